//! How frames are made of many lights.

use crate::Result;
use crate::base::named::{Parameters, within, words};
use crate::view::MOST_SUPERSAMPLES;
use crate::view::denoiser::Denoiser;
use serde::{Deserialize, Serialize};

/// Most lobes of a node.
pub(crate) const MOST_LOBES: usize = 4;
/// Most shadow rays of a gather.
pub(crate) const MOST_SHADOW_RAYS: usize = 16;

/// Which nodes of the tree light comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Traversal {
    /// Those between the min and the max cut.
    Cuts,
    /// Any.
    Full,
    /// The leaves alone: the brute-force sum over all lights.
    Leaves,
}

words!(Traversal { Cuts "cuts", Full "full", Leaves "leaves" });

/// At which pixels light is gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// From every sixteenth pixel each way down to each, where neighbours differ (§2.3).
    Adaptive,
    /// At every fourth each way, whatever they show.
    Bilateral,
    /// At all of them.
    Full,
}

words!(Sampling { Adaptive "adaptive", Bilateral "bilateral", Full "full" });

/// The shape of lobes, of lights and of what they light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// A power of the cosine. *Paper*.
    Phong,
    /// A spherical Gaussian of the same variance, an exponential in place of a power. *Ours*.
    Gaussian,
}

words!(Kernel { Phong "phong", Gaussian "gaussian" });

/// Parameters of the method; the defaults are the paper's where it has a value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManyLightParams {
    /// N x N rays a pixel through the G-buffer. *Paper*: 1, or 2 against aliasing.
    pub supersample: u32,
    /// Virtual point lights. *Paper*: 16 384.
    pub vpls: u32,
    /// Steps by which they push one another apart. *Ours*.
    pub repulsion: u32,
    /// Solid angle up to which a node counts as one light, steradians. *Paper*: 0.02.
    pub solid_angle: f32,
    /// Which nodes light comes from. *Paper*: those between the cuts.
    pub traversal: Traversal,
    /// sigma1: variance at most which a node on the min cut has, in the unit of [`super::cuts`]. *Paper*: 40.
    pub min_cut: f32,
    /// sigma2: the same of the max cut. *Paper*: 9.
    pub max_cut: f32,
    /// Distance from a node of mean radiance, in radii of a disc of its area, below which a traversal goes down past the max cut; it goes as the
    /// root of the radiance. *Paper*: 0.
    pub near: f32,
    /// The same distance of a node that the receiver's horizon cuts, and which would count in full. *Paper*: 0.
    pub horizon: f32,
    /// Part of a receiver's glossy lobe beyond which a node in it is taken apart past the max cut, too; 0 for no such rule. *Paper*: 0. *Ours*:
    /// a node is a point to a lobe, which would be dark between points.
    pub fill: f32,
    /// Reflections at lights, the first, of light straight from emitters, included. *Paper*: 1 to 3; 2 in Figure 1.
    pub bounces: u32,
    /// Most glossy lobes a node. *Paper*: 1, mixtures are its future work; with 0 lights are diffuse, as those of other methods are.
    pub lobes: u32,
    /// Their shape.
    pub kernel: Kernel,
    /// Least Phong exponent of a lobe, before it is filtered. *Paper*: its materials have 5 or more.
    pub min_exponent: f32,
    /// Greatest. *Paper*: its materials have up to 60: sharper lobes would show single lights.
    pub max_exponent: f32,
    /// Most of a receiver's lobe that a node may fill: its solid angle times the lobe's density towards it. *Ours*: what is cut off of the
    /// singularity at d = 0 that the solid angle of a disc leaves; 1 is what a surface of the same radiance gives that fills the lobe.
    pub clamp: f32,
    /// Rays in a row that follow the lobes of mirrors and polished surfaces in a view, to where light is gathered; 0 gathers for such lobes as for
    /// others. *Paper*: 0.
    pub mirror_rays: u32,
    /// Alpha up to which they follow a lobe. *Ours*: that of an exponent of 60.
    pub mirror_alpha: f32,
    /// How many a pixel are drawn from its lobe, but for perfect mirrors, which have one; 0 for one in the mirror direction, without noise.
    pub mirror_samples: u32,
    /// Radius of virtual spherical lights (Hasan et al. 2009), in radii of a disc of the node's area; 0 for points. *Paper*: points.
    pub sphere: f32,
    /// Shadow rays a gather, towards nodes drawn by what they send (stochastic lightcuts); 0 leaves out what blocks indirect light. *Paper*: 0.
    pub shadow_rays: u32,
    /// Samples of emitters, a light.
    pub light_samples: u32,
    /// Samples of direct light, a pixel of the G-buffer; 0 leaves it out.
    pub direct_samples: u32,
    /// At which pixels light is gathered. *Paper*: adaptive.
    pub sampling: Sampling,
    /// lambda: what differences of light count against those of geometry. *Paper*: 16.
    pub lambda: f32,
    /// epsilon: the coherence error, at a grid of 8 pixels, beyond which a pixel is sampled; it doubles from grid to grid. *Paper*: 0.3.
    pub threshold: f32,
    /// Takes the noise of direct light and of shadow rays out of both layers (`--denoise`); `None` for nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoise: Option<Denoiser>,
}

