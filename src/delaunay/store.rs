//! Where tetrahedra are kept while they are built: plain arrays for one thread, atomic ones for many.
//!
//! Both are structures of arrays of `u32`: four vertices and four neighbours (packed as `4 * tet + facet`). The two highest
//! bits of the first vertex note what the current insertion knows of a tetrahedron; they are clear between insertions. The
//! insertion is written once, over [`Store`]; a store also answers whether a tetrahedron may be touched, which with one
//! thread is always so.

use super::insertion::INF;

/// Bit of the first vertex: the tetrahedron was looked at.
pub(super) const SEEN: u32 = 1 << 30;
/// Bit of the first vertex: and it is in conflict.
pub(super) const INSIDE: u32 = 1 << 31;
/// The first vertex without its notes.
pub(super) const VERTEX: u32 = SEEN - 1;
/// Vertices of a slot that holds no tetrahedron.
pub(super) const NOTHING: [u32; 4] = [INF; 4];

/// Tetrahedra under construction, as one thread sees them.
pub(super) trait Store {
    /// Whether other threads work on the same tetrahedra.
    const SHARED: bool;
    /// Number of slots, with and without tetrahedra.
    fn slots(&self) -> u32;
    /// Vertices of a tetrahedron; the first is [`VERTEX`] in a slot that holds none.
    fn tet(&self, tet: u32) -> [u32; 4];
    /// Neighbours of a tetrahedron.
    fn neighbours(&self, tet: u32) -> [u32; 4];
    /// One neighbour.
    fn neighbour(&self, tet: u32, facet: usize) -> u32;
    /// Writes the vertices; nothing is noted.
    fn set_tet(&mut self, tet: u32, vertices: [u32; 4]);
    /// Writes the neighbours.
    fn set_neighbours(&mut self, tet: u32, neighbours: [u32; 4]);
    /// Writes the neighbour across a packed facet.
    fn set_neighbour(&mut self, facet: u32, neighbour: u32);
    /// Whether this thread may touch a tetrahedron.
    fn owns(&self, tet: u32) -> bool;
    /// Visits a tetrahedron: 1 the first time, else 0.
    fn visit(&mut self, tet: u32) -> usize;
    /// Notes whether a visited tetrahedron is in conflict.
    fn note(&mut self, tet: u32, inside: bool);
    /// Whether a visited tetrahedron is in conflict.
    fn is_inside(&self, tet: u32) -> bool;
    /// Forgets what was noted.
    fn forget(&mut self, tet: u32);
    /// Makes sure that `needed` slots can be had from [`Self::slot`]; `false` when there is no room.
    fn reserve(&mut self, needed: usize) -> bool;
    /// A slot for a new tetrahedron.
    fn slot(&mut self) -> u32;
    /// Gives a slot back.
    fn free(&mut self, tet: u32);
}

/// Plain arrays.
#[derive(Debug, Default)]
pub(super) struct Plain {
    pub vertices: Vec<[u32; 4]>,
    pub neighbours: Vec<[u32; 4]>,
    /// Slots that hold no tetrahedron.
    pub free: Vec<u32>,
}

impl Plain {
    /// Room for `capacity` tetrahedra; grows when needed.
    pub(super) fn with_capacity(capacity: usize) -> Self {
        Self {
            vertices: Vec::with_capacity(capacity),
            neighbours: Vec::with_capacity(capacity),
            free: Vec::new(),
        }
    }

    /// A slot that holds a tetrahedron.
    pub(super) fn any(&self) -> Option<u32> {
        self.vertices.iter().position(|v| *v != NOTHING).map(|i| i as u32)
    }

    /// Grows by an eighth instead of doubling, which would pass the memory that is promised.
    #[cold]
    fn grow(&mut self) {
        let more = (self.vertices.len() / 8).max(1024);
        self.vertices.reserve_exact(more);
        self.neighbours.reserve_exact(more);
    }
}

impl Store for Plain {
    const SHARED: bool = false;

    #[inline(always)]
    fn slots(&self) -> u32 {
        self.vertices.len() as u32
    }

    #[inline(always)]
    fn tet(&self, tet: u32) -> [u32; 4] {
        let [a, b, c, d] = self.vertices[tet as usize];
        [a & VERTEX, b, c, d]
    }

    #[inline(always)]
    fn neighbours(&self, tet: u32) -> [u32; 4] {
        self.neighbours[tet as usize]
    }

    #[inline(always)]
    fn neighbour(&self, tet: u32, facet: usize) -> u32 {
        self.neighbours[tet as usize][facet]
    }

    #[inline(always)]
    fn set_tet(&mut self, tet: u32, vertices: [u32; 4]) {
        self.vertices[tet as usize] = vertices;
    }

    #[inline(always)]
    fn set_neighbours(&mut self, tet: u32, neighbours: [u32; 4]) {
        self.neighbours[tet as usize] = neighbours;
    }

    #[inline(always)]
    fn set_neighbour(&mut self, facet: u32, neighbour: u32) {
        self.neighbours[(facet >> 2) as usize][(facet & 3) as usize] = neighbour;
    }

    #[inline(always)]
    fn owns(&self, _tet: u32) -> bool {
        true
    }

    #[inline(always)]
    fn visit(&mut self, tet: u32) -> usize {
        // Without a branch: which it will be cannot be foreseen.
        let first = &mut self.vertices[tet as usize][0];
        let seen = *first >> 30;
        *first |= SEEN;
        usize::from(seen == 0)
    }

    #[inline(always)]
    fn note(&mut self, tet: u32, inside: bool) {
        self.vertices[tet as usize][0] |= u32::from(inside) << 31;
    }

    #[inline(always)]
    fn is_inside(&self, tet: u32) -> bool {
        self.vertices[tet as usize][0] >= INSIDE
    }

    #[inline(always)]
    fn forget(&mut self, tet: u32) {
        self.vertices[tet as usize][0] &= VERTEX;
    }

    #[inline(always)]
    fn reserve(&mut self, _needed: usize) -> bool {
        true
    }

    #[inline(always)]
    fn slot(&mut self) -> u32 {
        if let Some(slot) = self.free.pop() {
            return slot;
        }
        if self.vertices.len() == self.vertices.capacity() {
            self.grow();
        }
        self.vertices.push(NOTHING);
        self.neighbours.push([0; 4]);
        (self.vertices.len() - 1) as u32
    }

    #[inline(always)]
    fn free(&mut self, tet: u32) {
        self.vertices[tet as usize] = NOTHING;
        self.free.push(tet);
    }
}
