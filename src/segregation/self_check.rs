//! A closed surface looks for its own faults.
//!
//! In: a closure, the points it was made of, its report. Out: [`SelfCheck`]: numbers that are large where the surface is
//! likely to be wrong, and a [`Doubt`] for each that passes its limit.
//!
//! 1. *Unsupported area*: triangles whose edges are longer than four spacings.
//! 2. *Parts cut off*: points that the closing left out, and their distance to the surface.
//! 3. *Spikes*: points all of whose triangles are unsupported, as an outlier on the surface has.
//! 4. *Narrow handles* ([`super::handles`]) that could not be given up: a bridge or tunnel a few points round, the narrower
//!    the weaker the noise.
//! 5. *Other runs* must agree on the Euler number and the components: other thinning seeds when the noise is strong; where
//!    two sheets lie back to back within two spacings, also the minimum cut with a weaker and a stronger pull.
//! 6. An *open* surface: rims of a few edges are holes that nobody cut, many rims and handles are more likely noise or
//!    patchy sampling than an object, and a share of unsupported area near the threshold could be either.
//! 7. *Parts side by side*: with strong noise a small component within three spacings of a larger one may be a piece of it.
//!
//! Cost: a sweep over the tetrahedra; two more minimum cuts where parts are thin.

use super::closure::Closure;
use super::handles::NarrowHandle;
use super::labels::{boundary_triangles, mesh_of};
use super::openness::{Rim, all_unsupported};
use super::report::{CloudReport, SecondOpinion, Variation};
use super::settings::SegregationSettings;
use crate::geometry::{ClosestOnMesh, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Factors on the pull of the other labellings.
pub(super) const PULL_FACTORS: [f32; 2] = [0.5, 2.0];
/// Normals of two sheets back to back make at least this angle (cosine), and the edge between them with each.
const OPPOSITE: f64 = -0.5;
const ALONG: f64 = 0.6;
/// Thickness, in spacings, below which a part is thin.
const THIN: f64 = 2.0;

/// Numbers of the self-check.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SelfCheck {
    /// Points left out that lie together more than one and a half spacings from the surface.
    pub far_points: usize,
    /// Distance of the farthest of them, in local spacings.
    pub farthest_over_spacing: f64,
    /// Where that is, mm.
    pub farthest_place: Option<DVec3>,
    /// Handles and tunnels a few points round.
    pub narrow_handles: Vec<NarrowHandle>,
    /// Points all of whose triangles are unsupported.
    pub spikes: usize,
    /// Small components within three spacings of a larger one.
    pub parts_side_by_side: usize,
    /// Where the first of them is, mm.
    pub side_by_side_place: Option<DVec3>,
    /// Share of the surface points at which the solid or a gap is thinner than two spacings.
    pub thin_share: f64,
    /// Thinnest place of the solid or a gap, in local spacings; 0 when none is thinner than four.
    pub thinnest_over_spacing: f64,
}

/// What a doubt is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DoubtKind {
    /// Open or closed could be decided the other way.
    OpenOrClosed,
    /// Much of a closed surface has no points to support it.
    UnsupportedArea,
    /// Many points ended off the surface.
    PointsOff,
    /// Points lie so far off the surface that a part may be cut off.
    PartCutOff,
    /// Single points stand out of the surface.
    Spikes,
    /// A bridge or tunnel is a few points round.
    NarrowHandles,
    /// Runs with one thing changed have another topology.
    Disagreement,
    /// An open surface has rims of a few edges.
    ShortRims,
    /// An open surface has many rims and handles.
    ManyRims,
    /// Small components lie against larger ones in a noisy cloud.
    PartsSideBySide,
    /// Vertices stayed pinched.
    Pinched,
}

/// A reason to look at the result before using it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    /// What it is about.
    pub kind: DoubtKind,
    /// The number that is too large (a share, a count or a length in spacings, as the text says).
    pub value: f64,
    /// Its limit.
    pub limit: f64,
    /// Where to look, mm, when it has a place.
    pub place: Option<DVec3>,
    /// The doubt in words.
    pub text: String,
}

