#!/usr/bin/env python3
"""Light maps by radiance probes against a path-traced one, texel by texel.

    python3 scripts/transport_vs_lightmap.py SCENE --reference lightmap.exr [--direct direct.exr] [--bounces 12] [--samples 64] TRANSPORT...

Each TRANSPORT is a folder that `bake-transport` wrote, the reference what `bake-lightmap` wrote with the same --texels or --texel. Each is
lit by `reprobe relight` (into a temporary folder). Columns: probes, order, radius of support, receivers, MB of the operator as half floats;
RMS error of indirect irradiance, relative to the RMS of indirect irradiance itself, the same without the worst 1 % of the texels, and the
difference of the means. Indirect is what the reference has over direct light, which both have from the same code; or with --direct, over a light
map of the same scene with black surfaces (`diffuse_scene.py --reflectance 0`): a receiver has direct light at four of its points alone, which
differs from a texel's mean at the edges of hard shadows.

Needs reprobe in the PATH (or REPROBE), and pip install OpenEXR numpy.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

try:
    import OpenEXR
except ImportError as error:
    sys.exit(f"transport_vs_lightmap: error: {error}; install it with: pip install OpenEXR")


def channels(path):
    return {name: c.pixels for name, c in OpenEXR.File(path, separate_channels=True).channels().items()}


def irradiance(path, pixels, back):
    """E at receivers, N x 3."""
    image = channels(path)
    sides = [np.stack([image[f"{layer}.{c}"].astype(float).ravel() for c in "RGB"], -1) if f"{layer}.R" in image else None
             for layer in ("irradiance", "back")]
    result = sides[0][pixels]
    if sides[1] is not None:
        result = np.where(back[:, None], sides[1][pixels], result)
    else:
        result[back] = 0
    return result


def relight(args, folder, *more):
    with tempfile.TemporaryDirectory() as temporary:
        command = [os.environ.get("REPROBE", "reprobe"), "relight", args.scene, "--probes", folder, "-o", temporary, "--quiet",
                   "--set", f"map_samples={args.samples}", *more]
        subprocess.run(command, check=True)
        pixel = channels(os.path.join(folder, "receivers.exr"))["pixel"].ravel()
        count = json.load(open(os.path.join(folder, "set.json")))["receivers"]
        pixels, back = pixel[:count] & 0x7FFFFFFF, pixel[:count] >> 31 == 1
        return irradiance(os.path.join(temporary, "0000.exr"), pixels, back), pixels, back


def halves(folder):
    """Half floats of the operator."""
    total = 0
    for name in sorted(os.listdir(folder)):
        if name[0].isdigit() and name.endswith(".exr"):
            index = channels(os.path.join(folder, name))["index"].ravel()
            at, (bake, terms) = 1, halves.bake
            for _ in range(index[0]):
                receivers, probes, rank = (int(n) for n in index[at : at + 3])
                total += rank * (probes * terms + receivers * bake)
                at += 3 + receivers + probes
    return total


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--reference", required=True)
    parser.add_argument("--direct")
    parser.add_argument("--bounces", type=int, default=12)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("transport", nargs="+")
    args = parser.parse_args()
    print("probes order radius receivers      MB     RMS  trimmed    mean   interpolation")
    for folder in args.transport:
        direct, pixels, back = relight(args, folder, "--set", "bounces=0")
        found, _, _ = relight(args, folder, "--set", f"bounces={args.bounces}")
        straight = irradiance(args.direct, pixels, back) if args.direct else direct
        indirect = irradiance(args.reference, pixels, back) - straight
        squares = ((found - direct - indirect) ** 2).sum(-1)
        size = (indirect**2).sum(-1).mean()
        kept = np.sort(squares)[: int(0.99 * len(squares))]
        bake = json.load(open(os.path.join(folder, "set.json")))
        params, places = bake["bake"], bake["places"]
        halves.bake = (4 if params["receiver"] == "sh1" else 1, (params["sh_order"] + 1) ** 2)
        probes = len(places["positions"]) - len(places.get("blocked", []))
        mean = (found - direct).mean() / indirect.mean() - 1
        print(f"{probes:6d} {params['sh_order']:5d} {bake['radius']:6.2f} {len(pixels):9d} {2e-6 * halves(folder):7.2f}  "
              f"{np.sqrt(squares.mean() / size):.4f}   {np.sqrt(kept.mean() / size):.4f}  {mean:+.4f}   {params['interpolation']}", flush=True)


if __name__ == "__main__":
    main()
