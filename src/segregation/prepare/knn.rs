//! One list of nearest neighbours shared by all steps of the preparation.
//!
//! In: points. Out: for every point itself and its `k - 1` nearest others, in order of (distance, index), in one flat array.
//! When points are dropped only the lists that lost a member are asked for again.

use crate::geometry::Neighbours;
use glam::DVec3;
use rayon::prelude::*;

/// Flat lists of neighbours; the first entry of each list is the point itself.
#[derive(Clone, Debug)]
pub struct KnnLists {
    /// Length of every list (smaller than asked when there are fewer points).
    k: usize,
    index: Vec<u32>,
}

impl KnnLists {
    /// Lists of `k` (or all, when fewer) points each. `O(n (k + log n))`, parallel.
    pub fn new(points: &[DVec3], k: usize) -> Self {
        let tree = Neighbours::new(points);
        let k = k.min(points.len());
        let mut index = vec![0u32; points.len() * k];
        if k > 0 {
            index
                .par_chunks_mut(k)
                .zip(points.par_iter())
                .enumerate()
                .for_each(|(i, (list, &p))| fill(list, &tree, p, i as u32));
        }
        Self { k, index }
    }

    /// Length of the lists.
    pub fn k(&self) -> usize {
        self.k
    }

    /// The first `k` members of the list of point `i` (itself first).
    #[inline]
    pub fn first(&self, i: usize, k: usize) -> &[u32] {
        &self.index[i * self.k..i * self.k + k.min(self.k)]
    }

    /// Lists after the points not marked are dropped: `points` are those left, in their old order.
    pub fn keep(&self, points: &[DVec3], keep: &[bool]) -> Self {
        let mut place = vec![u32::MAX; keep.len()];
        for (next, (slot, _)) in place.iter_mut().zip(keep).filter(|(_, k)| **k).enumerate() {
            *slot = next as u32;
        }
        let tree = Neighbours::new(points);
        let k = self.k.min(points.len());
        let old: Vec<u32> = (0..keep.len() as u32).filter(|&i| keep[i as usize]).collect();
        let mut index = vec![0u32; points.len() * k];
        if k > 0 {
            index.par_chunks_mut(k).enumerate().for_each(|(i, list)| {
                let before = self.first(old[i] as usize, k);
                if before.iter().all(|&j| keep[j as usize]) {
                    for (slot, &j) in list.iter_mut().zip(before) {
                        *slot = place[j as usize];
                    }
                } else {
                    fill(list, &tree, points[i], i as u32);
                }
            });
        }
        Self { k, index }
    }
}

/// The point itself, then its nearest others.
fn fill(list: &mut [u32], tree: &Neighbours, point: DVec3, own: u32) {
    let found = tree.knn(point, list.len());
    list[0] = own;
    // Coincident points may push the point itself out of its own list; it still leads.
    let others = found.iter().map(|n| n.index).filter(|&j| j != own);
    for (slot, j) in list[1..].iter_mut().zip(others) {
        *slot = j;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropping_points_gives_the_lists_of_a_fresh_search() {
        let points: Vec<DVec3> = (0..200)
            .map(|i| {
                let t = f64::from(i) * 0.37;
                DVec3::new(t.sin(), (1.7 * t).cos(), (0.3 * t).sin())
            })
            .collect();
        let keep: Vec<bool> = (0..200).map(|i| i % 7 != 3).collect();
        let left: Vec<DVec3> = points
            .iter()
            .zip(&keep)
            .filter(|(_, k)| **k)
            .map(|(p, _)| *p)
            .collect();
        let updated = KnnLists::new(&points, 12).keep(&left, &keep);
        let fresh = KnnLists::new(&left, 12);
        assert_eq!(updated.index, fresh.index);
    }
}
