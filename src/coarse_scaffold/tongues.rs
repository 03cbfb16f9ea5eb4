//! Tongues: strips of sheet below the cut that hang on a broad sheet. The complex keeps them, because the surface would move too far
//! without them or because they happened to grow back, but they come and go with the sampling, and a picture of them is one of needles, and of
//! white slits between them and the sheet beside them. As whiskers and flaps ([`super::hide`]), they are not shown.
//!
//! In: the network. Out: facets that it does not show.
//!
//! 1. what is narrow ([`super::breadth`]): further than [`ROOT`] from where the sheet is [`DEEP`] deep, and somewhere further than
//!    [`BACK`], so that teeth and the corners of sheets are not meant;
//! 2. its pieces without any axial curve, seam, wire or node on them, all of less erosion thickness than the cut;
//! 3. facet by facet from the ribs, the least first, as long as a facet can go by an elementary collapse that leaves the rib one curve: its ribs are
//!    one path, and what it has in common with the rest is one path inside the sheet. So the number of curves and sheets stays, and the homotopy
//!    type.
//!
//! Cost `O(n log n)` in the vertices near ribs.

use super::breadth::{Strips, Walk};
use super::hypergraph::CurveKind;
use super::network::Network;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;
use ordered_float::OrderedFloat;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// Depth of a sheet that is broad, in tolerances or spacings, whichever is more.
const DEEP: f64 = 1.0;
/// What reaches further than this from such a place is a tongue.
const BACK: f64 = 2.5;
/// Where a tongue begins.
const ROOT: f64 = 1.25;

/// Shows tongues below the cut no more. Returns the sheets that are left.
pub(crate) fn hide_tongues(network: &mut Network, strips: &mut Strips) -> Vec<Vec<u32>> {
    let mut sheets = network.sheets();
    let cut = network.regularised.cut;
    if cut.is_finite() && cut > 0.0 {
        let pieces = pieces(network, &sheets, strips);
        for piece in &pieces {
            peel(network, piece);
        }
        if !pieces.is_empty() {
            sheets
                .iter_mut()
                .for_each(|facets| facets.retain(|&f| network.shows(f)));
        }
    }
    sheets
}

/// The pieces of sheets that are tongues, as facets, in order of the smallest.
fn pieces(network: &Network, sheets: &[Vec<u32>], strips: &mut Strips) -> Vec<Vec<u32>> {
    let fine = network.fine;
    let mut sheet_of_facet = vec![NONE; fine.num_facets()];
    for (i, facets) in sheets.iter().enumerate() {
        for &f in facets {
            sheet_of_facet[f as usize] = i as u32;
        }
    }
    let mut borders: Vec<Vec<u32>> = vec![Vec::new(); sheets.len()];
    for e in (0..fine.num_edges() as u32).filter(|&e| network.kind(e) == Some(CurveKind::Rib)) {
        for sheet in network.facets(e).map(|f| sheet_of_facet[f as usize]) {
            if sheet != NONE {
                borders[sheet as usize].extend(fine.edge_vertices[e as usize]);
            }
        }
    }
    let mut walk = Walk {
        fine,
        regularised: network.regularised,
        sheet_of_facet: &sheet_of_facet,
        sheet: NONE,
    };
    let mut all: Vec<Vec<u32>> = Vec::new();
    for (sheet, border) in borders.iter().enumerate() {
        walk.sheet = sheet as u32;
        if !strips.look(&walk, border.iter().copied(), DEEP, BACK) {
            continue;
        }
        let thin = |v: u32| strips.distance_to_deep(v) > ROOT;
        let mut facets: Vec<u32> = strips
            .near_ribs()
            .filter(|&v| thin(v))
            .flat_map(|v| network.alive_edges(v))
            .flat_map(|e| network.facets(e))
            .filter(|&f| sheet_of_facet[f as usize] == walk.sheet)
            .filter(|&f| fine.facet_vertices(f as usize).iter().all(|&v| thin(v)))
            .collect();
        facets.sort_unstable();
        facets.dedup();
        let reaches_out = |f: &u32| {
            fine.facet_vertices(*f as usize)
                .iter()
                .any(|&v| strips.is_narrow(v))
        };
        let pieces = joined(network, &facets).into_iter();
        all.extend(pieces.filter(|p| p.iter().any(reaches_out) && is_tongue(network, p)));
    }
    all.sort_unstable();
    all
}

/// Facets joined across edges that are no curves; ascending.
fn joined(network: &Network, facets: &[u32]) -> Vec<Vec<u32>> {
    let place = |f: u32| facets.binary_search(&f).ok().map(|k| k as u32);
    let mut sets = DisjointSets::new(facets.len());
    for (k, &f) in facets.iter().enumerate() {
        for &e in network.fine.facet_edges(f as usize) {
            if network.kind(e).is_none() {
                for other in network.facets(e).filter_map(place) {
                    sets.union(k as u32, other);
                }
            }
        }
    }
    let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (k, &f) in facets.iter().enumerate() {
        pieces.entry(sets.find(k as u32)).or_default().push(f);
    }
    pieces.into_values().collect()
}

/// Whether a piece is below the cut and touches nothing but ribs.
fn is_tongue(network: &Network, piece: &[u32]) -> bool {
    let free = |&v: &u32| !network.is_node(v) && network.alive_edges(v).all(|e| is_plain(network, e));
    super::hide::is_crumb(network, piece)
        && piece
            .iter()
            .all(|&f| network.fine.facet_vertices(f as usize).iter().all(free))
}

/// Whether an edge is a rib, or inside one sheet, or one that is not shown and holds nothing.
fn is_plain(network: &Network, e: u32) -> bool {
    match network.count(e) {
        0 => network.hidden[e as usize],
        1 => true,
        2 => network.kind(e).is_none(),
        _ => false,
    }
}

/// Shows as much of a piece no more as can go from its ribs inward.
fn peel(network: &mut Network, piece: &[u32]) {
    let erosion =
        |network: &Network, f: u32| Reverse((OrderedFloat(network.regularised.erosion_mm[f as usize]), f));
    let mut queue: BinaryHeap<_> = piece.iter().map(|&f| erosion(network, f)).collect();
    while let Some(Reverse((_, f))) = queue.pop() {
        if !network.shows(f) || !can_go(network, f) {
            continue;
        }
        network.hide_facets(&[f]);
        for &e in network.fine.facet_edges(f as usize) {
            for next in network.facets(e) {
                if piece.binary_search(&next).is_ok() {
                    queue.push(erosion(network, next));
                }
            }
        }
    }
}

/// Whether a facet can go so that the rib stays one curve: see the module.
fn can_go(network: &Network, f: u32) -> bool {
    let (edges, vertices) = (
        network.fine.facet_edges(f as usize),
        network.fine.facet_vertices(f as usize),
    );
    let n = edges.len();
    let rib: Vec<bool> = edges.iter().map(|&e| network.count(e) == 1).collect();
    let starts = (0..n).filter(|&k| rib[k] && !rib[(k + n - 1) % n]).count();
    if starts != 1 {
        return false;
    }
    (0..n).all(|k| {
        let v = vertices[k];
        let others = || {
            network
                .alive_edges(v)
                .filter(|e| !edges.contains(e) && network.count(*e) > 0)
        };
        match (rib[(k + n - 1) % n], rib[k]) {
            // Inside the path of ribs: nothing else is there. Inside the other path: no rib comes there.
            (true, true) => others().next().is_none(),
            (false, false) => others().all(|e| network.count(e) == 2),
            _ => true,
        }
    })
}