/// Share of points off the surface above which a result is doubtful.
pub(super) const DOUBTFUL_OFF: f64 = 0.01;
/// Unsupported share above which a closed result is doubtful, as a share of the threshold; its inverse for open ones.
const NEAR_THRESHOLD: f64 = 0.5;
/// Far points from which a part may be cut off.
const FAR_POINTS: usize = 5;
/// Points standing alone that strong noise leaves at a sharp edge of a right surface: doubting one closed a box of 10 000 points twice, the
/// second time with the noise left in.
const LONE_SPIKES: usize = 1;
/// Noise over spacing from which also the widest of the narrow handles are doubted: a loop of nine edges is three spacings across,
/// two sheets of this noise as much. Below it tubes this thin come out right.
pub(super) const BLURRED: f64 = 0.7;
/// Rims of at most this many edges are not meant.
const SHORT_RIM: usize = 8;
/// Rims and twice the handles of an open surface (twice its components less its Euler number) beyond which it is doubted;
/// those of whole objects measured have one or two.
const MANY_RIMS: i64 = 6;
/// Components of less than this share of the points, this near another (spacings), are doubted when noise is strong.
const SMALL_PART: f64 = 0.1;
const SIDE_BY_SIDE: f64 = 3.0;

/// The doubts that a report justifies; its decision, closing numbers, self-check, opinions and rims are read.
pub(super) fn doubts(report: &CloudReport, settings: &SegregationSettings) -> Vec<Doubt> {
    let mut out = Vec::new();
    let mut doubt = |kind, value: f64, limit: f64, place: Option<DVec3>, text: String| {
        out.push(Doubt {
            kind,
            value,
            limit,
            place,
            text,
        });
    };
    let decision = &report.decision;
    let (share, threshold) = (decision.unsupported_area_share, decision.threshold);
    let check = &report.self_check;
    if !decision.closed {
        if !decision.by_user && share > 0.0 && share < threshold / NEAR_THRESHOLD {
            doubt(
                DoubtKind::OpenOrClosed,
                share,
                threshold / NEAR_THRESHOLD,
                report.rims.first().map(|r| r.place),
                format!(
                    "taken as open although only {:.2} % of its area has no points to support it: say which it is",
                    100.0 * share
                ),
            );
        }
        let short: Vec<&Rim> = report.rims.iter().filter(|r| r.edges <= SHORT_RIM).collect();
        if let Some(first) = short.first() {
            doubt(
                DoubtKind::ShortRims,
                short.len() as f64,
                0.0,
                Some(first.place),
                format!(
                    "{} of at most {SHORT_RIM} edges left in the open surface may be gaps between points",
                    match short.len() {
                        1 => "1 hole".to_owned(),
                        n => format!("{n} holes"),
                    }
                ),
            );
        }
        let topology = &report.topology;
        let loops = 2 * topology.components as i64 - topology.euler;
        if loops > MANY_RIMS {
            doubt(
                DoubtKind::ManyRims,
                loops as f64,
                MANY_RIMS as f64,
                report.rims.first().map(|r| r.place),
                format!(
                    "the open surface has many rims and handles (Euler number {} with {} components): gaps between the points, or noise, may have made them",
                    topology.euler, topology.components
                ),
            );
        }
        return out;
    }
    if share >= NEAR_THRESHOLD * threshold {
        doubt(
            DoubtKind::UnsupportedArea,
            share,
            NEAR_THRESHOLD * threshold,
            report.filled_holes.first().map(|p| p.place),
            format!(
                "{:.2} % of the surface has no points to support it: compare the list of filled holes with the object",
                100.0 * share
            ),
        );
    }
    if report.closing.off_share > DOUBTFUL_OFF {
        doubt(
            DoubtKind::PointsOff,
            report.closing.off_share,
            DOUBTFUL_OFF,
            check.farthest_place,
            format!(
                "{:.2} % of the points ended off the surface: parts may be cut off",
                100.0 * report.closing.off_share
            ),
        );
    }
    if check.far_points >= FAR_POINTS {
        doubt(
            DoubtKind::PartCutOff,
            check.far_points as f64,
            FAR_POINTS as f64,
            check.farthest_place,
            format!(
                "{} points lie more than {FAR} spacings off the surface, the farthest {:.1}: a part may be cut off",
                check.far_points, check.farthest_over_spacing
            ),
        );
    }
    let strong = report.prepare.noise_over_spacing >= settings.second_opinion_noise;
    let most = if strong { LONE_SPIKES } else { 0 };
    if check.spikes > most {
        doubt(
            DoubtKind::Spikes,
            check.spikes as f64,
            most as f64,
            report.filled_holes.first().map(|p| p.place),
            format!(
                "{} points of the surface stand alone: outliers may be left",
                check.spikes
            ),
        );
    }
    let blurred = report.prepare.noise_over_spacing >= BLURRED;
    let widest = super::handles::LONGEST_LOOP / 2 - u32::from(!blurred);
    let narrow: Vec<&NarrowHandle> = check
        .narrow_handles
        .iter()
        .filter(|h| h.rings <= widest)
        .collect();
    if let Some(first) = narrow.first() {
        doubt(
            DoubtKind::NarrowHandles,
            narrow.len() as f64,
            0.0,
            Some(first.place),
            format!(
                "bridges or tunnels at most {} edges round at {} places: the points cannot show whether they are real",
                2 * widest + 1,
                narrow.len()
            ),
        );
    }
    if check.parts_side_by_side > 0 && strong {
        doubt(
            DoubtKind::PartsSideBySide,
            check.parts_side_by_side as f64,
            0.0,
            check.side_by_side_place,
            format!(
                "{} small parts lie within {SIDE_BY_SIDE} spacings of a larger one: noise may have cut them off it",
                check.parts_side_by_side
            ),
        );
    }
    let opinions = &report.second_opinions;
    if let Some(first) = opinions.first()
        && opinions
            .iter()
            .any(|o| (o.euler, o.components) != (first.euler, first.components))
    {
        let eulers: Vec<i64> = opinions.iter().map(|o| o.euler).collect();
        doubt(
            DoubtKind::Disagreement,
            opinions.len() as f64,
            0.0,
            None,
            format!("runs with one thing changed gave Euler numbers {eulers:?}: the topology is not certain"),
        );
    }
    if report.closing.left_pinched > 0 {
        doubt(
            DoubtKind::Pinched,
            report.closing.left_pinched as f64,
            0.0,
            None,
            format!("{} vertices stayed pinched", report.closing.left_pinched),
        );
    }
    out
}

