//! `NAME=METHOD,...`: a method with other parameters, other options or other bakes; those that are known by name.

use super::stage::BAKES;
use super::{Context, Stage};
use crate::base::named::split;
use crate::method::{METHODS, Method};
use crate::metric::evaluation::Ablation;
use crate::view::oidn::Oidn;
use crate::{Error, Result};

/// An option of a command, and its value where it has one.
pub type Given = (String, Option<String>);

/// A method to evaluate.
#[derive(Clone)]
pub struct Variant {
    /// Its name in the tables, and that of the folder of its frames.
    pub name: String,
    /// `--method`.
    pub method: &'static Method,
    /// Options of `render-path`.
    pub options: Vec<Given>,
    /// Parameters of its passes, as `--set` takes them.
    pub sets: Vec<String>,
    /// Options of the stages that bake for it.
    pub bakes: Vec<(String, Given)>,
    /// The experiment that it belongs to.
    pub ablation: Option<Ablation>,
}

impl Variant {
    /// A method as it is.
    pub fn plain(name: &str) -> std::result::Result<Self, String> {
        let method = Method::find(name).map_err(|e| e.to_string())?;
        let (options, sets, bakes) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { name: name.into(), method, options, sets, bakes, ablation: None })
    }

    /// Parses `NAME=METHOD,WHAT,...`, where each WHAT is an option of `render-path` (`--spp=4`), an option of a stage
    /// (`bake-probes:--spp=64`) or a parameter of a pass (`gather.probes=1`).
    pub fn parse(text: &str) -> std::result::Result<Self, String> {
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

    fn add(&mut self, part: &str) -> std::result::Result<(), String> {
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

    /// The value of an option of `render-path`.
    pub fn option(&self, name: &str) -> Option<&str> {
        self.options.iter().find(|(n, _)| n == name)?.1.as_deref()
    }

    /// Gives `stage` those options that are the variant's own for it.
    pub fn configure(&self, stage: &mut Stage) -> Result<()> {
        configure(stage, &self.bakes)
    }

    /// Whether it asks for Open Image Denoise, and for nothing in its place.
    fn needs_oidn(&self) -> bool {
        self.option("--denoise") == Some("oidn")
    }

    /// What differs from the method's defaults, for people.
    pub fn differences(&self) -> Vec<String> {
        let text = |(name, value): &Given| value.as_ref().map_or(name.clone(), |v| format!("{name}={v}"));
        let bakes = self.bakes.iter().map(|(stage, given)| format!("{stage}:{}", text(given)));
        self.options.iter().map(text).chain(self.sets.iter().cloned()).chain(bakes).collect()
    }
}

/// Gives `stage` those of `options` that are meant for it.
pub fn configure(stage: &mut Stage, options: &[(String, Given)]) -> Result<()> {
    let command = stage.command();
    for (_, (option, value)) in options.iter().filter(|(name, _)| name == command) {
        stage.set(option, value.as_deref()).map_err(|e| Error::Request(format!("{command}:{option}: {e}")))?;
    }
    Ok(())
}

fn given(text: &str) -> Given {
    match text.split_once('=') {
        Some((name, value)) => (name.into(), Some(value.into())),
        None => (text.into(), None),
    }
}

/// Parses `STAGE:--OPTION=VALUE`.
pub fn parse_bake(text: &str) -> std::result::Result<(String, Given), String> {
    match text.split_once(':') {
        Some((stage, option)) if BAKES.contains(&stage) && option.starts_with("--") => Ok((stage.into(), given(option))),
        _ => Err(format!("\"{text}\": expected STAGE:--OPTION=VALUE, the stage one of {}", BAKES.join(", "))),
    }
}

/// Stands in `--methods` for every method and its variants.
pub const ALL: &str = "all";

/// What `--methods` takes.
#[derive(Clone)]
pub enum Named {
    /// [`ALL`].
    All,
    /// A method, or a variant of the table of methods.
    One(Variant),
}

impl Named {
    /// By its name.
    pub fn parse(name: &str) -> std::result::Result<Self, String> {
        if name == ALL {
            return Ok(Self::All);
        }
        let known = known()?;
        let found = known.iter().find(|v| v.name == name).cloned();
        let names = || known.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", ");
        found.map(Self::One).ok_or_else(|| format!("no method \"{name}\"; there are {ALL}, {}", names()))
    }
}

/// All methods, each before its variants.
fn known() -> std::result::Result<Vec<Variant>, String> {
    let variants =
        |m: &'static Method| m.variants.iter().map(move |(name, what)| Variant::parse(&format!("{name}={},{what}", m.name)));
    METHODS.iter().copied().flat_map(|m| std::iter::once(Variant::plain(m.name)).chain(variants(m))).collect()
}

