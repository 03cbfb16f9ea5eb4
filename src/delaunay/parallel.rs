//! Many threads inserting into one triangulation, each among its own tetrahedra.
//!
//! In: a triangulation of the first rounds and the points of the others. Out: the triangulation of all but a few points, which
//! are left to one thread. Steps, for each round (after Marot, Pellerin & Remacle 2019, "One machine, one minute, three
//! billion tetrahedra"):
//! 1. the space-filling curve is cut into one stretch a thread, so that each has as many points to insert; a thread owns the
//!    tetrahedra of whose vertices at least three lie on its stretch;
//! 2. every thread inserts its points as alone, but puts a point off when the walk or the cavity, with the tetrahedra around
//!    it, leaves its own;
//! 3. the curve is cut elsewhere, and points put off are tried again; after a few passes they wait for the next round.
//!
//! Nothing is locked. An insertion changes only tetrahedra that its thread owns; what it makes has the new point and two
//! vertices of an owned facet, so it is owned again; and the neighbours it looks at have two vertices on the stretch, so no
//! other thread owns, and changes, them. Only walks read what others write, and their ends are tested. All shared words are
//! atomic because the language cannot see this; on common processors a relaxed load or store is a plain one. Which points
//! wait decides the numbering only: the set of tetrahedra is canonical.

use super::filter::Filter;
use super::insertion::{Inserter, Memory};
use super::lanes::{Lanes, Site, Task, with_lanes};
use super::store::{INSIDE, NOTHING, Plain, SEEN, Store, VERTEX};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// Slots a thread takes from the common store at a time.
const SLOTS: u32 = 1024;

/// Where a pass begins to cut the curve, in stretches. The curve is closed for this purpose: one stretch may be the first
/// part of it and the last.
const CUTS: [f64; 2] = [0.0, 0.5];

/// Fewer points than this a thread are not worth a pass.
const WORTH_A_PASS: usize = 256;

/// The common store.
struct Shared {
    vertices: Vec<[AtomicU32; 4]>,
    neighbours: Vec<[AtomicU32; 4]>,
    /// First slot never used.
    next: AtomicU32,
    /// Set when a thread found no slot: all stop.
    full: AtomicBool,
}

/// Part of the closed curve: the positions `from..to`, or all others.
#[derive(Clone, Copy)]
struct Stretch {
    from: f64,
    to: f64,
    others: bool,
}

impl Stretch {
    #[inline(always)]
    fn holds(self, site: &Site) -> bool {
        let p = site.position();
        ((p >= self.from) & (p < self.to)) != self.others
    }
}

/// The common store as one thread sees it.
struct Worker<'a> {
    shared: &'a Shared,
    stretch: Stretch,
    free: Vec<u32>,
    fresh: Range<u32>,
}

#[inline(always)]
fn load(words: &[AtomicU32; 4]) -> [u32; 4] {
    [
        words[0].load(Relaxed),
        words[1].load(Relaxed),
        words[2].load(Relaxed),
        words[3].load(Relaxed),
    ]
}

#[inline(always)]
fn store(words: &[AtomicU32; 4], values: [u32; 4]) {
    for k in 0..4 {
        words[k].store(values[k], Relaxed);
    }
}

