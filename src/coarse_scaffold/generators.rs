//! The generator map: every generator has a host among the sheets, wires and nodes.

use super::attributes::facet_area;
use super::hypergraph::{FineLinks, Host};
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::{CurveId, NodeId, SheetId};
use crate::regularise::Regularised;
use crate::regularise::balls::BallTree;
use rayon::prelude::*;

/// Host of every generator: the sheet that most of its alive Voronoi facets by area belong to; else the element that holds the
/// alive vertex whose ball is nearest.
pub(crate) fn generator_hosts(
    fine: &FineScaffold,
    regularised: &Regularised,
    links: &FineLinks,
    sheet_of_facet: &[u32],
    node_of_vertex: &[u32],
) -> Vec<Host> {
    let n = fine.generator_position.len();
    // (generator, sheet, area) of every alive facet, gathered by sorting.
    let mut touches: Vec<(u32, u32, f64)> = Vec::new();
    for (f, &sheet) in sheet_of_facet.iter().enumerate().filter(|(_, s)| **s != NONE) {
        let area = facet_area(fine, f as u32);
        for g in fine.facet_generators[f] {
            touches.push((g.0, sheet, area));
        }
    }
    touches.sort_by_key(|a| (a.0, a.1));
    let mut hosts = vec![Host::Absent; n];
    for run in touches.chunk_by(|a, b| a.0 == b.0) {
        let mut best = (f64::NEG_INFINITY, NONE);
        for part in run.chunk_by(|a, b| a.1 == b.1) {
            let area: f64 = part.iter().map(|t| t.2).sum();
            if area > best.0 {
                best = (area, part[0].1);
            }
        }
        hosts[run[0].0 as usize] = Host::Sheet(SheetId(best.1));
    }
    let alive_edges: Vec<[u32; 2]> = (0..fine.num_edges())
        .filter(|&e| regularised.alive.edges[e])
        .map(|e| fine.edge_vertices[e])
        .collect();
    let of_vertex = vertex_hosts(fine, links, sheet_of_facet, node_of_vertex, &alive_edges);
    let alive: Vec<u32> = (0..fine.num_vertices() as u32)
        .filter(|&v| regularised.alive.vertices[v as usize])
        .collect();
    let tree = BallTree::new(alive, &fine.vertex_position, &fine.vertex_radius);
    hosts
        .into_par_iter()
        .enumerate()
        .map(|(g, host)| {
            if host != Host::Absent {
                return host;
            }
            let known = regularised.nearest_vertex.get(g).copied();
            if let Some(v) = known.filter(|&v| v != NONE) {
                return of_vertex[v as usize];
            }
            tree.nearest(fine.generator_position[g], None, |_| true)
                .map_or(Host::Absent, |ball| of_vertex[ball.id as usize])
        })
        .collect()
}

/// What holds each alive vertex: the smallest sheet at it, else its wire, else its node; what a node has taken in falls to a
/// sheet or wire that ends there.
fn vertex_hosts(
    fine: &FineScaffold,
    links: &FineLinks,
    sheet_of_facet: &[u32],
    node_of_vertex: &[u32],
    alive_edges: &[[u32; 2]],
) -> Vec<Host> {
    let mut hosts: Vec<Host> = node_of_vertex
        .iter()
        .map(|&n| {
            if n == NONE {
                Host::Absent
            } else {
                Host::Node(NodeId(n))
            }
        })
        .collect();
    for (c, edges) in links.curve_edges.iter().enumerate() {
        for &e in edges {
            for v in fine.edge_vertices[e as usize] {
                hosts[v as usize] = Host::Curve(CurveId::from_index(c));
            }
        }
    }
    for f in (0..fine.num_facets()).rev() {
        if sheet_of_facet[f] != NONE {
            for &v in fine.facet_vertices(f) {
                hosts[v as usize] = Host::Sheet(SheetId(sheet_of_facet[f]));
            }
        }
    }
    for vertices in &links.node_vertices {
        let near = vertices
            .iter()
            .map(|&v| hosts[v as usize])
            .filter(|h| !matches!(h, Host::Node(_)))
            .min();
        if let Some(near) = near {
            for &v in vertices {
                if matches!(hosts[v as usize], Host::Node(_)) {
                    hosts[v as usize] = near;
                }
            }
        }
    }
    // What is in the complex but not in the graph falls to what it hangs on.
    loop {
        let mut found: Vec<(u32, Host)> = Vec::new();
        for &[a, b] in alive_edges {
            match (hosts[a as usize], hosts[b as usize]) {
                (Host::Absent, Host::Absent) => {}
                (Host::Absent, host) => found.push((a, host)),
                (host, Host::Absent) => found.push((b, host)),
                _ => {}
            }
        }
        if found.is_empty() {
            return hosts;
        }
        for (v, host) in found {
            hosts[v as usize] = host;
        }
    }
}
