//! Clustered principal components (Sloan et al. 2003; §4.1, Eq. 11): the rows of receivers that lie together, T ≈ U Σ Vᵀ cut to its
//! largest singular values.
//!
//! *Ours*: only so many of them are ever asked for, so the space that they span is found by subspace iteration (Halko et al. 2011) in place of
//! a full decomposition; and a cluster is split along its first principal component, so that receivers of one wall part from those of
//! another. *Reading*: the error is the root of the mean square over a cluster's rows, relative to that over all receivers' rows, so that dark
//! corners do not ask for more than they show.

use super::interpolate::Row;
use crate::base::math::{hash_words, unit};
use half::f16;
use nalgebra_sparse::na::{DMatrix, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// How transport is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompressParams {
    /// Receivers of a cluster, at most one less. *Paper*: 1024.
    pub most_receivers: u32,
    /// Relative error at which a cluster is good enough. *Paper*: 0.005. *Ours*: 0.015, which changes irradiance by a third of a percent.
    pub error: f32,
    /// Most coefficients a receiver. *Paper*: 32.
    pub most_terms: u32,
}

impl Default for CompressParams {
    fn default() -> Self {
        Self { most_receivers: 1024, error: 0.015, most_terms: 32 }
    }
}

/// Receivers below which a cluster is not split, as its halves would be larger than their rows.
const LEAST_RECEIVERS: usize = 64;
/// Directions more than are asked for, and turns of the iteration.
const MORE: usize = 8;
const TURNS: usize = 2;

/// Receivers whose rows lie in one small space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cluster {
    /// The receivers.
    pub receivers: Vec<u32>,
    /// The probes that have a part in their light.
    pub probes: Vec<u32>,
    /// Dimensions of the space, n_c.
    pub rank: usize,
    /// Σ Vᵀ, `rank` rows over the harmonics of all `probes`.
    pub projection: Vec<f16>,
    /// U: for each receiver and each number that it keeps, `rank` coefficients.
    pub reconstruction: Vec<f16>,
}

/// Rows side by side: a column a row, over the harmonics of `probes`.
struct Rows {
    receivers: Vec<u32>,
    probes: Vec<u32>,
    matrix: DMatrix<f32>,
}

/// Compresses the rows of a group of receivers, in as many clusters as that takes. `terms`: harmonics of a probe; `scale`: the mean square of all receivers' rows.
pub fn compress(group: Vec<u32>, rows: Vec<Row>, terms: usize, (params, scale): (&CompressParams, f64)) -> Vec<Cluster> {
    let (mut done, mut open) = (Vec::new(), vec![(group, rows)]);
    while let Some((group, rows)) = open.pop() {
        match Rows::new(group, &rows, terms).cluster(params, scale) {
            Ok(cluster) => done.push(cluster),
            Err(Split { receivers, is_first }) => {
                let (mut a, mut b) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
                for ((receiver, row), is_first) in receivers.into_iter().zip(rows).zip(is_first) {
                    let half = if is_first { &mut a } else { &mut b };
                    half.0.push(receiver);
                    half.1.push(row);
                }
                open.extend([b, a]);
            }
        }
    }
    done
}

/// Receivers that are too many for one cluster, and which half each belongs to.
struct Split {
    receivers: Vec<u32>,
    is_first: Vec<bool>,
}

impl Rows {
    fn new(receivers: Vec<u32>, rows: &[Row], terms: usize) -> Self {
        let is_zero = |row: &Row, slot: usize| {
            row.values.chunks(row.probes.len() * terms).all(|kind| kind[slot * terms..][..terms].iter().all(|&v| v == 0.0))
        };
        let parts = rows.iter().flat_map(|row| (0..row.probes.len()).filter(|&s| !is_zero(row, s)).map(|s| row.probes[s]));
        let mut probes: Vec<u32> = parts.collect();
        probes.sort_unstable();
        probes.dedup();
        let kinds = rows.iter().find(|r| !r.probes.is_empty()).map_or(1, |r| r.values.len() / (r.probes.len() * terms));
        let mut matrix = DMatrix::zeros(probes.len() * terms, rows.len() * kinds);
        for (k, row) in rows.iter().enumerate() {
            for (slot, probe) in row.probes.iter().enumerate() {
                let Ok(to) = probes.binary_search(probe) else { continue };
                for kind in 0..kinds {
                    let from = &row.values[(kind * row.probes.len() + slot) * terms..][..terms];
                    matrix.column_mut(k * kinds + kind).as_mut_slice()[to * terms..][..terms].copy_from_slice(from);
                }
            }
        }
        Self { receivers, probes, matrix }
    }

