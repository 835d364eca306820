#!/usr/bin/env python3
"""Renders a scene's image layers with Mitsuba 3: the references that `reprobe compare` measures against.

    python3 scripts/mitsuba_reference.py SCENE [--path PATH.json] -o DIR [--spp 256] [--size 480x270]

DIR gets one NNNN.exr a frame with the layer names that `reprobe render-path` writes:

    R, G, B       the full image                             (stock `path` integrator)
    glossy.*      non-diffuse lobes of the first vertex:     L(S|D)*S+E
    diffuse.*     diffuse lobe of the first vertex:          L(S|D)*DE
    emission.*    light sources seen directly:               LE

glossy + diffuse + emission is the full image within noise. The first vertex is the first one that scatters: alpha masks
let rays through to it. Pixels are filtered with a box whatever the scene's film asks for, as `reprobe render-path` does without
`--rfilter scene`. Finished frames are kept, so an interrupted run goes on.

Needs: pip install mitsuba numpy; for the fast variant llvm_ad_rgb also LLVM (Debian: apt-get install libllvm19; versions
15 and 16 fail to compile Mitsuba's kernels), found by itself or named by DRJIT_LIBLLVM_PATH.
"""

import argparse
import glob
import json
import os
import sys
import time
import zlib

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import camera_path

LAYERS = ("full", "glossy", "diffuse", "emission")
LANES_PER_PASS = 1 << 23  # samples in flight; bounds memory, changes nothing else


def fail(message):
    sys.exit(f"mitsuba_reference: error: {message}")


def find_llvm():
    """Points Dr.Jit at an LLVM that works, unless the user has."""
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return
    for version in (19, 20, 18, 17):
        for folder in ("/usr/lib/*-linux-gnu", f"/usr/lib/llvm-{version}/lib", "/opt/homebrew/opt/llvm*/lib", "/usr/local/lib"):
            found = sorted(glob.glob(f"{folder}/libLLVM*{version}*.so*") + glob.glob(f"{folder}/libLLVM.so.{version}*"))
            if found:
                os.environ["DRJIT_LIBLLVM_PATH"] = found[0]
                return


def import_mitsuba(variant):
    """Mitsuba with its variant set, or a message that says what to install."""
    if variant.startswith("llvm"):
        find_llvm()
    try:
        import drjit
        import mitsuba
    except ImportError as error:
        fail(f"{error}; install it with: pip install mitsuba numpy")
    try:
        mitsuba.set_variant(variant)
        if variant.startswith("llvm"):
            drjit.eval(drjit.arange(mitsuba.Float, 1))
    except Exception as error:
        fail(f"variant {variant}: {error}; install LLVM with: apt-get install libllvm19, or take --variant scalar_rgb")
    return mitsuba


def scene_name(path):
    """A name for tables and files: the scene's folder and its file, without the extension."""
    return "-".join(os.path.splitext(os.path.abspath(path))[0].split(os.sep)[-2:])


def load_scene(mi, path):
    """The scene, older files made loadable: filters that Mitsuba 3 lacks become bilinear, unused properties a warning."""
    mi.file_resolver().prepend(os.path.dirname(os.path.abspath(path)))
    config = mi.parser.ParserConfig(mi.variant())
    config.unused_properties = mi.LogLevel.Warn
    config.parallel = False  # with few threads, its nested waits can lock up
    try:
        state = mi.parser.parse_file(config, path)
        mi.parser.transform_all(config, state)
        for node in state.nodes:
            if node.props.plugin_name() == "bitmap" and "filter_type" in node.props:
                if node.props["filter_type"] not in ("bilinear", "nearest"):
                    node.props["filter_type"] = "bilinear"
        scene = mi.parser.instantiate(config, state)
        return scene[0] if isinstance(scene, list) else scene
    except Exception as error:
        fail(f"{path}: {error}")


def integrator_depth(mi, scene):
    """(max_depth, rr_depth) of the scene's own integrator; Mitsuba's defaults where it has none."""
    text = str(scene.integrator())
    values = {}
    for line in text.splitlines():
        name, _, value = line.strip().rstrip(",").partition(" = ")
        values[name] = value
    depth = int(values.get("max_depth", -1))
    return (-1 if depth < 0 or depth > 10**6 else depth), int(values.get("rr_depth", 5))


def sensor_dict(mi, size, fov_x, to_world, lens=None):
    """A perspective sensor with a box filter and independent samples."""
    sensor = {
        "type": "perspective",
        "fov": fov_x,
        "fov_axis": "x",
        "near_clip": 1e-3,
        "to_world": to_world,
        "sampler": {"type": "independent"},
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "component_format": "float32", "rfilter": {"type": "box"}},
    }
    if lens and lens[0] > 0:
        sensor.update(type="thinlens", aperture_radius=lens[0], focus_distance=lens[1])
    return sensor


