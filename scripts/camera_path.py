"""Camera paths (PATH.json): the frames of a file, keyframes interpolated, as `reprobe` sees them.

A keyframed path has a frame every 1/fps seconds from its first keyframe to its last (both ends included). Origin,
target, up and fov follow a Catmull-Rom spline over the keyframes' times: a cubic Hermite curve whose tangent at a key is
the slope between its neighbours, one-sided at the ends.
"""

import bisect
import json
import math


class PathError(Exception):
    """What is wrong with a path file, and where."""


def _vector(path, key, where, default=None):
    value = key.get(where[1], default)
    if not (isinstance(value, list) and len(value) == 3 and all(isinstance(x, (int, float)) for x in value)):
        raise PathError(f'{path}: {where[0]}: "{where[1]}" is {value!r}, expected three numbers')
    return [float(x) for x in value]


def _catmull_rom(times, values, t):
    """The spline through `values` (lists of equal length) at `times`, at time `t`."""
    last = len(times) - 1
    i = min(max(bisect.bisect_right(times, t) - 1, 0), last - 1)

    def slope(k):
        a, b = max(k - 1, 0), min(k + 1, last)
        return [(y - x) / (times[b] - times[a]) for x, y in zip(values[a], values[b])]

    h = times[i + 1] - times[i]
    s = (t - times[i]) / h
    weights = (2 * s**3 - 3 * s**2 + 1, (s**3 - 2 * s**2 + s) * h, 3 * s**2 - 2 * s**3, (s**3 - s**2) * h)
    return [sum(w * x for w, x in zip(weights, column)) for column in zip(values[i], slope(i), values[i + 1], slope(i + 1))]


def load(path):
    """(frames, size): every frame is a dict of origin, target, up and fov_x (degrees); size is [width, height]."""
    try:
        with open(path, encoding="utf-8") as file:
            tree = json.load(file)
    except (OSError, ValueError) as error:
        raise PathError(f"{path}: {error}") from error
    size = tree.get("size", [1920, 1080])
    axis = tree.get("fov_axis", "x")
    keys = tree.get("frames", tree.get("keyframes"))
    if not keys:
        raise PathError(f'{path}: expected a non-empty "frames" or "keyframes"')
    if axis not in ("x", "y", "diagonal", "smaller", "larger"):
        raise PathError(f'{path}: "fov_axis" is {axis!r}, expected x, y, diagonal, smaller or larger')

    flat = []
    for i, key in enumerate(keys):
        where = f"frame {i}"
        fov = float(key.get("fov", tree.get("fov", 70)))
        flat.append(
            _vector(path, key, (where, "origin"))
            + _vector(path, key, (where, "target"))
            + _vector(path, key, (where, "up"), [0, 1, 0])
            + [fov]
        )
    if "keyframes" in tree and "frames" not in tree and len(flat) > 1:
        times = [float(k["time"]) for k in keys]
        if any(b <= a for a, b in zip(times, times[1:])):
            raise PathError(f"{path}: keyframe times must grow, found {times}")
        step = 1.0 / float(tree.get("fps", 30))
        count = int(math.floor((times[-1] - times[0]) / step + 1e-6)) + 1
        flat = [_catmull_rom(times, flat, times[0] + i * step) for i in range(count)]
    frames = [{"origin": v[0:3], "target": v[3:6], "up": v[6:9], "fov_x": horizontal_fov(v[9], axis, size)} for v in flat]
    return frames, size


def horizontal_fov(fov, axis, size):
    """Degrees along x of a field of view given along `axis`."""
    width, height = size
    if axis == "smaller":
        axis = "x" if width <= height else "y"
    elif axis == "larger":
        axis = "x" if width >= height else "y"
    extent = {"x": width, "y": height, "diagonal": math.hypot(width, height)}[axis]
    return math.degrees(2 * math.atan(math.tan(math.radians(fov) / 2) * width / extent))
