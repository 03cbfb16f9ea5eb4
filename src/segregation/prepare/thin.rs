//! Thinning: a random subset no two of whose points are close (dart throwing).
//!
//! In: points, their spacing, lists, a radius as a share of the spacing, a seed. Out: the points kept, in order. A point is
//! left out when one kept before it lies within its own radius; radii are well under the spacing, so the lists hold all
//! candidates.

use super::knn::KnnLists;
use glam::DVec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// The points kept.
pub fn poisson_disk(
    points: &[DVec3],
    spacing_mm: &[f64],
    lists: &KnnLists,
    share: f64,
    seed: u64,
) -> Vec<u32> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let mut kept = vec![false; points.len()];
    for i in order {
        let i = i as usize;
        let radius = share * spacing_mm[i];
        kept[i] = lists.first(i, lists.k())[1..]
            .iter()
            .map(|&j| j as usize)
            .take_while(|&j| points[i].distance(points[j]) < radius)
            .all(|j| !kept[j]);
    }
    (0..points.len() as u32).filter(|&i| kept[i as usize]).collect()
}
