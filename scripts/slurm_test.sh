#!/usr/bin/env bash
# Bakes scenes/room by scripts/Snakefile twice, on this machine alone and on a Slurm cluster of two nodes, one of which dies in mid-bake, and
# compares all EXR and JSON files that come of it. Not run by CI: some ten minutes on two cores.
#
#   PATH=$PWD/target/release:$PATH scripts/slurm_test.sh WORK [snakemake|slurm]
#
# WORK is a folder for the cluster's state, outputs and logs. The dead node's jobs are submitted again by Snakemake (--retries), or requeued by
# Slurm. Needs what scripts/slurm_on_one_machine.sh names, and pip install snakemake snakemake-executor-plugin-slurm. SPP sets how long the bake
# of probes takes. Prints jobs, what ran twice, and what differs; exit code 1 where a file differs, or where no job ran twice.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(dirname "$here")
again=${2:-snakemake}
case $#$again in 1snakemake | 2snakemake | 2slurm) ;; *) sed -n '2,9s/^# \?//p' "$0"; exit 2 ;; esac
mkdir -p "$1"
work=$(cd "$1" && pwd)
: "${SPP:=512}"
cluster="$here/slurm_on_one_machine.sh"
say() { echo "$(date +%T) $*"; }
give_up() {
    tail -20 "$work/$1.log"
    exit 1
}

cat >"$work/workflow.yaml" <<END
reprobe: $(command -v reprobe)
scenes:
  room: {scene: $root/scenes/room/scene.xml, path: $root/scenes/room/path.json, frames: 3}
size: 160x90
supersample: 1
all_texels: true
options: {bake-probes: --spp $SPP, bake-lightmap: --spp 16 --first-spp 4 --texels 50000 --denoise, reference: --spp 16}
shards: {bake-lightmap: 2, bake-probes: 5}
threads: 1
END
# A run has a folder of its own: outputs below out/, and what Snakemake remembers.
workflow() {
    local folder=$1
    shift
    mkdir -p "$work/$folder"
    snakemake -s "$here/Snakefile" --configfile "$work/workflow.yaml" --directory "$work/$folder" "$@" >>"$work/$folder.log" 2>&1
}

rm -rf "$work"/{alone,farm}{,.log}
say "on this machine alone"
workflow alone --cores 2 || give_up alone

say "on two nodes"
"$cluster" start "$work/slurm" >/dev/null
trap '"$cluster" stop "$work/slurm"' EXIT
# shellcheck disable=SC1091
. "$work/slurm/environment"
since=$(date +%FT%T)
farm=(farm --executor slurm --jobs 4 --retries 2 --latency-wait 30 --default-resources mem_mb=1000 runtime=60)
farm+=(--slurm-init-seconds-before-status-checks 5 --slurm-status-command sacct)
case $again in
snakemake) farm+=(--slurm-no-requeue) ;;
slurm) farm+=(--slurm-requeue) ;;
esac
workflow "${farm[@]}" &
snakemake=$!

# A process and all that came of it.
tree() {
    local child
    echo "$1"
    for child in $(pgrep -P "$1"); do tree "$child"; done
}
# Jobs of a node that bake probes.
baking() { squeue -h -t R -w "$1" -o '%A %k' | awk '/probes_shard/ { print $1 }'; }
finished() { find "$work/farm/out/room/probes" -name '????.exr' 2>/dev/null | wc -l; }
until [ -n "$(baking node1)" ] && [ -n "$(baking node2)" ] && [ "$(finished)" -ge 2 ]; do
    kill -0 $snakemake 2>/dev/null || { echo "the workflow ended before a node could be killed; SPP=$SPP"; give_up farm; }
    sleep 1
done
jobs=$(baking node2 | tr '\n' ' ')
pids=$(tree "$(cat "$work/slurm/slurmd.node2.pid")")
for job in $(squeue -h -w node2 -o %A); do
    for step in $(pgrep -f "^slurmstepd: \[$job\."); do pids+=" $(tree "$step")"; done
done
# shellcheck disable=SC2086
kill -9 $pids
say "node2 killed with its jobs $jobs- $(finished) probes were finished"
if ! wait $snakemake; then
    # The executor (2.8.0) excludes the node of a job that waits for its second run from all later jobs, by the name of "None assigned": these
    # cannot be submitted then. Called again, Snakemake goes on where it stopped.
    if [ "$again" != slurm ] || ! grep -q 'exclude=None assigned' "$work/farm.log"; then give_up farm; fi
    say "called again"
    workflow "${farm[@]}" || give_up farm
fi
say "done"

# -D: all runs of a job.
sacct -X -D -n -P -S "$since" -o JobID,State,NodeList,Elapsed,Comment >"$work/sacct.txt"
lost=$(grep -c NODE_FAIL "$work/sacct.txt" || true)
twice=$(cut -d'|' -f1 "$work/sacct.txt" | sort | uniq -d | wc -l)
echo "jobs: $(cut -d'|' -f1 "$work/sacct.txt" | sort -u | wc -l); lost with their node: $lost"
case $again in
snakemake) echo "submitted again by Snakemake: $(grep -c 'Trying to restart job' "$work/farm.log" || true)" ;;
slurm) echo "requeued by Slurm: $twice" ;;
esac
for job in $jobs; do grep "^$job|" "$work/sacct.txt"; done

compared=0 differing=0
while read -r file; do
    compared=$((compared + 1))
    cmp "$work/alone/out/$file" "$work/farm/out/$file" || differing=$((differing + 1))
done < <(for run in alone farm; do (cd "$work/$run/out" && find . -name '*.exr' -o -name '*.json'); done | grep -v timings.json | sort -u)
echo "files compared: $compared, differing: $differing"
[ "$differing" = 0 ] && [ "$lost" -gt 0 ]
