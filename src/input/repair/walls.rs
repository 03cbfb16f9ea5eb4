//! Walls and fins dropped: patches of a mesh that bound no solid of their own.
//!
//! In: triangles that agree patch by patch. Out: which of them stay.
//!
//! A surface that encloses something has as many triangles that run along an edge one way as the other. Where a wall divides
//! a solid, or a fin hangs on it, three meet and one is too many. Patches are bounded by edges of three triangles and more and
//! by rims. A patch is dropped when the edges at all its borders have too many triangles, and as many too many as it has
//! there:
//!
//! 1. a patch without rims is a wall; of the patches of which one must go the smallest does;
//! 2. a patch with rims is a fin; only small ones are dropped ([`LARGEST_FIN`]), since sheets that meet in a curve are a shape
//!    in their own right.
//!
//! Cost `O(n log n)`.

use super::cut::{Side, sorted_sides};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::DisjointSets;
use std::collections::BTreeMap;

/// Largest area of a fin, as a part of the whole mesh.
const LARGEST_FIN: f64 = 0.01;

/// An edge of three triangles or more.
struct Junction {
    /// Triangles that run forward less those that run backward.
    excess: i64,
}

/// The border of a patch.
#[derive(Default)]
struct Border {
    /// What the patch itself has in excess at each junction.
    at: BTreeMap<usize, i64>,
    has_rim: bool,
}

/// Which triangles stay; see the module.
pub(super) fn without_walls(mesh: &TriangleMesh) -> Vec<bool> {
    let sides = sorted_sides(mesh);
    let mut kept = vec![true; mesh.triangles.len()];
    if sides.chunk_by(|a, b| a.edge == b.edge).all(|run| run.len() < 3) {
        return kept;
    }
    let mut patches = DisjointSets::new(mesh.triangles.len());
    for run in sides.chunk_by(|a, b| a.edge == b.edge) {
        if let [a, b] = run {
            patches.union(a.triangle, b.triangle);
        }
    }
    let (mut junctions, borders) = borders(&sides, &mut patches);
    let mut area: BTreeMap<u32, f64> = borders.keys().map(|p| (*p, 0.0)).collect();
    for t in 0..mesh.triangles.len() as u32 {
        if let Some(sum) = area.get_mut(&patches.find(t)) {
            let [a, b, c] = mesh.triangles[t as usize].map(|i| mesh.points[i as usize]);
            *sum += 0.5 * (b - a).cross(c - a).length();
        }
    }
    let limit = LARGEST_FIN * mesh.area();
    let mut order: Vec<(f64, u32)> = area.iter().map(|(p, a)| (*a, *p)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut dropped: Vec<u32> = Vec::new();
    for (area, patch) in order {
        let border = &borders[&patch];
        let bounds_nothing = border
            .at
            .iter()
            .all(|(j, own)| *own != 0 && junctions[*j].excess == *own);
        if bounds_nothing && (!border.has_rim || area <= limit) {
            for (j, own) in &border.at {
                junctions[*j].excess -= own;
            }
            dropped.push(patch);
        }
    }
    dropped.sort_unstable();
    for (t, keep) in kept.iter_mut().enumerate() {
        *keep = dropped.binary_search(&patches.find(t as u32)).is_err();
    }
    kept
}

/// The junctions of a mesh, and the borders of the patches that have any.
fn borders(sides: &[Side], patches: &mut DisjointSets) -> (Vec<Junction>, BTreeMap<u32, Border>) {
    let mut junctions = Vec::new();
    let mut borders: BTreeMap<u32, Border> = BTreeMap::new();
    let sign = |side: &Side| if side.forward { 1 } else { -1 };
    for run in sides
        .chunk_by(|a, b| a.edge == b.edge)
        .filter(|run| run.len() > 2)
    {
        for side in run {
            let border = borders.entry(patches.find(side.triangle)).or_default();
            *border.at.entry(junctions.len()).or_default() += sign(side);
        }
        junctions.push(Junction {
            excess: run.iter().map(sign).sum(),
        });
    }
    for run in sides.chunk_by(|a, b| a.edge == b.edge) {
        if let [rim] = run
            && let Some(border) = borders.get_mut(&patches.find(rim.triangle))
        {
            border.has_rim = true;
        }
    }
    (junctions, borders)
}