impl Store for Worker<'_> {
    const SHARED: bool = true;

    #[inline(always)]
    fn slots(&self) -> u32 {
        self.shared
            .next
            .load(Relaxed)
            .min(self.shared.vertices.len() as u32)
    }

    #[inline(always)]
    fn tet(&self, tet: u32) -> [u32; 4] {
        let [a, b, c, d] = load(&self.shared.vertices[tet as usize]);
        [a & VERTEX, b, c, d]
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
    fn owns(&self, sites: &[Site], v: [u32; 4]) -> bool {
        // A slot being written by another thread holds vertices of that thread, old or new. Spelled out: an iterator's
        // closure would be compiled apart and called for every neighbour.
        let [a, b, c, d] = v;
        self.holds(sites, a) + self.holds(sites, b) + self.holds(sites, c) + self.holds(sites, d) >= 3
    }

    #[inline(always)]
    fn visit(&mut self, tet: u32) -> usize {
        let first = &self.shared.vertices[tet as usize][0];
        let word = first.load(Relaxed);
        first.store(word | SEEN, Relaxed);
        usize::from(word >> 30 == 0)
    }

    #[inline(always)]
    fn note(&mut self, tet: u32, inside: bool) {
        let first = &self.shared.vertices[tet as usize][0];
        first.store(first.load(Relaxed) | u32::from(inside) << 31, Relaxed);
    }

    #[inline(always)]
    fn is_inside(&self, tet: u32) -> bool {
        self.shared.vertices[tet as usize][0].load(Relaxed) >= INSIDE
    }

    #[inline(always)]
    fn forget(&mut self, tet: u32) {
        let first = &self.shared.vertices[tet as usize][0];
        first.store(first.load(Relaxed) & VERTEX, Relaxed);
    }

    #[inline(always)]
    fn reserve(&mut self, needed: usize) -> bool {
        self.free.len() + self.fresh.len() >= needed || self.take_slots(needed)
    }

    #[inline(always)]
    fn slot(&mut self) -> u32 {
        let slot = self.free.pop().or_else(|| self.fresh.next());
        slot.expect("slots were reserved")
    }

    #[inline(always)]
    fn free(&mut self, tet: u32) {
        store(&self.shared.vertices[tet as usize], NOTHING);
        self.free.push(tet);
    }
}

impl Worker<'_> {
    /// 1 when a vertex is on this thread's stretch; the infinite one never is.
    #[inline(always)]
    fn holds(&self, sites: &[Site], v: u32) -> u8 {
        match sites.get(v as usize) {
            Some(site) => u8::from(self.stretch.holds(site)),
            None => 0,
        }
    }

    /// Takes slots from the common store; `false` when there are none.
    #[cold]
    fn take_slots(&mut self, needed: usize) -> bool {
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
}

/// Inserts the points of `rounds` (ranges of vertices, one after the other, each in the order of the curve) with `threads`
/// threads into a store that already holds a triangulation; `room` is the number of slots to work in. Returns the store and
/// the points left over, in order.
pub(super) fn insert_rounds(
    plain: Plain,
    sites: &[Site],
    filter: Filter,
    rounds: &[Range<u32>],
    threads: usize,
    room: usize,
) -> (Plain, Vec<u32>) {
    let start = plain.any().expect("a triangulation to start from");
    let shared = share(plain, room);
    let mut workers: Vec<(Worker, Memory)> = (0..threads)
        .map(|_| {
            let worker = Worker {
                shared: &shared,
                stretch: Stretch {
                    from: 0.0,
                    to: 0.0,
                    others: false,
                },
                free: Vec::new(),
                fresh: 0..0,
            };
            (worker, Memory::new(sites.len(), start))
        })
        .collect();
    let mut waiting = Vec::new();
    for round in rounds {
        waiting.extend(round.clone());
        for cut in CUTS {
            if waiting.len() < WORTH_A_PASS * threads || shared.full.load(Relaxed) {
                break;
            }
            let position = |&v: &u32| sites[v as usize].position();
            waiting.sort_by(|a, b| position(a).total_cmp(&position(b)).then(a.cmp(b)));
            waiting = pass(
                &mut workers,
                sites,
                filter,
                &waiting,
                &cuts(sites, round, threads, cut),
            );
        }
    }
    let mut free = Vec::new();
    for (worker, _) in workers {
        free.extend(worker.free);
        free.extend(worker.fresh);
    }
    waiting.sort_unstable();
    (unshare(shared, free), waiting)
}

