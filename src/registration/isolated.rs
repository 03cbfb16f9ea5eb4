//! Points that belong to no surface: clutter of a raw cloud.
//!
//! In: a raw cloud. Out: the cloud without the points that lie alone or in small groups.
//!
//! 1. The reach of a point is the distance of its eighth neighbour.
//! 2. Two neighbours are joined when they are not farther apart than 1.25 times the smaller of their reaches: along a surface, however
//!    its density changes, all are (2 000 of 2 000 random points on ellipsoids, also where the density falls to a twentieth); a
//!    stray point is far from the surface by the surface's measure, and stray points among themselves make small groups
//!    (85 to 91 of 100 are told). With 2.5 times, chains of stray points hang on to the surface and nearly all stay.
//! 3. Groups of less than 5 % of the points go.
//!
//! Why at all: lengths of the search are shares of the diagonal, which clutter lengthens, and an untruncated distance feels it.
//! Clutter within about three spacings of the surface stays; de-noising takes it. Departure from the local outlier factor (Breunig,
//! Kriegel, Ng and Sander 2000): that compares each point with its neighbours alone, and leaves clutter whose neighbours are clutter.
//! Cost: `O(n log n)`.

use crate::geometry::Neighbours;
use glam::DVec3;
use petgraph::unionfind::UnionFind;
use rayon::prelude::*;

/// The neighbour whose distance is a point's reach, and how many are joined.
const NEIGHBOUR: usize = 8;
/// Neighbours farther apart than this many of the smaller reach are not joined.
const APART: f64 = 1.25;
/// Share of the points a group must have to be a surface.
const LEAST_SHARE: f64 = 0.05;
/// Fewer points are all kept.
const FEWEST: usize = 100;

/// The points of the large groups, in their order; `None` when that is all of them.
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
    let reach: Vec<f64> = near
        .iter()
        .zip(points)
        .map(|(near, p)| near.last().map_or(0.0, |&j| points[j as usize].distance(*p)))
        .collect();
    let mut groups = UnionFind::<u32>::new(points.len());
    for (i, near) in near.iter().enumerate() {
        for &j in near {
            let k = j as usize;
            if points[i].distance(points[k]) <= APART * reach[i].min(reach[k]) {
                groups.union(i as u32, j);
            }
        }
    }
    let group = groups.into_labeling();
    let mut sizes = vec![0usize; points.len()];
    group.iter().for_each(|&g| sizes[g as usize] += 1);
    let least = LEAST_SHARE * points.len() as f64;
    let kept: Vec<DVec3> = points
        .iter()
        .zip(&group)
        .filter(|(_, g)| sizes[**g as usize] as f64 >= least)
        .map(|(p, _)| *p)
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
            4 * clutter <= mixed.len() - 2000,
            "{clutter} of {} left",
            mixed.len() - 2000
        );
    }
}