    /// One cluster of all rows, or their halves where so few coefficients do not reach the error.
    fn cluster(self, params: &CompressParams, scale: f64) -> Result<Cluster, Split> {
        let (columns, most) = (self.matrix.ncols(), params.most_terms as usize);
        let kinds = columns / self.receivers.len().max(1);
        let square = |values: &mut dyn Iterator<Item = &f32>| values.map(|&v| f64::from(v) * f64::from(v)).sum::<f64>();
        let wanted = scale * self.receivers.len() as f64 * f64::from(params.error).powi(2);
        let mut left = square(&mut self.matrix.iter());
        if left <= wanted {
            return Ok(Cluster { receivers: self.receivers, ..Cluster::default() });
        }
        let (basis, parts) = leading(&self.matrix, most);
        let mut rank = 0;
        while rank < parts.nrows() && left > wanted {
            left -= square(&mut parts.row(rank).iter());
            rank += 1;
        }
        if (left > wanted || rank > most) && self.receivers.len() >= LEAST_RECEIVERS {
            let is_first = halves(&parts, kinds);
            if is_first.contains(&true) && is_first.contains(&false) {
                return Err(Split { receivers: self.receivers, is_first });
            }
        }
        let rank = rank.min(most);
        let scale: Vec<f32> = (0..rank).map(|k| parts.row(k).norm().max(f32::MIN_POSITIVE)).collect();
        let projection = (0..rank).flat_map(|k| basis.column(k).iter().map(|v| f16::from_f32(v * scale[k])).collect::<Vec<_>>());
        let reconstruction =
            (0..columns).flat_map(|i| (0..rank).map(|k| f16::from_f32(parts[(k, i)] / scale[k])).collect::<Vec<_>>());
        let (projection, reconstruction) = (projection.collect(), reconstruction.collect());
        Ok(Cluster { receivers: self.receivers, probes: self.probes, rank, projection, reconstruction })
    }
}

/// On which side of their mean receivers lie along the direction in which they differ most; `kinds` columns of `parts` are a receiver's.
fn halves(parts: &DMatrix<f32>, kinds: usize) -> Vec<bool> {
    let size = parts.nrows() * kinds;
    let points = DMatrix::from_column_slice(size, parts.ncols() / kinds, parts.as_slice());
    let mean = points.column_mean();
    let points = DMatrix::from_fn(points.nrows(), points.ncols(), |i, k| points[(i, k)] - mean[i]);
    let eigen = SymmetricEigen::new(&points * points.transpose());
    let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    points.column_iter().map(|p| p.dot(&axis) < 0.0).collect()
}

