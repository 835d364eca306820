//! Pixels between anchors, eight at a time: each begins where the anchors around it ended, and looks around there by the finest level.

use super::gather_params::{ANCHOR_TOLERANCE, TILE};
use super::samples::{Sample, Samples};
use super::window::{Sought, Target, Targets, Texels, Window};
use crate::base::simd::Simd;
use crate::base::simd::lane::{F8, M8, V2};
use glam::Vec2;

/// Where a probe sees what eight pixels reflect, texels.
#[derive(Clone)]
pub(crate) struct Begin {
    x: [f32; 8],
    y: [f32; 8],
    /// A bit for each that is anywhere.
    pub(crate) valid: u32,
}

impl Begin {
    pub(crate) const NOWHERE: Self = Self { x: [0.0; 8], y: [0.0; 8], valid: 0 };

    #[inline(always)]
    pub(crate) fn new<S: Simd>((at, valid): (V2<S>, u32)) -> Self {
        Self { x: at.x.array(), y: at.y.array(), valid }
    }

    /// Of one.
    #[inline(always)]
    pub(crate) fn of(&self, i: usize) -> Vec2 {
        Vec2::new(self.x[i], self.y[i])
    }
}

/// How the searches of a tile's anchors ended, by their places in it: from where they began (texels), the energy, and the bits of the
/// reflector's material. Infinite, and of no material, where none was found; the last one stands for those outside.
pub(crate) struct Anchors([[f32; 4]; TILE * TILE + 1]);

impl Anchors {
    pub(crate) const NONE: Self = Self([[0.0, 0.0, f32::INFINITY, f32::from_bits(u32::MAX)]; TILE * TILE + 1]);

    #[inline(always)]
    pub(crate) fn set(&mut self, target: &Target, found: Sample, centre: Vec2) {
        let end = found.texel - centre;
        self.0[target.place] = [end.x, end.y, found.energy, f32::from_bits(target.material)];
    }
}

/// Eight pixels of a tile.
pub(crate) struct Block {
    targets: Targets,
    /// Offsets of the four anchors around each.
    around: [[u32; 8]; 4],
    /// A bit for each that is an anchor.
    pub(crate) anchors: u32,
    /// A bit for each.
    pixels: u32,
}

impl Block {
    /// One to eight; anchors are `step` apart.
    pub(crate) fn new(targets: &[Target], step: usize) -> Self {
        let place = |i: usize| targets.get(i).map_or([0; 2], |target| [target.place % TILE, target.place / TILE]);
        let is_anchor = |i: usize| place(i).iter().all(|x| x.is_multiple_of(step));
        let offset = |i: usize, dx: usize, dy: usize| {
            let [x, y] = place(i).map(|x| x / step * step);
            let inside = x + dx < TILE && y + dy < TILE;
            4 * if inside { (y + dy) * TILE + x + dx } else { TILE * TILE } as u32
        };
        let corners = [(0, 0), (step, 0), (0, step), (step, step)];
        Self {
            targets: Targets::new(targets),
            around: corners.map(|(dx, dy)| std::array::from_fn(|i| offset(i, dx, dy))),
            anchors: (0..targets.len()).fold(0, |bits, i| bits | u32::from(is_anchor(i)) << i),
            pixels: (1 << targets.len()) - 1,
        }
    }

    /// Sets the samples of probe `k` that anchors lead to. A bit for each pixel that is left over: where the sample is much worse than
    /// those of its anchors, or there is none.
    #[inline(always)]
    pub(crate) fn between<S: Simd>(
        &self,
        texels: &Texels<S>,
        anchors: &Anchors,
        begin: &Begin,
        finest: Option<&Window>,
        (k, samples): (usize, &mut [Samples]),
    ) -> u32 {
        let wanted = self.pixels & !self.anchors & begin.valid;
        let Some(finest) = finest.filter(|_| wanted != 0) else { return wanted };
        let sought = Sought::eight(texels.s, &self.targets);
        let (start, allowed) = self.start(texels, anchors, begin, &sought);
        let found = start.look_around(texels, finest, &sought);
        let is_good = found.energy.is_finite() & !allowed.less(found.energy);
        let (energy, x, y) = (found.energy.array(), found.at.x.array(), found.at.y.array());
        let good = is_good.bits() & wanted;
        for (i, samples) in samples.iter_mut().enumerate() {
            if good >> i & 1 == 1 {
                samples.set(k, Sample { energy: energy[i], texel: Vec2::new(x[i], y[i]) });
            }
        }
        wanted & !good
    }

    /// The best of where the anchors' ends lead to, and the most energy that is allowed.
    #[inline(always)]
    fn start<S: Simd>(&self, texels: &Texels<S>, anchors: &Anchors, begin: &Begin, sought: &Sought<S>) -> (Found<S>, F8<S>) {
        let s = texels.s;
        let centre = V2 { x: F8::load(s, &begin.x), y: F8::load(s, &begin.y) };
        let mut found = Found { energy: F8::splat(s, f32::INFINITY), at: centre };
        let mut allowed = F8::splat(s, 0.0);
        for around in &self.around {
            let [x, y, energy, material] = s.fours(anchors.0.as_flattened(), s.load_ids(around));
            let counts = M8(s, s.same_ids(s.bits(material), sought.material));
            if counts.bits() == 0 {
                continue;
            }
            let tolerated = F8(s, energy) * ANCHOR_TOLERANCE.0 + ANCHOR_TOLERANCE.1;
            allowed = counts.choose(allowed.max(tolerated), allowed);
            found.try_at(texels, centre + V2 { x: F8(s, x), y: F8(s, y) }, counts, sought);
        }
        (found, allowed)
    }
}

/// Samples of eight pixels.
struct Found<S: Simd> {
    /// Infinite where there is none.
    energy: F8<S>,
    at: V2<S>,
}

impl<S: Simd> Found<S> {
    /// Takes another texel coordinate where it counts and is better.
    #[inline(always)]
    fn try_at(&mut self, texels: &Texels<S>, at: V2<S>, counts: M8<S>, sought: &Sought<S>) {
        if let Some((better, energy)) = texels.energies(at.x, at.y, self.energy, sought) {
            let better = better & counts;
            self.energy = better.choose(energy, self.energy);
            self.at = better.choose2(at, self.at);
        }
    }

    /// The best of the places of a level around here.
    #[inline(always)]
    fn look_around(mut self, texels: &Texels<S>, level: &Window, sought: &Sought<S>) -> Self {
        let (centre, is_known) = (self.at, self.energy.is_finite());
        let scale = texels.scales(centre);
        let (step_x, step_y) = (scale.x * level.step, scale.y * level.step);
        for [i, j] in &level.places {
            let at = V2 { x: step_x * *i + centre.x, y: step_y * *j + centre.y };
            self.try_at(texels, at, is_known, sought);
        }
        self
    }
}
