#!/usr/bin/env python3
"""Fits the sky and sun of src/exchange/mitsuba/sky/ to what Mitsuba's `sunsky` shows, and writes their table.

    python3 scripts/fit_sky.py src/exchange/mitsuba/sky/table.bin

Needs Mitsuba 3 (`pip install mitsuba`) with LLVM; takes some minutes. Nothing of Mitsuba's own tables is read: its emitter is asked
for radiance, turbidity by turbidity, albedo by albedo, sun by sun, over the dome.

The terms are those of Hosek and Wilkie 2012, with exponents that are fixed, so that radiance is linear in all that is fitted:

    L(theta, gamma) = sum_ij k_ij u_i(theta) v_j(gamma)
    u = 1, sqrt(cos theta), exp(-b / (cos theta + 0.01)) for b of B
    v = 1, cos^2 gamma, exp(-e gamma) for e of E, chi(h, gamma) for h of H

The 54 products are fitted to each sky; the skies' principal components (K of them) are the table's basis; the weights of these are
polynomials in the cube root of the sun's elevation, for each turbidity and albedo of a grid. The sun: polynomials for each turbidity.

The file, little-endian: K x 54 float32, the basis; [turbidity][albedo][channel][K][P] float16, the weights, Chebyshev coefficients;
[turbidity][3][Q] float32: log of the sun's red irradiance, then green and blue over red.
"""
import os
import sys

os.environ.setdefault("DRJIT_LIBLLVM_PATH", "/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1")
import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402

mi.set_variant("llvm_ad_rgb")
B, E, H = [0.02, 0.1, 0.3, 1.0], [0.7, 2.0, 5.0, 12.0], [0.3, 0.6, 0.8]
K, P, Q = 24, 9, 8
TURBIDITIES = np.arange(1.0, 10.01, 0.5)
ALBEDOS = [0.0, 0.5, 1.0]
SUNS = 24  # elevations that are measured
DOME = 900  # directions that cover the dome evenly; more of them lie about the sun and above the horizon
GOLDEN = np.pi * (3.0 - 5.0**0.5)


def sun_at(elevation):
    return np.array([np.cos(elevation), 0.0, np.sin(elevation)])


def sunsky(**parameters):
    if "albedo" in parameters:
        parameters["albedo"] = {"type": "rgb", "value": [float(parameters["albedo"])] * 3}
    return mi.load_dict({"type": "sunsky", **parameters})


def sky(turbidity, albedo, elevation, directions):
    """Radiance of the sky alone."""
    emitter = sunsky(turbidity=float(turbidity), albedo=albedo, sun_scale=0.0, sun_direction=sun_at(elevation).tolist())
    si = dr.zeros(mi.SurfaceInteraction3f, len(directions))
    si.wi = mi.Vector3f(*(mi.Float(np.ascontiguousarray(-d, dtype=np.float32)) for d in directions.T))
    return np.array(emitter.eval(si), dtype=np.float64).T


def polar(cos, phi):
    sin = np.sqrt(np.maximum(1.0 - cos * cos, 0.0))
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], 1)


def directions_for(elevation):
    """Directions, and their weights in the fit."""
    i = np.arange(DOME) + 0.5
    dome = polar(1.0 - i / DOME, i * GOLDEN)
    i = np.arange(300) + 0.5
    about_z = polar(np.cos(np.radians(40.0) * (i / 300) ** 2), i * GOLDEN)
    sun = sun_at(elevation)
    glow = about_z[:, :1] * np.cross(sun, [0.0, 1.0, 0.0]) + about_z[:, 1:2] * np.array([0.0, 1.0, 0.0]) + about_z[:, 2:] * sun
    horizon = polar(np.sin(np.radians(8.0)) * (i * 0.618034 % 1.0), np.pi * i / 300)
    parts = [dome, glow[glow[:, 2] > 0.0], horizon]
    return np.concatenate(parts), np.repeat([1.0, 0.3, 0.3], [len(p) for p in parts])


def terms(directions, elevation):
    """The 54 products u_i v_j in each direction."""
    cos = np.clip(directions[:, 2], 0.0, 1.0)
    gamma = np.arccos(np.clip(directions @ sun_at(elevation), -1.0, 1.0))
    cg, one = np.cos(gamma), np.ones_like(cos)
    u = np.stack([one, np.sqrt(cos)] + [np.exp(-b / (cos + 0.01)) for b in B], 1)
    v = [one, cg**2] + [np.exp(-e * gamma) for e in E] + [(1.0 + cg**2) / (1.0 + h * h - 2.0 * h * cg) ** 1.5 for h in H]
    return (u[:, :, None] * np.stack(v, 1)[:, None, :]).reshape(len(cos), -1)


def chebyshev(elevation, count):
    """Of the place between horizon (-1) and zenith (1): the cube root spreads low suns, as the paper's does."""
    return np.polynomial.chebyshev.chebvander(2.0 * np.cbrt(np.atleast_1d(elevation) * 2.0 / np.pi) - 1.0, count - 1)


