//! The star of a new point: one tetrahedron a boundary facet of the cavity, linked to its siblings and to the outside.
//!
//! In: the cavity and its boundary. Out: the store with the cavity replaced. Two tetrahedra of the star are neighbours when
//! their facets on the boundary share an edge. The vertices of the boundary are numbered as they come, and a small table,
//! indexed by the numbers of an edge's two ends, tells which tetrahedron has the edge (Marot, Pellerin & Remacle 2019, "One
//! machine, one minute, three billion tetrahedra"). Stars too large for the table are linked by sorting their edges.

use super::canonical::zeros;
use super::insertion::{INF, Memory};
use super::store::Store;

/// Stars of more vertices than this are linked by sorting their edges instead of by the table.
const TABLE: usize = 64;

/// A facet between the cavity and the rest.
#[derive(Clone, Copy, Default)]
pub(super) struct Boundary {
    /// Its vertices, counter-clockwise seen from outside the cavity; the infinite one last.
    pub vertices: [u32; 3],
    /// The facet as seen from outside, packed.
    pub outside: u32,
}

/// Numbers of the vertices of a star and the table of its edges.
pub(super) struct Links {
    /// For each vertex the star it was last numbered for and its number in it; the infinite vertex has the last place.
    numbers: Vec<u32>,
    /// Number of this star times [`TABLE`].
    star: u32,
    /// For each directed edge the packed facet that has it.
    table: Vec<u32>,
    /// For each boundary facet the numbers of its vertices.
    local: Vec<[u8; 4]>,
}

impl Links {
    /// For `points` vertices.
    pub(super) fn new(points: usize) -> Self {
        Self {
            numbers: zeros(points + 1),
            star: 0,
            table: vec![0; TABLE * TABLE],
            local: vec![[0; 4]; 2 * TABLE],
        }
    }

    /// Begins a star.
    #[inline(always)]
    fn begin(&mut self) {
        if self.star > u32::MAX - 2 * TABLE as u32 {
            self.numbers.fill(0);
            self.star = 0;
        }
        self.star += TABLE as u32;
    }
}

impl Memory {
    /// Replaces the cavity by the star of `v`.
    #[inline(always)]
    pub(super) fn fill<S: Store>(&mut self, store: &mut S, v: u32) {
        // The star takes the slots of the cavity first.
        for slot in &mut self.cavity[self.inside.min(self.facets)..self.facets] {
            *slot = store.slot();
        }
        for &slot in &self.cavity[self.facets.min(self.inside)..self.inside] {
            store.free(slot);
        }
        // A star of f tetrahedra has f / 2 + 2 vertices besides its centre.
        if self.facets / 2 + 2 <= TABLE {
            self.fill_by_table(store, v);
        } else {
            self.fill_by_sorting(store, v);
        }
        self.last = self.cavity[0];
    }

    #[inline(always)]
    fn fill_by_table<S: Store>(&mut self, store: &mut S, v: u32) {
        self.links.begin();
        let star = self.links.star;
        let facets = self.facets;
        let boundary = &mut self.boundary[..facets];
        let slots = &self.cavity[..facets];
        let numbers = self.links.numbers.as_mut_slice();
        let local = &mut self.links.local[..facets];
        let table: &mut [u32; TABLE * TABLE] = self
            .links
            .table
            .as_mut_slice()
            .try_into()
            .expect("the table is made this size");
        let infinite = numbers.len() - 1;
        let mut count = 0;
        for ((b, &tet), l) in boundary.iter_mut().zip(slots).zip(local.iter_mut()) {
            let [x, y, z] = infinite_last(b.vertices);
            store.set_tet(tet, [v, x, y, z]);
            store.set_neighbour(b.outside, 4 * tet);
            store.forget(b.outside >> 2);
            let mut number = |v: u32| {
                let place = &mut numbers[(v as usize).min(infinite)];
                let known = *place ^ star;
                let fresh = known >= TABLE as u32;
                let number = if fresh { count } else { known };
                *place = star + number;
                count += u32::from(fresh);
                number
            };
            let [x, y, z] = [number(x), number(y), number(z)];
            table[edge(x, y)] = 4 * tet + 3;
            table[edge(y, z)] = 4 * tet + 1;
            table[edge(z, x)] = 4 * tet + 2;
            *l = [x as u8, y as u8, z as u8, 0];
        }
        for ((b, &tet), l) in boundary.iter().zip(slots).zip(local.iter()) {
            let [x, y, z, _] = l.map(u32::from);
            store.set_neighbours(
                tet,
                [b.outside, table[edge(z, y)], table[edge(x, z)], table[edge(y, x)]],
            );
        }
    }

    #[cold]
    fn fill_by_sorting<S: Store>(&mut self, store: &mut S, v: u32) {
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * self.facets);
        for (b, &tet) in self.boundary[..self.facets].iter().zip(&self.cavity) {
            let [x, y, z] = infinite_last(b.vertices);
            store.set_tet(tet, [v, x, y, z]);
            store.set_neighbour(b.outside, 4 * tet);
            store.forget(b.outside >> 2);
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
