//! Size and form of one lesion, with the definitions of the Image Biomarker Standardisation Initiative (IBSI) where it has one.
//!
//! In: a [`Region`]. Out: [`Measures`]. Volumes are named by their definition:
//! - `volume_mesh`: enclosed by marching cubes at 0.5 on the mask (IBSI "volume (mesh)"); it cuts the corners of voxels, so it
//!   lies below the true volume of small lesions;
//! - `volume_voxel`: voxels times voxel volume (IBSI "volume (voxel counting)"); without bias for a grid placed at random. The
//!   smooth surface encloses the same volume.
//!
//! `volume_best` is the one that change is computed from: `volume_voxel` for masks (no bias, known variance), the enclosed volume
//! for meshes. Axis lengths are 4 sqrt(eigenvalue) of the sample covariance (n - 1, as IBSI's reference values; PyRadiomics divides
//! by n) of voxel centres, or of the solid for a mesh.
//! Diameters: largest distance between vertices of the plain surface, in space and within one axial slice; the perpendicular
//! is the widest extent across the longest axial diameter in the same slice.

use super::region::{Mask, Region, SurfaceKind};
use super::slices::{axial_slices, longest_axial};
use crate::geometry::TriangleMesh;
use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Size and form of a lesion at one date; lengths mm, areas mm^2, volumes mm^3.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// The volume that change is computed from.
    pub volume_best: f64,
    /// Its definition: `voxel` or `mesh`.
    pub volume_best_definition: String,
    /// Marching cubes at 0.5.
    pub volume_mesh: f64,
    /// Voxel count times voxel volume; not for meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_voxel: Option<f64>,
    /// Inside the surface dual to the scaffold, when a scaffold was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_scaffold: Option<f64>,
    /// Number of voxels; not for meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxels: Option<usize>,
    /// Area of the plain surface.
    pub area: f64,
    /// Area of the surface used for distances and growth; staircases do not count.
    pub area_smooth: f64,
    /// `(36 pi V^2)^(1/3) / A` of the plain surface.
    pub sphericity: f64,
    /// Area over volume of the plain surface, 1/mm.
    pub surface_to_volume: f64,
    /// Largest distance between two points of the plain surface.
    pub diameter_3d: f64,
    /// Largest distance within one axial slice.
    pub diameter_axial: f64,
    /// Largest distance between vertices of the plain surface of equal height in the grid (PyRadiomics' Maximum2DDiameterSlice).
    /// Half way between two slices it mixes the outlines of both, so it can exceed `diameter_axial`. Not for meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diameter_slice_vertices: Option<f64>,
    /// Widest extent across it in the same slice.
    pub diameter_perpendicular: f64,
    /// 4 sqrt(largest eigenvalue).
    pub axis_major: f64,
    /// 4 sqrt(middle eigenvalue).
    pub axis_minor: f64,
    /// 4 sqrt(least eigenvalue).
    pub axis_least: f64,
    /// sqrt(middle / largest eigenvalue).
    pub elongation: f64,
    /// sqrt(least / largest eigenvalue).
    pub flatness: f64,
    /// Centre of mass, LPS mm.
    pub centroid: DVec3,
    /// Which surface serves for distances and growth.
    pub surface: SurfaceKindName,
    /// Thickness over the sheets of the scaffold, when one was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<ThicknessStatistics>,
}

impl Measures {
    /// The measures that have a size to compare, by name; those that are not known are left out.
    fn sizes(&self) -> Vec<(&'static str, f64)> {
        let known = [
            ("volume_voxel", self.volume_voxel),
            ("volume_scaffold", self.volume_scaffold),
        ];
        let mut out = vec![
            ("volume_best", self.volume_best),
            ("volume_mesh", self.volume_mesh),
            ("area", self.area),
            ("area_smooth", self.area_smooth),
            ("sphericity", self.sphericity),
            ("surface_to_volume", self.surface_to_volume),
            ("diameter_3d", self.diameter_3d),
            ("diameter_axial", self.diameter_axial),
            ("diameter_perpendicular", self.diameter_perpendicular),
            ("axis_major", self.axis_major),
            ("axis_minor", self.axis_minor),
            ("axis_least", self.axis_least),
            ("elongation", self.elongation),
            ("flatness", self.flatness),
        ];
        out.extend(known.into_iter().filter_map(|(name, x)| Some((name, x?))));
        out
    }

