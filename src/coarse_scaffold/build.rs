//! From the network of curves to the hypergraph with attributes.
//!
//! In: the fine scaffold and its regularisation. Out: [`CoarseScaffold`].
//!
//! 1. [`super::network`]: nodes, chains and sheets;
//! 2. persistence: of a sheet its largest erosion thickness (ET), of an axial curve the third-highest ET along a length, of a
//!    wire how far the surface moves without it ([`super::wires`]), of a rib that of its sheet, of a seam that of the axial curve it goes on from.
//!    What cannot go without another topology (closed sheets, wires round a tunnel) gets the diagonal, and nothing else does;
//! 3. [`super::tongues`]: what is narrow and below the cut is not shown; [`super::ribs`]: ribs smoothed and fitted; attributes: polylines, lengths, areas, radii, moments, meshes;
//! 4. [`super::dissolve`]: nodes where only two ribs, or two pieces of one axial curve, are left go;
//! 5. the generator map: the sheet that most of a generator's Voronoi facets by area belong to, else what holds the nearest ball.
//!
//! Cost `O(n log n)`.

use super::attributes;
use super::breadth::{Strips, depths, unit_mm};
use super::contract::{contract, thickest};
use super::corners::{cut_at_corners, draw_straight, straighten};
use super::dissolve::dissolve;
use super::generators::generator_hosts;
use super::hypergraph::{CoarseScaffold, Curve, CurveKind, FineLinks, MedialPoint, Node, NodeKind, Sheet};
use super::natural::natural_tolerances;
use super::network::{Chain, Network};
use super::ribs::fit_ribs;
use super::settings::CoarseScaffoldSettings;
use super::tongues::hide_tongues;
use super::wires::wire_persistence;
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::{CurveId, NodeId, SheetId};
use crate::regularise::Regularised;
use glam::DVec3;
use std::collections::BTreeMap;

