#!/usr/bin/env python3
"""Ray tracing, `reprobe` against Embree: rays a second and thread, and whether the hits agree.

    python3 scripts/bench_vs_embree.py SCENE... [--runs 5]

Runs `cargo bench --bench rays -- --write` and Embree in turn on the same triangles and rays: those of paths (camera, then
cosine-distributed bounces), and shadow rays, both shuffled. One thread, one ray a call (rtcIntersect1, rtcOccluded1) from
compiled code, processor time. Closest hits agree where both meet the same triangle, or both miss, or the distances differ by less
than 1e-4 of them (edges that triangles share). Alpha masks are left out of both.

Needs: pip install embreex numpy.
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
from mitsuba_reference import scene_name

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except ImportError as error:
    sys.exit(f"bench_vs_embree: error: {error}; install it with: pip install embreex numpy")

UNOCCLUDED = -1  # embreex's answer to a shadow ray that meets nothing


def embree(folder):
    """Rates (million rays a second) and hits of Embree on what the benchmark wrote."""
    read = lambda name, *shape: np.fromfile(os.path.join(folder, name), dtype=np.float32).reshape(-1, *shape)
    scene = EmbreeScene()
    TriangleMesh(scene, read("triangles.f32", 3, 3))
    parts = lambda rays: (np.ascontiguousarray(rays[:, 0:3]), np.ascontiguousarray(rays[:, 3:6]), np.ascontiguousarray(rays[:, 7]))
    closest, shadow = parts(read("closest.f32", 8)), parts(read("any.f32", 8))
    scene.run(*(a[:64] for a in closest[:2]))  # builds

    def timed(o, d, far, query):
        began = time.process_time()
        found = scene.run(o, d, far.copy(), query=query)
        return len(o) / 1e6 / (time.process_time() - began), found

    closest_rate, hits = timed(*closest, "INTERSECT")
    any_rate, blocked = timed(*shadow, "OCCLUDED")
    distance = scene.run(*closest[:2], closest[2].copy(), query="DISTANCE")
    return (closest_rate, any_rate), np.asarray(hits), np.asarray(distance), np.asarray(blocked) != UNOCCLUDED


def agreement(folder, hits, distance, blocked):
    """Fractions of closest hits and of shadow rays on which both agree."""
    own = np.fromfile(os.path.join(folder, "hits.f32"), dtype=np.float32).reshape(-1, 2)
    triangle = own[:, 0].copy().view(np.uint32).astype(np.int64)
    triangle[triangle == 0xFFFFFFFF] = -1
    with np.errstate(invalid="ignore"):  # infinities of rays that miss
        near = np.abs(own[:, 1] - distance) <= 1e-4 * distance
    own_blocked = np.fromfile(os.path.join(folder, "blocked.u8"), dtype=np.uint8).astype(bool)
    return np.mean((triangle == hits) | near), np.mean(own_blocked == blocked)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    print(f"{'scene':28} {'':8} {'ours M/s':>9} {'Embree':>8} {'ratio':>22} {'agree':>10}")
    for path in args.scenes:
        name = scene_name(path)
        rows = []
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(args.runs):
                command = ["cargo", "bench", "--quiet", "--bench", "rays", "--", "--write", folder, os.path.abspath(path)]
                subprocess.run(command, check=True, cwd=root, stdout=subprocess.DEVNULL)
                with open(os.path.join(folder, "rates.json"), encoding="utf-8") as file:
                    own = json.load(file)
                rates, *found = embree(folder)
                rows.append([own["closest"], rates[0], own["any"], rates[1]])
            agree = agreement(folder, *found)
        table = np.array(rows)
        for k, what in enumerate(("closest", "any")):
            ours, theirs = table[:, 2 * k], table[:, 2 * k + 1]
            ratio = ours / theirs
            spread = f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})"
            print(f"{name:28} {what:8} {np.median(ours):9.2f} {np.median(theirs):8.2f} {spread:>22} {100 * agree[k]:9.4f}%", flush=True)


if __name__ == "__main__":
    main()