impl Default for ManyLightParams {
    fn default() -> Self {
        Self {
            supersample: 1,
            vpls: 16_384,
            repulsion: 24,
            solid_angle: 0.02,
            traversal: Traversal::Cuts,
            min_cut: 40.0,
            max_cut: 9.0,
            near: 1.5,
            horizon: 3.0,
            fill: 0.5,
            bounces: 2,
            lobes: 1,
            kernel: Kernel::Phong,
            min_exponent: 1.0,
            max_exponent: 60.0,
            clamp: 1.0,
            mirror_rays: 4,
            mirror_alpha: 0.09,
            mirror_samples: 0,
            sphere: 0.0,
            shadow_rays: 0,
            light_samples: 16,
            direct_samples: 8,
            sampling: Sampling::Adaptive,
            lambda: 16.0,
            threshold: 0.3,
            denoise: None,
        }
    }
}

impl ManyLightParams {
    /// Whether rays follow a lobe of this alpha.
    pub fn follows(&self, alpha: f32) -> bool {
        self.mirror_rays > 0 && alpha <= self.mirror_alpha
    }
}

impl Parameters for ManyLightParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        within("vpls", self.vpls, 1..=1 << 22)?;
        within("repulsion", self.repulsion, 0..=1024)?;
        within("solid_angle", self.solid_angle, 0.0..=100.0)?;
        within("max_cut", self.max_cut, 0.0..=1e6)?;
        within("min_cut", self.min_cut, self.max_cut..=1e6)?;
        within("near", self.near, 0.0..=1e3)?;
        within("horizon", self.horizon, 0.0..=1e3)?;
        within("fill", self.fill, 0.0..=1e6)?;
        within("bounces", self.bounces, 1..=64)?;
        within("lobes", self.lobes, 0..=MOST_LOBES as u32)?;
        within("min_exponent", self.min_exponent, 0.0..=1e6)?;
        within("max_exponent", self.max_exponent, self.min_exponent..=1e6)?;
        within("clamp", self.clamp, 1e-6..=1e9)?;
        within("mirror_rays", self.mirror_rays, 0..=64)?;
        within("mirror_alpha", self.mirror_alpha, 0.0..=1.0)?;
        within("mirror_samples", self.mirror_samples, 0..=1 << 12)?;
        within("sphere", self.sphere, 0.0..=100.0)?;
        within("shadow_rays", self.shadow_rays, 0..=MOST_SHADOW_RAYS as u32)?;
        within("light_samples", self.light_samples, 1..=1 << 16)?;
        within("direct_samples", self.direct_samples, 0..=1 << 16)?;
        within("lambda", self.lambda, 0.0..=1e9)?;
        within("threshold", self.threshold, 0.0..=1e9)?;
        self.denoise.map_or(Ok(()), |denoise| denoise.validate())
    }
}
