//! `inspect-lightfield`.

use crate::base::clock::Clock;
use crate::base::named::within;
use crate::io::{Provenance, png};
use crate::method::light_field_probes::LightFieldParams;
use crate::method::light_field_probes::field::LightField;
use crate::method::light_field_probes::hits::{Verdict, differ, found, judge, lobe_rays};
use crate::method::light_field_probes::inspect::way::{Way, ray_of};
use crate::method::light_field_probes::inspect::{draw, hits, maps};
use crate::method::light_field_probes::march::Search;
use crate::method::light_field_probes::shade::Shading;
use crate::method::light_field_probes::store::LightFieldSet;
use crate::plan::option::{List, Size, stage, text};
use crate::plan::stages::export_probes::LIGHTFIELD;
use crate::plan::views::views;
use crate::plan::{Context, Outcome};
use crate::probe::coverage::is_opaque;
use crate::probe::reach::{ReachParams, reach};
use crate::probe::set::ProbeSet;
use crate::probe::skeleton::field::Field;
use crate::probe::skeleton::space::Space;
use crate::probe::skeleton::voxels::Voxels;
use crate::probe::store::set_hash;
use crate::transport::World;
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::{Error, Result};
use glam::Vec3;
use serde_json::{Value, json};
use std::path::PathBuf;

text!(Search);

stage! {
    /// Draws what light field probes hold, a ray's way through them, or what all rays meet.
    InspectLightfield "inspect-lightfield"
    {
        /// The scene.
        scene,
    }
    {
        /// Light field probes.
        "--probes" probes: PathBuf,
        /// The probe whose maps are drawn.
        "--probe" probe: Option<u32>,
        /// Stops by which its colours are brightened.
        "--exposure" exposure: Option<f32>,
        /// Holds the rays of all glossy pixels against the scene.
        "--hits" hits: bool,
        /// The pixel whose ray is followed: column and row.
        "--pixel" pixel: Option<List<u32, 2, ','>>,
        /// The camera path; the scene's own sensor without it.
        "--path" path: Option<PathBuf>,
        /// Its frame.
        "--frame" frame: Option<u32>,
        /// Size of the frame.
        "--size" size: Option<Size>,
        /// How a probe's map is searched.
        "--trace" trace: Option<Search>,
        /// The picture to write, PNG.
        "--output" output: PathBuf,
    }
}

/// Voxels along the longest side of what is drawn.
const RESOLUTION: u32 = 96;
/// Room about it, as a share of that side.
const MARGIN: f32 = 0.02;

impl InspectLightfield {
    /// Refuses what does not go together.
    pub fn check(&self) -> Result<()> {
        png::check_png(&self.output)?;
        if [self.probe.is_some(), self.pixel.is_some(), self.hits].into_iter().filter(|given| *given).count() != 1 {
            let message = "--probe, --pixel, --hits: expected one of them: a probe's maps, a ray's way, or what all rays meet";
            return Err(Error::Request(message.into()));
        }
        let has = if self.probe.is_some() { "--probe" } else { "--pixel, --hits" };
        for (option, is_given, with) in [
            ("--exposure", self.exposure.is_some(), "--probe"),
            ("--path", self.path.is_some(), "--pixel, --hits"),
            ("--frame", self.frame.is_some(), "--pixel, --hits"),
            ("--size", self.size.is_some(), "--pixel, --hits"),
            ("--trace", self.trace.is_some(), "--pixel, --hits"),
        ] {
            if is_given && with != has {
                return Err(Error::Request(format!("{option}: {has} has no use for it; {with} has")));
            }
        }
        within("--exposure", self.exposure.unwrap_or(0.0), -32.0..=32.0)
    }

