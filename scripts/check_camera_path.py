"""Checks a camera path as a person would walk it: how near the eye comes to a surface, how fast it moves and turns.

For every frame, rays in all directions from the eye (Mitsuba 3) give the distance to the nearest surface; a person keeps some
20 cm away. A path that leads through a wall shows as two neighbouring eyes that do not see each other.

    python3 scripts/check_camera_path.py scene.xml scenes/paths/bathroom_walk.json
"""

import argparse
import math
import os
import sys

import numpy as np

import camera_path


def sphere(count):
    """`count` even directions (a Fibonacci lattice), as an array of rows."""
    i = np.arange(count) + 0.5
    z = 1 - 2 * i / count
    phi = math.pi * (1 + math.sqrt(5)) * i
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), z, r * np.sin(phi)], 1)


def distances(mi, scene, origins, directions):
    """Distance that each ray goes; infinite for one that leaves the scene."""
    column = lambda a, i: mi.Float(np.ascontiguousarray(a[:, i], dtype=np.float32))
    vector = lambda kind, a: kind(column(a, 0), column(a, 1), column(a, 2))
    return np.array(scene.ray_intersect_preliminary(mi.Ray3f(vector(mi.Point3f, origins), vector(mi.Vector3f, directions))).t)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene")
    parser.add_argument("paths", nargs="+")
    parser.add_argument("--clearance", type=float, default=0.2, help="least distance to a surface, m")
    parser.add_argument("--fps", type=float, help="frames a second [default: the path's]")
    parser.add_argument("--rays", type=int, default=512, help="rays a frame")
    args = parser.parse_args()

    import json

    import mitsuba as mi

    mi.set_variant(os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb"))
    scene = mi.load_file(args.scene)
    failed = False
    for path in args.paths:
        try:
            frames, _ = camera_path.load(path)
        except camera_path.PathError as error:
            sys.exit(str(error))
        with open(path, encoding="utf-8") as file:
            fps = args.fps or json.load(file).get("fps", 1)
        eyes = np.array([f["origin"] for f in frames])
        views = np.array([f["target"] for f in frames]) - eyes
        views /= np.linalg.norm(views, axis=1, keepdims=True)
        around = sphere(args.rays)
        nearest = distances(mi, scene, np.repeat(eyes, len(around), 0), np.tile(around, (len(eyes), 1)))
        nearest = nearest.reshape(len(eyes), -1).min(1)
        steps = np.diff(eyes, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        moving = lengths > 1e-6
        free = distances(mi, scene, eyes[:-1][moving], steps[moving] / lengths[moving][:, None]) > lengths[moving]
        turns = np.degrees(np.arccos(np.clip((views[1:] * views[:-1]).sum(1), -1, 1))) * fps
        speed = lengths * fps
        good = bool(nearest.min() >= args.clearance and free.all())
        failed |= not good
        print(
            f"{path}: {len(frames)} frames, {lengths.sum():.1f} m; nearest surface {nearest.min():.2f} m (frame {nearest.argmin()}), "
            f"speed {speed.min():.2f} to {speed.max():.2f} m/s, turning at most {turns.max():.0f} degrees/s, "
            f"{'clear' if free.all() else 'THROUGH A SURFACE'}: {'ok' if good else 'FAILED'}"
        )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
