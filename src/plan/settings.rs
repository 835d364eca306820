//! Presets: numbers of all stages at once.

use super::option::Size;

/// What a preset stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// A look in some 3 minutes on 2 cores.
    Draft,
    /// A judgement in some 20 minutes on 2 cores.
    Medium,
    /// 252 probes of 1024x512 at 2048 paths a texel, 1920x1080.
    Paper,
}

/// Numbers of all stages.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Probes to aim at.
    pub probes: u32,
    /// Size of a probe, texels.
    pub probe_size: Size,
    /// Paths a probe's texel; the most, where it has an error to reach.
    pub spp: u32,
    /// Standard error at which a probe's texel is done.
    pub error: Option<f32>,
    /// Paths a light map's texel; the most, where it has an error to reach.
    pub lightmap_spp: u32,
    /// Standard error at which a light map's texel is done.
    pub lightmap_error: Option<f32>,
    /// Paths a light map's texel in a first pass; 0 for none.
    pub lightmap_first_spp: u32,
    /// Whether the noise is taken out of the light map.
    pub lightmap_denoise: bool,
    /// Texels of the light map.
    pub lightmap_texels: u32,
    /// Edge of a light map's texel, metres, in place of their number.
    pub texel: Option<f32>,
    /// Size of the frames; `None` for the path's own.
    pub size: Option<Size>,
    /// Rays a pixel along one side.
    pub supersample: u32,
    /// Paths a pixel of the reference.
    pub reference_spp: u32,
    /// Bake all texels, in place of those that the path's views use.
    pub all_texels: bool,
    /// The paper's text in every choice.
    pub paper: bool,
}

impl Preset {
    /// The preset's numbers; the size is the path's own where there is one and the preset is the paper's.
    pub fn settings(self, has_path: bool) -> Settings {
        let settings = match self {
            Self::Draft => Settings {
                probes: 12,
                probe_size: Size([256, 128]),
                spp: 64,
                error: Some(0.15),
                lightmap_spp: 64,
                lightmap_error: Some(0.2),
                lightmap_first_spp: 8,
                lightmap_denoise: true,
                lightmap_texels: 150_000,
                texel: None,
                size: Some(Size([320, 180])),
                supersample: 2,
                reference_spp: 32,
                all_texels: false,
                paper: false,
            },
            Self::Medium => Settings {
                probes: 64,
                probe_size: Size([512, 256]),
                lightmap_error: Some(0.15),
                lightmap_texels: 1_000_000,
                size: Some(Size([480, 270])),
                reference_spp: 256,
                ..Self::Draft.settings(has_path)
            },
            Self::Paper => Settings {
                probes: 252,
                probe_size: Size([1024, 512]),
                spp: 2048,
                error: None,
                lightmap_spp: 2048,
                lightmap_error: None,
                lightmap_first_spp: 0,
                lightmap_denoise: false,
                lightmap_texels: 4_000_000,
                size: (!has_path).then_some(Size([1920, 1080])),
                supersample: 1,
                reference_spp: 1024,
                all_texels: true,
                ..Self::Draft.settings(has_path)
            },
        };
        // Without a path there are no views to bake for.
        Settings { all_texels: settings.all_texels || !has_path, ..settings }
    }
}
