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


def receivers(folder):
    """Pixel of each receiver, and whether it is on the back."""
    words = channels(os.path.join(folder, "receivers.exr"))["pixel"].ravel()
    words = words[: json.load(open(os.path.join(folder, "set.json")))["receivers"]]
    return words & 0x7FFFFFFF, words >> 31 == 1


def relight(scene, folder, *options, frame=0):
    """E of a frame at receivers, N x 3, and the width of the atlas."""
    with tempfile.TemporaryDirectory() as temporary:
        command = [os.environ.get("REPROBE", "reprobe"), "relight", scene, "--probes", folder, "-o", temporary, "--quiet", *options]
        subprocess.run(command, check=True)
        file = os.path.join(temporary, f"{frame:04d}.exr")
        return irradiance(file, *receivers(folder)), channels(file)["irradiance.R"].shape[1]


def clusters(folder):
    """Of each cluster its receivers, and its numbers of probes and of coefficients."""
    for name in sorted(n for n in os.listdir(folder) if n[0].isdigit() and n.endswith(".exr")):
        index = channels(os.path.join(folder, name))["index"].ravel().astype(int)
        at = 1
        for _ in range(index[0]):
            count, probes, rank = index[at : at + 3]
            yield index[at + 3 : at + 3 + count], probes, rank
            at += 3 + count + probes


def described(folder):
    """set.json, the probes that take part, and half floats of the operator."""
    bake = json.load(open(os.path.join(folder, "set.json")))
    params, places = bake["bake"], bake["places"]
    numbers, terms = (4 if params["receiver"] == "sh1" else 1, (params["sh_order"] + 1) ** 2)
    halves = sum(rank * (probes * terms + len(members) * numbers) for members, probes, rank in clusters(folder))
    return bake, len(places["positions"]) - len(places.get("blocked", [])), halves


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
        samples = f"map_samples={args.samples}"
        direct, _ = relight(args.scene, folder, "--set", samples, "--set", "bounces=0")
        found, _ = relight(args.scene, folder, "--set", samples, "--set", f"bounces={args.bounces}")
        pixels, back = receivers(folder)
        straight = irradiance(args.direct, pixels, back) if args.direct else direct
        indirect = irradiance(args.reference, pixels, back) - straight
        squares = ((found - direct - indirect) ** 2).sum(-1)
        size = (indirect**2).sum(-1).mean()
        kept = np.sort(squares)[: int(0.99 * len(squares))]
        bake, probes, halves = described(folder)
        mean = (found - direct).mean() / indirect.mean() - 1
        print(f"{probes:6d} {bake['bake']['sh_order']:5d} {bake['radius']:6.2f} {len(pixels):9d} {2e-6 * halves:7.2f}  "
              f"{np.sqrt(squares.mean() / size):.4f}   {np.sqrt(kept.mean() / size):.4f}  {mean:+.4f}   {bake['bake']['interpolation']}", flush=True)


if __name__ == "__main__":
    main()
