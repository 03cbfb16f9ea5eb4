//! Many threads inserting into one triangulation, each among its own tetrahedra.
//!
//! In: a triangulation of the first rounds and the points of the others. Out: the triangulation of all points, unless room ran
//! out. Steps, for each round:
//! 1. space is cut into slabs, one a thread, with equally many points of the round; a tetrahedron belongs to the first of the
//!    threads in whose slabs it has vertices;
//! 2. every thread inserts the points of its slab as alone, but puts a point off when the walk ends in a tetrahedron of
//!    another, or the cavity with the tetrahedra around it holds one. The first thread spares the points farthest from its
//!    cut;
//! 3. points put off lie around the cuts. Each cut becomes a slab of its own, and the threads insert what was put off, while
//!    the first, to whom the rest of space belongs, inserts what it spared;
//! 4. few points are left, with tetrahedra that reach through several slabs. One thread inserts them, so that such
//!    tetrahedra are not kept waiting to be cut up: in the next round they would stop many more points.
//!
//! After Marot, Pellerin & Remacle 2019, "One machine, one minute, three billion tetrahedra"; there a tetrahedron belongs to
//! the thread that has three of its vertices, and to nobody else, which stops twice as many points.
//!
//! Nothing is locked, and nothing depends on luck:
//! * Each slot has at most one owner a pass. Who that is follows from its vertices; the owner stamps the slot before it
//!   changes anything in it, so a slot with the stamp of an earlier pass is as that pass left it, and all threads read the
//!   same vertices and come to the same owner. A thread that reads vertices while the owner changes them sees the stamp when
//!   it looks again (the two fences; Boehm 2012, "Can seqlocks get along with programming language memory models?").
//! * A thread changes only slots it owns: an insertion changes the cavity, the neighbours of the cavity, and slots that were
//!   in no use, all stamped by then.
//! * It decides only by what cannot change beside it: its own slots and, for a ghost, the tetrahedron behind. If that is
//!   another's, it stays: to replace it, its owner would have to own the ghost, its neighbour, as well.
//! * Walks read what others write and may go astray; their ends are tested.
//!
//! All shared words are atomic because the language cannot see this; on common processors a relaxed load or store is a plain
//! one. Which points wait decides the numbering only: the set of tetrahedra is canonical.

use super::canonical::zeros;
use super::filter::Filter;
use super::insertion::{Inserter, Memory};
use super::lanes::{Lanes, Site, Task, with_lanes};
use super::store::{INSIDE, NOTHING, Plain, SEEN, Store, VERTEX};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering, Ordering::Relaxed, fence};

/// More threads than this are not used: stamps of all passes fit 16 bits.
pub(super) const MOST_THREADS: usize = 256;

/// Slots a thread takes from the common store at a time.
const SLOTS: u32 = 1024;

/// Fewer points than this a thread are not worth a pass.
const WORTH_A_PASS: usize = 256;

/// Positions looked at to cut a round into parts with equally many points.
const SAMPLE: usize = 1 << 12;

/// Half the thickness of the slab around a cut, in slabs of the first pass.
const AROUND: f64 = 0.4;

/// The share of a round that the first thread spares in the first pass of all, and how much smaller than in one round the
/// share put off is in the next, which has eight times as many points: measured.
const SPARED: [f64; 2] = [0.05, 0.4];

/// Stamp of slots never used.
const UNUSED: u16 = 0;
/// Stamp of slots used before the first pass.
const BEFORE: u16 = 1;

/// The common store.
struct Shared {
    vertices: Vec<[AtomicU32; 4]>,
    neighbours: Vec<[AtomicU32; 4]>,
    /// For each slot who owned it last and in which pass.
    stamps: Vec<AtomicU16>,
    /// First slot never used.
    next: AtomicU32,
    /// Set when a thread found no slot: all stop.
    full: AtomicBool,
}

/// Slabs, by the positions between them, and the threads they belong to.
struct Map {
    cuts: Vec<f64>,
    owners: Vec<u16>,
}

impl Map {
    /// Slab `i` belongs to thread `i`.
    fn one_each(cuts: Vec<f64>) -> Self {
        let owners = (0..=cuts.len() as u16).collect();
        Self { cuts, owners }
    }

    /// The thread in whose slab a position lies.
    #[inline(always)]
    fn owner(&self, position: f64) -> u16 {
        let slab = self
            .cuts
            .iter()
            .fold(0, |n, &cut| n + usize::from(position >= cut));
        self.owners[slab]
    }
}

