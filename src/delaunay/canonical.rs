//! Canonical numbering: vertices in lexicographic order of the points, tetrahedra in order of their vertices.
//!
//! In: tetrahedra as the insertion left them. Out: [`Triangulation`], which no longer shows how it was built. Steps:
//! 1. rename the vertices of every tetrahedron and rotate it by an even permutation, so that its smallest vertex comes first
//!    and the next smallest second (ghosts: smallest first, infinite last);
//! 2. deal tetrahedra into one bucket for each smallest vertex, finite before ghosts, and sort each bucket (about seven); a
//!    task does this for a range of vertices and passes over all tetrahedra, which costs little beside dealing them;
//! 3. rename neighbours, in the old order: the tetrahedra around each other are then near in memory, and each new place is
//!    met once. The words are atomic so that threads can share the array; on common processors their stores are plain ones.
//!
//! Cost: `O(n)` besides the buckets; the old and the new arrays are never all in memory at once.

use super::insertion::INF;
use super::triangulation::Triangulation;
use crate::geometry::VertexId;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

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

/// Buckets up to this size are ordered by counting smaller elements, which needs no branches.
const SMALL: usize = 24;

/// Tetrahedra renamed by one task at a time.
const CHUNK: usize = 1 << 14;

/// Builds the canonical triangulation. `order[i]` is the lexicographic index of insertion vertex `i`; slots without a
/// tetrahedron hold the infinite vertex only.
pub(super) fn canonical(
    points: Vec<DVec3>,
    order: Vec<u32>,
    mut vertices: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
) -> Triangulation {
    let slots = vertices.len();
    let mut rotations: Vec<u8> = zeros(slots);
    vertices
        .par_chunks_mut(CHUNK)
        .zip(rotations.par_chunks_mut(CHUNK))
        .for_each(|(tets, rotations)| {
            for (v, r) in tets.iter_mut().zip(rotations) {
                (*v, *r) = renamed(*v, &order);
            }
        });

    drop(order);
    let mut tasks = tasks(points.len());
    tasks.par_iter_mut().for_each(|task| task.count(&vertices));
    let total: usize = tasks.iter().map(Task::size).sum();
    let finite: usize = tasks.iter().filter(|t| !t.ghosts).map(Task::size).sum();
    let mut records = vec![[0u32; 4]; total];
    let id: Vec<AtomicU32> = zeros::<u32>(slots).into_iter().map(AtomicU32::new).collect();
    let mut parts = Vec::with_capacity(tasks.len());
    let (mut rest, mut start) = (records.as_mut_slice(), 0);
    for task in &mut tasks {
        let (part, others) = rest.split_at_mut(task.size());
        rest = others;
        let size = task.size() as u32;
        parts.push((task, part, start));
        start += size;
    }
    parts.into_par_iter().for_each(|(task, part, start)| {
        task.deal(&vertices, part);
        task.sort(part, start, &id);
    });
    drop(tasks);

    // The old vertices are done with; their room serves the new neighbours.
    let out: Vec<[AtomicU32; 4]> = vertices
        .into_iter()
        .map(|[a, b, c, d]| [a, b, c, d].map(AtomicU32::new))
        .collect();
    (
        neighbours.par_chunks(CHUNK),
        rotations.par_chunks(CHUNK),
        id.par_chunks(CHUNK),
    )
        .into_par_iter()
        .for_each(|(neighbours, own, new)| {
            let tets = neighbours.iter().zip(own).zip(new);
            for ((across, &r), new) in tets.filter(|((_, r), _)| **r != DEAD) {
                let place = &out[new.load(Relaxed) as usize];
                for (k, word) in EVEN[r as usize].iter().zip(place) {
                    let packed = across[*k as usize];
                    let other = (packed >> 2) as usize;
                    let facet = NEW_PLACE[rotations[other] as usize % 12][(packed & 3) as usize];
                    word.store(4 * id[other].load(Relaxed) + u32::from(facet), Relaxed);
                }
            }
        });
    drop((neighbours, id, rotations));
    let mut neighbours: Vec<[u32; 4]> = out
        .into_iter()
        .map(|words| words.map(AtomicU32::into_inner))
        .collect();
    neighbours.truncate(total);
    neighbours.shrink_to_fit();
    Triangulation {
        points,
        dimension: 3,
        finite: finite as u32,
        neighbours,
        vertices: records
            .into_iter()
            .map(|[a, b, c, d]| [VertexId(a), VertexId(b), VertexId(c), VertexId(d)])
            .collect(),
    }
}

/// An empty vector for `len` elements, with room for at least 48 MiB when that is not little: allocators hand such blocks out
/// page by page as they are touched and give them back to the system at once, where smaller ones stay with the process.
pub(super) fn room<T>(len: usize) -> Vec<T> {
    if len < 1 << 16 {
        Vec::with_capacity(len)
    } else {
        Vec::with_capacity(len.max((48 << 20) / size_of::<T>()))
    }
}

/// `len` zeros in such a block.
pub(super) fn zeros<T: Clone + Default>(len: usize) -> Vec<T> {
    let mut v = room(len);
    v.resize(len, T::default());
    v
}

/// Step 1 for one tetrahedron: its vertices in canonical order and the rotation that brought them there.
#[inline(always)]
fn renamed(v: [u32; 4], order: &[u32]) -> ([u32; 4], u8) {
    if v[0] == INF {
        return (v, DEAD);
    }
    let rename = |i: u32| if i == INF { INF } else { order[i as usize] };
    let v = [rename(v[0]), rename(v[1]), rename(v[2]), rename(v[3])];
    let r = rotation(v);
    let [a, b, c, d] = EVEN[r as usize];
    ([v[a as usize], v[b as usize], v[c as usize], v[d as usize]], r)
}