/// Makes the coarse scaffold; see the module for what the attributes mean.
///
/// # Complexity
/// `O(n log n)` in the size of what the regularisation left.
pub fn coarse_scaffold(
    fine: &FineScaffold,
    regularised: &Regularised,
    settings: &CoarseScaffoldSettings,
) -> CoarseScaffold {
    let mut network = Network::new(fine, regularised);
    let tau = regularised.tolerance_mm;
    contract(&mut network, settings);
    let mut strips = Strips::new(fine.num_vertices());
    let sheet_facets = hide_tongues(&mut network, &mut strips);
    cut_at_corners(&mut network);
    let node_vertices = network.nodes();
    let mut node_of_vertex = vec![NONE; fine.num_vertices()];
    for (i, vertices) in node_vertices.iter().enumerate() {
        for &v in vertices {
            node_of_vertex[v as usize] = i as u32;
        }
    }
    let chains = network.chains();
    let mut sheet_of_facet = vec![NONE; fine.num_facets()];
    for (i, facets) in sheet_facets.iter().enumerate() {
        for &f in facets {
            sheet_of_facet[f as usize] = i as u32;
        }
    }
    let never = fine.scale.diagonal_mm;
    let sheet_persistence: Vec<f64> = sheet_facets
        .iter()
        .map(|facets| {
            let persistence = |&f: &u32| {
                let ring = fine.facet_vertices(f as usize);
                regularised.persistence(regularised.erosion_mm[f as usize], ring)
            };
            facets.iter().map(persistence).fold(0.0, f64::max)
        })
        .collect();
    let sheets_of_chain: Vec<Vec<SheetId>> = chains
        .iter()
        .map(|chain| {
            let mut facets: Vec<u32> = network.facets(network.summit(chain)).collect();
            let erosion = |f: u32| regularised.erosion_mm[f as usize];
            facets.sort_by(|&a, &b| erosion(b).total_cmp(&erosion(a)).then(a.cmp(&b)));
            facets
                .into_iter()
                .map(|f| SheetId(sheet_of_facet[f as usize]))
                .collect()
        })
        .collect();
    let sheet_of_chain: Vec<Option<u32>> = sheets_of_chain.iter().map(|s| s.first().map(|s| s.0)).collect();
    let depth_mm = depths_mm(
        fine,
        regularised,
        &chains,
        &sheet_of_chain,
        &sheet_of_facet,
        &mut strips,
    );
    let mut lines = polylines(
        fine,
        regularised,
        &chains,
        &sheet_of_chain,
        &sheet_facets,
        &depth_mm,
        &node_of_vertex,
        settings,
    );
    let mut node_points = node_points(fine, &node_vertices, &chains, &lines, &node_of_vertex);
    let is_corner: Vec<bool> = node_vertices
        .iter()
        .map(|vertices| vertices.iter().any(|&v| network.corner[v as usize]))
        .collect();
    let ends: Vec<Option<[usize; 2]>> = chains.iter().map(|c| ends_of(c, &node_of_vertex)).collect();
    straighten(&network, &chains, &ends, &is_corner, &mut lines, &mut node_points);
    for ((chain, line), depth_mm) in chains.iter().zip(&mut lines).zip(&depth_mm) {
        let ends = ends_of(chain, &node_of_vertex);
        let tau = regularised.tolerance_over(&chain.vertices);
        let width_mm = |k: usize| (settings.smoothing * tau).min(depth_mm[k].max(fine.scale.spacing_mm));
        if chain.kind == CurveKind::Rib {
            pin(line, ends, &node_points, settings.near_end * tau, width_mm);
        }
        reach_nodes(line, ends, &node_points, width_mm);
    }
    let mut border: BTreeMap<u32, MedialPoint> = BTreeMap::new();
    for (chain, line) in chains.iter().zip(&lines) {
        border.extend(chain.vertices.iter().copied().zip(line.iter().copied()));
    }
    // What a node holds is drawn as the point it is: else there would be holes, and borders that no curve runs along.
    for (vertices, &point) in node_vertices.iter().zip(&node_points) {
        border.extend(vertices.iter().map(|&v| (v, point)));
    }
    let wire_persistence = wire_persistence(&network, &chains, &sheet_facets, &sheet_persistence);
    let mut curves: Vec<Curve> = chains
        .iter()
        .zip(sheets_of_chain)
        .zip(lines)
        .enumerate()
        .map(|(i, ((chain, sheets), line))| {
            let persistence = match chain.kind {
                CurveKind::Axial => axial_persistence(&network, chain),
                CurveKind::Rib => sheet_persistence[sheets[0].index()],
                CurveKind::Wire => wire_persistence[i],
                CurveKind::Seam => 0.0,
            };
            curve(chain, i, sheets, persistence, &node_of_vertex, line)
        })
        .collect();
    let mut curve_edges: Vec<Vec<u32>> = chains.into_iter().map(|c| c.edges).collect();
    let number = dissolve(&mut curves, &mut curve_edges, &is_corner);
    let (node_points, node_vertices) = left(&number, node_points, node_vertices, &mut node_of_vertex);
    let mut nodes = nodes(&node_points, &curves);
    for (node, vertices) in nodes.iter_mut().zip(&node_vertices) {
        node.sheets = sheets_at(fine, vertices, &sheet_of_facet);
    }
    seam_persistence(&mut curves, &nodes);
    for node in &mut nodes {
        node.persistence = node_persistence(&node.curves, &curves);
    }
    let mut sheets: Vec<Sheet> = sheet_facets
        .iter()
        .enumerate()
        .map(|(i, facets)| attributes::sheet(fine, i, facets, sheet_persistence[i], &border))
        .collect();
    attributes::boundaries(&mut sheets, &curves);
    let links = FineLinks {
        node_vertices,
        curve_edges,
        sheet_facets,
        generator_host: Vec::new(),
    };
    let generator_host = generator_hosts(fine, regularised, &links, &sheet_of_facet, &node_of_vertex);
    attributes::shares(fine, &mut sheets, &generator_host);
    CoarseScaffold {
        tolerance_mm: tau,
        diagonal_mm: never,
        natural_tolerances: natural_tolerances(&curves, tau, never),
        nodes,
        curves,
        sheets,
        transforms: std::mem::take(&mut network.transforms),
        fine: FineLinks {
            generator_host,
            ..links
        },
    }
}

/// The nodes that have a number still, in its order; `node_of_vertex` follows.
fn left(
    number: &[Option<NodeId>],
    points: Vec<MedialPoint>,
    vertices: Vec<Vec<u32>>,
    node_of_vertex: &mut [u32],
) -> (Vec<MedialPoint>, Vec<Vec<u32>>) {
    for n in node_of_vertex.iter_mut().filter(|n| **n != NONE) {
        *n = number[*n as usize].map_or(NONE, |id| id.0);
    }
    points
        .into_iter()
        .zip(vertices)
        .zip(number)
        .filter_map(|(kept, number)| number.is_some().then_some(kept))
        .unzip()
}

fn axial_persistence(network: &Network, chain: &Chain) -> f64 {
    network.along(&chain.edges, |e| {
        let ends = &network.fine.edge_vertices[e as usize];
        network.regularised.persistence(network.third_erosion(e), ends)
    })
}

fn seam_persistence(curves: &mut [Curve], nodes: &[Node]) {
    for i in 0..curves.len() {
        if curves[i].kind == CurveKind::Seam {
            curves[i].persistence = curves[i]
                .nodes
                .iter()
                .flat_map(|n| &nodes[n.index()].curves)
                .map(|c| &curves[c.index()])
                .filter(|c| c.kind == CurveKind::Axial)
                .map(|c| c.persistence)
                .fold(0.0, f64::max);
        }
    }
}