/// The Euler numbers had the pull been weaker or stronger.
pub(super) fn pull_opinions(closure: &Closure, least_component_share: f64) -> Vec<SecondOpinion> {
    PULL_FACTORS
        .iter()
        .map(|&factor| {
            let labelled = closure.relabelled(factor, least_component_share);
            let mesh = mesh_of(
                &closure.triangulation,
                &boundary_triangles(&closure.triangulation, &labelled.inside),
            );
            let t = mesh.topology();
            SecondOpinion {
                variation: Variation::Pull {
                    factor: f64::from(factor),
                },
                euler: t.euler,
                components: t.components,
            }
        })
        .collect()
}

/// Distance beyond which a point left out counts as far, in local spacings.
const FAR: f64 = 1.5;
/// Far points, itself included, that must lie within [`TOGETHER`] spacings of one for it to count.
const COMPANY: usize = 3;
const TOGETHER: f64 = 2.5;

/// Checks a closed surface; `points` and `spacing_mm` are all prepared points, `mesh` the closed surface over the closure's.
pub(super) fn self_check(
    closure: &Closure,
    mesh: &TriangleMesh,
    unsupported: &[bool],
    points: &[DVec3],
    spacing_mm: &[f64],
) -> SelfCheck {
    let mut out = SelfCheck {
        narrow_handles: closure.handles.clone(),
        ..Default::default()
    };
    out.spikes = all_unsupported(mesh.points.len(), &mesh.triangles, unsupported).len();
    far_points(&mut out, closure, mesh, points, spacing_mm);
    parts_side_by_side(&mut out, closure, mesh);
    thin_parts(&mut out, closure, mesh);
    out
}

fn far_points(
    out: &mut SelfCheck,
    closure: &Closure,
    mesh: &TriangleMesh,
    points: &[DVec3],
    spacing_mm: &[f64],
) {
    let mut on = vec![false; points.len()];
    for t in &mesh.triangles {
        for &v in t {
            on[closure.used[v as usize] as usize] = true;
        }
    }
    let Some(surface) = ClosestOnMesh::new(mesh) else {
        return;
    };
    // Outliers that the closing left out lie alone; points of a part that was cut off lie together.
    let mut far: Vec<u32> = Vec::new();
    let mut distances: Vec<f64> = Vec::new();
    for i in (0..points.len()).filter(|&i| !on[i]) {
        let distance = surface.closest(points[i]).distance2.sqrt() / spacing_mm[i].max(f64::MIN_POSITIVE);
        if distance > FAR {
            far.push(i as u32);
            distances.push(distance);
        }
    }
    for (&i, &distance) in far.iter().zip(&distances) {
        let p = points[i as usize];
        let reach = TOGETHER * spacing_mm[i as usize];
        let near = far
            .iter()
            .filter(|&&j| points[j as usize].distance(p) < reach)
            .count();
        if near < COMPANY {
            continue;
        }
        out.far_points += 1;
        if distance > out.farthest_over_spacing {
            out.farthest_over_spacing = distance;
            out.farthest_place = Some(p);
        }
    }
}

