//! Spheres, cylinders and disks as what they are, where a scene has too many of them for fine meshes.
//!
//! *Ours*. A few round shapes are meshes as fine as eyes and gradients ask for. Where a scene has a crowd of them (a point cloud, a
//! chain of lamps), each keeps a coarse mesh, which numbers its parts for charts, curvatures and probes, and this description beside
//! it: rays meet the shape itself, and a place on it is a triangle of its mesh with barycentric weights, as everywhere else. The weights
//! are taken over the shape's two angles (or its angle and length), so that going from one to the other loses nothing.

use super::mesh::Mesh;
use super::primitives::{grid, turn};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};

/// Kinds of round shapes, each in a space of its own. The texture coordinates are Mitsuba's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum RoundKind {
    /// Radius 1 about the origin; u = longitude from +X over a full turn, v = polar angle from +Z over a half.
    Sphere,
    /// Open, radius 1 about +Z, from z = 0 to 1; u = angle over a full turn, v = z.
    Cylinder,
    /// Radius 1 about the origin in the plane z = 0, facing +Z; u = radius, v = angle over a full turn.
    Disk,
}

/// A round shape of the scene.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Round {
    /// What it is.
    pub kind: RoundKind,
    /// From its own space to the world.
    pub to_world: DAffine3,
    /// From the world to its own space.
    pub to_local: DAffine3,
    /// Whether its normals point the other way: inwards, down.
    pub inwards: bool,
    /// Index into `Geometry::objects`.
    pub object: u32,
    /// The first of its triangles in `Geometry::triangles`.
    pub first: u32,
    /// Whether [`super::mesh::append`] has turned the triangles of its [`RoundKind::mesh`] round.
    pub turned: bool,
    /// Parts of the angle, and of the other coordinate, that its mesh has.
    pub cells: [u32; 2],
}

/// A point of a round shape, in its own space.
#[derive(Debug, Clone, Copy)]
pub struct RoundPoint {
    /// Position.
    pub p: DVec3,
    /// Unit normal: outwards, or up.
    pub n: DVec3,
    /// Texture coordinate.
    pub uv: DVec2,
    /// Change of position with u.
    pub dp_du: DVec3,
    /// Change of position with v.
    pub dp_dv: DVec3,
}

impl RoundKind {
    /// Area where `to_world` has no uneven scale; an estimate elsewhere.
    pub fn area(self, to_world: &DMat3) -> f64 {
        let [x, y, z] = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|a| a.length());
        match self {
            Self::Sphere => 4.0 * PI * (x * y * z).cbrt().powi(2),
            Self::Cylinder => TAU * (x * y).sqrt() * z,
            Self::Disk => PI * x * y,
        }
    }

    /// Parts of the angle and of the other coordinate for a mesh of about `triangles`, no more than `most` of the angle.
    pub fn cells(self, triangles: f64, most: u32) -> [u32; 2] {
        let around = |n: f64| (n as u32).clamp(LEAST_AROUND, most) & !1;
        match self {
            // A sphere of s x s/2 cells has s (s - 2) triangles.
            Self::Sphere => {
                let s = around(1.0 + (1.0 + triangles).sqrt());
                [s, s / 2]
            }
            Self::Cylinder => [around(triangles / 2.0), 1],
            Self::Disk => [around(triangles), 1],
        }
    }

    /// The coarse mesh, its vertices on the shape.
    pub fn mesh(self, [around, along]: [u32; 2]) -> Mesh {
        let mut mesh = grid(around, along, |i, j| {
            let pole = match self {
                Self::Sphere => j == 0 || j == along,
                Self::Cylinder => false,
                Self::Disk => j == 0,
            };
            // At a pole, each segment's vertex looks along its middle.
            let turn = (f64::from(i) + if pole { 0.5 } else { 0.0 }) / f64::from(around);
            let at = self.at(turn, f64::from(j) / f64::from(along));
            let p = match self {
                Self::Sphere if pole => DVec3::Z * at.p.z.signum(),
                _ => at.p,
            };
            (p.as_vec3(), at.n.as_vec3(), at.uv.as_vec2())
        });
        if self == Self::Cylinder {
            turn(&mut mesh);
        }
        mesh
    }

    /// The point at an angle (in turns) and at the other coordinate, 0 to 1.
    fn at(self, turn: f64, other: f64) -> RoundPoint {
        let (sin, cos) = (turn * TAU).sin_cos();
        match self {
            Self::Sphere => {
                let (s, c) = (other * PI).sin_cos();
                let p = DVec3::new(s * cos, s * sin, c);
                let dp_du = DVec3::new(-p.y, p.x, 0.0) * TAU;
                RoundPoint { p, n: p, uv: DVec2::new(turn, other), dp_du, dp_dv: DVec3::new(c * cos, c * sin, -s) * PI }
            }
            Self::Cylinder => {
                let n = DVec3::new(cos, sin, 0.0);
                let dp_du = DVec3::new(-sin, cos, 0.0) * TAU;
                RoundPoint { p: n.with_z(other), n, uv: DVec2::new(turn, other), dp_du, dp_dv: DVec3::Z }
            }
            Self::Disk => {
                let r = DVec3::new(cos, sin, 0.0);
                let dp_dv = DVec3::new(-sin, cos, 0.0) * (TAU * other);
                RoundPoint { p: r * other, n: DVec3::Z, uv: DVec2::new(other, turn), dp_du: r, dp_dv }
            }
        }
    }

    /// The angle in turns, [0, 1), and the other coordinate of a point of the shape.
    fn coordinates(self, p: DVec3) -> (f64, f64) {
        let turn = (p.y.atan2(p.x) / TAU).rem_euclid(1.0);
        let other = match self {
            Self::Sphere => p.truncate().length().atan2(p.z) / PI,
            Self::Cylinder => p.z,
            Self::Disk => p.truncate().length(),
        };
        (if turn < 1.0 { turn } else { 0.0 }, other.clamp(0.0, 1.0))
    }

    /// Where a line meets the shape, in order, as multiples of `d` from `o`; NaN where it does not.
    fn meets(self, o: DVec3, d: DVec3) -> [f64; 2] {
        match self {
            Self::Sphere => roots(d.length_squared(), o.dot(d), o.cross(d).length_squared(), o.length_squared() - 1.0),
            Self::Cylinder => {
                let (o2, d2) = (o.truncate(), d.truncate());
                let t = roots(d2.length_squared(), o2.dot(d2), o2.perp_dot(d2).powi(2), o2.length_squared() - 1.0);
                t.map(|t| if (0.0..=1.0).contains(&(o.z + t * d.z)) { t } else { f64::NAN })
            }
            Self::Disk => {
                let t = -o.z / d.z;
                [if (o + d * t).truncate().length_squared() <= 1.0 { t } else { f64::NAN }, f64::NAN]
            }
        }
    }
}