/// Step 2 for the tetrahedra, finite or ghosts, whose smallest vertices are in a range.
struct Task {
    ghosts: bool,
    range: Range<u32>,
    /// Ends of the buckets, one a vertex, after [`Self::count`] where they begin.
    ends: Vec<u32>,
    size: u32,
}

/// Ranges of about equal size, as many as there are threads, first for finite tetrahedra, then for ghosts.
fn tasks(points: usize) -> Vec<Task> {
    let count = rayon::current_num_threads().min(points);
    let bound = |i: usize| (points * i / count) as u32;
    [false, true]
        .into_iter()
        .flat_map(|ghosts| (0..count).map(move |i| (ghosts, bound(i)..bound(i + 1))))
        .map(|(ghosts, range)| Task {
            ghosts,
            range,
            ends: Vec::new(),
            size: 0,
        })
        .collect()
}

impl Task {
    fn size(&self) -> usize {
        self.size as usize
    }

    /// The bucket of a tetrahedron, if it is one of this task's.
    #[inline(always)]
    fn bucket(&self, v: [u32; 4]) -> Option<usize> {
        let place = v[0].wrapping_sub(self.range.start);
        ((place < self.range.len() as u32) & ((v[3] == INF) == self.ghosts)).then_some(place as usize)
    }

    /// Counts the tetrahedra of every bucket.
    fn count(&mut self, vertices: &[[u32; 4]]) {
        let mut ends = zeros::<u32>(self.range.len());
        for &v in vertices {
            if let Some(bucket) = self.bucket(v) {
                ends[bucket] += 1;
            }
        }
        for end in &mut ends {
            let begin = self.size;
            self.size += *end;
            *end = begin;
        }
        self.ends = ends;
    }

    /// Deals records into buckets: the three vertices after the first, and the old number.
    fn deal(&mut self, vertices: &[[u32; 4]], part: &mut [[u32; 4]]) {
        for (old, &v) in (0u32..).zip(vertices) {
            if let Some(bucket) = self.bucket(v) {
                let end = &mut self.ends[bucket];
                part[*end as usize] = [v[1], v[2], v[3], old];
                *end += 1;
            }
        }
    }

    /// Sorts the buckets, notes the new number of each tetrahedron and completes the records to four vertices; `start` is the
    /// number of the first.
    fn sort(&mut self, part: &mut [[u32; 4]], start: u32, id: &[AtomicU32]) {
        let mut begin = 0;
        for (first, &end) in self.range.clone().zip(&self.ends) {
            let run = &mut part[begin..end as usize];
            sort_run(run);
            for (new, record) in (start + begin as u32..).zip(run) {
                let [x, y, z, old] = *record;
                id[old as usize].store(new, Relaxed);
                *record = [first, x, y, z];
            }
            begin = end as usize;
        }
        self.ends = Vec::new();
    }
}

/// Sorts one bucket by vertices.
#[inline(always)]
fn sort_run(run: &mut [[u32; 4]]) {
    // As one number each: three vertices, then the old name, which never decides.
    let key = |&[x, y, z, old]: &[u32; 4]| {
        u128::from(x) << 96 | u128::from(y) << 64 | u128::from(z) << 32 | u128::from(old)
    };
    let n = run.len();
    if n > SMALL {
        run.sort_unstable_by_key(key);
        return;
    }
    let mut copy = [[0u32; 4]; SMALL];
    let mut keys = [0u128; SMALL];
    let mut rank = [0u8; SMALL];
    for i in 0..n {
        copy[i] = run[i];
        keys[i] = key(&run[i]);
        for j in 0..i {
            let smaller = u8::from(keys[j] < keys[i]);
            rank[i] += smaller;
            rank[j] += 1 - smaller;
        }
    }
    for i in 0..n {
        run[rank[i] as usize] = copy[i];
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

/// Which of [`EVEN`] brings two old places, `4 * first + second`, to the front.
const TO_FRONT: [u8; 16] = {
    let mut table = [0; 16];
    let mut r = 0;
    while r < 12 {
        table[(4 * EVEN[r][0] + EVEN[r][1]) as usize] = r as u8;
        r += 1;
    }
    table
};

/// Which of [`EVEN`] brings an old place to the front and leaves the last where it is.
const LAST_STAYS: [u8; 4] = {
    let mut table = [0; 4];
    let mut r = 0;
    while r < 12 {
        if EVEN[r][3] == 3 {
            table[EVEN[r][0] as usize] = r as u8;
        }
        r += 1;
    }
    table
};

/// Which of [`EVEN`] brings the smallest vertex first and the next smallest second; for a ghost the smallest first and the
/// infinite vertex last.
#[inline(always)]
fn rotation(v: [u32; 4]) -> u8 {
    // Vertices have 27 bits, so their places fit below them, and the infinite one stays the largest.
    let [a, b, c, d] = [v[0] << 2, v[1] << 2 | 1, v[2] << 2 | 2, v[3] << 2 | 3];
    let (low, high) = (a.min(b), a.max(b));
    let (lower, higher) = (c.min(d), c.max(d));
    let first = low.min(lower);
    let second = low.max(lower).min(if low < lower { high } else { higher });
    if v[3] == INF {
        LAST_STAYS[(first & 3) as usize]
    } else {
        TO_FRONT[(4 * (first & 3) + (second & 3)) as usize]
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
