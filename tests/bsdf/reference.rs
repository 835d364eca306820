//! Our scattering models against Mitsuba's values, stored by scripts/bsdf_reference.py.

use super::models::{model, surface};
use glam::{Vec2, Vec3};
use reprobe::material::bsdf::{Lobes, Query};
use serde::Deserialize;

#[derive(Deserialize)]
struct Reference {
    wi: Vec<Vec3Json>,
    wo: Vec<Vec3Json>,
    cases: Vec<Case>,
    samples: Vec<SampleCase>,
}

type Vec3Json = [f32; 3];

/// Rows over wi, then wo: eval (diffuse RGB, non-diffuse RGB; or the whole, where not split) and pdf.
#[derive(Deserialize)]
struct Case {
    model: String,
    uv: [f32; 2],
    split: bool,
    rows: Vec<Vec<f32>>,
}

/// A delta sample: wo, weight, pdf, eta; null where the model is black.
#[derive(Deserialize)]
struct SampleCase {
    model: String,
    wi: Vec3Json,
    u: f32,
    sample: Option<[f32; 8]>,
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("../data/bsdf_reference.json")).unwrap()
}

/// Largest relative difference; values below 1e-4 count as that.
fn differences(ours: &[f32], theirs: &[f32]) -> f32 {
    let relative = |(a, b): (&f32, &f32)| (a - b).abs() / b.abs().max(a.abs()).max(1e-4);
    ours.iter().zip(theirs).map(relative).fold(0.0, f32::max)
}

/// Rounding (of half vectors between grazing directions above all), except that Mitsuba integrates the tables of `roughplastic` with few nodes (worst for smooth coatings at
/// grazing angles), and takes the tangent of a map's tilt from 1 - cos², which cancels.
fn tolerance(model: &str) -> f32 {
    match model.split('_').next() {
        Some("roughplastic") => 5e-3,
        Some("bumpmap" | "normalmap") => 5e-4,
        _ => 3e-5,
    }
}

#[test]
fn values_and_densities_are_mitsubas() {
    let reference = reference();
    let mut failures = Vec::new();
    for case in &reference.cases {
        let (bsdf, s) = (model(&case.model), surface(case.uv));
        assert_eq!(case.rows.len(), reference.wi.len() * reference.wo.len());
        let pairs = reference.wi.iter().flat_map(|wi| reference.wo.iter().map(move |wo| (wi, wo)));
        let mut worst: (f32, String) = (0.0, String::new());
        for ((wi, wo), row) in pairs.zip(&case.rows) {
            let (wi, wo) = (Vec3::from(*wi), Vec3::from(*wo));
            let eval = |lobes| bsdf.eval(&s, wi, wo, Query { lobes, ..Query::default() }).to_array();
            let mut ours =
                if case.split { [eval(Lobes::DIFFUSE), eval(Lobes::NON_DIFFUSE)].concat() } else { eval(Lobes::ALL).to_vec() };
            ours.push(bsdf.pdf(&s, wi, wo, Query::default()));
            let difference = differences(&ours, row);
            if difference > worst.0 || difference.is_nan() {
                worst = (difference, format!("wi {wi} wo {wo}: ours {ours:?}, Mitsuba's {row:?}"));
            }
        }
        println!("{} {:?}: {:.2e}", case.model, case.uv, worst.0);
        if worst.0.is_nan() || worst.0 > tolerance(&case.model) {
            failures.push(format!("{} at {:?}: {:.2e}, {}", case.model, case.uv, worst.0, worst.1));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(reference.cases.len() > 20);
}

#[test]
fn delta_samples_are_mitsubas() {
    for case in reference().samples {
        let (bsdf, s) = (model(&case.model), surface([0.3, 0.6]));
        let ours = bsdf.sample(&s, case.wi.into(), case.u, Vec2::new(0.3, 0.8), Query::default());
        let name = format!("{} wi {:?} u {}", case.model, case.wi, case.u);
        match (ours, case.sample) {
            (None, None) => {}
            (Some(b), Some(theirs)) => {
                let ours = [b.wo.to_array().as_slice(), &b.weight.to_array(), &[b.pdf, b.eta]].concat();
                assert!(b.delta && differences(&ours, &theirs) < 1e-4, "{name}: ours {ours:?}, Mitsuba's {theirs:?}");
            }
            (ours, theirs) => panic!("{name}: ours {ours:?}, Mitsuba's {theirs:?}"),
        }
    }
}
