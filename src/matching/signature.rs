//! What a scaffold is like in any pose: distributions of its medial points.
//!
//! In: medial points drawn by area and persistence ([`super::samples`]). Out: a signature; two of them are apart by so many mm.
//!
//! 1. Four numbers of every point or pair of points: the radius, the distance from the centroid, the distance from the centroid to the
//!    surface beyond the point (both added), and the distance between two points (the shape distribution D2 of Osada, Funkhouser,
//!    Chazelle and Dobkin 2002, here of medial points, with persistence as their weight). To these the deviations along the
//!    principal axes.
//! 2. Every distribution is kept as quantiles. Two are apart by their Wasserstein distance of order 2, which is the root mean square
//!    difference of the quantiles, in mm; a histogram would jump when a value passes from one bin to the next.
//! 3. The signatures are apart by the root mean square of the five.
//!
//! A metric of signatures, hence zero for equal shapes, symmetric and obeying the triangle inequality; it does not see the mirror image and
//! needs no pose, so it is continuous wherever the samples are. Cost: O(n log n), 1 ms.

use super::moments::moments;
use super::samples::MedialSamples;
use glam::DVec3;

/// Quantiles kept of every distribution.
const QUANTILES: usize = 64;
/// Pairs of points a point takes part in.
const PAIRS: usize = 6;

/// The distributions of one scaffold, mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Signature {
    distributions: [Vec<f64>; 4],
    deviations: DVec3,
}

impl Signature {
    /// Reads the signature of medial points; of none it is empty.
    pub(crate) fn new(samples: &MedialSamples) -> Self {
        let n = samples.positions.len();
        if n == 0 {
            return Self::default();
        }
        let m = moments(&samples.positions);
        let far: Vec<f64> = samples.positions.iter().map(|p| p.distance(m.centroid)).collect();
        let outer = far.iter().zip(&samples.radii).map(|(d, r)| d + r).collect();
        // The points are in random order, so fixed steps make random pairs.
        let pairs = (0..n).flat_map(|i| (1..=PAIRS).map(move |k| (i, (i + k) % n)));
        let apart = pairs.map(|(i, j)| samples.positions[i].distance(samples.positions[j]));
        Self {
            distributions: [
                quantiles(samples.radii.clone()),
                quantiles(apart.collect()),
                quantiles(far),
                quantiles(outer),
            ],
            deviations: m.deviations,
        }
    }

    /// How far two signatures are apart, mm.
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        let squares: Vec<f64> = self
            .distributions
            .iter()
            .zip(&other.distributions)
            .map(|(a, b)| mean_square_difference(a, b))
            .collect();
        let deviations = (self.deviations - other.deviations).length_squared() / 3.0;
        ((squares.iter().sum::<f64>() + deviations) / (squares.len() + 1) as f64).sqrt()
    }
}

fn mean_square_difference(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum();
    sum / a.len().min(b.len()).max(1) as f64
}

/// Means of equal parts of the sorted values: the quantile function at [`QUANTILES`] places, smoothed over each.
fn quantiles(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (0..QUANTILES)
        .map(|q| {
            let (from, to) = (
                q * n / QUANTILES,
                ((q + 1) * n / QUANTILES).max(q * n / QUANTILES + 1),
            );
            let part = &values[from.min(n - 1)..to.min(n)];
            part.iter().sum::<f64>() / part.len() as f64
        })
        .collect()
}
