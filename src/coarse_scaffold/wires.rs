//! Persistence of wires: how far the surface moves without them.
//!
//! In: the network and its chains. Out: a persistence for each chain that is a wire.
//!
//! No fire crosses a wire that the regularisation keeps, so erosion thickness grades none of them. What grades them is what keeps them: the
//! distance from the surface to the medial balls that are left when they go.
//!
//! 1. The complex less its wires falls into blocks: tips and junctions, which are single vertices, and everything that hangs together
//!    by sheets. Wires join blocks to a graph.
//! 2. A wire can go when what hangs on its one end holds on to nothing else and can be shrunk to a point: a tip, a junction whose
//!    other wires are gone, a block of sheets without tunnels and cavities. It takes that block with it. The cost is the largest distance from a
//!    generator to the balls that would be left, and not less than the persistence of the sheets that go as well.
//! 3. The cheapest goes first; costs only rise as others go, so they are measured anew when their turn comes.
//! 4. Wires that are never free hold a tunnel open or lie between two blocks that cannot be shrunk: without them the topology would be
//!    another. They get the diagonal.
//!
//! Cost: a search among the balls for each generator of each wire, `O(n log n)` for wires without many forks.

use super::hypergraph::CurveKind;
use super::network::{Chain, Network};
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;
use crate::regularise::balls::BallTree;
use crate::regularise::queue::Queue;

/// What wires hold together.
struct Block {
    vertices: Vec<u32>,
    /// Wires that end here and are still there.
    wires: Vec<usize>,
    /// Whether it can be shrunk to a point.
    shrinks: bool,
    /// Largest persistence of what is or was here, mm.
    persistence: f64,
}

/// A wire between two blocks.
struct Wire {
    chain: usize,
    blocks: [usize; 2],
    inner: Vec<u32>,
}

/// Persistence of each chain that is a wire, mm; 0 for others. `sheet_facets` and `sheet_persistence` are those of the sheets.
pub(crate) fn wire_persistence(
    network: &Network,
    chains: &[Chain],
    sheet_facets: &[Vec<u32>],
    sheet_persistence: &[f64],
) -> Vec<f64> {
    let mut out = vec![0.0; chains.len()];
    if !chains.iter().any(|c| c.kind == CurveKind::Wire) {
        return out;
    }
    let (mut blocks, wires) = blocks_and_wires(network, chains, sheet_facets, sheet_persistence);
    let mut witnesses = Witnesses::new(network);
    let mut gone = vec![false; wires.len()];
    // Number of removals at which each side of each wire was measured.
    let mut measured: Vec<Option<usize>> = vec![None; 2 * wires.len()];
    let mut removals = 0;
    let mut queue = Queue::new();
    for (w, wire) in wires.iter().enumerate() {
        out[wire.chain] = network.fine.scale.diagonal_mm;
        // What a side costs at least: a bone's sheets are not measured while the wire can go with its tip.
        (0..2).for_each(|side| queue.push(blocks[wire.blocks[side]].persistence, (2 * w + side) as u32));
    }
    while let Some((known, id)) = queue.pop() {
        let (w, side) = (id as usize / 2, id as usize % 2);
        let wire = &wires[w];
        let [near, far] = [wire.blocks[side], wire.blocks[1 - side]];
        if gone[w] || blocks[near].wires != [w] || !blocks[near].shrinks {
            continue;
        }
        let leaving = || blocks[near].vertices.iter().chain(&wire.inner).copied();
        if measured[id as usize] != Some(removals) {
            measured[id as usize] = Some(removals);
            let movement = witnesses.movement(network, leaving());
            queue.push(movement.max(blocks[near].persistence).max(known), id);
            continue;
        }
        gone[w] = true;
        removals += 1;
        out[wire.chain] = known;
        witnesses.remove(network, leaving());
        blocks[near].wires.clear();
        blocks[far].wires.retain(|&x| x != w);
        blocks[far].persistence = blocks[far].persistence.max(known);
        if let [last] = blocks[far].wires[..] {
            (0..2).for_each(|side| queue.push(known, (2 * last + side) as u32));
        }
    }
    out
}

