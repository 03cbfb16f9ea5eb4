//! Canonical numbering: vertices in lexicographic order of the points, tetrahedra in order of their vertices.
//!
//! In: tetrahedra as the insertion left them. Out: [`Triangulation`], which no longer shows how it was built. Steps:
//! 1. rename the vertices of every tetrahedron and rotate it by an even permutation, so that its smallest vertex comes first
//!    and the next smallest second (ghosts: smallest first, infinite last);
//! 2. deal tetrahedra into one bucket for each smallest vertex, finite before ghosts, and sort each bucket (about seven);
//! 3. rename neighbours.
//!
//! Cost: `O(n)` besides the buckets; the old and the new arrays are never all in memory at once.

use super::insertion::INF;
use super::triangulation::Triangulation;
use crate::geometry::VertexId;
use glam::DVec3;

/// The twelve even permutations, as the old place of each new place: first place, then which of the other three is second.
const EVEN: [[u8; 4]; 12] = [
    [0, 1, 2, 3],
    [0, 2, 3, 1],
    [0, 3, 1, 2],
    [1, 0, 3, 2],
    [1, 3, 2, 0],
    [1, 2, 0, 3],
    [2, 0, 1, 3],
    [2, 1, 3, 0],
    [2, 3, 0, 1],
    [3, 0, 2, 1],
    [3, 2, 1, 0],
    [3, 1, 0, 2],
];

/// In place of a rotation: the slot holds no tetrahedron.
const DEAD: u8 = u8::MAX;

/// Builds the canonical triangulation. `order[i]` is the lexicographic index of insertion vertex `i`; slots
/// without a tetrahedron hold the infinite vertex only.
pub(super) fn canonical(
    points: Vec<DVec3>,
    order: &[u32],
    mut vertices: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
) -> Triangulation {
    // Step 1, counting the buckets: bucket v holds finite tetrahedra, bucket n + v ghosts.
    let n = points.len();
    let mut ends = vec![0u32; 2 * n + 1];
    let rotations: Vec<u8> = vertices
        .iter_mut()
        .map(|v| {
            if v[0] == INF {
                return DEAD;
            }
            let rename = |i: u32| if i == INF { INF } else { order[i as usize] };
            let renamed = [rename(v[0]), rename(v[1]), rename(v[2]), rename(v[3])];
            let r = rotation(renamed);
            let [a, b, c, d] = EVEN[r as usize];
            *v = [
                renamed[a as usize],
                renamed[b as usize],
                renamed[c as usize],
                renamed[d as usize],
            ];
            ends[bucket(*v, n) + 1] += 1;
            r
        })
        .collect();
    for i in 0..2 * n {
        ends[i + 1] += ends[i];
    }
    let finite = ends[n];
    let total = ends[2 * n] as usize;

    // Step 2: records of the three vertices after the first, and the old number.
    let mut records = vec![[0u32; 4]; total];
    for (old, v) in vertices.iter().enumerate().filter(|(_, v)| v[0] != INF) {
        let end = &mut ends[bucket(*v, n)];
        records[*end as usize] = [v[1], v[2], v[3], old as u32];
        *end += 1;
    }
    let slots = vertices.len();
    let mut id = vec![0u32; slots];
    let mut start = 0;
    for b in 0..2 * n {
        let end = ends[b] as usize;
        let run = &mut records[start..end];
        // As one number each: three vertices, then the old name, which never decides.
        run.sort_unstable_by_key(|&[x, y, z, old]| {
            u128::from(x) << 96 | u128::from(y) << 64 | u128::from(z) << 32 | u128::from(old)
        });
        for (new, record) in (start as u32..).zip(run) {
            let [x, y, z, old] = *record;
            id[old as usize] = new;
            *record = [(b % n) as u32, x, y, z];
        }
        start = end;
    }
    drop(ends);

    // Step 3.
    // The old vertices are done with; their room serves the new neighbours.
    let mut out = vertices;
    for (old, across) in neighbours
        .iter()
        .enumerate()
        .filter(|&(old, _)| rotations[old] != DEAD)
    {
        let rename = |k: u8| {
            let packed = across[k as usize];
            let other = (packed >> 2) as usize;
            4 * id[other] + u32::from(NEW_PLACE[rotations[other] as usize][(packed & 3) as usize])
        };
        let [a, b, c, d] = EVEN[rotations[old] as usize];
        out[id[old] as usize] = [rename(a), rename(b), rename(c), rename(d)];
    }
    drop(neighbours);
    out.truncate(total);
    out.shrink_to_fit();
    Triangulation {
        points,
        dimension: 3,
        finite,
        neighbours: out,
        vertices: records
            .into_iter()
            .map(|[a, b, c, d]| [VertexId(a), VertexId(b), VertexId(c), VertexId(d)])
            .collect(),
    }
}

/// The new place of each old place: inverses of [`EVEN`].
const NEW_PLACE: [[u8; 4]; 12] = {
    let mut inverse = [[0; 4]; 12];
    let mut r = 0;
    while r < 12 {
        let mut k = 0;
        while k < 4 {
            inverse[r][EVEN[r][k] as usize] = k as u8;
            k += 1;
        }
        r += 1;
    }
    inverse
};

#[inline(always)]
fn bucket(v: [u32; 4], n: usize) -> usize {
    v[0] as usize + if v[3] == INF { n } else { 0 }
}

/// Which of [`EVEN`] brings the smallest vertex first and the next smallest second; for a ghost the smallest first and the
/// infinite vertex last.
#[inline(always)]
fn rotation(v: [u32; 4]) -> u8 {
    let first = if v[0] < v[1] && v[0] < v[2] && v[0] < v[3] {
        0
    } else if v[1] < v[2] && v[1] < v[3] {
        1
    } else if v[2] < v[3] {
        2
    } else {
        3
    };
    let second = |r: u8| v[EVEN[r as usize][1] as usize];
    let last = |r: u8| v[EVEN[r as usize][3] as usize];
    let [p, q, r] = [3 * first, 3 * first + 1, 3 * first + 2];
    if v[3] == INF {
        return if last(p) == INF {
            p
        } else if last(q) == INF {
            q
        } else {
            r
        };
    }
    let [x, y, z] = [second(p), second(q), second(r)];
    if x < y && x < z {
        p
    } else if y < z {
        q
    } else {
        r
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_permutations_are_even() {
        for (r, p) in EVEN.iter().enumerate() {
            let inversions = (0..4)
                .flat_map(|i| (0..i).map(move |j| (j, i)))
                .filter(|&(j, i)| p[j] > p[i])
                .count();
            assert_eq!(inversions % 2, 0, "{p:?}");
            assert_eq!(usize::from(p[0]), r / 3);
        }
    }
}
