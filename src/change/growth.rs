//! Where a lesion grew: signed normal displacement of its baseline surface, checked against the change of volume, and the patches
//! and parts it falls into.
//!
//! In: the surfaces of two dates in one frame. Out: a [`GrowthMap`], patches named by their direction, and, with a scaffold, one
//! part a sheet. Steps:
//! 1. every baseline vertex goes along its normal, outward when it lies inside the follow-up and inward when it lies outside,
//!    to the follow-up surface. Where the normal misses, or goes many times farther than the closest point (a gap, a fold),
//!    the closest distance is taken;
//! 2. each triangle sweeps a prism, cut into three tetrahedra along diagonals that neighbours share; the signed prisms add up
//!    exactly to the difference in volume between the displaced and the old surface, which is the integral of
//!    `h + H h^2 + K h^3 / 3` over the surface. Its difference from the change measured directly is the identity residual;
//! 3. patches: connected sets of triangles whose vertices all moved the same way by more than half their threshold, at least one of
//!    them by more than the whole (two levels, as edges are traced: what is sure spreads over what is likely). The threshold follows
//!    the voxel's extent along the normal, so that flat ends between thick slices do not pass for growth.

use crate::coarse_scaffold::hypergraph::CoarseScaffold;
use crate::geometry::closest::SignedDistance;
use crate::geometry::neighbours::Neighbours;
use crate::geometry::{SheetId, TriangleMesh};
use glam::DVec3;
use parry3d_f64::query::{Ray, RayCast};
use parry3d_f64::shape::TriMesh;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The displacement of a baseline surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrowthMap {
    /// Baseline surface, LPS mm.
    pub mesh: TriangleMesh,
    /// Signed normal displacement of each vertex, mm; outward positive.
    pub displacement_mm: Vec<f64>,
    /// Signed volume that each triangle sweeps, mm^3.
    pub swept_mm3: Vec<f64>,
}

/// Numbers of a growth map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrowthSummary {
    /// Largest outward displacement, mm.
    pub max_outward: f64,
    /// Largest inward displacement, mm, as a positive number.
    pub max_inward: f64,
    /// Area-weighted mean displacement, mm.
    pub mean: f64,
    /// Volume change that the displacements imply, mm^3.
    pub implied_mm3: f64,
    /// Volume change between the two surfaces, mm^3.
    pub direct_mm3: f64,
    /// `implied - direct` in percent of `direct`; left out when the surfaces differ by less than 1 % in volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identity_residual_percent: Option<f64>,
}

/// What kind of part it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PartKind {
    /// A connected patch of the surface that moved beyond the threshold.
    Patch,
    /// The surface nearest to one sheet of the baseline scaffold.
    Sheet,
}

/// A part of a lesion and what it gained or lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Kind.
    pub kind: PartKind,
    /// Name: a direction for a patch, the sheet for a sheet.
    pub name: String,
    /// Sheet of the baseline scaffold, for sheets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheet: Option<SheetId>,
    /// Sheet of the follow-up scaffold that it was matched to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub followup_sheet: Option<SheetId>,
    /// Volume gained (lost when negative), mm^3.
    pub change_mm3: f64,
    /// Share of the change of the whole lesion, percent.
    pub share_percent: f64,
    /// Area of the baseline surface that belongs to it, mm^2.
    pub area_mm2: f64,
    /// Area-weighted mean displacement, mm.
    pub mean_displacement_mm: f64,
    /// Change of the sheet's mean radius, mm, when both sheets are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_change_mm: Option<f64>,
    /// Centre of the swept volume on the baseline surface, LPS mm.
    pub centre: DVec3,
}

/// The normal is left for the closest point when it goes farther than this many times the closest distance.
const FARTHEST_RATIO: f64 = 4.0;

/// The growth map from one closed surface to another; `None` when either has no triangle.
pub fn growth_map(baseline: &TriangleMesh, followup: &TriangleMesh) -> Option<GrowthMap> {
    let distance = SignedDistance::new(followup)?;
    if baseline.triangles.is_empty() {
        return None;
    }
    let rays = TriMesh::new(followup.points.clone(), followup.triangles.clone()).ok()?;
    let normals = baseline.vertex_normals();
    let displacement_mm: Vec<f64> = baseline
        .points
        .par_iter()
        .zip(&normals)
        .map(|(p, n)| {
            let closest = -distance.signed_distance(*p);
            let way = closest.signum();
            let reach = FARTHEST_RATIO * closest.abs();
            let along = rays.cast_local_ray(&Ray::new(*p, *n * way), reach, false);
            match along {
                Some(t) if *n != DVec3::ZERO => way * t,
                _ => closest,
            }
        })
        .collect();
    let moved: Vec<DVec3> = (0..baseline.points.len())
        .map(|i| baseline.points[i] + displacement_mm[i] * normals[i])
        .collect();
    let swept_mm3 = baseline
        .triangles
        .iter()
        .map(|t| prism(*t, &baseline.points, &moved))
        .collect();
    Some(GrowthMap {
        mesh: baseline.clone(),
        displacement_mm,
        swept_mm3,
    })
}

