//! Pictures of EXR layers for people: colours as sRGB, vectors and scalars in false colours, indices in random ones.

use super::ExrImage;
use super::layer::{Kind, Layer, Values, layers};
use crate::base::math::hash_words;

/// A layer of an image as 8-bit RGB.
pub struct Picture {
    /// The layer's name; `image` for channels without a layer.
    pub layer: String,
    /// What the layer holds.
    pub kind: Kind,
    /// What its colours mean.
    pub legend: String,
    /// What values there are.
    pub values: Values,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Rows from the top, three bytes a pixel.
    pub rgb: Vec<u8>,
}

/// How values become colours.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Look {
    /// Stops by which colours are brightened.
    pub exposure: f32,
    /// What is dark and what is bright, of numbers and of each axis of vectors: their 1st and 99th percentile where it is not given.
    pub ranges: Option<[[f32; 2]; 3]>,
}

/// A picture of each layer of `image`, in order of their names. `exposure` is in stops, for colours.
pub fn pictures(image: &ExrImage, exposure: f32) -> Vec<Picture> {
    layers(image).iter().map(|layer| draw(image, layer, &Look { exposure, ranges: None })).collect()
}

/// A picture of a layer of `image`, in colours that fit what it holds; what is not finite is magenta.
pub fn draw(image: &ExrImage, layer: &Layer, look: &Look) -> Picture {
    let (mut legend, rgb, values) = match layer.indices() {
        Some(indices) => {
            let legend = "random colours, one an index; black is none".to_owned();
            (legend, indices.iter().map(|&i| index_color(i)).collect(), Values::of_indices(indices))
        }
        None => {
            let planes = layer.planes();
            let values = Values::of(&planes);
            let ranges = look.ranges.unwrap_or_else(|| percentiles(&planes));
            let (legend, rgb) = match (layer.kind, planes.as_slice()) {
                (Kind::Colour, [r, g, b]) => color([r, g, b], look.exposure),
                (Kind::Vector, [x, y, z]) => vector([x, y, z], &ranges),
                _ => heated(planes.first().map_or(&[], Vec::as_slice), ranges[0]),
            };
            (legend, rgb, values)
        }
    };
    if layer.kind != Kind::Index && values.without > 0 {
        legend += "; magenta is not finite";
    }
    let rgb: Vec<[u8; 3]> = rgb;
    let (width, height) = (image.width as u32, image.height as u32);
    Picture { layer: layer.name.clone(), kind: layer.kind, legend, values, width, height, rgb: rgb.concat() }
}

/// Stops that fit the colours of an image where nothing else is said: irradiance is as bright as a white wall that it falls on.
pub fn usual_exposure(image: &ExrImage) -> f32 {
    const WHITE_WALL: f32 = -1.65;
    let is_irradiance = image.channels.iter().any(|(name, _)| name.starts_with("irradiance."));
    if is_irradiance { WHITE_WALL } else { 0.0 }
}

/// The ranges that a layer is drawn in where none is given; `None` for what has no use for them.
pub fn ranges(layer: &Layer) -> Option<[[f32; 2]; 3]> {
    matches!(layer.kind, Kind::Scalar | Kind::Vector).then(|| percentiles(&layer.planes()))
}

