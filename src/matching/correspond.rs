//! Correspondences, edit path and shape distance of two scaffolds: the front door of matching.
//!
//! 1. Everything is computed on the pair in an order that depends on the scaffolds alone, then turned round if need be: the result
//!    of (A, B) is exactly the mirror of that of (B, A).
//! 2. Graduated assignment on attributes alone; its pairs give a guess of the pose by consistency and robust fit.
//! 3. That guess and those of the moments compete in the alignment of medial points ([`super::dense`]).
//! 4. The edit distance, with places under the pose, bounded and where it is small enough proven by branch and bound; graduated
//!    assignment from its map gives the correspondences, one to one, with their evidence.
//! 5. The edit path is put into words; the medial residual and the difference of the signatures, with and
//!    without size, and the price by attributes alone are the shape distance.

use super::compatibility::{Placement, costs};
use super::dense::{DenseFit, align};
use super::edit_path::edit_path;
use super::evidence::Evidence;
use super::moments::moments;
use super::result::{Correspondences, Edit, Elements, Matching, Pair, PoseHypothesis, ShapeDistance};
use super::samples::MedialSamples;
use super::settings::MatchingSettings;
use super::signature::Signature;
use crate::coarse_scaffold::hypergraph::CoarseScaffold;
use crate::geometry::{CurveId, NodeId, Rigid, SheetId};
use glam::{DMat3, DVec3};
use matchers::edit_distance::{EditDistance, EditSettings, edit_distance};
use matchers::graduated_assignment::{HypergraphMatch, MatchSettings, match_hypergraphs};
use matchers::pose::{RobustPoseSettings, robust_pose};
use matchers::{ElementCosts, EvidenceSettings, MatchingProblem};
use nalgebra::Point3;
use std::cmp::Ordering;

/// A rival is a pose farther than this, degrees.
const RIVAL_DEG: f64 = 15.0;
/// Residuals below this share of the size say nothing about which pose is right.
const INDISTINCT: f64 = 2e-4;

/// Matches the scaffold of a source to that of a target, in any pose.
///
/// # Complexity
/// `O(samples log samples)` an iteration of the alignment, quadratic in the incidences above the cut for the assignment.
///
/// # Example
/// ```
/// use medial_scaffold::coarse_scaffold::CoarseScaffold;
/// use medial_scaffold::matching::{MatchingSettings, match_scaffolds};
/// let empty = CoarseScaffold::default();
/// let found = match_scaffolds(&empty, &empty, &MatchingSettings::default());
/// assert_eq!(found.shape_distance.with_size_mm, 0.0);
/// ```
pub fn match_scaffolds(
    target: &CoarseScaffold,
    source: &CoarseScaffold,
    settings: &MatchingSettings,
) -> Matching {
    run(target, source, None, settings)
}

/// Reads the correspondences in a pose that is already known (verified on the surfaces, say). Whether the source is mirrored
/// follows from the pose.
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub fn match_scaffolds_at(
    target: &CoarseScaffold,
    source: &CoarseScaffold,
    T_target_source: &Rigid,
    settings: &MatchingSettings,
) -> Matching {
    let settings = MatchingSettings {
        mirrored: T_target_source.is_mirrored(),
        ..settings.clone()
    };
    run(target, source, Some(*T_target_source), &settings)
}

/// Poses that two scaffolds allow, the best first, without correspondences: first guesses for a registration on the surfaces.
pub fn pose_hypotheses(
    target: &CoarseScaffold,
    source: &CoarseScaffold,
    settings: &MatchingSettings,
) -> Vec<PoseHypothesis> {
    let settings = settings.in_range();
    let pair = OrderedPair::new(target, source, &settings);
    let fits = pair.align(None, &settings);
    fits.iter().map(|f| pair.hypothesis(f)).collect()
}

