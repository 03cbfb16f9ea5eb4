//! Exact maximum clique by bitset branch and bound.
//!
//! In: an undirected graph, a work limit. Out: a largest set of vertices that are all joined, and whether it is
//! proven largest.
//!
//! 1. Vertices are put in degeneracy order (a vertex of least remaining degree goes last).
//! 2. A greedy clique along that order gives the first incumbent.
//! 3. Branch and bound: the candidates are coloured greedily with bit-parallel sets; a clique takes at most one vertex
//!    a colour, so vertices whose colour cannot lift the current set above the incumbent are not branched on.
//!
//! E. Tomita, T. Seki, "An efficient branch-and-bound algorithm for finding a maximum clique", DMTCS 2003; P. San
//! Segundo et al., "An exact bit-parallel algorithm for the maximum clique problem", Computers & OR 38 (2011).
//! The limit counts search nodes, not seconds, so the answer does not depend on the machine. Worst case exponential;
//! dense graphs of length-consistent pairs are the slow ones.

/// An undirected graph as adjacency bitsets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    vertices: usize,
    words: usize,
    bits: Vec<u64>,
}

impl Graph {
    /// A graph without edges.
    pub fn new(vertices: usize) -> Self {
        let words = vertices.div_ceil(64);
        Self {
            vertices,
            words,
            bits: vec![0; vertices * words],
        }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// Joins two vertices; a vertex is never joined to itself.
    ///
    /// # Panics
    /// When there is no such vertex.
    pub fn join(&mut self, a: usize, b: usize) {
        assert!(a < self.vertices && b < self.vertices, "no such vertex");
        if a != b {
            self.bits[a * self.words + b / 64] |= 1 << (b % 64);
            self.bits[b * self.words + a / 64] |= 1 << (a % 64);
        }
    }

    /// Whether two vertices are joined.
    pub fn joined(&self, a: usize, b: usize) -> bool {
        self.row(a)[b / 64] >> (b % 64) & 1 == 1
    }

    /// Number of neighbours.
    pub fn degree(&self, a: usize) -> usize {
        self.row(a).iter().map(|w| w.count_ones() as usize).sum()
    }

    fn row(&self, a: usize) -> &[u64] {
        &self.bits[a * self.words..(a + 1) * self.words]
    }
}

/// A clique found by [`max_clique`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clique {
    /// Its vertices, ascending.
    pub vertices: Vec<usize>,
    /// Whether no larger clique exists; false only when the work limit was reached.
    pub proven: bool,
    /// Search nodes visited.
    pub search_nodes: usize,
}

/// Finds a maximum clique, visiting at most `max_search_nodes` search nodes.
///
/// # Example
/// ```
/// use matchers::pose::{Graph, max_clique};
/// let mut g = Graph::new(4);
/// for (a, b) in [(0, 1), (1, 2), (0, 2), (2, 3)] {
///     g.join(a, b);
/// }
/// let best = max_clique(&g, 1000);
/// assert_eq!((best.vertices, best.proven), (vec![0, 1, 2], true));
/// ```
pub fn max_clique(graph: &Graph, max_search_nodes: usize) -> Clique {
    let n = graph.vertices;
    let order = degeneracy_order(graph);
    let mut place = vec![0; n];
    for (k, &v) in order.iter().enumerate() {
        place[v] = k;
    }
    let mut sorted = Graph::new(n);
    for a in 0..n {
        for b in bits_of(graph.row(a)) {
            sorted.join(place[a], place[b]);
        }
    }
    let mut search = Search {
        graph: &sorted,
        best: greedy(&sorted),
        current: Vec::new(),
        visited: 0,
        limit: max_search_nodes,
        stopped: false,
    };
    let mut all = vec![0u64; sorted.words];
    (0..n).for_each(|v| all[v / 64] |= 1 << (v % 64));
    search.expand(&mut all);
    let mut vertices: Vec<usize> = search.best.iter().map(|&k| order[k]).collect();
    vertices.sort_unstable();
    Clique {
        vertices,
        proven: !search.stopped,
        search_nodes: search.visited,
    }
}