    /// The change of every measure that both dates have and the baseline has not zero, percent.
    pub fn change_percent(&self, followup: &Measures) -> BTreeMap<&'static str, f64> {
        let after: BTreeMap<&str, f64> = followup.sizes().into_iter().collect();
        let of = |(name, a): (&'static str, f64)| {
            let b = after.get(name)?;
            (a != 0.0).then(|| (name, 100.0 * (b - a) / a))
        };
        self.sizes().into_iter().filter_map(of).collect()
    }
}

/// [`SurfaceKind`] with a default, as measures need one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SurfaceKindName(pub SurfaceKind);

impl Default for SurfaceKindName {
    fn default() -> Self {
        Self(SurfaceKind::Mesh)
    }
}

/// Thickness (twice the radius) over the sheets of a scaffold, weighted by area, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ThicknessStatistics {
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// Measures one lesion. Cost: linear in voxels, plus a search among the surface points that can end a diameter.
pub fn measure(region: &Region) -> Measures {
    let volume_mesh = region.plain.signed_volume();
    let area = region.plain.area();
    let moments = match &region.mask {
        Some(mask) => voxel_moments(mask),
        None => solid_moments(&region.surface),
    };
    let volume_voxel = region
        .mask
        .as_ref()
        .map(|m| m.count() as f64 * m.voxel_volume_mm3());
    let slices = axial_slices(region);
    let axial = longest_axial(&slices);
    let vertices = vertex_diameters(region);
    let [l, m, s] = moments.eigenvalues.map(|e| e.max(0.0).sqrt());
    Measures {
        volume_best: volume_voxel.unwrap_or(volume_mesh),
        volume_best_definition: if volume_voxel.is_some() { "voxel" } else { "mesh" }.to_owned(),
        volume_mesh,
        volume_voxel,
        volume_scaffold: None,
        voxels: region.mask.as_ref().map(Mask::count),
        area,
        area_smooth: region.surface.area(),
        sphericity: (36.0 * std::f64::consts::PI * volume_mesh * volume_mesh).cbrt() / area,
        surface_to_volume: area / volume_mesh,
        diameter_3d: vertices.in_space,
        diameter_slice_vertices: region.mask.as_ref().map(|_| vertices.in_plane),
        diameter_axial: axial.longest_mm,
        diameter_perpendicular: axial.perpendicular_mm,
        axis_major: 4.0 * l,
        axis_minor: 4.0 * m,
        axis_least: 4.0 * s,
        elongation: if l > 0.0 { m / l } else { 1.0 },
        flatness: if l > 0.0 { s / l } else { 1.0 },
        centroid: moments.centroid,
        surface: SurfaceKindName(region.surface_kind),
        thickness: None,
    }
}

/// Centre and spread of a solid.
struct Moments {
    centroid: DVec3,
    /// Of the covariance, largest first.
    eigenvalues: [f64; 3],
}

impl Moments {
    fn of(centroid: DVec3, covariance: Matrix3<f64>) -> Self {
        let mut e: Vec<f64> = SymmetricEigen::new(covariance)
            .eigenvalues
            .iter()
            .copied()
            .collect();
        e.sort_by(|a, b| b.total_cmp(a));
        Self {
            centroid,
            eigenvalues: [e[0], e[1], e[2]],
        }
    }
}

fn voxel_moments(mask: &Mask) -> Moments {
    let count = mask.count();
    let (n, freedom) = (count.max(1) as f64, count.saturating_sub(1).max(1) as f64);
    let place = |v: [usize; 3]| mask.position(DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64));
    let centroid = mask.voxels().map(place).sum::<DVec3>() / n;
    let mut covariance = Matrix3::zeros();
    for v in mask.voxels() {
        let d: Vector3<f64> = (place(v) - centroid).into();
        covariance += d * d.transpose() / freedom;
    }
    Moments::of(centroid, covariance)
}