    /// Reads, draws, writes the picture.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let set = LightFieldSet::read(&self.probes)?;
        let world = cx.opaque_world(&self.scene)?;
        set.provenance.check_scene(&ProbeSet::path(&self.probes), &world.scene.hash)?;
        match (self.probe, self.pixel) {
            (Some(probe), _) => self.draw_maps(cx, &set, probe as usize),
            (None, Some(pixel)) => self.draw_way(cx, &world, pixel.0),
            (None, None) => self.draw_hits(cx, &world),
        }
    }

    fn draw_maps(&self, cx: &Context, set: &LightFieldSet, probe: usize) -> Result<Outcome> {
        let places = &set.places;
        if probe >= places.len() {
            let last = places.len() - 1;
            return Err(Error::Request(format!("--probe {probe}: {} has probes 0 to {last}", self.probes.display())));
        }
        if places.is_blocked(probe) {
            let p = places.position(probe);
            let used = places.used().into_iter().min_by(|&a, &b| {
                let [a, b] = [a, b].map(|i| places.position(i).distance(p));
                a.total_cmp(&b)
            });
            let hint = used.map_or_else(String::new, |i| format!("; the nearest one that is not is {i}"));
            return Err(Error::Request(format!(
                "--probe {probe}: is blocked, inside an object or behind a wall, and holds nothing{hint}"
            )));
        }
        let p = places.position(probe);
        let title =
            format!("probe {probe} of {} at {p:.3}: +Y in the middle, -Y in the corners, +X right, +Z below", places.len());
        let (canvas, shown) = maps::draw(&title, &set.images(&self.probes, probe)?, self.exposure.unwrap_or(0.0));
        let parameters = json!({ "probe": probe, "exposure": self.exposure.unwrap_or(0.0) });
        canvas.write(&self.output, &self.provenance(cx, &set.provenance.scene, parameters)?)?;
        let mut summary = format!("{}: probe {probe} at {p:.3}\n", self.output.display());
        for map in &shown {
            summary += &format!("  {:10} {}\n", map.layer, map.legend);
        }
        let layers: serde_json::Map<String, serde_json::Value> =
            shown.into_iter().map(|map| (map.layer, map.legend.into())).collect();
        Ok(Outcome {
            summary,
            figures: json!({ "probe": probe, "position": p.to_array(), "maps": layers }),
            ..Outcome::default()
        })
    }

    /// Where the picture comes from.
    fn provenance(&self, cx: &Context, scene: &str, parameters: Value) -> Result<Provenance> {
        let provenance = Provenance::new(Self::COMMAND, scene, cx.seed, &parameters);
        Ok(provenance.with_input("probes", set_hash(&self.probes, LIGHTFIELD)?))
    }

    /// All views, and the number of the one that is asked for.
    fn views(&self, world: &World) -> Result<(Vec<View>, usize)> {
        let views = views(&world.scene, self.path.as_deref(), self.size.map(|s| s.0), None)?;
        let number = self.frame.unwrap_or(0) as usize;
        if number >= views.len() {
            return Err(Error::Request(format!("--frame {number}: the path has frames 0 to {}", views.len() - 1)));
        }
        Ok((views, number))
    }

    fn draw_hits(&self, cx: &Context, world: &World) -> Result<Outcome> {
        let (views, number) = self.views(world)?;
        let field = LightField::load(&self.probes, &world.scene)?;
        let params = LightFieldParams::default();
        let view = Baseline::new(world, None, 1).gbuffer(&views[number].camera, &mut Clock::start());
        let rays = lobe_rays(world, &view, params.samples, Shading::far(world));
        if rays.is_empty() {
            return Err(Error::Request(format!("--hits: frame {number} shows no glossy surface: choose another frame")));
        }
        let search = self.trace.unwrap_or(params.search);
        let other = if search == Search::HiZ { Search::TwoScale } else { Search::HiZ };
        let [(found, time), (others, other_time)] = [search, other].map(|s| found(&field, &rays, s, params.thickness));
        let verdicts = judge(world, &field, &rays, &found);
        let (words, shares) = shares(&verdicts);
        let apart = found.iter().zip(&others).filter(|(a, b)| differ(**a, **b)).count() as f64 / rays.len() as f64;
        let title = format!(
            "frame {number}: {} rays along glossy lobes through {} probes, {search}",
            rays.len(),
            field.places.used().len()
        );
        let parameters = of_frame(number, &views[number], search);
        let provenance = self.provenance(cx, &world.scene.hash, parameters)?;
        hits::draw(&title, &view, &rays, &verdicts, &words).write(&self.output, &provenance)?;
        let lines: String = words.iter().map(|line| format!("  {line}\n")).collect();
        Ok(Outcome {
            summary: format!(
                "{}: {title}\n{lines}  {:.3} % differ from {other}; {search} {time:.0} ns a ray, {other} {other_time:.0} ns",
                self.output.display(),
                100.0 * apart,
            ),
            figures: json!({
                "frame": number, "rays": rays.len(), "probes": field.places.used().len(), "bytes": field.bytes(), "trace": search.to_string(),
                "shares": shares, "differ": apart, "nanoseconds": { search.to_string(): time, other.to_string(): other_time },
            }),
            ..Outcome::default()
        })
    }

    fn draw_way(&self, cx: &Context, world: &World, [x, y]: [u32; 2]) -> Result<Outcome> {
        let (views, number) = self.views(world)?;
        let camera = &views[number].camera;
        let [width, height] = camera.size;
        if x >= width || y >= height {
            return Err(Error::Request(format!(
                "--pixel {x},{y}: frame {number} has {width} x {height} pixels: expected from 0,0 to {},{}",
                width - 1,
                height - 1
            )));
        }
        let asked = ray_of(world, camera, [x, y], Shading::far(world)).ok_or_else(|| {
            Error::Request(format!("--pixel {x},{y}: frame {number} shows no surface there: choose another pixel"))
        })?;
        let field = LightField::load(&self.probes, &world.scene)?;
        let params = LightFieldParams::default();
        let search = self.trace.unwrap_or(params.search);
        let way = Way::new((world, &field), asked, search, params.thickness);
        let space = space(world, &views, &field)?;
        let title = format!("frame {number}, pixel {x},{y}: {}, {search}", way.kind());
        let mut parameters = of_frame(number, &views[number], search);
        parameters["pixel"] = json!([x, y]);
        let provenance = self.provenance(cx, &world.scene.hash, parameters)?;
        draw((world, &space), &field, &way, &title).write(&self.output, &provenance)?;
        cx.listener.detail(&format!("{} probes were asked", way.steps.len()));
        let mut figures = way.figures();
        figures["frame"] = number.into();
        figures["pixel"] = json!([x, y]);
        figures["trace"] = search.to_string().into();
        Ok(Outcome { summary: format!("{}: {title}\n{}", self.output.display(), way.text()), figures, ..Outcome::default() })
    }
}

