//! What the graph does not show. The complex keeps some pieces that are less persistent than the cut, because without them the surface
//! would move too far: the last facets of a fin that is thin and wide, or the short whisker that holds one corner. They stay in
//! the complex, so that homotopy type and surface are kept, but they are no elements of the graph, whose elements would
//! otherwise come and go with the sampling.
//!
//! 1. the spines of the regularisation;
//! 2. whiskers: wires with a free tip that hang on a sheet and are no longer than one and a half of the longest seams;
//! 3. axial curves of less persistence than the cut, the least persistent first. The sheets along a curve that is hidden are one
//!    sheet, and the curves on both sides of its ends become one where nothing else ends there, with the larger persistence;
//! 4. flaps: the fin that such a curve carried, where it hangs on nothing else and all of it is below the cut.
//!
//! Cost `O(n)` for each curve hidden.

use super::contract::{Cells, shrink_one};
use super::hypergraph::CurveKind;
use super::network::{Chain, Network};
use super::settings::CoarseScaffoldSettings;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;
use crate::regularise::{Event, Kind};
use std::collections::{BTreeMap, BTreeSet};

/// Hides whiskers and the axial curves below the cut.
pub(crate) fn hide(network: &mut Network, settings: &CoarseScaffoldSettings) {
    if !network.regularised.cut.is_finite() || network.regularised.cut <= 0.0 {
        return;
    }
    for &e in &network.regularised.spines {
        network.hidden[e as usize] = true;
    }
    // A whisker that forks is hidden branch by branch.
    loop {
        let whiskers: Vec<Chain> = network
            .chains()
            .into_iter()
            .filter(|c| is_whisker(network, c, settings.near_end))
            .collect();
        if whiskers.is_empty() {
            break;
        }
        for chain in &whiskers {
            hide_chain(network, chain);
        }
    }
    loop {
        let weakest = network
            .chains()
            .into_iter()
            .filter(|c| c.kind == CurveKind::Axial)
            .map(|c| (relative_persistence(network, &c), c))
            .filter(|(p, _)| *p < network.regularised.cut)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.edges.cmp(&b.1.edges)));
        let Some((persistence, chain)) = weakest else {
            break;
        };
        let v = chain.vertices[0];
        let tau = network.regularised.tolerance_at(v);
        let place = network.fine.vertex_position[v as usize];
        // A stub between a curve and the seam that closes its gap is part of the seam.
        let stub = Cells::path(&chain.edges);
        if network.length(&chain.edges) <= settings.contract_seam * tau
            && goes_on_in_seam(network, &chain)
            && shrink_one(network, Kind::ContractCurve, stub)
        {
            continue;
        }
        hide_chain(network, &chain);
        drop_loose_seams(network);
        network
            .transforms
            .push(Event::applied(Kind::HideCurve, persistence * tau, place, 0, 0));
    }
    while drop_seams_of_crumbs(network) {}
    hide_flaps(network);
}

/// Hides the flaps: pieces of sheet below the cut between a hidden curve and a rib, which shrink onto the curve.
fn hide_flaps(network: &mut Network) {
    let fine = network.fine;
    let mut sets = DisjointSets::new(fine.num_facets());
    for e in (0..fine.num_edges() as u32).filter(|&e| network.count(e) == 2) {
        let pair: Vec<u32> = network.facets(e).collect();
        sets.union(pair[0], pair[1]);
    }
    let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let carries = |e: u32| network.hidden[e as usize] && network.count(e) > 2;
    for e in (0..fine.num_edges() as u32).filter(|&e| carries(e)) {
        for f in network.facets(e) {
            pieces.entry(sets.find(f)).or_default();
        }
    }
    for f in (0..fine.num_facets() as u32).filter(|&f| network.shows(f)) {
        if let Some(piece) = pieces.get_mut(&sets.find(f)) {
            piece.push(f);
        }
    }
    for piece in pieces.into_values() {
        if is_crumb(network, &piece) && is_flap(network, &piece) {
            network.hide_facets(&piece);
        }
    }
}

/// Whether a piece of sheet is bounded by ribs and hidden curves alone and shrinks onto what it has in common with the rest: as many cells of
/// it alone of even as of odd dimension, and a rib to start from.
fn is_flap(network: &Network, piece: &[u32]) -> bool {
    let fine = network.fine;
    let own: BTreeSet<u32> = piece.iter().copied().collect();
    let edges: BTreeSet<u32> = piece
        .iter()
        .flat_map(|&f| fine.facet_edges(f as usize).iter().copied())
        .collect();
    let alone = |e: u32| network.facets(e).all(|f| own.contains(&f));
    let rib = |e: u32| network.count(e) == 1;
    if !edges.iter().any(|&e| rib(e)) {
        return false;
    }
    if edges.iter().any(|&e| !alone(e) && !network.hidden[e as usize]) {
        return false;
    }
    let vertices: BTreeSet<u32> = piece
        .iter()
        .flat_map(|&f| fine.facet_vertices(f as usize).iter().copied())
        .collect();
    // Hidden wires that hang on it go with it.
    let loose = |e: u32| network.hidden[e as usize] && network.count(e) == 0;
    let alone_at = |v: u32| {
        network
            .alive_edges(v)
            .all(|e| loose(e) || edges.contains(&e) && alone(e))
    };
    let own_vertices = vertices.iter().filter(|&&v| alone_at(v)).count();
    let own_edges = edges.iter().filter(|&&e| alone(e)).count();
    piece.len() + own_vertices == own_edges
}

