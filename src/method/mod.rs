//! The methods: a folder each, and the table that says what each one is. Options, help, evaluation and messages come from it.
//!
//! A method is a way of making frames. What differs between methods stands in its row; what a frame of any of them is, in [`Renderer`].

#[cfg(test)]
mod contract;
pub mod diffuse;
pub mod glossy_probes;
pub mod image_space_gather;
pub mod light_field_probes;
pub mod lightmap_rt;
pub mod many_light;
pub mod path_trace;
pub mod radiance_probes;
pub mod ulr;

use crate::base::math::Rgb;
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::io::ExrImage;
use crate::lightmap::LightMap;
use crate::scene::{Animation, Scene};
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::View;
use crate::view::denoiser::Kind;
use crate::view::layers::LayerImages;
use crate::{Error, Result};
use diffuse::{DiffuseConstructor, Joined};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// All methods, the default first.
pub const METHODS: &[&Method] = &[
    &glossy_probes::METHOD,
    &path_trace::METHOD,
    &ulr::METHOD,
    &image_space_gather::METHOD,
    &lightmap_rt::METHOD,
    &light_field_probes::METHOD,
    &radiance_probes::METHOD,
    &many_light::METHOD,
];

/// A row of the table.
pub struct Method {
    /// `--method`.
    pub name: &'static str,
    /// One line of help.
    pub about: &'static str,
    /// What it reads that other stages have baked.
    pub reads: Reads,
    /// The layers that it computes by itself; the others come from a light map, or are seen directly.
    pub layers: &'static [&'static str],
    /// Options of `render-path`, without their dashes, that it uses of those that not every method uses.
    pub options: &'static [&'static str],
    /// What its samples are; `None` where frames have no number of samples.
    pub samples: Option<Samples>,
    /// Whether it sees a scene's transmissive shapes too.
    pub transmissive: bool,
    /// Whether it has cameras of parallel rays.
    pub orthographic: bool,
    /// Whether a frame may depend on the one before it: it does where it, on its own, has unserved pixels.
    pub sequential: bool,
    /// Variants that `evaluate` knows by name and shows beside it: a name, which is its own and more, and what `--variant` takes after it.
    pub variants: &'static [(&'static str, &'static str)],
    /// Its parameters, checked, from the options.
    pub parameters: fn(&Options) -> Result<Value>,
    /// Fills in what the scene says of them, where the options have left it open; and warnings.
    pub for_scene: fn(Value, &Scene) -> Result<ForScene>,
    /// Makes its renderer on the CPU.
    pub cpu: Constructor,
    /// Makes its renderer on a GPU; `None` where there is none.
    pub gpu: Option<GpuConstructor>,
    /// Makes its diffuse light for the frames of others; `None` where it has none for them.
    pub diffuse: Option<DiffuseConstructor>,
}

/// Makes a renderer from what frames are made of.
pub type Constructor = for<'a> fn(&Setup<'a>) -> Result<Box<dyn Renderer + 'a>>;
/// The same on a device.
pub type GpuConstructor = for<'a> fn(Arc<Gpu>, &Setup<'a>) -> Result<Box<dyn Renderer + 'a>>;

impl Method {
    /// The row of a name.
    pub fn find(name: &str) -> Result<&'static Self> {
        let known = || METHODS.iter().map(|m| m.name).collect::<Vec<_>>().join(", ");
        let row = METHODS.iter().copied().find(|m| m.name == name);
        row.ok_or_else(|| Error::Request(format!("no method \"{name}\"; there are {}", known())))
    }

    /// Whether it uses an option of `render-path`, of those that not every method uses.
    pub fn uses(&self, option: &str) -> bool {
        self.options.contains(&option)
    }

    /// Its parameters with another number of samples.
    pub fn with_samples(&self, parameters: &Value, count: u32) -> Value {
        let mut parameters = parameters.clone();
        if let Some(slot) = self.samples.as_ref().and_then(|s| parameters.pointer_mut(s.pointer)) {
            *slot = count.into();
        }
        parameters
    }

    /// The number of samples in its parameters.
    pub fn count(&self, parameters: &Value) -> Option<u32> {
        u32::try_from(parameters.pointer(self.samples.as_ref()?.pointer)?.as_u64()?).ok()
    }
}

