#!/usr/bin/env python3
"""The most memory that each stage takes on a scene, at two or three sizes each.

    python3 scripts/measure_memory.py kitchen/scene_opaque.xml --path scenes/paths/kitchen.json -o work/ --reprobe target/release/reprobe

Peak resident set of the process, as the kernel counts it, and what one stage writes is what the next one reads. Samples are few, to
save time. What grows with a size is told per unit, between the two largest sizes: below, what every stage has, the scene, may be more.
"""

import argparse
import os
import pathlib
import subprocess
import sys
import time


def peak(command):
    """Bytes at the most, and seconds."""
    start = time.monotonic()
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = process.stderr.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{' '.join(map(str, command))}: {said}")
    return usage.ru_maxrss * 1024, time.monotonic() - start


def stages(scene, path, out):
    """Name, unit, and the commands at growing sizes with their number of units."""
    o = lambda name: out / name
    view = ["--path", path, "--frames", 0]
    size = lambda w, h: ["--size", f"{w}x{h}"]
    frames = [((320, 180), "s"), ((640, 360), "m"), ((1280, 720), "l")]
    few, many = o("p8.json"), o("p64.json")
    yield "place-probes", "probe", [(n, ["place-probes", scene, "--path", path, "--count", n, "-o", o(f"p{n}.json")]) for n in [8, 64]]
    yield "place-probes --method voxel", "probe", [
        (n, ["place-probes", scene, "--path", path, "--method", "voxel", "--count", n, "-o", o(f"v{n}.json")]) for n in [16, 64]
    ]
    yield "curvature", "", [(0, ["curvature", scene, "-o", o("curvature.exr")])]
    yield "resmap", "texel", [
        (w * w // 2, ["resmap", scene, "--probes", few, *size(w, w // 2), "-o", o(f"resmap{w}")]) for w in [256, 512]
    ]
    yield "qhmap", "texel", [(w * w // 2, ["qhmap", o("resmap256"), *size(w, w // 2), "-o", o(f"qhmap{w}")]) for w in [256, 512, 1024]]
    yield "bake-lightmap --denoise", "texel", [
        (n, ["bake-lightmap", scene, "--texels", n, "--spp", 2, "--first-spp", 1, "--denoise", "-o", o(f"lightmap{n}.exr")])
        for n in [50_000, 200_000, 800_000]
    ]
    light = ["--lightmap", o("lightmap200000.exr")]
    yield "bake-probes", "texel", [
        (w * w // 2, ["bake-probes", scene, "--probes", few, "--qhmap", o(f"qhmap{w}"), *light, "--spp", 1, "-o", o(f"probes{w}")])
        for w in [256, 512, 1024]
    ]
    yield "bake-lightfield, 8 probes", "texel", [
        (8 * w * w, ["bake-lightfield", scene, "--probes", few, *size1(w), "--spp", 1, "-o", o(f"lightfield{w}")]) for w in [128, 256, 512]
    ]
    yield "bake-transport", "receiver", [
        (n, ["bake-transport", scene, "--probes", o("v64.json"), "--texels", n, "-o", o(f"transport{n}")]) for n in [4000, 16000]
    ]
    for w in [256, 512, 1024]:
        yield f"render-path, 8 probes of {w}x{w // 2}", "pixel", [
            (x * y, ["render-path", scene, *view, *size(x, y), "--probes", o(f"probes{w}"), *light, "--curvature", o("curvature.exr"), "-o", o(f"f{w}{s}")])
            for (x, y), s in frames
        ]
    others = [
        ("path-trace", ["--spp", 1]),
        ("lightmap-rt", light),
        ("many-light", []),
        ("light-field-probes", ["--probes", o("lightfield256")]),
        ("radiance-probes", ["--probes", o("transport4000")]),
    ]
    for method, words in others:
        yield f"render-path --method {method}", "pixel", [
            (x * y, ["render-path", scene, *view, *size(x, y), "--method", method, *words, "-o", o(f"{method}{s}")]) for (x, y), s in frames
        ]
    yield "compare", "pixel", [(x * y, ["compare", o(f"path-trace{s}"), o(f"lightmap-rt{s}"), "-o", o(f"report{s}")]) for (x, y), s in frames]
    yield "view", "pixel", [(x * y, ["view", o(f"path-trace{s}/0000.exr"), "-o", o(f"view{s}.png")]) for (x, y), s in frames]
    yield "export-gltf", "texel", [
        (n, ["export-gltf", scene, "--lightmap", o(f"lightmap{n}.exr"), "-o", o(f"scene{n}.glb")]) for n in [50_000, 800_000]
    ]
    yield "export-probes", "texel", [(w * w, ["export-probes", o(f"lightfield{w}"), "-o", o(f"engine{w}")]) for w in [128, 512]]


def size1(w):
    return ["--size", w]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("--path", type=pathlib.Path, required=True)
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--reprobe", default="reprobe")
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    loaded, _ = peak([args.reprobe, "info", args.scene])
    print(f"the scene alone (info): {loaded / 1e6:.0f} MB\n\n| stage | MB | of units | bytes a unit |\n|---|---|---|---|", flush=True)
    for name, unit, runs in stages(args.scene, args.path, args.output):
        found = [(n, *peak([args.reprobe, *words, "--threads", args.threads, "--device", "cpu"] if words[0] in DEVICE else [args.reprobe, *words])) for n, words in runs]
        slope = (found[-1][1] - found[-2][1]) / (found[-1][0] - found[-2][0]) if len(found) > 1 else 0
        megabytes = ", ".join(f"{bytes / 1e6:.0f}" for _, bytes, _ in found)
        units = ", ".join(f"{n:,}" for n, *_ in found) + f" {unit}s" if unit else ""
        print(f"| `{name}` | {megabytes} | {units} | {slope:.0f} |", flush=True)


DEVICE = ("resmap", "bake-lightmap", "bake-probes", "bake-lightfield", "render-path", "bake-transport")
main()
