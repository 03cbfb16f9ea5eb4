//! Incremental insertion: one point at a time, the tetrahedra whose spheres hold it are replaced by a star.
//!
//! In: normalised distinct points in insertion order that span space. Out: tetrahedra, neighbours and ghosts, numbered as
//! they happened to arise. Steps for each point (Bowyer 1981; Watson 1981; ghosts after Shewchuk's lecture notes):
//! 1. **Walk** from the last tetrahedron across any facet that separates it from the point (visibility walk that never turns
//!    back; it ends because a perturbed Delaunay triangulation is regular).
//! 2. **Cavity**: breadth-first over tetrahedra in conflict. A finite one conflicts when the point lies in its sphere, ties
//!    broken by coordinates; a ghost when the point lies beyond its hull triangle, or in its plane and in the sphere of the
//!    finite tetrahedron behind it.
//! 3. **Star** (see `star`): one new tetrahedron a boundary facet.
//!
//! Several threads may insert at once (see `parallel`), each among its own tetrahedra: an insertion that would need another
//! one gives up, with nothing changed, and comes again later.
//!
//! Cost: expected `O(n)` after sorting for points spread evenly or on surfaces; `O(n^2)` tetrahedra in the worst case.

use super::filter::Filter;
use super::lanes::{Corners, Lanes, Site};
use super::star::{Boundary, Links};
use super::store::{Store, VERTEX};

/// The vertex at infinity while building.
pub(super) const INF: u32 = u32::MAX;

/// Vertex places of facet `i`, counter-clockwise seen from outside.
const FACET: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Steps after which a walk among other threads' changes is given up.
const LONGEST_WALK: u32 = 1 << 14;

/// Random slots looked at to find a place near a point.
const DRAWS: u32 = 256;

/// What one thread keeps from insertion to insertion.
pub(super) struct Memory {
    /// A tetrahedron near the last insertion.
    pub last: u32,
    /// Tetrahedra visited by this insertion, the first `visited` of them.
    tested: Vec<u32>,
    visited: usize,
    /// Those in conflict, the first `inside` of them; then the slots of the star.
    pub(super) cavity: Vec<u32>,
    pub(super) inside: usize,
    /// Facets around them, the first `facets` of them.
    pub(super) boundary: Vec<Boundary>,
    pub(super) facets: usize,
    pub(super) links: Links,
    /// State of the random numbers that [`Inserter::jump`] draws.
    random: u64,
}

impl Memory {
    /// For a triangulation of `points` points; the first walk begins at `start`.
    pub(super) fn new(points: usize, start: u32) -> Self {
        Self {
            last: start,
            tested: Vec::new(),
            visited: 0,
            cavity: Vec::new(),
            inside: 0,
            boundary: Vec::new(),
            facets: 0,
            links: Links::new(points),
            random: 1,
        }
    }

    /// Makes room for what one more layer can add: four neighbours a tetrahedron.
    #[inline(always)]
    fn make_room(&mut self) {
        let needed = self.visited + 4 * self.inside + 5;
        if self.tested.len() < needed {
            self.grow(2 * needed);
        }
    }

    #[cold]
    fn grow(&mut self, size: usize) {
        self.tested.resize(size, 0);
        self.cavity.resize(size, 0);
        self.boundary.resize(size, Boundary::default());
    }
}

/// One thread's means to insert points.
pub(super) struct Inserter<'a, L> {
    /// The points in the order of insertion.
    pub sites: &'a [Site],
    /// The exact tests.
    pub filter: Filter,
    /// The arithmetic of their first step.
    pub lanes: L,
    /// Buffers.
    pub memory: &'a mut Memory,
}

