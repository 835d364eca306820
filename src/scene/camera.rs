//! Perspective, thin-lens and orthographic cameras.

use super::Geometry;
use crate::base::ray::Ray;
use glam::{Affine3A, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::ops::RangeInclusive;

/// Horizontal fields of view, radians.
const FOVS: RangeInclusive<f32> = 1e-5..=PI - 1e-4;

/// No clipping.
pub const ALL_DEPTHS: [f32; 2] = [0.0, f32::INFINITY];

/// A pinhole, thin-lens or orthographic camera that looks along local +Z, with +X to the left of the image (Mitsuba's convention).
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Camera to world, rigid (a scene file may also mirror it).
    pub to_world: Affine3A,
    /// Horizontal field of view, radians.
    pub fov_x: f32,
    /// Image width and height, pixels.
    pub size: [u32; 2],
    /// Lens radius; 0 for a pinhole.
    pub aperture_radius: f32,
    /// Distance of the plane in focus.
    pub focus_distance: f32,
    /// How far the optical axis meets the image right of and below its middle, in widths and heights of the image: lens shift, or a
    /// window cut out of a larger film.
    pub shift: Vec2,
    /// Depths along local +Z between which surfaces are seen.
    pub clip: [f32; 2],
    /// For parallel rays: the lengths that half the image's width, in pixels, spans along X and along Y. `fov_x` means nothing then.
    pub orthographic: Option<Vec2>,
}

/// What a field of view is measured along.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FovAxis {
    /// The image's width.
    #[default]
    X,
    /// Its height.
    Y,
    /// From corner to corner.
    Diagonal,
    /// The shorter side.
    Smaller,
    /// The longer side.
    Larger,
}

impl FovAxis {
    /// The horizontal field of view that this axis' field of view means, both in radians.
    pub fn fov_x(self, fov: f32, size: [u32; 2]) -> f32 {
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let half = (f64::from(fov) * 0.5).tan();
        let half_x = match self {
            Self::X => half,
            Self::Y => half * aspect,
            Self::Diagonal => half / (1.0 + 1.0 / (aspect * aspect)).sqrt(),
            Self::Smaller if aspect > 1.0 => half * aspect,
            Self::Larger if aspect <= 1.0 => half * aspect,
            Self::Smaller | Self::Larger => half,
        };
        (2.0 * half_x.atan()) as f32
    }
}

impl Camera {
    /// Its view in a picture so many pixels wide, of the same shape as far as a picture may be tall: four times as tall as wide.
    pub fn at_width(&self, width: u32) -> Self {
        let [w, h] = self.size.map(|n| u64::from(n.max(1)));
        let height = (u64::from(width) * h).div_ceil(w).clamp(1, 4 * u64::from(width)) as u32;
        Self { size: [width, height], ..self.clone() }
    }

    /// A pinhole at `origin` that looks at `target`.
    pub fn look_at(origin: Vec3, target: Vec3, up: Vec3, fov_x: f32, size: [u32; 2]) -> Self {
        let z = (target - origin).try_normalize().unwrap_or(Vec3::Z);
        let x = up.cross(z).try_normalize().unwrap_or_else(|| crate::base::math::Basis::from_normal(z).s);
        let y = z.cross(x);
        let to_world = Affine3A { matrix3: glam::Mat3A::from_cols(x.into(), y.into(), z.into()), translation: origin.into() };
        Self::pinhole(to_world, fov_x, size)
    }

    /// A pinhole that sees all depths, its axis through the middle of the image.
    pub fn pinhole(to_world: Affine3A, fov_x: f32, size: [u32; 2]) -> Self {
        let (aperture_radius, focus_distance) = (0.0, 1.0);
        let (shift, clip) = (Vec2::ZERO, ALL_DEPTHS);
        Self { to_world, fov_x, size, aperture_radius, focus_distance, shift, clip, orthographic: None }
    }

    /// The pixel at which the optical axis meets the image.
    pub fn axis_px(&self) -> Vec2 {
        Vec2::new(self.size[0] as f32, self.size[1] as f32) * (self.shift + 0.5)
    }

    /// Whether single precision tells the rays of its pixels apart: it stands and looks somewhere, and its field of view is neither
    /// next to nothing nor next to half a turn.
    pub fn can_see(&self) -> bool {
        let lens = self.aperture_radius.is_finite() && self.focus_distance.is_finite();
        self.to_world.is_finite() && FOVS.contains(&self.fov_x) && self.axis_px().is_finite() && lens
    }

    /// Where the camera stands.
    pub fn position(&self) -> Vec3 {
        self.to_world.translation.into()
    }

    /// Focal length in pixels.
    pub fn focal_px(&self) -> f32 {
        0.5 * self.size[0] as f32 / (0.5 * self.fov_x).tan()
    }

