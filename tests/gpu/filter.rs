//! The glossy filter.

use crate::Device;
use glam::Vec3;
use reprobe::method::glossy_probes::filter::{Convolution, FilterInput, FilterParams, Kernel, NOT_GLOSSY, filter};
use reprobe::method::glossy_probes::gpu::filter::Filter;
use reprobe::transport::Sampler;

pub fn the_filter_is_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let (width, height) = (150, 91);
    let n = width * height;
    let place = |i: usize| ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
    let noise = |i: usize| Sampler::new(5, i as u32).next_4d();
    let color: Vec<Vec3> = (0..n).map(|i| Vec3::from_slice(&noise(i)) * 4.0).collect();
    let energy: Vec<f32> = (0..n).map(|i| 6.0 * noise(i)[3]).collect();
    // Slanted edges of material, depth and normal, pixels without a glossy surface, kernels that turn and grow, some of none at all.
    let material: Vec<u32> =
        (0..n).map(place).map(|(x, y)| if x > 0.9 { NOT_GLOSSY } else { u32::from(x + 0.4 * y > 0.6) }).collect();
    let depth: Vec<f32> = (0..n).map(place).map(|(x, y)| 2.0 + x + if y > 0.3 + 0.2 * x { 1.0 } else { 0.0 }).collect();
    let normal: Vec<Vec3> = (0..n).map(place).map(|(x, y)| if y > 0.8 - 0.3 * x { Vec3::Y } else { Vec3::Z }).collect();
    let covariance = |(x, y): (f32, f32)| {
        let (s, c) = (5.0 * x + 2.0 * y).sin_cos();
        // No deviation at which rounding decides on the stride, a whole number of steps.
        let (a, b) = if y < 0.1 { (0.0, 0.0) } else { ((12.1 * x).powi(2), (3.03 * y).powi(2)) };
        [a * c * c + b * s * s, (a - b) * c * s, a * s * s + b * c * c]
    };
    let covariance: Vec<[f32; 3]> = (0..n).map(place).map(covariance).collect();
    let input = FilterInput {
        width,
        height,
        color: &color,
        normal: &normal,
        depth: &depth,
        material: &material,
        covariance: &covariance,
        energy: &energy,
    };
    for (kernel, method) in [
        (Kernel::Gaussian, Convolution::FourPass),
        (Kernel::Ggx, Convolution::FourPass),
        (Kernel::Gaussian, Convolution::TwoPass),
    ] {
        let params = FilterParams { kernel, method, ..FilterParams::default() };
        let on_gpu = Filter::new(gpu.clone(), &params).unwrap();
        let (a, b) = (on_gpu.filter(&input).unwrap(), filter(&input, &params));
        let sum: f32 = a.iter().zip(&b).map(|(a, b)| (*a - *b).length_squared()).sum();
        let rmse = (sum / (3 * n) as f32).sqrt();
        assert!(rmse < 1e-3, "{kernel:?}, {method:?}: {rmse}");
        let changed = b.iter().zip(&color).filter(|(b, c)| b.distance(**c) > 0.1).count();
        assert!(changed * 2 > n, "the filter did next to nothing");
    }
    let full = FilterParams { method: Convolution::Full, ..FilterParams::default() };
    let Err(error) = Filter::new(gpu, &full) else { panic!("made it") };
    assert!(error.to_string().contains("filter.method"), "{error}");
}
