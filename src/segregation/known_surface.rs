//! Segregation by a known closed surface: a tetrahedron is inside when its circumcentre is.
//!
//! In: the triangulation of generators on (or near) a closed, oriented surface, and that surface. Out: the label of every
//! tetrahedron, the facets between inside and outside as triangles, and a comparison of their topology with the surface's.
//!
//! 1. Tetrahedra are flooded into regions that the surface provably does not cut ([`super::flood`]).
//! 2. One winding number a region, at the circumcentre of its smallest tetrahedron; inside above one half. Measured: the
//!    *centroid* instead of the circumcentre gives the wrong topology even on noise-free samples, because slivers lie on
//!    the surface; circumcentres put each sliver with the ball it belongs to.
//! 3. Flat tetrahedra (cocircular generators, e.g. a grid) take the label of the tetrahedra round them: inside only when
//!    all of those are. Any consistent choice gives the same solid, as they have no volume.
//! 4. The facets between the labels are the restricted Delaunay triangles of the surface (Edelsbrunner & Shah 1997). Where
//!    each Voronoi edge meets the surface at most once, each Voronoi facet in one arc, the topology is the surface's. When
//!    the component-wise Euler numbers differ or an edge or vertex is non-manifold, the places where that property fails
//!    are listed: points *of the known surface* which, added as generators, resolve it (as in Boissonnat & Oudot 2005).
//!
//! Cost: `O(n log n)` and one distance query for about one tetrahedron in eight.

use super::balls::Balls;
use super::error::SegregationError;
use super::flood::{Regions, regions};
use super::known_repair::RepairedPlace;
use super::labels::{Segregation, boundary_facets, boundary_triangles, mesh_of};
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::{MeshTopology, Neighbours, TetId, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What a known surface answers. Distances mm.
pub trait SurfaceQueries: Sync {
    /// Distance of a point from the surface.
    fn distance_mm(&self, point: DVec3) -> f64;
    /// Whether the generalised winding number is above one half.
    fn is_inside(&self, point: DVec3) -> bool;
    /// Where the segment meets the surface, as shares of its length in increasing order.
    fn crossings(&self, from: DVec3, to: DVec3) -> Vec<f64>;
}

/// Settings of the known-surface route.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KnownSurfaceSettings {
    /// List at most this many places for refinement, those farthest from the generators first.
    pub max_places: usize,
    /// Rounds of refinement at most ([`super::segregate_known_refined`]). Each halves the smallest feature seen; ten are
    /// a factor of a thousand.
    pub max_rounds: usize,
    /// Refinement stops after this many rounds without a better topology.
    pub max_idle_rounds: usize,
    /// Refinement stops when the generators are this many times those given.
    pub max_growth: f64,
}

impl Default for KnownSurfaceSettings {
    fn default() -> Self {
        Self {
            max_places: 2000,
            max_rounds: 10,
            max_idle_rounds: 4,
            max_growth: 2.0,
        }
    }
}

/// Why a place asks for finer sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RefinementReason {
    /// A curve of the full scaffold crosses the surface more than once between two of its vertices.
    ManyCrossings,
    /// The triangles round a generator or an edge do not form a disk.
    NotADisk,
    /// The nearest generator is far from this part of the surface.
    Unsampled,
}

/// A point of the known surface that should become a generator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RefinementPlace {
    /// The point on the known surface, mm.
    pub point: DVec3,
    /// Why.
    pub reason: RefinementReason,
}

/// Numbers of a known-surface segregation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KnownSurfaceReport {
    /// Regions that were asked for their side.
    pub regions: usize,
    /// Winding-number queries, one a region.
    pub winding_queries: usize,
    /// Distance queries of the flood.
    pub distance_queries: usize,
    /// Flat tetrahedra, labelled by their neighbours.
    pub flat_tets: usize,
    /// Topology of the known surface.
    pub expected: MeshTopology,
    /// Topology of the segregated surface.
    pub found: MeshTopology,
    /// Euler numbers of the components of the known surface that enclose volume, sorted.
    pub expected_euler: Vec<i64>,
    /// Euler numbers of the components of the segregated surface, sorted.
    pub found_euler: Vec<i64>,
    /// Whether the segregated surface is a manifold with the known surface's components and Euler numbers.
    pub agree: bool,
    /// Where more generators are needed; empty when `agree`.
    pub needs_refinement: Vec<RefinementPlace>,
    /// Where labels were changed after all refinement so that the topology agrees ([`super::known_repair`]); most often empty.
    pub repaired: Vec<RepairedPlace>,
}

