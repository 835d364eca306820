//! `curvature`.

use crate::Result;
use crate::base::clock::seconds;
use crate::base::named::within;
use crate::io::Provenance;
use crate::plan::option::stage;
use crate::plan::{Context, Outcome};
use crate::surface::{CurvatureParams, curvature, curvature_file};
use serde_json::json;
use std::path::PathBuf;

stage! {
    /// Estimates the principal curvatures at every vertex.
    Curvature "curvature"
    {
        /// The scene.
        scene,
    }
    {
        /// Average with neighbours whose normals differ by less than this, degrees.
        "--regularize" regularize: Option<f32>,
        /// Leave coarse flat parts as they are.
        "--no-tessellation" no_tessellation: bool,
        /// The table to write.
        "--output" output: PathBuf,
    }
}

impl Curvature {
    fn params(&self) -> Result<CurvatureParams> {
        let base = CurvatureParams::default();
        let regularize_degrees = self.regularize.unwrap_or(base.regularize_degrees);
        within("--regularize", regularize_degrees, 0.0..=90.0)?;
        let mut params = CurvatureParams { regularize_degrees, ..base };
        if self.no_tessellation {
            params.tessellation.max_triangles = 0;
        }
        Ok(params)
    }

    /// Refuses options that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads the scene, estimates, writes.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let params = self.params()?;
        let world = cx.opaque_world(&self.scene)?;
        let scene = &world.scene;
        let clock = seconds();
        let map = curvature(&scene.geometry, &params, cx.progress());
        let seconds = clock();
        curvature_file::write(&map, &self.output, Provenance::new(Self::COMMAND, &scene.hash, cx.seed, &params))?;
        let curved = map.k1.iter().zip(&map.k2).filter(|(a, b)| **a != 0.0 || **b != 0.0).count();
        let (vertices, triangles) = (map.k1.len(), scene.geometry.triangles.len());
        Ok(Outcome {
            summary: format!("{}: {vertices} vertices, {curved} of them curved, in {seconds:.2} s", self.output.display()),
            figures: json!({"vertices": vertices, "triangles": triangles, "curved": curved, "seconds": seconds}),
            ..Outcome::default()
        })
    }
}