/// How far each vertex of the follow-up surface lies from the baseline surface, mm, outside positive; `None` when the baseline has no
/// triangle. It shows what no line from the baseline reaches: a lobe far out, a new arm.
pub fn followup_distances(baseline: &TriangleMesh, followup: &TriangleMesh) -> Option<Vec<f64>> {
    let distance = SignedDistance::new(baseline)?;
    let points = followup.points.par_iter();
    Some(points.map(|p| distance.signed_distance(*p)).collect())
}

/// Signed volume between a triangle and its moved copy.
fn prism(triangle: [u32; 3], from: &[DVec3], to: &[DVec3]) -> f64 {
    // Sorted by index, so that neighbours cut the wall between them along the same diagonal; an odd sort turns the triangle.
    let mut t = triangle;
    let mut sign = 1.0;
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if t[i] > t[j] {
            t.swap(i, j);
            sign = -sign;
        }
    }
    let [a, b, c] = t.map(|i| from[i as usize]);
    let [x, y, z] = t.map(|i| to[i as usize]);
    let tetrahedron = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| (q - p).cross(r - p).dot(s - p) / 6.0;
    // All three have the sign of the motion: a top above a counter-clockwise bottom is positive.
    sign * (tetrahedron(a, b, c, z) + tetrahedron(a, b, z, y) + tetrahedron(a, y, z, x))
}

fn triangle_area(mesh: &TriangleMesh, t: usize) -> f64 {
    let [a, b, c] = mesh.triangles[t].map(|i| mesh.points[i as usize]);
    0.5 * (b - a).cross(c - a).length()
}

impl GrowthMap {
    fn triangle_mean(&self, t: usize) -> f64 {
        self.mesh.triangles[t]
            .iter()
            .map(|i| self.displacement_mm[*i as usize])
            .sum::<f64>()
            / 3.0
    }

    /// The numbers of the map; `direct_mm3` is the difference in volume between the two surfaces.
    pub fn summary(&self, direct_mm3: f64) -> GrowthSummary {
        let areas: Vec<f64> = (0..self.mesh.triangles.len())
            .map(|t| triangle_area(&self.mesh, t))
            .collect();
        let area: f64 = areas.iter().sum();
        let sum: f64 = areas
            .iter()
            .enumerate()
            .map(|(t, a)| a * self.triangle_mean(t))
            .sum();
        let implied_mm3: f64 = self.swept_mm3.iter().sum();
        let tell = direct_mm3.abs() > 0.01 * self.mesh.signed_volume().abs();
        GrowthSummary {
            max_outward: self.displacement_mm.iter().copied().fold(0.0, f64::max),
            max_inward: -self.displacement_mm.iter().copied().fold(0.0, f64::min),
            mean: sum / area,
            implied_mm3,
            direct_mm3,
            identity_residual_percent: tell.then(|| 100.0 * (implied_mm3 - direct_mm3) / direct_mm3.abs()),
        }
    }

    /// One part from some triangles.
    fn part(&self, kind: PartKind, triangles: &[usize], total_mm3: f64) -> Part {
        let (mut area, mut change, mut mean, mut weight) = (0.0, 0.0, 0.0, 0.0);
        let mut centre = DVec3::ZERO;
        for &t in triangles {
            let a = triangle_area(&self.mesh, t);
            let w = self.swept_mm3[t].abs();
            area += a;
            change += self.swept_mm3[t];
            mean += a * self.triangle_mean(t);
            let corners = self.mesh.triangles[t].map(|i| self.mesh.points[i as usize]);
            centre += w * corners.iter().sum::<DVec3>() / 3.0;
            weight += w;
        }
        Part {
            kind,
            name: String::new(),
            sheet: None,
            followup_sheet: None,
            change_mm3: change,
            share_percent: if total_mm3 == 0.0 {
                0.0
            } else {
                100.0 * change / total_mm3
            },
            area_mm2: area,
            mean_displacement_mm: if area > 0.0 { mean / area } else { 0.0 },
            radius_change_mm: None,
            centre: if weight > 0.0 {
                centre / weight
            } else {
                DVec3::ZERO
            },
        }
    }

