//! Canonical numbering: vertices in lexicographic order of the points, tetrahedra in order of their vertices.
//!
//! In: tetrahedra as the insertion left them. Out: [`Triangulation`], which no longer shows how it was built. Steps:
//! (1) rename vertices, (2) rotate every tetrahedron by an even permutation so that its smallest vertex comes first and the
//! next smallest second (ghosts: smallest first, infinite last), (3) sort, finite before ghosts, (4) rename neighbours.

use super::insertion::INF;
use super::triangulation::{INFINITE, Triangulation};
use crate::geometry::VertexId;
use glam::DVec3;

/// Builds the canonical triangulation. `order[i]` is the lexicographic index of insertion vertex `i`; `free` lists slots
/// that hold no tetrahedron.
pub(super) fn canonical(
    points: Vec<DVec3>,
    order: &[u32],
    vertices: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    free: &[u32],
) -> Triangulation {
    let mut alive = vec![true; vertices.len()];
    for &f in free {
        alive[f as usize] = false;
    }
    let mut keyed: Vec<([u32; 4], u32)> = Vec::with_capacity(vertices.len());
    let mut places: Vec<[u8; 4]> = vec![[0; 4]; vertices.len()];
    for (t, v) in vertices.iter().enumerate().filter(|&(t, _)| alive[t]) {
        let renamed = v.map(|i| if i == INF { INF } else { order[i as usize] });
        places[t] = rotation(renamed);
        keyed.push((places[t].map(|k| renamed[k as usize]), t as u32));
    }
    keyed.sort_unstable_by_key(|&(v, _)| (v[3] == INF, v));
    let mut id = vec![u32::MAX; vertices.len()];
    for (new, &(_, old)) in keyed.iter().enumerate() {
        id[old as usize] = new as u32;
    }
    let rename = |packed: u32| {
        let old = (packed >> 2) as usize;
        let place = places[old].iter().position(|&k| u32::from(k) == packed & 3);
        4 * id[old] + place.expect("a permutation of four places") as u32
    };
    Triangulation {
        points,
        dimension: 3,
        finite: keyed.partition_point(|(v, _)| v[3] != INF) as u32,
        neighbours: keyed
            .iter()
            .map(|&(_, old)| places[old as usize].map(|k| rename(neighbours[old as usize][k as usize])))
            .collect(),
        vertices: keyed
            .iter()
            .map(|(v, _)| v.map(|i| if i == INF { INFINITE } else { VertexId(i) }))
            .collect(),
    }
}

/// The even permutation that brings the smallest vertex first and the next smallest second; for a ghost the smallest
/// first and the infinite vertex last.
fn rotation(v: [u32; 4]) -> [u8; 4] {
    /// For each first place, the other three in the cyclic order that keeps the orientation.
    const REST: [[u8; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
    let first = (0..4u8).min_by_key(|&k| v[k as usize]).expect("four places");
    let [a, b, c] = REST[first as usize];
    let [x, y, z] = [a, b, c].map(|k| v[k as usize]);
    let infinite = v[3] == INF;
    // A ghost keeps the infinite vertex last, a finite tetrahedron puts its second smallest vertex second.
    if (infinite && z == INF) || (!infinite && x < y && x < z) {
        [first, a, b, c]
    } else if (infinite && x == INF) || (!infinite && y < z) {
        [first, b, c, a]
    } else {
        [first, c, a, b]
    }
}
