//! Pose from pairs of which most may be wrong.
//!
//! 1. Join pairs that agree on lengths ([`super::consistency`]).
//! 2. Take the maximum clique ([`super::clique`]): the largest set of pairs that all agree.
//! 3. Fit it robustly ([`super::gnc`]): length agreement admits reflections and a few near misses.
//! 4. Collect every pair within the inlier bound, fit again, until the set stays the same.
//!
//! H. Yang, J. Shi, L. Carlone, "TEASER", IEEE T-RO 2021, is the model; steps 3 and 4 differ in that the full pose is
//! refitted instead of rotation and translation apart. Cost: O(n^2) plus the clique.

use super::clique::max_clique;
use super::consistency::{ScaleRange, consistency_graph};
use super::fit::{Pose, PoseError, check_pairs, fit};
use super::gnc::{GncSettings, fit_gnc};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// Refits of the last step; the set of inliers settles in two or three.
const MAX_REFITS: usize = 20;

/// How to estimate a pose from doubtful pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RobustPoseSettings {
    /// Largest residual of a right pair, in the points' unit.
    pub inlier_bound: f64,
    /// Scales admitted; [`ScaleRange::RIGID`] fixes the scale to one, any other range has it estimated.
    pub scale: ScaleRange,
    /// Most search nodes of the clique search; the largest clique found by then is used.
    pub max_search_nodes: usize,
}

impl Default for RobustPoseSettings {
    fn default() -> Self {
        Self {
            inlier_bound: 1.0,
            scale: ScaleRange::RIGID,
            max_search_nodes: 200_000,
        }
    }
}

/// A pose and the pairs that carry it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobustPose {
    /// The pose.
    pub pose: Pose,
    /// Pairs within the inlier bound, ascending.
    pub inliers: Vec<usize>,
    /// Size of the consistent set it started from.
    pub clique: usize,
    /// Whether that set is proven the largest.
    pub clique_proven: bool,
}

/// Estimates the pose of matched points, some or most of them matched wrongly.
///
/// # Errors
/// When the input is malformed or no consistent set determines a rotation.
pub fn robust_pose(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    weights: &[f64],
    settings: &RobustPoseSettings,
) -> Result<RobustPose, PoseError> {
    check_pairs(source, target, weights)?;
    let s = settings.scale;
    if !(s.least > 0.0 && s.greatest >= s.least && s.greatest.is_finite()) {
        let expected = "scales are finite, above 0, the least not above the greatest";
        return Err(PoseError::BadSetting {
            name: "scale",
            value: s.least,
            expected,
        });
    }
    let with_scale = s.greatest > s.least;
    let graph = consistency_graph(source, target, settings.inlier_bound, s);
    let clique = max_clique(&graph, settings.max_search_nodes);
    let mut prior = vec![0.0; source.len()];
    for &k in &clique.vertices {
        prior[k] = weights[k];
    }
    let gnc = GncSettings {
        inlier_bound: settings.inlier_bound,
        with_scale,
        ..GncSettings::default()
    };
    let mut pose = fit_gnc(source, target, &prior, &gnc)?.pose;
    let within = |pose: &Pose| -> Vec<usize> {
        let near = |k: &usize| (pose.apply(&source[*k]) - target[*k]).norm() <= settings.inlier_bound;
        (0..source.len())
            .filter(|k| weights[*k] > 0.0)
            .filter(near)
            .collect()
    };
    let mut inliers = within(&pose);
    for _ in 0..MAX_REFITS {
        let mut held = vec![0.0; source.len()];
        inliers.iter().for_each(|&k| held[k] = weights[k]);
        pose = fit(source, target, &held, with_scale)?;
        let next = within(&pose);
        if next == inliers {
            break;
        }
        inliers = next;
    }
    Ok(RobustPose {
        pose,
        inliers,
        clique: clique.vertices.len(),
        clique_proven: clique.proven,
    })
}
