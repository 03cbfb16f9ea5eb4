//! Nearest neighbours among fixed points.
//!
//! In: points in mm. Out: neighbours in order of (squared distance, index), so that ties never depend on the tree.
//!
//! 1. A [kiddo] immutable kd-tree finds candidates (the mutable one refuses more than 32 identical points).
//! 2. Distances are computed again from the points, one formula for every query.
//! 3. Where the last neighbour ties with the next, all points at that distance are fetched and the lowest indices kept.
//!
//! Cost: `O(n log n)` to build, `O(log n + k)` a query for points of bounded density; identical points are allowed and make
//! the ties of step 3 as large as their number.

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// A point found near a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Index into the points the tree was built from.
    pub index: u32,
    /// Squared distance to the query, mm^2.
    pub distance2: f64,
}

/// Points with an index for neighbour queries.
pub struct Neighbours {
    points: Vec<DVec3>,
    tree: Option<ImmutableKdTree<f64, 3>>,
}

/// Candidates are fetched from a ball wider by this factor, because the tree may round its sums in another order than we do;
/// three squares and two sums err by at most a few units in the last place.
const ROUNDING: f64 = 1.0 + 1e-12;

impl Neighbours {
    /// Indexes the points. All coordinates must be finite (checked at the door of every stage), fewer than `u32::MAX`.
    ///
    /// ```
    /// use glam::DVec3;
    /// use medial_scaffold::geometry::Neighbours;
    /// let tree = Neighbours::new(&[DVec3::ZERO, DVec3::X, DVec3::new(3.0, 0.0, 0.0)]);
    /// let near: Vec<u32> = tree.knn(DVec3::new(0.5, 0.0, 0.0), 2).iter().map(|n| n.index).collect();
    /// assert_eq!(near, [0, 1]); // a tie: the lower index first
    /// ```
    pub fn new(points: &[DVec3]) -> Self {
        debug_assert!(points.iter().all(|p| p.is_finite()));
        let coordinates: Vec<[f64; 3]> = points.iter().map(|p| p.to_array()).collect();
        let tree = (!points.is_empty()).then(|| {
            ImmutableKdTree::new_from_slice(&coordinates).expect("finite points, indices within u32")
        });
        Self {
            points: points.to_vec(),
            tree,
        }
    }

    /// The indexed points.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Number of indexed points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The nearest point; of several at one distance that of lowest index. `None` without points.
    pub fn nearest(&self, query: DVec3) -> Option<Neighbour> {
        self.knn(query, 1).first().copied()
    }

    /// The `k` nearest points (all when there are fewer), in order of (distance, index). A query that is itself an indexed
    /// point finds itself, at distance 0.
    pub fn knn(&self, query: DVec3, k: usize) -> Vec<Neighbour> {
        let Some(tree) = &self.tree else {
            return Vec::new();
        };
        let Some(wanted) = NonZero::new((k + 1).min(self.points.len())) else {
            return Vec::new();
        };
        if k == 0 {
            return Vec::new();
        }
        let q = query.to_array();
        let mut found: Vec<Neighbour> = tree
            .query(&q)
            .nearest_n::<SquaredEuclidean<f64>>(wanted)
            .execute()
            .iter()
            .map(|hit| self.neighbour(query, hit.item))
            .collect();
        sort(&mut found);
        if found.len() > k {
            let (last, next) = (found[k - 1].distance2, found[k].distance2);
            if next <= last * ROUNDING {
                found = self.within(query, (last * ROUNDING).sqrt() * ROUNDING);
            }
        }
        found.truncate(k);
        found
    }

    /// All points within `radius_mm` (inclusive), in order of (distance, index).
    pub fn within(&self, query: DVec3, radius_mm: f64) -> Vec<Neighbour> {
        let Some(tree) = &self.tree else {
            return Vec::new();
        };
        let radius2 = radius_mm * radius_mm;
        let mut found: Vec<Neighbour> = tree
            .query(&query.to_array())
            .within::<SquaredEuclidean<f64>>(radius2 * ROUNDING)
            .execute()
            .iter()
            .map(|hit| self.neighbour(query, hit.item))
            .filter(|n| n.distance2 <= radius2)
            .collect();
        sort(&mut found);
        found
    }

    /// [`Self::nearest`] of many queries in parallel, in the order of the queries. Must not be called without points.
    pub fn nearest_many(&self, queries: &[DVec3]) -> Vec<Neighbour> {
        queries
            .par_iter()
            .map(|&q| self.nearest(q).expect("the caller has points"))
            .collect()
    }

    /// [`Self::knn`] of many queries in parallel, in the order of the queries.
    pub fn knn_many(&self, queries: &[DVec3], k: usize) -> Vec<Vec<Neighbour>> {
        queries.par_iter().map(|&q| self.knn(q, k)).collect()
    }

    fn neighbour(&self, query: DVec3, index: u32) -> Neighbour {
        Neighbour {
            index,
            distance2: (self.points[index as usize] - query).length_squared(),
        }
    }
}

fn sort(found: &mut [Neighbour]) {
    found.sort_unstable_by(|a, b| a.distance2.total_cmp(&b.distance2).then(a.index.cmp(&b.index)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn brute(points: &[DVec3], query: DVec3) -> Vec<Neighbour> {
        let mut all: Vec<Neighbour> = points
            .iter()
            .enumerate()
            .map(|(i, p)| Neighbour {
                index: i as u32,
                distance2: (*p - query).length_squared(),
            })
            .collect();
        sort(&mut all);
        all
    }

    #[test]
    fn agrees_with_brute_force_on_grids_full_of_ties_and_on_random_points() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let grid: Vec<DVec3> = (0..1000)
            .map(|i| DVec3::new((i % 10) as f64, (i / 10 % 10) as f64, (i / 100) as f64))
            .collect();
        let random: Vec<DVec3> = (0..777)
            .map(|_| DVec3::new(rng.random(), rng.random(), rng.random()))
            .collect();
        let same = vec![DVec3::splat(0.3); 500];
        for points in [grid, random, same, vec![DVec3::X]] {
            let tree = Neighbours::new(&points);
            for i in 0..60 {
                let query = if i % 2 == 0 {
                    points[i * 7 % points.len()]
                } else {
                    DVec3::new(rng.random(), rng.random(), rng.random()) * 4.0
                };
                let all = brute(&points, query);
                for k in [0, 1, 2, 7, 27, 2000] {
                    assert_eq!(tree.knn(query, k), all[..k.min(all.len())]);
                }
                for r in [0.0, 0.1, 1.0, 2.0] {
                    let end = all.partition_point(|n| n.distance2 <= r * r);
                    assert_eq!(tree.within(query, r), all[..end]);
                }
            }
        }
    }

    #[test]
    fn no_points_no_neighbours() {
        let tree = Neighbours::new(&[]);
        assert!(
            tree.is_empty()
                && tree.nearest(DVec3::ZERO).is_none()
                && tree.within(DVec3::ZERO, 9.0).is_empty()
        );
    }
}