/// What a method reads that other stages have baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reads {
    /// Probes.
    pub probes: Option<Probes>,
    /// The light map.
    pub lightmap: Need,
    /// The curvatures of the scene's vertices.
    pub curvature: Need,
}

impl Reads {
    /// Nothing.
    pub const NOTHING: Self = Self { probes: None, lightmap: Need::No, curvature: Need::No };

    /// Whether there is anything.
    pub fn any(&self) -> bool {
        *self != Self::NOTHING
    }
}

/// Probes that a method reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Probes {
    /// The stage that writes them.
    pub stage: &'static str,
    /// Whether it reads other texels than those that a bake for the views of a path chooses.
    pub any_texel: bool,
}

/// How much a method needs a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// It does not read it.
    No,
    /// A layer is black without it.
    Wanted,
    /// It does nothing without it.
    Required,
}

/// What a method's samples are.
pub struct Samples {
    /// The option that says how many.
    pub option: &'static str,
    /// Where the number stands in the method's parameters (a JSON pointer).
    pub pointer: &'static str,
}

/// Options of `render-path` from which methods take their parameters.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// `--supersample`.
    pub supersample: Option<u32>,
    /// `--spp`.
    pub spp: Option<u32>,
    /// `--samples`.
    pub samples: Option<u32>,
    /// `--max-depth`.
    pub max_depth: Option<u32>,
    /// `--layers`.
    pub layers: Option<LayerChoice>,
    /// `--rfilter`.
    pub rfilter: Option<FilterChoice>,
    /// `--denoise`, and by what; `Some(None)` leaves that open.
    pub denoise: Option<Option<Kind>>,
    /// `--trace`.
    pub trace: Option<String>,
    /// `--paper`.
    pub paper: bool,
    /// `--set NAME=VALUE`.
    pub set: Vec<String>,
}

/// What a path tracer computes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LayerChoice {
    /// The image and its layers: emission, diffuse, glossy; a path each for the latter two.
    #[default]
    All,
    /// The image alone, one path a sample.
    Full,
}

/// The filter of a path-traced frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FilterChoice {
    /// The pixel's own square.
    Box,
    /// That of the scene's film; where it names none, Mitsuba's Gaussian of half a pixel.
    Scene,
}

/// Parameters, and warnings.
pub type ForScene = (Value, Vec<String>);

/// [`Method::for_scene`] of a method that asks nothing of the scene.
pub fn as_given(parameters: Value, _: &Scene) -> Result<ForScene> {
    Ok((parameters, Vec::new()))
}

/// What frames are made of.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// The scene.
    pub world: &'a World,
    /// Lights, materials and objects that change from frame to frame.
    pub animation: Option<&'a Animation>,
    /// All views that will be rendered, in order.
    pub views: &'a [View],
    /// The method's parameters, as its row has checked them.
    pub parameters: &'a Value,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Diffuse light.
    pub lightmap: Option<&'a LightMap>,
    /// Curvatures of the scene's vertices.
    pub curvature: Option<&'a CurvatureMap>,
    /// Folder of probes.
    pub probes: Option<&'a Path>,
    /// Whose diffuse light frames have, where it is not the method's own.
    pub diffuse: Option<&'a Joined>,
    /// Whether frames shall show the buffers of their passes.
    pub inspect: bool,
    /// Memory that a GPU may be filled with, bytes.
    pub gpu_memory: u64,
}

impl<'a> Setup<'a> {
    /// The parameters in their own type.
    pub fn parameters<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        serde_json::from_value(self.parameters.clone()).map_err(|e| Error::Request(e.to_string()))
    }

    /// The world of a view's frame, where it is not that of the scene.
    pub fn world_at(&self, view: &View) -> Option<World> {
        self.animation.map(|animation| self.world.at(animation, view.frame))
    }

    /// The light map of a method that does nothing without it.
    pub fn required_lightmap(&self) -> Result<&'a LightMap> {
        self.lightmap.ok_or_else(|| Error::Request("a light map is needed: --lightmap FILE, written by bake-lightmap".into()))
    }

    /// The folder of probes of a method that does nothing without them.
    pub fn required_probes(&self) -> Result<PathBuf> {
        let folder =
            self.probes.ok_or_else(|| Error::Request("probes are needed: --probes DIR, written by bake-probes".into()))?;
        Ok(folder.into())
    }
}

