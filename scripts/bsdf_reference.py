#!/usr/bin/env python3
"""Writes tests/data/bsdf_reference.json: values of Mitsuba's BSDFs that tests/bsdf_reference.rs compares ours with.

usage: scripts/bsdf_reference.py [OUTPUT]      (needs PyPI's mitsuba; the stored file is from 3.9.1)

Every case names a model that the test builds with the same parameters. A case holds, for each pair of local
directions, the diffuse and non-diffuse parts of eval (or eval as a whole where Mitsuba's plugin does not split) and
the pdf; and for models with delta lobes what sample returns for a few random numbers.
"""

import json
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

DIFFUSE = int(mi.BSDFFlags.Diffuse)
NON_DIFFUSE = int(mi.BSDFFlags.All) & ~DIFFUSE
ALL = int(mi.BSDFFlags.All)


def direction(cos, phi):
    sin = np.sqrt(max(0.0, 1.0 - cos * cos))
    return [float(sin * np.cos(phi)), float(sin * np.sin(phi)), float(cos)]


def rgb(*value):
    return {"type": "rgb", "value": list(value)}


# A surface whose shading normal, geometric normal and uv axes all differ, for the maps' sake.
N = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
DP_DU = np.array([1.3, 0.2, 0.0])
DP_DV = np.array([-0.1, 0.9, 0.0])
S = DP_DU - N * N.dot(DP_DU)
S /= np.linalg.norm(S)


def interaction(wi, uv):
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(wi)
    si.uv = mi.Point2f(uv)
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(mi.Vector3f(S), mi.Vector3f(np.cross(N, S)), mi.Vector3f(N))
    si.dp_du = mi.Vector3f(DP_DU)
    si.dp_dv = mi.Vector3f(DP_DV)
    return si


# A 4 x 3 image with all channels different, the same formula as in the test.
PIXELS = np.array(
    [[[((3 * x + 5 * y + 2 * c) % 7) / 10 for c in range(3)] for x in range(4)] for y in range(3)], dtype=np.float32
)


def bitmap(pixels, **more):
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True, "filter_type": "bilinear", **more}


ORANGE = rgb(0.8, 0.4, 0.1)
PINK = rgb(0.9, 0.6, 0.7)
METAL = {"eta": rgb(0.2, 0.92, 1.1), "k": rgb(3.9, 2.45, 2.1)}
GLASS = {"int_ior": 1.5, "ext_ior": 1.0}


def plastic(kind="plastic", nonlinear=False, **more):
    return {
        "type": kind, **GLASS, "nonlinear": nonlinear, "diffuse_reflectance": ORANGE, "specular_reflectance": PINK, **more
    }


def principled(**more):
    return {"type": "principled", "base_color": ORANGE, **more}


def perturbed(kind, texture, nested):
    return {"type": kind, ("normalmap" if kind == "normalmap" else "height"): texture, "bsdf": nested}


ANISOTROPIC = {"type": "roughconductor", **METAL, "alpha_u": 0.3, "alpha_v": 0.1, "distribution": "ggx"}
ISOTROPIC = {"type": "roughconductor", **METAL, "alpha": 0.1, "distribution": "ggx"}

