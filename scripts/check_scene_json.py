#!/usr/bin/env python3
"""A scene as XML and as JSON, rendered by Mitsuba and by reprobe: the same pictures?

    pip install mitsuba OpenEXR numpy
    python3 scripts/check_scene_json.py scenes/room/scene.xml scenes/cornell/scene.xml -o check/ --reprobe target/release/reprobe

writes each scene's tree as a dictionary, `NAME.json`, and renders both files with each program. Mitsuba's `load_dict` takes what `json.load`
gives, but for transforms, of which JSON has none: what our files hold in their place (4x4 rows, or steps) becomes `ScalarTransform4f`.

Mitsuba loads shapes in parallel, in no fixed order, and so may give each lamp another part of its samples: its two pictures then
differ by their noise. What that is, a third picture tells, of the XML with another seed. Radiance counts up to 1. Exit code 1 where the two
differ by more than a tenth beyond that noise, or in their means by more than four standard errors; where reprobe's differ at all.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np

numbers = lambda text: [float(x) for x in text.replace(",", " ").split()]


def triple(element, default):
    """Attributes x, y, z, or the three of `value`."""
    if "value" in element.attrib:
        value = numbers(element.get("value"))
        return value * 3 if len(value) == 1 else value
    return [float(element.get(axis, default)) for axis in "xyz"]


def step(element):
    """A step of a transform, as our JSON has it."""
    match element.tag:
        case "translate":
            return {"translate": triple(element, 0)}
        case "scale":
            return {"scale": triple(element, 1)}
        case "rotate":
            return {"rotate": {"axis": triple(element, 0), "angle": float(element.get("angle"))}}
        case "lookat" | "look_at":
            return {"look_at": {key: numbers(element.get(key)) for key in ["origin", "target", "up"]}}
        case "matrix":
            return {"matrix": np.reshape(numbers(element.get("value")), (4, 4)).tolist()}
    sys.exit(f"<{element.tag}> in a transform: not known here")


def value(element):
    match element.tag:
        case "integer":
            return int(element.get("value"))
        case "float":
            return float(element.get("value"))
        case "boolean":
            return element.get("value") == "true"
        case "string":
            return element.get("value")
        case "rgb":
            colour = numbers(element.get("value"))
            return {"type": "rgb", "value": colour * 3 if len(colour) == 1 else colour}
        case "point" | "vector":
            return triple(element, 0)
        case "ref":
            return {"type": "ref", "id": element.get("id")}
        case "transform":
            return [step(child) for child in element]
    return plugin(element)


def plugin(element):
    """A plugin of the XML tree as a dictionary. What has neither a name nor an id gets a name that says its place."""
    found = {"type": element.get("type", element.tag)}
    if element.get("id"):
        found["id"] = element.get("id")
    for i, child in enumerate(element):
        key = child.get("name") or (child.get("id") if element.tag == "scene" else None) or f"{child.tag}_{i}"
        found[key] = value(child)
    return found


def matrix(mi, steps):
    """The matrix of what our JSON holds in a transform's place."""
    if not steps or not isinstance(steps[0], dict):
        return np.asarray(steps, dtype=np.float64) if steps else np.eye(4)
    whole = np.eye(4)
    for one in steps:
        (kind, of), = one.items()
        if kind == "matrix":
            m = np.asarray(of, dtype=np.float64)
        elif kind in ("translate", "scale"):
            m = getattr(mi.ScalarTransform4d(), kind)(of).matrix
        else:
            m = getattr(mi.ScalarTransform4d(), kind)(**of).matrix
        whole = np.asarray(m, dtype=np.float64) @ whole
    return whole


def for_mitsuba(mi, tree):
    """The one thing that `load_dict` wants and JSON does not have. Its transforms of images have the size of those of space."""
    done = {}
    for key, item in tree.items():
        if key in ("to_world", "to_uv"):
            rows = matrix(mi, item)
            done[key] = mi.ScalarTransform4f(rows) if key == "to_world" else mi.ScalarTransform3f(rows[np.ix_([0, 1, 3], [0, 1, 3])])
        else:
            done[key] = for_mitsuba(mi, item) if isinstance(item, dict) else item
    return done


