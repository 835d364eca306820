//! `reprobe bake-lightmap`.

use crate::common::{Common, Outcome};

/// Not yet
#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, _common: &Common) -> anyhow::Result<Outcome> {
    anyhow::bail!("not yet")
}
