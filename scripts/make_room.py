#!/usr/bin/env python3
"""Makes the textures and meshes of scenes/room (numpy and pillow): python3 scripts/make_room.py"""

import os

import numpy as np
from PIL import Image

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scenes", "room")


def smooth_noise(rng, shape, cells):
    """Periodic value noise in [0, 1] with `cells` lattice cells down and across."""
    lattice = rng.random(cells)
    axes = [np.arange(n) * c / n for n, c in zip(shape, cells)]
    (i, j) = [a.astype(int) for a in axes]
    (u, v) = [3 * (a % 1) ** 2 - 2 * (a % 1) ** 3 for a in axes]
    at = lambda di, dj: lattice[np.ix_((i + di) % cells[0], (j + dj) % cells[1])]
    u, v = u[:, None], v[None, :]
    return (at(0, 0) * (1 - u) + at(1, 0) * u) * (1 - v) + (at(0, 1) * (1 - u) + at(1, 1) * u) * v


def save(name, colour):
    pixels = (np.clip(colour, 0, 1) * 255 + 0.5).astype(np.uint8)
    Image.fromarray(pixels).save(os.path.join(FOLDER, name), quality=90)


def grain(rng, size):
    """Wood grain along x."""
    y = np.arange(size)[:, None] / size
    warp = smooth_noise(rng, (size, size), (8, 3)) * 0.25 + smooth_noise(rng, (size, size), (24, 2)) * 0.05
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * 9 * (y + warp))
    fibres = smooth_noise(rng, (size, size), (256, 6))
    return 0.6 * rings + 0.4 * fibres


def planks(rng, size=768, rows=8):
    """Floor boards along x, each with its own tone, dark joints between them."""
    colour = np.zeros((size, size, 3))
    height = size // rows
    dark, light = np.array([0.46, 0.30, 0.18]), np.array([0.82, 0.60, 0.40])
    for row in range(rows):
        joint = int(size * ((row * 0.382) % 1.0))
        for k, (a, b) in enumerate([(0, joint), (joint, size)]):
            if b <= a:
                continue
            board = grain(rng, size)[:height, : b - a, None]
            tone = rng.uniform(0.75, 1.1)
            top = row * height
            colour[top : top + height, a:b] = tone * (dark + (light - dark) * (0.25 + 0.6 * board))
            colour[top : top + height, a : a + 2] *= 0.4
        colour[row * height : row * height + 2] *= 0.4
    return colour


def wallpaper(rng, size=512, tiles=4):
    """A lattice of ogees, two shades of green."""
    y, x = np.mgrid[0:size, 0:size] / size * tiles
    wave = np.cos(2 * np.pi * x) + np.cos(2 * np.pi * y) * 0.9
    lines = np.exp(-((wave / 0.16) ** 2))
    dots = np.clip(1.5 - 9 * np.hypot((x + 0.5) % 1 - 0.5, (y + 0.5) % 1 - 0.5), 0, 1)
    base = np.array([0.50, 0.62, 0.55]) * (0.96 + 0.08 * smooth_noise(rng, (size, size), (64, 64))[..., None])
    return base + (lines + dots)[..., None] * np.array([0.20, 0.17, 0.13])


def rug(size=512):
    """Borders and diamonds in brick, cream and navy."""
    y, x = np.mgrid[0:size, 0:size] / size
    edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    brick, cream, navy = np.array([0.50, 0.16, 0.13]), np.array([0.80, 0.73, 0.60]), np.array([0.13, 0.17, 0.29])
    diamonds = (np.abs((x * 6) % 1 - 0.5) + np.abs((y * 4) % 1 - 0.5)) % 0.36 < 0.12
    colour = np.where(diamonds[..., None], cream, brick)
    for inner, tone in ((0.11, navy), (0.085, cream), (0.065, navy), (0.02, brick)):
        colour = np.where((edge < inner)[..., None], tone, colour)
    weave = 0.92 + 0.08 * np.sign(np.sin(np.pi * 128 * x) * np.sin(np.pi * 128 * y))
    return colour * weave[..., None]


