//! Tensorial quasi-harmonic maps (§4.2.2, after Zayer et al. 2005): a resolution map deforms the lat-long mesh so that texel
//! density grows with it.
//!
//! Both coordinates of the forward map f solve div(C ∇f) = 0 on the mesh whose quads are the texels of m.
//!
//! *Reading*: the paper asks for C = m I, "scaling proportional to m". Along one axis the equation says f' ∝ 1/C, so for a
//! map from directions to texels that choice starves what m favours (log-density against log m correlates at −.98). The
//! sentence decides: C = 1/m (+.95).
//!
//! *Reading*: "boundary vertices move on the boundary, left and right in step". The domain is a cylinder: u has a jump of 1
//! across the seam and is free at the poles, v is held at the poles and is the same on both sides of the seam. The seam
//! itself may move, so that turning the scene about the vertical turns the map. Nothing pins u's translation; the mean
//! displacement is set to 0.
//!
//! *Ours*: linear elements on split quads, which give the five-point stencil with positive weights (each edge the mean of
//! the C at its sides). Mirrored at the poles the mesh is a torus, and positive weights on a torus embed every quad as a
//! convex one (Gortler, Gotsman and Thurston 2006), so no quad flips but by rounding; that is checked, and answered by a
//! larger epsilon. "Solve iteratively" needs no more than one solve here: C does not depend on f.

use super::cholesky::Cholesky;
use crate::probe::parameter_map::count_flipped;
use crate::{Error, Result};
use glam::Vec2;
use nalgebra_sparse::pattern::SparsityPattern;

/// Regions of at most this many vertices are not dissected further.
const LEAF: u32 = 12;

/// Solver for one mesh size; the analysis of the matrix is shared by all probes.
pub struct Solver {
    mesh: [u32; 2],
    /// Unknown of each vertex (columns 0 to W − 1, rows 0 to H).
    unknown: Vec<u32>,
    /// What each stored matrix entry holds, column after column.
    entries: Vec<Entry>,
    pattern: SparsityPattern,
    cholesky: Cholesky,
}

#[derive(Clone, Copy)]
enum Entry {
    /// Diagonal, of a vertex.
    Vertex(u32),
    /// Off-diagonal: minus the weight of the edge to the right of a vertex.
    Right(u32),
    /// Off-diagonal: minus the weight of the edge below a vertex.
    Down(u32),
}

/// A forward map and how it was regularised.
#[derive(Debug, Clone, PartialEq)]
pub struct ForwardMap {
    /// Probe coordinates of the (W + 1) x (H + 1) vertices, as in [`crate::probe::parameter_map::ParameterMap::forward`].
    pub vertices: Vec<Vec2>,
    /// The epsilon that was used: that asked for, or larger where quads flipped.
    pub epsilon: f32,
}

impl Solver {
    /// Orders and analyses the matrix for resolution maps of this size, at least 4 x 2.
    pub fn new(mesh: [u32; 2]) -> Result<Self> {
        let [w, h] = mesh;
        if w < 4 || h < 2 || w > 4096 || h > 4096 {
            return Err(Error::Request(format!("resolution map of {w} x {h} texels: expected from 4 x 2 to 4096 x 4096")));
        }
        let order = dissected(w, h + 1);
        let mut unknown = vec![0; order.len()];
        for (i, &v) in order.iter().enumerate() {
            unknown[v as usize] = i as u32;
        }
        let mut offsets = vec![0];
        let (mut rows, mut entries) = (Vec::new(), Vec::new());
        for &v in &order {
            let (x, y) = (v % w, v / w);
            let left = y * w + (x + w - 1) % w;
            let mut column = vec![(v, Entry::Vertex(v)), (y * w + (x + 1) % w, Entry::Right(v)), (left, Entry::Right(left))];
            if y > 0 {
                column.push((v - w, Entry::Down(v - w)));
            }
            if y < h {
                column.push((v + w, Entry::Down(v)));
            }
            let mut column: Vec<_> = column.into_iter().map(|(n, e)| (unknown[n as usize] as usize, e)).collect();
            column.sort_by_key(|c| c.0);
            for (row, entry) in column {
                rows.push(row);
                entries.push(entry);
            }
            offsets.push(rows.len());
        }
        let n = order.len();
        let pattern = SparsityPattern::try_from_offsets_and_indices(n, n, offsets, rows)
            .map_err(|e| Error::Request(format!("matrix of the quasi-harmonic map: {e}")))?;
        Ok(Self { mesh, unknown, entries, cholesky: Cholesky::new(&pattern), pattern })
    }

    /// Quads of the mesh in u and v: the resolution map's size.
    pub fn mesh(&self) -> [u32; 2] {
        self.mesh
    }

