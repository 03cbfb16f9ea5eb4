//! Degenerate vertices (A1^n): tetrahedra whose spheres coincide, seen as the one vertex they are.
//!
//! In: the scaffold with its exact cospherical signs. Out: [`DegenerateVertex`] for each group of two tetrahedra or more.
//! The perturbed view (all tetrahedra, zero-length arcs between them) stays beside it.

use super::scaffold::FullScaffold;
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::mesh::DisjointSets;
use crate::geometry::{TetId, VertexId};

/// A vertex of the scaffold with five generators or more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DegenerateVertex {
    /// The tetrahedra of the perturbed view, in order; arcs between two of them have no length.
    pub tets: Vec<TetId>,
    /// The generators on the common sphere, in order.
    pub generators: Vec<VertexId>,
}

/// Groups in order of their smallest tetrahedron.
pub(super) fn degenerate_vertices(t: &Triangulation, scaffold: &FullScaffold) -> Vec<DegenerateVertex> {
    let tied = |tet: TetId| (0..4u8).any(|index| scaffold.is_zero_length(Facet { tet, index }));
    let tets: Vec<TetId> = t.finite_tets().filter(|&tet| tied(tet)).collect();
    if tets.is_empty() {
        return Vec::new();
    }
    let mut place = vec![u32::MAX; t.num_finite()];
    for (i, tet) in (0..).zip(&tets) {
        place[tet.index()] = i;
    }
    let mut sets = DisjointSets::new(tets.len());
    for (i, &tet) in tets.iter().enumerate() {
        for index in 0..4u8 {
            let facet = Facet { tet, index };
            if scaffold.is_zero_length(facet) {
                sets.union(i as u32, place[t.neighbour(tet, index as usize).index()]);
            }
        }
    }
    let mut group = vec![usize::MAX; tets.len()];
    let mut out: Vec<DegenerateVertex> = Vec::new();
    for (i, &tet) in tets.iter().enumerate() {
        let root = sets.find(i as u32) as usize;
        if group[root] == usize::MAX {
            group[root] = out.len();
            out.push(DegenerateVertex {
                tets: Vec::new(),
                generators: Vec::new(),
            });
        }
        let vertex = &mut out[group[root]];
        vertex.tets.push(tet);
        vertex.generators.extend(t.tet(tet));
    }
    for vertex in &mut out {
        vertex.generators.sort_unstable();
        vertex.generators.dedup();
    }
    out
}