/// What `named` comes to, in order; says which of [`ALL`] this machine lacks the denoiser for.
pub fn chosen(named: &[Named], cx: &Context) -> Result<Vec<Variant>> {
    let wants_all = named.iter().any(|n| matches!(n, Named::All));
    let missing = wants_all.then(|| Oidn::found().err()).flatten();
    let (variants, left_out) = expand(named, missing.is_none()).map_err(Error::Request)?;
    if let Some(why) = missing.filter(|_| !left_out.is_empty()) {
        cx.listener.warn(&format!("{ALL} leaves out {}: {why}", left_out.join(", ")));
    }
    Ok(variants)
}

/// What `named` comes to, and the names that [`ALL`] leaves out where there is no Open Image Denoise.
fn expand(named: &[Named], has_oidn: bool) -> std::result::Result<(Vec<Variant>, Vec<String>), String> {
    let (mut variants, mut left_out) = (Vec::new(), Vec::new());
    for name in named {
        match name {
            Named::One(variant) => variants.push(variant.clone()),
            Named::All => {
                let (usable, others): (Vec<_>, Vec<_>) = known()?.into_iter().partition(|v| has_oidn || !v.needs_oidn());
                variants.extend(usable);
                left_out.extend(others.into_iter().map(|v| v.name));
            }
        }
    }
    Ok((variants, left_out))
}

/// Name of the whole method, which the ablations are compared with.
pub const WHOLE: &str = "glossy-probes";

/// Figures 12 to 15, and the filters of Figure 10. `probes` is the number of probes of the whole method.
///
/// As in the paper, Figures 12 and 13 are of probes of half roughness, without the filter; every pixel is then searched for in full, as the paper does, since a pixel
/// that begins where its neighbour ended searches further than its own window.
pub fn paper_ablations(probes: u32) -> std::result::Result<Vec<Variant>, String> {
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
    use crate::base::named::apply;
    use crate::method::Need;
    use crate::method::glossy_probes::GlossyProbeParams;
    use crate::plan::stages::RenderPath;

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
            let message = Variant::parse(text).err().unwrap();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }

    fn names(named: &[&str], has_oidn: bool) -> (Vec<String>, Vec<String>) {
        let named: Vec<Named> = named.iter().map(|n| Named::parse(n).unwrap()).collect();
        let (variants, left_out) = expand(&named, has_oidn).unwrap();
        (variants.into_iter().map(|v| v.name).collect(), left_out)
    }

    #[test]
    fn all_is_every_method_and_its_variants_but_for_a_denoiser_that_is_not_there() {
        let whole = [
            "glossy-probes",
            "glossy-probes-rays",
            "path-trace",
            "path-trace-filter",
            "path-trace-oidn",
            "ulr",
            "image-space-gather",
            "lightmap-rt",
            "lightmap-rt-oidn",
            "light-field-probes",
            "radiance-probes",
            "many-light",
        ];
        assert_eq!(names(&["all"], true), (whole.map(str::to_owned).to_vec(), vec![]));
        let (without, left_out) = names(&["all"], false);
        assert_eq!(left_out, ["path-trace-oidn", "lightmap-rt-oidn"]);
        assert!(without.len() == whole.len() - 2 && left_out.iter().all(|name| !without.contains(name)));
        // What is asked for by its name stays, and is an error later.
        assert_eq!(names(&["ulr", "path-trace-oidn"], false).0, ["ulr", "path-trace-oidn"]);
        let message = Named::parse("path-trace-odin").err().unwrap();
        assert!(message.contains("there are all, glossy-probes, glossy-probes-rays"), "{message}");
    }

    /// A row's text is parsed when somebody asks for it, and its options are checked then.
    #[test]
    fn variants_of_the_table_are_what_their_methods_take() {
        for variant in known().unwrap().iter().filter(|v| !v.needs_oidn() || Oidn::found().is_ok()) {
            let [file, folder] = ["file", "folder"].map(std::path::PathBuf::from);
            let reads = variant.method.reads;
            let mut stage = RenderPath {
                method: Some(variant.method.name.into()),
                probes: reads.probes.map(|_| folder),
                lightmap: (reads.lightmap != Need::No).then(|| file.clone()),
                curvature: (reads.curvature != Need::No).then_some(file),
                set: variant.sets.clone(),
                ..RenderPath::default()
            };
            for (option, value) in &variant.options {
                stage.set(option, value.as_deref()).unwrap();
            }
            stage.check().unwrap_or_else(|e| panic!("{}: {e}", variant.name));
            assert_eq!(variant.differences().is_empty(), variant.name == variant.method.name);
        }
    }

    #[test]
    fn the_papers_ablations_are_compared_with_one_another_and_change_what_there_is() {
        let variants = paper_ablations(64).unwrap();
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
