//! Points that belong to no surface: clutter of a raw cloud.
//!
//! In: a raw cloud. Out: the cloud without the points that lie alone.
//!
//! A point lies alone when its sixth neighbour is much farther away than those of its neighbours are from them (the local outlier
//! factor of Breunig, Kriegel, Ng and Sander 2000, with distances instead of densities). Local, so that a sparse end of a shape of
//! uneven density stays; clutter within about three spacings of the surface stays too, and de-noising takes it.
//!
//! Why at all: lengths of the search are shares of the diagonal, which clutter lengthens, and an untruncated distance feels it.
//! Cost: `O(n log n)`.

use crate::geometry::Neighbours;
use glam::DVec3;
use rayon::prelude::*;

/// The neighbour whose distance says how dense it is around a point.
const NEIGHBOUR: usize = 6;
/// A point is alone when that distance is this many times the median of its neighbours'. Between random points on a surface the
/// ratio stays below 2.
const ALONE: f64 = 2.5;
/// Fewer points are all kept.
const FEWEST: usize = 100;

/// The points that do not lie alone, in their order; `None` when that is all of them.
pub(crate) fn without_isolated(points: &[DVec3]) -> Option<Vec<DVec3>> {
    if points.len() < FEWEST {
        return None;
    }
    let tree = Neighbours::new(points);
    // The point itself comes first.
    let near: Vec<Vec<u32>> = points
        .par_iter()
        .map(|&p| tree.knn(p, NEIGHBOUR + 1).iter().map(|n| n.index).collect())
        .collect();
    let reach = |i: usize| {
        let last = near[i].last().map_or(i, |&j| j as usize);
        points[i].distance(points[last])
    };
    let kept: Vec<DVec3> = (0..points.len())
        .filter(|&i| {
            let mut around: Vec<f64> = near[i].iter().map(|&j| reach(j as usize)).collect();
            let middle = around.len() / 2;
            let (_, median, _) = around.select_nth_unstable_by(middle, f64::total_cmp);
            reach(i) <= ALONE * *median
        })
        .map(|i| points[i])
        .collect();
    // A cloud that is mostly clutter has no surface to be told from it.
    (kept.len() < points.len() && 2 * kept.len() > points.len()).then_some(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use datasets_synthetic::{ShapeKind, add_outliers, sample_density_gradient};

    #[test]
    fn clutter_goes_and_sparse_ends_stay() {
        let shape = ShapeKind::Ellipsoid.shape(0).expect("a single shape");
        let cloud = sample_density_gradient(&shape.mesh(8000), 2000, 20.0, 3).points;
        let lost = without_isolated(&cloud).map_or(0, |kept| cloud.len() - kept.len());
        assert!(lost <= 10, "{lost} of 2000 surface points taken for clutter");
        let even = shape.sample_uniform(2000, 4).points;
        let mixed = add_outliers(&even, 0.05, 0.2, 5);
        let kept = without_isolated(&mixed).expect("there is clutter");
        let clutter = kept.iter().filter(|p| !even.contains(p)).count();
        let surface = kept.len() - clutter;
        assert!(surface >= 1990, "{surface} of 2000 surface points kept");
        assert!(
            clutter <= (mixed.len() - 2000) / 2,
            "{clutter} of {} left",
            mixed.len() - 2000
        );
    }
}
