//! The columns of the error tables, those by which methods are judged, and the table for a terminal.

use super::{Evaluation, FrameErrors, WITHOUT_NOISE, number};
use crate::metric::without_noise::WithoutNoise;
use serde_json::{Value, json};
use std::fmt::Write;

/// A column of the error tables.
pub(crate) struct Column {
    /// Where its number stands in `evaluation.json`: a field, or one of [`WITHOUT_NOISE`] after a dot.
    pub key: &'static str,
    /// Its head; *clean* is without the reference's noise.
    pub name: &'static str,
    /// Its number.
    pub of: fn(&FrameErrors) -> Option<f64>,
}

/// All of them; what is clean needs two references.
static COLUMNS: [Column; 11] = [
    Column { key: "rmse_rgb", name: "RMSE RGB", of: |e| Some(e.metrics.rmse_rgb) },
    Column { key: "without_noise.rmse_rgb", name: "clean RMSE RGB", of: |e| clean(e, |c| c.rmse_rgb) },
    Column { key: "rmse_lum", name: "RMSE Lum.", of: |e| Some(e.metrics.rmse_lum) },
    Column { key: "without_noise.rmse_lum", name: "clean RMSE Lum.", of: |e| clean(e, |c| c.rmse_lum) },
    Column { key: "dssim_rgb", name: "DSSIM RGB", of: |e| Some(e.metrics.dssim_rgb) },
    Column { key: "without_noise.dssim_rgb", name: "clean DSSIM RGB", of: |e| clean(e, |c| c.dssim_rgb) },
    Column { key: "dssim_lum", name: "DSSIM Lum.", of: |e| Some(e.metrics.dssim_lum) },
    Column { key: "without_noise.dssim_lum", name: "clean DSSIM Lum.", of: |e| clean(e, |c| c.dssim_lum) },
    Column { key: "flip", name: "FLIP", of: |e| Some(e.metrics.flip) },
    Column { key: "change", name: "change", of: |e| e.change },
    Column { key: "without_noise.change_rms", name: "clean change", of: |e| e.without_noise?.change_rms },
];

/// Keys of the columns that a verdict goes by: with one reference, and with two.
const JUDGING: [[&str; 4]; 2] = [
    ["rmse_rgb", "dssim_rgb", "flip", "change"],
    ["without_noise.rmse_rgb", "without_noise.dssim_rgb", "flip", "without_noise.change_rms"],
];

/// Columns of the table for a terminal.
const SHORT: [&str; 7] =
    ["rmse_rgb", "without_noise.rmse_rgb", "dssim_rgb", "without_noise.dssim_rgb", "flip", "change", "without_noise.change_rms"];

fn clean(errors: &FrameErrors, of: fn(&WithoutNoise) -> f64) -> Option<f64> {
    errors.without_noise.map(|clean| of(&clean.errors))
}

impl Column {
    /// Whether it tells of changes from frame to frame.
    pub fn is_change(&self) -> bool {
        self.key.ends_with("change") || self.key.ends_with("change_rms")
    }
}

impl Evaluation {
    /// Whether there were two references.
    pub fn has_pair(&self) -> bool {
        self.methods.iter().flat_map(|m| m.layers.values()).any(|l| l.mean.without_noise.is_some())
    }