/// What a picture of a frame depends on besides scene and probes.
fn of_frame(number: usize, view: &View, search: Search) -> Value {
    let camera = &view.camera;
    json!({
        "frame": number, "to_world": camera.to_world.to_cols_array(), "fov_x_rad": camera.fov_x, "size": camera.size, "trace": search.to_string(),
    })
}

/// A sentence a verdict, and the shares by name.
fn shares(verdicts: &[Verdict]) -> (Vec<String>, serde_json::Map<String, serde_json::Value>) {
    let meanings = [
        "meet what they meet in the scene",
        "meet another place",
        "meet nothing where there is something",
        "meet something where there is nothing",
        "are lost behind what probes see",
    ];
    let share = |verdict| verdicts.iter().filter(|v| **v == verdict).count() as f64 / verdicts.len().max(1) as f64;
    let words =
        Verdict::ALL.iter().zip(meanings).map(|((v, name), meaning)| format!("{name} {:.2} %: {meaning}", 100.0 * share(*v)));
    (words.collect(), Verdict::ALL.iter().map(|(v, name)| ((*name).into(), share(*v).into())).collect())
}

/// The free space of what cameras see and where probes stand.
fn space(world: &World, views: &[View], field: &LightField) -> Result<Space> {
    let cameras: Vec<Vec3> = views.iter().map(|view| view.camera.position()).collect();
    let params = ReachParams { margin: f32::INFINITY, ..ReachParams::default() };
    let (mut lower, mut upper) = reach(world, &cameras, &params)?;
    for probe in field.places.used() {
        let p = field.places.position(probe);
        (lower, upper) = (lower.min(p), upper.max(p));
    }
    let margin = MARGIN * (upper - lower).max_element();
    let voxels = Voxels::in_box(lower - margin, upper + margin, RESOLUTION)?;
    Space::reached(world, Field::of(&world.scene.geometry, &|t| is_opaque(world, t), voxels), &cameras)
}