/// The left singular vectors of the largest singular values, up to `most` and a few more, and their products with all columns.
fn leading(matrix: &DMatrix<f32>, most: usize) -> (DMatrix<f32>, DMatrix<f32>) {
    let transposed = matrix.transpose();
    let count = (most + MORE).min(matrix.nrows()).min(matrix.ncols());
    // Sums of twelve uniform numbers are normal enough.
    let normal = |i: usize, k: usize| (0..12).map(|n| unit(hash_words(&[i as u32, k as u32, n]))).sum::<f32>() - 6.0;
    let mut basis = orthonormal(matrix * DMatrix::from_fn(matrix.ncols(), count, normal));
    for _ in 0..TURNS {
        basis = orthonormal(matrix * orthonormal(&transposed * &basis));
    }
    let parts = basis.transpose() * matrix;
    let eigen = SymmetricEigen::new(&parts * parts.transpose());
    let mut order: Vec<usize> = (0..basis.ncols()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let turn = DMatrix::from_fn(order.len(), order.len(), |i, k| eigen.eigenvectors[(i, order[k])]);
    (basis * &turn, turn.transpose() * parts)
}

/// An orthonormal basis of the space that the columns span: those that depend on others to rounding are left out (Gram-Schmidt, twice).
fn orthonormal(mut columns: DMatrix<f32>) -> DMatrix<f32> {
    let largest = columns.column_iter().map(|c| c.norm()).fold(0.0, f32::max);
    let mut kept = 0;
    for k in 0..columns.ncols() {
        let mut column = columns.column(k).into_owned();
        for _ in 0..2 {
            let basis = columns.columns(0, kept);
            let parts = basis.tr_mul(&column);
            column -= basis * parts;
        }
        let norm = column.norm();
        if norm > 1e-6 * largest {
            columns.set_column(kept, &(column / norm));
            kept += 1;
        }
    }
    columns.columns(0, kept).into_owned()
}

#[cfg(test)]
mod tests {
    use super::super::transport::mean_square;
    use super::*;

    /// Rows that are sums of `rank` patterns over 3 probes of order 1, with noise.
    fn rows(count: u32, rank: u32, noise: f32, kinds: usize) -> Vec<Row> {
        let random = |a: u32, b: u32| unit(hash_words(&[a, b])) * 2.0 - 1.0;
        let value = |r: u32, v: u32| {
            let pattern = |k: u32| random(1000 + k, v) * ((r as f32) * 0.05 * (k + 1) as f32).sin();
            (0..rank).map(pattern).sum::<f32>() + noise * random(r, v)
        };
        let row = |r: u32| Row { probes: vec![2, 5, 7], values: (0..12 * kinds as u32).map(|v| value(r, v)).collect() };
        (0..count).map(row).collect()
    }

    /// Relative RMS error of what clusters make of the rows, probe by probe.
    fn error(clusters: &[Cluster], rows: &[Row], kinds: usize) -> f64 {
        let (mut wrong, mut all) = (0.0, 0.0);
        for c in clusters {
            let width = c.probes.len() * 4;
            for (i, &r) in c.receivers.iter().enumerate() {
                for kind in 0..kinds {
                    let u: Vec<f32> = (0..c.rank).map(|k| c.reconstruction[(i * kinds + kind) * c.rank + k].to_f32()).collect();
                    for (slot, probe) in rows[r as usize].probes.iter().enumerate() {
                        for j in 0..4 {
                            let expected = rows[r as usize].values[(kind * 3 + slot) * 4 + j];
                            let found: f32 = match c.probes.binary_search(probe) {
                                Ok(at) => (0..c.rank).map(|k| u[k] * c.projection[k * width + at * 4 + j].to_f32()).sum(),
                                Err(_) => 0.0,
                            };
                            wrong += f64::from(found - expected).powi(2);
                            all += f64::from(expected).powi(2);
                        }
                    }
                }
            }
        }
        (wrong / all).sqrt()
    }

    #[test]
    fn rows_of_low_rank_come_back_to_the_error_that_is_asked_for() {
        for kinds in [1, 4] {
            for (rank, noise, wanted) in [(3, 0.0, 1e-3), (3, 0.01, 0.02), (9, 0.0, 0.1)] {
                let all = rows(300, rank, noise, kinds);
                let params = CompressParams { error: wanted, ..CompressParams::default() };
                let scale = mean_square(&all);
                let clusters = compress((0..300).collect(), rows(300, rank, noise, kinds), 4, (&params, scale));
                let found = error(&clusters, &all, kinds);
                assert!(found < f64::from(wanted) * 1.05, "{rank} {noise} {kinds}: {found}");
                let mut receivers: Vec<u32> = clusters.iter().flat_map(|c| c.receivers.clone()).collect();
                receivers.sort_unstable();
                assert_eq!(receivers, (0..300).collect::<Vec<_>>());
                if (rank, kinds) == (3, 1) {
                    assert_eq!((clusters.len(), clusters[0].rank), (1, 3), "no more than it takes");
                }
            }
        }
    }

    #[test]
    fn few_coefficients_are_made_up_for_by_more_clusters() {
        let all = rows(1000, 6, 0.0, 1);
        let params = CompressParams { error: 0.05, most_terms: 4, ..CompressParams::default() };
        let clusters = compress((0..1000).collect(), rows(1000, 6, 0.0, 1), 4, (&params, mean_square(&all)));
        assert!(clusters.len() > 1 && clusters.iter().all(|c| c.rank <= 4));
        assert!(error(&clusters, &all, 1) < 0.06, "{}", error(&clusters, &all, 1));
    }

    #[test]
    fn rows_of_nothing_and_rows_that_are_all_alike_are_no_trouble() {
        let params = CompressParams::default();
        let zero = |_| Row { probes: vec![1], values: vec![0.0; 4] };
        let dark = compress((0..50).collect(), (0..50).map(zero).collect(), 4, (&params, 1.0));
        assert_eq!((dark.len(), dark[0].rank, dark[0].probes.len()), (1, 0, 0));
        let one = |r: u32| Row { probes: vec![1], values: if r == 7 { vec![1.0, 0.0, 0.0, 2.0] } else { vec![0.0; 4] } };
        let single = compress((0..50).collect(), (0..50).map(one).collect(), 4, (&params, 1.0));
        assert_eq!(single[0].rank, 1);
        assert!(single[0].projection.iter().chain(&single[0].reconstruction).all(|v| v.is_finite()));
        let none = |_| Row { probes: vec![], values: vec![] };
        assert_eq!(compress(vec![3, 4], (0..2).map(none).collect(), 4, (&params, 1.0))[0].receivers, [3, 4]);
    }
}
