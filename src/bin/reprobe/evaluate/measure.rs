//! Measures all frames of all methods, and makes the pictures of those that the page shows.

use crate::common::Common;
use crate::compare::read_pair;
use anyhow::{Context, bail};
use rayon::prelude::*;
use reprobe::base::progress::Progress;
use reprobe::io::ExrImage;
use reprobe::metric::evaluation::{FrameErrors, LayerErrors, Pictures, Shown, jpeg_gray, jpeg_rgb};
use reprobe::metric::flip::to_rgb8;
use reprobe::metric::temporal::{change, signed_error};
use reprobe::metric::{compare, display};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What is measured.
pub struct Subjects<'a> {
    /// A folder of frames a method.
    pub methods: &'a [PathBuf],
    /// The folder of their references.
    pub reference: &'a Path,
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
    /// Pictures by layer.
    pub shown: BTreeMap<String, Shown>,
}

/// The layers that the references have, glossy first.
pub fn layers(subjects: &Subjects) -> anyhow::Result<Vec<&'static str>> {
    for &frame in subjects.frames {
        let path = subjects.reference.join(file(frame));
        if !path.is_file() {
            bail!(
                "{}: no such file; the reference needs every frame that is evaluated ({})",
                path.display(),
                subjects.frames.len()
            );
        }
    }
    let path = subjects.reference.join(file(subjects.frames[0]));
    let image = ExrImage::read(&path)?;
    let [w, h] = subjects.size;
    if [image.width, image.height] != [w as usize, h as usize] {
        bail!("{} has {} x {} pixels, the frames {w} x {h}: give --size", path.display(), image.width, image.height);
    }
    let has = |layer: &&str| image.rgb(&path, if *layer == "full" { "" } else { layer }).is_ok();
    let layers: Vec<_> = ["glossy", "full"].into_iter().filter(has).collect();
    anyhow::ensure!(!layers.is_empty(), "{}: found neither R, G, B nor glossy.R, glossy.G, glossy.B", path.display());
    Ok(layers)
}

/// `NNNN.exr`.
pub fn file(frame: u32) -> String {
    format!("{frame:04}.exr")
}

/// A picture and its error map.
type Pair = [Vec<u8>; 2];

/// Measures everything.
pub fn measure(subjects: &Subjects, layers: &[&str], common: &Common) -> anyhow::Result<Measured> {
    let count = subjects.frames.len();
    let jobs: Vec<(usize, usize, usize)> = (0..layers.len())
        .flat_map(|layer| (0..subjects.methods.len()).flat_map(move |method| (0..count).map(move |frame| (layer, method, frame))))
        .collect();
    let sizes: Vec<usize> = jobs
        .par_iter()
        .filter(|job| job.2 == count / 2)
        .map(|&job| {
            anyhow::Ok(measure_frame(subjects, layers, job, true)?.1.map_or(0, |[picture, map]| picture.len() + map.len()))
        })
        .collect::<anyhow::Result<_>>()?;
    // The reference's pictures, and what base64 adds.
    let a_frame = (sizes.iter().sum::<usize>() + sizes.iter().max().unwrap_or(&0) * layers.len()) * 4 / 3;
    let every = (count * a_frame).div_ceil(subjects.page_bytes.max(1)).max(1);

    let bar = common.progress();
    bar.start("measure", jobs.len() as u64);
    let results: Vec<(FrameErrors, Option<Pair>)> = jobs
        .par_iter()
        .map(|&job| {
            let result = measure_frame(subjects, layers, job, job.2 % every == 0);
            bar.advance(1);
            result
        })
        .collect::<anyhow::Result<_>>()?;
    bar.finish();

    let mut errors = vec![BTreeMap::new(); subjects.methods.len()];
    let mut shown: BTreeMap<String, Shown> = BTreeMap::new();
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
            let path = subjects.reference.join(file(subjects.frames[frame]));
            let [image, _] = read_pair(&path, &path, layer)?;
            reference.frames.insert(frame, jpeg_rgb(&to_rgb8(&display(&image, subjects.exposure)), image.size)?);
        }
        shown.insert((*layer).to_owned(), Shown { reference, methods });
    }
    Ok(Measured { errors, shown })
}

/// One frame of one method; with its pictures, if `draw`.
fn measure_frame(
    subjects: &Subjects,
    layers: &[&str],
    (layer, method, frame): (usize, usize, usize),
    draw: bool,
) -> anyhow::Result<(FrameErrors, Option<Pair>)> {
    let read = |number: u32| {
        let name = file(number);
        read_pair(&subjects.methods[method].join(&name), &subjects.reference.join(&name), layers[layer])
    };
    let number = subjects.frames[frame];
    let [image, reference] = read(number).with_context(|| format!("layer {}", layers[layer]))?;
    let comparison = compare(&image, &reference, subjects.exposure);
    let change = match frame.checked_sub(1).map(|before| subjects.frames[before]).filter(|before| before + 1 == number) {
        Some(before) => {
            let before = read(before)?.map(|raster| display(&raster, subjects.exposure));
            Some(change(&signed_error(&before), &signed_error(&comparison.display)))
        }
        None => None,
    };
    let size = image.size;
    let pictures = draw
        .then(|| anyhow::Ok([jpeg_rgb(&to_rgb8(&comparison.display[0]), size)?, jpeg_gray(&comparison.maps.flip, size)?]))
        .transpose()?;
    Ok((FrameErrors { metrics: comparison.metrics, change }, pictures))
}
