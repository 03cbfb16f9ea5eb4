//! The scaffold of points that do not span space: coplanar, collinear, or fewer than two.
//!
//! In: a triangulation of dimension below 3. Out: [`PlanarScaffold`] inside a [`FullScaffold`] without vertices. In space the
//! scaffold of coplanar points is a prism: every sheet and curve is perpendicular to the plane and unbounded on both sides.
//! Steps: (1) the planar Delaunay triangulation is the link of an apex in the triangulation of the points and any one point
//! off their plane: a sphere through the apex meets the plane in the circle of its triangle, so both tests and ties agree;
//! (2) all triangles are Gabriel; sources and relays are told apart by their angles, sheet sources by the edges' links.
//! Collinear points have one sheet between each two neighbours.

use super::flow::{CriticalCounts, FlowType};
use super::scaffold::FullScaffold;
use crate::delaunay::{DelaunayError, DelaunaySettings, INFINITE, Triangulation, delaunay};
use crate::geometry::VertexId;
use crate::geometry::predicates::{edge_gabriel_perturbed, orient3d};
use glam::DVec3;

/// Sheets and curves of generators in a plane or on a line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlanarScaffold {
    /// Delaunay triangles of the plane, dual to the curves (straight lines perpendicular to the plane), each starting with its
    /// smallest vertex, in order; all turn the same way.
    pub triangles: Vec<[VertexId; 3]>,
    /// Flow on the curve of each triangle: source or relay.
    pub flows: Vec<FlowType>,
    /// Delaunay edges, dual to the sheets, smaller vertex first, in order.
    pub edges: Vec<[VertexId; 2]>,
    /// Whether the sheet of each edge has a source (the edge is Gabriel).
    pub has_source: Vec<bool>,
}

/// The scaffold of a triangulation without tetrahedra; `points` are its points in the frame of the predicates.
pub(super) fn flat_scaffold(t: &Triangulation, points: &[DVec3]) -> Result<FullScaffold, DelaunayError> {
    let mut planar = PlanarScaffold::default();
    match t.dimension {
        2 => {
            planar.triangles = planar_triangles(points)?;
            let mut edges: Vec<[VertexId; 2]> = planar
                .triangles
                .iter()
                .flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)])
                .collect();
            edges.sort_unstable();
            edges.dedup();
            planar.edges = edges;
        }
        // Lexicographic order is the order along a line.
        1 => {
            planar.edges = (1..points.len())
                .map(|i| [VertexId::from_index(i - 1), VertexId::from_index(i)])
                .collect();
        }
        _ => {}
    }
    planar.has_source = vec![true; planar.edges.len()];
    for &triangle in &planar.triangles {
        let mut flow = FlowType::Source;
        for k in 0..3 {
            let [at, a, b] = [0, 1, 2].map(|i| triangle[(k + i) % 3]);
            if edge_gabriel_perturbed(points[a.index()], points[b.index()], points[at.index()]) < 0.0 {
                flow = FlowType::Relay;
                let place = planar
                    .edges
                    .binary_search(&edge(a, b))
                    .expect("an edge of a triangle is listed");
                planar.has_source[place] = false;
            }
        }
        planar.flows.push(flow);
    }
    let sources = planar.flows.iter().filter(|&&f| f == FlowType::Source).count() as u64;
    let mut counts = CriticalCounts {
        generators: points.len() as u64,
        sheet_sources: planar.has_source.iter().filter(|&&s| s).count() as u64,
        curve_sources: sources,
        relays: planar.flows.len() as u64 - sources,
        ..CriticalCounts::default()
    };
    counts.morse = counts.generators as i64 - counts.sheet_sources as i64 + counts.curve_sources as i64;
    Ok(FullScaffold::flat(counts, planar))
}

fn edge(a: VertexId, b: VertexId) -> [VertexId; 2] {
    [a.min(b), a.max(b)]
}

/// The planar Delaunay triangles of coplanar points, by an apex off the plane.
fn planar_triangles(points: &[DVec3]) -> Result<Vec<[VertexId; 3]>, DelaunayError> {
    let apex = apex(points);
    let mut all = points.to_vec();
    all.push(apex);
    let t = delaunay(&all, &DelaunaySettings { threads: 1 })?;
    let place = VertexId::from_index(
        t.points
            .iter()
            .position(|&p| p == apex)
            .expect("the apex is a vertex like the others"),
    );
    let original = |v: VertexId| if v > place { VertexId(v.0 - 1) } else { v };
    let mut triangles: Vec<[VertexId; 3]> = t
        .finite_tets()
        .map(|tet| {
            debug_assert!(!t.tet(tet).contains(&INFINITE));
            let index = t
                .tet(tet)
                .iter()
                .position(|&v| v == place)
                .expect("every tetrahedron has the apex");
            let facet = crate::delaunay::Facet {
                tet,
                index: index as u8,
            };
            let [a, b, c] = t.facet_vertices(facet).map(original);
            match a.min(b).min(c) {
                m if m == a => [a, b, c],
                m if m == b => [b, c, a],
                _ => [c, a, b],
            }
        })
        .collect();
    triangles.sort_unstable();
    Ok(triangles)
}

/// A point off the plane: the first point moved along one axis by a power of two of the size of the cloud, so that the range
/// of exponents hardly grows.
fn apex(points: &[DVec3]) -> DVec3 {
    let size = points.iter().fold(0.0f64, |m, p| m.max(p.abs().max_element()));
    let step = f64::powi(2.0, size.log2().ceil() as i32);
    let (a, c) = (points[0], points[points.len() - 1]);
    let b = points
        .iter()
        .copied()
        .find(|&b| !crate::geometry::predicates::collinear(a, b, c))
        .expect("coplanar points of dimension two are not collinear");
    [DVec3::X, DVec3::Y, DVec3::Z]
        .map(|axis| a + step * axis)
        .into_iter()
        .find(|&d| orient3d(a, b, c, d) != 0.0)
        .expect("three axes do not all lie in one plane")
}