/// Change of depth along a rib, at most: what a point is smoothed over does not jump.
const EVEN: f64 = 0.5;

/// How far each point of each chain may be smoothed and moved, mm: by the depth of the sheet that it borders.
fn depths_mm(
    fine: &FineScaffold,
    regularised: &Regularised,
    chains: &[Chain],
    sheet_of_chain: &[Option<u32>],
    sheet_of_facet: &[u32],
    strips: &mut Strips,
) -> Vec<Vec<f64>> {
    let mut depths = depths(fine, regularised, chains, sheet_of_chain, sheet_of_facet, strips);
    for (chain, depth) in chains.iter().zip(&mut depths) {
        for (depth, &v) in depth.iter_mut().zip(&chain.vertices) {
            *depth *= unit_mm(fine, regularised, v);
        }
        let position = |k: usize| fine.vertex_position[chain.vertices[k] as usize];
        let step = |k: usize| EVEN * position(k).distance(position(k - 1));
        for k in 1..depth.len() {
            depth[k] = depth[k].min(depth[k - 1] + step(k));
        }
        for k in (1..depth.len()).rev() {
            depth[k - 1] = depth[k - 1].min(depth[k] + step(k));
        }
    }
    depths
}

/// The chains as polylines, smoothed, ribs fitted as well.
fn polylines(
    fine: &FineScaffold,
    regularised: &Regularised,
    chains: &[Chain],
    sheet_of_chain: &[Option<u32>],
    sheet_facets: &[Vec<u32>],
    depth_mm: &[Vec<f64>],
    node_of_vertex: &[u32],
    settings: &CoarseScaffoldSettings,
) -> Vec<Vec<MedialPoint>> {
    let free: Vec<bool> = chains
        .iter()
        .map(|c| node_of_vertex[c.vertices[0] as usize] == NONE)
        .collect();
    let mut lines: Vec<Vec<MedialPoint>> = chains
        .iter()
        .zip(&free)
        .map(|(chain, &free)| {
            let points = &chain.vertices[..chain.vertices.len() - usize::from(free)];
            let mut line: Vec<MedialPoint> = points
                .iter()
                .map(|&v| MedialPoint {
                    position: fine.vertex_position[v as usize],
                    radius: fine.vertex_radius[v as usize],
                })
                .collect();
            if chain.kind != CurveKind::Rib {
                let width_mm = settings.smoothing * regularised.tolerance_over(&chain.vertices);
                attributes::smooth(&mut line, free, width_mm);
            }
            line
        })
        .collect();
    fit_ribs(
        fine,
        regularised,
        chains,
        sheet_of_chain,
        sheet_facets,
        &mut lines,
        &free,
        depth_mm,
        settings.smoothing,
    );
    lines
}

fn curve(
    chain: &Chain,
    index: usize,
    sheets: Vec<SheetId>,
    persistence: f64,
    node_of_vertex: &[u32],
    polyline: Vec<MedialPoint>,
) -> Curve {
    let ends: Vec<NodeId> = [chain.vertices[0], chain.vertices[chain.vertices.len() - 1]]
        .iter()
        .map(|&v| node_of_vertex[v as usize])
        .filter(|&n| n != NONE)
        .map(NodeId)
        .collect();
    let closed = ends.is_empty() || (ends.len() == 2 && ends[0] == ends[1]);
    Curve {
        id: CurveId::from_index(index),
        kind: chain.kind,
        persistence,
        length: attributes::length(&polyline, closed),
        nodes: ends,
        closed,
        sheets,
        polyline,
    }
}

/// Nodes of the two ends of a chain; none for a closed one.
fn ends_of(chain: &Chain, node_of_vertex: &[u32]) -> Option<[usize; 2]> {
    let node = |v: u32| match node_of_vertex[v as usize] {
        NONE => None,
        n => Some(n as usize),
    };
    Some([
        node(chain.vertices[0])?,
        node(chain.vertices[chain.vertices.len() - 1])?,
    ])
}

/// Where the nodes are: on the fitted ribs that end there, where the scaffold is thin (a node made of an axial curve's end and of
/// the rib that its seam leads to belongs on the rib); elsewhere at the thickest vertex.
fn node_points(
    fine: &FineScaffold,
    node_vertices: &[Vec<u32>],
    chains: &[Chain],
    lines: &[Vec<MedialPoint>],
    node_of_vertex: &[u32],
) -> Vec<MedialPoint> {
    let mut rib_ends: Vec<(DVec3, f64, f64)> = vec![(DVec3::ZERO, 0.0, 0.0); node_vertices.len()];
    for (chain, line) in chains.iter().zip(lines).filter(|(c, _)| c.kind == CurveKind::Rib) {
        if let (Some(ends), [first, .., last]) = (ends_of(chain, node_of_vertex), line.as_slice()) {
            for (node, point) in ends.into_iter().zip([first, last]) {
                let (position, radius, count) = &mut rib_ends[node];
                *position += point.position;
                *radius += point.radius;
                *count += 1.0;
            }
        }
    }
    node_vertices
        .iter()
        .zip(rib_ends)
        .map(|(vertices, (position, radius, count))| {
            if count > 0.0 {
                return MedialPoint {
                    position: position / count,
                    radius: radius / count,
                };
            }
            let v = thickest(fine, vertices.iter().copied()).unwrap_or(0) as usize;
            MedialPoint {
                position: fine.vertex_position[v],
                radius: fine.vertex_radius[v],
            }
        })
        .collect()
}

