//! Measures all frames of all methods, and makes the pictures of those that the page shows.

use crate::base::math::Rgb;
use crate::base::progress::Progress;
use crate::io::ExrImage;
use crate::metric::evaluation::{Clean, Detail, FrameErrors, Gallery, LayerErrors, Pictures, Shown};
use crate::metric::temporal::{change, change_rms, signed_error};
use crate::metric::without_noise::without_noise;
use crate::metric::{Comparison, Raster, compare, display};
use crate::plan::stages::{read_pair, read_second};
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What is measured.
pub struct Subjects<'a> {
    /// A folder of frames a method.
    pub methods: &'a [PathBuf],
    /// The folder of their references, and that of other renders of them where there are such.
    pub references: &'a [PathBuf],
    /// Numbers of the frames, ascending.
    pub frames: &'a [u32],
    /// Their width and height, pixels.
    pub size: [u32; 2],
    /// Stops.
    pub exposure: f32,
    /// About how many bytes the page's pictures may take.
    pub page_bytes: usize,
}

/// What came of it.
pub struct Measured {
    /// Errors by layer, a method an entry.
    pub errors: Vec<BTreeMap<String, LayerErrors>>,
    /// The page's pictures.
    pub gallery: Gallery,
}

/// The layers that the references have, glossy first.
pub fn layers(subjects: &Subjects) -> Result<Vec<&'static str>> {
    let (first, image) = first_frame(subjects, &subjects.references[0])?;
    let has = |layer: &&str| image.rgb(&first, if *layer == "full" { "" } else { layer }).is_ok();
    let layers: Vec<_> = ["glossy", "full"].into_iter().filter(has).collect();
    if layers.is_empty() {
        return Err(Error::input(&first, "found neither R, G, B nor glossy.R, glossy.G, glossy.B"));
    }
    // A second one that has the first one's noise, or lacks a layer, is refused before hours of work.
    for folder in &subjects.references[1..] {
        let (second, _) = first_frame(subjects, folder)?;
        for layer in &layers {
            let [reference, _] = read_pair(&first, &first, layer)?;
            read_second((&first, &reference), &second, layer)?;
        }
    }
    Ok(layers)
}

/// The first frame of a reference that has all of them, in the frames' size.
fn first_frame(subjects: &Subjects, folder: &Path) -> Result<(PathBuf, ExrImage)> {
    for &frame in subjects.frames {
        let path = folder.join(file(frame));
        if !path.is_file() {
            let message = format!("no such file; the reference needs every frame that is evaluated ({})", subjects.frames.len());
            return Err(Error::input(&path, message));
        }
    }
    let path = folder.join(file(subjects.frames[0]));
    let image = ExrImage::read(&path)?;
    let [w, h] = subjects.size;
    if [image.width, image.height] != [w as usize, h as usize] {
        let message = format!("has {} x {} pixels, the frames {w} x {h}: give --size", image.width, image.height);
        return Err(Error::input(&path, message));
    }
    Ok((path, image))
}

/// `NNNN.exr`.
pub fn file(frame: u32) -> String {
    format!("{frame:04}.exr")
}

/// Numbers of a layer, a method and a frame.
type Job = (usize, usize, usize);
/// A picture and its error map.
type Pair = [Vec<u8>; 2];

/// Measures everything.
pub fn measure(subjects: &Subjects, layers: &[&str], bar: &dyn Progress) -> Result<Measured> {
    let count = subjects.frames.len();
    let jobs: Vec<Job> = (0..layers.len())
        .flat_map(|layer| (0..subjects.methods.len()).flat_map(move |method| (0..count).map(move |frame| (layer, method, frame))))
        .collect();
    let (detail, every) = affordable(subjects, layers, &jobs)?;

    bar.start("measure", jobs.len() as u64);
    let results: Vec<(FrameErrors, Option<Pair>)> = jobs
        .par_iter()
        .map(|&job| {
            let (errors, comparison) = measure_frame(subjects, layers, job)?;
            let pictures = (job.2 % every == 0).then(|| draw(&comparison, detail)).transpose()?;
            bar.advance(1);
            Ok((errors, pictures))
        })
        .collect::<Result<_>>()?;
    bar.finish();

    let mut errors = vec![BTreeMap::new(); subjects.methods.len()];
    let mut gallery = Gallery { layers: BTreeMap::new(), detail };
    let mut all = results.into_iter();
    for layer in layers {
        let mut methods = Vec::new();
        for of_method in &mut errors {
            let (frames, pictures): (Vec<_>, Vec<_>) = all.by_ref().take(count).unzip();
            of_method.insert((*layer).to_owned(), LayerErrors::new(frames));
            let mut files = Pictures::default();
            for (frame, [picture, map]) in pictures.into_iter().enumerate().filter_map(|(f, p)| Some((f, p?))) {
                files.frames.insert(frame, picture);
                files.flip.insert(frame, map);
            }
            methods.push(files);
        }
        let mut reference = Pictures::default();
        for frame in (0..count).step_by(every) {
            let path = subjects.references[0].join(file(subjects.frames[frame]));
            let [image, _] = read_pair(&path, &path, layer)?;
            reference.frames.insert(frame, detail.frame(&display(&image, subjects.exposure))?);
        }
        gallery.layers.insert((*layer).to_owned(), Shown { reference, methods });
    }
    Ok(Measured { errors, gallery })
}