def painting(rng, size=512):
    """A sun over hills."""
    y, x = np.mgrid[0:size, 0:size] / size
    sky = np.array([0.95, 0.75, 0.45]) * (1 - y[..., None]) + np.array([0.90, 0.42, 0.30]) * y[..., None]
    colour = np.where((np.hypot(x - 0.64, y - 0.36) < 0.13)[..., None], np.array([0.99, 0.93, 0.72]), sky)
    tones = [(0.50, 0.42, 0.55), (0.30, 0.33, 0.50), (0.16, 0.28, 0.36), (0.08, 0.18, 0.20)]
    for k, tone in enumerate(tones):
        ridge = 0.48 + 0.12 * k + 0.07 * np.sin(2 * np.pi * (x * (1 + 0.4 * k) + 0.3 * k)) + 0.03 * np.sin(9 * x + 2 * k)
        colour = np.where((y > ridge)[..., None], np.array(tone), colour)
    return colour * (0.93 + 0.14 * smooth_noise(rng, (size, size), (96, 96))[..., None])


def surface_of_revolution(name, profile, segments):
    """OBJ of a profile of (radius, height) points turned about Y. Smooth normals from the profile's tangents."""
    profile = np.array(profile, dtype=float)
    tangent = np.gradient(profile, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    write_grid(name, profile, normal, segments, closed=False)


def torus(name, major, minor, segments, sides):
    """OBJ of a torus that lies flat about Y."""
    phi = np.arange(sides + 1) * 2 * np.pi / sides
    circle = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    write_grid(name, circle * minor + np.array([major, 0]), circle, segments, closed=True)


def write_grid(name, profile, normal, segments, closed):
    """A profile with normals, turned about Y, as quads; the seam has its own texture coordinates."""
    rings = len(profile)
    lines = ["# made by scripts/make_room.py"]
    for j in range(segments + 1):
        theta = 2 * np.pi * (j % segments) / segments
        c, s = np.cos(theta), np.sin(theta)
        for i in range(rings):
            (r, y), (nr, ny) = profile[i], normal[i]
            lines.append(f"v {r * c:.5f} {y:.5f} {r * s:.5f}")
            lines.append(f"vt {j / segments:.4f} {i / (rings - 1):.4f}")
            lines.append(f"vn {nr * c:.4f} {ny:.4f} {nr * s:.4f}")
    index = lambda i, j: 1 + j * rings + i
    for j in range(segments):
        for i in range(rings - 1):
            quad = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]
            # A ring of no radius is a point: one triangle there, not two.
            if not closed and profile[i][0] < 1e-9:
                quad = quad[:3]
            elif not closed and profile[i + 1][0] < 1e-9:
                quad = [quad[0], quad[1], quad[3]]
            lines.append("f " + " ".join(f"{k}/{k}/{k}" for k in quad))
    with open(os.path.join(FOLDER, name), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def spline(points, count):
    """A smooth curve through points (Catmull-Rom), sampled evenly in its parameter."""
    p = np.array([points[0], *points, points[-1]], dtype=float)
    t = np.linspace(0, len(points) - 1 - 1e-9, count)
    i = t.astype(int)
    s = (t - i)[:, None]
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return 0.5 * (2 * b + (c - a) * s + (2 * a - 5 * b + 4 * c - d) * s**2 + (3 * b - a - 3 * c + d) * s**3)


def main():
    os.makedirs(FOLDER, exist_ok=True)
    rng = np.random.default_rng(1)
    save("floor.jpg", planks(rng))
    save("wallpaper.jpg", wallpaper(rng))
    save("rug.jpg", rug())
    save("painting.jpg", painting(rng)[::-1])  # v grows upwards on a rectangle, and row 0 is v = 0
    wood = grain(rng, 512)[..., None]
    save("walnut.jpg", np.array([0.30, 0.17, 0.10]) + wood * np.array([0.24, 0.16, 0.10]))
    # A bulbous vase with a narrow neck, its lip turned over and the wall going down inside.
    vase = [(0.0, 0.0), (0.07, 0.002), (0.10, 0.05), (0.145, 0.15), (0.13, 0.25), (0.07, 0.34), (0.05, 0.40), (0.07, 0.45)]
    vase += [(0.078, 0.458), (0.066, 0.452), (0.042, 0.40), (0.04, 0.36)]
    surface_of_revolution("vase.obj", spline(vase, 45), 48)
    bowl = [(0.0, 0.0), (0.06, 0.0), (0.065, 0.015), (0.12, 0.05), (0.165, 0.11), (0.17, 0.115), (0.16, 0.11), (0.11, 0.055), (0.0, 0.02)]
    surface_of_revolution("bowl.obj", spline(bowl, 33), 48)
    torus("ring.obj", 0.115, 0.042, 56, 24)


if __name__ == "__main__":
    main()
