//! Thickness at every generator: the diameter of the medial ball that touches it.
//!
//! In: the fine scaffold and what regularisation left of it. Out: one diameter a generator, mm, NaN where a generator has no
//! tetrahedron of the side.
//!
//! 1. A generator that still touches medial balls takes the largest of them: the pole of its Voronoi cell, which converges to the
//!    medial ball as the sampling gets denser (Amenta, Choi & Kolluri 2001).
//! 2. Any other takes the ball whose boundary is nearest, at most the tolerance away.
//!
//! Regularised, so that a dent of the surface does not make it thin. Near a ridge the value is the ridge's diameter of
//! curvature, not the distance to an opposite wall. Cost `O(n log n)`.

use crate::fine_scaffold::FineScaffold;
use crate::regularise::Regularised;
use crate::regularise::balls::BallTree;
use rayon::prelude::*;

/// Thickness at every generator, mm; see the module.
pub fn thickness(fine: &FineScaffold, regularised: &Regularised) -> Vec<f64> {
    let is_alive = |v: u32| regularised.alive.vertices[v as usize];
    let mut takes_part = vec![false; fine.generator_position.len()];
    let mut touching = vec![0.0f64; fine.generator_position.len()];
    for (ends, generators) in fine.edge_vertices.iter().zip(&fine.edge_generators) {
        let radius = ends
            .iter()
            .filter(|&&v| is_alive(v))
            .map(|&v| fine.vertex_radius[v as usize]);
        let radius = radius.fold(0.0, f64::max);
        for g in generators {
            takes_part[g.index()] = true;
            touching[g.index()] = touching[g.index()].max(radius);
        }
    }
    let alive: Vec<u32> = (0..fine.num_vertices() as u32).filter(|&v| is_alive(v)).collect();
    let tree = BallTree::new(alive, &fine.vertex_position, &fine.vertex_radius);
    (0..fine.generator_position.len())
        .into_par_iter()
        .map(|g| match (takes_part[g], touching[g]) {
            (false, _) => f64::NAN,
            (true, radius) if radius > 0.0 => 2.0 * radius,
            _ => tree
                .nearest(fine.generator_position[g], None, |_| true)
                .map_or(f64::NAN, |ball| 2.0 * fine.vertex_radius[ball.id as usize]),
        })
        .collect()
}
