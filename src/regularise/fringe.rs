//! Step 5b: fringes are trimmed. Growing back down to a small erosion thickness (ET) leaves fingers along the ribs, one for each place where
//! the sampling happens to bend the surface a little more; they are narrower than the tolerance and mean nothing.
//!
//! Morphological opening of the sheets (Serra, "Image Analysis and Mathematical Morphology", 1982):
//!
//! 1. the way to the nearest rib, along facets, for every facet near one;
//! 2. the core: facets at least `width` away from every rib;
//! 3. what lies within `width` of the core stays; the rest with an ET below `most` is fringe;
//! 4. each connected piece of fringe is collapsed from its ribs, its dangling edges with it, and put back should the surface move
//!    by more than `movement` or should it leave a wire.
//!
//! Elementary collapses only. Cost `O(n log n)` in the facets near ribs.

use super::collapse::collapse_facets;
use super::complex::Complex;
use super::cover::Cover;
use super::measure::Measure;
use super::queue::Queue;
use super::splice::remove_spines;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;

/// What counts as fringe. All in tolerances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fringe {
    /// Half the width of the widest finger.
    pub width: f64,
    /// Erosion thickness below which facets may go.
    pub most: f64,
    /// Largest movement of the surface.
    pub movement: f64,
}

/// Trims fringes. Returns the number of pieces that went.
pub(crate) fn trim_fringes(
    complex: &mut Complex,
    measure: &Measure,
    relative: &[f64],
    fringe: Fringe,
    cover: &mut Cover,
) -> usize {
    let pieces = pieces(complex, measure, relative, fringe);
    let mut piece_of = vec![NONE; complex.fine.num_facets()];
    for (k, facets) in pieces.iter().enumerate() {
        for &f in facets {
            piece_of[f as usize] = k as u32;
        }
    }
    let mut trimmed = 0;
    for (k, facets) in pieces.iter().enumerate() {
        let since = complex.log.len();
        collapse_facets(complex, measure, facets.iter().copied(), |f| {
            (piece_of[f as usize] == k as u32).then(|| relative[f as usize])
        });
        if complex.log.len() == since {
            continue;
        }
        remove_spines(complex, facets);
        let leaves_wire = facets
            .iter()
            .flat_map(|&f| complex.fine.facet_edges(f as usize))
            .any(|&e| complex.edge_alive[e as usize] && complex.edge_count[e as usize] == 0);
        if leaves_wire {
            complex.undo_to(since);
            continue;
        }
        let movement = cover.movement(complex, since, Some(fringe.movement), fringe.movement);
        if movement.worst > fringe.movement {
            complex.undo_to(since);
            continue;
        }
        cover.accept(complex, since, movement);
        trimmed += 1;
    }
    trimmed
}

/// The connected pieces of fringe, in order of their smallest facet.
fn pieces(complex: &Complex, measure: &Measure, relative: &[f64], fringe: Fringe) -> Vec<Vec<u32>> {
    let n = complex.fine.num_facets();
    let width = |f: u32| fringe.width * measure.tolerance.over(complex.fine.facet_vertices(f as usize));
    let from_ribs = (0..n as u32)
        .filter(|&f| complex.facet_alive[f as usize])
        .filter_map(|f| {
            let ribs = complex
                .fine
                .facet_edges(f as usize)
                .iter()
                .filter(|&&e| complex.is_rib(e));
            let way = |&e: &u32| measure.facet_centre[f as usize].distance(measure.edge_middle[e as usize]);
            ribs.map(way).min_by(f64::total_cmp).map(|d| (f, d))
        });
    let to_rib = ways(complex, measure, from_ribs, &width);
    let is_core = |f: u32| complex.facet_alive[f as usize] && to_rib[f as usize].is_infinite();
    // Only the border of the core matters.
    let border = (0..n as u32).filter(|&f| {
        let near = |e: &u32| complex.alive_facets(*e).any(|g| !is_core(g));
        is_core(f) && complex.fine.facet_edges(f as usize).iter().any(near)
    });
    let to_core = ways(complex, measure, border.map(|f| (f, 0.0)), &width);
    let is_fringe = |f: u32| {
        complex.facet_alive[f as usize]
            && !is_core(f)
            && to_core[f as usize].is_infinite()
            && relative[f as usize] < fringe.most
    };
    let mut sets = DisjointSets::new(n);
    for e in 0..complex.fine.num_edges() as u32 {
        if complex.edge_alive[e as usize] && complex.edge_count[e as usize] >= 2 {
            let mut own = complex.alive_facets(e).filter(|&f| is_fringe(f));
            if let Some(a) = own.next() {
                for b in own {
                    sets.union(a, b);
                }
            }
        }
    }
    let mut slot = vec![NONE; n];
    let mut pieces: Vec<Vec<u32>> = Vec::new();
    for f in (0..n as u32).filter(|&f| is_fringe(f)) {
        let root = sets.find(f) as usize;
        if slot[root] == NONE {
            slot[root] = pieces.len() as u32;
            pieces.push(Vec::new());
        }
        pieces[slot[root] as usize].push(f);
    }
    pieces
}

/// Length of the way along facets from given ones, up to `longest` at each facet; infinite beyond.
fn ways(
    complex: &Complex,
    measure: &Measure,
    start: impl Iterator<Item = (u32, f64)>,
    longest: &impl Fn(u32) -> f64,
) -> Vec<f64> {
    let mut way = vec![f64::INFINITY; complex.fine.num_facets()];
    let mut queue = Queue::new();
    for (f, d) in start {
        queue.push(d, f);
    }
    while let Some((distance, f)) = queue.pop() {
        if distance >= way[f as usize] || distance > longest(f) {
            continue;
        }
        way[f as usize] = distance;
        for &e in complex.fine.facet_edges(f as usize) {
            for g in complex.alive_facets(e) {
                let run = measure.facet_centre[f as usize].distance(measure.facet_centre[g as usize]);
                if distance + run < way[g as usize] {
                    queue.push(distance + run, g);
                }
            }
        }
    }
    way
}
