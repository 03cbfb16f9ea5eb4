//! Many threads inserting into one triangulation.
//!
//! In: a triangulation of the first rounds and the points of the others. Out: the triangulation of all but a few points, which
//! were given up and are left to one thread. Steps, for each round: (1) its points, which follow a Hilbert curve, are cut into
//! one stretch a thread, so that threads work far apart; (2) every thread inserts as alone, but takes each tetrahedron it
//! looks at by a compare-and-swap on its owner word before anything is written; meeting another thread's it lets go of
//! everything and puts the point off (Batista et al. 2010, "Parallel geometric algorithms for multi-core computers", lock
//! cells likewise); (3) a thread that is done helps with the stretches of others.
//!
//! All shared words are atomic, so no `unsafe` is needed; on common processors a relaxed load or store is a plain one. Data
//! of a tetrahedron is written while its owner word is held and published by releasing it. A walk reads without taking, so it
//! can lose its way among changes; the tetrahedron it ends in is taken and tested again. Freed slots stay owned, so a walk
//! that ends in one is refused. Which thread wins a race decides the numbering only: the set of tetrahedra is canonical.

use super::filter::Filter;
use super::insertion::Inserter;
use super::store::{Plain, Store};
use glam::DVec3;
use std::ops::Range;
use std::sync::atomic::{
    AtomicBool, AtomicU32, AtomicUsize, Ordering::Acquire, Ordering::Relaxed, Ordering::Release,
};

/// Points taken from a stretch at a time.
const CHUNK: usize = 64;

/// Slots a thread takes from the common store at a time.
const SLOTS: u32 = 1024;

/// The common store.
struct Shared {
    vertices: Vec<[AtomicU32; 4]>,
    neighbours: Vec<[AtomicU32; 4]>,
    /// 0 for a tetrahedron nobody holds; else the holder's tag and, in the low bits, what it knows.
    owners: Vec<AtomicU32>,
    /// First slot never used.
    next: AtomicU32,
    /// Set when a thread found no slot: all stop.
    full: AtomicBool,
}

/// Low bits of an owner word.
const TAKEN: u32 = 0;
const OUTSIDE: u32 = 1;
const INSIDE: u32 = 2;
/// A slot that holds no tetrahedron, or one that is being written.
const SLOT: u32 = 3;

/// The common store as one thread sees it.
struct Worker<'a> {
    shared: &'a Shared,
    tag: u32,
    free: Vec<u32>,
    fresh: Range<u32>,
}

fn load(words: &[AtomicU32; 4]) -> [u32; 4] {
    [
        words[0].load(Relaxed),
        words[1].load(Relaxed),
        words[2].load(Relaxed),
        words[3].load(Relaxed),
    ]
}

fn store(words: &[AtomicU32; 4], values: [u32; 4]) {
    for (word, value) in words.iter().zip(values) {
        word.store(value, Relaxed);
    }
}

impl Store for Worker<'_> {
    const SHARED: bool = true;

    #[inline(always)]
    fn tet(&self, tet: u32) -> [u32; 4] {
        load(&self.shared.vertices[tet as usize])
    }

    #[inline(always)]
    fn neighbours(&self, tet: u32) -> [u32; 4] {
        load(&self.shared.neighbours[tet as usize])
    }

    #[inline(always)]
    fn neighbour(&self, tet: u32, facet: usize) -> u32 {
        self.shared.neighbours[tet as usize][facet].load(Relaxed)
    }

    #[inline(always)]
    fn set_tet(&mut self, tet: u32, vertices: [u32; 4]) {
        store(&self.shared.vertices[tet as usize], vertices);
    }

    #[inline(always)]
    fn set_neighbours(&mut self, tet: u32, neighbours: [u32; 4]) {
        store(&self.shared.neighbours[tet as usize], neighbours);
    }

    #[inline(always)]
    fn set_neighbour(&mut self, facet: u32, neighbour: u32) {
        self.shared.neighbours[(facet >> 2) as usize][(facet & 3) as usize].store(neighbour, Relaxed);
    }

    #[inline(always)]
    fn begin(&mut self) {}

    #[inline(always)]
    fn take(&mut self, tet: u32) -> bool {
        let owner = &self.shared.owners[tet as usize];
        match owner.load(Relaxed) {
            0 => owner
                .compare_exchange(0, self.tag | TAKEN, Acquire, Relaxed)
                .is_ok(),
            word => word & !3 == self.tag && word & 3 != SLOT,
        }
    }

    #[inline(always)]
    fn visit(&mut self, tet: u32) -> usize {
        let owner = &self.shared.owners[tet as usize];
        let word = owner.load(Relaxed);
        let first = u32::from(word == self.tag | TAKEN);
        owner.store(word + first * OUTSIDE, Relaxed);
        first as usize
    }

    #[inline(always)]
    fn note(&mut self, tet: u32, inside: bool) {
        self.shared.owners[tet as usize].store(self.tag + OUTSIDE + u32::from(inside), Relaxed);
    }

    #[inline(always)]
    fn is_inside(&self, tet: u32) -> bool {
        self.shared.owners[tet as usize].load(Relaxed) == self.tag | INSIDE
    }

    #[inline(always)]
    fn is_outside(&self, tet: u32) -> bool {
        self.shared.owners[tet as usize].load(Relaxed) == self.tag | OUTSIDE
    }

    #[inline(always)]
    fn reserve(&mut self, needed: usize) -> bool {
        while self.free.len() + self.fresh.len() < needed {
            let start = self.shared.next.fetch_add(SLOTS, Relaxed);
            if u64::from(start) + u64::from(SLOTS) > self.shared.vertices.len() as u64 {
                self.shared.next.fetch_sub(SLOTS, Relaxed);
                self.shared.full.store(true, Relaxed);
                return false;
            }
            self.free.extend(self.fresh.clone());
            self.fresh = start..start + SLOTS;
        }
        true
    }

    #[inline(always)]
    fn slot(&mut self) -> u32 {
        let slot = self.free.pop().or_else(|| self.fresh.next());
        let slot = slot.expect("slots were reserved");
        self.shared.owners[slot as usize].store(self.tag | SLOT, Relaxed);
        slot
    }

    #[inline(always)]
    fn free(&mut self, tet: u32) {
        self.shared.owners[tet as usize].store(self.tag | SLOT, Relaxed);
        self.free.push(tet);
    }

    #[inline(always)]
    fn release(&mut self, tet: u32) {
        self.shared.owners[tet as usize].store(0, Release);
    }
}