/// Slots that a thread has at hand.
#[derive(Default)]
struct Slots {
    free: Vec<u32>,
    fresh: Range<u32>,
}

/// The common store as one thread sees it.
struct Worker<'a> {
    shared: &'a Shared,
    sites: &'a [Site],
    map: &'a Map,
    slots: &'a mut Slots,
    /// This thread.
    number: u16,
    /// Stamp of the first thread in this pass.
    pass: u16,
    /// Stamp of this thread in this pass.
    stamp: u16,
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
    fn owns(&self, tet: u32) -> bool {
        self.shared.stamps[tet as usize].load(Relaxed) == self.stamp || self.claims(tet)
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
        self.slots.free.len() + self.slots.fresh.len() >= needed || self.take_slots(needed)
    }

    #[inline(always)]
    fn slot(&mut self) -> u32 {
        let slot = self.slots.free.pop().or_else(|| self.slots.fresh.next());
        let slot = slot.expect("slots were reserved");
        self.stamp(slot);
        slot
    }

    #[inline(always)]
    fn free(&mut self, tet: u32) {
        store(&self.shared.vertices[tet as usize], NOTHING);
        self.slots.free.push(tet);
    }
}

impl Worker<'_> {
    /// Whether a tetrahedron without this thread's stamp is its own all the same; stamps it then.
    #[inline(never)]
    fn claims(&self, tet: u32) -> bool {
        let stamp = &self.shared.stamps[tet as usize];
        let first = stamp.load(Relaxed);
        let vertices = self.tet(tet);
        // Vertices written by another thread in this pass come with its stamp, by the second look.
        fence(Ordering::Acquire);
        let second = stamp.load(Relaxed);
        let own = self.is_own([first, second], vertices);
        if own {
            self.stamp(tet);
        }
        own
    }

    /// Whether a slot whose stamp was the same before and after its vertices were read is this thread's.
    #[inline(always)]
    fn is_own(&self, [first, second]: [u16; 2], vertices: [u32; 4]) -> bool {
        first != UNUSED && first < self.pass && first == second && self.owner(vertices) == self.number
    }

    /// Stamps a slot, before anything in it is changed.
    #[inline(always)]
    fn stamp(&self, tet: u32) {
        self.shared.stamps[tet as usize].store(self.stamp, Relaxed);
        fence(Ordering::Release);
    }

    /// The first of the threads in whose slabs the vertices lie; none of a slot that holds no tetrahedron.
    #[inline(always)]
    fn owner(&self, vertices: [u32; 4]) -> u16 {
        let of = |v: u32| match self.sites.get(v as usize) {
            Some(site) => self.map.owner(site.position()),
            None => u16::MAX,
        };
        let [a, b, c, d] = vertices;
        of(a).min(of(b)).min(of(c)).min(of(d))
    }

    /// Takes slots from the common store; `false` when there are none.
    #[cold]
    fn take_slots(&mut self, needed: usize) -> bool {
        while self.slots.free.len() + self.slots.fresh.len() < needed {
            let start = self.shared.next.fetch_add(SLOTS, Relaxed);
            if u64::from(start) + u64::from(SLOTS) > self.shared.vertices.len() as u64 {
                self.shared.next.fetch_sub(SLOTS, Relaxed);
                self.shared.full.store(true, Relaxed);
                return false;
            }
            self.slots.free.extend(self.slots.fresh.clone());
            self.slots.fresh = start..start + SLOTS;
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
    debug_assert!((2..=MOST_THREADS).contains(&threads));
    let start = plain.any().expect("a triangulation to start from");
    let mut team = Team {
        shared: share(plain, room),
        sites,
        filter,
        members: (0..threads)
            .map(|_| (Slots::default(), Memory::new(sites.len(), start)))
            .collect(),
        passes: 0,
        spared: SPARED[0],
    };
    let mut waiting = Vec::new();
    for round in rounds {
        waiting = team.insert_round(waiting, round.clone());
    }
    waiting.sort_unstable();
    let mut free = Vec::new();
    for (slots, _) in team.members {
        free.extend(slots.free);
        free.extend(slots.fresh);
    }
    (unshare(team.shared, free), waiting)
}

/// All threads, with what they keep from pass to pass.
struct Team<'a> {
    shared: Shared,
    sites: &'a [Site],
    filter: Filter,
    members: Vec<(Slots, Memory)>,
    passes: usize,
    /// The share of a round that the first thread spares.
    spared: f64,
}