/// Labels, triangles and report.
#[derive(Clone, Debug, Default)]
pub struct KnownSurfaceSegregation {
    /// Labels and triangles.
    pub segregation: Segregation,
    /// Numbers.
    pub report: KnownSurfaceReport,
}

/// Segregates by a known closed surface; see the module.
///
/// # Errors
/// [`SegregationError::FewPoints`] when the generators do not span space, [`SegregationError::OpenSurface`] when the known
/// surface has open edges (it has no inside; mend it first or use the cloud route).
pub fn segregate_known(
    triangulation: &Triangulation,
    surface: &TriangleMesh,
    queries: &impl SurfaceQueries,
    settings: &KnownSurfaceSettings,
) -> Result<KnownSurfaceSegregation, SegregationError> {
    let expected = surface.topology();
    if expected.boundary_edges > 0 || surface.triangles.is_empty() {
        return Err(SegregationError::OpenSurface {
            boundary_edges: expected.boundary_edges,
            triangles: expected.triangles,
        });
    }
    if triangulation.dimension < 3 {
        return Err(SegregationError::FewPoints {
            points: triangulation.points.len(),
            dimension: triangulation.dimension,
        });
    }
    let balls = Balls::new(triangulation);
    let regions = regions(triangulation, &balls, |p| queries.distance_mm(p));
    let labelled = label_regions(triangulation, &balls, &regions, queries);
    let inside = labelled.inside;
    let triangles = boundary_triangles(triangulation, &inside);
    let mesh = mesh_of(triangulation, &triangles);
    let found = mesh.topology();
    let expected_euler = enclosing_parts(surface)
        .into_iter()
        .map(|p| p.euler)
        .collect::<Vec<_>>();
    let found_euler = component_eulers(&mesh);
    let agree = expected_euler == found_euler
        && found.nonmanifold_edges == 0
        && found.nonmanifold_vertices == 0
        && found.watertight;
    let mut warnings = Vec::new();
    let mut needs_refinement = Vec::new();
    if !agree {
        needs_refinement = places(
            triangulation,
            &balls,
            &inside,
            surface,
            queries,
            settings.max_places,
        );
        warnings.push(format!(
            "the segregated surface has {}, the known surface {}; {} non-manifold \
             edges and {} non-manifold vertices; {} places ask for finer sampling",
            eulers_in_words(&found_euler),
            eulers_in_words(&expected_euler),
            found.nonmanifold_edges,
            found.nonmanifold_vertices,
            needs_refinement.len()
        ));
    }
    Ok(KnownSurfaceSegregation {
        segregation: Segregation {
            triangles,
            inside,
            closed: true,
            loose: 0,
            warnings,
        },
        report: KnownSurfaceReport {
            regions: labelled.queries,
            winding_queries: labelled.queries,
            distance_queries: regions.distance_queries,
            flat_tets: balls.flat.iter().filter(|f| **f).count(),
            expected,
            found,
            expected_euler,
            found_euler,
            agree,
            needs_refinement,
            repaired: Vec::new(),
        },
    })
}

struct Labelled {
    inside: Vec<bool>,
    queries: usize,
}

/// Step 2 and 3: one query a region, then the flat tetrahedra.
fn label_regions(
    triangulation: &Triangulation,
    balls: &Balls,
    regions: &Regions,
    queries: &impl SurfaceQueries,
) -> Labelled {
    let asked: Vec<u32> = (0..triangulation.num_finite() as u32)
        .filter(|&t| !balls.flat[t as usize] && regions.representative[t as usize].0 == t)
        .collect();
    let answers: Vec<bool> = asked
        .par_iter()
        .map(|&t| queries.is_inside(balls.centres[t as usize]))
        .collect();
    let mut inside = vec![false; triangulation.num_tets()];
    for (&t, &answer) in asked.iter().zip(&answers) {
        inside[t as usize] = answer;
    }
    for t in 0..triangulation.num_finite() {
        inside[t] = !balls.flat[t] && inside[regions.representative[t].index()];
    }
    label_flat(triangulation, &balls.flat, &mut inside);
    Labelled {
        inside,
        queries: asked.len(),
    }
}