def sensors(mi, scene, path, size):
    """The sensors to render, and the image size."""
    import numpy as np

    if path:
        frames, own_size = camera_path.load(path)
        size = size or own_size
        look = lambda f: mi.ScalarTransform4f().look_at(origin=f["origin"], target=f["target"], up=f["up"])
        return [mi.load_dict(sensor_dict(mi, size, f["fov_x"], look(f))) for f in frames]
    if not scene.sensors():
        fail("the scene has no sensor; give a --path")
    sensor = scene.sensors()[0]
    params = mi.traverse(sensor)
    first = lambda name: float(np.array(params[name]).ravel()[0]) if name in params else 0.0
    size = size or [int(x) for x in sensor.film().size()]
    matrix = np.array(params["to_world"].matrix).reshape(-1)[:16].reshape(4, 4)
    lens = (first("aperture_radius"), first("focus_distance"))
    return [mi.load_dict(sensor_dict(mi, size, first("x_fov"), mi.ScalarTransform4f(matrix), lens))]


def render_layer(mi, scene, sensor, integrator, spp, seed, name):
    """Mean of `spp` samples a pixel, rendered in passes that fit into memory: an array of height x width x 3."""
    import numpy as np

    width, height = sensor.film().size()
    per_pass = max(1, min(spp, LANES_PER_PASS // (width * height)))
    total, done = np.zeros((height, width, 3)), 0
    while done < spp:
        n = min(per_pass, spp - done)
        pass_seed = zlib.crc32(f"{seed} {name} {done}".encode())
        image = mi.render(scene, sensor=sensor, integrator=integrator, spp=n, seed=pass_seed)
        total += n * np.array(image)[:, :, :3]
        done += n
    return (total / spp).astype(np.float32)


def write_exr(mi, path, layers, attributes):
    """One EXR of all layers, whole or not at all."""
    import numpy as np

    names, planes = [], []
    for layer, pixels in layers.items():
        for i, c in enumerate("RGB"):
            names.append(c if layer == "full" else f"{layer}.{c}")
            planes.append(pixels[:, :, i])
    bitmap = mi.Bitmap(np.stack(planes, axis=-1), mi.Bitmap.PixelFormat.MultiChannel, channel_names=names)
    for key, value in attributes.items():
        bitmap.metadata()[key] = value
    temporary = f"{path}.tmp.exr"
    bitmap.write(temporary)
    os.replace(temporary, path)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", help="Mitsuba XML file")
    parser.add_argument("--path", help="camera path (PATH.json); without one, the scene's own sensor is the one frame")
    parser.add_argument("-o", "--output", required=True, help="folder for NNNN.exr")
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel and layer")
    parser.add_argument("--size", help="WxH; the path's or the sensor's by default. The horizontal field of view stays")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--layers", default=",".join(LAYERS))
    parser.add_argument("--frames", help="only these, such as 0,3,5-8")
    parser.add_argument("--max-depth", type=int, help="longest path, -1 for no limit; the scene's own by default")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    return parser.parse_args()


def chosen_frames(text, count):
    if not text:
        return range(count)
    chosen = set()
    for part in text.split(","):
        a, _, b = part.partition("-")
        chosen.update(range(int(a), int(b or a) + 1))
    return sorted(i for i in chosen if i < count)


def main():
    args = parse_arguments()
    layers = args.layers.split(",")
    if unknown := [x for x in layers if x not in LAYERS]:
        fail(f"--layers {args.layers}: {unknown[0]!r} is none of {', '.join(LAYERS)}")
    size = None
    if args.size:
        try:
            size = [int(x) for x in args.size.split("x")]
            assert len(size) == 2 and min(size) > 0
        except (ValueError, AssertionError):
            fail(f"--size {args.size}: expected WIDTHxHEIGHT, such as 480x270")
    if not os.path.isfile(args.scene):
        fail(f"{args.scene}: no such file")

    mi = import_mitsuba(args.variant)
    scene = load_scene(mi, args.scene)
    max_depth, rr_depth = integrator_depth(mi, scene)
    if args.max_depth is not None:
        max_depth = args.max_depth
    try:
        cameras = sensors(mi, scene, args.path, size)
    except camera_path.PathError as error:
        fail(str(error))
    import first_vertex  # defines integrators of the variant set above

    made = {name: first_vertex.integrator(name, max_depth, rr_depth) for name in layers}

    os.makedirs(args.output, exist_ok=True)
    settings = {"spp": args.spp, "seed": args.seed, "layers": layers, "max_depth": max_depth, "mitsuba": mi.__version__}
    settings["size"] = [int(x) for x in cameras[0].film().size()]
    settings_path = os.path.join(args.output, "settings.json")
    if os.path.exists(settings_path):
        with open(settings_path, encoding="utf-8") as file:
            if (found := json.load(file)) != settings:
                fail(f"{args.output} holds frames of other settings ({found}, now {settings}); take another folder")
    with open(settings_path, "w", encoding="utf-8") as file:
        json.dump(settings, file, indent=1)

    for i in chosen_frames(args.frames, len(cameras)):
        output = os.path.join(args.output, f"{i:04}.exr")
        if os.path.exists(output):
            continue
        started, images = time.time(), {}
        for layer in layers:
            images[layer] = render_layer(mi, scene, cameras[i], made[layer], args.spp, args.seed, f"{i} {layer}")
        write_exr(mi, output, images, {"spp": str(args.spp), "seed": str(args.seed), "max_depth": str(max_depth)})
        print(f"{output}  {time.time() - started:.0f} s", flush=True)


if __name__ == "__main__":
    main()