impl Team<'_> {
    /// Tries the points of a round and those that wait from the rounds before; returns those that wait now.
    fn insert_round(&mut self, mut waiting: Vec<u32>, round: Range<u32>) -> Vec<u32> {
        let count = self.members.len();
        if waiting.len() + round.len() < WORTH_A_PASS * count {
            waiting.extend(round);
            return waiting;
        }
        let positions = sample(self.sites, round.clone());
        let quantile = |share: f64| positions[(share * positions.len() as f64) as usize];
        let spared = quantile(self.spared);
        let slab = (1.0 - self.spared) / count as f64;
        let begin = self.spared;
        let cut = |i: f64| quantile(begin + i * slab);
        let cuts = 1..count;

        let slabs = Map::one_each(cuts.clone().map(|i| cut(i as f64)).collect());
        let rest = self.pass(&waiting, round.clone(), &slabs, spared);
        let around = Map {
            cuts: cuts
                .clone()
                .flat_map(|i| [cut(i as f64 - AROUND), cut(i as f64 + AROUND)])
                .collect(),
            owners: cuts.clone().flat_map(|i| [0, i as u16]).chain([0]).collect(),
        };
        let put_off = rest.put_off.len() as f64 / (cuts.len() * round.len()) as f64;
        self.spared = (SPARED[1] * put_off).min(SPARED[0]);
        let waiting = [rest.put_off, rest.spared].concat();
        let rest = self.pass(&waiting, 0..0, &around, f64::NEG_INFINITY);
        let rest = self.pass(&rest.put_off, 0..0, &Map::one_each(Vec::new()), f64::NEG_INFINITY);
        rest.put_off
    }

    /// Every thread tries the points in its slabs, but for those at positions below `spared`.
    fn pass(&mut self, waiting: &[u32], round: Range<u32>, map: &Map, spared: f64) -> Rest {
        self.passes += 1;
        let pass = (self.passes * self.members.len()) as u16 + BEFORE;
        let (shared, sites, filter) = (&self.shared, self.sites, self.filter);
        let rests: Vec<Rest> = (0..map.owners.len().min(self.members.len()) as u16)
            .into_par_iter()
            .zip(&mut self.members)
            .with_max_len(1)
            .map(|(number, (slots, memory))| {
                with_lanes(Part {
                    worker: Worker {
                        shared,
                        sites,
                        map,
                        slots,
                        number,
                        pass,
                        stamp: pass + number,
                    },
                    memory,
                    filter,
                    points: waiting.iter().copied().chain(round.clone()),
                    spared,
                })
            })
            .collect();
        let mut all = Rest::default();
        for rest in rests {
            all.put_off.extend(rest.put_off);
            all.spared.extend(rest.spared);
        }
        all
    }
}

/// Positions of a sample of points, in order, with the last once more.
fn sample(sites: &[Site], round: Range<u32>) -> Vec<f64> {
    let step = (round.len() / SAMPLE).max(1);
    let mut positions: Vec<f64> = round
        .step_by(step)
        .map(|v| sites[v as usize].position())
        .collect();
    positions.sort_unstable_by(f64::total_cmp);
    positions.extend(positions.last().copied());
    positions
}

/// One thread's part of a pass.
struct Part<'a, I> {
    worker: Worker<'a>,
    memory: &'a mut Memory,
    filter: Filter,
    points: I,
    spared: f64,
}

/// The points that a pass did not insert, in the order they came in.
#[derive(Default)]
struct Rest {
    put_off: Vec<u32>,
    spared: Vec<u32>,
}

impl<I: Iterator<Item = u32>> Task for Part<'_, I> {
    type Output = Rest;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Rest {
        let mut worker = self.worker;
        let mut inserter = Inserter {
            sites: worker.sites,
            filter: self.filter,
            lanes,
            memory: self.memory,
        };
        let mut rest = Rest::default();
        for v in self.points {
            let position = worker.sites[v as usize].position();
            if worker.map.owner(position) != worker.number {
                continue;
            }
            if position < self.spared {
                rest.spared.push(v);
            } else if worker.shared.full.load(Relaxed) || !inserter.insert(&mut worker, v) {
                rest.put_off.push(v);
            }
        }
        rest
    }
}

