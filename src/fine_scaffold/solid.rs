//! Betti numbers of the solid by a route that knows nothing of the dual complex.
//!
//! In: the triangulation and the labels, or a closed mesh. Out: [`Betti`].
//!
//! The interior of the union of inside tetrahedra is an open 3-manifold; shrunk a little it is compact, and its boundary is
//! the surface of the union *unpinched*: where the surface touches itself along an edge or in a vertex, the sides are told
//! apart by walking through the solid, and the tip that a vertex puts into the solid is drilled out. For a compact 3-manifold in space `b0` counts components, `b2` the
//! boundary components less `b0`, and half the Euler number of the boundary is `b0 - b1 + b2` (Hatcher, Algebraic Topology,
//! 3.3 and Alexander duality). Cost `O(tetrahedra)`.

use super::build::{FineScaffoldError, Side};
use super::complex::{Betti, NONE};
use super::domain::Domain;
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::DisjointSets;
use crate::segregation::Segregation;

/// Betti numbers of one side of the surface.
///
/// # Errors
/// Those of [`Domain::new`].
pub fn solid_betti(
    triangulation: &Triangulation,
    segregation: &Segregation,
    side: Side,
) -> Result<Betti, FineScaffoldError> {
    Ok(solid_betti_of(
        triangulation,
        &Domain::new(triangulation, segregation, side)?,
    ))
}

/// Betti numbers of a domain: the interior of a union of tetrahedra, less walls. A wall is boundary on both its sides.
pub fn solid_betti_of(triangulation: &Triangulation, domain: &Domain) -> Betti {
    let of_domain = || triangulation.finite_tets().filter(|&t| domain.has(t));
    let mut parts = DisjointSets::new(triangulation.num_tets());
    let mut b0 = 0i64;
    let mut boundary = Vec::new();
    let mut slot = vec![NONE; 4 * triangulation.num_finite()];
    for tet in of_domain() {
        b0 += 1;
        for index in 0..4u8 {
            let facet = Facet { tet, index };
            if domain.beyond(triangulation, facet).is_none() {
                slot[4 * tet.index() + index as usize] = boundary.len() as u32;
                boundary.push(facet);
            }
        }
    }
    for tet in of_domain() {
        for index in 0..4u8 {
            if let Some(next) = domain.beyond(triangulation, Facet { tet, index }) {
                b0 -= i64::from(parts.union(tet.0, next.tet.0));
            }
        }
    }
    let mut surfaces = DisjointSets::new(boundary.len());
    let mut corners = DisjointSets::new(4 * boundary.len());
    let slot_of = |f: Facet| slot[4 * f.tet.index() + f.index as usize];
    for (i, &facet) in boundary.iter().enumerate() {
        let i = i as u32;
        for opposite in (0..4).filter(|&k| k != facet.index as usize) {
            let other = across(triangulation, domain, facet, opposite);
            surfaces.union(i, slot_of(other));
            for place in (0..4).filter(|&k| k != facet.index as usize && k != opposite) {
                let v = triangulation.tet(facet.tet)[place];
                if let Some(k) = triangulation.tet(other.tet).iter().position(|&w| w == v) {
                    corners.union(4 * i + place as u32, 4 * slot_of(other) + k as u32);
                }
            }
        }
    }
    let patches = patches(triangulation, domain);
    let euler_of_vertices = euler_of_vertices(triangulation, &boundary, &mut corners, patches, &mut surfaces);
    let components = (0..boundary.len() as u32)
        .filter(|&i| surfaces.find(i) == i)
        .count() as i64;
    let triangles = boundary.len() as i64;
    let euler = euler_of_vertices - 3 * triangles / 2 + triangles;
    let b2 = components - b0;
    Betti {
        b0,
        b1: b0 + b2 - euler / 2,
        b2,
    }
}