/// A connected set of flat tetrahedra is inside when every tetrahedron round it is.
pub(super) fn label_flat(triangulation: &Triangulation, flat: &[bool], inside: &mut [bool]) {
    let mut seen = vec![false; flat.len()];
    let mut group = Vec::new();
    for start in triangulation.finite_tets().filter(|t| flat[t.index()]) {
        if std::mem::replace(&mut seen[start.index()], true) {
            continue;
        }
        group.clear();
        group.push(start);
        let mut all_inside = true;
        let mut next = 0;
        while next < group.len() {
            let tet = group[next];
            next += 1;
            for index in 0..4 {
                let other = triangulation.neighbour(tet, index);
                if !triangulation.is_finite(other) || !flat[other.index()] {
                    all_inside &= inside[other.index()];
                } else if !std::mem::replace(&mut seen[other.index()], true) {
                    group.push(other);
                }
            }
        }
        for tet in &group {
            inside[tet.index()] = all_inside;
        }
    }
}

/// Euler numbers of components for a message: each of a few, the sum of many.
pub(super) fn eulers_in_words(eulers: &[i64]) -> String {
    const SHOWN: usize = 6;
    if eulers.len() <= SHOWN {
        return format!("Euler numbers {eulers:?}");
    }
    format!(
        "{} components with Euler numbers {} in all ({} of them other than a sphere's 2)",
        eulers.len(),
        eulers.iter().sum::<i64>(),
        eulers.iter().filter(|e| **e != 2).count()
    )
}

/// A component of a known surface that encloses volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EnclosingPart {
    pub euler: i64,
    /// Whether it bounds a cavity (it is oriented inwards).
    pub cavity: bool,
}

/// The components of a closed surface that enclose volume, by Euler number. Segmentation programs leave pairs of triangles back to
/// back; such a part has no inside, so no labels can show it.
pub(super) fn enclosing_parts(surface: &TriangleMesh) -> Vec<EnclosingPart> {
    let mut out: Vec<EnclosingPart> = surface
        .solid_components()
        .iter()
        .map(|c| surface.submesh(c))
        .map(|part| EnclosingPart {
            euler: part.topology().euler,
            cavity: part.signed_volume() < 0.0,
        })
        .collect();
    out.sort_unstable_by_key(|p| (p.euler, p.cavity));
    out
}

/// Euler numbers of the connected components, sorted.
pub(super) fn component_eulers(mesh: &TriangleMesh) -> Vec<i64> {
    let mut out: Vec<i64> = mesh
        .components()
        .iter()
        .map(|c| mesh.submesh(c).topology().euler)
        .collect();
    out.sort_unstable();
    out
}

/// Step 4: points of the surface where it is not sampled finely enough for its topology.
fn places(
    triangulation: &Triangulation,
    balls: &Balls,
    inside: &[bool],
    surface: &TriangleMesh,
    queries: &impl SurfaceQueries,
    max_places: usize,
) -> Vec<RefinementPlace> {
    let mut found = many_crossings(triangulation, balls, queries);
    found.extend(not_disks(triangulation, balls, inside, queries));
    if found.is_empty() {
        found = unsampled(triangulation, surface);
    }
    spread(triangulation, found, max_places)
}

