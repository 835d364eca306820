#!/bin/sh
# Times bakes and frames on a GPU and prints the paper's Tables 2 and 3, next to the bars that this project sets itself.
#
#   scripts/bench_gpu.sh REPROBE SCENE.xml PATH.json OUT [DEVICE]
#
# Needs the release binary and a scene, nothing else. OUT is made anew where it holds nothing, and taken up again where it does. The sizes are
# the paper's; smaller ones, for a trial on a software adapter:
#
#   GRID=2x2x2 TEXELS=64x32 LIGHT_TEXELS=20000 SIZE=96x54 SPP=4 FRAMES=0-1 scripts/bench_gpu.sh target/release/reprobe scenes/room/scene.xml \
#       scenes/room/path.json bench/ gpu:llvmpipe
set -eu

if [ $# -lt 4 ]; then
    sed -n '2,11p' "$0"
    exit 2
fi
reprobe=$1 scene=$2 path=$3 out=$4 device=${5:-gpu}
: "${GRID:=7x6x6}" "${TEXELS:=1024x512}" "${LIGHT_TEXELS:=1000000}" "${SIZE:=1920x1080}" "${SPP:=2048}" "${FRAMES:=0-11}" "${CPU_SPP:=4}"
mkdir -p "$out"

# A number of a JSON line, by its name: the last of that name.
number() { sed -n "s/.*\"$1\":\([0-9.eE+-]*\).*/\1/p" | tail -1; }
text() { sed -n "s/.*\"$1\":\"\([^\"]*\)\".*/\1/p" | tail -1; }
calc() { awk "BEGIN { printf \"$1\", $2 }"; }
stage() {
    name=$1
    shift
    echo "$name ..." >&2
    "$reprobe" "$@" --json >"$out/$name.json"
}

"$reprobe" devices --json >"$out/devices.json"
stage place place-probes "$scene" --path "$path" --grid "$GRID" -o "$out/probes.json"
stage resmap resmap "$scene" --probes "$out/probes.json" -o "$out/resmap" --device "$device"
stage qhmap qhmap "$out/resmap" --size "$TEXELS" -o "$out/qhmap"
stage curvature curvature "$scene" -o "$out/curvature.exr"
stage lightmap bake-lightmap "$scene" -o "$out/lightmap.exr" --texels "$LIGHT_TEXELS" --spp "$SPP" --device "$device"
# One probe of all in full, then what the frames need, quickly: a frame takes as long whatever its probes hold.
stage probe bake-probes "$scene" --probes "$out/probes.json" --qhmap "$out/qhmap" -o "$out/one" --spp "$SPP" \
    --lightmap "$out/lightmap.exr" --shard 0/1000000 --device "$device"
stage probe_full bake-probes "$scene" --probes "$out/probes.json" --qhmap "$out/qhmap" -o "$out/one_full" --spp "$SPP" \
    --shard 0/1000000 --device "$device"
stage needed bake-probes "$scene" --probes "$out/probes.json" --qhmap "$out/qhmap" -o "$out/probes" --spp 4 \
    --lightmap "$out/lightmap.exr" --for-path "$path" --curvature "$out/curvature.exr" --size "$SIZE" --frames "$FRAMES" --device "$device"
render() {
    name=$1
    shift
    rm -rf "$out/$name"
    stage "$name" render-path "$scene" --path "$path" --size "$SIZE" -o "$out/$name" "$@"
}
inputs="--probes $out/probes --lightmap $out/lightmap.exr --curvature $out/curvature.exr --frames $FRAMES"
# shellcheck disable=SC2086
render frames $inputs --device "$device"
# shellcheck disable=SC2086
render frames_plain $inputs --set coverage.rays=0 --device "$device"
render traced --method path-trace --layers full --spp 64 --frames 0 --device "$device"
render traced_cpu --method path-trace --layers full --spp "$CPU_SPP" --frames 0 --device cpu

get() { number "$2" <"$out/$1.json"; }
pixels=$(echo "$SIZE" | tr x ' ' | awk '{ print $1 * $2 }')
probes=$(echo "$GRID" | tr x ' ' | awk '{ print $1 * $2 * $3 }')

echo
echo "$(text device <"$out/frames.json"), $(basename "$(dirname "$scene")"), $probes probes of $TEXELS, $SPP samples a texel, frames of $SIZE"
echo
echo "| bake | measured | bar |"
echo "|---|---|---|"
printf '| resolution maps, all probes | %.1f s | |\n' "$(get resmap seconds)"
printf '| parameterisations (CPU) | %.1f s | |\n' "$(get qhmap seconds)"
printf '| light map, %s texels | %.1f s | 300 s |\n' "$(get lightmap texels)" "$(get lightmap seconds)"
for kind in probe probe_full; do
    paths=$(get $kind paths) seconds=$(get $kind seconds)
    label="reading the light map"
    [ $kind = probe ] || label="traced in full"
    printf '| probes, %s: one | %.2f s, %s million paths a second | |\n' "$label" "$seconds" "$(calc %.1f "$paths / $seconds / 1e6")"
    printf '| probes, %s: all, by that one | %s min | 20 min |\n' "$label" "$(calc %.1f "$seconds * $probes / 60")"
done
echo
echo "| pass, ms a frame | with coverage | without | bar |"
echo "|---|---|---|---|"
for pass in gbuffer mirror gather footprint filter composite coverage load read; do
    bar=
    case $pass in gather) bar=3 ;; filter | mirror) bar=1.5 ;; esac
    with=$(sed 's/.*"mean_ms"//' "$out/frames.json" | number $pass) without=$(sed 's/.*"mean_ms"//' "$out/frames_plain.json" | number $pass)
    [ -z "$with$without" ] || printf '| %s | %.2f | %.2f | %s |\n' $pass "${with:-0}" "${without:-0}" "$bar"
done
printf '| probes on the device, most | %s MB | | |\n' "$(calc %.0f "$(get frames gpu_probe_memory_bytes) / 1e6")"
echo
gpu=$(calc %.2f "$pixels * 64 / $(get traced path_trace) / 1e3") cpu=$(calc %.2f "$pixels * $CPU_SPP / $(get traced_cpu path_trace) / 1e3")
echo "Path tracing: $gpu million samples a second on the GPU, $cpu on the CPU: $(calc %.1f "$gpu / $cpu") times (bar: 40 times 2 cores)"
