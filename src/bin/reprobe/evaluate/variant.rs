//! `--variant NAME=METHOD,...`: a method with other parameters, other options or other bakes.

use crate::render_path::Method;
use crate::set_params::split;
use clap::ValueEnum;
use reprobe::metric::evaluation::Ablation;

/// An option of a command, and its value where it has one.
pub type Given = (String, Option<String>);

/// A method to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Its name in the tables, and that of the folder of its frames.
    pub name: String,
    /// `--method`.
    pub method: Method,
    /// Options of `render-path`.
    pub options: Vec<Given>,
    /// Parameters of its passes, as `--set` takes them.
    pub sets: Vec<String>,
    /// Options of the stages that bake for it.
    pub bakes: Vec<(String, Given)>,
    /// The experiment that it belongs to.
    pub ablation: Option<Ablation>,
}

/// The stages whose options a variant may change, in the order in which they run.
pub const STAGES: [&str; 6] = ["place-probes", "resmap", "qhmap", "curvature", "bake-lightmap", "bake-probes"];

impl Variant {
    /// A method as it is.
    pub fn plain(name: &str) -> Result<Self, String> {
        let method = Method::from_str(name, false).map_err(|_| {
            let known: Vec<String> =
                Method::value_variants().iter().filter_map(|m| Some(m.to_possible_value()?.get_name().to_owned())).collect();
            format!("no method \"{name}\"; there are {}", known.join(", "))
        })?;
        let (options, sets, bakes) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { name: name.into(), method, options, sets, bakes, ablation: None })
    }

    /// Parses `NAME=METHOD,WHAT,...`, where each WHAT is an option of `render-path` (`--spp=4`), an option of a stage
    /// (`bake-probes:--spp=64`) or a parameter of a pass (`gather.probes=1`).
    pub fn parse(text: &str) -> Result<Self, String> {
        let (name, rest) = text.split_once('=').ok_or("expected NAME=METHOD,... like one=glossy-probes,gather.probes=1")?;
        let usable = |c: char| c.is_ascii_alphanumeric() || "-_.+".contains(c);
        if name.is_empty() || name.starts_with('.') || !name.chars().all(usable) {
            return Err(format!("\"{name}\": expected a name of letters, digits, - _ . +, as it is that of a folder too"));
        }
        let mut parts = split(rest).into_iter();
        let mut variant = Self { name: name.into(), ..Self::plain(&parts.next().unwrap_or_default())? };
        for part in parts {
            variant.add(&part)?;
        }
        Ok(variant)
    }

    fn add(&mut self, part: &str) -> Result<(), String> {
        if part.starts_with("--") {
            self.options.push(given(part));
        } else if part.contains(":--") {
            self.bakes.push(parse_bake(part)?);
        } else if part.contains('=') {
            self.sets.push(part.into());
        } else {
            return Err(format!("\"{part}\": expected --OPTION=VALUE, STAGE:--OPTION=VALUE or PARAMETER=VALUE"));
        }
        Ok(())
    }

    /// `--method`.
    pub fn method_name(&self) -> String {
        self.method.to_possible_value().map_or_else(String::new, |v| v.get_name().into())
    }

    /// The value of an option of `render-path`.
    pub fn option(&self, name: &str) -> Option<&str> {
        self.options.iter().find(|(n, _)| n == name)?.1.as_deref()
    }

    /// What differs from the method's defaults, for people.
    pub fn differences(&self) -> Vec<String> {
        let text = |(name, value): &Given| value.as_ref().map_or(name.clone(), |v| format!("{name}={v}"));
        let bakes = self.bakes.iter().map(|(stage, given)| format!("{stage}:{}", text(given)));
        self.options.iter().map(text).chain(self.sets.iter().cloned()).chain(bakes).collect()
    }
}

fn given(text: &str) -> Given {
    match text.split_once('=') {
        Some((name, value)) => (name.into(), Some(value.into())),
        None => (text.into(), None),
    }
}

/// Parses `STAGE:--OPTION=VALUE`.
pub fn parse_bake(text: &str) -> Result<(String, Given), String> {
    match text.split_once(':') {
        Some((stage, option)) if STAGES.contains(&stage) && option.starts_with("--") => Ok((stage.into(), given(option))),
        _ => Err(format!("\"{text}\": expected STAGE:--OPTION=VALUE, the stage one of {}", STAGES.join(", "))),
    }
}

/// Experiments that are known by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Ablations {
    /// Figures 12 to 15 of Rodriguez et al. 2020
    Paper,
}

/// Name of the whole method, which the ablations are compared with.
pub const WHOLE: &str = "glossy-probes";

