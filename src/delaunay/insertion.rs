//! Incremental insertion: one point at a time, the tetrahedra whose spheres hold it are replaced by a star.
//!
//! In: normalised distinct points in insertion order that span space. Out: tetrahedra, neighbours and ghosts, numbered as
//! they happened to arise. Steps for each point (Bowyer 1981; Watson 1981; ghosts after Shewchuk's lecture notes):
//! 1. **Walk** from the last tetrahedron across any facet that separates it from the point (visibility walk that never turns
//!    back; it ends because a perturbed Delaunay triangulation is regular).
//! 2. **Cavity**: breadth-first over tetrahedra in conflict. A finite one conflicts when the point lies in its sphere, ties
//!    broken by coordinates; a ghost when the point lies beyond its hull triangle, or in its plane and in the sphere of the
//!    finite tetrahedron behind it.
//! 3. **Star**: one new tetrahedron a boundary facet, linked to its siblings through a table indexed by the two local
//!    vertex numbers of an edge.
//!
//! Several threads may insert at once (see `parallel`): a cavity and the tetrahedra around it are taken before anything is
//! written, and an insertion that meets one taken by another thread gives up and comes again later.
//!
//! Cost: expected `O(n)` after sorting for points spread evenly or on surfaces; `O(n^2)` tetrahedra in the worst case.

use super::filter::Filter;
use super::store::Store;
use glam::DVec3;

/// The vertex at infinity while building.
pub(super) const INF: u32 = u32::MAX;

/// Vertex places of facet `i`, counter-clockwise seen from outside.
const FACET: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Cavities of more vertices than this are linked by sorting their edges instead of by the table.
const TABLE: usize = 64;

/// Steps after which a walk among other threads' changes is given up.
const LONGEST_WALK: usize = 1 << 16;

/// A facet between the cavity and the rest.
#[derive(Clone, Copy)]
struct Boundary {
    /// Its vertices, counter-clockwise seen from outside the cavity; the infinite one last.
    vertices: [u32; 3],
    /// The facet as seen from outside, packed.
    outside: u32,
}

/// One thread's means to insert points.
pub(super) struct Inserter<'a> {
    points: &'a [DVec3],
    filter: Filter,
    /// A tetrahedron near the last insertion.
    last: u32,
    /// Tetrahedra visited by this insertion, the first `visited` of them.
    tested: Vec<u32>,
    visited: usize,
    /// Those in conflict, the first `inside` of them.
    cavity: Vec<u32>,
    inside: usize,
    /// Facets around them, the first `facets` of them.
    boundary: Vec<Boundary>,
    facets: usize,
    star: Vec<u32>,
    /// Local number of a vertex, valid when `local[slot[v]] == v`; the infinite vertex has the last place.
    slot: Vec<u8>,
    local: [u32; TABLE],
    table: Vec<u32>,
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
        store.release(tet);
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

impl<'a> Inserter<'a> {
    /// Inserts `points`, whose tests `filter` makes; the walk begins at `start`.
    pub(super) fn new(points: &'a [DVec3], filter: Filter, start: u32) -> Self {
        Self {
            points,
            filter,
            last: start,
            tested: Vec::new(),
            visited: 0,
            cavity: Vec::new(),
            inside: 0,
            boundary: Vec::new(),
            facets: 0,
            star: Vec::new(),
            slot: vec![0; points.len() + 1],
            local: [0; TABLE],
            table: vec![0; TABLE * TABLE],
        }
    }

    /// A tetrahedron near the last insertion.
    pub(super) fn last(&self) -> u32 {
        self.last
    }

    #[inline(always)]
    fn point(&self, v: u32) -> DVec3 {
        self.points[v as usize]
    }

    #[inline(always)]
    fn corners(&self, v: [u32; 4]) -> [DVec3; 4] {
        [
            self.point(v[0]),
            self.point(v[1]),
            self.point(v[2]),
            self.point(v[3]),
        ]
    }

    /// Inserts a point that is not yet a vertex; `false`, and nothing changed, when another thread was in the way or the
    /// store is full.
    pub(super) fn insert<S: Store>(&mut self, store: &mut S, v: u32) -> bool {
        let p = self.point(v);
        store.begin();
        let Some(start) = self.locate(store, p) else {
            return false;
        };
        if !self.find_cavity(store, start, p) || !store.reserve(self.facets) {
            self.give_up(store);
            // The tetrahedron the walk began in may be no more; its old neighbour leads on.
            self.last = store.neighbour(self.last, 0) >> 2;
            return false;
        }
        self.fill(store, v);
        true
    }

