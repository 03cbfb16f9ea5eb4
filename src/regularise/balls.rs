//! Distance from a point to a union of balls.
//!
//! A bounding-volume tree over ball centres with the largest radius below each node: `|p - c| - r` is at least the
//! distance to the box less that radius, so whole branches are skipped. Balls may die after the tree is built; the
//! dead are passed over. Build `O(n log n)`, query about `O(log n)` for medial balls, whose radii vary slowly in space.

use glam::DVec3;

/// Balls at a leaf.
const LEAF: usize = 8;

#[derive(Clone, Debug)]
struct Node {
    lo: DVec3,
    hi: DVec3,
    radius: f64,
    start: u32,
    end: u32,
    /// Index of the second child; the first follows its parent. 0 at a leaf.
    second: u32,
}

/// A tree of balls.
#[derive(Clone, Debug, Default)]
pub(crate) struct BallTree {
    nodes: Vec<Node>,
    centres: Vec<DVec3>,
    radii: Vec<f64>,
    ids: Vec<u32>,
}

/// The ball nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NearestBall {
    /// Id of the ball.
    pub id: u32,
    /// Distance from the point to the ball's surface, negative inside.
    pub distance: f64,
}

impl BallTree {
    /// A tree over the balls named by `ids`.
    pub fn new(ids: Vec<u32>, centre: &[DVec3], radius: &[f64]) -> Self {
        let mut ids = ids;
        let mut nodes = Vec::with_capacity(2 * ids.len() / LEAF + 1);
        if !ids.is_empty() {
            let n = ids.len();
            build(&mut nodes, &mut ids, 0, n, centre, radius);
        }
        Self {
            nodes,
            centres: ids.iter().map(|&i| centre[i as usize]).collect(),
            radii: ids.iter().map(|&i| radius[i as usize]).collect(),
            ids,
        }
    }

    /// The ball of least `|p - c| - r` among those `alive`, ties to the smaller id. With `enough`, the first one found within
    /// that distance will do.
    pub fn nearest(
        &self,
        point: DVec3,
        enough: Option<f64>,
        alive: impl Fn(u32) -> bool,
    ) -> Option<NearestBall> {
        let mut best: Option<NearestBall> = None;
        let mut stack: Vec<(f64, u32)> = Vec::with_capacity(64);
        if !self.nodes.is_empty() {
            stack.push((self.bound(0, point), 0));
        }
        while let Some((bound, at)) = stack.pop() {
            if best.is_some_and(|b| bound > b.distance) {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.second == 0 {
                for k in node.start as usize..node.end as usize {
                    let distance = point.distance(self.centres[k]) - self.radii[k];
                    let id = self.ids[k];
                    let better = best.is_none_or(|b| (distance, id) < (b.distance, b.id));
                    if better && alive(id) {
                        best = Some(NearestBall { id, distance });
                    }
                }
                if let (Some(b), Some(enough)) = (best, enough)
                    && b.distance <= enough
                {
                    return best;
                }
            } else {
                let (first, second) = (at + 1, node.second);
                let (a, b) = (self.bound(first, point), self.bound(second, point));
                if a <= b {
                    stack.push((b, second));
                    stack.push((a, first));
                } else {
                    stack.push((a, first));
                    stack.push((b, second));
                }
            }
        }
        best
    }

    fn bound(&self, node: u32, point: DVec3) -> f64 {
        let n = &self.nodes[node as usize];
        (point - point.clamp(n.lo, n.hi)).length() - n.radius
    }
}

/// The indices of points in an order in which neighbours follow each other (Morton 1966): queries in this order find the branches they
/// need in the cache.
pub(crate) fn near_order(points: &[DVec3]) -> Vec<u32> {
    const CELLS: f64 = 1024.0;
    let lo = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let hi = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = (hi - lo).max_element().max(f64::MIN_POSITIVE);
    let spread = |x: f64| {
        let cell = ((x / size * CELLS) as u64).min(1023);
        (0..10).fold(0, |key, bit| key | (cell >> bit & 1) << (3 * bit))
    };
    let mut order: Vec<(u64, u32)> = points
        .iter()
        .zip(0..)
        .map(|(&p, i)| {
            let d = p - lo;
            (spread(d.x) | spread(d.y) << 1 | spread(d.z) << 2, i)
        })
        .collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

fn build(
    nodes: &mut Vec<Node>,
    ids: &mut [u32],
    start: usize,
    end: usize,
    centre: &[DVec3],
    radius: &[f64],
) -> u32 {
    let own = &mut ids[start..end];
    let mut lo = DVec3::INFINITY;
    let mut hi = DVec3::NEG_INFINITY;
    let mut largest = f64::NEG_INFINITY;
    for &i in own.iter() {
        lo = lo.min(centre[i as usize]);
        hi = hi.max(centre[i as usize]);
        largest = largest.max(radius[i as usize]);
    }
    let at = nodes.len() as u32;
    nodes.push(Node {
        lo,
        hi,
        radius: largest,
        start: start as u32,
        end: end as u32,
        second: 0,
    });
    if end - start > LEAF {
        let size = hi - lo;
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let middle = (end - start) / 2;
        own.select_nth_unstable_by(middle, |&a, &b| {
            centre[a as usize][axis]
                .total_cmp(&centre[b as usize][axis])
                .then(a.cmp(&b))
        });
        build(nodes, ids, start, start + middle, centre, radius);
        let second = build(nodes, ids, start + middle, end, centre, radius);
        nodes[at as usize].second = second;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_near_order_is_a_permutation_that_stays_near() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let points: Vec<DVec3> = (0..1000)
            .map(|_| DVec3::new(rng.random(), rng.random(), rng.random()))
            .collect();
        let order = near_order(&points);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..1000));
        let way = |order: &[u32]| -> f64 {
            let step = |w: &[u32]| points[w[0] as usize].distance(points[w[1] as usize]);
            order.windows(2).map(step).sum()
        };
        assert!(way(&order) < 0.3 * way(&(0..1000).collect::<Vec<_>>()));
        assert_eq!(near_order(&[DVec3::ONE; 2]), [0, 1]);
        assert!(near_order(&[]).is_empty());
    }

    #[test]
    fn agrees_with_looking_at_every_ball() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut point = || DVec3::new(rng.random(), rng.random(), rng.random());
        let centre: Vec<DVec3> = (0..500).map(|_| point()).collect();
        let radius: Vec<f64> = centre.iter().map(|c| 0.2 * c.x + 0.01).collect();
        let tree = BallTree::new((0..500).collect(), &centre, &radius);
        for _ in 0..200 {
            let p = point();
            let alive = |i: u32| !i.is_multiple_of(3);
            let best = (0..500u32)
                .filter(|&i| alive(i))
                .map(|i| p.distance(centre[i as usize]) - radius[i as usize])
                .fold(f64::INFINITY, f64::min);
            let found = tree.nearest(p, None, alive).expect("balls are alive");
            assert_eq!(found.distance, best);
            assert!(tree.nearest(p, Some(0.05), alive).expect("a ball").distance <= best.max(0.05));
        }
        assert_eq!(tree.nearest(DVec3::ZERO, None, |_| false), None);
    }
}