/// Fewest parts of the angle.
const LEAST_AROUND: u32 = 8;

/// Both t with a t² + 2 b t + c = 0, where `cross` is the squared area that tells them apart: a - `cross` = b² - a c.
fn roots(a: f64, b: f64, cross: f64, c: f64) -> [f64; 2] {
    let discriminant = a - cross;
    if !(discriminant >= 0.0 && a > 0.0) {
        return [f64::NAN; 2];
    }
    // Without the difference of two numbers that are nearly equal.
    let q = -(b + discriminant.sqrt().copysign(b));
    let (t0, t1) = (q / a, if q == 0.0 { 0.0 } else { c / q });
    [t0.min(t1), t0.max(t1)]
}

impl Round {
    /// Where the ray from `o` along `d` meets the shape, in order of distance; NaN where it does not.
    pub fn meets(&self, o: Vec3, d: Vec3) -> [f64; 2] {
        let (o, d) = (o.as_dvec3(), d.as_dvec3());
        self.kind.meets(self.to_local.transform_point3(o), self.to_local.transform_vector3(d))
    }

    /// Triangle, and weights of its second and third vertex, of a point of the shape in its own space.
    pub fn locate(&self, p: DVec3) -> (u32, f32, f32) {
        let (turn, other) = self.kind.coordinates(p);
        let [around, along] = self.cells;
        let cell = |x: f64, n: u32| {
            let i = ((x * f64::from(n)) as u32).min(n - 1);
            (i, (x * f64::from(n) - f64::from(i)).clamp(0.0, 1.0))
        };
        let ((i, f), (j, g)) = (cell(turn, around), cell(other, along));
        let (part, b, c) = match self.row(j) {
            Row::FromPole => (i, g * (1.0 - f), g * f),
            Row::ToPole => (i, g, (1.0 - g) * f),
            Row::Whole if g >= f => (2 * i, g - f, f),
            Row::Whole => (2 * i + 1, g, f - g),
        };
        let (b, c) = if self.is_swapped() { (c, b) } else { (b, c) };
        (self.first + self.before(j) + part, b as f32, c as f32)
    }

