#!/usr/bin/env python3
"""Pictures of how one frame comes about, like Fig. 3 of the paper.

usage: figure_frame.py frames/0003.exr [--reference reference/0003.exr] -o figure.png

The frame is one of `reprobe render-path --aov all`. Rows: the frame, its diffuse layer, its glossy layer; principal curvatures
k1 and k2 (red convex, blue concave), the filter's width; the glossy layer as gathered, filtered, and the reference's.
Needs numpy, pillow and OpenEXR (3.3 or later).
"""

import argparse

import numpy as np
import OpenEXR
from PIL import Image

CURVED = 10.0  # 1/m: full colour
WIDE = 32.0  # pixels: white


class Frame:
    def __init__(self, path):
        with OpenEXR.File(path, separate_channels=True) as file:
            self.channels = {name: channel.pixels.astype(np.float32) for name, channel in file.channels().items()}

    def scalar(self, name):
        return self.channels[name]

    def color(self, layer=""):
        """The layer as it is shown: clamped, sRGB-encoded."""
        prefix = layer + "." if layer else ""
        x = np.clip(np.stack([self.channels[prefix + c] for c in "RGB"], axis=-1), 0, 1)
        return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def signed(curvature):
    """Red above zero, blue below, white at zero."""
    x = np.clip(curvature / CURVED, -1, 1)[..., None]
    strength = np.sqrt(np.abs(x))
    return 1 - strength * np.where(x > 0, [0.1, 0.9, 0.9], [0.9, 0.6, 0.1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frame")
    parser.add_argument("--reference")
    parser.add_argument("-o", "--output", default="figure.png")
    args = parser.parse_args()
    frame = Frame(args.frame)
    variance = frame.scalar("covariance.xx") + frame.scalar("covariance.yy")
    width = np.clip(np.sqrt(variance / 2) / WIDE, 0, 1)[..., None] * np.ones(3)
    tiles = [frame.color(), frame.color("diffuse"), frame.color("glossy")]
    tiles += [signed(frame.scalar("curvature.k1")), signed(frame.scalar("curvature.k2")), width]
    tiles += [frame.color("gathered"), frame.color("glossy")]
    if args.reference:
        tiles.append(Frame(args.reference).color("glossy"))
    height, width = tiles[0].shape[:2]
    rows = (len(tiles) + 2) // 3
    figure = Image.new("RGB", (3 * width + 8, rows * height + 4 * (rows - 1)), "white")
    for k, tile in enumerate(tiles):
        image = Image.fromarray((np.clip(tile, 0, 1) * 255 + 0.5).astype(np.uint8))
        figure.paste(image, (k % 3 * (width + 4), k // 3 * (height + 4)))
    figure.save(args.output)


if __name__ == "__main__":
    main()
