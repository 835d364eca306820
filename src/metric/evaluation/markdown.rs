//! The tables of §7.3 as Markdown.

use super::{COLUMNS, Costs, Evaluation, MethodErrors, number};
use std::collections::BTreeSet;
use std::fmt::Write;

/// Errors as in Table 1, ablations, times as in Table 2, probes as in Table 3.
pub fn markdown(evaluation: &Evaluation, costs: &Costs) -> String {
    let [w, h] = evaluation.size;
    let mut out = format!(
        "# {}, {}\n\n{} frames of {w} x {h}. Reference: {}. Errors are of display values (linear radiance times 2^{}, clamped, sRGB): \
         RMSE, DSSIM = (1 - SSIM) / 2, FLIP; *change* is the mean change of the signed error from one frame to the next. Lower is better.\n",
        evaluation.scene,
        evaluation.path,
        evaluation.frames.len(),
        evaluation.reference,
        evaluation.exposure,
    );
    for layer in &evaluation.layers {
        let _ = write!(out, "\n## Error, {}\n\n", layer_title(layer));
        for line in evaluation.verdict(layer, costs) {
            let _ = writeln!(out, "- {line}");
        }
        out += &errors(evaluation, layer, costs);
        out += &ablations(evaluation, layer);
    }
    out + &precomputation(costs) + &times(evaluation, costs) + &probes(evaluation, costs)
}

/// What people call a layer.
pub(super) fn layer_title(layer: &str) -> &str {
    match layer {
        "full" => "full image",
        "glossy" => "glossy layer",
        other => other,
    }
}

fn row<S: AsRef<str>>(cells: impl IntoIterator<Item = S>) -> String {
    let cells: Vec<String> = cells.into_iter().map(|c| c.as_ref().replace('|', "\\|")).collect();
    format!("| {} |\n", cells.join(" | "))
}

fn head(cells: &[&str]) -> String {
    row(cells) + &format!("|{}\n", "---|".repeat(cells.len()))
}

/// Table 1.
fn errors(evaluation: &Evaluation, layer: &str, costs: &Costs) -> String {
    let names: Vec<&str> = ["method"].into_iter().chain(COLUMNS.map(|c| c.1)).chain(["ms a frame"]).collect();
    let mut out = format!("\n{}", head(&names));
    let rows: Vec<_> = evaluation.contenders().filter_map(|m| Some((m, m.layers.get(layer)?.mean.columns()))).collect();
    for (method, columns) in &rows {
        let cells = columns.iter().enumerate().map(|(i, value)| match value {
            None => "-".into(),
            Some(x) if rows.len() > 1 && rows.iter().all(|(_, c)| c[i] >= Some(*x)) => format!("**{}**", number(*x)),
            Some(x) => number(*x),
        });
        let ms = costs.methods.get(&method.name).map_or("-".into(), |c| format!("{:.0}", c.frame_ms));
        out += &row([method.name.clone()].into_iter().chain(cells).chain([ms]));
    }
    out
}

/// Figures 12 to 15 as numbers.
fn ablations(evaluation: &Evaluation, layer: &str) -> String {
    let of = |m: &MethodErrors| Some(m.layers.get(layer)?.mean);
    let mut out = String::new();
    for method in &evaluation.methods {
        let (Some(ablation), Some(errors)) = (&method.ablation, of(method)) else { continue };
        if out.is_empty() {
            out = format!(
                "\nAblations: error, and in brackets that of what it is compared with\n\n{}",
                head(&["figure", "variant", "what", "RMSE RGB", "DSSIM RGB", "FLIP", "change", "against"])
            );
        }
        let against = evaluation.method(&ablation.against).and_then(of);
        let cell = |column: usize| {
            let text = |x: Option<f64>| x.map_or("-".into(), number);
            let base = against.map_or(String::new(), |b| format!(" ({})", text(b.columns()[column])));
            text(errors.columns()[column]) + &base
        };
        let names = [ablation.figure.clone(), method.name.clone(), ablation.what.clone()];
        out += &row(names.into_iter().chain([0, 2, 4, 5].map(cell)).chain([ablation.against.clone()]));
    }
    out
}

/// The upper half of Table 2.
fn precomputation(costs: &Costs) -> String {
    if costs.stages.is_empty() {
        return String::new();
    }
    let mut out = format!("\n## Time of the precomputation\n\n{}", head(&["stage", "seconds", "for"]));
    for stage in &costs.stages {
        out += &row([stage.stage.clone(), stage.seconds.map_or("-".into(), |s| format!("{s:.1}")), stage.methods.join(", ")]);
    }
    out
}

/// The lower half of Table 2.
fn times(evaluation: &Evaluation, costs: &Costs) -> String {
    let passes: BTreeSet<&String> = costs.methods.values().flat_map(|c| c.passes_ms.keys()).collect();
    if passes.is_empty() {
        return String::new();
    }
    let mut names = vec!["method"];
    names.extend(passes.iter().map(|p| p.as_str()));
    names.push("sum");
    let mut out = format!("\n## Time of a frame, milliseconds a pass\n\n{}", head(&names));
    for method in &evaluation.methods {
        let Some(cost) = costs.methods.get(&method.name) else { continue };
        let cells = passes.iter().map(|p| cost.passes_ms.get(*p).map_or("-".into(), |ms| format!("{ms:.0}")));
        out += &row([method.name.clone()].into_iter().chain(cells).chain([format!("{:.0}", cost.frame_ms)]));
    }
    out
}

/// Table 3: probes times resolution, with time and memory.
fn probes(evaluation: &Evaluation, costs: &Costs) -> String {
    let mut out = String::new();
    for method in &evaluation.methods {
        let Some((cost, probes)) = costs.methods.get(&method.name).and_then(|c| Some((c, c.probes.as_ref()?))) else { continue };
        if out.is_empty() {
            let names = ["method", "probes", "baked", "texels", "memory", "precomputation", "a frame"];
            out = format!("\n## Probes, resolution, time and memory\n\n{}", head(&names));
        }
        out += &row([
            method.name.clone(),
            probes.count.to_string(),
            probes.baked.to_string(),
            format!("{} x {}", probes.size[0], probes.size[1]),
            format!("{:.0} MB", probes.bytes as f64 / 1e6),
            cost.precompute_seconds.map_or("given".into(), |s| format!("{s:.0} s")),
            format!("{:.0} ms", cost.frame_ms),
        ]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::evaluation::tests::example;

    #[test]
    fn tables_have_a_row_a_method_and_the_best_in_bold() {
        let (evaluation, costs) = example();
        let text = markdown(&evaluation, &costs);
        for line in [
            "| ours | **.0300** | **.0000** | **.0600** | **.0000** | **.0000** | **.0100** | 42 |",
            "| Fig. 14 | one-probe | one probe | .0600 (.0300) | .1200 (.0600) | .0000 (.0000) | .0100 (.0100) | ours |",
            "| curvature | 61.0 | ours |",
            "| ours | 12 | 30 | 42 |",
            "| ours | 12 | 9 | 256 x 128 | 9 MB | 61 s | 42 ms |",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
        assert!(!text.contains("**.0450**"));
        let table = |line: &str| line.starts_with('|');
        for block in text.split("\n\n").filter(|b| b.lines().all(table)) {
            let columns: BTreeSet<usize> = block.lines().map(|l| l.matches('|').count()).collect();
            assert_eq!(columns.len(), 1, "{block}");
        }
    }
}
