//! Contractions: short curves, seams and small sheets shrink to nodes, cheapest first.
//!
//! In: the network of curves over the fine complex. Out: clusters of fine vertices that are one node each, and the edges and facets
//! inside them, which belong to no curve and no sheet any more. The fine complex itself stays as it is.
//!
//! Dividing a complex by a subcomplex that is contractible keeps the homotopy type (Hatcher, "Algebraic Topology", 2002,
//! proposition 0.17). Every contraction is therefore checked on the cells that the new node would hold, those of the nodes it joins included:
//! they must be connected and collapse to a point, else the contraction is refused and logged as such. So a loop, a ring of curves or a
//! bubble is never shrunk.
//!
//! 1. seams (merges A1A5, A1A3-II and A1^2A3-I: the end of an axial curve meets a rib or another axial curve);
//! 2. curves between two different nodes (A1^5 between two A1^4 nodes, A1^2A3-I between an A1^4 and an A1A3 node);
//! 3. sheets with everything around them (A1^5: the triangle between axial curves; crumbs of the sampling). The ball of the new
//!    node, the largest there is, must come within the tolerance of every generator of what is shrunk, unless the sheet is below the cut
//!    and in the graph only because it hangs on a node.
//!
//! Costs are lengths: of the path, of the curve, half the extent of the sheet. With [`Cost::Count`] they are numbers of fine
//! edges and of generators with the thresholds of Chang & Kimia, "Regularizing 3D medial axis using medial scaffold transforms"
//! (2008). Cost of the step itself `O(n log n)`.

use super::hypergraph::CurveKind;
use super::network::Network;
use super::settings::CoarseScaffoldSettings;
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::regularise::seams::SEAM_SPACINGS;
use crate::regularise::{Cost, Event, Kind};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Seams up to this many fine edges are merged when costs are counts.
const COUNT_MERGE: f64 = 10.0;
/// Curves up to this many fine edges are contracted when costs are counts.
const COUNT_CURVE: f64 = 20.0;
/// Sheets up to this many generators are contracted when costs are counts (30 at a weight of 0.8).
const COUNT_SHEET: f64 = 37.0;

/// The cells that one node holds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells {
    edges: Vec<u32>,
    facets: Vec<u32>,
}

impl Cells {
    /// A path of edges.
    pub fn path(edges: &[u32]) -> Self {
        Self {
            edges: edges.to_vec(),
            facets: Vec::new(),
        }
    }
}

/// What is to be shrunk to a node.
struct Candidate {
    kind: Kind,
    cost: f64,
    cells: Cells,
}

/// Hides what is below the cut ([`super::hide`]), then contracts seams, short curves, then small sheets; see the module.
pub(crate) fn contract(network: &mut Network, settings: &CoarseScaffoldSettings) {
    let counts = network.regularised.cost == Cost::Count;
    let tau = network.regularised.tolerance_mm;
    let limit = |length: f64, count: f64| if counts { count } else { length * tau };
    super::hide::hide(network, settings);
    let seams = seams(network, counts);
    // A seam of few spacings is all sampling.
    let seam = limit(settings.contract_seam, COUNT_MERGE);
    shrink(
        network,
        seams,
        if counts {
            seam
        } else {
            seam.max(SEAM_SPACINGS * network.fine.scale.spacing_mm)
        },
    );
    let curves = curves(network, counts);
    shrink(network, curves, limit(settings.contract_curve, COUNT_CURVE));
    let sheets = sheets(network, counts);
    let sheet = limit(settings.contract_sheet, COUNT_SHEET);
    shrink(
        network,
        sheets,
        if counts {
            sheet
        } else {
            sheet.max(network.fine.scale.spacing_mm)
        },
    );
}

fn path_cost(network: &Network, edges: &[u32], counts: bool) -> f64 {
    if counts {
        edges.len() as f64
    } else {
        network.length(edges)
    }
}

