#!/usr/bin/env python3
"""The same scene with nothing but diffuse surfaces: what diffuse methods can be judged by without the light that gloss adds.

    python3 scripts/diffuse_scene.py SCENE.xml [--reflectance R] -o SCENE_DIFFUSE.xml

Every scattering model becomes a diffuse one with the reflectance or texture that it had, or with --reflectance, the same one everywhere (0:
nothing but direct light is left); metals and glass become grey (.5). The output lies beside the input, as file names in it are relative.
"""

import argparse
import os
import sys
import xml.etree.ElementTree as ElementTree

ADAPTERS = {"twosided", "mask", "bumpmap", "normalmap"}
NAMES = ("reflectance", "diffuse_reflectance", "diffuseReflectance", "base_color")


def make_diffuse(bsdf, reflectance):
    kept = [child for child in bsdf if child.get("name") in NAMES]
    if reflectance is not None:
        kept = [ElementTree.Element("rgb", value=str(reflectance))]
    for child in list(bsdf):
        bsdf.remove(child)
    bsdf.set("type", "diffuse")
    if kept:
        kept[0].set("name", "reflectance")
        bsdf.append(kept[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--reflectance", type=float, metavar="R")
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()
    if os.path.dirname(os.path.abspath(args.scene)) != os.path.dirname(os.path.abspath(args.output)):
        sys.exit(f"diffuse_scene: error: {args.output}: expected a file beside {args.scene}")
    tree = ElementTree.parse(args.scene)
    models = [b for b in tree.iter("bsdf") if b.get("type") not in ADAPTERS]
    for bsdf in models:
        make_diffuse(bsdf, args.reflectance)
    tree.write(args.output, encoding="utf-8", xml_declaration=True)
    print(f"{args.output}: {len(models)} models made diffuse")


if __name__ == "__main__":
    main()