fn run(
    target: &CoarseScaffold,
    source: &CoarseScaffold,
    known: Option<Rigid>,
    settings: &MatchingSettings,
) -> Matching {
    let settings = settings.in_range();
    let pair = OrderedPair::new(target, source, &settings);
    let known = known.map(|k| pair.to_inner(&k));
    let fits = pair.align(known, &settings);
    let pose = known.or(fits.first().map(|f| f.pose));
    let placement = pose.map(|pose| Placement {
        pose,
        reach_mm: settings.reach * 0.5 * (target.diagonal_mm + source.diagonal_mm),
    });
    let (assigned, shape_distance) = rayon::join(
        || pair.assign_and_edit(placement, &settings),
        || pair.shape_distance(&fits, &settings),
    );
    let (correspondences, edit) = match &assigned {
        Some(a) => {
            let path = edit_path(&a.distance, &pair.first, &pair.second, pair.turned);
            (pair.correspondences(&a.matched), path)
        }
        None => (
            Correspondences::default(),
            Edit {
                exact: true,
                ..Edit::default()
            },
        ),
    };
    let hypotheses: Vec<PoseHypothesis> = fits.iter().map(|f| pair.hypothesis(f)).collect();
    Matching {
        T_target_source: pose.map_or(Rigid::IDENTITY, |p| pair.to_outer(&p)),
        mirrored: settings.mirrored,
        ambiguous: pair.ambiguous(&fits, &settings),
        cut_mm: pair.cut_mm,
        correspondences,
        shape_distance,
        edit,
        hypotheses,
    }
}

/// Two scaffolds in an order of their own: `first` is the target unless the order was turned.
struct OrderedPair {
    first: Evidence,
    second: Evidence,
    first_samples: MedialSamples,
    second_samples: MedialSamples,
    turned: bool,
    /// Applied to the second scaffold before anything else.
    mirror: Rigid,
    cut_mm: f64,
}

/// A match in the inner order, and the edit distance that goes with it.
struct Assigned {
    matched: HypergraphMatch,
    distance: EditDistance,
}

impl OrderedPair {
    fn new(target: &CoarseScaffold, source: &CoarseScaffold, settings: &MatchingSettings) -> Self {
        let turned = order(target, source) == Ordering::Greater;
        let (first, second) = if turned {
            (source, target)
        } else {
            (target, source)
        };
        let cut_mm = target.tolerance_mm.max(source.tolerance_mm);
        let mirror = if settings.mirrored {
            Rigid {
                linear: DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
                translation: DVec3::ZERO,
            }
        } else {
            Rigid::IDENTITY
        };
        let draw = |s: &CoarseScaffold| MedialSamples::new(s, cut_mm, settings.samples, settings.seed);
        let first_samples = draw(first);
        let mut second_samples = draw(second);
        let mirrored;
        let second = if settings.mirrored {
            second_samples = second_samples.mirror_image();
            mirrored = mirror_image(second);
            &mirrored
        } else {
            second
        };
        Self {
            first: Evidence::new(first, cut_mm),
            second: Evidence::new(second, cut_mm),
            first_samples,
            second_samples,
            turned,
            mirror,
            cut_mm,
        }
    }

    /// From the caller's frames to `first` from (mirrored) `second`.
    fn to_inner(&self, pose: &Rigid) -> Rigid {
        let pose = if self.turned { pose.inverse() } else { *pose };
        // The mirror is its own inverse.
        pose.after(&self.mirror)
    }

    fn to_outer(&self, pose: &Rigid) -> Rigid {
        let pose = pose.after(&self.mirror);
        if self.turned { pose.inverse() } else { pose }
    }

    fn hypothesis(&self, fit: &DenseFit) -> PoseHypothesis {
        PoseHypothesis {
            T_target_source: self.to_outer(&fit.pose),
            residual_mm: fit.residual,
        }
    }

    fn align(&self, known: Option<Rigid>, settings: &MatchingSettings) -> Vec<DenseFit> {
        let mut guesses: Vec<Rigid> = known.into_iter().collect();
        guesses.extend(self.guess(settings));
        align(
            &self.first_samples,
            &self.second_samples,
            &guesses,
            settings.hypotheses,
            false,
        )
    }

    /// Pose from the pairs that attributes and incidences alone name.
    fn guess(&self, settings: &MatchingSettings) -> Option<Rigid> {
        let matched = self.assign(settings)?;
        let mut from = Vec::new();
        let mut to = Vec::new();
        let mut weights = Vec::new();
        let point = |p: DVec3| Point3::new(p.x, p.y, p.z);
        let mut add = |second: DVec3, first: DVec3, weight: f64| {
            from.push(point(second));
            to.push(point(first));
            weights.push(weight.max(1e-9));
        };
        for p in &matched.nodes {
            let (a, b) = (
                &self.first.nodes[p.target as usize],
                &self.second.nodes[p.source as usize],
            );
            add(b.position, a.position, a.evidence.min(b.evidence));
        }
        for p in &matched.curves {
            let (a, b) = (
                &self.first.curves[p.target as usize],
                &self.second.curves[p.source as usize],
            );
            // The middle is the one place that both directions of a curve agree on.
            let middle = super::evidence::PROFILE / 2;
            if !a.closed {
                add(
                    b.profile[middle].position,
                    a.profile[middle].position,
                    a.evidence.min(b.evidence),
                );
            }
        }
        for p in &matched.sheets {
            let (a, b) = (
                &self.first.sheets[p.target as usize],
                &self.second.sheets[p.source as usize],
            );
            add(b.centroid, a.centroid, a.evidence.min(b.evidence));
        }
        let bound = settings.reach * self.first_samples.size().max(self.second_samples.size()) * 2.0;
        let robust = RobustPoseSettings {
            inlier_bound: bound,
            ..Default::default()
        };
        let found = robust_pose(&from, &to, &weights, &robust).ok()?;
        Some(super::dense::to_rigid(&found.pose))
    }