/// Makes every word atomic, which costs nothing, in `room` slots. Most of the room is touched first by the thread that fills
/// it.
fn share(plain: Plain, room: usize) -> Shared {
    let used = plain.vertices.len();
    let atomic = |words: Vec<[u32; 4]>| -> Vec<[AtomicU32; 4]> {
        let mut all = vec![[0; 4]; room.max(used)];
        all[..used].copy_from_slice(&words);
        all.into_iter().map(|w| w.map(AtomicU32::new)).collect()
    };
    let mut stamps: Vec<u16> = zeros(room.max(used));
    stamps[..used].fill(BEFORE);
    Shared {
        vertices: atomic(plain.vertices),
        neighbours: atomic(plain.neighbours),
        stamps: stamps.into_iter().map(AtomicU16::new).collect(),
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
    let mut vertices = plain(shared.vertices);
    for &slot in &free {
        vertices[slot as usize] = NOTHING;
    }
    Plain {
        vertices,
        neighbours: plain(shared.neighbours),
        free,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Calls `f` with all ways to put two sequences of steps into one: `true` for a step of the first.
    fn interleavings(first: usize, second: usize, so_far: &mut Vec<bool>, f: &mut impl FnMut(&[bool])) {
        if first + second == 0 {
            f(so_far);
        }
        for (of_first, left) in [(true, first), (false, second)] {
            if left > 0 {
                so_far.push(of_first);
                interleavings(
                    first - usize::from(of_first),
                    second - usize::from(!of_first),
                    so_far,
                    f,
                );
                so_far.pop();
            }
        }
    }

    /// One thread stamps its slot and changes it, in any order of its words, while another looks at it as
    /// [`Worker::claims`] does: in every order of their steps, and whatever the slot held and will hold, the other leaves it
    /// alone. Without the second look at the stamp it would not.
    #[test]
    fn nobody_claims_what_its_owner_changes() {
        const PASS: u16 = 3;
        let sites: Vec<Site> = (0..4u8).map(|i| Site::new(DVec3::ZERO, f64::from(i))).collect();
        let shared = share(Plain::default(), 1);
        let map = Map::one_each(vec![2.0]);
        let infinite = u32::MAX;
        let contents = [
            [0, 1, 2, 3],
            [3, 2, 1, 0],
            [2, 3, 0, infinite],
            [3, 1, 2, infinite],
            [2, 3, 3, 2],
            [3, 2, 2, infinite],
            NOTHING,
        ];
        let (mut fooled, mut ways) = (0, 0);
        for number in [0, 1] {
            let (mut own_slots, mut other_slots) = (Slots::default(), Slots::default());
            let of = |number: u16, slots| Worker {
                shared: &shared,
                sites: &sites,
                map: &map,
                slots,
                number,
                pass: PASS,
                stamp: PASS + number,
            };
            let (owner, other) = (of(number, &mut own_slots), of(1 - number, &mut other_slots));
            let owned = |v: &&[u32; 4]| owner.owner(**v) == number;
            for old in contents.iter().filter(owned) {
                assert!(owner.is_own([BEFORE; 2], *old) && !other.is_own([BEFORE; 2], *old));
                // What an owner writes is its own or nothing.
                for new in contents.iter().filter(|v| **v == NOTHING || owned(v)) {
                    for turn in 0..4 {
                        interleavings(5, 6, &mut Vec::new(), &mut |order| {
                            let (mut stamp, mut words) = (BEFORE, *old);
                            let (mut written, mut read) = (0, 0);
                            let (mut stamps, mut vertices) = ([0; 2], [0; 4]);
                            for &by_owner in order {
                                if by_owner {
                                    match written {
                                        0 => stamp = owner.stamp,
                                        k => words[(k + turn) % 4] = new[(k + turn) % 4],
                                    }
                                    written += 1;
                                } else {
                                    match read {
                                        0 => stamps[0] = stamp,
                                        5 => stamps[1] = stamp,
                                        k => vertices[k - 1] = words[k - 1],
                                    }
                                    read += 1;
                                }
                            }
                            assert!(!other.is_own(stamps, vertices), "{old:?} {new:?} {order:?}");
                            fooled += u32::from(other.is_own([stamps[0]; 2], vertices));
                            ways += 1;
                        });
                    }
                }
            }
        }
        assert!(
            fooled > 0 && ways > 10_000,
            "one look is fooled {fooled} times of {ways}"
        );
    }
}
