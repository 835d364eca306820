#!/usr/bin/env python3
"""Path tracing, `reprobe` against Mitsuba 3: samples a second, and time to equal error.

    python3 scripts/bench_vs_mitsuba.py SCENE... --reprobe target/release/reprobe -o DIR [--runs 5] [--spp 32] [--size 320x180]

Both render the full image of the same scene and camera, at the same size, samples a pixel and depth (no limit; roulette as
each has it), on all cores, in turn: reprobe, Mitsuba, reprobe, ... with a new seed each time. Loading and Mitsuba's compilation of its
kernels are left out. The error is the relative MSE, mean of (x - r)^2 / (r^2 + 0.01), against a converged image r by
Mitsuba (--reference-spp, kept in DIR), without the 0.1 % of the pixels that are worst, in which fireflies would decide; what
the reference's own noise adds is taken off. Monte Carlo error falls as one over time, so the time to equal error is time times error.

Columns: million samples a second of each, ratio (reprobe / Mitsuba, higher is better), relative MSE of each, and the ratio of
times to equal error (reprobe / Mitsuba, lower is better). Ratios are medians over the runs, with the least and the greatest.

Needs what mitsuba_reference.py needs. results.json in DIR has every run.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from layers_vs_mitsuba import read_layers
from mitsuba_reference import import_mitsuba, load_scene, scene_name, sensors

OFFSET = 0.01
TRIMMED = 0.001


class Mitsuba:
    """A scene in Mitsuba, compiled and warm."""

    def __init__(self, mi, path, size, spp):
        self.mi, self.spp = mi, spp
        self.scene = load_scene(mi, path)
        self.sensor = sensors(mi, self.scene, None, size)[0]
        self.integrator = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})
        self.render(0)

    def render(self, seed, spp=None):
        """Image and seconds."""
        began = time.perf_counter()
        image = np.array(self.mi.render(self.scene, sensor=self.sensor, integrator=self.integrator, spp=spp or self.spp, seed=seed))
        return image[:, :, :3].astype(np.float64), time.perf_counter() - began


def reprobe(mi, args, scene, seed):
    """Image and seconds."""
    with tempfile.TemporaryDirectory() as folder:
        command = [args.reprobe, "render-path", scene, "-o", folder, "--method", "path-trace", "--layers", args.layers]
        command += ["--spp", str(args.spp), "--size", args.size, "--seed", str(seed), "--json"]
        figures = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
        image = read_layers(mi, os.path.join(folder, "0000.exr"), ["full"])["full"]
        return image, figures["mean_ms"]["path_trace"] / 1e3


def reference(renderer, path, spp):
    """The mean of `spp` samples a pixel and the relative squared error that its noise adds, a pixel each; kept in `path`."""
    if not os.path.exists(path):
        halves, per_pass = [], 128
        for half in range(2):
            passes = max(1, spp // (2 * per_pass))
            halves.append(sum(renderer.render(10**6 + half * passes + k, per_pass)[0] for k in range(passes)) / passes)
        with open(path + ".tmp", "wb") as file:
            np.save(file, np.stack(halves))
        os.replace(path + ".tmp", path)
    first, second = np.load(path)
    mean = (first + second) / 2
    return mean, ((first - second) / 2) ** 2 / (mean**2 + OFFSET)


def error(image, mean, noise):
    """Trimmed relative MSE."""
    squares = (((image - mean) ** 2) / (mean**2 + OFFSET)).mean(axis=2).ravel()
    kept = np.argsort(squares)[: int(round(len(squares) * (1 - TRIMMED)))]
    return squares[kept].mean() - noise.mean(axis=2).ravel()[kept].mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--reprobe", default="target/release/reprobe")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--layers", default="full", choices=["full", "all"], help="reprobe's: one path a sample, or one a layer")
    parser.add_argument("--reference-spp", type=int, default=2048)
    args = parser.parse_args()
    os.makedirs(args.output, exist_ok=True)
    size = [int(x) for x in args.size.split("x")]
    samples = size[0] * size[1] * args.spp / 1e6

    mi = import_mitsuba("llvm_ad_rgb")
    results = {}
    print(f"{'scene':28} {'ours M/s':>9} {'Mitsuba':>8} {'ratio':>22} {'ours relMSE':>12} {'Mitsuba':>9} {'time to equal error':>24}")
    for scene in args.scenes:
        name = scene_name(scene)
        renderer = Mitsuba(mi, scene, size, args.spp)
        stored = os.path.join(args.output, f"{name}-{args.size}-{args.reference_spp}.npy")
        mean, noise = reference(renderer, stored, args.reference_spp)
        rows = []
        for run in range(args.runs):
            (ours, our_time), (theirs, their_time) = reprobe(mi, args, scene, run + 1), renderer.render(run + 1)
            rows.append([our_time, their_time, error(ours, mean, noise), error(theirs, mean, noise)])
        ours, theirs, our_error, their_error = (np.array(x) for x in zip(*rows))
        results[name] = [dict(zip(("seconds", "mitsuba_seconds", "error", "mitsuba_error"), row)) for row in rows]
        spread = lambda r: f"{np.median(r):.2f} ({r.min():.2f} to {r.max():.2f})"
        print(
            f"{name:28} {samples / np.median(ours):9.2f} {samples / np.median(theirs):8.2f} {spread(theirs / ours):>22} "
            f"{np.median(our_error):12.5f} {np.median(their_error):9.5f} {spread(ours * our_error / (theirs * their_error)):>24}",
            flush=True,
        )
    with open(os.path.join(args.output, "results.json"), "w", encoding="utf-8") as file:
        json.dump({"arguments": vars(args), "runs": results}, file, indent=1)


if __name__ == "__main__":
    main()