    /// Patches that moved by more than the threshold of their vertices, the largest first; those with less than a hundredth of the
    /// volume swept in all patches are left out.
    pub fn patches(&self, thresholds_mm: &[f64], centroid: DVec3) -> Vec<Part> {
        let total: f64 = self.swept_mm3.iter().sum();
        let area: f64 = self.mesh.area();
        let mut parts = Vec::new();
        for way in [1.0, -1.0] {
            let moved = |t: usize, share: f64| {
                self.mesh.triangles[t]
                    .map(|i| i as usize)
                    .iter()
                    .all(|i| way * self.displacement_mm[*i] > share * thresholds_mm[*i])
            };
            let ids: Vec<usize> = (0..self.mesh.triangles.len())
                .filter(|t| moved(*t, 0.5))
                .collect();
            let changed = TriangleMesh {
                points: self.mesh.points.clone(),
                triangles: ids.iter().map(|t| self.mesh.triangles[*t]).collect(),
            };
            for patch in changed.components() {
                let triangles: Vec<usize> = patch.iter().map(|t| ids[*t as usize]).collect();
                if !triangles.iter().any(|t| moved(*t, 1.0)) {
                    continue;
                }
                let mut part = self.part(PartKind::Patch, &triangles, total);
                let verb = if way > 0.0 { "grew" } else { "shrank" };
                let place = direction_name(part.centre - centroid, part.area_mm2 / area);
                part.name = format!("{verb} {place}");
                parts.push(part);
            }
        }
        let gross: f64 = parts.iter().map(|p| p.change_mm3.abs()).sum();
        parts.retain(|p| p.change_mm3.abs() >= 0.01 * gross);
        parts.sort_by(|a, b| b.change_mm3.abs().total_cmp(&a.change_mm3.abs()));
        parts
    }

    /// One part a sheet of the baseline scaffold: each triangle goes to the sheet whose ball comes nearest to it.
    pub fn sheet_parts(
        &self,
        baseline: &CoarseScaffold,
        followup: &CoarseScaffold,
        pairs: &[SheetPair],
    ) -> Vec<Part> {
        let trees: Vec<Option<Neighbours>> = baseline
            .sheets
            .iter()
            .map(|s| {
                let points: Vec<DVec3> = s.mesh.vertices.iter().map(|v| v.position).collect();
                (!points.is_empty()).then(|| Neighbours::new(&points))
            })
            .collect();
        let mut triangles = vec![Vec::new(); baseline.sheets.len()];
        for (t, corners) in self.mesh.triangles.iter().enumerate() {
            let centre = corners
                .iter()
                .map(|i| self.mesh.points[*i as usize])
                .sum::<DVec3>()
                / 3.0;
            let gap = |s: usize| {
                let hit = trees[s].as_ref()?.nearest(centre)?;
                Some(hit.distance2.sqrt() - baseline.sheets[s].mesh.vertices[hit.index as usize].radius)
            };
            let nearest = (0..trees.len())
                .filter_map(|s| Some((gap(s)?, s)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, s)) = nearest {
                triangles[s].push(t);
            }
        }
        let total: f64 = self.swept_mm3.iter().sum();
        let sheets = baseline.sheets.iter().zip(&triangles);
        sheets
            .map(|(sheet, triangles)| {
                let partner = pairs.iter().find(|p| p.baseline == sheet.id).map(|p| p.followup);
                let radius = partner
                    .and_then(|p| followup.sheets.get(p.index()))
                    .map(|s| s.mean_radius);
                Part {
                    name: format!("sheet {}", sheet.id),
                    sheet: Some(sheet.id),
                    followup_sheet: partner,
                    radius_change_mm: radius.map(|r| r - sheet.mean_radius),
                    ..self.part(PartKind::Sheet, triangles, total)
                }
            })
            .collect()
    }
}

/// A sheet of the baseline scaffold and its partner in the follow-up scaffold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SheetPair {
    /// In the baseline scaffold.
    pub baseline: SheetId,
    /// In the follow-up scaffold.
    pub followup: SheetId,
}

/// Words for a direction in LPS: each axis with at least two fifths of the length; `all round` when most of the surface moved.
fn direction_name(offset: DVec3, share_of_surface: f64) -> String {
    if share_of_surface > 0.7 {
        return "all round".to_owned();
    }
    let d = offset.normalize_or_zero();
    let words = [
        (d.z, "superior", "inferior"),
        (d.y, "posterior", "anterior"),
        (d.x, "left", "right"),
    ];
    let named: Vec<&str> = words
        .iter()
        .filter(|(x, _, _)| x.abs() >= 0.4)
        .map(|(x, plus, minus)| if *x > 0.0 { *plus } else { *minus })
        .collect();
    if named.is_empty() {
        "in the middle".to_owned()
    } else {
        named.join(" ")
    }
}