/// Figures 12 to 15, and the filters of Figure 10. `probes` is the number of probes of the whole method.
///
/// As in the paper, Figures 12 and 13 are of probes of half roughness, without the filter; every pixel is then searched for in full, as the paper does, since a pixel
/// that begins where its neighbour ended searches further than its own window.
pub fn paper(probes: u32) -> Result<Vec<Variant>, String> {
    let half = format!("place-probes:--count={}", (probes / 2).max(1));
    let double = format!("place-probes:--count={}", 2 * probes);
    let unfiltered = "footprint=null,gather.anchors=1,bake-probes:--roughness-scale=0.5";
    let list = [
        ("half-roughness", "Fig. 15", "probes of half roughness", WHOLE, "bake-probes:--roughness-scale=0.5".into()),
        ("unfiltered", "Fig. 15", "no filter, half roughness", "half-roughness", unfiltered.to_owned()),
        ("full-roughness", "Fig. 15", "no filter, full roughness", WHOLE, "footprint=null".into()),
        ("lat-long", "Fig. 12", "lat-long probes", WHOLE, "qhmap:--lat-long".into()),
        ("one-probe-unfiltered", "Fig. 12", "one probe, no filter", "unfiltered", format!("{unfiltered},gather.probes=1")),
        (
            "one-lat-long-unfiltered",
            "Fig. 12",
            "one lat-long probe, no filter",
            "one-probe-unfiltered",
            format!("{unfiltered},gather.probes=1,qhmap:--lat-long"),
        ),
        (
            "planar",
            "Fig. 13",
            "reflectors as planes, no filter",
            "unfiltered",
            format!("{unfiltered},gather.perturb.order=plane"),
        ),
        (
            "first-order",
            "Fig. 13",
            "perturbation of first order, no filter",
            "unfiltered",
            format!("{unfiltered},gather.perturb.order=first,gather.perturb.newton=0"),
        ),
        (
            "second-order",
            "Fig. 13",
            "perturbation of second order without Newton steps, no filter",
            "unfiltered",
            format!("{unfiltered},gather.perturb.newton=0"),
        ),
        (
            "small-search",
            "Fig. 13",
            "search of 3x3 and 3x3, no filter",
            "unfiltered",
            format!(r#"{unfiltered},gather.search=[{{"radius":1,"step":4}},{{"radius":1,"step":2}}]"#),
        ),
        (
            "one-level",
            "Fig. 13",
            "search of one level, no filter",
            "unfiltered",
            format!(r#"{unfiltered},gather.search=[{{"radius":3,"step":4}}]"#),
        ),
        ("one-probe", "Fig. 14", "one probe of eight", WHOLE, "gather.probes=1".into()),
        ("four-probes", "Fig. 14", "four probes of eight", WHOLE, "gather.probes=4".into()),
        ("half-count", "Fig. 14", "half as many probes baked", WHOLE, half),
        ("double-count", "Fig. 14", "twice as many probes baked", WHOLE, double),
        ("full-filter", "Fig. 10", "full 2D filter", WHOLE, "filter.method=full".into()),
        ("two-pass-filter", "Fig. 10", "filter of two passes", WHOLE, "filter.method=two_pass".into()),
    ];
    list.into_iter()
        .map(|(name, figure, what, against, change)| {
            let ablation = Ablation { figure: figure.into(), what: what.into(), against: against.into() };
            Ok(Variant { ablation: Some(ablation), ..Variant::parse(&format!("{name}={WHOLE},{change}"))? })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set_params::apply;
    use reprobe::method::glossy_probes::GlossyProbeParams;

    #[test]
    fn a_variant_tells_options_of_frames_and_bakes_and_parameters_apart() {
        let v = Variant::parse("x=glossy-probes,--spp=4,--paper,bake-probes:--spread,gather.search=[],footprint=null").unwrap();
        assert_eq!(v.options, [("--spp".into(), Some("4".into())), ("--paper".into(), None)]);
        assert_eq!(v.bakes, [("bake-probes".into(), ("--spread".into(), None))]);
        assert_eq!(v.sets, ["gather.search=[]", "footprint=null"]);
        assert_eq!((v.option("--spp"), v.option("--paper")), (Some("4"), None));
        for (text, expected) in [
            ("x", "NAME=METHOD"),
            ("x=", "there are glossy-probes"),
            ("x=magic", "no method \"magic\""),
            ("../x=glossy-probes", "name of letters"),
            ("x=glossy-probes,fast", "\"fast\": expected"),
            ("x=glossy-probes,compare:--layer=glossy", "the stage one of"),
        ] {
            let message = Variant::parse(text).unwrap_err();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }

    #[test]
    fn the_papers_ablations_are_compared_with_one_another_and_change_what_there_is() {
        let variants = paper(64).unwrap();
        for v in &variants {
            let against = &v.ablation.as_ref().unwrap().against;
            assert!(against == WHOLE || variants.iter().any(|w| w.name == *against), "{}: {against}", v.name);
            assert!(variants.iter().filter(|w| w.name == v.name).count() == 1 && v.name != WHOLE);
            let changed = apply(&GlossyProbeParams::default(), &v.sets).unwrap();
            assert!(changed != GlossyProbeParams::default() || !v.bakes.is_empty(), "{} changes nothing", v.name);
        }
        assert!(variants.iter().any(|v| v.differences() == ["place-probes:--count=32"]));
    }
}
