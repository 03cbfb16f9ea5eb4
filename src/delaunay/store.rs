//! Where tetrahedra are kept while they are built: plain arrays for one thread, atomic ones for many.
//!
//! Both are structures of arrays of `u32`: four vertices, four neighbours (packed as `4 * tet + facet`) and one word of state
//! for each tetrahedron. The insertion is written once, over [`Store`]; a store also answers whether a tetrahedron may be
//! touched, which with one thread is always so.

/// Tetrahedra under construction, as one thread sees them.
pub(super) trait Store {
    /// Whether other threads work on the same tetrahedra.
    const SHARED: bool;
    /// Vertices of a tetrahedron.
    fn tet(&self, tet: u32) -> [u32; 4];
    /// Neighbours of a tetrahedron.
    fn neighbours(&self, tet: u32) -> [u32; 4];
    /// One neighbour.
    fn neighbour(&self, tet: u32, facet: usize) -> u32;
    /// Writes the vertices.
    fn set_tet(&mut self, tet: u32, vertices: [u32; 4]);
    /// Writes the neighbours.
    fn set_neighbours(&mut self, tet: u32, neighbours: [u32; 4]);
    /// Writes the neighbour across a packed facet.
    fn set_neighbour(&mut self, facet: u32, neighbour: u32);
    /// Begins an insertion: every tetrahedron is new.
    fn begin(&mut self);
    /// Makes sure that a tetrahedron is taken by this thread; `false` when another holds it.
    fn take(&mut self, tet: u32) -> bool;
    /// Visits a taken tetrahedron: 1 the first time, when it is noted as outside, else 0.
    fn visit(&mut self, tet: u32) -> usize;
    /// Notes whether a visited tetrahedron is in conflict.
    fn note(&mut self, tet: u32, inside: bool);
    /// Whether a visited tetrahedron is in conflict.
    fn is_inside(&self, tet: u32) -> bool;
    /// Whether a taken tetrahedron was visited and is not in conflict.
    fn is_outside(&self, tet: u32) -> bool;
    /// Makes sure that `needed` slots can be had from [`Self::slot`]; `false` when there is no room.
    fn reserve(&mut self, needed: usize) -> bool;
    /// A slot for a new tetrahedron, taken.
    fn slot(&mut self) -> u32;
    /// Gives a slot back.
    fn free(&mut self, tet: u32);
    /// Lets go of a taken tetrahedron.
    fn release(&mut self, tet: u32);
}

/// Plain arrays.
#[derive(Debug, Default)]
pub(super) struct Plain {
    pub vertices: Vec<[u32; 4]>,
    pub neighbours: Vec<[u32; 4]>,
    /// Last insertion that looked at a tetrahedron and what it found: `2 * insertion + inside`.
    stamps: Vec<u32>,
    insertion: u32,
    /// Slots that hold no tetrahedron.
    pub free: Vec<u32>,
}

impl Plain {
    /// Room for `capacity` tetrahedra; grows when needed.
    pub(super) fn with_capacity(capacity: usize) -> Self {
        Self {
            vertices: Vec::with_capacity(capacity),
            neighbours: Vec::with_capacity(capacity),
            stamps: Vec::with_capacity(capacity),
            ..Self::default()
        }
    }

    /// A store of given tetrahedra.
    pub(super) fn from_parts(vertices: Vec<[u32; 4]>, neighbours: Vec<[u32; 4]>, free: Vec<u32>) -> Self {
        Self {
            stamps: vec![0; vertices.len()],
            vertices,
            neighbours,
            insertion: 0,
            free,
        }
    }

    /// Slots that hold a tetrahedron.
    pub(super) fn used(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.vertices.len() as u32).filter(|tet| !self.free.contains(tet))
    }

    /// Grows by an eighth instead of doubling, which would pass the memory that is promised.
    #[cold]
    fn grow(&mut self) {
        let more = (self.vertices.len() / 8).max(1024);
        self.vertices.reserve_exact(more);
        self.neighbours.reserve_exact(more);
        self.stamps.reserve_exact(more);
    }
}

impl Store for Plain {
    const SHARED: bool = false;

    #[inline(always)]
    fn tet(&self, tet: u32) -> [u32; 4] {
        self.vertices[tet as usize]
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
    fn begin(&mut self) {
        self.insertion += 1;
    }

    #[inline(always)]
    fn take(&mut self, _tet: u32) -> bool {
        true
    }

    #[inline(always)]
    fn visit(&mut self, tet: u32) -> usize {
        let stamp = &mut self.stamps[tet as usize];
        // Stamps only grow. Without a branch: which it will be cannot be foreseen.
        let first = *stamp < 2 * self.insertion;
        *stamp = (*stamp).max(2 * self.insertion);
        usize::from(first)
    }

    #[inline(always)]
    fn note(&mut self, tet: u32, inside: bool) {
        self.stamps[tet as usize] = 2 * self.insertion + u32::from(inside);
    }

    #[inline(always)]
    fn is_inside(&self, tet: u32) -> bool {
        self.stamps[tet as usize] == 2 * self.insertion + 1
    }

    #[inline(always)]
    fn is_outside(&self, tet: u32) -> bool {
        self.stamps[tet as usize] == 2 * self.insertion
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
        self.vertices.push([0; 4]);
        self.neighbours.push([0; 4]);
        self.stamps.push(0);
        (self.vertices.len() - 1) as u32
    }

    #[inline(always)]
    fn free(&mut self, tet: u32) {
        self.free.push(tet);
    }

    #[inline(always)]
    fn release(&mut self, _tet: u32) {}
}
