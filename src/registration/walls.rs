//! Two walls of something thin, told apart.
//!
//! In: a raw cloud and the points near a place. Out: those on the wall the place is on.
//!
//! A fit over several spacings takes both walls of a plate thinner than its reach for one noisy sheet half way between them; the
//! plate then has one face, and which way up it lies can no longer be seen. The nearest points of a place lie on its own wall as
//! long as the walls are two spacings apart.
//!
//! 1. The noise by the ten nearest points: what they leave of a plane, median over the cloud.
//! 2. Where a wide fit leaves over twice that, the heights of its points over the plane of the ten nearest are sorted. An empty band
//!    wider than four times that noise and half a spacing parts two walls; what is beyond it is left out.
//!
//! On one noisy wall heights have no such band (but for single far points, which the fit does better without). Walls nearer to each
//! other than two spacings or six times the noise are not told apart. Cost: a sort a suspicious place.

use super::cells::Cells;
use super::denoise::plane_frame;
use glam::DVec3;
use rayon::prelude::*;

/// Nearest points that make the plane of a place.
const NEAREST: usize = 10;
/// Degrees of freedom that a plane leaves of them, as a share.
const LEFT: f64 = (NEAREST - 3) as f64 / NEAREST as f64;

/// What tells one wall from two in a cloud.
pub(crate) struct Walls {
    /// A fit that leaves more than this may be over two walls.
    pub(crate) suspect: f64,
    /// Least width of the empty band between two walls.
    gap: f64,
}

impl Walls {
    /// `cells` holds `raw` and answers balls of `radius`; `s` is the spacing.
    pub(crate) fn new(raw: &[DVec3], cells: &Cells, radius: f64, s: f64) -> Self {
        let step = (raw.len() / 400).max(1);
        let mut residuals: Vec<f64> = raw
            .par_iter()
            .step_by(step)
            .filter_map(|&x| {
                let mut near = Vec::with_capacity(96);
                cells.within(x, radius, |i, d2| near.push((i, d2)));
                let (centre, normal) = plane(raw, &near)?;
                let nearest = nearest(&near)?;
                let square = |&(i, _): &(u32, f64)| (raw[i as usize] - centre).dot(normal).powi(2);
                Some((nearest.iter().map(square).sum::<f64>() / NEAREST as f64 / LEFT).sqrt())
            })
            .collect();
        residuals.sort_unstable_by(f64::total_cmp);
        let noise = residuals
            .get(residuals.len() / 2)
            .copied()
            .unwrap_or(f64::INFINITY);
        Self {
            suspect: 2.0 * noise,
            gap: (4.0 * noise).max(0.5 * s),
        }
    }

    /// Leaves in `near` (points with weights that fall with the distance from `x`) those on the wall of `x`; says whether any went.
    pub(crate) fn keep_own(&self, raw: &[DVec3], near: &mut Vec<(u32, f64)>, x: DVec3) -> bool {
        let by_distance: Vec<(u32, f64)> = near
            .iter()
            .map(|&(i, _)| (i, raw[i as usize].distance_squared(x)))
            .collect();
        let Some((_, normal)) = plane(raw, &by_distance) else {
            return false;
        };
        let height = |i: u32| (raw[i as usize] - x).dot(normal);
        let mut heights: Vec<f64> = near.iter().map(|&(i, _)| height(i)).collect();
        heights.push(0.0);
        heights.sort_unstable_by(f64::total_cmp);
        let own = heights.partition_point(|h| *h < 0.0);
        let mut low = own;
        while low > 0 && heights[low] - heights[low - 1] < self.gap {
            low -= 1;
        }
        let mut high = own;
        while high + 1 < heights.len() && heights[high + 1] - heights[high] < self.gap {
            high += 1;
        }
        let before = near.len();
        let (low, high) = (heights[low], heights[high]);
        near.retain(|&(i, _)| (low..=high).contains(&height(i)));
        near.len() < before
    }
}

fn nearest(near: &[(u32, f64)]) -> Option<Vec<(u32, f64)>> {
    if near.len() < NEAREST {
        return None;
    }
    let mut near = near.to_vec();
    near.select_nth_unstable_by(NEAREST - 1, |a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    near.truncate(NEAREST);
    Some(near)
}

/// A place and the normal of the plane through the nearest of `near`, points with squared distances.
fn plane(raw: &[DVec3], near: &[(u32, f64)]) -> Option<(DVec3, DVec3)> {
    let even: Vec<(u32, f64)> = nearest(near)?.iter().map(|&(i, _)| (i, 1.0)).collect();
    let centre = even.iter().map(|&(i, _)| raw[i as usize]).sum::<DVec3>() / NEAREST as f64;
    Some((centre, plane_frame(raw, &even, centre).z_axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two walls 0.04 apart, spacing 0.02, shaken.
    fn walls(shake: f64) -> Vec<DVec3> {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        (0..5000)
            .map(|k| {
                let wall = if k % 2 == 0 { 0.0 } else { 0.04 };
                DVec3::new(random(), random(), wall + shake * random())
            })
            .collect()
    }

    #[test]
    fn a_place_on_one_wall_keeps_that_wall_and_a_noisy_wall_keeps_all() {
        let thin = walls(0.006);
        let cells = Cells::new(&thin, 0.1);
        let found = Walls::new(&thin, &cells, 0.1, 0.02);
        let mut near = Vec::new();
        cells.within(thin[0], 0.1, |i, d2| near.push((i, (-d2 / 0.0025).exp())));
        let before = near.len();
        assert!(found.keep_own(&thin, &mut near, thin[0]));
        assert!(near.len() > before / 3 && near.iter().all(|&(i, _)| i % 2 == 0));

        // As thick as both walls, with nothing between: one wall.
        let noisy: Vec<DVec3> = walls(0.06).into_iter().step_by(2).collect();
        let cells = Cells::new(&noisy, 0.1);
        let found = Walls::new(&noisy, &cells, 0.1, 0.02);
        let mut near = Vec::new();
        cells.within(noisy[0], 0.1, |i, d2| near.push((i, (-d2 / 0.0025).exp())));
        let before = near.len();
        found.keep_own(&noisy, &mut near, noisy[0]);
        assert_eq!(near.len(), before);
    }
}