/// Moments of the solid inside a closed mesh, exact, by signed tetrahedra about its first point.
fn solid_moments(mesh: &TriangleMesh) -> Moments {
    let origin = mesh.points.first().copied().unwrap_or_default();
    let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| Vector3::from(mesh.points[i as usize] - origin));
        let v = a.dot(&b.cross(&c)) / 6.0;
        let sum = a + b + c;
        volume += v;
        first += sum * (v / 4.0);
        second +=
            (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose()) * (v / 20.0);
    }
    if volume <= 0.0 {
        return Moments::of(origin, Matrix3::zeros());
    }
    let mean = first / volume;
    let centroid: DVec3 = mean.into();
    Moments::of(origin + centroid, second / volume - mean * mean.transpose())
}

/// Largest distances between vertices of the plain surface, mm.
struct VertexDiameters {
    in_space: f64,
    in_plane: f64,
}

/// Exact. The ends of a diameter are corners of the convex hull, so of the hull of their own plane: for a mask only those are
/// compared. For a mesh all points are, from the farthest from the centre on, until no pair can be longer.
fn vertex_diameters(region: &Region) -> VertexDiameters {
    let points = &region.plain.points;
    let Some(mask) = &region.mask else {
        return VertexDiameters {
            in_space: farthest_pair(points),
            in_plane: 0.0,
        };
    };
    // Vertices lie in the middle of voxel edges: in slices, or half way between two.
    let mut placed: Vec<(i64, DVec3, DVec3)> = points
        .iter()
        .map(|p| {
            let index = mask.index(*p);
            ((2.0 * index.z).round() as i64, index, *p)
        })
        .collect();
    placed.sort_by_key(|p| p.0);
    let mut corners = Vec::new();
    let mut in_plane = 0f64;
    for plane in placed.chunk_by(|a, b| a.0 == b.0) {
        let flat: Vec<[f64; 2]> = plane.iter().map(|(_, i, _)| [i.x, i.y]).collect();
        let ring: Vec<DVec3> = super::slices::hull(&flat)
            .into_iter()
            .map(|i| plane[i].2)
            .collect();
        in_plane = in_plane.max(farthest_pair(&ring));
        corners.extend(ring);
    }
    VertexDiameters {
        in_space: farthest_pair(&corners),
        in_plane,
    }
}

/// Largest distance between two points.
fn farthest_pair(points: &[DVec3]) -> f64 {
    let centre = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let mut by_reach: Vec<(f64, DVec3)> = points.iter().map(|p| (p.distance(centre), *p)).collect();
    by_reach.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = 0f64;
    for (i, (reach, p)) in by_reach.iter().enumerate() {
        if 2.0 * reach <= best {
            break;
        }
        for (other, q) in &by_reach[i + 1..] {
            if reach + other <= best {
                break;
            }
            best = best.max(p.distance_squared(*q).sqrt());
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_box_are_exact() {
        let size = DVec3::new(6.0, 4.0, 2.0);
        let corner = |i: usize| {
            DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * size + DVec3::splat(100.0)
        };
        let mesh = TriangleMesh {
            points: (0..8).map(corner).collect(),
            triangles: [
                [0, 2, 3, 1],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 6, 7, 3],
                [0, 4, 6, 2],
                [1, 3, 7, 5],
            ]
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        };
        assert!((mesh.signed_volume() - 48.0).abs() < 1e-9);
        let m = solid_moments(&mesh);
        for (value, side) in m.eigenvalues.iter().zip([6.0, 4.0, 2.0]) {
            assert!((value - side * side / 12.0).abs() < 1e-9);
        }
        assert!((m.centroid - (DVec3::splat(100.0) + 0.5 * size)).length() < 1e-9);
        assert!((farthest_pair(&mesh.points) - size.length()).abs() < 1e-12);
    }
}
