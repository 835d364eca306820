#!/usr/bin/env python3
"""Pictures of one probe's resolution map and parameterisation, like Fig. 4 of the paper.

usage: figure_maps.py resmap/ qhmap/ 0003 -o figure.png

Rows: m, m_mat, m_size; m_complexity, normal, depth; the warped grid (every fourth line), the inverse map as colours and
the normals as the probe's texels see them. Needs numpy, pillow and OpenEXR (3.3 or later).
"""

import argparse
import pathlib

import numpy as np
import OpenEXR
from PIL import Image, ImageDraw

WIDTH, HEIGHT = 512, 256


def channels(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.astype(np.float32) for name, channel in file.channels().items()}


def tile(values, largest=None):
    """An image of [0, largest] (default: the 99.5th percentile), grey or RGB, gamma-encoded."""
    largest = largest or np.percentile(values, 99.5) or 1.0
    encoded = np.clip(values / largest, 0, 1) ** (1 / 2.2)
    rgb = encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=2)
    return Image.fromarray((rgb * 255).astype(np.uint8)).resize((WIDTH, HEIGHT), Image.NEAREST)


def grid(u, v, step=4, scale=2):
    """The deformed mesh; what leaves at one side comes in at the other."""
    image = Image.new("RGB", (WIDTH * scale, HEIGHT * scale), "white")
    draw = ImageDraw.Draw(image)
    for turn in (-1, 0, 1):
        x, y = (u + turn) * WIDTH * scale, v * HEIGHT * scale
        for j in range(0, u.shape[0], step):
            draw.line(list(zip(x[j], y[j])), fill=(200, 60, 50))
        for i in range(0, u.shape[1], step):
            draw.line(list(zip(x[:, i], y[:, i])), fill=(50, 80, 200))
    return image.resize((WIDTH, HEIGHT), Image.LANCZOS)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("resmap", type=pathlib.Path)
    parser.add_argument("qhmap", type=pathlib.Path)
    parser.add_argument("probe", help="its number, like 0003")
    parser.add_argument("-o", "--output", default="figure.png")
    args = parser.parse_args()
    seen = channels(args.resmap / f"{args.probe}.exr")
    inverse = channels(args.qhmap / f"{args.probe}.exr")
    forward = channels(args.qhmap / f"{args.probe}_forward.exr")

    normal = np.stack([seen[f"normal.{axis}"] for axis in "XYZ"], axis=-1) * 0.5 + 0.5
    u, v = inverse["inverse.U"] % 1.0, np.clip(inverse["inverse.V"], 0, 1)
    height, width = seen["m"].shape
    column = (u * width).astype(int) % width
    row = np.minimum((v * height).astype(int), height - 1)
    tiles = [
        tile(seen["m"]),
        tile(seen["m_mat"], 1.0),
        tile(seen["m_size"]),
        tile(seen["m_complexity"]),
        tile(normal, 1.0),
        tile(seen["depth"]),
        grid(forward["forward.U"], forward["forward.V"]),
        tile(np.stack([u, v, np.zeros_like(u)], axis=-1), 1.0),
        tile(normal[row, column], 1.0),
    ]
    figure = Image.new("RGB", (3 * WIDTH + 8, 3 * HEIGHT + 8), "white")
    for k, image in enumerate(tiles):
        figure.paste(image, ((k % 3) * (WIDTH + 4), (k // 3) * (HEIGHT + 4)))
    figure.save(args.output)


if __name__ == "__main__":
    main()