/// Keeps places that are far from the generators first, and drops those nearer to a kept one than half their own distance
/// to the generators: one new generator changes its whole surroundings, so places beside it are out of date.
fn spread(
    triangulation: &Triangulation,
    found: Vec<RefinementPlace>,
    max_places: usize,
) -> Vec<RefinementPlace> {
    let generators = Neighbours::new(&triangulation.points);
    let clearance: Vec<f64> = found
        .par_iter()
        .map(|p| generators.nearest(p.point).map_or(0.0, |n| n.distance2.sqrt()))
        .collect();
    let mut order: Vec<usize> = (0..found.len()).filter(|&i| clearance[i] > 0.0).collect();
    order.sort_by(|&i, &j| {
        clearance[j].total_cmp(&clearance[i]).then_with(|| {
            let (p, q) = (found[i].point, found[j].point);
            p.x.total_cmp(&q.x)
                .then(p.y.total_cmp(&q.y))
                .then(p.z.total_cmp(&q.z))
        })
    });
    let mut kept: Vec<RefinementPlace> = Vec::new();
    for i in order {
        let far = |k: &RefinementPlace| k.point.distance(found[i].point) >= 0.5 * clearance[i];
        if kept.len() < max_places && kept.iter().all(far) {
            kept.push(found[i]);
        }
    }
    kept
}

/// The dual Voronoi edge of a facet between two finite, non-flat tetrahedra.
fn dual_segment(triangulation: &Triangulation, balls: &Balls, facet: Facet) -> Option<[DVec3; 2]> {
    let other = triangulation.mirror(facet).tet;
    let usable = |t: TetId| triangulation.is_finite(t) && !balls.flat[t.index()];
    (usable(facet.tet) && usable(other))
        .then(|| [balls.centres[facet.tet.index()], balls.centres[other.index()]])
}

/// All crossings of Voronoi edges that cross the surface more than once.
fn many_crossings(
    triangulation: &Triangulation,
    balls: &Balls,
    queries: &impl SurfaceQueries,
) -> Vec<RefinementPlace> {
    let facets: Vec<Facet> = triangulation.facets().collect();
    facets
        .par_iter()
        .map(|&facet| {
            let Some([from, to]) = dual_segment(triangulation, balls, facet) else {
                return Vec::new();
            };
            let hits = queries.crossings(from, to);
            if hits.len() < 2 {
                return Vec::new();
            }
            hits.iter()
                .map(|&s| RefinementPlace {
                    point: from + s * (to - from),
                    reason: RefinementReason::ManyCrossings,
                })
                .collect()
        })
        .collect::<Vec<_>>()
        .concat()
}

/// Crossings of the Voronoi edges dual to the triangles at a generator whose triangles do not form a disk.
fn not_disks(
    triangulation: &Triangulation,
    balls: &Balls,
    inside: &[bool],
    queries: &impl SurfaceQueries,
) -> Vec<RefinementPlace> {
    let bad = super::stars::pinched_vertices(triangulation, inside);
    boundary_facets(triangulation, inside)
        .into_iter()
        .filter(|&f| triangulation.facet_vertices(f).iter().any(|v| bad[v.index()]))
        .filter_map(|f| dual_segment(triangulation, balls, f))
        .flat_map(|[from, to]| {
            queries
                .crossings(from, to)
                .into_iter()
                .map(move |s| RefinementPlace {
                    point: from + s * (to - from),
                    reason: RefinementReason::NotADisk,
                })
        })
        .collect()
}

/// Corners and centroids of the known surface's triangles farther from every generator than a generator is, on average,
/// from its nearest inside neighbour: the parts that sampling missed.
fn unsampled(triangulation: &Triangulation, surface: &TriangleMesh) -> Vec<RefinementPlace> {
    let candidates: Vec<DVec3> = surface
        .triangles
        .iter()
        .flat_map(|t| {
            let [a, b, c] = t.map(|i| surface.points[i as usize]);
            [a, b, c, (a + b + c) / 3.0]
        })
        .collect();
    let neighbours = Neighbours::new(&triangulation.points);
    let distances: Vec<f64> = candidates
        .par_iter()
        .map(|&p| {
            neighbours
                .nearest(p)
                .map_or(f64::INFINITY, |n| n.distance2.sqrt())
        })
        .collect();
    let mut sorted = distances.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let limit = sorted
        .get(sorted.len() * 9 / 10)
        .copied()
        .unwrap_or(f64::INFINITY);
    candidates
        .iter()
        .zip(&distances)
        .filter(|(_, d)| **d > limit.max(0.0))
        .map(|(p, _)| RefinementPlace {
            point: *p,
            reason: RefinementReason::Unsampled,
        })
        .collect()
}