    /// Ray through the place of pixel number `pixel`, and that of the lens, which four numbers in [0, 1) draw.
    pub fn drawn_ray(&self, pixel: u32, [dx, dy, lens_x, lens_y]: [f32; 4]) -> Ray {
        let corner = Vec2::new((pixel % self.size[0]) as f32, (pixel / self.size[0]) as f32);
        self.ray(corner + Vec2::new(dx, dy), Vec2::new(lens_x, lens_y))
    }

    /// Ray through `pixel` (pixels, (0, 0) the upper left corner of the image) and the point
    /// of the lens that `lens` in [0, 1)² maps to.
    pub fn ray(&self, pixel: Vec2, lens: Vec2) -> Ray {
        self.ray_of(self.focal_px(), pixel, lens)
    }

    /// [`Camera::ray`], where [`Camera::focal_px`] is at hand: a tangent, which is as long as the rest.
    pub(crate) fn ray_of(&self, focal_px: f32, pixel: Vec2, lens: Vec2) -> Ray {
        let to_axis = self.axis_px() - pixel;
        if let Some(half) = self.orthographic {
            let origin = (to_axis * half * (2.0 / self.size[0] as f32)).extend(0.0);
            let d = self.to_world.transform_vector3(Vec3::Z).normalize();
            return self.clipped(Ray::new(self.to_world.transform_point3(origin), d), 1.0);
        }
        let d = to_axis.extend(focal_px);
        if self.aperture_radius == 0.0 {
            let ray = Ray::new(self.position(), self.to_world.transform_vector3(d).normalize());
            return self.clipped(ray, d.length() / d.z);
        }
        let focus = d * (self.focus_distance / d.z);
        let origin = (concentric_disk(lens) * self.aperture_radius).extend(0.0);
        let d = focus - origin;
        let ray = Ray::new(self.to_world.transform_point3(origin), self.to_world.transform_vector3(d).normalize());
        self.clipped(ray, d.length() / d.z)
    }

    /// The ray between the clipping planes; its direction gains depth 1 over the distance `slant`.
    fn clipped(&self, ray: Ray, slant: f32) -> Ray {
        if self.clip == ALL_DEPTHS {
            return ray;
        }
        Ray { t_min: self.clip[0] * slant, t_max: self.clip[1] * slant, ..ray }
    }

    /// Takes clipping planes away that cut nothing off: those of most files are far from everything.
    pub fn drop_idle_clip(&mut self, geometry: &Geometry) {
        let inverse = self.to_world.inverse();
        let depth = |p: Vec3| inverse.transform_point3(p).z;
        let beyond = |p: Vec3| depth(p) >= self.clip[1];
        let round_corners = geometry.rounds.iter().flat_map(|r| {
            let [low, high] = r.bounds().map(|p| p.as_vec3());
            (0..8).map(move |k| Vec3::select(glam::BVec3::new(k & 1 == 1, k & 2 == 2, k & 4 == 4), low, high))
        });
        if self.clip[1] < f32::INFINITY && !geometry.positions.iter().copied().chain(round_corners).any(beyond) {
            self.clip[1] = f32::INFINITY;
        }
        // How far from the camera something in view may be that lies before the near plane.
        let corner = Vec2::new(self.size[0] as f32, self.size[1] as f32) * (self.shift.abs() + 0.5);
        let reach = self.clip[0] * corner.extend(self.focal_px()).length() / self.focal_px() + self.aperture_radius;
        let near = |t: u32| {
            let [a, b, c] = geometry.corners(t);
            let p = self.position();
            p.distance(p.clamp(a.min(b).min(c), a.max(b).max(c))) <= reach
        };
        let all = 0..geometry.triangles.len() as u32;
        if self.clip[0] > 0.0 && self.orthographic.is_none() && geometry.rounds.is_empty() && !all.into_iter().any(near) {
            self.clip[0] = 0.0;
        }
    }

    /// Pixel that this camera, its lens a pinhole, sees `p` at; `None` behind it. Inverse of [`Camera::ray`].
    pub fn project(&self, p: Vec3) -> Option<Vec2> {
        let local = self.to_world.inverse().transform_point3(p);
        let pixels = match self.orthographic {
            Some(half) => Vec2::new(0.5 * self.size[0] as f32, 0.5 * self.size[0] as f32) / half,
            None => Vec2::splat(self.focal_px() / local.z),
        };
        (local.z > 0.0).then(|| self.axis_px() - Vec2::new(local.x, local.y) * pixels)
    }
}