    /// The columns that there are numbers for.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &'static Column> {
        let has_pair = self.has_pair();
        COLUMNS.iter().filter(move |c| has_pair || !c.key.starts_with(WITHOUT_NOISE))
    }

    /// Those that the verdict goes by: without the reference's noise where that can be had.
    pub(crate) fn judging(&self) -> impl Iterator<Item = &'static Column> {
        JUDGING[usize::from(self.has_pair())].iter().filter_map(|key| COLUMNS.iter().find(|c| c.key == *key))
    }

    /// The noise of one reference in a layer, by RMSE over RGB; `None` where there is one reference alone.
    pub fn noise(&self, layer: &str) -> Option<f64> {
        let of = |m: &super::MethodErrors| Some(m.layers.get(layer)?.mean.without_noise?.errors.noise_rmse_rgb);
        self.methods.iter().find_map(of)
    }

    /// What the columns are, in sentences.
    pub(crate) fn note(&self) -> String {
        let mut note = format!(
            "Errors are of display values (linear radiance times 2^{}, clamped, sRGB): RMSE, DSSIM = (1 - SSIM) / 2, FLIP; change is by \
             how much the signed error changes from one frame to the next, mean of its absolute value. Lower is better.",
            self.exposure
        );
        note += match self.has_pair() {
            true => {
                " What is called clean is without the reference's own noise, which two references of different seeds tell, and decides \
                 who is best; clean change is a root mean square, as of absolute values noise cannot be taken out. In all other \
                 numbers that noise is included."
            }
            false => " The reference's own noise is in every number, and in change in full, as it is new in every frame.",
        };
        note
    }

    /// The columns for the page: key, name, and whether methods are judged by it.
    pub(super) fn columns_of_page(&self) -> Value {
        let judges = |c: &Column| self.judging().any(|j| j.key == c.key);
        self.columns().map(|c| json!([c.key, c.name, judges(c)])).collect()
    }

    /// The means for a terminal, a line a method.
    pub fn table(&self) -> String {
        let columns: Vec<_> = self.columns().filter(|c| SHORT.contains(&c.key)).collect();
        let heads = columns.iter().map(|c| c.name.trim_end_matches(" RGB"));
        let widths: Vec<usize> = heads.clone().map(|h| h.len().max(6) + 2).collect();
        let name_width = self.methods.iter().map(|m| m.name.chars().count()).max().unwrap_or(0);
        let mut text = String::new();
        for layer in &self.layers {
            let heads: String = heads.clone().zip(&widths).map(|(h, &w)| format!("{h:>w$}")).collect();
            let title = format!("{layer}, mean of {}", self.frames.len());
            let name_width = name_width.max(title.len());
            let _ = writeln!(text, "{title:name_width$}{heads}");
            for (method, errors) in self.methods.iter().filter_map(|m| Some((m, m.layers.get(layer)?))) {
                let cell = |c: &Column| (c.of)(&errors.mean).map_or("-".into(), number);
                let cells: String = columns.iter().zip(&widths).map(|(c, &w)| format!("{:>w$}", cell(c))).collect();
                let _ = writeln!(text, "{:name_width$}{cells}", method.name);
            }
            if let Some(noise) = self.noise(layer) {
                let _ = writeln!(text, "clean: without the noise of the reference ({})", number(noise));
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use crate::metric::evaluation::tests::{example, with_pair};

    #[test]
    fn with_two_references_what_is_clean_judges() {
        let (one, _) = example();
        let two = with_pair();
        let names = |e: &super::Evaluation| e.judging().map(|c| c.name).collect::<Vec<_>>();
        assert_eq!(names(&one), ["RMSE RGB", "DSSIM RGB", "FLIP", "change"]);
        assert_eq!(names(&two), ["clean RMSE RGB", "clean DSSIM RGB", "FLIP", "clean change"]);
        assert_eq!((one.columns().count(), two.columns().count()), (6, 11));
        assert_eq!((one.noise("glossy"), two.noise("glossy")), (None, Some(0.005)));
    }

    #[test]
    fn the_terminal_has_changes_and_what_is_clean() {
        let (one, _) = example();
        let [one, two] = [one, with_pair()].map(|e| e.table());
        assert!(one.contains("change") && one.contains(".0100") && !one.contains("clean"), "{one}");
        for part in ["clean RMSE", "clean change", ".0150", "noise of the reference (.0050)"] {
            assert!(two.contains(part), "{part}\n{two}");
        }
        let lines: Vec<usize> = two.lines().filter(|l| !l.starts_with("clean")).map(str::len).collect();
        assert!(lines.iter().all(|l| *l == lines[0]), "{two}");
    }

    #[test]
    fn keys_are_where_the_json_has_the_numbers() {
        let evaluation = with_pair();
        let json = serde_json::to_value(&evaluation).unwrap();
        for column in evaluation.columns() {
            let pointer = format!("/methods/0/layers/glossy/frames/1/{}", column.key.replace('.', "/"));
            assert!(json.pointer(&pointer).is_some_and(|v| v.is_number()), "{pointer}");
        }
    }
}
