//! How thick the part of the solid is that a medial point belongs to: what a tolerance relative to the radius is relative to.
//!
//! In: the fine scaffold. Out: a radius for every vertex, at least its own.
//!
//! The small balls of an edge or a corner say nothing of how thick the solid is there: along a sharp edge their radius goes to
//! zero, and so would a tolerance that is a share of it, so that no edge could ever be given up. Local thickness in the
//! sense of Hildebrand & Ruegsegger, "A new method for the model-independent assessment of thickness in three-dimensional images" (1997), is
//! the radius of the largest ball that holds a point. No large ball holds the points of an edge, so here it is the largest one that comes within
//! its own radius of the whole small ball, which reaches the corner of a cube (`1.73 r` from the centre of the ball in it); and it must be joined to the small one
//! by medial points that it reaches as well, or a thick part would lend its radius to a thin one that runs beside it.
//!
//! Balls are taken from the largest down. One that lies within half the radius of a larger one already taken reaches nothing new of note
//! and is passed over. Cost: `O(n log n)` to sort, and for each vertex as many visits as balls of half overlap reach it.

use crate::fine_scaffold::FineScaffold;
use std::collections::VecDeque;

/// A ball reaches medial balls that lie within this many of its radii of its centre.
const REACH: f64 = 2.0;
/// A ball within this many radii of the centre of a larger one that was taken is not taken.
const APART: f64 = 0.5;

/// The radius of the part that each vertex belongs to, mm.
pub(crate) fn part_radii(fine: &FineScaffold) -> Vec<f64> {
    let n = fine.num_vertices();
    let mut part = fine.vertex_radius.clone();
    let mut order: Vec<u32> = (0..n as u32)
        .filter(|&v| !fine.vertex_outside[v as usize])
        .collect();
    order.sort_by(|&a, &b| {
        let r = |v: u32| fine.vertex_radius[v as usize];
        r(b).total_cmp(&r(a)).then(a.cmp(&b))
    });
    let mut beside = vec![false; n];
    let mut seen = vec![u32::MAX; n];
    let mut open = VecDeque::new();
    for u in order {
        if beside[u as usize] {
            continue;
        }
        let (centre, radius) = (fine.vertex_position[u as usize], fine.vertex_radius[u as usize]);
        open.push_back(u);
        seen[u as usize] = u;
        while let Some(v) = open.pop_front() {
            part[v as usize] = part[v as usize].max(radius);
            let away = centre.distance(fine.vertex_position[v as usize]);
            beside[v as usize] |= away <= APART * radius;
            for e in fine.edges_of_vertex(v as usize) {
                let w = fine.other_end(e as usize, v);
                let reached = || {
                    let away = centre.distance(fine.vertex_position[w as usize]);
                    away + fine.vertex_radius[w as usize] <= REACH * radius
                };
                if seen[w as usize] != u && reached() {
                    seen[w as usize] = u;
                    open.push_back(w);
                }
            }
        }
    }
    part
}
