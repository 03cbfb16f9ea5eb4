//! Building the fine scaffold.
//!
//! In: the triangulation and one side's labels. Out: the dual complex of the simplices in the interior of that side.
//!
//! 1. vertices: tetrahedra of the side, in id order, with circumcentre and circumradius;
//! 2. edges: triangles between two of them;
//! 3. facets: Delaunay edges whose whole ring of tetrahedra is of the side, found at the smallest tetrahedron of the ring and
//!    followed counter-clockwise about the edge directed from the smaller generator;
//! 4. 3-cells: generators whose whole star is of the side (a generator off the surface, from noise);
//! 5. what the generators need: positions, volumes, and the components of the complement.
//!
//! The duality between a union of tetrahedra and its dual complex is that of Edelsbrunner, "The union of balls and its dual
//! shape" (1995). Everything is numbered in the order of the tetrahedra, hence canonical. Cost: `O(tetrahedra)`, the facets
//! in parallel over tetrahedra with results kept in order.
//!
//! Degenerate input: flat tetrahedra have circumcentres far away or none; a vertex without a finite circumcentre is an
//! error, because no later stage could place it.

use super::complex::{FineScaffold, NONE};
use crate::delaunay::Triangulation;
use crate::delaunay::triangulation::INFINITE;
use crate::geometry::circumsphere::{self, Sphere};
use crate::geometry::mesh::{DisjointSets, bounds};
use crate::geometry::{LengthScale, TetId, VertexId};
use crate::segregation::Segregation;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The side of the surface whose scaffold is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The solid.
    #[default]
    Interior,
    /// The convex hull less the solid.
    Exterior,
}

/// Settings of the fine scaffold.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FineScaffoldSettings {
    /// The side.
    pub side: Side,
}

/// Why there is no fine scaffold.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FineScaffoldError {
    /// The surface is open and has no inside.
    #[error(
        "the surface is open, so it has no inside and no interior scaffold; close it, or ask for the surface mesh only"
    )]
    Open,
    /// Labels of another triangulation.
    #[error(
        "{labels} inside labels for {tets} tetrahedra; segregation and triangulation do not belong together"
    )]
    Labels {
        /// Number of labels.
        labels: usize,
        /// Number of tetrahedra.
        tets: usize,
    },
    /// No tetrahedron is of the side.
    #[error(
        "none of {tets} tetrahedra lies on the {side:?} side; the sampling is too coarse for this shape (lower --spacing) or the \
         surface is inside out"
    )]
    Empty {
        /// Number of finite tetrahedra.
        tets: usize,
        /// The side asked for.
        side: Side,
    },
    /// A tetrahedron so flat that its circumcentre is not a number.
    #[error(
        "tetrahedron {tet} of generators {generators:?} is flat and has no circumcentre; re-sample the shape"
    )]
    Flat {
        /// The tetrahedron.
        tet: TetId,
        /// Its generators.
        generators: [VertexId; 4],
    },
}

/// For each pair of corners of a tetrahedron the other two, so that the four are an even permutation.
const AROUND: [([usize; 2], [usize; 2]); 6] = [
    ([0, 1], [2, 3]),
    ([0, 2], [3, 1]),
    ([0, 3], [1, 2]),
    ([1, 2], [0, 3]),
    ([1, 3], [2, 0]),
    ([2, 3], [0, 1]),
];