/// Positions at which `count` stretches begin: those of points evenly spaced in a round, the first `shift` stretches from its
/// beginning. Points put off lie around the cuts of an earlier pass, so the cuts do not depend on them.
fn cuts(sites: &[Site], round: &Range<u32>, count: usize, shift: f64) -> Vec<f64> {
    let place = |i: usize| ((i as f64 + shift) / count as f64 * round.len() as f64) as usize;
    (0..count)
        .map(|i| sites[round.start as usize + place(i)].position())
        .collect()
}

/// Every worker tries its part of `points`, which follow the curve; returns those put off.
fn pass(
    workers: &mut [(Worker, Memory)],
    sites: &[Site],
    filter: Filter,
    points: &[u32],
    cuts: &[f64],
) -> Vec<u32> {
    let count = workers.len();
    // Points of equal position are on the same side of a cut, so that a point and its tetrahedra belong to the same thread.
    let bounds: Vec<usize> = cuts
        .iter()
        .map(|&cut| points.partition_point(|&v| sites[v as usize].position() < cut))
        .collect();
    let put_off: Vec<Vec<u32>> = workers
        .par_iter_mut()
        .enumerate()
        .with_max_len(1)
        .map(|(i, (worker, memory))| {
            let next = (i + 1) % count;
            let (from, to) = (bounds[i], bounds[next]);
            let wraps = next == 0;
            worker.stretch = Stretch {
                from: if wraps { cuts[0] } else { cuts[i] },
                to: if wraps { cuts[i] } else { cuts[next] },
                others: wraps,
            };
            let parts = if wraps {
                [&points[from..], &points[..to]]
            } else {
                [&points[from..to], &[]]
            };
            with_lanes(Part {
                worker,
                memory,
                sites,
                filter,
                parts,
            })
        })
        .collect();
    put_off.concat()
}

/// One thread's part of a pass.
struct Part<'a, 'b> {
    worker: &'a mut Worker<'b>,
    memory: &'a mut Memory,
    sites: &'a [Site],
    filter: Filter,
    parts: [&'a [u32]; 2],
}

impl Task for Part<'_, '_> {
    type Output = Vec<u32>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Vec<u32> {
        let Self {
            worker,
            memory,
            sites,
            filter,
            parts,
        } = self;
        let mut inserter = Inserter {
            sites,
            filter,
            lanes,
            memory,
        };
        let mut put_off = Vec::new();
        for &v in parts.into_iter().flatten() {
            if worker.shared.full.load(Relaxed) || !inserter.insert(worker, v) {
                put_off.push(v);
            }
        }
        put_off
    }
}

/// Makes every word atomic and adds room. What is there is converted in place; the room is touched for the first time here,
/// by all threads.
fn share(plain: Plain, room: usize) -> Shared {
    let used = plain.vertices.len();
    let more = room.saturating_sub(used);
    let atomic = |words: Vec<[u32; 4]>, blank: [u32; 4]| {
        let mut words: Vec<[AtomicU32; 4]> = words
            .into_iter()
            .map(|[a, b, c, d]| [a, b, c, d].map(AtomicU32::new))
            .collect();
        words.reserve_exact(more);
        words.par_extend((0..more).into_par_iter().map(|_| blank.map(AtomicU32::new)));
        words
    };
    Shared {
        vertices: atomic(plain.vertices, NOTHING),
        neighbours: atomic(plain.neighbours, [0; 4]),
        next: AtomicU32::new(used as u32),
        full: AtomicBool::new(false),
    }
}

/// Plain arrays again.
fn unshare(shared: Shared, free: Vec<u32>) -> Plain {
    let used = shared.next.into_inner() as usize;
    let plain = |words: Vec<[AtomicU32; 4]>| -> Vec<[u32; 4]> {
        let mut words: Vec<[u32; 4]> = words.into_iter().map(|w| w.map(AtomicU32::into_inner)).collect();
        words.truncate(used);
        words
    };
    Plain {
        vertices: plain(shared.vertices),
        neighbours: plain(shared.neighbours),
        free,
    }
}