/// The blocks that the wires leave, and the wires between them.
fn blocks_and_wires(
    network: &Network,
    chains: &[Chain],
    sheet_facets: &[Vec<u32>],
    sheet_persistence: &[f64],
) -> (Vec<Block>, Vec<Wire>) {
    let (fine, alive) = (network.fine, &network.regularised.alive);
    let mut on_wire = vec![false; fine.num_edges()];
    let of_wire = || {
        chains
            .iter()
            .enumerate()
            .filter(|(_, c)| c.kind == CurveKind::Wire)
    };
    for &e in of_wire().flat_map(|(_, c)| &c.edges) {
        on_wire[e as usize] = true;
    }
    let mut sets = DisjointSets::new(fine.num_vertices());
    for e in (0..fine.num_edges()).filter(|&e| alive.edges[e] && !on_wire[e]) {
        let [a, b] = fine.edge_vertices[e];
        sets.union(a, b);
    }
    // What hangs on the middle of a wire (hidden whiskers) goes with the wire.
    let mut owner = vec![NONE; fine.num_vertices()];
    let mut wires: Vec<Wire> = Vec::new();
    for (chain, c) in of_wire() {
        for &v in &c.vertices[1..c.vertices.len() - 1] {
            owner[sets.find(v) as usize] = wires.len() as u32;
        }
        wires.push(Wire {
            chain,
            blocks: [0, 0],
            inner: Vec::new(),
        });
    }
    let mut slot = vec![NONE; fine.num_vertices()];
    let mut blocks: Vec<Block> = Vec::new();
    for v in (0..fine.num_vertices() as u32).filter(|&v| alive.vertices[v as usize]) {
        let root = sets.find(v) as usize;
        if owner[root] != NONE {
            wires[owner[root] as usize].inner.push(v);
            continue;
        }
        if slot[root] == NONE {
            slot[root] = blocks.len() as u32;
            blocks.push(Block {
                vertices: Vec::new(),
                wires: Vec::new(),
                shrinks: true,
                persistence: 0.0,
            });
        }
        blocks[slot[root] as usize].vertices.push(v);
    }
    for (w, wire) in wires.iter_mut().enumerate() {
        let vertices = &chains[wire.chain].vertices;
        wire.blocks = [vertices[0], vertices[vertices.len() - 1]].map(|v| {
            let block = slot[sets.find(v) as usize];
            // A closed wire without nodes has no block; it is its own loop.
            if block == NONE { usize::MAX } else { block as usize }
        });
        for b in wire.blocks.into_iter().filter(|&b| b != usize::MAX) {
            blocks[b].wires.push(w);
        }
    }
    wires.retain(|w| w.blocks[0] != usize::MAX);
    for (facets, &persistence) in sheet_facets.iter().zip(sheet_persistence) {
        let v = fine.facet_vertices(facets[0] as usize)[0];
        let block = &mut blocks[slot[sets.find(v) as usize] as usize];
        block.persistence = block.persistence.max(persistence);
    }
    let whole = network.regularised.betti();
    if whole.b1 != 0 || whole.b2 != 0 {
        for block in blocks
            .iter_mut()
            .filter(|b| b.vertices.len() > 1 && !b.wires.is_empty())
        {
            block.shrinks = shrinks(network, &on_wire, &block.vertices);
        }
    }
    (blocks, wires)
}

/// Whether a block has no tunnel and no cavity.
fn shrinks(network: &Network, on_wire: &[bool], vertices: &[u32]) -> bool {
    let (fine, alive) = (network.fine, &network.regularised.alive);
    let mut own = vec![false; fine.num_vertices()];
    vertices.iter().for_each(|&v| own[v as usize] = true);
    let edges: Vec<bool> = (0..fine.num_edges())
        .map(|e| alive.edges[e] && !on_wire[e] && own[fine.edge_vertices[e][0] as usize])
        .collect();
    let facets: Vec<bool> = (0..fine.num_facets())
        .map(|f| alive.facets[f] && own[fine.facet_vertices(f)[0] as usize])
        .collect();
    let betti = fine.betti_of(&own, &edges, &facets, &vec![false; fine.num_cells()]);
    betti.b1 == 0 && betti.b2 == 0
}