SPLIT = {
    "diffuse": {"type": "diffuse", "reflectance": ORANGE},
    "plastic": plastic(),
    "plastic_nonlinear": plastic(nonlinear=True),
    "twosided_plastic": {"type": "twosided", "bsdf": plastic()},
    "roughplastic_ggx_0.3": plastic("roughplastic", alpha=0.3, distribution="ggx"),
    "roughplastic_ggx_0.1_nonlinear": plastic("roughplastic", True, alpha=0.1, distribution="ggx"),
    "roughplastic_ggx_0.01": plastic("roughplastic", alpha=0.01, distribution="ggx"),
    "roughplastic_beckmann_0.1": plastic("roughplastic", alpha=0.1, distribution="beckmann"),
    "roughplastic_beckmann_0.5_nonlinear": plastic("roughplastic", True, alpha=0.5, distribution="beckmann"),
    "roughconductor_ggx_0.1": ISOTROPIC,
    "roughconductor_ggx_anisotropic": ANISOTROPIC,
    "roughconductor_beckmann_0.4": {
        "type": "roughconductor", **METAL, "alpha": 0.4, "distribution": "beckmann", "specular_reflectance": PINK
    },
    "roughdielectric_ggx_0.2": {"type": "roughdielectric", **GLASS, "alpha": 0.2, "distribution": "ggx"},
    "roughdielectric_beckmann_0.3": {
        "type": "roughdielectric", **GLASS, "alpha": 0.3, "distribution": "beckmann", "specular_transmittance": PINK
    },
    "blend": {
        "type": "blendbsdf", "weight": 0.3, "a": {"type": "diffuse", "reflectance": ORANGE}, "b": ANISOTROPIC
    },
    "bumpmap_diffuse": perturbed("bumpmap", bitmap(PIXELS), {"type": "diffuse", "reflectance": ORANGE}) | {"scale": 0.4},
    # Isotropic: its tangent under an anisotropic model is wrong, see src/transport/bsdf/bump.rs.
    "bumpmap_rough": perturbed("bumpmap", bitmap(PIXELS, wrap_mode="mirror"), ISOTROPIC) | {"scale": 0.1},
    "bumpmap_turned": perturbed(
        "bumpmap",
        bitmap(PIXELS, wrap_mode="clamp", to_uv=mi.ScalarTransform3f().rotate(20).scale([0.6, 0.4])),
        {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": ORANGE}},
    ) | {"scale": 0.2},
    "normalmap_diffuse": perturbed("normalmap", bitmap(PIXELS + 0.3), {"type": "diffuse", "reflectance": ORANGE}),
    "normalmap_anisotropic": perturbed("normalmap", bitmap(PIXELS + 0.3), ANISOTROPIC),
}

# These do not split in Mitsuba: eval as a whole.
WHOLE = {
    "principled_default": principled(),
    "principled_cloth": principled(roughness=0.7, sheen=0.8, sheen_tint=0.6, flatness=0.5),
    "principled_metal": principled(roughness=0.4, metallic=0.7, anisotropic=0.8, spec_tint=0.5),
    "principled_coat": principled(roughness=0.6, clearcoat=0.9, clearcoat_gloss=0.3, specular=0.8),
    "principled_glass": principled(roughness=0.5, spec_trans=0.6, eta=1.4, spec_tint=0.3, metallic=0.2),
}

DELTA = {
    "plastic": plastic(),
    "conductor": {"type": "conductor", **METAL, "specular_reflectance": PINK},
    "conductor_none": {"type": "conductor", "material": "none"},
    "dielectric": {"type": "dielectric", **GLASS, "specular_transmittance": PINK},
    "thindielectric": {"type": "thindielectric", **GLASS, "specular_transmittance": PINK},
    "twosided_plastic": {"type": "twosided", "bsdf": plastic()},
}

UVS = [[0.3, 0.6], [0.95, 0.1], [1.7, -0.4]]
WI = [direction(1.0, 0.0), direction(0.8, 0.3), direction(0.4, 2.0), direction(0.06, 5.0), direction(-0.6, 1.0)]
WO = [direction(c, p) for c, p in [(0.95, 1.0), (0.8, 3.5), (0.6, 0.2), (0.4, 5.1), (0.1, 4.0), (0.03, 1.8), (-0.5, 4.3), (-0.9, 3.0)]]


def context(mask):
    ctx = mi.BSDFContext()
    ctx.type_mask = mask
    return ctx


def rounded(values):
    return [float(f"{float(v):.7g}") for v in values]


def main():
    cases = []
    for models, split in [(SPLIT, True), (WHOLE, False)]:
        for name, scene in models.items():
            bsdf = mi.load_dict(scene)
            uvs = UVS if "map" in name else UVS[:1]
            for uv in uvs:
                rows = []
                for wi in WI:
                    for wo in WO:
                        si, w = interaction(wi, uv), mi.Vector3f(wo)
                        parts = [DIFFUSE, NON_DIFFUSE] if split else [ALL]
                        row = [x for mask in parts for x in bsdf.eval(context(mask), si, w)]
                        pdf = bsdf.pdf(context(ALL), si, w)
                        # From behind an opaque principled, pdf is not what sample does: it draws nothing.
                        if not split and wi[2] < 0 and max(row) == 0:
                            pdf = 0.0
                        rows.append(rounded(row + [pdf]))
                cases.append({"model": name, "uv": uv, "split": split, "rows": rows})
    samples = []
    for name, scene in DELTA.items():
        bsdf = mi.load_dict(scene)
        for wi in WI:
            for u in [0.01, 0.5, 0.99]:
                bs, weight = bsdf.sample(context(ALL), interaction(wi, UVS[0]), u, [0.3, 0.8], True)
                delta = bool(int(bs.sampled_type) & int(mi.BSDFFlags.Delta | mi.BSDFFlags.Null))
                # Black samples carry anything.
                if max(weight) == 0:
                    samples.append({"model": name, "wi": wi, "u": u, "sample": None})
                elif delta:
                    sample = rounded([*bs.wo, *weight, bs.pdf, bs.eta])
                    samples.append({"model": name, "wi": wi, "u": u, "sample": sample})
    out = sys.argv[1] if len(sys.argv) > 1 else "tests/data/bsdf_reference.json"
    with open(out, "w") as f:
        f.write('{"mitsuba": %s,\n"wi": %s,\n"wo": %s,\n"cases": [\n' % tuple(map(json.dumps, (mi.__version__, WI, WO))))
        f.write(",\n".join(map(json.dumps, cases)))
        f.write('],\n"samples": [\n' + ",\n".join(map(json.dumps, samples)) + "]}\n")


main()
