//! How much each facet looks like a piece of surface.
//!
//! In: triangulation and circumspheres. Out: for every facet of every tetrahedron the height of the circumcentre over it on
//! its own side, over the circumradius ([`FacetDepths`]), and from the two sides the weight
//! `w = 1 - min(h1 / r1, h2 / r2)` in `0..=2`: 0 when both balls are deep on their own sides (the facet is a thin plate
//! between two large balls, as a surface triangle is), 2 when one ball reaches deep through the facet into the other, so
//! that no surface can pass. This is `1 - min(cos phi, cos psi)` of Labatut, Pons & Keriven 2009 with the sign that lets it
//! tell the two cases of obtuse facets apart.
//!
//! Ghosts count as perfect half-spaces (depth 1); so do flat tetrahedra, whose ball is undetermined and must not speak.

use super::balls::Balls;
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::TetId;
use rayon::prelude::*;

/// Own-side depths of all facets, indexed by tetrahedron and facet.
#[derive(Clone, Debug, Default)]
pub struct FacetDepths {
    depth: Vec<[f32; 4]>,
}

impl FacetDepths {
    /// Computes all depths. `O(n)`, parallel.
    pub fn new(triangulation: &Triangulation, balls: &Balls) -> Self {
        let finite = triangulation.num_finite();
        let depth = (0..triangulation.num_tets() as u32)
            .into_par_iter()
            .map(|t| {
                if t as usize >= finite || balls.flat[t as usize] {
                    [1.0; 4]
                } else {
                    depths(triangulation, balls, TetId(t))
                }
            })
            .collect();
        Self { depth }
    }

    /// Own-side height of the circumcentre over the facet, over the circumradius, in `-1..=1`.
    #[inline]
    pub fn depth(&self, facet: Facet) -> f32 {
        self.depth[facet.tet.index()][facet.index as usize]
    }

    /// The weight `w` of a facet, the same from both sides, in `0..=2`.
    #[inline]
    pub fn weight(&self, triangulation: &Triangulation, facet: Facet) -> f32 {
        1.0 - self.depth(facet).min(self.depth(triangulation.mirror(facet)))
    }

    /// Whether the smallest sphere through the facet's vertices is empty (its dual curve has its source on the facet).
    #[inline]
    pub fn is_gabriel(&self, triangulation: &Triangulation, facet: Facet) -> bool {
        self.depth(facet) >= 0.0 && self.depth(triangulation.mirror(facet)) >= 0.0
    }
}

fn depths(triangulation: &Triangulation, balls: &Balls, tet: TetId) -> [f32; 4] {
    let centre = balls.centres[tet.index()];
    let radius = balls.radii[tet.index()];
    let mut out = [1.0f32; 4];
    for (index, slot) in out.iter_mut().enumerate() {
        let [a, b, c] = triangulation
            .facet_vertices(Facet {
                tet,
                index: index as u8,
            })
            .map(|v| triangulation.points[v.index()]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        *slot = ((a - centre).dot(normal) / radius).clamp(-1.0, 1.0) as f32;
    }
    out
}
