"""Mitsuba integrators that split the first vertex of a path into its lobes.

The stock `path` integrator takes over from the second vertex on. Import this after the variant is set. The first vertex is
the first one that scatters: surfaces with an unscattered component (alpha masks) are looped over, at random. A pane of
`thindielectric` is an interface, not a hole: its straight transmission belongs to the non-diffuse layer. (A mask over a perfect
mirror looks the same to Mitsuba's flags, and is taken for a pane.)
"""

import drjit as dr
import mitsuba as mi

MAX_NULL_VERTICES = 64
DIFFUSE = int(mi.BSDFFlags.Diffuse)
NULL = int(mi.BSDFFlags.Null)


def integrator(layer, max_depth, rr_depth):
    """The integrator of `full`, `glossy`, `diffuse` or `emission`; depths as in Mitsuba (max_depth -1: no limit)."""
    stock = lambda depth: mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": rr_depth})
    tail = lambda: stock(max_depth - 1 if max_depth > 0 else -1)
    if layer == "full":
        return stock(max_depth)
    if layer == "glossy":
        return FirstVertex(int(mi.BSDFFlags.All) & ~DIFFUSE | NULL, tail())
    if layer == "diffuse":
        return FirstVertex(DIFFUSE | NULL, tail())
    return Emission()


def power_heuristic(a, b):
    """Weight of a sample of density a, where b is the other strategy's density."""
    a, b = a * a, b * b
    weight = a / (a + b)
    return dr.select(dr.isfinite(weight), weight, 0.0)  # as Mitsuba: both zero, or one past the range of a float


PANE = int(mi.BSDFFlags.Null | mi.BSDFFlags.DeltaReflection)
SIDES = int(mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)


def holes(bsdf, si, active):
    """How much of the light goes through a mask's holes; 0 for a pane, which also has a null lobe."""
    is_pane = (bsdf.flags() | SIDES) == (PANE | SIDES)
    return dr.select(is_pane, 0.0, bsdf.eval_null_transmission(si, active & ~is_pane))


class FirstVertex(mi.SamplingIntegrator):
    """Scatters by the lobes of `type_mask` alone at the first vertex."""

    def __init__(self, type_mask, tail):
        super().__init__(mi.Properties())
        self.tail = tail
        self.context = mi.BSDFContext()
        self.context.type_mask = type_mask
        self.panes_count = type_mask != (DIFFUSE | NULL)

    @dr.syntax
    def sample(self, scene, sampler, ray, medium=None, active=True):
        """One radiance sample; called by Mitsuba."""
        ray, active = mi.Ray3f(ray), mi.Bool(active)
        context, panes_count = self.context, mi.Bool(self.panes_count)
        radiance, throughput = mi.Spectrum(0.0), mi.Spectrum(1.0)
        # Where and how the path left the first vertex.
        vertex, next_ray = dr.zeros(mi.Interaction3f), mi.Ray3f(ray)
        pdf, delta, scattered = mi.Float(0.0), mi.Bool(False), mi.Bool(False)
        steps = mi.UInt32(0)

        while active & (steps < MAX_NULL_VERTICES):
            si = scene.ray_intersect(ray, active)
            active &= si.is_valid()
            bsdf = si.bsdf(ray)

            # Next-event estimation.
            lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            light, emitted = scene.sample_emitter_direction(si, sampler.next_2d(active), True, lit)
            lit &= light.pdf != 0.0
            value, bsdf_pdf = bsdf.eval_pdf(context, si, si.to_local(light.d), lit)
            share = dr.select(light.delta, 1.0, power_heuristic(light.pdf, bsdf_pdf))
            radiance[lit] += throughput * value * emitted * share

            # The next direction: on through a mask, or away from the first vertex.
            sample, weight = bsdf.sample(context, si, sampler.next_1d(active), sampler.next_2d(active), active)
            throughput[active] *= weight
            active &= dr.max(throughput) > 0.0
            is_null = active & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
            passes = is_null & (dr.max(holes(bsdf, si, is_null)) > 0.0)
            leaves = active & ~passes & (~is_null | panes_count)
            ray = si.spawn_ray(si.to_world(sample.wo))
            vertex.p = dr.select(leaves, si.p, vertex.p)
            next_ray.o = dr.select(leaves, ray.o, next_ray.o)
            next_ray.d = dr.select(leaves, ray.d, next_ray.d)
            pdf = dr.select(leaves, sample.pdf, pdf)
            delta = dr.select(leaves, mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta) | is_null, delta)
            scattered |= leaves
            active &= passes
            steps += 1

        # The stock integrator counts what its first ray sees of an emitter in full: trade that for its share under MIS.
        incident, _, _ = self.tail.sample(scene, sampler, next_ray, None, scattered)
        si = scene.ray_intersect(next_ray, scattered)
        emitter = si.emitter(scene, scattered)
        seen = scattered & (emitter != None)  # noqa: E711 (an array comparison)
        emitted = emitter.eval(si, seen)
        light_pdf = scene.pdf_emitter_direction(vertex, mi.DirectionSample3f(scene, si, vertex), seen & ~delta)
        share = dr.select(delta, 1.0, power_heuristic(pdf, light_pdf))
        radiance[scattered] += throughput * (incident + dr.select(seen, emitted * (share - 1.0), 0.0))
        return radiance, mi.Bool(True), []


class Emission(mi.SamplingIntegrator):
    """Light sources that the camera sees itself, masks thinning them out."""

    def __init__(self):
        super().__init__(mi.Properties())

    @dr.syntax
    def sample(self, scene, sampler, ray, medium=None, active=True):
        """One radiance sample; called by Mitsuba."""
        ray, active = mi.Ray3f(ray), mi.Bool(active)
        radiance, throughput = mi.Spectrum(0.0), mi.Spectrum(1.0)
        steps = mi.UInt32(0)
        while active & (steps < MAX_NULL_VERTICES):
            si = scene.ray_intersect(ray, active)
            emitter = si.emitter(scene, active)
            radiance[active & (emitter != None)] += throughput * emitter.eval(si, active)  # noqa: E711
            active &= si.is_valid()
            throughput[active] *= holes(si.bsdf(ray), si, active)
            active &= dr.max(throughput) > 0.0
            ray = si.spawn_ray(ray.d)
            steps += 1
        return radiance, mi.Bool(True), []