/// Makes the fine scaffold of one side.
///
/// # Errors
/// [`FineScaffoldError`]: no inside, labels of another triangulation, an empty side, a flat tetrahedron.
///
/// # Complexity
/// `O(tetrahedra)` time and space.
pub fn fine_scaffold(
    triangulation: &Triangulation,
    segregation: &Segregation,
    settings: &FineScaffoldSettings,
) -> Result<FineScaffold, FineScaffoldError> {
    if segregation.inside.is_empty() && triangulation.num_tets() > 0 {
        return Err(FineScaffoldError::Open);
    }
    if segregation.inside.len() != triangulation.num_tets() {
        return Err(FineScaffoldError::Labels {
            labels: segregation.inside.len(),
            tets: triangulation.num_tets(),
        });
    }
    let of_side: Vec<bool> = triangulation
        .tets()
        .map(|t| triangulation.is_finite(t) && segregation.is_inside(t) == (settings.side == Side::Interior))
        .collect();
    let dual = Vertices::new(triangulation, &of_side);
    if dual.tets.is_empty() {
        return Err(FineScaffoldError::Empty {
            tets: triangulation.num_finite(),
            side: settings.side,
        });
    }
    let balls = circumballs(triangulation, &dual.tets)?;
    let edges = edges(triangulation, &dual);
    let facets = facets(triangulation, &dual, &edges.of_vertex);
    let (edge_facet_start, edge_facets) = incidence(edges.vertices.len(), &facets.start, &facets.ring_edges);
    let cells = cells(triangulation, &of_side, &facets.generators);
    let (generator_region, num_regions) = regions(triangulation, &of_side);
    let outside = (0..dual.tets.len())
        .into_par_iter()
        .map(|v| !circumcentre_is_of_side(triangulation, &of_side, dual.tets[v], balls[v].centre))
        .collect();
    Ok(FineScaffold {
        scale: scale(triangulation, &of_side),
        generator_position: triangulation.points.clone(),
        generator_volume: generator_volumes(triangulation, &dual.tets),
        generator_region,
        num_regions,
        vertex_position: balls.iter().map(|b| b.centre).collect(),
        vertex_radius: balls.iter().map(|b| b.radius).collect(),
        vertex_outside: outside,
        vertex_edges: edges.of_vertex,
        vertex_tet: dual.tets,
        edge_vertices: edges.vertices,
        edge_generators: edges.generators,
        facet_generators: facets.generators,
        facet_start: facets.start,
        ring_vertices: facets.ring_vertices,
        ring_edges: facets.ring_edges,
        edge_facet_start,
        edge_facets,
        cell_generator: cells.generator,
        cell_facet_start: cells.start,
        cell_facets: cells.facets,
    })
}

/// The vertices: tetrahedra of the side, and the way back.
struct Vertices {
    tets: Vec<TetId>,
    of_tet: Vec<u32>,
}

impl Vertices {
    fn new(triangulation: &Triangulation, of_side: &[bool]) -> Self {
        let mut of_tet = vec![NONE; triangulation.num_tets()];
        let mut tets = Vec::new();
        for t in triangulation.finite_tets().filter(|t| of_side[t.index()]) {
            of_tet[t.index()] = tets.len() as u32;
            tets.push(t);
        }
        Self { tets, of_tet }
    }
}

fn circumballs(triangulation: &Triangulation, tets: &[TetId]) -> Result<Vec<Sphere>, FineScaffoldError> {
    let balls: Vec<Sphere> = tets
        .par_iter()
        .map(|&t| circumsphere::tetrahedron(triangulation.corners(t)))
        .collect();
    match balls.iter().position(|b| !b.radius.is_finite()) {
        None => Ok(balls),
        Some(v) => Err(FineScaffoldError::Flat {
            tet: tets[v],
            generators: triangulation.tet(tets[v]),
        }),
    }
}

struct Edges {
    vertices: Vec<[u32; 2]>,
    generators: Vec<[VertexId; 3]>,
    of_vertex: Vec<[u32; 4]>,
}

fn edges(triangulation: &Triangulation, dual: &Vertices) -> Edges {
    let mut out = Edges {
        vertices: Vec::with_capacity(2 * dual.tets.len()),
        generators: Vec::with_capacity(2 * dual.tets.len()),
        of_vertex: vec![[NONE; 4]; dual.tets.len()],
    };
    for (v, &tet) in dual.tets.iter().enumerate() {
        for index in 0..4u8 {
            let facet = crate::delaunay::Facet { tet, index };
            let mirror = triangulation.mirror(facet);
            let w = dual.of_tet[mirror.tet.index()];
            if w == NONE || (w as usize) < v {
                continue;
            }
            let e = out.vertices.len() as u32;
            out.vertices.push([v as u32, w]);
            out.generators.push(triangulation.facet_vertices(facet));
            out.of_vertex[v][index as usize] = e;
            out.of_vertex[w as usize][mirror.index as usize] = e;
        }
    }
    out
}

