#!/usr/bin/env python3
"""Every EXR and JSON file of a folder, as other programs read it, against what `reprobe info` says of it.

    pip install OpenEXR OpenImageIO mitsuba numpy
    python3 scripts/check_exr.py out/ --reprobe target/release/reprobe

Of each EXR file: channels by name, their types, data and display window, the attribute `provenance`, and the least, mean and greatest finite
value of each channel. OpenEXR's and OpenImageIO's samples must also be the same bits. Mitsuba turns all channels of a file into the first
one's type: where a file has several, its values are not compared. JSON files are read by Python. Prints a row a program; exit code 1 where
anything differs.
"""

import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np

TYPES = {"float16": "half", "float32": "float", "uint32": "uint"}


def with_openexr(path):
    import OpenEXR

    file = OpenEXR.File(str(path), separate_channels=True)
    header = file.header()
    window = lambda name: [np.asarray(corner).tolist() for corner in header[name]]
    return {
        "pixels": {name: channel.pixels for name, channel in file.channels().items()},
        "windows": [window("dataWindow"), window("displayWindow")],
        "provenance": header.get("provenance"),
    }


def with_openimageio(path):
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(str(path))
    if file is None:
        raise OSError(oiio.geterror())
    spec = file.spec()
    pixels = {}
    for i, name in enumerate(spec.channelnames):
        kind = spec.channelformat(i)
        pixels[name] = file.read_image(0, 0, i, i + 1, kind).reshape(spec.height, spec.width)
    window = lambda x, y, w, h: [[x, y], [x + w - 1, y + h - 1]]
    return {
        "pixels": pixels,
        "windows": [
            window(spec.x, spec.y, spec.width, spec.height),
            window(spec.full_x, spec.full_y, spec.full_width, spec.full_height),
        ],
        "provenance": spec.getattribute("provenance"),
    }


def with_mitsuba(path):
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    bitmap = mi.Bitmap(str(path))
    values = np.asarray(bitmap).reshape(bitmap.height(), bitmap.width(), -1)
    names = [field.name for field in bitmap.struct_()]
    metadata = dict(bitmap.metadata()) if hasattr(bitmap, "metadata") else {}
    return {
        "pixels": {name: values[:, :, i] for i, name in enumerate(names)},
        "windows": None,
        "provenance": metadata.get("provenance"),
        "one_type": True,
    }


PROGRAMS = {"OpenEXR": with_openexr, "OpenImageIO": with_openimageio, "Mitsuba": with_mitsuba}


def differences(found, info):
    """What a program tells otherwise than `reprobe info`."""
    width, height = info["width"], info["height"]
    wrong = []
    expected = {c["name"]: c for c in info["channels"]}
    if set(found["pixels"]) != set(expected):
        wrong.append(f"channels {sorted(found['pixels'])}, expected {sorted(expected)}")
    whole = [[0, 0], [width - 1, height - 1]]
    if found["windows"] is not None and found["windows"] != [whole, whole]:
        wrong.append(f"windows {found['windows']}")
    provenance = json.loads(found["provenance"]) if found["provenance"] else None
    if provenance is not None:
        provenance.pop("checksum", None)
    if provenance != info["provenance"]:
        wrong.append("provenance")
    if found.get("one_type") and len({told["type"] for told in expected.values()}) > 1:
        return wrong
    for name in set(found["pixels"]) & set(expected):
        pixels, told = found["pixels"][name], expected[name]
        if pixels.shape != (height, width):
            wrong.append(f"{name}: {pixels.shape} pixels")
            continue
        if TYPES.get(str(pixels.dtype)) != told["type"]:
            wrong.append(f"{name}: {pixels.dtype}, expected {told['type']}")
        values = pixels.astype(np.float64)
        finite = values[np.isfinite(values)]
        bad = values.size - finite.size
        if bad != told["not_finite"]:
            wrong.append(f"{name}: {bad} not finite, expected {told['not_finite']}")
        elif finite.size:
            for what, value in [("min", finite.min()), ("mean", finite.mean()), ("max", finite.max())]:
                scale = max(abs(told["min"]), abs(told["max"]), 1e-30)
                if abs(value - told[what]) > 1e-6 * scale:
                    wrong.append(f"{name}: {what} {value}, expected {told[what]}")
    return wrong


def same_bits(a, b):
    """Channels of which two programs have other bits."""
    return [n for n in a if n in b and a[n].tobytes() != b[n].tobytes()]


def check_json(path):
    value = json.loads(path.read_text(encoding="utf-8"))
    return [] if isinstance(value, dict) else ["no object"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--reprobe", default="reprobe")
    args = parser.parse_args()
    files = sorted(args.folder.rglob("*.exr"))
    if not files:
        sys.exit(f"{args.folder}: no EXR file")
    rows = {name: [0, 0, 0] for name in [*PROGRAMS, "OpenEXR against OpenImageIO, bits", "JSON, Python"]}

    def count(row, path, wrong, channels=0):
        rows[row] = [a + b for a, b in zip(rows[row], [1, channels, len(wrong)])]
        for line in wrong:
            print(f"{row}: {path}: {line}", file=sys.stderr)

    for path in files:
        command = [args.reprobe, "info", "--json", str(path)]
        info = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        read = {}
        for name, program in PROGRAMS.items():
            try:
                read[name] = program(path)
                count(name, path, differences(read[name], info), len(info["channels"]))
            except Exception as error:  # whatever a program says, it is a difference
                count(name, path, [f"not opened: {error}"])
        if {"OpenEXR", "OpenImageIO"} <= set(read):
            a, b = (read[name]["pixels"] for name in ["OpenEXR", "OpenImageIO"])
            count("OpenEXR against OpenImageIO, bits", path, same_bits(a, b), len(a))
    for path in sorted(args.folder.rglob("*.json")):
        count("JSON, Python", path, check_json(path))
    print("| program | files | channels | differences |\n|---|---|---|---|")
    for name, (n, channels, wrong) in rows.items():
        print(f"| {name} | {n} | {channels or ''} | {wrong} |")
    sys.exit(1 if any(row[2] for row in rows.values()) else 0)


main()
