//! The full scaffold as read off a Delaunay triangulation.
//!
//! In: [`Triangulation`]. Out: [`FullScaffold`]. Steps: (1) sphere and signs of every tetrahedron (`spheres`, four at a
//! time by `four`); (2) flow type of every triangle from the two signs across it and its angles, and whether the two spheres
//! coincide (`facets`); (3) critical points counted, sheet sources through the edges that face an obtuse angle; (4) vertices
//! whose spheres coincide gathered (`merged`).
//!
//! After Leymarie & Kimia 2007 (types of shocks) and Siersma 1999, Giesen & John 2008 (critical points of the distance to
//! points are the Delaunay simplices that hold their centre and whose smallest ball is empty). We read the scaffold off the
//! Delaunay triangulation instead of pairing shocks: the result is the same and robustness has one place. Ties are those of
//! a generic weighted point set infinitely near (see [`crate::geometry::predicates`]), hence arcs are acyclic and the
//! alternating sum of critical points is 1 for every input. Cost: `O(tetrahedra)`.

use super::facets::{CHUNK, classify, tell_both_sides};
use super::flow::{CriticalCounts, FlowType};
use super::merged::{DegenerateVertex, degenerate_vertices};
use super::planar::{self, PlanarScaffold};
use super::spheres::{Geometries, Signs};
use crate::delaunay::counters::Counters;
use crate::delaunay::door::Frame;
use crate::delaunay::lanes::with_lanes;
use crate::delaunay::{DelaunayError, Facet, Triangulation};
use crate::geometry::fixed::Grid;
use crate::geometry::{Sphere, TetId};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Flow along the curve element dual to a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arc {
    /// Two arcs leave a critical point on the curve element towards both ends.
    Outward,
    /// One arc, along increasing radius. The end may be a ghost: the curve goes to infinity.
    Along {
        /// Tetrahedron of the smaller sphere.
        from: TetId,
        /// Tetrahedron of the larger sphere, or a ghost.
        to: TetId,
    },
}

/// A curve element with an end at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnboundedCurve {
    /// The hull triangle it is dual to, as seen from its finite tetrahedron.
    pub facet: Facet,
    /// Unit direction towards infinity: outward normal of the triangle.
    pub direction: DVec3,
}

/// The medial scaffold of all generators. Curve elements are addressed by the Delaunay triangle ([`Facet`], either side),
/// vertices by the tetrahedron, sheet elements by the Delaunay edge.
#[derive(Clone, Debug, PartialEq)]
pub struct FullScaffold {
    /// Circumscribed sphere of every finite tetrahedron, mm: position and radius of the scaffold's vertex.
    pub spheres: Vec<Sphere>,
    /// Numbers of critical points.
    pub counts: CriticalCounts,
    /// Vertices of five or more generators, by exact test, each made of several tetrahedra of one sphere.
    pub degenerate: Vec<DegenerateVertex>,
    /// The scaffold of points that do not span space; `None` when they do.
    pub planar: Option<PlanarScaffold>,
    /// Bit `i` of a finite tetrahedron: vertex `i` is outside the smallest ball of facet `i`. Bit `4 + i`: the vertex beyond
    /// facet `i` lies on the sphere.
    signs: Vec<u8>,
    /// Flow of the four facets of a finite tetrahedron, two bits each; set for facets whose other side has a larger id.
    flows: Vec<u8>,
}

const FLOWS: [FlowType; 4] = [
    FlowType::Source,
    FlowType::Relay,
    FlowType::PassingAcute,
    FlowType::PassingObtuse,
];

impl FullScaffold {
    /// The scaffold of points that do not span space.
    pub(super) fn flat(counts: CriticalCounts, planar: PlanarScaffold) -> Self {
        Self {
            spheres: Vec::new(),
            counts,
            degenerate: Vec::new(),
            planar: Some(planar),
            signs: Vec::new(),
            flows: Vec::new(),
        }
    }

    /// Position of the scaffold vertex dual to a finite tetrahedron, mm.
    #[inline]
    pub fn circumcentre(&self, tet: TetId) -> DVec3 {
        self.spheres[tet.index()].centre
    }