/// What makes frames: one of a view at a number of samples.
pub trait Renderer {
    /// Renders a view; `next` is the one after it, where there is one. Methods without samples take no notice of their number. Advances
    /// `progress` by the view's rows.
    fn frame(&mut self, view: &View, next: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame>;

    /// Lets the next frame be the first of a path, for methods whose frames may depend on the one before.
    fn forget(&mut self) {}

    /// The GPU that frames are made on, and whether its own clock times their passes; `None` for the CPU.
    fn gpu(&self) -> Option<(&str, bool)> {
        None
    }

    /// Bytes that probes take at present, in the host's memory and on the GPU.
    fn probe_bytes(&self) -> [u64; 2] {
        [0; 2]
    }
}

/// A rendered view.
pub struct Frame {
    /// What it shows.
    pub picture: Picture,
    /// Milliseconds a pass, in order.
    pub passes: Vec<(&'static str, f64)>,
    /// Sub-pixels that neither a probe nor the frame before served; `None` for methods without probes.
    pub unserved: Option<usize>,
    /// What else was counted, by name.
    pub counts: Vec<(&'static str, f64)>,
    /// Layers that show how it came about, where they were asked for.
    pub inspected: Option<ExrImage>,
}

/// Linear radiance a pixel, rows from the top.
pub enum Picture {
    /// The layers, whose sum is the image.
    Layers(LayerImages),
    /// The image alone.
    Full(Vec<Rgb>),
}

impl Frame {
    /// A frame of layers, without anything else to tell.
    pub fn of(layers: LayerImages, passes: Vec<(&'static str, f64)>) -> Self {
        Self { picture: Picture::Layers(layers), passes, unserved: None, counts: Vec::new(), inspected: None }
    }

    /// Adds the picture and its layers to an image.
    pub fn with_pictures(&self, image: ExrImage) -> ExrImage {
        match &self.picture {
            Picture::Full(full) => image.with_rgb("", full),
            Picture::Layers(layers) => image
                .with_rgb("", &layers.full())
                .with_rgb("emission", &layers.emission)
                .with_rgb("diffuse", &layers.diffuse)
                .with_rgb("glossy", &layers.glossy),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_differ_in_name_and_their_defaults_are_in_range() {
        for (i, row) in METHODS.iter().enumerate() {
            assert!(METHODS[..i].iter().all(|other| other.name != row.name));
            let of_it = |name: &str| name.strip_prefix(row.name).is_some_and(|rest| rest.starts_with('-'));
            assert!(row.variants.iter().all(|(name, _)| of_it(name)), "{:?}", row.variants);
            let parameters = (row.parameters)(&Options::default()).unwrap();
            assert_eq!(row.samples.is_some(), row.count(&parameters).is_some(), "{}", row.name);
            if let Some(samples) = &row.samples {
                assert!(row.uses(samples.option) && row.uses("budget-ms") && row.uses("match-time"), "{}", row.name);
                assert_eq!(row.count(&row.with_samples(&parameters, 7)), Some(7));
            }
            let reads = [row.reads.probes.is_some(), row.reads.lightmap != Need::No, row.reads.curvature != Need::No];
            assert_eq!(["probes", "lightmap", "curvature"].map(|o| row.uses(o)), reads, "{}", row.name);
        }
        assert!(Method::find("magic").err().unwrap().to_string().contains("there are glossy-probes, path-trace"));
    }

    #[test]
    fn paper_parameters_are_in_range_and_can_be_said_in_json() {
        for row in METHODS.iter().filter(|row| row.uses("paper")) {
            let options = Options { paper: true, ..Options::default() };
            assert_ne!((row.parameters)(&options).unwrap(), (row.parameters)(&Options::default()).unwrap());
        }
    }
}