/// Uniform point of the unit disk from the unit square, rings from rings (Shirley and Chiu 1997).
fn concentric_disk(u: Vec2) -> Vec2 {
    let p = u * 2.0 - 1.0;
    if p == Vec2::ZERO {
        return p;
    }
    let (r, phi) = match p.x.abs() > p.y.abs() {
        true => (p.x, FRAC_PI_4 * p.y / p.x),
        false => (p.y, FRAC_PI_2 - FRAC_PI_4 * p.x / p.y),
    };
    Vec2::from_angle(phi) * r
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mitsuba 3.9.1, `sample_ray` of cameras of 320x200 with a field of view of 50 degrees along y that look from (1, 2, 3)
    /// to (-1, 0.5, 0) with (0.1, 1, 0) up; the lens has a radius of 0.2 and its focus at 2.5.
    #[test]
    fn rays_are_mitsubas() {
        // Radius, pixel, lens, origin, direction.
        let table = [
            (0.0, [0.5, 0.5], [0.1, 0.8], [0.99999, 2.0, 2.99999], [-0.90681, 0.07936, -0.41399]),
            (0.0, [160.25, 40.0], [0.6, 0.3], [0.99999, 2.0, 2.99999], [-0.52883, -0.12228, -0.83987]),
            (0.0, [300.0, 190.0], [0.5, 0.95], [1.0, 1.99999, 2.99999], [0.0778, -0.652, -0.75422]),
            (0.2, [0.5, 0.5], [0.1, 0.8], [1.10075, 2.07044, 2.8976], [-0.92408, 0.05737, -0.37786]),
            (0.2, [160.25, 40.0], [0.6, 0.3], [0.98406, 1.93464, 3.04329], [-0.51848, -0.09633, -0.84965]),
            (0.2, [300.0, 190.0], [0.5, 0.95], [0.97557, 2.16548, 2.93353], [0.08382, -0.6903, -0.71865]),
        ];
        let fov_x = FovAxis::Y.fov_x(50f32.to_radians(), [320, 200]);
        for (radius, pixel, lens, o, d) in table {
            let up = Vec3::new(0.1, 1.0, 0.0);
            let mut camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-1.0, 0.5, 0.0), up, fov_x, [320, 200]);
            (camera.aperture_radius, camera.focus_distance) = (radius, 2.5);
            let ray = camera.ray(Vec2::from_array(pixel), Vec2::from_array(lens));
            assert!((ray.o - Vec3::from_array(o)).length() < 5e-5, "{} against {o:?}", ray.o);
            assert!((ray.d - Vec3::from_array(d)).length() < 3e-5, "{} against {d:?}", ray.d);
        }
    }

    /// Mitsuba 3.9.1's `x_fov`, degrees, for 50 degrees along each axis.
    #[test]
    fn every_fov_axis_is_mitsubas() {
        use FovAxis::*;
        let wide = [(X, 50.0), (Y, 73.45267), (Diagonal, 43.15047), (Smaller, 73.45267), (Larger, 50.0)];
        let tall = [(X, 50.0), (Y, 32.49671), (Diagonal, 27.764103), (Smaller, 50.0), (Larger, 32.49671)];
        for (size, table) in [([320, 200], wide), ([200, 320], tall)] {
            for (axis, expected) in table {
                let found = axis.fov_x(50f32.to_radians(), size).to_degrees();
                assert!((found - expected).abs() < 1e-4, "{axis:?} {size:?}: {found}, Mitsuba {expected}");
            }
        }
    }

    #[test]
    fn project_inverts_ray() {
        let camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-1.0, 0.5, 0.0), Vec3::Y, 1.2, [320, 200]);
        for pixel in [Vec2::new(0.5, 0.5), Vec2::new(160.0, 100.0), Vec2::new(300.25, 17.5)] {
            let back = camera.project(camera.ray(pixel, Vec2::splat(0.5)).at(2.5)).unwrap();
            assert!((back - pixel).length() < 1e-2, "{pixel} -> {back}");
        }
        assert_eq!(camera.project(Vec3::new(3.0, 3.5, 6.0)), None);
    }

    #[test]
    fn all_rays_of_a_lens_meet_in_the_plane_of_focus() {
        let mut camera = Camera::look_at(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0, [200, 100]);
        (camera.aperture_radius, camera.focus_distance) = (0.3, 4.0);
        let pixel = Vec2::new(30.0, 80.0);
        let at_focus = |lens: Vec2| {
            let ray = camera.ray(pixel, lens);
            assert!(ray.o.length() <= 0.3 + 1e-6);
            ray.at((4.0 - ray.o.z) / ray.d.z)
        };
        let centre = at_focus(Vec2::splat(0.5));
        for lens in [Vec2::new(0.0, 0.3), Vec2::new(0.9, 0.1), Vec2::new(0.5, 0.99)] {
            assert!((at_focus(lens) - centre).length() < 1e-5);
        }
        assert!(camera.ray(pixel, Vec2::new(0.9, 0.1)).o.length() > 0.1, "the lens has an extent");
    }
}