    /// A tetrahedron that holds the point, or a ghost whose hull triangle it lies beyond. With one thread there always is
    /// one; among other threads' changes the walk may lose its way.
    fn locate<S: Store>(&self, store: &S, p: DVec3) -> Option<u32> {
        let mut tet = self.last;
        if store.tet(tet)[3] == INF {
            tet = store.neighbour(tet, 3) >> 2;
        }
        let mut from = 4;
        'walk: for _ in 0..LONGEST_WALK.max(self.points.len()) {
            let v = store.tet(tet);
            if v[3] == INF {
                return Some(tet);
            }
            let corners = self.corners(v);
            for k in 0..4 {
                if k == from {
                    continue;
                }
                let [i, j, l] = FACET[k];
                if self.filter.orient3d(corners[i], corners[j], corners[l], p) > 0.0 {
                    let next = store.neighbour(tet, k);
                    tet = next >> 2;
                    from = (next & 3) as usize;
                    continue 'walk;
                }
            }
            return Some(tet);
        }
        None
    }

    #[inline(always)]
    fn in_conflict<S: Store>(&self, store: &S, tet: u32, p: DVec3) -> bool {
        let v = store.tet(tet);
        if v[3] == INF {
            return self.ghost_in_conflict(store, tet, p);
        }
        self.filter.insphere(self.corners(v), p) > 0.0
    }

    fn ghost_in_conflict<S: Store>(&self, store: &S, tet: u32, p: DVec3) -> bool {
        let v = store.tet(tet);
        let (a, b, c) = (self.point(v[0]), self.point(v[1]), self.point(v[2]));
        let side = self.filter.orient3d(a, b, c, p);
        if side != 0.0 {
            return side > 0.0;
        }
        let behind = store.tet(store.neighbour(tet, 3) >> 2);
        debug_assert!(behind[3] != INF);
        self.filter.insphere(self.corners(behind), p) > 0.0
    }

    /// Collects the tetrahedra in conflict with `p` and the facets around them; `false` when one is taken by another thread
    /// or `start` turns out not to conflict (it may have changed since the walk).
    ///
    /// Layer by layer: the neighbours of the last layer are gathered, then tested. Which of them are new and which conflict
    /// cannot be foreseen, so lists grow without branches: every element is written, the length advances when it counts.
    #[inline(always)]
    fn find_cavity<S: Store>(&mut self, store: &mut S, start: u32, p: DVec3) -> bool {
        self.visited = 0;
        self.inside = 0;
        self.make_room();
        if !store.take(start) {
            return false;
        }
        self.visited = store.visit(start);
        self.tested[0] = start;
        if S::SHARED && !self.in_conflict(store, start, p) {
            return false;
        }
        store.note(start, true);
        self.cavity[0] = start;
        self.inside = 1;
        let mut layer = 0;
        while layer < self.inside {
            let candidates = self.visited;
            self.make_room();
            // Lists and lengths as locals: the compiler then keeps them in registers.
            let mut tested = std::mem::take(&mut self.tested);
            let mut cavity = std::mem::take(&mut self.cavity);
            let mut visited = self.visited;
            let mut inside = self.inside;
            let mut denied = false;
            'layer: for &tet in &cavity[layer..inside] {
                let n = store.neighbours(tet);
                let room: &mut [u32; 5] = (&mut tested[visited..visited + 5])
                    .try_into()
                    .expect("five places");
                let mut first = 0;
                for k in 0..4 {
                    let other = n[k] >> 2;
                    if !store.take(other) {
                        denied = true;
                        visited += first;
                        break 'layer;
                    }
                    room[first] = other;
                    first += store.visit(other);
                }
                visited += first;
            }
            if !denied {
                layer = inside;
                for &tet in &tested[candidates..visited] {
                    let conflict = self.in_conflict(store, tet, p);
                    store.note(tet, conflict);
                    cavity[inside] = tet;
                    inside += usize::from(conflict);
                }
            }
            self.tested = tested;
            self.cavity = cavity;
            self.visited = visited;
            self.inside = inside;
            if denied {
                return false;
            }
        }
        self.collect_boundary(store);
        true
    }

    /// Makes room for what one more layer can add: four neighbours a tetrahedron.
    #[inline(always)]
    fn make_room(&mut self) {
        let needed = self.visited + 4 * self.inside + 5;
        if self.tested.len() < needed {
            self.tested.resize(2 * needed, 0);
            self.cavity.resize(2 * needed, 0);
            let blank = Boundary {
                vertices: [0; 3],
                outside: 0,
            };
            self.boundary.resize(2 * needed, blank);
        }
    }

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
                room[first] = Boundary {
                    vertices: facet(v, k),
                    outside: n[k],
                };
                first += usize::from(!store.is_inside(n[k] >> 2));
            }
            facets += first;
        }
        self.facets = facets;
    }

    /// Lets go of everything taken by an insertion that is given up.
    #[cold]
    fn give_up<S: Store>(&mut self, store: &mut S) {
        for &tet in &self.tested[..self.visited] {
            store.release(tet);
        }
    }

    /// Replaces the cavity by the star of `v`.
    #[inline(always)]
    fn fill<S: Store>(&mut self, store: &mut S, v: u32) {
        for &tet in &self.cavity[..self.inside] {
            store.free(tet);
        }
        self.star.clear();
        for b in &mut self.boundary[..self.facets] {
            b.vertices = infinite_last(b.vertices);
            let [x, y, z] = b.vertices;
            let tet = store.slot();
            store.set_tet(tet, [v, x, y, z]);
            store.set_neighbour(b.outside, 4 * tet);
            self.star.push(tet);
        }
        if !self.link_by_table(store) {
            self.link_by_sorting(store);
        }
        self.last = self.star[0];
        if S::SHARED {
            // Each once: a tetrahedron outside that has several facets on the cavity, let go of a second time, would be
            // taken from under whoever holds it by then. Slots of the cavity are no longer noted as outside.
            for &tet in &self.tested[..self.visited] {
                if store.is_outside(tet) {
                    store.release(tet);
                }
            }
            for &tet in &self.star {
                store.release(tet);
            }
        }
    }

    /// Links the star's tetrahedra through the edges they share; `false` when there are too many vertices.
    #[inline(always)]
    fn link_by_table<S: Store>(&mut self, store: &mut S) -> bool {
        // A star of f tetrahedra has f / 2 + 2 vertices besides its centre.
        if self.facets / 2 + 2 > TABLE {
            return false;
        }
        let table: &mut [u32; TABLE * TABLE] = self
            .table
            .as_mut_slice()
            .try_into()
            .expect("the table is made this size");
        let mut count = 0;
        let n = self.points.len();
        for (b, &tet) in self.boundary[..self.facets].iter_mut().zip(&self.star) {
            for v in &mut b.vertices {
                let slot = &mut self.slot[(*v as usize).min(n)];
                let known = *slot < count && self.local[*slot as usize % TABLE] == *v;
                *slot = if known { *slot } else { count };
                self.local[*slot as usize % TABLE] = *v;
                count += u8::from(!known);
                *v = u32::from(*slot);
            }
            let [x, y, z] = b.vertices;
            table[edge(x, y)] = 4 * tet + 3;
            table[edge(y, z)] = 4 * tet + 1;
            table[edge(z, x)] = 4 * tet + 2;
        }
        for (b, &tet) in self.boundary[..self.facets].iter().zip(&self.star) {
            let [x, y, z] = b.vertices;
            store.set_neighbours(
                tet,
                [b.outside, table[edge(z, y)], table[edge(x, z)], table[edge(y, x)]],
            );
        }
        true
    }

    #[cold]
    fn link_by_sorting<S: Store>(&mut self, store: &mut S) {
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * self.star.len());
        for (b, &tet) in self.boundary[..self.facets].iter().zip(&self.star) {
            let [_, x, y, z] = store.tet(tet);
            store.set_neighbour(4 * tet, b.outside);
            for (p, q, k) in [(y, z, 1), (z, x, 2), (x, y, 3)] {
                edges.push(([p.min(q), p.max(q)], 4 * tet + k));
            }
        }
        edges.sort_unstable();
        for pair in edges.chunks(2) {
            debug_assert_eq!(pair[0].0, pair[1].0);
            store.set_neighbour(pair[0].1, pair[1].1);
            store.set_neighbour(pair[1].1, pair[0].1);
        }
    }
}

/// Vertices of facet `k`, counter-clockwise seen from outside.
#[inline(always)]
fn facet(v: [u32; 4], k: usize) -> [u32; 3] {
    let [i, j, l] = FACET[k];
    [v[i], v[j], v[l]]
}

/// Place of a directed edge in the table.
#[inline(always)]
fn edge(from: u32, to: u32) -> usize {
    from as usize % TABLE * TABLE + to as usize % TABLE
}

/// Rotates a facet so that the infinite vertex, if it is one of the three, comes last.
#[inline(always)]
fn infinite_last([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a == INF {
        [b, c, a]
    } else if b == INF {
        [c, a, b]
    } else {
        [a, b, c]
    }
}