/// The patches of every generator's link: corners `4 * tet + place` of tetrahedra of the side, joined across the
/// triangles between them that hold the generator.
fn patches(triangulation: &Triangulation, domain: &Domain) -> DisjointSets {
    let mut patches = DisjointSets::new(4 * triangulation.num_finite());
    for tet in triangulation.finite_tets().filter(|&t| domain.has(t)) {
        for index in 0..4u8 {
            let Some(next) = domain.beyond(triangulation, Facet { tet, index }) else {
                continue;
            };
            if next.tet < tet {
                continue;
            }
            let there = triangulation.tet(next.tet);
            for (place, v) in triangulation.tet(tet).iter().enumerate() {
                if place == index as usize {
                    continue;
                }
                if let Some(k) = there.iter().position(|w| w == v) {
                    patches.union(4 * tet.0 + place as u32, 4 * next.tet.0 + k as u32);
                }
            }
        }
    }
    patches
}

/// What the generators add to the Euler number of the boundary. Near a generator the solid is a cone over a patch of the
/// generator's link, without the tip; shrunk, its boundary there is a copy of the patch, a sphere with as many holes as
/// the patch has border loops. So a patch with `k` loops adds `2 - k` (an ordinary vertex: 1), and joins the surfaces of its
/// loops.
fn euler_of_vertices(
    triangulation: &Triangulation,
    boundary: &[Facet],
    corners: &mut DisjointSets,
    mut patches: DisjointSets,
    surfaces: &mut DisjointSets,
) -> i64 {
    let mut first_of_patch = vec![NONE; 4 * triangulation.num_finite()];
    let mut euler = 0;
    for (i, &facet) in boundary.iter().enumerate() {
        let i = i as u32;
        for place in (0..4u32).filter(|&k| k != u32::from(facet.index)) {
            if corners.find(4 * i + place) != 4 * i + place {
                continue;
            }
            let first = &mut first_of_patch[patches.find(4 * facet.tet.0 + place) as usize];
            if *first == NONE {
                *first = i;
                euler += 1;
            } else {
                surfaces.union(*first, i);
                euler -= 1;
            }
        }
    }
    euler
}

/// The boundary facet met when turning from `facet` through the solid about its edge that misses corner `opposite`.
fn across(triangulation: &Triangulation, domain: &Domain, facet: Facet, opposite: usize) -> Facet {
    // The edge is kept; `pivot` is the corner of the current tetrahedron not on the facet last crossed.
    let mut at = facet.tet;
    let mut exit = opposite;
    let mut entered = facet.index as usize;
    loop {
        let out = Facet {
            tet: at,
            index: exit as u8,
        };
        let Some(mirror) = domain.beyond(triangulation, out) else {
            return out;
        };
        // In the next tetrahedron leave opposite the corner of the crossed facet that is not on the edge: the old `entered`.
        let kept = triangulation.tet(at)[entered];
        at = mirror.tet;
        entered = mirror.index as usize;
        exit = triangulation
            .tet(at)
            .iter()
            .position(|&v| v == kept)
            .expect("a corner of the crossed facet is in both tetrahedra");
    }
}

/// Betti numbers of the solid bounded by a closed, oriented mesh without self-intersections: outward components bound pieces,
/// inward ones bound cavities, and those that enclose nothing count for nothing. `None` when the mesh is open, not consistently oriented, or pinched.
pub fn mesh_betti(mesh: &TriangleMesh) -> Option<Betti> {
    let topology = mesh.topology();
    if !topology.watertight
        || !topology.oriented
        || topology.nonmanifold_vertices > 0
        || topology.euler % 2 != 0
    {
        return None;
    }
    let mut betti = Betti::default();
    let mut euler = 0;
    for part in mesh.solid_components() {
        let part = mesh.submesh(&part);
        euler += part.topology().euler;
        if part.signed_volume() > 0.0 {
            betti.b0 += 1;
        } else {
            betti.b2 += 1;
        }
    }
    betti.b1 = betti.b0 + betti.b2 - euler / 2;
    Some(betti)
}
