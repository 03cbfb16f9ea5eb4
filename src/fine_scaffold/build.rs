//! Building the fine scaffold.
//!
//! In: the triangulation and a [`Domain`], one side of the surface. Out: the dual complex of the simplices in the interior of that side.
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
//! error, because no later stage could place it. One whose circumcentre is on the other side and farther off than the tetrahedron is long is
//! put at the centroid: labels that close a surface or mend its topology need such tetrahedra, and their circumcentres say nothing.

use super::complex::{FineScaffold, NONE};
use super::domain::Domain;
use crate::delaunay::triangulation::INFINITE;
use crate::delaunay::{Facet, Triangulation};
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
    /// The convex hull less the solid, but for what a large ball reaches from outside; see [`super::domain`].
    Exterior,
    /// Both sides of an open surface, one through its holes and round its rims; see [`super::domain`].
    Joined,
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
    #[error("the surface is open, so it has no inside; `medial mesh --closed` closes it")]
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
    /// A surface that is not part of the triangulation.
    #[error(
        "{missing} of {triangles} surface triangles are not in the triangulation; segregation and triangulation do not belong together"
    )]
    Surface {
        /// Triangles not found.
        missing: usize,
        /// Triangles of the surface.
        triangles: usize,
    },
    /// No tetrahedron is of the side.
    #[error(
        "none of {tets} tetrahedra lies on the {side:?} side: the sampling is too coarse for this shape (lower --spacing), the \
         surface is inside out, or, outside, no part of it is deep enough to have a scaffold"
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
    fine_scaffold_of(
        triangulation,
        &Domain::new(triangulation, segregation, settings.side)?,
    )
}