#[derive(Default)]
struct Facets {
    generators: Vec<[VertexId; 2]>,
    start: Vec<u32>,
    ring_vertices: Vec<u32>,
    ring_edges: Vec<u32>,
}

/// Vertices whose facets are gathered in one task; the result does not depend on it.
const CHUNK: usize = 4096;

fn facets(triangulation: &Triangulation, dual: &Vertices, edges_of_vertex: &[[u32; 4]]) -> Facets {
    let parts: Vec<Facets> = dual
        .tets
        .par_chunks(CHUNK)
        .map(|tets| {
            let mut out = Facets::default();
            let mut ring = Vec::with_capacity(32);
            for &tet in tets {
                for pair in AROUND {
                    if let Some(generators) = walk_ring(triangulation, dual, tet, pair, &mut ring) {
                        out.generators.push(generators);
                        out.start.push(ring.len() as u32);
                        for &(v, exit) in &ring {
                            out.ring_vertices.push(v);
                            out.ring_edges.push(edges_of_vertex[v as usize][exit as usize]);
                        }
                    }
                }
            }
            out
        })
        .collect();
    let mut all = Facets {
        start: vec![0],
        ..Facets::default()
    };
    for part in parts {
        all.generators.extend(part.generators);
        for size in part.start {
            all.start.push(all.start.last().copied().unwrap_or(0) + size);
        }
        all.ring_vertices.extend(part.ring_vertices);
        all.ring_edges.extend(part.ring_edges);
    }
    all
}

/// Follows the tetrahedra about an edge of `tet`, counter-clockwise about the edge directed from the smaller generator.
/// `None` when the ring leaves the side or when `tet` is not its smallest member (the ring is found there).
fn walk_ring(
    triangulation: &Triangulation,
    dual: &Vertices,
    tet: TetId,
    ([i, j], [k, l]): ([usize; 2], [usize; 2]),
    ring: &mut Vec<(u32, u8)>,
) -> Option<[VertexId; 2]> {
    let corners = triangulation.tet(tet);
    let (a, b) = (corners[i], corners[j]);
    // Leaving opposite `k` turns from k towards l, which is counter-clockwise about i -> j.
    let mut exit = if a < b { k } else { l };
    let mut kept = if a < b { corners[l] } else { corners[k] };
    ring.clear();
    let mut at = tet;
    loop {
        ring.push((dual.of_tet[at.index()], exit as u8));
        let mirror = triangulation.mirror(crate::delaunay::Facet {
            tet: at,
            index: exit as u8,
        });
        if mirror.tet == tet {
            return Some([a.min(b), a.max(b)]);
        }
        if mirror.tet < tet || dual.of_tet[mirror.tet.index()] == NONE {
            return None;
        }
        at = mirror.tet;
        let entered = triangulation.tet(at)[mirror.index as usize];
        exit = triangulation.tet(at).iter().position(|&v| v == kept)?;
        kept = entered;
    }
}

/// Inverts "facet has edges" to "edge has facets", ascending.
fn incidence(edges: usize, facet_start: &[u32], ring_edges: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; edges + 1];
    for &e in ring_edges {
        start[e as usize + 1] += 1;
    }
    for e in 0..edges {
        start[e + 1] += start[e];
    }
    let mut next = start.clone();
    let mut facets = vec![0u32; ring_edges.len()];
    for f in 0..facet_start.len() - 1 {
        for &e in &ring_edges[facet_start[f] as usize..facet_start[f + 1] as usize] {
            facets[next[e as usize] as usize] = f as u32;
            next[e as usize] += 1;
        }
    }
    (start, facets)
}

struct Cells {
    generator: Vec<VertexId>,
    start: Vec<u32>,
    facets: Vec<u32>,
}

