//! Which pairs of matched points agree on lengths.
//!
//! A rigid motion keeps distances: two right pairs (p, q) and (p', q') have `| |p - p'| - |q - q'| | <= 2 b` when every
//! point is off by at most b. With an unknown scale in `[lo, hi]` the target length must lie in
//! `[lo |p - p'| - 2 b, hi |p - p'| + 2 b]`. Pairs that share a source or target point contradict each other.
//! (H. Yang, J. Shi, L. Carlone, "TEASER: fast and certifiable point cloud registration", IEEE T-RO 2021, section on
//! maximal clique inlier selection.) Cost: O(n^2).

use super::clique::Graph;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// Range of the target's size over the source's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleRange {
    /// Smallest scale.
    pub least: f64,
    /// Largest scale.
    pub greatest: f64,
}

impl ScaleRange {
    /// Rigid: scale exactly one.
    pub const RIGID: ScaleRange = ScaleRange {
        least: 1.0,
        greatest: 1.0,
    };
}

/// Joins the pairs that agree on lengths within twice `point_error` and do not share a point.
pub fn consistency_graph(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    point_error: f64,
    scale: ScaleRange,
) -> Graph {
    let n = source.len();
    let mut graph = Graph::new(n);
    for a in 0..n {
        for b in 0..a {
            let (p, q) = ((source[a] - source[b]).norm(), (target[a] - target[b]).norm());
            let slack = 2.0 * point_error;
            let fits = q >= scale.least * p - slack && q <= scale.greatest * p + slack;
            if fits && p > 0.0 && q > 0.0 {
                graph.join(a, b);
            }
        }
    }
    graph
}