    /// Radius at the vertex dual to a tetrahedron, mm; infinite for a ghost.
    #[inline]
    pub fn radius_mm(&self, tet: TetId) -> f64 {
        self.spheres.get(tet.index()).map_or(f64::INFINITY, |s| s.radius)
    }

    /// Whether the vertex is a sink (A1^4-4): the tetrahedron holds its circumcentre. Ghosts are not.
    #[inline]
    pub fn is_sink(&self, tet: TetId) -> bool {
        self.signs.get(tet.index()).is_some_and(|s| s & 15 == 15)
    }

    /// Whether vertex `facet.index` lies outside the smallest ball of the facet opposite to it, ties broken by coordinates;
    /// true for a ghost's hull triangle, whose opposite vertex is at infinity.
    #[inline]
    pub fn opposite_is_outside(&self, facet: Facet) -> bool {
        self.signs
            .get(facet.tet.index())
            .is_none_or(|s| s >> facet.index & 1 == 1)
    }

    /// Whether the two vertices at the ends of the curve element coincide: the five generators lie on one sphere, exactly.
    #[inline]
    pub fn is_zero_length(&self, facet: Facet) -> bool {
        self.signs
            .get(facet.tet.index())
            .is_some_and(|s| s >> (4 + facet.index) & 1 == 1)
    }

    /// Flow type of the curve element dual to a triangle, from either side; `None` when the facet has the infinite vertex.
    #[inline]
    pub fn flow(&self, t: &Triangulation, facet: Facet) -> Option<FlowType> {
        let owner = facet.min(t.mirror(facet));
        let flows = self.flows.get(owner.tet.index())?;
        Some(FLOWS[(flows >> (2 * owner.index) & 3) as usize])
    }

    /// Flow along the curve element dual to a triangle; `None` when the facet has the infinite vertex. Exact: no radius is
    /// compared. The tetrahedron whose opposite vertex lies in the triangle's smallest ball has the nearer centre.
    pub fn arc(&self, t: &Triangulation, facet: Facet) -> Option<Arc> {
        let other = t.mirror(facet);
        if !t.is_finite(facet.tet.min(other.tet)) {
            return None;
        }
        let along = |from: Facet, to: Facet| Arc::Along {
            from: from.tet,
            to: to.tet,
        };
        Some(
            match (self.opposite_is_outside(facet), self.opposite_is_outside(other)) {
                (true, true) => Arc::Outward,
                (false, _) => along(facet, other),
                (true, false) => along(other, facet),
            },
        )
    }

    /// Curve elements that go to infinity, in order of their ghosts.
    pub fn unbounded<'a>(&'a self, t: &'a Triangulation) -> impl Iterator<Item = UnboundedCurve> + 'a {
        t.tets().skip(t.num_finite()).map(move |tet| {
            let facet = t.mirror(Facet { tet, index: 3 });
            let [a, b, c] = t.facet_vertices(facet).map(|v| t.points[v.index()]);
            // Scaled so that the cross product neither over- nor underflows.
            let size = (b - a).abs().max((c - a).abs()).max_element();
            let direction = ((b - a) / size).cross((c - a) / size).normalize_or_zero();
            UnboundedCurve { facet, direction }
        })
    }

    /// Finite tetrahedra in an order in which every arc between two of them goes forward: increasing radius with ties
    /// broken as everywhere. Smallest id first among those that are free, so the order is canonical.
    ///
    /// # Panics
    /// Never for a scaffold of its own triangulation: the arcs of a generic weighted point set are acyclic.
    pub fn acyclic_order(&self, t: &Triangulation) -> Vec<TetId> {
        let enters = |tet: TetId| {
            (0..4u8)
                .map(|index| t.mirror(Facet { tet, index }))
                .filter(|f| t.is_finite(f.tet) && !self.opposite_is_outside(*f))
                .count() as u8
        };
        let mut waiting: Vec<u8> = t.finite_tets().map(enters).collect();
        let mut ready: std::collections::BinaryHeap<std::cmp::Reverse<TetId>> = t
            .finite_tets()
            .filter(|tet| waiting[tet.index()] == 0)
            .map(std::cmp::Reverse)
            .collect();
        let mut order = Vec::with_capacity(t.num_finite());
        while let Some(std::cmp::Reverse(tet)) = ready.pop() {
            order.push(tet);
            for index in 0..4u8 {
                let facet = Facet { tet, index };
                let to = t.neighbour(tet, index as usize);
                if !self.opposite_is_outside(facet) && t.is_finite(to) {
                    waiting[to.index()] -= 1;
                    if waiting[to.index()] == 0 {
                        ready.push(std::cmp::Reverse(to));
                    }
                }
            }
        }
        assert_eq!(order.len(), t.num_finite(), "arcs of a scaffold are acyclic");
        order
    }
}