/// Inserts the points of `rounds` (ranges of vertices, one after the other) with `threads` threads into a store that already
/// holds a triangulation; `room` is the number of slots to work in. Returns the store and the points given up.
pub(super) fn insert_rounds(
    plain: Plain,
    points: &[DVec3],
    filter: Filter,
    rounds: &[Range<u32>],
    threads: usize,
    room: usize,
) -> (Plain, Vec<u32>) {
    let start = plain.used().next().expect("a triangulation to start from");
    let next = plain.vertices.len() as u32;
    let shared = share(plain, room);
    let mut workers: Vec<(Worker, Inserter, Vec<u32>)> = (0..threads as u32)
        .map(|i| {
            let worker = Worker {
                shared: &shared,
                tag: (i + 1) << 2,
                free: Vec::new(),
                fresh: 0..0,
            };
            (worker, Inserter::new(points, filter, start), Vec::new())
        })
        .collect();
    debug_assert!(next <= shared.next.load(Relaxed));
    for round in rounds {
        insert_round(&mut workers, &shared.full, round.clone());
    }
    let mut free = Vec::new();
    let mut given_up = Vec::new();
    for (worker, _, put_off) in workers {
        free.extend(worker.free);
        free.extend(worker.fresh);
        given_up.extend(put_off);
    }
    given_up.sort_unstable();
    (unshare(shared, free), given_up)
}

/// One round: a stretch of points for each worker, then help for the others.
fn insert_round(workers: &mut [(Worker, Inserter, Vec<u32>)], full: &AtomicBool, round: Range<u32>) {
    let count = workers.len();
    let bound = |i: usize| round.start as usize + round.len() * i / count;
    let stretches: Vec<(AtomicUsize, usize)> = (0..count)
        .map(|i| (AtomicUsize::new(bound(i)), bound(i + 1)))
        .collect();
    let stretches = stretches.as_slice();
    rayon::scope(|scope| {
        for (i, (worker, inserter, put_off)) in workers.iter_mut().enumerate() {
            scope.spawn(move |_| {
                for k in 0..count {
                    let (cursor, end) = &stretches[(i + k) % count];
                    loop {
                        let from = cursor.fetch_add(CHUNK, Relaxed);
                        if from >= *end {
                            break;
                        }
                        for v in from as u32..(from + CHUNK).min(*end) as u32 {
                            if full.load(Relaxed) || !inserter.insert(worker, v) {
                                put_off.push(v);
                            }
                        }
                    }
                }
            });
        }
    });
}

/// Makes every word atomic and adds room. The arrays are converted in place.
fn share(plain: Plain, room: usize) -> Shared {
    let Plain {
        mut vertices,
        mut neighbours,
        free,
        ..
    } = plain;
    let used = vertices.len();
    let room = room.max(used);
    vertices.resize(room, [0; 4]);
    neighbours.resize(room, [0; 4]);
    let mut owners: Vec<AtomicU32> = Vec::new();
    owners.resize_with(room, AtomicU32::default);
    // Slots that one thread freed go to nobody in particular: they are sealed and come back at the end.
    for &slot in &free {
        owners[slot as usize].store(u32::MAX, Relaxed);
    }
    let atomic = |words: Vec<[u32; 4]>| {
        words
            .into_iter()
            .map(|[a, b, c, d]| [a, b, c, d].map(AtomicU32::new))
            .collect()
    };
    Shared {
        vertices: atomic(vertices),
        neighbours: atomic(neighbours),
        owners,
        next: AtomicU32::new(used as u32),
        full: AtomicBool::new(false),
    }
}

/// Plain arrays again.
fn unshare(shared: Shared, mut free: Vec<u32>) -> Plain {
    let used = shared.next.into_inner() as usize;
    free.extend(
        (0u32..)
            .zip(&shared.owners)
            .filter(|(_, w)| w.load(Relaxed) == u32::MAX)
            .map(|(i, _)| i),
    );
    drop(shared.owners);
    let plain = |words: Vec<[AtomicU32; 4]>| -> Vec<[u32; 4]> {
        let mut words: Vec<[u32; 4]> = words.into_iter().map(|w| w.map(AtomicU32::into_inner)).collect();
        words.truncate(used);
        words
    };
    Plain::from_parts(plain(shared.vertices), plain(shared.neighbours), free)
}