    /// The problem of matching both; none when there is nothing to compare.
    fn problem(&self, costs: &ElementCosts) -> Option<MatchingProblem> {
        // The tables were made for these graphs, and costs are at least 0 or infinite.
        let evidence = EvidenceSettings::default();
        MatchingProblem::new(&self.first.graph, &self.second.graph, costs, &evidence).ok()
    }

    /// Graduated assignment by attributes and incidences alone.
    fn assign(&self, settings: &MatchingSettings) -> Option<HypergraphMatch> {
        let costs = costs(&self.first, &self.second, None, settings);
        Some(match_hypergraphs(
            &self.problem(&costs)?,
            &[],
            &MatchSettings::default(),
        ))
    }

    /// The edit distance under a pose, or by attributes alone.
    fn edit_distance(
        &self,
        placement: Option<Placement>,
        settings: &MatchingSettings,
    ) -> Option<EditDistance> {
        let costs = costs(&self.first, &self.second, placement, settings);
        let edit = EditSettings {
            max_search_nodes: settings.search_nodes,
            ..EditSettings::default()
        };
        edit_distance(&self.first.graph, &self.second.graph, &costs, &edit).ok()
    }

    /// The edit distance under a pose, and the assignment that starts from its map: pairs of elements with their evidence.
    fn assign_and_edit(&self, placement: Option<Placement>, settings: &MatchingSettings) -> Option<Assigned> {
        let distance = self.edit_distance(placement, settings)?;
        let problem = self.problem(&costs(&self.first, &self.second, placement, settings))?;
        let hypothesis = distance.map(&self.first.graph);
        let matched = match_hypergraphs(&problem, &[hypothesis], &MatchSettings::default());
        Some(Assigned { matched, distance })
    }

    fn ambiguous(&self, fits: &[DenseFit], settings: &MatchingSettings) -> bool {
        let Some(best) = fits.first() else {
            return true;
        };
        let floor = INDISTINCT * self.first_samples.size();
        fits.iter().skip(1).any(|f| {
            f.pose.rotation_angle_deg(&best.pose) > RIVAL_DEG
                && f.residual < settings.rival_residual * best.residual.max(floor)
        })
    }

    fn shape_distance(&self, fits: &[DenseFit], settings: &MatchingSettings) -> ShapeDistance {
        let mut out = ShapeDistance::default();
        if let Some(free) = self.edit_distance(None, settings) {
            out.structure_mm = free.upper_bound;
            out.structure = 1.0 - free.similarity;
        }
        let Some(best) = fits.first() else {
            return out;
        };
        let (a, b) = (self.first_samples.size(), self.second_samples.size());
        out.with_size_mm = best.residual;
        out.distribution_mm =
            Signature::new(&self.first_samples).distance(&Signature::new(&self.second_samples));
        if a > 0.0 && b > 0.0 {
            let (first, second) = (self.first_samples.scaled(a), self.second_samples.scaled(b));
            let guesses: Vec<Rigid> = fits
                .iter()
                .map(|f| Rigid {
                    linear: f.pose.linear,
                    translation: rescaled(f, &self.second_samples, a, b),
                })
                .collect();
            let scaled = align(&first, &second, &guesses, settings.hypotheses, false);
            out.without_size = scaled.first().map_or(0.0, |f| f.residual);
            out.distribution = Signature::new(&first).distance(&Signature::new(&second));
        }
        out
    }

