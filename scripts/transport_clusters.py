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
import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from transport_vs_lightmap import clusters, described, receivers, relight


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
    options = ["--indirect", "--set", f"bounces={args.bounces}", "--set", "map_samples=16"]
    options += ["--lights", args.lights, "--frames", str(args.frame)] if args.lights else []
    exact, width = relight(args.scene, args.uncompressed, *options, frame=args.frame)
    print("probes receivers clusters   rank  sparsity  RMS, %  steps")
    for folder in args.transport:
        found, _ = relight(args.scene, folder, *options, frame=args.frame)
        parts = list(clusters(folder))
        owner = np.zeros(len(found), int)
        for number, (members, _, _) in enumerate(parts):
            owner[members] = number
        a, b = neighbours(folder, width)
        size = lambda light: np.sqrt((light**2).sum(-1))
        difference = size(found - exact)
        steps, smooth = size(found[a] - found[b]), size(exact[a] - exact[b])
        across = owner[a] != owner[b]
        step = (steps[across].mean() / smooth[across].mean()) / (steps[~across].mean() / smooth[~across].mean())
        _, probes, stored = described(folder)
        error = 100 * np.sqrt((difference**2).mean() / (size(exact) ** 2).mean())
        rank = sum(len(members) * rank for members, _, rank in parts) / len(owner)
        print(f"{probes:6d} {len(owner):9d} {len(parts):8d} {rank:6.1f}  {stored / len(owner) ** 2:.2e}  {error:6.3f}  {step:.3f}", flush=True)


if __name__ == "__main__":
    main()