fn cells(triangulation: &Triangulation, of_side: &[bool], facet_generators: &[[VertexId; 2]]) -> Cells {
    let n = triangulation.points.len();
    let (mut in_side, mut off_side) = (vec![false; n], vec![false; n]);
    for t in triangulation.tets() {
        let seen = if of_side[t.index()] {
            &mut in_side
        } else {
            &mut off_side
        };
        for v in triangulation.tet(t) {
            if v != INFINITE {
                seen[v.index()] = true;
            }
        }
    }
    let generator: Vec<VertexId> = (0..n)
        .filter(|&g| in_side[g] && !off_side[g])
        .map(VertexId::from_index)
        .collect();
    let mut cell_of = vec![NONE; n];
    for (c, g) in generator.iter().enumerate() {
        cell_of[g.index()] = c as u32;
    }
    let mut lists = vec![Vec::new(); generator.len()];
    for (f, pair) in facet_generators.iter().enumerate() {
        for g in pair {
            if cell_of[g.index()] != NONE {
                lists[cell_of[g.index()] as usize].push(f as u32);
            }
        }
    }
    let mut out = Cells {
        generator,
        start: vec![0],
        facets: Vec::new(),
    };
    for list in lists {
        out.facets.extend(list);
        out.start.push(out.facets.len() as u32);
    }
    out
}

/// Components of the complement: the cells of two generators meet across a Voronoi facet that is not in the complex
/// exactly when some tetrahedron of the other side (a ghost included) holds both.
fn regions(triangulation: &Triangulation, of_side: &[bool]) -> (Vec<u32>, u32) {
    let n = triangulation.points.len();
    let mut sets = DisjointSets::new(n);
    for t in triangulation.tets().filter(|t| !of_side[t.index()]) {
        let corners = triangulation.tet(t);
        for v in corners.iter().filter(|v| **v != INFINITE) {
            sets.union(corners[0].0, v.0);
        }
    }
    let mut number = vec![NONE; n];
    let mut count = 0;
    let region = (0..n as u32)
        .map(|g| {
            let root = sets.find(g) as usize;
            if number[root] == NONE {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect();
    (region, count)
}

fn generator_volumes(triangulation: &Triangulation, tets: &[TetId]) -> Vec<f64> {
    let mut volume = vec![0.0; triangulation.points.len()];
    for &t in tets {
        let [a, b, c, d] = triangulation.corners(t);
        let quarter = (b - a).cross(c - a).dot(d - a) / 24.0;
        for v in triangulation.tet(t) {
            volume[v.index()] += quarter;
        }
    }
    volume
}

fn scale(triangulation: &Triangulation, of_side: &[bool]) -> LengthScale {
    let diagonal_mm = bounds(&triangulation.points).map_or(0.0, |[lo, hi]| (hi - lo).length());
    let mut area = 0.0;
    let mut on_boundary = vec![false; triangulation.points.len()];
    for f in triangulation.facets() {
        if of_side[f.tet.index()] == of_side[triangulation.mirror(f).tet.index()] {
            continue;
        }
        let ids = triangulation.facet_vertices(f);
        if ids.contains(&INFINITE) {
            continue;
        }
        let [a, b, c] = ids.map(|v| triangulation.points[v.index()]);
        area += 0.5 * (b - a).cross(c - a).length();
        for v in ids {
            on_boundary[v.index()] = true;
        }
    }
    let n = on_boundary.iter().filter(|&&b| b).count().max(1);
    LengthScale {
        diagonal_mm,
        spacing_mm: (area / n as f64).sqrt(),
    }
}

/// Longest walk to a circumcentre; longer ones are cut short by rounding only and end where they are.
const MAX_WALK: usize = 256;

/// Walks from a tetrahedron to its circumcentre and asks the tetrahedron found there. Rounding may stop the walk in a
/// neighbour of the right one, which matters only for circumcentres on the surface, whose radius is about zero.
fn circumcentre_is_of_side(
    triangulation: &Triangulation,
    of_side: &[bool],
    tet: TetId,
    centre: DVec3,
) -> bool {
    let (mut at, mut from) = (tet, tet);
    for _ in 0..MAX_WALK {
        if !triangulation.is_finite(at) {
            return of_side[at.index()];
        }
        let beyond = (0..4u8).find(|&index| {
            let facet = crate::delaunay::Facet { tet: at, index };
            let next = triangulation.mirror(facet).tet;
            let [a, b, c] = triangulation
                .facet_vertices(facet)
                .map(|v| triangulation.points[v.index()]);
            next != from && (b - a).cross(c - a).dot(centre - a) > 0.0
        });
        match beyond {
            None => break,
            Some(index) => {
                from = at;
                at = triangulation.neighbour(at, index as usize);
            }
        }
    }
    of_side[at.index()]
}
