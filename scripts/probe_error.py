#!/usr/bin/env python3
"""How far sets of baked probes are from another, which counts as the truth: the noise of their glossy texels.

    python3 scripts/probe_error.py TRUTH/ SET/ ...

All are of one qhmap; the truth has many paths and another seed. A row a set, over the texels that the truth does not leave black, of all probes together:
the root mean square of (x - r) / (luminance of r + 0.01), in brackets without the worst 1 %; its median; that of display values, in brackets without the worst 1 %;
and the difference of the means.

Needs pip install OpenEXR.
"""

import sys
from pathlib import Path

try:
    import numpy as np
    import OpenEXR
except ImportError as error:
    sys.exit(f"probe_error: error: {error}; install it with: pip install OpenEXR")

REC709 = np.array([0.2126, 0.7152, 0.0722])


def glossy(path):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([channels[f"glossy.{c}"].pixels.astype(np.float64) for c in "RGB"], -1).reshape(-1, 3)


def display(x):
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def root_mean(squares):
    """The root of the mean, and of the mean without the largest hundredth."""
    rest = np.sort(squares)[: int(0.99 * len(squares))]
    return np.sqrt(squares.mean()), np.sqrt(rest.mean())


def main():
    truth, *sets = map(Path, sys.argv[1:]) if len(sys.argv) > 2 else sys.exit(__doc__)
    names = sorted(path.name for path in truth.glob("[0-9][0-9][0-9][0-9].exr"))
    right = np.concatenate([glossy(truth / name) for name in names])
    lit = right.sum(-1) > 0
    right = right[lit]
    for folder in sets:
        found = np.concatenate([glossy(folder / name) for name in names])[lit]
        relative = ((found - right) ** 2).mean(-1) / (right @ REC709 + 0.01) ** 2
        shown = ((display(found) - display(right)) ** 2).mean(-1)
        (all_r, most_r), (all_d, most_d) = root_mean(relative), root_mean(shown)
        mean = found.mean() / right.mean() - 1
        print(f"{folder}: relative {all_r:.4f} ({most_r:.4f}), median {np.sqrt(np.median(relative)):.4f}, "
              f"display {all_d:.4f} ({most_d:.4f}), mean {100 * mean:+.2f} %")


if __name__ == "__main__":
    main()
