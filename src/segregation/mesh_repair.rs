//! A damaged mesh repaired: its good triangles are kept, the rest is found anew from its points.
//!
//! In: points and triangles of a mesh with holes, duplicate, flipped or stray faces. Out: a [`CloudSegregation`] over its
//! points and [`MeshRepairReport`]: what was kept, dropped, turned and added.
//!
//! 1. Triangles without area and repeated ones are dropped.
//! 2. Those left that are facets of the Delaunay triangulation are accepted before any gap transform, at cost 0, and are
//!    never undone; the closing stage sees them as surface. A triangle that is no Delaunay facet cannot be kept by a method
//!    that labels tetrahedra; it is listed as replaced.
//! 3. Closing, decision and report as for a cloud, without noise removal; triangles of the input count as supported however
//!    long their edges are, so that a coarse mesh is not taken for an open cloud.
//!
//! Cost: as for a cloud.

use super::cloud::{CloudSegregation, check, segregate_with_preset};
use super::error::SegregationError;
use super::prepare::compare;
use super::settings::{Denoise, SegregationSettings};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Why a triangle of the input is not in the output as given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChangeKind {
    /// It has two equal corners or no area.
    Degenerate,
    /// An earlier triangle has the same corners.
    Duplicate,
    /// It was turned over.
    Turned,
    /// It is no facet of the Delaunay triangulation; others cover its place.
    Replaced,
    /// It does not belong to the surface that was found.
    Stray,
}

/// One changed triangle of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// Its place in the input.
    pub triangle: u32,
    /// What happened to it.
    pub kind: ChangeKind,
}

/// What a repair changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshRepairReport {
    /// Triangles given.
    pub given: usize,
    /// Triangles kept as given.
    pub kept: usize,
    /// Triangles of the output that the input did not have.
    pub added: usize,
    /// Every triangle of the input that is not in the output as given, in the order of the input.
    pub changes: Vec<Change>,
}

/// A repaired mesh.
#[derive(Clone, Debug, Default)]
pub struct MeshRepair {
    /// Surface, labels and report over the mesh's points.
    pub cloud: CloudSegregation,
    /// What was changed.
    pub report: MeshRepairReport,
}

/// Repairs a mesh; see the module.
///
/// # Errors
/// [`SegregationError::BadTriangle`] when a triangle names a point that does not exist, and as for
/// [`super::segregate_cloud`].
pub fn segregate_mesh(
    points: &[DVec3],
    triangles: &[[u32; 3]],
    settings: &SegregationSettings,
) -> Result<MeshRepair, SegregationError> {
    check(points)?;
    for (triangle, t) in triangles.iter().enumerate() {
        if let Some(&point) = t.iter().find(|&&i| i as usize >= points.len()) {
            return Err(SegregationError::BadTriangle {
                triangle,
                point,
                points: points.len(),
            });
        }
    }
    let welded = weld(points);
    let mut kinds: Vec<Option<ChangeKind>> = vec![None; triangles.len()];
    let mut first: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for (i, t) in triangles.iter().enumerate() {
        let t = t.map(|v| welded[v as usize]);
        let [a, b, c] = t.map(|v| points[v as usize]);
        let key = sorted(t);
        if (b - a).cross(c - a) == DVec3::ZERO {
            kinds[i] = Some(ChangeKind::Degenerate);
        } else if *first.entry(key).or_insert(i as u32) != i as u32 {
            kinds[i] = Some(ChangeKind::Duplicate);
        }
    }
    let preset: Vec<[u32; 3]> = first.keys().copied().collect();
    let settings = SegregationSettings {
        denoise: Denoise::Off,
        ..settings.clone()
    };
    let outcome = segregate_with_preset(points, &preset, &settings)?;
    let cloud = outcome.cloud;
    let mut found: BTreeMap<[u32; 3], [u32; 3]> = BTreeMap::new();
    for t in &cloud.segregation.triangles {
        let given = t.map(|v| cloud.source[v.index()]);
        found.insert(sorted(given), given);
    }
    let mut kept = 0;
    for (key, &i) in &first {
        let as_given = triangles[i as usize].map(|v| welded[v as usize]);
        kinds[i as usize] = match found.get(key) {
            Some(&out) if same_turn(out, as_given) => None,
            Some(_) => Some(ChangeKind::Turned),
            None if outcome.preset_facets.contains(key) => Some(ChangeKind::Stray),
            None => Some(ChangeKind::Replaced),
        };
        kept += usize::from(kinds[i as usize].is_none());
    }
    let report = MeshRepairReport {
        given: triangles.len(),
        kept,
        added: found.keys().filter(|k| !first.contains_key(*k)).count(),
        changes: kinds
            .iter()
            .enumerate()
            .filter_map(|(i, kind)| {
                Some(Change {
                    triangle: i as u32,
                    kind: (*kind)?,
                })
            })
            .collect(),
    };
    Ok(MeshRepair { cloud, report })
}

/// For every point the first point with the same coordinates.
fn weld(points: &[DVec3]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| compare(points[a as usize], points[b as usize]).then(a.cmp(&b)));
    let mut out: Vec<u32> = (0..points.len() as u32).collect();
    for run in order.chunk_by(|a, b| points[*a as usize] == points[*b as usize]) {
        for &i in run {
            out[i as usize] = run[0];
        }
    }
    out
}

fn sorted(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}

/// Whether two triangles of the same corners run the same way round.
fn same_turn(a: [u32; 3], b: [u32; 3]) -> bool {
    (0..3).any(|k| [a[k], a[(k + 1) % 3], a[(k + 2) % 3]] == b)
}
