#!/usr/bin/env python3
"""Runs every stage and method with two builds of reprobe, on one thread and on two, and compares all that they write, byte for byte.

    python3 scripts/same_outputs.py OLD NEW [--scene scenes/room/scene.xml --path scenes/room/path.json] [--work DIR]

For changes that must not change a result. What may differ is left out: of the provenance the version, the scene's hash, the hashes of inputs
and the parameters; times; and hashes of files that hold a provenance. Exit code 1 where anything else differs.
"""

import argparse
import json
import os
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

FREE = {"version", "scene", "inputs", "parameters"}
# Stages that draw no random numbers: whichever seed they were given says nothing.
SEEDLESS = {"qhmap", "compare"}
HASH = re.compile(rb"[0-9a-f]{64}")


def stages(scene, path, out):
    """The commands, small; later ones read what earlier ones wrote."""
    views = ["--path", path, "--size", "64x36", "--frames", "0,5"]
    bakes = ["--probes", f"{out}/probes.json", "--qhmap", f"{out}/qhmap"]
    light = ["--lightmap", f"{out}/lightmap.exr"]
    for_path = ["--for-path", path, "--size", "64x36", "--frames", "0,5", "--curvature", f"{out}/curvature.exr"]
    glossy = views + ["--probes", f"{out}/probes", "--curvature", f"{out}/curvature.exr", *light]

    def frames(name, *options):
        return ["render-path", scene, *options, "-o", f"{out}/{name}"]

    def probes(name, *options):
        return ["bake-probes", scene, *bakes, *options, "-o", f"{out}/{name}"]

    return [
        ["place-probes", scene, "--count", "4", "--path", path, "-o", f"{out}/probes.json"],
        ["resmap", scene, "--probes", f"{out}/probes.json", "--size", "64x32", "-o", f"{out}/resmap"],
        ["resmap", scene, "--probes", f"{out}/probes.json", "--size", "64x32", "--paper", "-o", f"{out}/resmap-paper"],
        ["qhmap", f"{out}/resmap", "--size", "128x64", "-o", f"{out}/qhmap"],
        ["qhmap", f"{out}/resmap", "--size", "128x64", "--lat-long", "-o", f"{out}/qhmap-lat-long"],
        ["curvature", scene, "-o", f"{out}/curvature.exr"],
        ["bake-lightmap", scene, "--spp", "8", "--texels", "6000", "-o", f"{out}/lightmap.exr"],
        ["bake-lightmap", scene, "--spp", "8", "--first-spp", "2", "--texels", "6000", "-o", f"{out}/lightmap-first.exr"],
        probes("probes", "--spp", "8", *light),
        probes("probes-paper", "--spp", "2", "--paper"),
        probes("probes-error", "--spp", "32", "--error", "0.2", *light),
        probes("probes-spread", "--spp", "4", "--spread", *light),
        probes("probes-for-path", "--spp", "8", *light, *for_path, "--alternative", "paper"),
        frames("glossy", *glossy, "--aov", "all"),
        frames("glossy-super", *glossy, "--supersample", "2"),
        frames("glossy-paper", *glossy, "--paper"),
        frames("glossy-full-filter", *glossy, "--set", "filter.method=full", "--set", "coverage.rays=0"),
        frames("path-trace", *views, "--method", "path-trace", "--spp", "4", "--aov", "all"),
        frames("path-trace-full", *views, "--method", "path-trace", "--spp", "4", "--layers", "full"),
        frames("path-trace-denoise", *views, "--method", "path-trace", "--spp", "2", "--denoise"),
        frames("ulr", *views, "--method", "ulr", "--probes", f"{out}/probes", *light),
        frames("image-space-gather", *views, "--method", "image-space-gather", *light, "--samples", "16"),
        frames("lightmap-rt", *views, "--method", "lightmap-rt", *light, "--samples", "2"),
        ["place-probes", scene, "--method", "sdf", "--count", "3", "--refine", "1", "--path", path, "-o", f"{out}/places.json"],
        ["place-probes", scene, "--method", "voxel", "--count", "12", "--path", path, "-o", f"{out}/sparse.json"],
        ["bake-lightfield", scene, "--probes", f"{out}/probes.json", "--size", "64", "--spp", "2", "-o", f"{out}/lightfield-grid"],
        ["bake-lightfield", scene, "--probes", f"{out}/places.json", "--size", "64", "--spp", "2", "-o", f"{out}/lightfield"],
        frames("light-field-grid", *views, "--method", "light-field-probes", "--probes", f"{out}/lightfield-grid", "--samples", "2", "--trace", "two-scale"),
        frames("light-field", *views, "--method", "light-field-probes", "--probes", f"{out}/lightfield", "--samples", "2"),
        ["bake-transport", scene, "--probes", f"{out}/sparse.json", "--texels", "2000", "--rays", "64", "--relight-rays", "500", "-o", f"{out}/transport"],
        ["bake-transport", scene, "--probes", f"{out}/sparse.json", "--texels", "2000", "--rays", "64", "--receiver", "sh1", "-o", f"{out}/transport-sh1"],
        ["relight", scene, "--probes", f"{out}/transport", "-o", f"{out}/lightmaps"],
        frames("radiance", *views, "--method", "radiance-probes", "--probes", f"{out}/transport"),
        frames("radiance-sh1", *views, "--method", "radiance-probes", "--probes", f"{out}/transport-sh1"),
        frames("many-light", *views, "--method", "many-light"),
        frames("many-light-shadows", *views, "--method", "many-light", "--set", "vpls=2000", "--set", "shadow_rays=2", "--set", "sphere=2", "--set", "sampling=full"),
        ["inspect-transport", scene, "--probes", f"{out}/transport", "--receivers", "200", "-o", f"{out}/lost.png"],
        ["compare", f"{out}/glossy", f"{out}/path-trace", "--layer", "glossy", "-o", f"{out}/report"],
        ["run", scene, *views, "--preset", "draft", "--probes", "3", "--spp", "4", "--lightmap-spp", "4", "--reference-spp", "2", "--probe-size", "128x64", "-o", f"{out}/run"],
        ["evaluate", scene, *views, "--methods", "glossy-probes,path-trace", "--bake", "bake-probes:--spp=4", "--bake", "place-probes:--count=3",
         "--bake", "bake-lightmap:--spp=4", "--reference-spp", "2", "-o", f"{out}/evaluate"],
    ]