/// A number in [0, 1] as a byte.
pub(crate) fn byte(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// The sRGB transfer function, linear to display.
pub fn srgb(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// What is not finite, in pictures.
const NOT_FINITE: [u8; 3] = [255, 0, 255];

/// The colours of what three channels hold.
fn three(planes: [&[f32]; 3], shade: impl Fn(usize, f32) -> u8) -> Vec<[u8; 3]> {
    let pixel = |i: usize| planes.map(|p| p[i]);
    let colour = |p: [f32; 3]| {
        let is_finite = p.iter().all(|v| v.is_finite());
        if is_finite { std::array::from_fn(|c| shade(c, p[c])) } else { NOT_FINITE }
    };
    (0..planes[0].len()).map(|i| colour(pixel(i))).collect()
}

fn color(planes: [&[f32]; 3], exposure: f32) -> (String, Vec<[u8; 3]>) {
    let scale = exposure.exp2();
    (format!("sRGB, exposure {exposure:+}"), three(planes, |_, v| byte(srgb(v * scale))))
}

/// The 1st and 99th percentile of the finite values.
fn range(values: &[f32]) -> [f32; 2] {
    let mut v: Vec<f32> = values.iter().copied().filter(|x| x.is_finite()).collect();
    if v.is_empty() {
        return [0.0, 1.0];
    }
    v.sort_by(f32::total_cmp);
    let at = |q: f32| v[((v.len() - 1) as f32 * q) as usize];
    // No -0 in legends.
    [at(0.01), at(0.99)].map(|end| end + 0.0)
}

fn percentiles(planes: &[Vec<f32>]) -> [[f32; 2]; 3] {
    std::array::from_fn(|c| planes.get(c).map_or([0.0, 1.0], |p| range(p)))
}

/// Where a value lies between two others.
fn share(value: f32, [lo, hi]: [f32; 2]) -> f32 {
    (value - lo) / (hi - lo).max(1e-20)
}

fn vector(planes: [&[f32]; 3], ranges: &[[f32; 2]; 3]) -> (String, Vec<[u8; 3]>) {
    let legend = ranges.map(|[lo, hi]| format!("{lo:.3} to {hi:.3}")).join(", ");
    let rgb = three(planes, |c, v| byte(share(v, ranges[c])));
    (format!("X, Y, Z as red, green, blue: {legend}"), rgb)
}

fn heated(values: &[f32], [lo, hi]: [f32; 2]) -> (String, Vec<[u8; 3]>) {
    let rgb = values.iter().map(|&v| if v.is_finite() { heat(share(v, [lo, hi])) } else { NOT_FINITE }).collect();
    (format!("{lo:.4} (dark) to {hi:.4} (bright)"), rgb)
}

/// Finite values from dark to bright.
pub fn scalar(values: &[f32]) -> Vec<[u8; 3]> {
    heated(values, range(values)).1
}

/// Black over violet, red and yellow to white: brightness grows with `x` in [0, 1].
pub fn heat(x: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 6] =
        [[0.0, 0.0, 0.02], [0.25, 0.04, 0.41], [0.58, 0.15, 0.40], [0.87, 0.32, 0.23], [0.99, 0.65, 0.04], [0.99, 1.0, 0.80]];
    let t = x.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let i = (t as usize).min(STOPS.len() - 2);
    std::array::from_fn(|c| byte(STOPS[i][c] + (STOPS[i + 1][c] - STOPS[i][c]) * (t - i as f32)))
}

fn index_color(i: u32) -> [u8; 3] {
    if i == u32::MAX {
        return [0; 3];
    }
    let h = hash_words(&[i]);
    [64 + (h & 0xbf) as u8, 64 + (h >> 8 & 0xbf) as u8, 64 + (h >> 16 & 0xbf) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_layer_becomes_one_picture() {
        let image = ExrImage::new(2, 1)
            .with_rgb("glossy", &[glam::Vec3::ONE, glam::Vec3::ZERO])
            .with_u32("reflector.triangle", vec![3, u32::MAX])
            .with_f32("m", vec![0.0, f32::NAN]);
        let all = pictures(&image, 0.0);
        assert_eq!(all.iter().map(|p| p.layer.as_str()).collect::<Vec<_>>(), ["m", "glossy", "reflector.triangle"]);
        assert_eq!(all[1].rgb, [255, 255, 255, 0, 0, 0]);
        assert_eq!(all[0].rgb[3..], [255, 0, 255]);
        assert_eq!(all[2].rgb[3..], [0, 0, 0]);
        let noted = |p: &Picture| p.legend.ends_with("magenta is not finite");
        assert_eq!([&all[0], &all[1], &all[2]].map(noted), [true, false, false]);
    }

    #[test]
    fn ranges_and_exposure_say_what_is_bright() {
        let image = ExrImage::new(3, 1)
            .with_f32("m", vec![0.0, 2.0, 8.0])
            .with_f32("n.X", vec![0.0, 2.0, f32::INFINITY])
            .with_f32("n.Y", vec![4.0, 2.0, 1.0])
            .with_f32("n.Z", vec![-9.0, 9.0, 1.0])
            .with_rgb("", &[glam::Vec3::splat(0.25), glam::Vec3::splat(f32::NAN), glam::Vec3::ZERO]);
        let of = |layer: &str, look: Look| {
            let all = layers(&image);
            draw(&image, all.iter().find(|l| l.name == layer).unwrap(), &look)
        };
        let look = Look { exposure: 2.0, ranges: Some([[0.0, 4.0]; 3]) };
        let m = of("m", look);
        assert_eq!(m.rgb, [heat(0.0), heat(0.5), heat(1.0)].concat());
        assert!(m.legend.starts_with("0.0000 (dark) to 4.0000 (bright)") && m.values.ends == Some([0.0, 8.0]), "{}", m.legend);
        assert_eq!(of("n", look).rgb, [0, 255, 0, 128, 128, 255, 255, 0, 255]);
        let colours = of("image", look);
        assert_eq!(colours.rgb, [255, 255, 255, 255, 0, 255, 0, 0, 0]);
        assert!(colours.legend.contains("exposure +2; magenta") && colours.values.without == 1, "{}", colours.legend);
    }

    #[test]
    fn heat_grows_brighter() {
        let sum = |x: f32| heat(x).iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!((1..=20).all(|i| sum(i as f32 / 20.0) > sum((i - 1) as f32 / 20.0)));
    }
}