/// Puts the first tetrahedron, positively oriented, and its four ghosts into an empty store.
pub(super) fn first_tetrahedron<S: Store>(store: &mut S, first: [u32; 4]) {
    let mut tets = vec![first];
    tets.extend(FACET.map(|facet| {
        let [a, b, c] = facet.map(|k| first[k]);
        [a, b, c, INF]
    }));
    let mut sides = Vec::new();
    for v in tets {
        let tet = store.slot();
        store.set_tet(tet, v);
        for (k, facet) in FACET.iter().enumerate() {
            let mut key = facet.map(|p| v[p]);
            key.sort_unstable();
            sides.push((key, 4 * tet + k as u32));
        }
    }
    sides.sort_unstable();
    for pair in sides.chunks(2) {
        store.set_neighbour(pair[0].1, pair[1].1);
        store.set_neighbour(pair[1].1, pair[0].1);
    }
}

impl<L: Lanes> Inserter<'_, L> {
    #[inline(always)]
    fn corners(&self, v: [u32; 4]) -> Corners<'_> {
        let [a, b, c, d] = v.map(|v| v as usize);
        [&self.sites[a], &self.sites[b], &self.sites[c], &self.sites[d]]
    }

    /// Inserts a point that is not yet a vertex; `false`, and nothing changed, when a tetrahedron of another thread was in
    /// the way or the store is full.
    #[inline(always)]
    pub(super) fn insert<S: Store>(&mut self, store: &mut S, v: u32) -> bool {
        let p = self.sites[v as usize];
        let Some(start) = self.locate(store, &p) else {
            return false;
        };
        if !self.find_cavity(store, start, &p) || !store.reserve(self.memory.facets) {
            self.give_up(store);
            return false;
        }
        self.memory.fill(store, v);
        true
    }

    /// A tetrahedron that holds the point, or a ghost whose hull triangle it lies beyond; `None` when it belongs to another
    /// thread. A walk through other threads' tetrahedra reads what they are writing: it may lose its way and end anywhere,
    /// so a shared store has the end tested for conflict.
    #[inline(always)]
    fn locate<S: Store>(&mut self, store: &S, p: &Site) -> Option<u32> {
        let mut tet = self.memory.last;
        let mut v = store.tet(tet);
        if v[3] == INF && v[0] != VERTEX {
            tet = store.neighbour(tet, 3) >> 2;
            v = store.tet(tet);
        }
        let mut from = 4;
        let mut steps = 0;
        'walk: loop {
            if S::SHARED {
                steps += 1;
                if steps > LONGEST_WALK || v[0] == VERTEX {
                    self.jump(store, p);
                    return None;
                }
            }
            if v[3] == INF {
                break;
            }
            let corners = self.corners(v).map(Site::point);
            for k in 0..4 {
                if k == from {
                    continue;
                }
                let [i, j, l] = FACET[k];
                if self
                    .filter
                    .orient3d(corners[i], corners[j], corners[l], p.point())
                    > 0.0
                {
                    let next = store.neighbour(tet, k);
                    tet = next >> 2;
                    from = (next & 3) as usize;
                    v = store.tet(tet);
                    continue 'walk;
                }
            }
            break;
        }
        if S::SHARED {
            self.memory.last = tet;
            if !store.owns(tet) || !self.in_conflict(store, v, tet, p) {
                return None;
            }
        }
        Some(tet)
    }

    /// Chooses, among random slots, the tetrahedron that lies nearest to the point for the next walk to begin in.
    #[cold]
    fn jump<S: Store>(&mut self, store: &S, p: &Site) {
        let target = p.point();
        let mut nearest = f64::INFINITY;
        for _ in 0..DRAWS {
            // Xorshift (Marsaglia 2003).
            let r = &mut self.memory.random;
            *r ^= *r << 13;
            *r ^= *r >> 7;
            *r ^= *r << 17;
            let slot = (u64::from(store.slots()) * (*r >> 32)) >> 32;
            let tet = store.tet(slot as u32);
            if tet[0] == VERTEX || tet[3] == INF {
                continue;
            }
            let distance = self.sites[tet[0] as usize].point().distance_squared(target);
            if distance < nearest {
                nearest = distance;
                self.memory.last = slot as u32;
            }
        }
    }

    #[inline(always)]
    fn in_conflict<S: Store>(&self, store: &S, v: [u32; 4], tet: u32, p: &Site) -> bool {
        if v[3] == INF {
            return self.ghost_in_conflict(store, v, tet, p);
        }
        self.filter.insphere(self.lanes, self.corners(v), p) > 0.0
    }

    fn ghost_in_conflict<S: Store>(&self, store: &S, v: [u32; 4], tet: u32, p: &Site) -> bool {
        let [a, b, c] = [v[0], v[1], v[2]].map(|v| self.sites[v as usize].point());
        let side = self.filter.orient3d(a, b, c, p.point());
        if side != 0.0 {
            return side > 0.0;
        }
        let behind = store.tet(store.neighbour(tet, 3) >> 2);
        debug_assert!(behind[3] != INF);
        self.filter.insphere(self.lanes, self.corners(behind), p) > 0.0
    }

    /// Collects the tetrahedra in conflict with `p` and the facets around them; `false` when one belongs to another thread.
    ///
    /// Layer by layer: the neighbours of the last layer are gathered, then tested. Which of them are new and which conflict
    /// cannot be foreseen, so lists grow without branches: every element is written, the length advances when it counts.
    #[inline(always)]
    fn find_cavity<S: Store>(&mut self, store: &mut S, start: u32, p: &Site) -> bool {
        self.memory.visited = 0;
        self.memory.inside = 0;
        self.memory.make_room();
        self.memory.visited = store.visit(start);
        store.note(start, true);
        self.memory.tested[0] = start;
        self.memory.cavity[0] = start;
        self.memory.inside = 1;
        let mut layer = 0;
        while layer < self.memory.inside {
            self.memory.make_room();
            // Lists and lengths as locals: the compiler then keeps them in registers.
            let mut tested = std::mem::take(&mut self.memory.tested);
            let mut cavity = std::mem::take(&mut self.memory.cavity);
            let candidates = self.memory.visited;
            let mut visited = candidates;
            let mut inside = self.memory.inside;
            let mut denied = false;
            'layer: for &tet in &cavity[layer..inside] {
                let n = store.neighbours(tet);
                let room: &mut [u32; 5] = (&mut tested[visited..visited + 5])
                    .try_into()
                    .expect("five places");
                let mut first = 0;
                for k in 0..4 {
                    let other = n[k] >> 2;
                    // Before anything is noted: it may be another's.
                    if S::SHARED && !store.owns(other) {
                        denied = true;
                        visited += first;
                        break 'layer;
                    }
                    room[first] = other;
                    first += store.visit(other);
                }
                visited += first;
            }
            layer = inside;
            let gathered = if denied { candidates } else { visited };
            for &tet in &tested[candidates..gathered] {
                let v = store.tet(tet);
                let conflict = self.in_conflict(store, v, tet, p);
                store.note(tet, conflict);
                cavity[inside] = tet;
                inside += usize::from(conflict);
            }
            self.memory.tested = tested;
            self.memory.cavity = cavity;
            self.memory.visited = visited;
            self.memory.inside = inside;
            if denied {
                return false;
            }
        }
        self.memory.collect_boundary(store);
        true
    }

    /// Forgets what an insertion that is given up has noted.
    #[cold]
    fn give_up<S: Store>(&mut self, store: &mut S) {
        for &tet in &self.memory.tested[..self.memory.visited] {
            store.forget(tet);
        }
    }
}

impl Memory {
    /// The facets between the cavity and the rest.
    #[inline(always)]
    fn collect_boundary<S: Store>(&mut self, store: &S) {
        self.make_room();
        let mut facets = 0;
        let boundary = self.boundary.as_mut_slice();
        for &tet in &self.cavity[..self.inside] {
            let v = store.tet(tet);
            let n = store.neighbours(tet);
            let room: &mut [Boundary; 5] = (&mut boundary[facets..facets + 5])
                .try_into()
                .expect("five places");
            let mut first = 0;
            for k in 0..4 {
                let [i, j, l] = FACET[k];
                room[first] = Boundary {
                    vertices: [v[i], v[j], v[l]],
                    outside: n[k],
                };
                first += usize::from(!store.is_inside(n[k] >> 2));
            }
            facets += first;
        }
        self.facets = facets;
    }
}