def provenance(value):
    free = FREE | ({"seed"} if value.get("stage") in SEEDLESS else set())
    return {k: v for k, v in value.items() if k not in free}


def plain(value):
    """JSON without what may differ."""
    if isinstance(value, dict):
        return {k: provenance(v) if k == "provenance" and isinstance(v, dict) else plain(v) for k, v in value.items() if k != "files"}
    return [plain(v) for v in value] if isinstance(value, list) else value


def exr(data):
    """The header's attributes without the free part of the provenance, and the pixels' chunks as they stand."""
    at, attributes = 8, []
    text = lambda i: data[i : data.index(b"\0", i)]
    while data[at]:
        name = text(at)
        kind = text(at + len(name) + 1)
        at += len(name) + len(kind) + 2
        size = struct.unpack_from("<i", data, at)[0]
        value = data[at + 4 : at + 4 + size]
        at += 4 + size
        if name == b"provenance":
            value = json.dumps(provenance(json.loads(value))).encode()
        attributes.append((name, kind, value))
    # The table of offsets ends where the first chunk begins.
    first = struct.unpack_from("<Q", data, at + 1)[0]
    return attributes, data[first:]


def content(path):
    data = path.read_bytes()
    if path.suffix == ".exr":
        return exr(data)
    if path.suffix == ".json":
        return plain(json.loads(data))
    if path.suffix == ".html":
        return HASH.sub(b"", re.sub(rb'"provenance":\{.*?\}\}', b"", data))
    return data


def run(binary, scene, path, threads, folder):
    # A folder without Open Image Denoise: `--denoise` is the filter, in builds that know no other too.
    environment = {**os.environ, "OIDN_DIR": str(folder)}
    for command in stages(scene, path, "out"):
        call = [binary, *command, "--threads", str(threads), "--device", "cpu", "--quiet", "--seed", "3"]
        done = subprocess.run(call, cwd=folder, env=environment, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{' '.join(map(str, call))}\n{done.stderr}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--scene", type=Path, default="scenes/room/scene.xml")
    parser.add_argument("--path", type=Path, default="scenes/room/path.json")
    parser.add_argument("--work", type=Path, help="keep what is written here; what the old build has written before is used again")
    args = parser.parse_args()
    work = args.work or Path(tempfile.mkdtemp())
    scene, path = args.scene.resolve(), args.path.resolve()
    folders = {}
    for name, binary, threads in [("old", args.old, 2), ("new-1", args.new, 1), ("new-2", args.new, 2)]:
        folder = folders[name] = (work / name).resolve()
        if not (name == "old" and folder.exists()):
            if folder.exists():
                subprocess.run(["rm", "-r", folder], check=True)
            folder.mkdir(parents=True)
            run(binary.resolve(), scene, path, threads, folder)
    old = folders["old"]
    listing = lambda folder: {p.relative_to(folder) for p in folder.rglob("*") if p.is_file()}
    names = {n for n in listing(old) if n.name != "timings.json" and not (n.parts[1] == "evaluate" and n.suffix in (".md", ".html"))}
    wrong = 0
    for new in (folders["new-1"], folders["new-2"]):
        for missing in sorted(names - listing(new)):
            print(f"{new.name}: {missing} is missing")
            wrong += 1
        for name in sorted(names & listing(new)):
            if content(old / name) != content(new / name):
                print(f"{new.name}: {name} differs")
                wrong += 1
    print(f"{len(names)} files, on one thread and on two: {wrong} differ")
    sys.exit(wrong > 0)


main()
