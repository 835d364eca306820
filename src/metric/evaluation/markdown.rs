//! The tables of §7.3 as Markdown.

use super::{Costs, Evaluation, number};
use std::collections::BTreeSet;
use std::fmt::Write;

/// Errors as in Table 1, ablations, times as in Table 2, probes as in Table 3.
pub fn markdown(evaluation: &Evaluation, costs: &Costs) -> String {
    let [w, h] = evaluation.size;
    let mut out = format!(
        "# {}, {}\n\n{} frames of {w} x {h}. Reference: {}. {}\n",
        evaluation.scene,
        evaluation.path,
        evaluation.frames.len(),
        evaluation.reference,
        evaluation.note(),
    );
    let variants = evaluation.variants(costs);
    if !variants.is_empty() {
        out += "\n";
    }
    for line in variants {
        let _ = writeln!(out, "- {line}");
    }
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
    let columns: Vec<_> = evaluation.columns().collect();
    let names: Vec<&str> = ["method"].into_iter().chain(columns.iter().map(|c| c.name)).chain(["ms a frame"]).collect();
    let mut out = format!("\n{}", head(&names));
    let rows: Vec<_> = evaluation.contenders().filter_map(|m| Some((m, &m.layers.get(layer)?.mean))).collect();
    for (method, mean) in &rows {
        let cells = columns.iter().map(|c| match (c.of)(mean) {
            None => "-".into(),
            Some(x) if rows.len() > 1 && rows.iter().all(|(_, other)| (c.of)(other) >= Some(x)) => format!("**{}**", number(x)),
            Some(x) => number(x),
        });
        let ms = costs.methods.get(&method.name).map_or("-".into(), |c| format!("{:.0}", c.frame_ms));
        out += &row([method.name.clone()].into_iter().chain(cells).chain([ms]));
    }
    out
}

/// Figures 12 to 15 as numbers.
fn ablations(evaluation: &Evaluation, layer: &str) -> String {
    let columns: Vec<_> = evaluation.judging().collect();
    let mut out = String::new();
    for method in &evaluation.methods {
        let (Some(ablation), Some(errors)) = (&method.ablation, method.layers.get(layer)) else { continue };
        if out.is_empty() {
            let names = columns.iter().map(|c| c.name);
            let names: Vec<&str> = ["figure", "variant", "what"].into_iter().chain(names).chain(["against"]).collect();
            out = format!("\nAblations: error, and in brackets that of what it is compared with\n\n{}", head(&names));
        }
        let against = evaluation.method(&ablation.against).and_then(|m| m.layers.get(layer));
        let cells = columns.iter().map(|c| {
            let text = |x: Option<f64>| x.map_or("-".into(), number);
            let base = against.map_or(String::new(), |b| format!(" ({})", text((c.of)(&b.mean))));
            text((c.of)(&errors.mean)) + &base
        });
        let names = [ablation.figure.clone(), method.name.clone(), ablation.what.clone()];
        out += &row(names.into_iter().chain(cells).chain([ablation.against.clone()]));
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
    use crate::metric::evaluation::tests::{example, with_pair};

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

    #[test]
    fn what_is_clean_stands_beside_what_is_not() {
        let (_, mut costs) = example();
        costs.methods.entry("ours".to_owned()).and_modify(|c| c.denoiser = Some("oidn 2.3.0".into()));
        let text = markdown(&with_pair(), &costs);
        for part in [
            "| method | RMSE RGB | clean RMSE RGB |",
            "| ours | **.0300** | .0150 |",
            "| Fig. 14 | one-probe | one probe | .0300 (.0150) |",
            "without the reference's own noise",
            "- ours: glossy-probes, denoised by oidn 2.3.0\n",
        ] {
            assert!(text.contains(part), "{part}\n{text}");
        }
    }
}
