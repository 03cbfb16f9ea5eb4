//! Open or closed: the share of a closed surface's area that no points support ([`super::openness`]) against the limit of the settings, unless
//! the user has said which. In: a closure. Out: [`Judged`] and a [`Decision`] in words.

use super::closure::Closure;
use super::labels::boundary_triangles;
use super::openness::{area_share, unsupported};
use super::report::Decision;
use super::settings::{ClosedOrOpen, SegregationSettings};
use crate::geometry::VertexId;
use std::collections::BTreeSet;

/// A closed surface and which of its triangles points support.
pub(super) struct Judged {
    pub triangles: Vec<[VertexId; 3]>,
    pub raw: Vec<[u32; 3]>,
    pub bare: Vec<bool>,
    pub share: f64,
}

impl Judged {
    /// Triangles in `known` (sorted corners) count as supported.
    pub fn new(closure: &Closure, known: &BTreeSet<[u32; 3]>) -> Self {
        let triangles = boundary_triangles(&closure.triangulation, &closure.inside);
        let raw: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v.0)).collect();
        let points = &closure.triangulation.points;
        let mut bare = unsupported(points, &raw, &closure.spacing_mm);
        for (mark, t) in bare.iter_mut().zip(&triangles) {
            *mark &= known.is_empty() || !known.contains(&sorted(*t));
        }
        let share = area_share(points, &raw, &bare);
        Self {
            triangles,
            raw,
            bare,
            share,
        }
    }

    pub fn decide(&self, threshold: f64, settings: &SegregationSettings) -> Decision {
        decide(self.share, self.raw.is_empty(), threshold, settings)
    }
}

fn decide(share: f64, nothing_inside: bool, threshold: f64, settings: &SegregationSettings) -> Decision {
    let percent = 100.0 * share;
    let limit = 100.0 * threshold;
    let (closed, by_user, reason) = match settings.closed {
        ClosedOrOpen::Closed => (
            true,
            true,
            format!("closed as asked; {percent:.2} % of the area has no points to support it"),
        ),
        ClosedOrOpen::Open => (false, true, "left open as asked".to_owned()),
        ClosedOrOpen::Auto if nothing_inside => (false, false, "open: the points enclose nothing".to_owned()),
        ClosedOrOpen::Auto if share >= threshold => (
            false,
            false,
            format!(
                "open: closing it would take {percent:.2} % of the area where there are no points (limit {limit:.2} %)"
            ),
        ),
        ClosedOrOpen::Auto => (
            true,
            false,
            format!(
                "closed: only {percent:.2} % of the area has no points to support it (limit {limit:.2} %)"
            ),
        ),
    };
    Decision {
        closed,
        by_user,
        unsupported_area_share: share,
        threshold,
        reason,
    }
}

pub(super) fn sorted(t: [VertexId; 3]) -> [u32; 3] {
    let mut t = t.map(|v| v.0);
    t.sort_unstable();
    t
}