/// Vertices so that each has least degree among itself and those before it (the first are the densest core).
fn degeneracy_order(graph: &Graph) -> Vec<usize> {
    let n = graph.vertices;
    let mut degree: Vec<usize> = (0..n).map(|v| graph.degree(v)).collect();
    let mut gone = vec![false; n];
    let mut order = vec![0; n];
    for slot in (0..n).rev() {
        let v = (0..n)
            .filter(|&v| !gone[v])
            .min_by_key(|&v| (degree[v], v))
            .expect("slots as many as vertices");
        gone[v] = true;
        order[slot] = v;
        for b in bits_of(graph.row(v)) {
            degree[b] = degree[b].saturating_sub(1);
        }
    }
    order
}

fn greedy(graph: &Graph) -> Vec<usize> {
    let mut best = Vec::new();
    // A few starts from the dense end; the search proves or improves the rest.
    for start in 0..graph.vertices.min(8) {
        let mut candidates = graph.row(start).to_vec();
        let mut clique = vec![start];
        while let Some(v) = first_bit(&candidates) {
            clique.push(v);
            candidates.iter_mut().zip(graph.row(v)).for_each(|(c, r)| *c &= r);
        }
        if clique.len() > best.len() {
            best = clique;
        }
    }
    best
}

struct Search<'a> {
    graph: &'a Graph,
    best: Vec<usize>,
    current: Vec<usize>,
    visited: usize,
    limit: usize,
    stopped: bool,
}

impl Search<'_> {
    fn expand(&mut self, candidates: &mut [u64]) {
        let (order, colour) = self.colour(candidates);
        for k in (0..order.len()).rev() {
            if self.stopped || self.current.len() + colour[k] <= self.best.len() {
                return;
            }
            self.visited += 1;
            if self.visited > self.limit {
                self.stopped = true;
                return;
            }
            let v = order[k];
            self.current.push(v);
            let mut inner: Vec<u64> = candidates
                .iter()
                .zip(self.graph.row(v))
                .map(|(c, r)| c & r)
                .collect();
            if inner.iter().all(|w| *w == 0) {
                if self.current.len() > self.best.len() {
                    self.best = self.current.clone();
                }
            } else {
                self.expand(&mut inner);
            }
            self.current.pop();
            candidates[v / 64] &= !(1 << (v % 64));
        }
    }

    /// Greedy colouring of the candidates that may still improve the incumbent: vertices and colours, colours ascending.
    fn colour(&self, candidates: &[u64]) -> (Vec<usize>, Vec<usize>) {
        let needed = (self.best.len() + 1).saturating_sub(self.current.len());
        let mut uncoloured = candidates.to_vec();
        let mut class = vec![0u64; candidates.len()];
        let (mut order, mut colours) = (Vec::new(), Vec::new());
        let mut colour = 1;
        while uncoloured.iter().any(|w| *w != 0) {
            class.copy_from_slice(&uncoloured);
            while let Some(v) = first_bit(&class) {
                uncoloured[v / 64] &= !(1 << (v % 64));
                class[v / 64] &= !(1 << (v % 64));
                class
                    .iter_mut()
                    .zip(self.graph.row(v))
                    .for_each(|(c, r)| *c &= !r);
                if colour >= needed {
                    order.push(v);
                    colours.push(colour);
                }
            }
            colour += 1;
        }
        (order, colours)
    }
}

fn first_bit(words: &[u64]) -> Option<usize> {
    let k = words.iter().position(|w| *w != 0)?;
    Some(64 * k + words[k].trailing_zeros() as usize)
}

fn bits_of(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(k, &w)| {
        let mut w = w;
        std::iter::from_fn(move || {
            if w == 0 {
                return None;
            }
            let b = w.trailing_zeros() as usize;
            w &= w - 1;
            Some(64 * k + b)
        })
    })
}
