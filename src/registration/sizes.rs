//! Cut shapes of unknown size: one bone whole, the other a piece of another person's, larger or smaller by up to a quarter.
//!
//! In: the pairs of views that compete. Out: the same pairs with the source at every size of a grid, and how to compare their scores.
//!
//! A whole shape tells its size by its radius of gyration; a piece does not. But the search finds a pose when the size is off by a few
//! percent, because its tolerances are 3 to 8 % of the diagonal, so that a coarse grid of sizes is enough: at seven sizes
//! in steps of 7.5 % no size between 0.78 and 1.29 is farther than 3.8 % from one of them. The last refinement finds the size exactly, as the seventh
//! unknown.
//!
//! Free-space scores are per area of both shapes, and the source's area grows with its size: a piece that agrees everywhere would score
//! higher the larger it is. So sizes are compared by score per area of the smaller shape.

use super::faces::ViewPair;
use super::oriented::View;
use std::sync::Arc;

/// From one size to the next.
const STEP: f64 = 1.075;
/// Sizes on either side of the source's own.
const STEPS: i32 = 3;

/// Share of the poses that each size gets in the first round: 3 000 of 10 000 find as many half-overlapping bones as all.
pub(crate) const FIRST_SHARE: f64 = 0.4;
/// Sizes that get a second round.
pub(crate) const SECOND_ROUNDS: usize = 2;
/// Poses nearer than this in size (logarithm) and in turn are one.
pub(crate) const SAME_SIZE: f64 = 0.03;
pub(crate) const SAME_TURN_DEG: f64 = 6.0;
/// Sizes farther apart than this (logarithm) are different answers.
pub(crate) const OTHER_SIZE: f64 = 0.07;

/// The pairs with their sources at all other sizes of the grid, pair by pair; the own size is not repeated.
pub(crate) fn at_other_sizes(pairs: &[ViewPair]) -> Vec<ViewPair> {
    let mut out = Vec::new();
    for pair in pairs {
        for k in (-STEPS..=STEPS).filter(|k| *k != 0) {
            out.push(ViewPair {
                source: Arc::new(pair.source.resized(STEP.powi(k))),
                target: Arc::clone(&pair.target),
            });
        }
    }
    out
}

/// What the score of a pair is multiplied with so that sizes can be compared.
pub(crate) fn per_smaller_area(source: &View, target: &View, growth: f64) -> f64 {
    let (a, b) = (source.area() * growth * growth, target.area());
    0.5 * (a + b) / a.min(b)
}