    fn correspondences(&self, m: &HypergraphMatch) -> Correspondences {
        let ids = |e: &Evidence| {
            (
                e.nodes.iter().map(|n| n.id).collect::<Vec<u32>>(),
                e.curves.iter().map(|c| c.id).collect::<Vec<u32>>(),
                e.sheets.iter().map(|s| s.id).collect::<Vec<u32>>(),
            )
        };
        let (first, second) = (ids(&self.first), ids(&self.second));
        let mut out = Correspondences {
            nodes: self.pairs(&m.nodes, &first.0, &second.0, NodeId),
            curves: self.pairs(&m.curves, &first.1, &second.1, CurveId),
            sheets: self.pairs(&m.sheets, &first.2, &second.2, SheetId),
            ..Default::default()
        };
        let missing = |ids: &[u32], pairs: &[u32]| -> Vec<u32> {
            (0..ids.len() as u32)
                .filter(|k| !pairs.contains(k))
                .map(|k| ids[k as usize])
                .collect()
        };
        let of_first = |p: &[matchers::graduated_assignment::MatchedPair]| {
            p.iter().map(|p| p.target).collect::<Vec<_>>()
        };
        let of_second = |p: &[matchers::graduated_assignment::MatchedPair]| {
            p.iter().map(|p| p.source).collect::<Vec<_>>()
        };
        let elements = |n: Vec<u32>, c: Vec<u32>, s: Vec<u32>| Elements {
            nodes: n.into_iter().map(NodeId).collect(),
            curves: c.into_iter().map(CurveId).collect(),
            sheets: s.into_iter().map(SheetId).collect(),
        };
        let left_first = elements(
            missing(&first.0, &of_first(&m.nodes)),
            missing(&first.1, &of_first(&m.curves)),
            missing(&first.2, &of_first(&m.sheets)),
        );
        let left_second = elements(
            missing(&second.0, &of_second(&m.nodes)),
            missing(&second.1, &of_second(&m.curves)),
            missing(&second.2, &of_second(&m.sheets)),
        );
        (out.unmatched_target, out.unmatched_source) = if self.turned {
            (left_second, left_first)
        } else {
            (left_first, left_second)
        };
        out
    }

    fn pairs<Id: Copy + Ord>(
        &self,
        pairs: &[matchers::graduated_assignment::MatchedPair],
        first: &[u32],
        second: &[u32],
        id: fn(u32) -> Id,
    ) -> Vec<Pair<Id>> {
        let mut out: Vec<Pair<Id>> = pairs
            .iter()
            .map(|p| {
                let (a, b) = (id(first[p.target as usize]), id(second[p.source as usize]));
                let (target, source) = if self.turned { (b, a) } else { (a, b) };
                Pair {
                    target,
                    source,
                    weight: p.gain,
                    confidence: p.confidence,
                }
            })
            .collect();
        out.sort_by_key(|p| p.target);
        out
    }
}

/// Translation of a pose after both shapes were divided by their sizes: the same places meet at the centroid of the second.
fn rescaled(fit: &DenseFit, second: &MedialSamples, a: f64, b: f64) -> DVec3 {
    let centroid = moments(&second.positions).centroid;
    fit.pose.apply(centroid) / a - fit.pose.linear * centroid / b
}

/// An order of scaffolds that does not depend on who is called target.
fn order(a: &CoarseScaffold, b: &CoarseScaffold) -> Ordering {
    let radii = |s: &CoarseScaffold| s.nodes.iter().map(|n| n.radius).sum::<f64>();
    let areas = |s: &CoarseScaffold| s.sheets.iter().map(|x| x.area).sum::<f64>();
    let lengths = |s: &CoarseScaffold| s.curves.iter().map(|x| x.length).sum::<f64>();
    areas(a)
        .total_cmp(&areas(b))
        .then(lengths(a).total_cmp(&lengths(b)))
        .then(radii(a).total_cmp(&radii(b)))
        .then(a.diagonal_mm.total_cmp(&b.diagonal_mm))
}

/// The scaffold with `x -> -x`.
fn mirror_image(s: &CoarseScaffold) -> CoarseScaffold {
    let mut out = s.clone();
    let flip = |p: &mut DVec3| p.x = -p.x;
    out.nodes.iter_mut().for_each(|n| flip(&mut n.position));
    out.curves
        .iter_mut()
        .flat_map(|c| &mut c.polyline)
        .for_each(|m| flip(&mut m.position));
    for sheet in &mut out.sheets {
        flip(&mut sheet.moments.centroid);
        sheet.mesh.vertices.iter_mut().for_each(|m| flip(&mut m.position));
    }
    out
}