/// Computes the full scaffold of a triangulation; see the module.
///
/// # Errors
/// [`DelaunayError::Range`] when the points of a triangulation that was not made by [`crate::delaunay::delaunay`] differ too
/// much in magnitude for exact tests.
///
/// # Complexity
/// `O(tetrahedra)`; parallel, with a result that does not depend on the number of threads.
///
/// # Example
/// ```
/// # use glam::DVec3;
/// # use medial_scaffold::{delaunay::{delaunay, DelaunaySettings}, full_scaffold::full_scaffold};
/// let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::splat(0.4)];
/// let t = delaunay(&points, &DelaunaySettings::default())?;
/// let scaffold = full_scaffold(&t)?;
/// assert_eq!(scaffold.counts.morse, 1);
/// # Ok::<(), medial_scaffold::delaunay::DelaunayError>(())
/// ```
pub fn full_scaffold(t: &Triangulation) -> Result<FullScaffold, DelaunayError> {
    // Inside the pool from here on: its parallel steps are many, and each would hand over to it and wait.
    rayon::scope(|_| read_off(t))
}

fn read_off(t: &Triangulation) -> Result<FullScaffold, DelaunayError> {
    let frame = Frame::of(&t.points)?;
    let points: Cow<[DVec3]> = if frame.exponent == 0 {
        Cow::Borrowed(&t.points)
    } else {
        t.points.iter().map(|&p| frame.apply(p)).collect()
    };
    if t.dimension < 3 {
        return planar::flat_scaffold(t, &points);
    }
    let grid = Grid::new(points.iter().fold(0.0, |m, p| p.abs().max_element().max(m)));
    let Geometry {
        spheres,
        signs,
        obtuse,
    } = geometry(t, &points, frame);
    let mut classified = classify(t, &points, grid, &signs, obtuse);
    drop(signs);
    tell_both_sides(t, &mut classified);
    let mut counts = classified.counts;
    counts.generators = t.points.len() as u64;
    // Edges come from Euler's formula; those without a sheet source are the ones that face an angle that is not acute.
    let triangles = (t.num_finite() as u64 * 4 + (t.num_tets() - t.num_finite()) as u64) / 2;
    let edges = counts.generators + triangles - t.num_finite() as u64 - 1;
    counts.sheet_sources = edges - edges_facing_obtuse_angles(t, classified.obtuse, classified.facing);
    counts.morse = counts.generators as i64 - counts.sheet_sources as i64 + counts.curve_sources as i64
        - counts.sinks as i64;
    let mut out = FullScaffold {
        spheres,
        counts,
        degenerate: Vec::new(),
        planar: None,
        signs: classified.signs,
        flows: classified.flows,
    };
    out.degenerate = degenerate_vertices(t, &out);
    Ok(out)
}

/// What step 1 gives.
struct Geometry {
    /// Circumscribed spheres, mm.
    spheres: Vec<Sphere>,
    signs: Vec<Signs>,
    /// [`Geometries::obtuse`].
    obtuse: Vec<u16>,
}