/// Makes the fine scaffold of a domain.
///
/// # Errors
/// [`FineScaffoldError`]: an empty domain, a flat tetrahedron.
///
/// # Complexity
/// `O(tetrahedra)` time and space.
pub fn fine_scaffold_of(
    triangulation: &Triangulation,
    domain: &Domain,
) -> Result<FineScaffold, FineScaffoldError> {
    let dual = Vertices::new(triangulation, domain);
    if dual.tets.is_empty() {
        return Err(FineScaffoldError::Empty {
            tets: triangulation.num_finite(),
            side: domain.side(),
        });
    }
    let mut balls = circumballs(triangulation, &dual.tets)?;
    let edges = edges(triangulation, domain, &dual);
    let facets = facets(triangulation, domain, &dual, &edges.of_vertex);
    let (edge_facet_start, edge_facets) = incidence(edges.vertices.len(), &facets.start, &facets.ring_edges);
    let cells = cells(triangulation, domain, &facets.generators);
    let (generator_region, num_regions) = regions(triangulation, domain);
    let outside: Vec<bool> = (0..dual.tets.len())
        .into_par_iter()
        .map(|v| !circumcentre_is_of_side(triangulation, domain, dual.tets[v], balls[v].centre))
        .collect();
    for v in (0..balls.len()).filter(|&v| outside[v]) {
        hold_near(triangulation.corners(dual.tets[v]), &mut balls[v]);
    }
    Ok(FineScaffold {
        scale: scale(triangulation, domain),
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
    fn new(triangulation: &Triangulation, domain: &Domain) -> Self {
        let mut of_tet = vec![NONE; triangulation.num_tets()];
        let mut tets = Vec::new();
        for t in triangulation.finite_tets().filter(|&t| domain.has(t)) {
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

/// Keeps the ball of a flat tetrahedron, labelled against its circumcentre, from flying off: when its radius is more than the
/// longest edge, the centroid takes the centre's place, with the largest ball that holds no corner.
fn hold_near(corners: [DVec3; 4], ball: &mut Sphere) {
    let longest = (1..4)
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|(i, j)| corners[i].distance(corners[j]))
        .fold(0.0, f64::max);
    if ball.radius > longest {
        ball.centre = corners.iter().sum::<DVec3>() / 4.0;
        ball.radius = corners
            .iter()
            .map(|c| c.distance(ball.centre))
            .fold(f64::INFINITY, f64::min);
    }
}

struct Edges {
    vertices: Vec<[u32; 2]>,
    generators: Vec<[VertexId; 3]>,
    of_vertex: Vec<[u32; 4]>,
}

fn edges(triangulation: &Triangulation, domain: &Domain, dual: &Vertices) -> Edges {
    let mut out = Edges {
        vertices: Vec::with_capacity(2 * dual.tets.len()),
        generators: Vec::with_capacity(2 * dual.tets.len()),
        of_vertex: vec![[NONE; 4]; dual.tets.len()],
    };
    for (v, &tet) in dual.tets.iter().enumerate() {
        for index in 0..4u8 {
            let facet = Facet { tet, index };
            let Some(mirror) = domain.beyond(triangulation, facet) else {
                continue;
            };
            let w = dual.of_tet[mirror.tet.index()];
            if (w as usize) < v {
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

fn facets(
    triangulation: &Triangulation,
    domain: &Domain,
    dual: &Vertices,
    edges_of_vertex: &[[u32; 4]],
) -> Facets {
    let parts: Vec<Facets> = dual
        .tets
        .par_chunks(CHUNK)
        .map(|tets| {
            let mut out = Facets::default();
            let mut ring = Vec::with_capacity(32);
            for &tet in tets {
                for pair in AROUND {
                    if let Some(generators) = walk_ring(triangulation, domain, dual, tet, pair, &mut ring) {
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
    domain: &Domain,
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
        let facet = Facet {
            tet: at,
            index: exit as u8,
        };
        let mirror = domain.beyond(triangulation, facet)?;
        if mirror.tet == tet {
            return Some([a.min(b), a.max(b)]);
        }
        if mirror.tet < tet {
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

fn cells(triangulation: &Triangulation, domain: &Domain, facet_generators: &[[VertexId; 2]]) -> Cells {
    let n = triangulation.points.len();
    let bounding = domain.bounding_generators(triangulation);
    let generator: Vec<VertexId> = (0..n)
        .filter(|&g| !bounding[g])
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
/// exactly when some tetrahedron of the other side (a ghost included) or some wall holds both.
fn regions(triangulation: &Triangulation, domain: &Domain) -> (Vec<u32>, u32) {
    let n = triangulation.points.len();
    let mut sets = DisjointSets::new(n);
    for t in triangulation.tets().filter(|&t| !domain.has(t)) {
        let corners = triangulation.tet(t);
        for v in corners.iter().filter(|v| **v != INFINITE) {
            sets.union(corners[0].0, v.0);
        }
    }
    for f in triangulation.facets().filter(|&f| domain.is_wall(f)) {
        let [a, b, c] = triangulation.facet_vertices(f);
        sets.union(a.0, b.0);
        sets.union(a.0, c.0);
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

fn scale(triangulation: &Triangulation, domain: &Domain) -> LengthScale {
    let diagonal_mm = bounds(&triangulation.points).map_or(0.0, |[lo, hi]| (hi - lo).length());
    let mut area = 0.0;
    let mut on_boundary = vec![false; triangulation.points.len()];
    for f in triangulation.facets() {
        if !domain.on_surface(triangulation, f) {
            continue;
        }
        let ids = triangulation.facet_vertices(f);
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

/// Walks from a tetrahedron to its circumcentre and asks the tetrahedron found there, or, where walls alone part the sides, whether it
/// came through one. Rounding may stop the walk in a neighbour of the right one, which matters only for circumcentres on the
/// surface, whose radius is about zero.
fn circumcentre_is_of_side(
    triangulation: &Triangulation,
    domain: &Domain,
    tet: TetId,
    centre: DVec3,
) -> bool {
    let (mut at, mut from) = (tet, tet);
    let mut walls = 0;
    for _ in 0..MAX_WALK {
        if !triangulation.is_finite(at) {
            break;
        }
        let beyond = (0..4u8).map(|index| Facet { tet: at, index }).find(|&facet| {
            let next = triangulation.mirror(facet).tet;
            let [a, b, c] = triangulation
                .facet_vertices(facet)
                .map(|v| triangulation.points[v.index()]);
            next != from && (b - a).cross(c - a).dot(centre - a) > 0.0
        });
        match beyond {
            None => break,
            Some(facet) => {
                walls += usize::from(domain.is_wall(facet));
                from = at;
                at = triangulation.mirror(facet).tet;
            }
        }
    }
    match domain.side() {
        Side::Joined => walls % 2 == 0,
        Side::Interior | Side::Exterior => domain.has(at),
    }
}
