#!/usr/bin/env python3
"""Same light as Mitsuba? Path-traced layers of `reprobe` against those of Mitsuba 3, judged by the noise of both.

    python3 scripts/layers_vs_mitsuba.py SCENE... --reprobe target/release/reprobe -o DIR [--spp 64] [--size 320x180]

Each scene is rendered by either program with --renders seeds, all at the same samples a pixel and without a limit on depth. Columns:

    mean    reprobe's mean less Mitsuba's, and its standard error, in percent of Mitsuba's
    sigmas  the same in standard errors
    tiles   root mean square over squares of 15 x 15 pixels of such sigmas: 1 is noise alone, more is light in the wrong place
    noise   root mean square of reprobe's standard deviation over Mitsuba's, each pixel's capped at the 99.5th percentile of
            what the two have there on average: for the reader, no part of the verdict

A standard error is what a pixel's renders differ by, summed over the pixels, which are independent: thousands of degrees of
freedom from a few renders. Nothing is capped in what is judged: a cap takes more from the noisier of two images of one mean.
A firefly makes the standard error as wide as it moves the mean, and so raises no alarm.

FAILED where the means are further apart than 0.5 % and than 4 standard errors, or where tiles is 4 of its own standard deviations
(1 / sqrt(2 N) of N tiles) past 1. NOISY where the standard error is past 0.5 %, so that 3 % could go unseen: more --spp or
--renders tell. Exits with 1 for either. Finished renders in DIR are kept. --bias 1.03 multiplies reprobe's radiance first,
to see that the check would fail.

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
MAX_MEAN_DIFFERENCE = 0.005
MAX_SIGMAS = 4.0
MAX_STANDARD_ERROR = 0.005
TILE = 15
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


def tile_sums(image):
    """Sums over whole squares of TILE x TILE pixels; the rest at the right and below belongs to no square."""
    height, width = (max(n // TILE, 1) for n in image.shape)
    part = image[: height * TILE, : width * TILE]
    rows = np.add.reduceat(part, np.arange(0, part.shape[0], TILE), axis=0)
    return np.add.reduceat(rows, np.arange(0, part.shape[1], TILE), axis=1)


def compare(ours, theirs):
    """The row of a layer from renders x height x width x 3 of either program."""
    ours, theirs = (x.mean(axis=3) for x in (ours, theirs))
    variances = [x.var(axis=0, ddof=1) for x in (ours, theirs)]
    difference = ours.mean(axis=0) - theirs.mean(axis=0)
    variance = sum(variances) / len(ours)
    reference = theirs.mean(axis=0).sum()
    tiles, tile_variances = tile_sums(difference), tile_sums(variance)
    noisy = tile_variances > 0
    cap = np.percentile(sum(variances) / 2, CAP_PERCENTILE)
    noise = [np.minimum(v, cap).mean() for v in variances]
    mean, error = difference.sum(), np.sqrt(variance.sum())
    return {
        "mean": mean / reference if reference else 0.0,
        "error": error / reference if reference else 0.0,
        "sigmas": mean / error if error else 0.0,
        "tiles": np.sqrt(np.mean(tiles[noisy] ** 2 / tile_variances[noisy])) if noisy.any() else 1.0,
        "count": max(noisy.sum(), 1),
        "noise": np.sqrt(noise[0] / noise[1]) if noise[1] else 1.0,
    }


def verdict(row):
    """What is wrong with a row; values that are not numbers pass nothing."""
    means_agree = abs(row["mean"]) <= MAX_MEAN_DIFFERENCE or abs(row["sigmas"]) <= MAX_SIGMAS
    tiles_agree = row["tiles"] <= 1 + MAX_SIGMAS / np.sqrt(2 * row["count"])
    if not (means_agree and tiles_agree):
        return "FAILED"
    return "" if row["error"] <= MAX_STANDARD_ERROR else "NOISY"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--reprobe", default="target/release/reprobe")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--spp", default="64")
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--renders", type=int, default=4, help="of either program, at least 2")
    parser.add_argument("--bias", type=float, default=1.0)
    args = parser.parse_args()
    if args.renders < 2:
        parser.error("--renders: one render does not tell its noise")

    mi = import_mitsuba("llvm_ad_rgb")
    here = os.path.dirname(os.path.abspath(__file__))
    sampling = ["--spp", args.spp, "--size", args.size]
    print(f"{'scene':32} {'layer':8} {'mean':>8} {'':9} {'sigmas':>6} {'tiles':>6} {'noise':>6}")
    passed = True
    for scene in args.scenes:
        name = scene_name(scene)
        folder = lambda what: os.path.join(args.output, f"{name}-{args.size}-{args.spp}", what)
        script = [sys.executable, os.path.join(here, "mitsuba_reference.py"), scene, *sampling, "--max-depth", "-1"]
        script += ["--layers", ",".join([*LAYERS, "emission"])]
        own = [args.reprobe, "render-path", scene, "--method", "path-trace", "--quiet", *sampling, "--max-depth", "4294967295"]
        frames = lambda what, command: [
            read_layers(mi, render([*command, "--seed", str(k)], folder(f"{what}-{k}"))) for k in range(1, args.renders + 1)
        ]
        theirs, ours = frames("mitsuba", script), frames("reprobe", own)
        for layer in LAYERS:
            row = compare(args.bias * np.stack([f[layer] for f in ours]), np.stack([f[layer] for f in theirs]))
            passed &= not verdict(row)
            mean = f"{100 * row['mean']:+7.2f}% ± {100 * row['error']:5.2f}%"
            print(f"{name:32} {layer:8} {mean} {row['sigmas']:+6.1f} {row['tiles']:6.2f} {row['noise']:6.2f}  {verdict(row)}", flush=True)
    sys.exit(0 if passed else 1)


if __name__ == "__main__":
    main()