fn seams(network: &Network, counts: bool) -> Vec<Candidate> {
    let paths = network
        .regularised
        .seams
        .iter()
        .filter(|path| path.first().is_some_and(|&e| network.seam[e as usize]));
    paths
        .map(|path| Candidate {
            kind: Kind::Merge,
            cost: path_cost(network, path, counts),
            cells: Cells {
                edges: path.clone(),
                facets: Vec::new(),
            },
        })
        .collect()
}

/// Axial curves between two nodes. Ribs and wires are left alone: a short rib bounds a sheet that another step may take, and wires
/// have been pruned by the movement of the surface.
fn curves(network: &Network, counts: bool) -> Vec<Candidate> {
    let between_nodes = |c: &super::network::Chain| c.vertices[0] != c.vertices[c.vertices.len() - 1];
    network
        .chains()
        .into_iter()
        .filter(|c| c.kind == CurveKind::Axial && between_nodes(c))
        .map(|c| Candidate {
            kind: Kind::ContractCurve,
            cost: path_cost(network, &c.edges, counts),
            cells: Cells {
                edges: c.edges,
                facets: Vec::new(),
            },
        })
        .collect()
}

/// Sheets with the edges around them.
fn sheets(network: &Network, counts: bool) -> Vec<Candidate> {
    let fine = network.fine;
    let candidate = |facets: Vec<u32>| {
        let edges: BTreeSet<u32> = facets
            .iter()
            .flat_map(|&f| fine.facet_edges(f as usize).iter().copied())
            .collect();
        let cost = if counts {
            let generators: BTreeSet<u32> = facets
                .iter()
                .flat_map(|&f| fine.facet_generators[f as usize].map(|g| g.0))
                .collect();
            generators.len() as f64
        } else {
            half_extent(fine, &facets)
        };
        Candidate {
            kind: Kind::ContractSheet,
            cost,
            cells: Cells {
                edges: edges.into_iter().collect(),
                facets,
            },
        }
    };
    network.sheets().into_iter().map(candidate).collect()
}

/// Half the diagonal of the box around some facets, mm.
fn half_extent(fine: &FineScaffold, facets: &[u32]) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &v in facets.iter().flat_map(|&f| fine.facet_vertices(f as usize)) {
        low = low.min(fine.vertex_position[v as usize]);
        high = high.max(fine.vertex_position[v as usize]);
    }
    0.5 * (high - low).length()
}

/// Shrinks the candidates up to a cost, cheapest first.
fn shrink(network: &mut Network, mut candidates: Vec<Candidate>, limit: f64) {
    // Costs are held to the tolerance where they arise.
    let local = |c: &Candidate| match network.regularised.cost {
        Cost::Count => c.cost,
        Cost::Length => {
            let ends = c
                .cells
                .edges
                .iter()
                .flat_map(|&e| network.fine.edge_vertices[e as usize]);
            let vertices: Vec<u32> = ends.collect();
            network.regularised.persistence(c.cost, &vertices)
        }
    };
    candidates.retain(|c| local(c) <= limit);
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.cells.edges.cmp(&b.cells.edges)));
    for candidate in candidates {
        let Candidate { kind, cost, cells } = candidate;
        let place =
            network.fine.vertex_position[network.fine.edge_vertices[cells.edges[0] as usize][0] as usize];
        let event = if shrink_one(network, kind, cells) {
            Event::applied(kind, cost, place, 0, 0)
        } else {
            Event::skipped(kind, cost, place)
        };
        network.transforms.push(event);
    }
}

