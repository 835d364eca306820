//! A ray's way through the probes, beside what it meets in the scene.

use crate::base::ray::Ray;
use crate::method::light_field_probes::field::LightField;
use crate::method::light_field_probes::march::{March, Search};
use crate::method::light_field_probes::trace::{Found, Step, follow};
use crate::scene::Camera;
use crate::transport::World;
use crate::view::gbuffer::is_glossy;
use crate::view::mirror::mirror_direction;
use glam::{Vec2, Vec3};
use serde_json::{Value, json};

/// A ray that a pixel asks for.
#[derive(Debug, Clone, Copy)]
pub struct Asked {
    /// The ray; its end is finite.
    pub ray: Ray,
    /// Where the camera stands if this is the mirror's ray; the view's own ray, of a surface that is not glossy, starts there.
    pub eye: Option<Vec3>,
}

/// The ray of a pixel: the mirror's where the surface there is glossy, the view's elsewhere. `None` where no surface is seen. `far`: length of
/// rays, metres.
pub fn ray_of(world: &World, camera: &Camera, [x, y]: [u32; 2], far: f32) -> Option<Asked> {
    let view = camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), Vec2::splat(0.5));
    let surface = world.seen(&view)?;
    let (mut ray, eye) = match is_glossy(world, &surface, -view.d) {
        true => (surface.spawn(mirror_direction(&surface, -view.d)), Some(view.o)),
        false => (view, None),
    };
    ray.t_max = ray.t_max.min(ray.t_min + far);
    Some(Asked { ray, eye })
}

/// What became of a ray.
#[derive(Debug, Clone)]
pub struct Way {
    /// The ray.
    pub asked: Asked,
    /// The probes that were asked, in order.
    pub steps: Vec<Step>,
    /// What they found.
    pub found: Found,
    /// What it meets in the scene: the distance, metres.
    pub truth: Option<f32>,
}

impl Way {
    /// Follows a ray through the probes, and through the scene.
    pub fn new((world, field): (&World, &LightField), asked: Asked, search: Search, thickness: f32) -> Self {
        let mut steps = Vec::new();
        let found = follow(field, &asked.ray, search, thickness, &mut |step| steps.push(step));
        Self { asked, steps, found, truth: world.closest(&asked.ray).map(|hit| hit.t) }
    }

    /// Where a probe's part ends, metres along the ray; infinite where it says that nothing is met.
    pub fn end(step: &Step) -> f32 {
        match step.march {
            March::Hit { t, .. } | March::Hidden { t } => t,
            March::Free => f32::INFINITY,
        }
    }

    /// What a probe said, in words.
    pub fn said(step: &Step) -> &'static str {
        match step.march {
            March::Hit { .. } => "hit",
            March::Hidden { .. } => "lost",
            March::Free => "nothing",
        }
    }

    /// What all of them found, in words.
    pub fn result(&self) -> String {
        match self.found {
            Found::Surface { probe, t, .. } => format!("hit at {t:.3} m, seen by probe {probe}"),
            Found::Nothing if self.steps.is_empty() => "nothing: no probe to ask".into(),
            Found::Nothing => "nothing".into(),
            Found::Lost { probe, t } => format!("lost at {t:.3} m, by probe {probe} last"),
        }
    }

    /// What the scene has, in words.
    pub fn truth_in_words(&self) -> String {
        self.truth.map_or_else(|| "nothing".into(), |t| format!("hit at {t:.3} m"))
    }

    /// What ray it is, in words.
    pub fn kind(&self) -> &'static str {
        if self.asked.eye.is_some() { "mirror ray" } else { "view ray" }
    }

    /// A line a probe, and what came of it.
    pub fn text(&self) -> String {
        let Ray { o, d, .. } = self.asked.ray;
        let number = |t: f32| if t.is_finite() { format!("{t:9.3}") } else { format!("{:>9}", "-") };
        let truth = number(self.truth.unwrap_or(f32::INFINITY));
        let mut text = format!("{} from {o:.3} along {d:.3}\n", self.kind());
        text += "step  probe     from        to  said          BVH\n";
        for (i, step) in self.steps.iter().enumerate() {
            let (from, to, said) = (number(step.t), number(Self::end(step)), Self::said(step));
            text += &format!("{:4}  {:5}{from} {to}  {said:8}{truth}\n", i + 1, step.probe);
        }
        text + &format!("probes: {}; BVH: {}", self.result(), self.truth_in_words())
    }

    /// The same for programs. Distances are metres along the ray; null is none.
    pub fn figures(&self) -> Value {
        let finite = |t: f32| t.is_finite().then_some(t);
        let step =
            |step: &Step| json!({ "probe": step.probe, "from": step.t, "to": finite(Self::end(step)), "said": Self::said(step) });
        let (said, probe, t) = match self.found {
            Found::Surface { probe, t, .. } => ("hit", Some(probe), Some(t)),
            Found::Nothing => ("nothing", None, None),
            Found::Lost { probe, t } => ("lost", Some(probe), Some(t)),
        };
        let Ray { o, d, .. } = self.asked.ray;
        json!({
            "ray": { "kind": self.kind(), "origin": o.to_array(), "direction": d.to_array() },
            "steps": self.steps.iter().map(step).collect::<Vec<_>>(),
            "found": { "said": said, "probe": probe, "t": t },
            "bvh": self.truth,
        })
    }
}
