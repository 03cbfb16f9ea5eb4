//! The tetrahedra round a vertex and what labels make of them.
//!
//! In: the triangulation (topology only). Out: stars, and whether the inside and the outside of a labelling are each
//! connected in a star. They are, in every star, exactly when the surface between them is a manifold: its link at the
//! vertex is then one circle. An edge with four surface triangles shows as two inside (or outside) parts in the stars of
//! its ends, so edges need no test of their own.

use crate::delaunay::Triangulation;
use crate::geometry::{TetId, VertexId};
use rayon::prelude::*;

/// One tetrahedron of every vertex, from which its star is walked.
#[derive(Clone, Debug)]
pub(super) struct Stars {
    /// A tetrahedron (ghosts included) at each vertex.
    anchor: Vec<TetId>,
}

/// Buffers of star walks, reused from vertex to vertex of one triangulation.
#[derive(Clone, Debug, Default)]
pub(super) struct StarBuffer {
    /// The star, ghosts included, in the order of the walk.
    pub tets: Vec<TetId>,
    /// For each tetrahedron of the star the neighbours in the star, as places in `tets`, by facet (`u32::MAX`: none).
    pub links: Vec<[u32; 4]>,
    /// Place of each tetrahedron in `tets`; `u32::MAX` for those that are not in the star.
    place: Vec<u32>,
}

impl Stars {
    pub fn new(triangulation: &Triangulation) -> Self {
        let mut anchor = vec![TetId(u32::MAX); triangulation.points.len()];
        for tet in triangulation.tets() {
            for v in triangulation.tet(tet) {
                if let Some(slot) = anchor.get_mut(v.index())
                    && slot.0 == u32::MAX
                {
                    *slot = tet;
                }
            }
        }
        Self { anchor }
    }

    /// Collects the star of a vertex. `O(size of the star)`.
    pub fn collect(&self, triangulation: &Triangulation, vertex: VertexId, buffer: &mut StarBuffer) {
        for tet in buffer.tets.drain(..) {
            buffer.place[tet.index()] = u32::MAX;
        }
        buffer.links.clear();
        buffer.place.resize(triangulation.num_tets(), u32::MAX);
        let start = self.anchor[vertex.index()];
        if start.0 == u32::MAX {
            return;
        }
        buffer.tets.push(start);
        buffer.place[start.index()] = 0;
        let mut at = 0;
        while at < buffer.tets.len() {
            let tet = buffer.tets[at];
            let corners = triangulation.tet(tet);
            let mut links = [u32::MAX; 4];
            for index in 0..4 {
                if corners[index] == vertex {
                    continue;
                }
                let next = triangulation.neighbour(tet, index);
                let place = &mut buffer.place[next.index()];
                if *place == u32::MAX {
                    *place = buffer.tets.len() as u32;
                    buffer.tets.push(next);
                }
                links[index] = *place;
            }
            buffer.links.push(links);
            at += 1;
        }
    }
}

/// The parts of equal label in a star.
#[derive(Clone, Debug, Default)]
pub(super) struct StarParts {
    /// Part of each tetrahedron of the star.
    pub part: Vec<u32>,
    /// Label of each part.
    pub inside: Vec<bool>,
    /// Whether the part holds a ghost.
    pub infinite: Vec<bool>,
}

impl StarParts {
    /// Splits a star into parts of equal label; all parts with ghosts are one part (they meet at infinity).
    pub fn split(&mut self, triangulation: &Triangulation, star: &StarBuffer, inside: &[bool]) {
        let n = star.tets.len();
        self.part.clear();
        self.part.resize(n, u32::MAX);
        self.inside.clear();
        self.infinite.clear();
        let mut infinite_part = u32::MAX;
        let mut stack: Vec<u32> = Vec::new();
        // Ghosts first, so that their parts share one number.
        for pass_ghosts in [true, false] {
            for start in 0..n {
                let ghost = !triangulation.is_finite(star.tets[start]);
                if self.part[start] != u32::MAX || ghost != pass_ghosts {
                    continue;
                }
                let label = inside[star.tets[start].index()];
                let part = if ghost && infinite_part != u32::MAX {
                    infinite_part
                } else {
                    self.inside.push(label);
                    self.infinite.push(ghost);
                    self.inside.len() as u32 - 1
                };
                if ghost {
                    infinite_part = part;
                }
                self.part[start] = part;
                stack.push(start as u32);
                while let Some(at) = stack.pop() {
                    for &next in &star.links[at as usize] {
                        if next != u32::MAX
                            && self.part[next as usize] == u32::MAX
                            && inside[star.tets[next as usize].index()] == label
                        {
                            self.part[next as usize] = part;
                            stack.push(next);
                        }
                    }
                }
            }
        }
    }

    /// Number of inside and outside parts.
    pub fn counts(&self) -> PartCounts {
        let inside = self.inside.iter().filter(|l| **l).count();
        PartCounts {
            inside,
            outside: self.inside.len() - inside,
        }
    }
}

/// How many parts of each label a star has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PartCounts {
    pub inside: usize,
    pub outside: usize,
}

impl PartCounts {
    /// Whether the surface is not a disk round the vertex.
    pub fn pinched(self) -> bool {
        self.inside > 1 || self.outside > 1
    }
}

/// The generators round which the surface between the labels is not a disk (off the surface counts as fine).
pub(super) fn pinched_vertices(triangulation: &Triangulation, inside: &[bool]) -> Vec<bool> {
    let stars = Stars::new(triangulation);
    (0..triangulation.points.len() as u32)
        .into_par_iter()
        .map_init(
            || (StarBuffer::default(), StarParts::default()),
            |(star, parts), v| {
                stars.collect(triangulation, VertexId(v), star);
                parts.split(triangulation, star, inside);
                parts.counts().pinched()
            },
        )
        .collect()
}