/// How the pictures are made, and of every how many frames, by what those of the frame in the middle would take.
fn affordable(subjects: &Subjects, layers: &[&str], jobs: &[Job]) -> Result<(Detail, usize)> {
    let count = subjects.frames.len();
    let details: Vec<Detail> = Detail::of_width(subjects.size[0] as usize).collect();
    let sizes: Vec<Vec<usize>> = jobs
        .par_iter()
        .filter(|job| job.2 == count / 2)
        .map(|&job| {
            let comparison = measure_frame(subjects, layers, job)?.1;
            let bytes = |detail: &Detail| Ok::<_, Error>(draw(&comparison, *detail)?.iter().map(Vec::len).sum::<usize>());
            details.iter().map(bytes).collect()
        })
        .collect::<Result<_>>()?;
    let choices = details.into_iter().enumerate().map(|(i, detail)| {
        let of_methods = sizes.iter().map(|s| s[i]);
        // The reference's pictures, and what base64 adds.
        (detail, (of_methods.clone().sum::<usize>() + of_methods.max().unwrap_or(0) * layers.len()) * 4 / 3)
    });
    Ok(Detail::choose(&choices.collect::<Vec<_>>(), count, subjects.page_bytes))
}

fn draw(comparison: &Comparison, detail: Detail) -> Result<Pair> {
    let image = &comparison.display[0];
    Ok([detail.frame(image)?, detail.flip(&comparison.maps, image.size)?])
}

/// A frame of a method, and the one or two renders of its reference: one layer, linear.
struct Sides {
    image: Raster,
    references: Vec<Raster>,
}

impl Sides {
    fn read(subjects: &Subjects, method: usize, number: u32, layer: &str) -> Result<Self> {
        let name = file(number);
        let at = |folder: &Path| folder.join(&name);
        let first = at(&subjects.references[0]);
        let [image, reference] = read_pair(&at(&subjects.methods[method]), &first, layer)?;
        let seconds = subjects.references[1..].iter().map(|folder| read_second((&first, &reference), &at(folder), layer));
        let seconds = seconds.collect::<Result<Vec<_>>>()?;
        Ok(Self { image, references: std::iter::once(reference).chain(seconds).collect() })
    }

    /// Errors of display values against each render.
    fn signed_errors(&self, exposure: f32) -> Vec<Vec<Rgb>> {
        let image = display(&self.image, exposure);
        self.references.iter().map(|r| signed_error([&image, &display(r, exposure)])).collect()
    }
}

/// Against the two renders.
fn both(errors: &[Vec<Rgb>]) -> [&[Rgb]; 2] {
    [&errors[0], &errors[1]]
}

/// One frame of one method.
fn measure_frame(subjects: &Subjects, layers: &[&str], (layer, method, frame): Job) -> Result<(FrameErrors, Comparison)> {
    let (layer, exposure) = (layers[layer], subjects.exposure);
    let read = |number: u32| Sides::read(subjects, method, number, layer);
    let number = subjects.frames[frame];
    let sides = read(number).map_err(|e| Error::Request(format!("layer {layer}: {e}")))?;
    let comparison = compare(&sides.image, &sides.references[0], exposure);
    let changes = match frame.checked_sub(1).map(|before| subjects.frames[before]).filter(|before| before + 1 == number) {
        Some(before) => Some([read(before)?.signed_errors(exposure), sides.signed_errors(exposure)]),
        None => None,
    };
    let without_noise = match &sides.references[..] {
        [first, second] => Some(Clean {
            errors: without_noise(&sides.image, [first, second], exposure),
            change_rms: changes.as_ref().map(|[before, after]| change_rms(both(before), both(after))),
        }),
        _ => None,
    };
    let change = changes.as_ref().map(|[before, after]| change(&before[0], &after[0]));
    Ok((FrameErrors { metrics: comparison.metrics, change, without_noise }, comparison))
}