/// Makes one node of some cells and of the nodes they touch, if that keeps the homotopy type and the surface.
pub(crate) fn shrink_one(network: &mut Network, kind: Kind, new: Cells) -> bool {
    let fine = network.fine;
    let vertices: BTreeSet<u32> = new
        .edges
        .iter()
        .flat_map(|&e| fine.edge_vertices[e as usize])
        .collect();
    let roots: BTreeSet<u32> = vertices
        .iter()
        .filter(|&&v| network.in_cluster[v as usize])
        .map(|&v| network.clusters.find(v))
        .collect();
    let mut all = new;
    for root in &roots {
        if let Some(own) = network.cells.get(root) {
            all.edges.extend(&own.edges);
            all.facets.extend(&own.facets);
        }
    }
    for list in [&mut all.edges, &mut all.facets] {
        list.sort_unstable();
        list.dedup();
    }
    let must_cover = kind == Kind::ContractSheet && !super::hide::is_crumb(network, &all.facets);
    if !is_contractible(fine, &all) || must_cover && !ball_covers(network, &all) {
        return false;
    }
    for root in &roots {
        network.cells.remove(root);
    }
    for &e in &all.edges {
        network.contracted[e as usize] = true;
        let [a, b] = fine.edge_vertices[e as usize];
        network.clusters.union(a, b);
        network.in_cluster[a as usize] = true;
        network.in_cluster[b as usize] = true;
    }
    for &f in &all.facets {
        network.contracted_facet[f as usize] = true;
    }
    let root = network
        .clusters
        .find(fine.edge_vertices[all.edges[0] as usize][0]);
    network.cells.insert(root, all);
    true
}

/// Whether cells (closed under taking faces) are connected and collapse to a point: every facet goes through a free edge, and the
/// edges that are left make a tree.
fn is_contractible(fine: &FineScaffold, cells: &Cells) -> bool {
    let mut number = BTreeMap::new();
    let mut ends = Vec::with_capacity(cells.edges.len());
    for &e in &cells.edges {
        ends.push(fine.edge_vertices[e as usize].map(|v| {
            let next = number.len() as u32;
            *number.entry(v).or_insert(next)
        }));
    }
    let mut parts = crate::geometry::mesh::DisjointSets::new(number.len());
    let joins = ends.iter().filter(|[a, b]| parts.union(*a, *b)).count();
    let euler = number.len() as i64 - cells.edges.len() as i64 + cells.facets.len() as i64;
    if joins + 1 != number.len() || euler != 1 {
        return false;
    }
    let place = |e: u32| cells.edges.binary_search(&e);
    let mut own: Vec<Vec<u32>> = vec![Vec::new(); cells.edges.len()];
    for (k, &f) in cells.facets.iter().enumerate() {
        for &e in fine.facet_edges(f as usize) {
            match place(e) {
                Ok(i) => own[i].push(k as u32),
                Err(_) => return false,
            }
        }
    }
    let mut alive = vec![true; cells.facets.len()];
    let mut left = alive.len();
    let mut free: Vec<usize> = (0..own.len()).filter(|&i| own[i].len() == 1).collect();
    while let Some(i) = free.pop() {
        let mut here = own[i].iter().filter(|&&k| alive[k as usize]);
        let (Some(&k), None) = (here.next(), here.next()) else {
            continue;
        };
        alive[k as usize] = false;
        left -= 1;
        let ring = fine.facet_edges(cells.facets[k as usize] as usize);
        free.extend(ring.iter().filter_map(|&e| place(e).ok()));
    }
    // Connected with Euler number 1 and no facet left: a tree.
    left == 0
}

/// Whether the largest ball of some cells comes within the tolerance of all their generators.
fn ball_covers(network: &Network, cells: &Cells) -> bool {
    let fine = network.fine;
    let vertices = cells.edges.iter().flat_map(|&e| fine.edge_vertices[e as usize]);
    let Some(v) = thickest(fine, vertices) else {
        return false;
    };
    let (centre, radius) = (fine.vertex_position[v as usize], fine.vertex_radius[v as usize]);
    cells
        .edges
        .iter()
        .flat_map(|&e| fine.edge_generators[e as usize])
        .all(|g| {
            let distance = fine.generator_position[g.index()].distance(centre) - radius;
            distance <= network.regularised.tolerance_at(v)
        })
}

/// The vertex of largest radius, ties to the smaller id.
pub(crate) fn thickest(fine: &FineScaffold, vertices: impl Iterator<Item = u32>) -> Option<u32> {
    let r = |v: u32| fine.vertex_radius[v as usize];
    vertices
        .filter(|&v| v != NONE)
        .max_by(|&a, &b| r(a).total_cmp(&r(b)).then(b.cmp(&a)))
}
