//! How well two segmentations agree: overlap and surface distances, each in both published conventions.
//!
//! In: two [`Region`]s in one frame. Out: [`Agreement`]. Conventions:
//! - `mesh` (Nikolov et al. 2018): distances from each surface element to the other surface, weighted by area; percentiles and
//!   surface Dice by area. Elements are the triangles of the plain surfaces, taken at their centres; distances are exact.
//! - `voxel` (Taha & Hanbury 2015; as in common segmentation challenges): distances between centres of border voxels (set, with
//!   an unset neighbour across a face), every voxel counting the same. Only for two masks.
//!
//! Hausdorff distance: the larger of the two directed maxima; HD95: the larger of the two directed 95th percentiles; ASSD: all
//! distances of both directions, averaged; surface Dice: the share of both borders within the tolerance.

use super::region::{Mask, Region};
use crate::geometry::TriangleMesh;
use crate::geometry::closest::ClosestOnMesh;
use crate::geometry::neighbours::Neighbours;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Overlap and distances of two segmentations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// `2 |A and B| / (|A| + |B|)` by volume; for masks only. Grids may differ: the common part is measured on both and averaged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dice: Option<f64>,
    /// Tolerance of the surface Dice coefficients, mm.
    pub tolerance_mm: f64,
    /// Area-weighted distances between surfaces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<SurfaceAgreement>,
    /// Distances between border voxels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel: Option<SurfaceAgreement>,
}

/// Distances between two borders, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceAgreement {
    /// Hausdorff distance.
    pub hausdorff: f64,
    /// 95th percentile instead of the maximum.
    pub hd95: f64,
    /// Average symmetric surface distance.
    pub assd: f64,
    /// Share of both borders within the tolerance, 0 to 1.
    pub surface_dice: f64,
}

/// Compares two regions.
pub fn agreement(a: &Region, b: &Region, tolerance_mm: f64) -> Agreement {
    let masks = a.mask.as_ref().zip(b.mask.as_ref());
    Agreement {
        dice: masks.map(|(a, b)| dice(a, b)),
        tolerance_mm,
        mesh: mesh_agreement(&a.plain, &b.plain, tolerance_mm),
        voxel: masks.map(|(a, b)| voxel_agreement(a, b, tolerance_mm)),
    }
}

/// Volume of the voxels of one mask whose centres lie in the other, mm^3.
pub(super) fn common_volume(a: &Mask, b: &Mask) -> f64 {
    let place = |v: [usize; 3]| a.position(DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64));
    a.voxels().filter(|v| b.contains(place(*v))).count() as f64 * a.voxel_volume_mm3()
}

fn dice(a: &Mask, b: &Mask) -> f64 {
    let volume = |m: &Mask| m.count() as f64 * m.voxel_volume_mm3();
    (common_volume(a, b) + common_volume(b, a)) / (volume(a) + volume(b))
}

/// A distance and how much it counts.
type Weighted = (f64, f64);

fn summary(mut forth: Vec<Weighted>, mut back: Vec<Weighted>, tolerance_mm: f64) -> SurfaceAgreement {
    let percentile = |list: &mut Vec<Weighted>| {
        list.sort_by(|x, y| x.0.total_cmp(&y.0));
        let total: f64 = list.iter().map(|d| d.1).sum();
        let mut sum = 0.0;
        list.iter()
            .find(|d| {
                sum += d.1;
                sum >= 0.95 * total
            })
            .map_or(0.0, |d| d.0)
    };
    let hd95 = percentile(&mut forth).max(percentile(&mut back));
    let both = || forth.iter().chain(&back);
    let weight: f64 = both().map(|d| d.1).sum();
    let near: f64 = both().filter(|d| d.0 <= tolerance_mm).map(|d| d.1).sum();
    SurfaceAgreement {
        hausdorff: both().map(|d| d.0).fold(0.0, f64::max),
        hd95,
        assd: both().map(|d| d.0 * d.1).sum::<f64>() / weight,
        surface_dice: near / weight,
    }
}

fn mesh_agreement(a: &TriangleMesh, b: &TriangleMesh, tolerance_mm: f64) -> Option<SurfaceAgreement> {
    let directed = |from: &TriangleMesh, to: &TriangleMesh| -> Option<Vec<Weighted>> {
        let closest = ClosestOnMesh::new(to)?;
        let corners = |t: &[u32; 3]| t.map(|i| from.points[i as usize]);
        let centres: Vec<DVec3> = from
            .triangles
            .iter()
            .map(|t| corners(t).iter().sum::<DVec3>() / 3.0)
            .collect();
        let hits = closest.closest_many(&centres);
        Some(
            from.triangles
                .iter()
                .zip(hits.iter().zip(&centres))
                .map(|(t, (hit, centre))| {
                    let [p, q, r] = corners(t);
                    (hit.point.distance(*centre), 0.5 * (q - p).cross(r - p).length())
                })
                .collect(),
        )
    };
    Some(summary(directed(a, b)?, directed(b, a)?, tolerance_mm))
}

/// Centres of set voxels with an unset neighbour across a face, LPS mm.
fn border(mask: &Mask) -> Vec<DVec3> {
    mask.voxels()
        .filter(|v| {
            let [i, j, k] = v.map(|x| x as i64);
            let faces = [
                [i - 1, j, k],
                [i + 1, j, k],
                [i, j - 1, k],
                [i, j + 1, k],
                [i, j, k - 1],
                [i, j, k + 1],
            ];
            faces.iter().any(|f| !mask.is_set(f[0], f[1], f[2]))
        })
        .map(|v| mask.position(DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64)))
        .collect()
}

fn voxel_agreement(a: &Mask, b: &Mask, tolerance_mm: f64) -> SurfaceAgreement {
    let (a, b) = (border(a), border(b));
    let directed = |from: &[DVec3], to: &[DVec3]| -> Vec<Weighted> {
        let tree = Neighbours::new(to);
        tree.nearest_many(from)
            .iter()
            .zip(from)
            .map(|(hit, p)| (tree.points()[hit.index as usize].distance(*p), 1.0))
            .collect()
    };
    summary(directed(&a, &b), directed(&b, &a), tolerance_mm)
}