    /// The map for a resolution map `m` ≥ 0, rows from the top; plain lat-long where m is 0 everywhere.
    /// `epsilon` times m's mean is added to m: it bounds how far a texel without need is compressed.
    pub fn forward_map(&mut self, m: &[f32], epsilon: f32) -> Result<ForwardMap> {
        let [w, h] = self.mesh;
        if m.len() != (w * h) as usize {
            return Err(Error::Request(format!("resolution map has {} texels, expected {w} x {h}", m.len())));
        }
        if let Some(i) = m.iter().position(|&x| !(x.is_finite() && x >= 0.0)) {
            return Err(Error::Request(format!("m is {} at texel {i}: expected a finite number that is not negative", m[i])));
        }
        let mean = m.iter().map(|&x| f64::from(x)).sum::<f64>() / m.len() as f64;
        let mut epsilon = epsilon;
        loop {
            // In units of the mean, so that the matrix is of order 1.
            let c: Vec<f64> = if mean > 0.0 {
                m.iter().map(|&x| 1.0 / (f64::from(x) / mean + f64::from(epsilon))).collect()
            } else {
                vec![1.0; m.len()]
            };
            let weights = Weights::new(self.mesh, &c);
            let [u, v] = [self.solve(&weights, Axis::U)?, self.solve(&weights, Axis::V)?];
            let vertices = self.vertices(&u, &v);
            if count_flipped(self.mesh, &vertices) == 0 {
                return Ok(ForwardMap { vertices, epsilon });
            }
            epsilon *= 4.0;
            if epsilon > 1e6 {
                return Err(Error::Request("the quasi-harmonic map flips quads whatever its epsilon".into()));
            }
        }
    }

    /// Displacements of all vertices along one axis, in quads.
    fn solve(&mut self, weights: &Weights, axis: Axis) -> Result<Vec<f64>> {
        let [w, h] = self.mesh;
        let pinned = |v: u32| axis == Axis::V && (v < w || v >= w * h);
        // One unknown of the singular u system is tied down; its sum of forces is 0, so the tie carries none.
        let tied = self.unknown.iter().position(|&i| i as usize == self.unknown.len() - 1);
        let values: Vec<f64> = self
            .entries
            .iter()
            .map(|&entry| match entry {
                Entry::Vertex(v) if pinned(v) => 1.0,
                Entry::Vertex(v) => weights.sum(v) + f64::from(axis == Axis::U && Some(v as usize) == tied),
                Entry::Right(v) if pinned(v) => 0.0,
                Entry::Right(v) => -weights.right[v as usize],
                Entry::Down(v) if pinned(v) || pinned(v + w) => 0.0,
                Entry::Down(v) => -weights.down[v as usize],
            })
            .collect();
        if !self.cholesky.factor(&self.pattern, &values) {
            return Err(Error::Request("the quasi-harmonic map's matrix is not positive definite".into()));
        }
        let mut x = vec![0.0; self.unknown.len()];
        for (v, &i) in self.unknown.iter().enumerate() {
            let v = v as u32;
            x[i as usize] = if pinned(v) { 0.0 } else { weights.force(v, axis) };
        }
        self.cholesky.solve(&mut x);
        let mut d: Vec<f64> = self.unknown.iter().map(|&i| x[i as usize]).collect();
        if axis == Axis::U {
            let mean = d.iter().sum::<f64>() / d.len() as f64;
            d.iter_mut().for_each(|x| *x -= mean);
        }
        Ok(d)
    }

