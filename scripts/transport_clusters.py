#!/usr/bin/env python3
"""What the compression of radiance probes' transport costs, and whether its clusters show.

    python3 scripts/transport_clusters.py SCENE --uncompressed TRANSPORT [--lights LIGHTS.json --frame N] TRANSPORT...

Uncompressed is what `bake-transport --error 0 --most-terms 1024` wrote with the same probes and texels; the others are compressed. Each is
lit by `reprobe relight --indirect`. Columns: probes, receivers, clusters, their coefficients on average, stored numbers over those of a full
matrix of receivers and all receivers (the paper's effective sparsity); RMS difference of irradiance from the uncompressed one, relative to its
RMS; and steps: the mean difference of neighbouring texels of two clusters over that of the same texels without compression, divided by the
same for neighbours within clusters. 1 is no step.

Needs reprobe in the PATH (or REPROBE), and pip install OpenEXR numpy.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from transport_vs_lightmap import channels, irradiance


def receivers(folder):
    count = json.load(open(os.path.join(folder, "set.json")))["receivers"]
    words = channels(os.path.join(folder, "receivers.exr"))["pixel"].ravel()[:count]
    return words & 0x7FFFFFFF, words >> 31 == 1


def lit(args, folder):
    with tempfile.TemporaryDirectory() as temporary:
        lights = ["--lights", args.lights, "--frames", str(args.frame)] if args.lights else []
        subprocess.run([os.environ.get("REPROBE", "reprobe"), "relight", args.scene, "--probes", folder, "-o", temporary, "--quiet", "--indirect",
                        "--set", f"bounces={args.bounces}", "--set", "map_samples=16", *lights], check=True)
        return irradiance(os.path.join(temporary, f"{args.frame:04d}.exr"), *receivers(folder))


def clusters(folder):
    """Cluster of each receiver, coefficients of each cluster, and how many numbers are stored."""
    described = json.load(open(os.path.join(folder, "set.json")))
    terms = (described["bake"]["sh_order"] + 1) ** 2
    owner, ranks, stored = np.zeros(described["receivers"], int), [], 0
    for name in sorted(n for n in os.listdir(folder) if n[0].isdigit() and n.endswith(".exr")):
        index = channels(os.path.join(folder, name))["index"].ravel().astype(int)
        at = 1
        for _ in range(index[0]):
            count, probes, rank = index[at : at + 3]
            owner[index[at + 3 : at + 3 + count]] = len(ranks)
            ranks.append((count, rank))
            stored += rank * (count + probes * terms)
            at += 3 + count + probes
    return owner, np.array(ranks), stored


def neighbours(folder, width):
    """Pairs of receivers that lie beside each other in the atlas."""
    pixels, back = receivers(folder)
    place = {(int(p), bool(b)): i for i, (p, b) in enumerate(zip(pixels, back))}
    pairs = [(i, place[other]) for (p, b), i in place.items() for other in ((p + 1, b), (p + width, b)) if other in place]
    return np.array(pairs).T


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--uncompressed", required=True)
    parser.add_argument("--lights")
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--bounces", type=int, default=8)
    parser.add_argument("transport", nargs="+")
    args = parser.parse_args()
    exact = lit(args, args.uncompressed)
    with tempfile.TemporaryDirectory() as temporary:
        subprocess.run([os.environ.get("REPROBE", "reprobe"), "relight", args.scene, "--probes", args.uncompressed, "-o", temporary, "--quiet",
                        "--set", "bounces=0"] + (["--lights", args.lights, "--frames", str(args.frame)] if args.lights else []), check=True)
        width = channels(os.path.join(temporary, f"{args.frame:04d}.exr"))["irradiance.R"].shape[1]
    print("probes receivers clusters   rank  sparsity  RMS, %  steps")
    for folder in args.transport:
        found, (owner, ranks, stored) = lit(args, folder), clusters(folder)
        a, b = neighbours(folder, width)
        size = lambda light: np.sqrt((light**2).sum(-1))
        difference = size(found - exact)
        steps, smooth = size(found[a] - found[b]), size(exact[a] - exact[b])
        across = owner[a] != owner[b]
        step = (steps[across].mean() / smooth[across].mean()) / (steps[~across].mean() / smooth[~across].mean())
        places = json.load(open(os.path.join(folder, "set.json")))["places"]
        probes = len(places["positions"]) - len(places.get("blocked", []))
        error = 100 * np.sqrt((difference**2).mean() / (size(exact) ** 2).mean())
        rank = (ranks[:, 0] * ranks[:, 1]).sum() / ranks[:, 0].sum()
        print(f"{probes:6d} {len(owner):9d} {len(ranks):8d} {rank:6.1f}  {stored / len(owner) ** 2:.2e}  {error:6.3f}  {step:.3f}", flush=True)


if __name__ == "__main__":
    main()