def fit_sky():
    places = 0.5 - 0.5 * np.cos((np.arange(SUNS) + 0.5) / SUNS * np.pi)
    elevations = np.maximum(np.pi / 2.0 * places**3, 1e-4)
    views = [directions_for(e) for e in elevations]
    products = [terms(d, e) for (d, _), e in zip(views, elevations)]
    measured = {
        (t, a): [sky(t, a, e, d) for (d, _), e in zip(views, elevations)] for t in TURBIDITIES for a in ALBEDOS
    }
    # Every sky by itself, with a little regularisation: the products are far from independent.
    scale = np.sqrt(np.mean([(m**2).mean(0) for m in products], 0))
    ridge = 1e-7 * np.eye(len(scale))
    metric, skies = ridge.copy(), []
    for i, (m, (_, w)) in enumerate(zip(products, views)):
        m = m / scale
        gram = (m.T * w) @ m / w.sum()
        metric += gram / SUNS
        values = np.concatenate([v[i] / v[i].mean(0) for v in measured.values()], 1)
        skies.append(np.linalg.solve(gram + ridge, (m.T * w) @ values / w.sum()).T)
    root = np.linalg.cholesky(metric)
    components = np.linalg.svd(np.concatenate(skies) @ root, full_matrices=False)[2]
    basis = (np.linalg.solve(root.T, components[:K].T).T / scale).astype(np.float32)
    # Weights of the basis, all suns of a turbidity and albedo at once; errors count by the sky's mean radiance.
    along = chebyshev(elevations, P)
    bases = [m @ basis.T.astype(np.float64) for m in products]
    grams = [(b.T * w) @ b for b, (_, w) in zip(bases, views)]
    weights = np.zeros((len(TURBIDITIES), len(ALBEDOS), 3, K, P))
    for t, turbidity in enumerate(TURBIDITIES):
        for a, albedo in enumerate(ALBEDOS):
            for c in range(3):
                left, right = 0.0, 0.0
                for i, values in enumerate(measured[turbidity, albedo]):
                    size = 0.5 * values.mean() ** 2 + 0.5 * values[:, c].mean() ** 2
                    left = left + np.kron(grams[i], np.outer(along[i], along[i])) / size
                    right = right + np.kron((bases[i].T * views[i][1]) @ values[:, c], along[i]) / size
                left += 1e-10 * np.trace(left) / len(left) * np.eye(len(left))
                weights[t, a, c] = np.linalg.solve(left, right).reshape(K, P)
    return basis, weights.astype(np.float16)


def fit_sun():
    """Irradiance of a surface that faces the sun. Mitsuba's is linear between elevations of 2, 5, ... 89 degrees."""
    elevations = np.radians(np.arange(2.0, 90.0, 3.0))
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(np.radians(10.0)))
    fits = []
    for turbidity in np.arange(1.0, 10.1):
        values = []
        for elevation in elevations:
            sun = sun_at(elevation)
            # A wide sun has the same irradiance as a narrow one, and its solid angle is not lost in rounding.
            emitter = sunsky(turbidity=float(turbidity), sky_scale=0.0, sun_aperture=20.0, sun_direction=sun.tolist())
            si = dr.zeros(mi.SurfaceInteraction3f, 1)
            si.wi = mi.Vector3f(*(float(-x) for x in sun))
            values.append(np.array(emitter.eval(si), dtype=np.float64).ravel() * solid_angle)
        r, g, b = np.array(values).T
        along = chebyshev(elevations, Q)
        fits.append([np.linalg.lstsq(along, y, rcond=None)[0] for y in (np.log(r), g / r, b / r)])
        red = np.exp(along @ fits[-1][0])
        error = np.array([red - r, red * (along @ fits[-1][1]) - g, red * (along @ fits[-1][2]) - b]) / r
        print(f"sun, turbidity {turbidity:.0f}: largest error {100 * np.abs(error).max():.2f} % of red", file=sys.stderr)
    return np.array(fits, dtype=np.float32)


def evaluate(basis, weights, turbidity, albedo, elevation, directions):
    """What the Rust code does: parabolas through three turbidities and three albedos."""
    low = min(int(turbidity), 9)
    x, y = turbidity - low, albedo

    def parabola(x):
        return [(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)]

    cell = weights[2 * (low - 1) : 2 * (low - 1) + 3].astype(np.float64)
    mixed = np.einsum("t,a,tackp->ckp", parabola(x), parabola(y), cell) @ chebyshev(elevation, P)[0]
    return terms(directions, elevation) @ (mixed @ basis.astype(np.float64)).T


def validate(basis, weights, count=400):
    random = np.random.default_rng(5)
    for name, low, high in [("below 1 degree", 0.0, 1.0), ("1 to 10 degrees", 1.0, 10.0), ("10 to 90 degrees", 10.0, 90.0)]:
        rms, mean = [], []
        for _ in range(count):
            turbidity, albedo = random.uniform(1.0, 10.0), random.uniform()
            elevation = np.radians(random.uniform(low, high))
            dome = directions_for(elevation)[0][:DOME]
            true = sky(turbidity, albedo, elevation, dome)
            error = evaluate(basis, weights, turbidity, albedo, elevation, dome) - true
            rms.append(np.sqrt((error**2).mean(0) / (true**2).mean(0)))
            mean.append(np.abs(error.mean(0) / true.mean(0)))
        rms, mean = 100.0 * np.array(rms), 100.0 * np.array(mean)
        print(
            f"sun {name}: RMS over the dome {np.sqrt((rms**2).mean()):.2f} %, at worst {rms.max():.2f} %; "
            f"mean radiance within {mean.max():.2f} %",
            file=sys.stderr,
        )


if __name__ == "__main__":
    basis, weights = fit_sky()
    validate(basis, weights)
    sun = fit_sun()
    with open(sys.argv[1], "wb") as file:
        file.write(basis.astype("<f4").tobytes() + weights.astype("<f2").tobytes() + sun.astype("<f4").tobytes())