    /// The point, in the shape's own space, that a triangle and its weights mean; inverse of [`Round::locate`].
    pub fn point(&self, triangle: u32, b: f32, c: f32) -> RoundPoint {
        let (b, c) = if self.is_swapped() { (c, b) } else { (b, c) };
        let (b, c) = (f64::from(b), f64::from(c));
        let [around, along] = self.cells;
        let index = triangle - self.first;
        // The row before which no more triangles lie than before this one.
        let j = (0..along).rev().find(|&j| self.before(j) <= index).unwrap_or(0);
        let part = index - self.before(j);
        let share = |x: f64, whole: f64| if whole > 0.0 { (x / whole).clamp(0.0, 1.0) } else { 0.5 };
        let (i, f, g) = match self.row(j) {
            Row::FromPole => (part, share(c, b + c), b + c),
            Row::ToPole => (part, share(c, 1.0 - b), b),
            Row::Whole if part.is_multiple_of(2) => (part / 2, c, b + c),
            Row::Whole => (part / 2, b + c, b),
        };
        self.kind.at((f64::from(i) + f) / f64::from(around), (f64::from(j) + g) / f64::from(along))
    }

    /// The point of the shape that a hit's triangle and weights mean, and its texture coordinate.
    pub fn uv(&self, triangle: u32, b: f32, c: f32) -> Vec2 {
        self.point(triangle, b, c).uv.as_vec2()
    }

    /// Unit normal in the world of a point whose own is `n`, as `flip_normals` turns it.
    pub fn normal(&self, n: DVec3) -> DVec3 {
        let n = self.to_local.matrix3.transpose() * n;
        n.normalize() * if self.inwards { -1.0 } else { 1.0 }
    }

    /// How much larger a piece of the surface with normal `n` is in the world than in the shape's own space.
    pub fn stretch(&self, n: DVec3) -> f64 {
        (self.to_world.matrix3.determinant() * (self.to_local.matrix3.transpose() * n)).length()
    }

    /// Area in the world, from a few thousand pieces where the scale is uneven.
    pub fn area(&self) -> f64 {
        let (n, local) = (64, self.kind.area(&DMat3::IDENTITY));
        let pieces = (0..n * n).map(|k| ((f64::from(k % n) + 0.5) / f64::from(n), (f64::from(k / n) + 0.5) / f64::from(n)));
        local * pieces.map(|(x, y)| self.stretch(self.uniform(x, y).n)).sum::<f64>() / f64::from(n * n)
    }

    /// The point at (x, y) of the unit square, spread evenly over the shape in its own space.
    pub fn uniform(&self, x: f64, y: f64) -> RoundPoint {
        match self.kind {
            RoundKind::Sphere => self.kind.at(x, (1.0 - 2.0 * y).clamp(-1.0, 1.0).acos() / PI),
            RoundKind::Cylinder => self.kind.at(x, y),
            RoundKind::Disk => self.kind.at(x, y.sqrt()),
        }
    }

    /// The point of the shape that lies at `p` in its own space.
    pub fn nearest(&self, p: DVec3) -> RoundPoint {
        let (turn, other) = self.kind.coordinates(p);
        self.kind.at(turn, other)
    }

    /// Lower and upper corner of the shape in the world.
    pub fn bounds(&self) -> [DVec3; 2] {
        let m = &self.to_world.matrix3;
        let rows = m.transpose();
        let reach = |row: DVec3| match self.kind {
            RoundKind::Sphere => row.length(),
            RoundKind::Cylinder | RoundKind::Disk => row.truncate().length(),
        };
        let r = DVec3::new(reach(rows.x_axis), reach(rows.y_axis), reach(rows.z_axis));
        let ends = match self.kind {
            RoundKind::Cylinder => [DVec3::ZERO, m.z_axis],
            RoundKind::Sphere | RoundKind::Disk => [DVec3::ZERO; 2],
        };
        let o = self.to_world.translation;
        [o + ends[0].min(ends[1]) - r, o + ends[0].max(ends[1]) + r]
    }

    /// Whether the second and third vertex of its triangles have changed places against the grid that they come from.
    fn is_swapped(&self) -> bool {
        self.turned != (self.kind == RoundKind::Cylinder)
    }

    fn row(&self, j: u32) -> Row {
        match self.kind {
            RoundKind::Sphere if j == 0 => Row::FromPole,
            RoundKind::Sphere if j == self.cells[1] - 1 => Row::ToPole,
            RoundKind::Disk if j == 0 => Row::FromPole,
            _ => Row::Whole,
        }
    }

    /// Triangles in the rows before row `j`.
    fn before(&self, j: u32) -> u32 {
        let around = self.cells[0];
        match self.kind {
            RoundKind::Cylinder => 2 * around * j,
            RoundKind::Sphere | RoundKind::Disk if j == 0 => 0,
            RoundKind::Sphere | RoundKind::Disk => around * (2 * j - 1),
        }
    }
}

/// How the cells of a row are cut: two triangles each, or one where a side has shrunk to a pole.
enum Row {
    FromPole,
    Whole,
    ToPole,
}
