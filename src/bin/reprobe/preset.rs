//! `--preset`.

/// What a preset stands for
#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
pub enum Preset {
    /// A look in some 3 minutes on 2 cores
    Draft,
    /// A judgement in some 20 minutes on 2 cores
    Medium,
    /// 252 probes of 1024x512 at 2048 paths a texel, 1920x1080
    Paper,
}

impl From<Preset> for reprobe::plan::settings::Preset {
    fn from(preset: Preset) -> Self {
        match preset {
            Preset::Draft => Self::Draft,
            Preset::Medium => Self::Medium,
            Preset::Paper => Self::Paper,
        }
    }
}