/// Puts the ends of a line on its nodes where they are near and smooths what lies between.
fn pin(
    line: &mut [MedialPoint],
    ends: Option<[usize; 2]>,
    nodes: &[MedialPoint],
    near_mm: f64,
    width_mm: impl Fn(usize) -> f64,
) {
    if let (Some([a, b]), [first, .., last]) = (ends, &mut *line) {
        for (end, node) in [(first, nodes[a]), (last, nodes[b])] {
            if end.position.distance(node.position) <= near_mm {
                *end = node;
            }
        }
        attributes::smooth_by(line, false, width_mm);
    }
}

/// A line goes straight to its node from this many times as far as its end was away from it.
const TURN: f64 = 2.0;

/// Puts the ends of a line on its nodes and smooths it where they were not there.
fn reach_nodes(
    line: &mut [MedialPoint],
    ends: Option<[usize; 2]>,
    nodes: &[MedialPoint],
    width_mm: impl Fn(usize) -> f64,
) {
    let (Some([a, b]), [first, .., last]) = (ends, &mut *line) else {
        return;
    };
    let gaps =
        [(*first, nodes[a]), (*last, nodes[b])].map(|(end, node)| end.position.distance(node.position));
    if *first != nodes[a] || *last != nodes[b] {
        (*first, *last) = (nodes[a], nodes[b]);
        // A node on a fitted rib may lie beside the end or behind it: without turning back, the line goes straight to it.
        draw_straight(line, true, TURN * gaps[0], nodes[a]);
        draw_straight(line, false, TURN * gaps[1], nodes[b]);
        attributes::smooth_by(line, false, width_mm);
    }
}

fn nodes(points: &[MedialPoint], curves: &[Curve]) -> Vec<Node> {
    let mut curves_at: Vec<Vec<CurveId>> = vec![Vec::new(); points.len()];
    for c in curves {
        for n in &c.nodes {
            curves_at[n.index()].push(c.id);
        }
    }
    points
        .iter()
        .zip(curves_at)
        .enumerate()
        .map(|(i, (point, at))| Node {
            id: NodeId::from_index(i),
            kind: node_kind(&at, curves),
            position: point.position,
            radius: point.radius,
            curves: at,
            sheets: Vec::new(),
            persistence: 0.0,
        })
        .collect()
}

/// The sheets that have a facet at one of some vertices, ascending.
fn sheets_at(fine: &FineScaffold, vertices: &[u32], sheet_of_facet: &[u32]) -> Vec<SheetId> {
    let facets = vertices
        .iter()
        .flat_map(|&v| fine.edges_of_vertex(v as usize))
        .flat_map(|e| fine.facets_of_edge(e as usize));
    let mut sheets: Vec<SheetId> = facets
        .map(|&f| sheet_of_facet[f as usize])
        .filter(|&s| s != NONE)
        .map(SheetId)
        .collect();
    sheets.sort_unstable();
    sheets.dedup();
    sheets
}

/// What meets at a node where the given curves end.
pub(crate) fn node_kind(at: &[CurveId], curves: &[Curve]) -> NodeKind {
    let number = |kind: CurveKind| at.iter().filter(|c| curves[c.index()].kind == kind).count();
    let axial = number(CurveKind::Axial);
    let rib = number(CurveKind::Rib);
    let wire = number(CurveKind::Wire);
    match (axial, rib, wire, at.len()) {
        (4, 0, 0, 4) => NodeKind::A14,
        (1, _, 0, _) if rib >= 1 => NodeKind::A1A3,
        (0, 0, 1, 1) => NodeKind::Tip,
        // Elsewhere two ribs alone are one.
        (0, 2, 0, 2) => NodeKind::Corner,
        _ => NodeKind::Degenerate,
    }
}

/// Largest persistence of the axial curves and wires among the given curves.
pub(crate) fn node_persistence(at: &[CurveId], curves: &[Curve]) -> f64 {
    at.iter()
        .map(|c| &curves[c.index()])
        .filter(|c| matches!(c.kind, CurveKind::Axial | CurveKind::Wire))
        .map(|c| c.persistence)
        .fold(0.0, f64::max)
}