/// Drops the first seam that cuts a crumb off a sheet: a piece of less persistence than the cut is none by itself. Returns whether
/// there was one.
fn drop_seams_of_crumbs(network: &mut Network) -> bool {
    let sheets = network.sheets();
    let mut sheet_of = vec![NONE; network.fine.num_facets()];
    for (i, facets) in sheets.iter().enumerate() {
        for &f in facets {
            sheet_of[f as usize] = i as u32;
        }
    }
    let crumb: Vec<bool> = sheets.iter().map(|s| is_crumb(network, s)).collect();
    let cuts_off = |path: &Vec<u32>| {
        path.iter().any(|&e| {
            let mut sides = network.facets(e).map(|f| sheet_of[f as usize]);
            let (a, b) = (sides.next(), sides.next());
            network.seam[e as usize]
                && a != b
                && [a, b]
                    .into_iter()
                    .flatten()
                    .any(|s| s != NONE && crumb[s as usize])
        })
    };
    let Some(path) = network.regularised.seams.iter().find(|path| cuts_off(path)) else {
        return false;
    };
    for &e in path {
        network.seam[e as usize] = false;
    }
    true
}

/// Whether the largest erosion thickness of some facets, in tolerances, is below the cut.
pub(crate) fn is_crumb(network: &Network, facets: &[u32]) -> bool {
    facets.iter().all(|&f| {
        let ring = network.fine.facet_vertices(f as usize);
        let tau = network.regularised.tolerance_over(ring);
        network.regularised.erosion_mm[f as usize] < network.regularised.cut * tau
    })
}

/// Whether a live seam starts at an end of a chain.
fn goes_on_in_seam(network: &Network, chain: &Chain) -> bool {
    let ends = [chain.vertices[0], chain.vertices[chain.vertices.len() - 1]];
    network.regularised.seams.iter().any(|path| {
        path.first().is_some_and(|&e| {
            network.seam[e as usize]
                && network.fine.edge_vertices[e as usize]
                    .iter()
                    .any(|v| ends.contains(v))
        })
    })
}

/// Seams that no shown axial curve goes on from are none any more.
fn drop_loose_seams(network: &mut Network) {
    for path in &network.regularised.seams {
        let Some(&first) = path.first() else { continue };
        if !network.seam[first as usize] {
            continue;
        }
        // The end that the path does not go on from.
        let [a, b] = network.fine.edge_vertices[first as usize];
        let start = match path.get(1) {
            Some(&next) if network.fine.edge_vertices[next as usize].contains(&a) => b,
            Some(_) => a,
            None => {
                let axial = |v: u32| {
                    network
                        .alive_edges(v)
                        .any(|e| network.kind(e) == Some(CurveKind::Axial))
                };
                if axial(a) || axial(b) {
                    continue;
                }
                a
            }
        };
        let goes_on = network.in_cluster[start as usize]
            || network
                .alive_edges(start)
                .any(|e| network.kind(e) == Some(CurveKind::Axial));
        if !goes_on {
            for &e in path {
                network.seam[e as usize] = false;
            }
        }
    }
}

fn hide_chain(network: &mut Network, chain: &Chain) {
    for &e in &chain.edges {
        network.hidden[e as usize] = true;
    }
}

/// Third-highest erosion thickness along the persistence length of an axial curve, in tolerances.
fn relative_persistence(network: &Network, chain: &Chain) -> f64 {
    let value = |e: u32| {
        let ends = &network.fine.edge_vertices[e as usize];
        network.third_erosion(e) / network.regularised.tolerance_over(ends)
    };
    network.along(&chain.edges, value)
}

/// Whether a chain is a short wire from a tip to a sheet.
fn is_whisker(network: &Network, chain: &Chain, longest: f64) -> bool {
    let (first, last) = (chain.vertices[0], chain.vertices[chain.vertices.len() - 1]);
    let edges_at = |v: u32| {
        let shown = |e: &u32| !network.hidden[*e as usize];
        network.alive_edges(v).filter(shown).count()
    };
    let holds_facet = |v: u32| network.alive_edges(v).any(|e| network.facets(e).next().is_some());
    let at = |v: u32| network.regularised.tolerance_at(v);
    let tau = at(first).max(at(last));
    chain.kind == CurveKind::Wire
        && (edges_at(first) == 1 && holds_facet(last) || edges_at(last) == 1 && holds_facet(first))
        && network.length(&chain.edges) <= 1.5 * longest * tau.max(network.fine.scale.spacing_mm)
}
