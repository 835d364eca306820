#!/usr/bin/env python3
"""Baked probes against Mitsuba 3: the glossy layer along the rays of one probe's texels.

    python3 scripts/probes_vs_mitsuba.py SCENE --probes probes.json --index 3 -o reference/ [--spp 1024] BAKE...

Each BAKE is a folder that `bake-probes --roughness-scale 1` wrote, with whatever other options are to be judged; all of the same qhmap.
Mitsuba traces the same rays (from the probe through the centres of the texels that have a glossy reflector) with the scene's
materials as they are. Radiance is capped at the 99.5th percentile of Mitsuba's.

Columns: relative MSE, mean of (x - r)^2 / (r^2 + 0.01), and the same without the worst 1 % of the texels, less what the reference's own noise adds;
difference of the means; median and 99th percentile of the differences of means over squares of 8 x 8 texels. The line
"Mitsuba" compares two halves of the reference: the noise in the others' percentiles.

Needs what mitsuba_reference.py needs, and pip install OpenEXR. The reference is kept in the -o folder.
"""

import argparse
import json
import os
import sys

import numpy as np

try:
    import OpenEXR
except ImportError as error:
    sys.exit(f"probes_vs_mitsuba: error: {error}; install it with: pip install OpenEXR")

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from bench_vs_mitsuba import OFFSET
from layers_vs_mitsuba import CAP_PERCENTILE
from mitsuba_reference import import_mitsuba, load_scene, scene_name

SQUARE = 8
PER_PASS = 32


def read(path):
    """Channels of an EXR by name. (Mitsuba would read all in one type, half floats, which is too little for directions.)"""
    channels = OpenEXR.File(path, separate_channels=True).channels()
    return {name: channel.pixels.astype(np.float64) for name, channel in channels.items()}


def directions(channels):
    """Unit directions that the texels look along."""
    phi, theta = 2 * np.pi * channels["inverse.U"], np.pi * channels["inverse.V"]
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)


def reference(mi, scene, position, rays, spp):
    """Two independent means of spp / 2 samples of the glossy layer along each of the rays."""
    import first_vertex

    integrator = first_vertex.integrator("glossy", -1, 5)
    halves = np.zeros((2, len(rays), 3))
    passes = max(1, spp // (2 * PER_PASS))
    d = np.repeat(rays.astype(np.float32), PER_PASS, axis=0)
    for half in range(2):
        for k in range(passes):
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(half * passes + k, len(d))
            ray = mi.Ray3f(mi.Point3f(*position), mi.Vector3f(*d.T))
            color = np.array(integrator.sample(scene, sampler, ray)[0]).T
            color = np.where(np.isfinite(color), color, 0.0)
            halves[half] += color.reshape(len(rays), PER_PASS, 3).mean(axis=1) / passes
    return halves


def squares(image, mask):
    """Means over the squares that are at least half in the mask; NaN elsewhere."""
    height, width = (n // SQUARE * SQUARE for n in mask.shape)
    total = lambda x: x[:height, :width].reshape(height // SQUARE, SQUARE, width // SQUARE, SQUARE).sum(axis=(1, 3))
    count = total(mask.astype(float))
    return np.where(count >= SQUARE**2 / 2, total(image.mean(axis=2) * mask) / np.maximum(count, 1), np.nan)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("bakes", nargs="+")
    parser.add_argument("--probes", required=True, help="probes.json")
    parser.add_argument("--index", type=int, required=True)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--spp", type=int, default=1024)
    args = parser.parse_args()

    mi = import_mitsuba("llvm_ad_rgb")
    with open(args.probes, encoding="utf-8") as file:
        probes = json.load(file)
    position = probes.get("grid", probes)["positions"][args.index]
    baked = [read(os.path.join(folder, f"{args.index:04}.exr")) for folder in args.bakes]
    glossy = [np.stack([b[f"glossy.{c}"] for c in "RGB"], axis=-1) for b in baked]
    mask = np.any([g.sum(axis=2) > 0 for g in glossy], axis=0)
    if any(not np.array_equal(b["inverse.U"], baked[0]["inverse.U"]) for b in baked):
        sys.exit("the bakes have different parameterisations; bake them from one qhmap")

    stored = os.path.join(args.output, f"{scene_name(args.scene)}-{args.index:04}-{args.spp}.npy")
    if not os.path.exists(stored):
        os.makedirs(args.output, exist_ok=True)
        halves = reference(mi, load_scene(mi, args.scene), position, directions(baked[0])[mask], args.spp)
        np.save(stored + ".tmp.npy", halves)
        os.replace(stored + ".tmp.npy", stored)
    halves = np.load(stored)
    if halves.shape[1] != mask.sum():
        sys.exit(f"{stored} is for {halves.shape[1]} texels, these bakes have {mask.sum()}; delete it")
    cap = np.percentile(halves.mean(axis=0), CAP_PERCENTILE)
    halves = np.minimum(halves, cap)
    mean, noise = halves.mean(axis=0), (halves[0] - halves[1]) ** 2 / 4

    def image(values):
        out = np.zeros((*mask.shape, 3))
        out[mask] = values
        return out

    base = squares(image(mean), mask)
    valid = np.isfinite(base)
    floor = 0.02 * np.nanmean(base)
    print(f"{'':40} {'relMSE':>9} {'trimmed':>9} {'mean':>8} {'median':>8} {'99th':>8}")
    rows = [(os.path.basename(os.path.normpath(f)), np.minimum(g[mask], cap), mean, noise) for f, g in zip(args.bakes, glossy)]
    rows.append(("Mitsuba, half against half", halves[0], halves[1], 0 * noise))
    for name, ours, theirs, own in rows:
        errors = (((ours - theirs) ** 2 - own) / (theirs**2 + OFFSET)).mean(axis=1)
        trimmed = np.sort(errors)[: int(0.99 * len(errors))].mean()
        other = base if theirs is mean else squares(image(theirs), mask)
        off = np.abs(squares(image(ours), mask) - other)[valid] / np.maximum(other[valid], floor)
        difference = ours.mean() / theirs.mean() - 1
        print(f"{name:40} {errors.mean():9.5f} {trimmed:9.5f} {100 * difference:+7.2f}% {100 * np.median(off):7.2f}% {100 * np.percentile(off, 99):7.2f}%")


if __name__ == "__main__":
    main()
