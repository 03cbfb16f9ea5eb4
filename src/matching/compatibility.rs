//! How much two elements have in common, and what it costs to deform one into the other.
//!
//! In: the elements of both scaffolds above the cut, a pose when one is known. Out: tables of costs in mm.
//!
//! With `s(a, b) = |a - b| / (a + b)`, which is 0 for equal and 1 for incomparable sizes (Chang and Kimia 2009 use its like), and for
//! distances from the centroid `|a - b|` as a share of the mean spread of both scaffolds, at most 1 (a sheet may lie at the centroid, where a ratio
//! of distances means nothing):
//!
//! * node: `0.5 s(radius) + 0.5` distance from the centroid, plus 0.1 when the kinds differ (an A1^4 that was split);
//! * curve: `0.35 s(length) + 0.35` mean `s(radius)` along it `+ 0.3` mean distance from the centroid along it, in the better
//!   of both directions (for a closed curve of all turns); never between kinds;
//! * sheet: `0.3 s(sqrt area) + 0.25 s(mean radius) + 0.15 s(max radius) + 0.2` mean `s(deviations) + 0.1` distance from the centroid.
//!
//! Divided by `unlike` it is 1 when nothing is in common. Under a pose the place joins in: mean distance in four dimensions
//! (radius included) over the reach. The cost of a pair of evidence `w`, `w'` and difference `d` is
//!
//! ```text
//! c = |w - w'| + 2 min(w, w') min(d, 1)
//! ```
//!
//! so that equal elements cost nothing, unlike ones as much as giving up both, and everything fades with the evidence. Pairs
//! more than 1.5 reaches apart are forbidden.

use super::evidence::{CurveFacts, Evidence, NodeFacts, PROFILE, SheetFacts};
use super::settings::MatchingSettings;
use crate::coarse_scaffold::hypergraph::MedialPoint;
use crate::geometry::Rigid;
use matchers::{ElementCosts, Table};

/// Pairs farther apart than this many reaches never correspond.
const FARTHEST: f64 = 1.5;

/// Where the source lies on the target.
#[derive(Clone, Copy)]
pub(crate) struct Placement {
    pub(crate) pose: Rigid,
    /// Distance at which places have nothing in common, mm.
    pub(crate) reach_mm: f64,
}

/// Costs of all pairs.
pub(crate) fn costs(
    target: &Evidence,
    source: &Evidence,
    placement: Option<Placement>,
    settings: &MatchingSettings,
) -> ElementCosts {
    let price = |w: f64, v: f64, unlike: f64, place: Option<f64>| {
        let likeness = unlike / settings.unlike;
        let d = match place {
            Some(p) if p > FARTHEST => return f64::INFINITY,
            Some(p) => settings.attribute_share * likeness.min(1.0) + (1.0 - settings.attribute_share) * p,
            None => likeness,
        };
        (w - v).abs() + 2.0 * w.min(v) * d.min(1.0)
    };
    let size_mm = 0.5 * (target.size_mm + source.size_mm);
    let nodes = Table::from_fn(target.nodes.len(), source.nodes.len(), |i, j| {
        let (a, b) = (&target.nodes[i], &source.nodes[j]);
        let place = placement.map(|p| {
            let moved = p.pose.apply(b.position);
            moved.distance(a.position).hypot(a.radius - b.radius) / p.reach_mm
        });
        price(a.evidence, b.evidence, node_difference(a, b, size_mm), place)
    });
    let curves = Table::from_fn(target.curves.len(), source.curves.len(), |i, j| {
        let (a, b) = (&target.curves[i], &source.curves[j]);
        if a.kind != b.kind {
            return f64::INFINITY;
        }
        let place = placement.map(|p| apart(&a.profile, &b.profile, &p));
        price(a.evidence, b.evidence, curve_difference(a, b, size_mm), place)
    });
    let sheets = Table::from_fn(target.sheets.len(), source.sheets.len(), |i, j| {
        let (a, b) = (&target.sheets[i], &source.sheets[j]);
        let place = placement.map(|p| {
            if a.places.is_empty() || b.places.is_empty() {
                p.pose.apply(b.centroid).distance(a.centroid) / p.reach_mm
            } else {
                apart(&a.places, &b.places, &p)
            }
        });
        price(a.evidence, b.evidence, sheet_difference(a, b, size_mm), place)
    });
    ElementCosts {
        nodes,
        curves,
        sheets,
    }
}

/// Normalised difference of two sizes, 0 to 1.
fn s(a: f64, b: f64) -> f64 {
    let sum = a.abs() + b.abs();
    if sum > 0.0 { (a - b).abs() / sum } else { 0.0 }
}

/// Difference of two distances from the centroid as a share of the spread, 0 to 1.
fn far(a: f64, b: f64, size_mm: f64) -> f64 {
    if size_mm > 0.0 {
        ((a - b).abs() / size_mm).min(1.0)
    } else {
        0.0
    }
}

fn node_difference(a: &NodeFacts, b: &NodeFacts, size_mm: f64) -> f64 {
    let kind = if a.kind == b.kind { 0.0 } else { 0.1 };
    0.5 * s(a.radius, b.radius) + 0.5 * far(a.remoteness, b.remoteness, size_mm) + kind
}

fn curve_difference(a: &CurveFacts, b: &CurveFacts, size_mm: f64) -> f64 {
    let along = |order: &dyn Fn(usize) -> usize| {
        let mut sum = 0.0;
        for k in 0..PROFILE {
            let m = order(k);
            sum += 0.35 * s(a.profile[k].radius, b.profile[m].radius)
                + 0.3 * far(a.remoteness[k], b.remoteness[m], size_mm);
        }
        sum / PROFILE as f64
    };
    let last = PROFILE - 1;
    let best = if a.closed && b.closed {
        (0..last)
            .flat_map(|turn| {
                [
                    along(&|k| (k + turn) % last),
                    along(&|k| (2 * last + turn - k) % last),
                ]
            })
            .fold(f64::INFINITY, f64::min)
    } else {
        along(&|k| k).min(along(&|k| last - k))
    };
    0.35 * s(a.length, b.length) + best
}

fn sheet_difference(a: &SheetFacts, b: &SheetFacts, size_mm: f64) -> f64 {
    let deviations = (0..3).map(|k| s(a.deviations[k], b.deviations[k])).sum::<f64>() / 3.0;
    0.3 * s(a.area.sqrt(), b.area.sqrt())
        + 0.25 * s(a.mean_radius, b.mean_radius)
        + 0.15 * s(a.max_radius, b.max_radius)
        + 0.2 * deviations
        + 0.1 * far(a.remoteness, b.remoteness, size_mm)
}

/// Mean distance of two sets of medial points to the nearest of the other, radius included, in reaches.
fn apart(a: &[MedialPoint], b: &[MedialPoint], placement: &Placement) -> f64 {
    let moved: Vec<MedialPoint> = b
        .iter()
        .map(|m| MedialPoint {
            position: placement.pose.apply(m.position),
            radius: m.radius,
        })
        .collect();
    let one = |from: &[MedialPoint], to: &[MedialPoint]| {
        let nearest = |m: &MedialPoint| {
            to.iter()
                .map(|o| o.position.distance_squared(m.position) + (o.radius - m.radius).powi(2))
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        from.iter().map(nearest).sum::<f64>() / from.len().max(1) as f64
    };
    0.5 * (one(a, &moved) + one(&moved, a)) / placement.reach_mm
}