def with_mitsuba(mi, scene, spp, seed=0):
    return np.asarray(mi.render(scene, spp=spp, seed=seed), dtype=np.float64)[..., :3]


def compare(a, b, noise):
    """A row's numbers, and whether they are as they should be."""
    a, b = np.minimum(a, 1), np.minimum(b, 1)
    off = b - a
    rms, pixels = np.sqrt(np.mean(off**2)), int((np.abs(off).max(-1) > 0).sum())
    means = b.mean() / a.mean()
    # Rounding has no noise.
    error = max(off.std() / np.sqrt(off.size / 3), 1e-6)
    cells = [a.size // 3, pixels, f"{rms:.4f}", "" if noise is None else f"{noise:.4f}", f"{means:.4f}"]
    fine = pixels == 0 if noise is None else rms <= 1.1 * noise and abs(off.mean()) <= 4 * error
    return cells, fine and np.any(a > 0)


def with_reprobe(args, scene, out):
    import OpenEXR

    command = [args.reprobe, "render-path", scene, "--method", "path-trace", "--spp", args.spp, "--size", args.size, "-o", out, "--quiet"]
    subprocess.run([str(word) for word in command], check=True)
    channels = OpenEXR.File(str(out / "0000.exr"), separate_channels=True).channels()
    return np.stack([channels[c].pixels for c in "RGB"], -1).astype(np.float64)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=pathlib.Path, nargs="+")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--reprobe", default="reprobe")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--size", default="96x72")
    args = parser.parse_args()
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    args.output.mkdir(parents=True, exist_ok=True)
    width, height = map(int, args.size.split("x"))
    failed = False
    print("| scene | program | pixels | that differ at all | RMS | noise | means, ratio |\n|---|---|---|---|---|---|---|")
    for scene in args.scenes:
        name = scene.resolve().parent.name
        tree = plugin(ET.parse(scene).getroot())
        sensor = next(v for v in tree.values() if isinstance(v, dict) and v["type"] == "perspective")
        film = next(v for v in sensor.values() if isinstance(v, dict) and v["type"] == "hdrfilm")
        film["width"], film["height"] = width, height
        # Beside the scene's own files, which it names by their places.
        written = scene.resolve().parent / f".check_{name}.json"
        sized = scene.resolve().parent / f".check_{name}.xml"
        root = ET.parse(scene)
        for side, n in [("width", width), ("height", height)]:
            root.find(f"./sensor/film/integer[@name='{side}']").set("value", str(n))
        try:
            root.write(sized)
            written.write_text(json.dumps(tree, indent=1), encoding="utf-8")
            (args.output / f"{name}.json").write_text(written.read_text(encoding="utf-8"), encoding="utf-8")
            mi.file_resolver().prepend(str(scene.resolve().parent))
            from_xml = mi.load_file(str(sized))
            from_json = mi.load_dict(for_mitsuba(mi, json.loads(written.read_text(encoding="utf-8"))))
            a, b = (with_mitsuba(mi, scene, args.spp) for scene in [from_xml, from_json])
            again = with_mitsuba(mi, from_xml, args.spp, seed=1)
            noise = np.sqrt(np.mean((np.minimum(a, 1) - np.minimum(again, 1)) ** 2))
            ours = [with_reprobe(args, file, args.output / f"{name}_{file.suffix[1:]}") for file in [sized, written]]
        finally:
            sized.unlink(missing_ok=True)
            written.unlink(missing_ok=True)
        for program, pair, noise in [("Mitsuba", (a, b), noise), ("reprobe", ours, None)]:
            cells, fine = compare(*pair, noise)
            print("|", " | ".join(map(str, [name, program, *cells])), "|", "" if fine else "DIFFERS")
            failed |= not fine
    sys.exit(1 if failed else 0)


main()