fn parts_side_by_side(out: &mut SelfCheck, closure: &Closure, mesh: &TriangleMesh) {
    let parts = mesh.components();
    if parts.len() < 2 {
        return;
    }
    let mut part_of = vec![u32::MAX; mesh.points.len()];
    for (number, part) in parts.iter().enumerate() {
        for v in part.iter().flat_map(|&t| mesh.triangles[t as usize]) {
            part_of[v as usize] = number as u32;
        }
    }
    let mut size = vec![0usize; parts.len()];
    for &p in part_of.iter().filter(|p| **p != u32::MAX) {
        size[p as usize] += 1;
    }
    let on: usize = size.iter().sum();
    let mut near = vec![false; parts.len()];
    let mut place = None;
    // Neighbours in the triangulation: two parts that near have edges between them.
    for t in closure.triangulation.finite_tets() {
        let v = closure.triangulation.tet(t).map(|v| v.index());
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let (p, q) = (part_of[v[i]], part_of[v[j]]);
            if p == q || p == u32::MAX || q == u32::MAX {
                continue;
            }
            let small = if size[p as usize] < size[q as usize] { p } else { q } as usize;
            let spacing = 0.5 * (closure.spacing_mm[v[i]] + closure.spacing_mm[v[j]]);
            let apart = mesh.points[v[i]].distance(mesh.points[v[j]]);
            if (size[small] as f64) < SMALL_PART * on as f64 && apart < SIDE_BY_SIDE * spacing {
                near[small] = true;
                place = place.or(Some(mesh.points[v[i]]));
            }
        }
    }
    out.parts_side_by_side = near.iter().filter(|n| **n).count();
    out.side_by_side_place = place;
}

fn thin_parts(out: &mut SelfCheck, closure: &Closure, mesh: &TriangleMesh) {
    let normals = mesh.vertex_normals();
    let triangulation = &closure.triangulation;
    let thin: Vec<(u32, u32, f64)> = (0..triangulation.num_finite())
        .into_par_iter()
        .flat_map_iter(|t| {
            let tet = crate::geometry::TetId(t as u32);
            let inside = closure.inside[t];
            let v = triangulation.tet(tet).map(|v| v.index());
            let (normals, closure) = (&normals, closure);
            [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
                .into_iter()
                .filter_map(move |(i, j)| {
                    let (p, q) = (v[i], v[j]);
                    let (n, m) = (normals[p], normals[q]);
                    if n == DVec3::ZERO || m == DVec3::ZERO || n.dot(m) > OPPOSITE {
                        return None;
                    }
                    let d = closure.triangulation.points[q] - closure.triangulation.points[p];
                    let length = d.length();
                    let along = if inside { -ALONG } else { ALONG } * length;
                    let faces = if inside {
                        d.dot(n) < along && d.dot(m) > -along
                    } else {
                        d.dot(n) > along && d.dot(m) < -along
                    };
                    let ratio = 2.0 * length / (closure.spacing_mm[p] + closure.spacing_mm[q]);
                    (faces && ratio < 4.0).then_some((p as u32, q as u32, ratio))
                })
        })
        .collect();
    let mut thickness = vec![f64::INFINITY; mesh.points.len()];
    for (p, q, ratio) in thin {
        for v in [p, q] {
            thickness[v as usize] = thickness[v as usize].min(ratio);
        }
    }
    let on = normals.iter().filter(|n| **n != DVec3::ZERO).count().max(1) as f64;
    out.thin_share = thickness.iter().filter(|t| **t < THIN).count() as f64 / on;
    let least = thickness.iter().copied().fold(f64::INFINITY, f64::min);
    out.thinnest_over_spacing = if least.is_finite() { least } else { 0.0 };
}
