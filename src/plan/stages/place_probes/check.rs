//! Options of `place-probes` that do not go together.

use super::PlaceProbes;
use crate::io::png;
use crate::probe::nonuniform::COVERAGE;
use crate::probe::placement::{PROBES_MAX, Placement};
use crate::{Error, Result};

/// Most passes of a refinement.
const PASSES_MAX: u32 = 10_000;

impl PlaceProbes {
    /// Refuses what does not go together.
    pub fn check(&self) -> Result<()> {
        self.check_method()?;
        if let Some(margin) = self.margin.filter(|m| !(m.is_finite() && *m >= 0.0)) {
            return Err(Error::Request(format!("--margin {margin}: expected metres, not negative")));
        }
        if let Some(bounds) = &self.bounds
            && !(bounds.0.iter().all(|x| x.is_finite()) && (0..3).all(|i| bounds.0[i] <= bounds.0[i + 3]))
        {
            return Err(Error::Request(format!(
                "--bounds {bounds}: expected x0,y0,z0,x1,y1,z1, the lower corner first, like -2,0,-2,2,2.5,2"
            )));
        }
        let density = [self.grid.is_some(), self.count.is_some(), self.spacing.is_some()];
        if density.into_iter().filter(|given| *given).count() > 1 {
            return Err(Error::Request("--grid, --count, --spacing: expected one of them".into()));
        }
        if self.bounds.is_some() && self.path.is_some() {
            return Err(Error::Request("--bounds, --path: expected one of them".into()));
        }
        for path in [&self.picture, &self.coverage_picture].into_iter().flatten() {
            png::check_png(path)?;
        }
        if self.picture.is_some() && self.picture == self.coverage_picture {
            return Err(Error::Request("--picture, --coverage-picture: expected two files".into()));
        }
        Ok(())
    }

    /// Refuses options that the method has no use for, and values out of their range.
    fn check_method(&self) -> Result<()> {
        let method = self.method.unwrap_or_default();
        let of_grid: &[Placement] = &[Placement::Grid];
        let (even, skeleton) = (&[Placement::Grid, Placement::Voxel][..], &[Placement::Sdf, Placement::MedialAxis][..]);
        for (option, is_given, methods) in [
            ("grid", self.grid.is_some(), of_grid),
            ("spacing", self.spacing.is_some(), even),
            ("margin", self.margin.is_some(), of_grid),
            ("coverage", self.coverage.is_some(), skeleton),
            ("refine", self.refine.is_some(), skeleton),
            ("refine-by", self.refine_by.is_some(), &[Placement::Voxel]),
        ] {
            if is_given && !methods.contains(&method) {
                let names: Vec<String> = methods.iter().map(Placement::to_string).collect();
                let have = if names.len() == 1 { "has" } else { "have" };
                let names = names.join(", ");
                return Err(Error::Request(format!("--{option}: --method {method} has no use for it; {names} {have}")));
            }
        }
        if method == Placement::Grid {
            return Ok(());
        }
        if let Some(spacing) = self.spacing.filter(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(Error::Request(format!("--spacing {spacing}: expected a positive number of metres")));
        }
        if let Some(count) = self.count.filter(|n| !(1..=PROBES_MAX as u32).contains(n)) {
            return Err(Error::Request(format!("--count {count}: expected from 1 to {PROBES_MAX} probes")));
        }
        if let Some(coverage) = self.coverage.filter(|c| !(*c > 0.0 && *c <= 1.0)) {
            return Err(Error::Request(format!("--coverage {coverage}: expected a share above 0, at most 1, like {COVERAGE}")));
        }
        if let Some(passes) = self.refine.filter(|n| *n > PASSES_MAX) {
            return Err(Error::Request(format!("--refine {passes}: expected at most {PASSES_MAX} passes")));
        }
        Ok(())
    }
}
