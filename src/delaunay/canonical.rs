//! Canonical numbering: vertices in lexicographic order of the points, tetrahedra in order of their vertices.
//!
//! In: tetrahedra as the insertion left them. Out: [`Triangulation`], which no longer shows how it was built. Steps:
//! 1. rename the vertices of every tetrahedron and rotate it by an even permutation, so that its smallest vertex comes first
//!    and the next smallest second (ghosts: smallest first, infinite last); count the tetrahedra of each smallest vertex;
//! 2. deal finite tetrahedra into one bucket for each smallest vertex and sort each bucket (about seven); a task does this
//!    for a range of vertices and passes over all tetrahedra, which costs little beside dealing them; sort the ghosts;
//! 3. rename neighbours, in the old order: the tetrahedra around each other are then near in memory, and each new place is
//!    met once. The words are atomic so that threads can share the array; on common processors their stores are plain ones.
//!
//! Cost: `O(n)` besides buckets and ghosts; the old and the new arrays are never all in memory at once. A third of the time
//! is the system's, handing out pages, and another third waits for lines of memory of the scattered writes: neither huge
//! pages (slow to be had on virtual machines), nor curves cut into slabs of x (the insertion loses more), nor counting in
//! vector registers (buckets are too small) made it faster.

use super::insertion::INF;
use super::triangulation::Triangulation;
use crate::geometry::VertexId;
use glam::DVec3;
use rayon::prelude::*;
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

/// In place of [`PLACES`]: the slot holds no tetrahedron.
const DEAD: u8 = 0;

/// Buckets up to this size are ordered by counting smaller elements, which needs no branches.
const SMALL: usize = 24;

/// Threads that count for themselves.
const MOST_COUNTS: usize = 8;

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
    let Renamed {
        places,
        mut ends,
        finite,
        ghosts,
    } = rename(&mut vertices, order);
    let total = finite + ghosts.len();
    let mut records = vec![[0u32; 4]; total];
    let id: Vec<AtomicU32> = zeros::<u32>(slots).into_iter().map(AtomicU32::new).collect();
    let (finite_records, ghost_records) = records.split_at_mut(finite);
    buckets(&mut ends, finite_records)
        .into_par_iter()
        .for_each(|mut buckets| {
            buckets.deal(&vertices);
            buckets.sort(&id);
        });
    number_ghosts(&vertices, &ghosts, ghost_records, finite as u32, &id);
    drop((ends, ghosts));

    // The old vertices are done with; their room serves the new neighbours.
    let out: Vec<[AtomicU32; 4]> = vertices
        .into_iter()
        .map(|[a, b, c, d]| [a, b, c, d].map(AtomicU32::new))
        .collect();
    (
        neighbours.par_chunks(CHUNK),
        places.par_chunks(CHUNK),
        id.par_chunks(CHUNK),
    )
        .into_par_iter()
        .for_each(|(neighbours, own, new)| {
            let tets = neighbours.iter().zip(own).zip(new);
            for ((across, &own), new) in tets.filter(|((_, own), _)| **own != DEAD) {
                let words = &out[new.load(Relaxed) as usize];
                for k in 0..4 {
                    let other = (across[k] >> 2) as usize;
                    let facet = place(places[other], across[k] & 3);
                    words[place(own, k as u32) as usize].store(4 * id[other].load(Relaxed) + facet, Relaxed);
                }
            }
        });
    drop((neighbours, id, places));
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

/// Elements to make room for when `len` are needed: at least 48 MiB when that is not little. Allocators hand such blocks out
/// page by page as they are touched and give them back to the system at once, where smaller ones stay with the process.
fn capacity<T>(len: usize) -> usize {
    if len < 1 << 16 {
        len
    } else {
        len.max((48 << 20) / size_of::<T>())
    }
}

/// An empty vector in such a block.
pub(super) fn room<T>(len: usize) -> Vec<T> {
    Vec::with_capacity(capacity::<T>(len))
}

/// `len` zeros in such a block, not touched yet.
pub(super) fn zeros<T: Clone + Default>(len: usize) -> Vec<T> {
    let mut v = vec![T::default(); capacity::<T>(len)];
    v.truncate(len);
    v
}

/// What step 1 gives beside the renamed vertices.
struct Renamed {
    /// The rotation of every tetrahedron, as in [`PLACES`].
    places: Vec<u8>,
    /// For each vertex the number of finite tetrahedra whose smallest vertex is smaller: where its bucket begins. Dealing
    /// moves each beginning to its end.
    ends: Vec<u32>,
    /// Number of finite tetrahedra.
    finite: usize,
    /// Slots that hold ghosts, in order.
    ghosts: Vec<u32>,
}

/// Step 1 for all tetrahedra. Every thread counts for itself, as long as the counts of all find room beside what is there.
fn rename(vertices: &mut [[u32; 4]], order: Vec<u32>) -> Renamed {
    let mut places: Vec<u8> = zeros(vertices.len());
    let threads = rayon::current_num_threads().min(MOST_COUNTS);
    let part = vertices.len().div_ceil(threads).max(CHUNK);
    let mut counts: Vec<(Vec<u32>, Vec<u32>)> = (vertices.par_chunks_mut(part), places.par_chunks_mut(part))
        .into_par_iter()
        .enumerate()
        .map(|(i, (tets, places))| {
            let mut counts: Vec<u32> = zeros(order.len());
            let mut ghosts = Vec::new();
            let first = (i * part) as u32;
            for ((v, places), slot) in tets.iter_mut().zip(places).zip(first..) {
                (*v, *places) = renamed(*v, &order);
                if v[3] != INF {
                    counts[v[0] as usize] += 1;
                } else if v[0] != INF {
                    ghosts.push(slot);
                }
            }
            (counts, ghosts)
        })
        .collect();
    let ghosts = counts.iter().flat_map(|(_, ghosts)| ghosts).copied().collect();
    let (mut ends, _) = counts.swap_remove(0);
    for (more, _) in &counts {
        (ends.par_chunks_mut(CHUNK), more.par_chunks(CHUNK))
            .into_par_iter()
            .for_each(|(ends, more)| ends.iter_mut().zip(more).for_each(|(e, m)| *e += m));
    }
    let mut finite = 0;
    for end in &mut ends {
        (*end, finite) = (finite, finite + *end);
    }
    Renamed {
        places,
        ends,
        finite: finite as usize,
        ghosts,
    }
}