    fn vertices(&self, u: &[f64], v: &[f64]) -> Vec<Vec2> {
        let [w, h] = self.mesh;
        (0..=h)
            .flat_map(|y| (0..=w).map(move |x| (x, y)))
            .map(|(x, y)| {
                let i = (y * w + x % w) as usize;
                let p = |at: u32, d: f64, n: u32| ((f64::from(at) + d) / f64::from(n)) as f32;
                // The last column is the first plus 1 to the bit, as the seam demands.
                let turn = if x == w { 1.0 } else { 0.0 };
                Vec2::new(p(x % w, u[i], w) + turn, p(y, v[i], h))
            })
            .collect()
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Axis {
    U,
    V,
}

/// Weights of the mesh's edges: the mean of C at both sides, half of C on the boundary.
struct Weights {
    mesh: [u32; 2],
    /// From each vertex to the one at its right.
    right: Vec<f64>,
    /// From each vertex to the one below; 0 in the last row.
    down: Vec<f64>,
}

impl Weights {
    fn new(mesh: [u32; 2], c: &[f64]) -> Self {
        let [w, h] = mesh;
        let quad = |x: u32, y: u32| c[(y * w + x) as usize];
        let vertices = || (0..=h).flat_map(|y| (0..w).map(move |x| (x, y)));
        let right = vertices()
            .map(|(x, y)| {
                let above = if y > 0 { quad(x, y - 1) } else { 0.0 };
                let below = if y < h { quad(x, y) } else { 0.0 };
                0.5 * (above + below)
            })
            .collect();
        let down = vertices().map(|(x, y)| if y < h { 0.5 * (quad((x + w - 1) % w, y) + quad(x, y)) } else { 0.0 }).collect();
        Self { mesh, right, down }
    }

    fn left(&self, v: u32) -> f64 {
        let w = self.mesh[0];
        self.right[(v / w * w + (v % w + w - 1) % w) as usize]
    }

    fn up(&self, v: u32) -> f64 {
        v.checked_sub(self.mesh[0]).map_or(0.0, |v| self.down[v as usize])
    }

    fn sum(&self, v: u32) -> f64 {
        self.left(v) + self.right[v as usize] + self.up(v) + self.down[v as usize]
    }

    /// What pulls a vertex off its place in plain lat-long.
    fn force(&self, v: u32, axis: Axis) -> f64 {
        match axis {
            Axis::U => self.right[v as usize] - self.left(v),
            Axis::V => self.down[v as usize] - self.up(v),
        }
    }
}

/// Vertices of a cylinder of `w` x `rows` in nested-dissection order: halves first, the vertices that part them last.
fn dissected(w: u32, rows: u32) -> Vec<u32> {
    let mut order = Vec::with_capacity((w * rows) as usize);
    let middle = w / 2;
    dissect(w, [1, 0], [middle, rows], &mut order);
    dissect(w, [middle + 1, 0], [w, rows], &mut order);
    for column in [0, middle] {
        order.extend((0..rows).map(|y| y * w + column));
    }
    order
}

fn dissect(w: u32, lower: [u32; 2], upper: [u32; 2], order: &mut Vec<u32>) {
    let size = [upper[0] - lower[0], upper[1] - lower[1]];
    if size[0] * size[1] <= LEAF {
        order.extend((lower[1]..upper[1]).flat_map(|y| (lower[0]..upper[0]).map(move |x| y * w + x)));
        return;
    }
    let axis = usize::from(size[1] > size[0]);
    let middle = lower[axis] + size[axis] / 2;
    let (mut near, mut far) = (upper, lower);
    near[axis] = middle;
    far[axis] = middle + 1;
    dissect(w, lower, near, order);
    dissect(w, far, upper, order);
    let other = 1 - axis;
    order.extend((lower[other]..upper[other]).map(|k| if axis == 0 { k * w + middle } else { middle * w + k }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;

    const EPSILON: f32 = 0.01;

    fn map(mesh: [u32; 2], m: &[f32], epsilon: f32) -> Vec<Vec2> {
        Solver::new(mesh).unwrap().forward_map(m, epsilon).unwrap().vertices
    }

    /// Values over six orders of magnitude without any smoothness.
    fn wild(mesh: [u32; 2], seed: u32) -> Vec<f32> {
        (0..mesh[0] * mesh[1]).map(|i| 10f32.powf(hash_words(&[seed, i]) as f32 / u32::MAX as f32 * 6.0 - 3.0)).collect()
    }

    #[test]
    fn constant_m_gives_plain_lat_long() {
        let mesh = [16, 8];
        for m in [0.0, 1.0, 1e-20, 1e20] {
            for (i, p) in map(mesh, &[m; 128], EPSILON).iter().enumerate() {
                let plain = Vec2::new((i % 17) as f32 / 16.0, (i / 17) as f32 / 8.0);
                assert!((*p - plain).length() < 1e-6, "m = {m}, vertex {i}: {p}, not {plain}");
            }
        }
    }

    #[test]
    fn texel_density_grows_with_m_across_a_step_in_longitude() {
        let mesh = [32, 8];
        let m: Vec<f32> = (0..256).map(|i| if i % 32 < 8 { 3.0 } else { 1.0 }).collect();
        let f = map(mesh, &m, EPSILON);
        // Alone along one axis, f' is proportional to m + ε·mean: the whole turn is shared out in that proportion.
        let mean = 1.5;
        let (much, little) = (3.0 + EPSILON * mean, 1.0 + EPSILON * mean);
        let unit = 8.0 * much + 24.0 * little;
        for y in 0..9 {
            for x in 0..32 {
                let width = f[y * 33 + x + 1].x - f[y * 33 + x].x;
                let expected = if x < 8 { much } else { little } / unit;
                assert!((width - expected).abs() < 1e-6, "column {x}: {width}, expected {expected}");
            }
        }
    }

    #[test]
    fn texel_density_grows_with_m_across_a_step_in_latitude() {
        let mesh = [8, 16];
        let m: Vec<f32> = (0..128).map(|i| if i / 8 < 4 { 10.0 } else { 0.0 }).collect();
        let f = map(mesh, &m, EPSILON);
        let (much, little) = (10.0 + EPSILON * 2.5, EPSILON * 2.5);
        let unit = 4.0 * much + 12.0 * little;
        for y in 0..16 {
            let height = f[(y + 1) * 9].y - f[y * 9].y;
            let expected = if y < 4 { much } else { little } / unit;
            assert!((height - expected).abs() < 1e-6, "row {y}: {height}, expected {expected}");
        }
    }

    #[test]
    fn every_vertex_is_the_weighted_mean_of_its_neighbours() {
        let mesh = [12, 6];
        let m = wild(mesh, 1);
        let mut solver = Solver::new(mesh).unwrap();
        let c: Vec<f64> = m.iter().map(|&x| 1.0 / f64::from(x)).collect();
        let weights = Weights::new(mesh, &c);
        for axis in [Axis::U, Axis::V] {
            let d = solver.solve(&weights, axis).unwrap();
            for v in 0..12 * 7u32 {
                let (x, y) = (v % 12, v / 12);
                if axis == Axis::V && (y == 0 || y == 6) {
                    assert_eq!(d[v as usize], 0.0, "poles hold v");
                    continue;
                }
                let at = |n: u32| d[n as usize] - d[v as usize];
                let mut pull = weights.force(v, axis);
                pull += weights.right[v as usize] * at(y * 12 + (x + 1) % 12);
                pull += weights.left(v) * at(y * 12 + (x + 11) % 12);
                pull += if y > 0 { weights.up(v) * at(v - 12) } else { 0.0 };
                pull += if y < 6 { weights.down[v as usize] * at(v + 12) } else { 0.0 };
                assert!(pull.abs() < 1e-9 * weights.sum(v), "vertex {v}: {pull} left over");
            }
        }
    }

    #[test]
    fn no_quad_flips_however_rough_m_is() {
        let mesh = [48, 24];
        let mut solver = Solver::new(mesh).unwrap();
        for seed in 0..20 {
            let map = solver.forward_map(&wild(mesh, seed), EPSILON).unwrap();
            assert_eq!(count_flipped(mesh, &map.vertices), 0, "seed {seed}");
            assert_eq!(map.epsilon, EPSILON, "seed {seed}: positive weights need no larger epsilon");
        }
    }

    #[test]
    fn boundaries_slide_along_themselves_and_the_seam_closes() {
        let mesh = [48, 24];
        let f = map(mesh, &wild(mesh, 3), EPSILON);
        for x in 0..=48 {
            assert_eq!((f[x].y, f[24 * 49 + x].y), (0.0, 1.0));
        }
        for y in 0..=24 {
            assert_eq!(f[y * 49 + 48], f[y * 49] + Vec2::X, "row {y}");
        }
    }

    #[test]
    fn turning_m_about_up_turns_the_map() {
        let mesh = [32, 16];
        let m: Vec<f32> = wild(mesh, 4).iter().map(|x| x.sqrt()).collect();
        let turned: Vec<f32> = (0..512).map(|i| m[i / 32 * 32 + (i % 32 + 27) % 32]).collect();
        let (a, b) = (map(mesh, &m, EPSILON), map(mesh, &turned, EPSILON));
        for y in 0..=16 {
            for x in 0..32 {
                let from = (x + 27) % 32;
                let moved = a[y * 33 + from] + Vec2::new((x as f32 - from as f32) / 32.0, 0.0);
                assert!((b[y * 33 + x] - moved).length() < 1e-5, "({x}, {y})");
            }
        }
    }

    #[test]
    fn a_solver_used_before_gives_the_same_bits_as_a_fresh_one() {
        let mesh = [32, 16];
        let mut used = Solver::new(mesh).unwrap();
        used.forward_map(&wild(mesh, 5), EPSILON).unwrap();
        let again = used.forward_map(&wild(mesh, 6), EPSILON).unwrap();
        assert_eq!(again, Solver::new(mesh).unwrap().forward_map(&wild(mesh, 6), EPSILON).unwrap());
    }

    #[test]
    fn a_bad_resolution_map_is_an_error() {
        let mut solver = Solver::new([8, 4]).unwrap();
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            let mut m = [1.0; 32];
            m[5] = bad;
            let message = solver.forward_map(&m, EPSILON).unwrap_err().to_string();
            assert!(message.contains("texel 5"), "{message}");
        }
        assert!(solver.forward_map(&[1.0; 31], EPSILON).is_err());
        assert!(Solver::new([2, 1]).is_err());
    }
}