/// The nearest medial ball of each generator, among those not removed yet.
struct Witnesses {
    tree: BallTree,
    left: Vec<bool>,
    /// Generators of each vertex.
    hosted: Vec<Vec<u32>>,
    /// Tolerance at each generator, mm.
    tolerance_mm: Vec<f64>,
}

impl Witnesses {
    fn new(network: &Network) -> Self {
        let (fine, regularised) = (network.fine, network.regularised);
        let left = regularised.alive.vertices.clone();
        let alive: Vec<u32> = (0..left.len() as u32).filter(|&v| left[v as usize]).collect();
        let tree = BallTree::new(alive, &fine.vertex_position, &fine.vertex_radius);
        let mut witness = regularised.nearest_vertex.clone();
        witness.resize(fine.generator_position.len(), NONE);
        for (e, generators) in fine.edge_generators.iter().enumerate() {
            for v in fine.edge_vertices[e].into_iter().filter(|&v| left[v as usize]) {
                generators.iter().for_each(|g| witness[g.index()] = v);
            }
        }
        let mut hosted = vec![Vec::new(); left.len()];
        let mut tolerance_mm = vec![regularised.tolerance_mm; witness.len()];
        for (g, &v) in witness.iter().enumerate().filter(|(_, v)| **v != NONE) {
            hosted[v as usize].push(g as u32);
            tolerance_mm[g] = regularised.tolerance_at(v);
        }
        Self {
            tree,
            left,
            hosted,
            tolerance_mm,
        }
    }

    /// A tree of the balls left, where a search among all would pass over too many that are gone.
    fn rebuilt(&self, network: &Network, leaving: usize) -> Option<BallTree> {
        let left: Vec<u32> = (0..self.left.len() as u32)
            .filter(|&v| self.left[v as usize])
            .collect();
        let fine = network.fine;
        (leaving > left.len()).then(|| BallTree::new(left, &fine.vertex_position, &fine.vertex_radius))
    }

    /// How far the surface moves when some vertices go, mm at the scale of persistences.
    fn movement(&mut self, network: &Network, leaving: impl Iterator<Item = u32>) -> f64 {
        let leaving: Vec<u32> = leaving.filter(|&v| self.left[v as usize]).collect();
        leaving.iter().for_each(|&v| self.left[v as usize] = false);
        let rebuilt = self.rebuilt(network, leaving.len());
        let tree = rebuilt.as_ref().unwrap_or(&self.tree);
        let share = |g: u32| {
            let point = network.fine.generator_position[g as usize];
            let near = tree.nearest(point, None, |v| self.left[v as usize]);
            near.map_or(0.0, |b| b.distance.max(0.0) / self.tolerance_mm[g as usize])
        };
        let hosted = leaving.iter().flat_map(|&v| &self.hosted[v as usize]);
        let worst = hosted.map(|&g| share(g)).fold(0.0, f64::max);
        leaving.iter().for_each(|&v| self.left[v as usize] = true);
        network.regularised.at_scale(worst)
    }

    /// Removes some vertices; their generators fall to the nearest balls that are left.
    fn remove(&mut self, network: &Network, leaving: impl Iterator<Item = u32>) {
        let leaving: Vec<u32> = leaving.filter(|&v| self.left[v as usize]).collect();
        leaving.iter().for_each(|&v| self.left[v as usize] = false);
        if let Some(tree) = self.rebuilt(network, leaving.len()) {
            self.tree = tree;
        }
        for v in leaving {
            for g in std::mem::take(&mut self.hosted[v as usize]) {
                let point = network.fine.generator_position[g as usize];
                if let Some(ball) = self.tree.nearest(point, None, |v| self.left[v as usize]) {
                    self.hosted[ball.id as usize].push(g);
                }
            }
        }
    }
}