/// Step 1 for one tetrahedron: its vertices in canonical order and the rotation that brought them there.
#[inline(always)]
fn renamed(v: [u32; 4], order: &[u32]) -> ([u32; 4], u8) {
    if v[0] == INF {
        return (v, DEAD);
    }
    let rename = |i: u32| if i == INF { INF } else { order[i as usize] };
    let v = [rename(v[0]), rename(v[1]), rename(v[2]), rename(v[3])];
    let r = rotation(v) as usize;
    let [a, b, c, d] = EVEN[r];
    (
        [v[a as usize], v[b as usize], v[c as usize], v[d as usize]],
        PLACES[r],
    )
}

/// Step 2 for the finite tetrahedra whose smallest vertices are in a range.
struct Buckets<'a> {
    /// The first of these vertices.
    first: u32,
    /// Number of the first of these tetrahedra.
    start: u32,
    /// Where each vertex' bucket begins, after [`Self::deal`] where it ends.
    ends: &'a mut [u32],
    /// The buckets.
    records: &'a mut [[u32; 4]],
}

/// Ranges with about equally many tetrahedra, one a thread; `begins` is where buckets begin among `records`.
fn buckets<'a>(mut begins: &'a mut [u32], mut records: &'a mut [[u32; 4]]) -> Vec<Buckets<'a>> {
    let threads = rayon::current_num_threads();
    let all = records.len();
    let mut out = Vec::with_capacity(threads);
    let (mut first, mut start) = (0, 0);
    for i in 1..=threads {
        let last = all * i / threads;
        let vertices = begins.partition_point(|&b| (b as usize) < last);
        let vertices = if i == threads { begins.len() } else { vertices };
        let (ends, others) = begins.split_at_mut(vertices);
        let size = others.first().map_or(all, |&b| b as usize) - start;
        let (part, rest) = records.split_at_mut(size);
        out.push(Buckets {
            first,
            start: start as u32,
            ends,
            records: part,
        });
        (begins, records) = (others, rest);
        first += vertices as u32;
        start += size;
    }
    out
}

impl Buckets<'_> {
    /// Deals records into buckets: the three vertices after the first, and the old number.
    fn deal(&mut self, vertices: &[[u32; 4]]) {
        for (old, &v) in (0u32..).zip(vertices) {
            let bucket = v[0].wrapping_sub(self.first) as usize;
            if v[3] != INF
                && let Some(end) = self.ends.get_mut(bucket)
            {
                self.records[(*end - self.start) as usize] = [v[1], v[2], v[3], old];
                *end += 1;
            }
        }
    }

    /// Sorts the buckets, notes the new number of each tetrahedron and completes the records to four vertices.
    fn sort(&mut self, id: &[AtomicU32]) {
        let mut begin = 0;
        for (first, &end) in (self.first..).zip(&*self.ends) {
            let end = (end - self.start) as usize;
            let run = &mut self.records[begin..end];
            sort_run(run);
            for (new, record) in (self.start + begin as u32..).zip(run) {
                let [x, y, z, old] = *record;
                id[old as usize].store(new, Relaxed);
                *record = [first, x, y, z];
            }
            begin = end;
        }
    }
}

/// Step 2 for the ghosts in the given slots, few unless the cloud is convex; numbers begin at `start`.
fn number_ghosts(
    vertices: &[[u32; 4]],
    ghosts: &[u32],
    records: &mut [[u32; 4]],
    start: u32,
    id: &[AtomicU32],
) {
    records.par_iter_mut().zip(ghosts).for_each(|(record, &slot)| {
        let [a, b, c, _] = vertices[slot as usize];
        *record = [a, b, c, slot];
    });
    records.par_sort_unstable_by_key(key);
    records
        .par_iter_mut()
        .zip(start..start + ghosts.len() as u32)
        .for_each(|(record, new)| {
            id[record[3] as usize].store(new, Relaxed);
            record[3] = INF;
        });
}

/// A record as one number: three vertices, then the old name, which never decides.
#[inline(always)]
fn key(&[x, y, z, old]: &[u32; 4]) -> u128 {
    u128::from(x) << 96 | u128::from(y) << 64 | u128::from(z) << 32 | u128::from(old)
}

/// Sorts one bucket by vertices.
#[inline(always)]
fn sort_run(run: &mut [[u32; 4]]) {
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

/// The new place of each old place, two bits each: inverses of [`EVEN`]. None is zero.
const PLACES: [u8; 12] = {
    let mut places = [0; 12];
    let mut r = 0;
    while r < 12 {
        let mut k = 0;
        while k < 4 {
            places[r] |= (k as u8) << (2 * EVEN[r][k]);
            k += 1;
        }
        r += 1;
    }
    places
};

/// The new place of an old one, by an entry of [`PLACES`].
#[inline(always)]
fn place(places: u8, old: u32) -> u32 {
    u32::from(places) >> (2 * old) & 3
}

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
