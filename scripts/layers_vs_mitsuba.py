#!/usr/bin/env python3
"""Same light as Mitsuba? Path-traced layers of `reprobe` against those of Mitsuba 3, judged by Mitsuba's own noise.

    python3 scripts/layers_vs_mitsuba.py SCENE... --reprobe target/release/reprobe -o DIR [--spp 64] [--size 320x180]

Each scene is rendered by Mitsuba with two seeds and by reprobe, all at the same samples a pixel and without a limit on
depth. Radiance is capped at the 99.5th percentile of Mitsuba's first image, so that fireflies do not decide. A layer passes
if RMSE(reprobe, Mitsuba 1) <= 1.1 x RMSE(Mitsuba 1, Mitsuba 2) and the means of the capped images agree within 0.5 %.
Exits with 1 where a layer does not. Finished renders in DIR are kept.

Needs what mitsuba_reference.py needs, and numpy.
"""

import argparse
import os
import subprocess
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from mitsuba_reference import import_mitsuba, scene_name

LAYERS = ("full", "glossy", "diffuse")
MAX_RMSE_RATIO = 1.1
MAX_MEAN_DIFFERENCE = 0.005
CAP_PERCENTILE = 99.5


def read_layers(mi, path, layers=LAYERS):
    """Layer name to an array of height x width x 3."""
    bitmap = mi.Bitmap(path)
    channels = {bitmap.struct_()[i].name: i for i in range(bitmap.channel_count())}
    pixels = np.array(bitmap, dtype=np.float64)
    pick = lambda layer: pixels[:, :, [channels[c if layer == "full" else f"{layer}.{c}"] for c in "RGB"]]
    return {layer: pick(layer) for layer in layers}


def render(command, output):
    """Runs a renderer unless its frame is there; returns the frame's path."""
    frame = os.path.join(output, "0000.exr")
    if not os.path.exists(frame):
        subprocess.run([*command, "-o", output], check=True, stdout=subprocess.DEVNULL)
    return frame


def compare(ours, first, second):
    """RMSE against Mitsuba, Mitsuba's own, and the relative difference of means, capped."""
    cap = np.percentile(first, CAP_PERCENTILE)
    ours, first, second = (np.minimum(x, cap) for x in (ours, first, second))
    rmse = lambda a, b: float(np.sqrt(np.mean((a - b) ** 2)))
    reference_mean = (first.mean() + second.mean()) / 2
    return rmse(ours, first), rmse(first, second), float(ours.mean() / reference_mean - 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--reprobe", default="target/release/reprobe")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--spp", default="64")
    parser.add_argument("--size", default="320x180")
    args = parser.parse_args()

    mi = import_mitsuba("llvm_ad_rgb")
    here = os.path.dirname(os.path.abspath(__file__))
    sampling = ["--spp", args.spp, "--size", args.size, "--max-depth"]
    print(f"{'scene':32} {'layer':8} {'ours':>9} {'Mitsuba':>9} {'ratio':>6} {'mean':>8}")
    passed = True
    for scene in args.scenes:
        name = scene_name(scene)
        folder = lambda what: os.path.join(args.output, f"{name}-{args.size}-{args.spp}", what)
        script = [sys.executable, os.path.join(here, "mitsuba_reference.py"), scene, *sampling, "-1"]
        frames = [render([*script, "--seed", str(k), "--layers", ",".join([*LAYERS, "emission"])], folder(f"mitsuba-{k}")) for k in (1, 2)]
        own = [args.reprobe, "render-path", scene, "--method", "path-trace", "--quiet", "--seed", "1", *sampling[:-1]]
        frames.append(render(own, folder("reprobe")))
        first, second, ours = (read_layers(mi, f) for f in frames)
        for layer in LAYERS:
            error, noise, mean = compare(ours[layer], first[layer], second[layer])
            good = error <= MAX_RMSE_RATIO * noise and abs(mean) <= MAX_MEAN_DIFFERENCE
            passed &= good
            verdict = "" if good else "  FAILED"
            print(f"{name:32} {layer:8} {error:9.5f} {noise:9.5f} {error / noise:6.3f} {100 * mean:+7.2f}%{verdict}", flush=True)
    sys.exit(0 if passed else 1)


if __name__ == "__main__":
    main()
