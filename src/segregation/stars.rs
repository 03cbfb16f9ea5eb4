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

/// The generators round which the surface between the labels is not a disk (off the surface counts as fine). Asked of the
/// triangles, which is the same as asking the stars and costs a quarter: their sides opposite the vertex must be one circle.
pub(super) fn pinched_vertices(triangulation: &Triangulation, inside: &[bool]) -> Vec<bool> {
    let n = triangulation.points.len();
    let triangles = super::labels::boundary_triangles(triangulation, inside);
    let mut first = vec![0u32; n + 1];
    for v in triangles.iter().flatten() {
        first[v.index() + 1] += 1;
    }
    for i in 0..n {
        first[i + 1] += first[i];
    }
    let mut sides = vec![[VertexId(0); 2]; 3 * triangles.len()];
    let mut next = first.clone();
    for t in &triangles {
        for k in 0..3 {
            let place = &mut next[t[k].index()];
            sides[*place as usize] = [t[(k + 1) % 3], t[(k + 2) % 3]];
            *place += 1;
        }
    }
    (0..n)
        .into_par_iter()
        .map(|v| !is_circle(&sides[first[v] as usize..first[v + 1] as usize]))
        .collect()
}

/// Whether directed sides are one simple circle, or there are none.
fn is_circle(sides: &[[VertexId; 2]]) -> bool {
    let Some(&[start, mut at]) = sides.first() else {
        return true;
    };
    for used in 1..=sides.len() {
        if at == start {
            return used == sides.len();
        }
        let mut on = sides.iter().filter(|s| s[0] == at);
        match (on.next(), on.next()) {
            (Some(side), None) => at = side[1],
            _ => return false,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delaunay::{DelaunaySettings, delaunay};
    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn triangles_and_stars_agree_on_what_is_pinched() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let points: Vec<DVec3> = (0..60)
            .map(|_| DVec3::new(rng.random(), rng.random(), rng.random()))
            .collect();
        let triangulation =
            delaunay(&points, &DelaunaySettings::default()).expect("points in general position");
        let stars = Stars::new(&triangulation);
        let (mut star, mut parts) = (StarBuffer::default(), StarParts::default());
        let mut seen = [0usize; 2];
        for share in [0.02, 0.1, 0.5, 0.9, 0.98] {
            for _ in 0..20 {
                let mut inside: Vec<bool> = (0..triangulation.num_finite())
                    .map(|_| rng.random::<f64>() < share)
                    .collect();
                inside.resize(triangulation.num_tets(), false);
                let by_triangles = pinched_vertices(&triangulation, &inside);
                for v in 0..triangulation.points.len() {
                    stars.collect(&triangulation, VertexId::from_index(v), &mut star);
                    parts.split(&triangulation, &star, &inside);
                    assert_eq!(
                        by_triangles[v],
                        parts.counts().pinched(),
                        "share {share} vertex {v}"
                    );
                    seen[usize::from(by_triangles[v])] += 1;
                }
            }
        }
        assert!(seen[0] > 500 && seen[1] > 500, "{seen:?}");
    }
}