/// Step 1; `points` are those of the triangulation in the frame of the predicates.
fn geometry(t: &Triangulation, points: &[DVec3], frame: Frame) -> Geometry {
    // Zeros, which the system hands out without writing them, instead of spheres.
    let mut spheres: Vec<Sphere> = vec![[0.0; 4]; t.num_finite()]
        .into_iter()
        .map(|[x, y, z, radius]| Sphere {
            centre: DVec3::new(x, y, z),
            radius,
        })
        .collect();
    let mut signs = vec![Signs::default(); t.num_finite()];
    let mut obtuse = vec![0; t.num_finite()];
    let chunks = (
        spheres.par_chunks_mut(CHUNK),
        signs.par_chunks_mut(CHUNK),
        obtuse.par_chunks_mut(CHUNK),
    )
        .into_par_iter();
    chunks.enumerate().for_each(|(i, (spheres, signs, obtuse))| {
        with_lanes(Geometries {
            t,
            points,
            first: (i * CHUNK) as u32,
            spheres: &mut *spheres,
            signs,
            obtuse,
        });
        for sphere in spheres.iter_mut().filter(|_| frame.exponent != 0) {
            sphere.centre = sphere.centre.to_array().map(|v| frame.restore(v)).into();
            sphere.radius = frame.restore(sphere.radius);
        }
    });
    Geometry {
        spheres,
        signs,
        obtuse,
    }
}

/// The edge that faces the vertex in place `at` in a facet, smaller vertex first.
#[inline(always)]
fn facing_edge(t: &Triangulation, tet: TetId, index: u8, at: u16) -> [u32; 2] {
    let v = t.tet(tet);
    let [p, q] = OPPOSITE[index as usize][(at & 3) as usize];
    let (a, b) = (v[(p & 3) as usize].0, v[(q & 3) as usize].0);
    [a.min(b), a.max(b)]
}

/// Step 3: the number of edges that face an angle that is not acute in some triangle. Such an edge has no sheet source, and
/// Delaunay edges need no other witness than their link. Edges are collected by their smaller vertex and told apart.
fn edges_facing_obtuse_angles(t: &Triangulation, obtuse: Vec<u16>, mut facing: Counters) -> u64 {
    let n = t.points.len();
    let sum = facing.accumulate();
    let ends: Vec<AtomicU32> = vec![0u32; sum as usize].into_iter().map(AtomicU32::new).collect();
    obtuse.par_chunks(CHUNK).enumerate().for_each(|(chunk, obtuse)| {
        for (&codes, tet) in obtuse.iter().zip((chunk * CHUNK) as u32..) {
            let mut rest = codes;
            while rest != 0 {
                let index = rest.trailing_zeros() as usize / 4;
                let code = rest >> (4 * index) & 15;
                rest &= !(15 << (4 * index));
                let [a, b] = facing_edge(t, TetId(tet), index as u8, code - 1);
                ends[facing.add(a as usize, 1) as usize].store(b, Relaxed);
            }
        }
    });
    drop(obtuse);
    // Each beginning has moved to the next one's old place.
    let starts = facing.into_inner();
    let ends: Vec<u32> = ends.into_iter().map(AtomicU32::into_inner).collect();
    (0..n)
        .into_par_iter()
        .with_min_len(CHUNK)
        .map_init(Vec::new, |copy, i| {
            let from = if i == 0 { 0 } else { starts[i - 1] };
            distinct(&ends[from as usize..starts[i] as usize], copy)
        })
        .sum()
}

/// Number of different values; `copy` is a buffer.
#[inline(always)]
fn distinct(values: &[u32], copy: &mut Vec<u32>) -> u64 {
    if values.len() <= 24 {
        let repeats = |i: usize| {
            values[..i]
                .iter()
                .fold(false, |found, v| found | (*v == values[i]))
        };
        return (0..values.len()).map(|i| u64::from(!repeats(i))).sum();
    }
    copy.clear();
    copy.extend_from_slice(values);
    copy.sort_unstable();
    copy.chunk_by(|a, b| a == b).count() as u64
}

/// Places of the edge that faces a vertex in a facet, for each facet and place; nothing where the two are the same.
const OPPOSITE: [[[u8; 2]; 4]; 4] = {
    let mut table = [[[0; 2]; 4]; 4];
    let mut facet = 0;
    while facet < 4 {
        let mut at = 0;
        while at < 4 {
            let mut k = 0;
            let mut place = 0;
            while place < 4 && facet != at {
                if place != facet && place != at {
                    table[facet][at][k] = place as u8;
                    k += 1;
                }
                place += 1;
            }
            at += 1;
        }
        facet += 1;
    }
    table
};
