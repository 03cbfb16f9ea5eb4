//! The full scaffold as read off a Delaunay triangulation.
//!
//! In: [`Triangulation`]. Out: [`FullScaffold`]. Steps: (1) sphere and signs of every tetrahedron; (2) flow type of every
//! triangle from the two signs across it and its angles; (3) critical points counted, sheet sources through the edges that
//! face an obtuse angle; (4) vertices whose spheres coincide gathered.
//!
//! After Leymarie & Kimia 2007 (types of shocks) and Siersma 1999, Giesen & John 2008 (critical points of the distance to
//! points are the Delaunay simplices that hold their centre and whose smallest ball is empty). We read the scaffold off the
//! Delaunay triangulation instead of pairing shocks: the result is the same and robustness has one place. Ties are those of
//! a generic weighted point set infinitely near (see [`crate::geometry::predicates`]), hence arcs are acyclic and the
//! alternating sum of critical points is 1 for every input. Cost: `O(tetrahedra)`.

use super::flow::{CriticalCounts, FlowType};
use super::merged::{DegenerateVertex, degenerate_vertices};
use super::planar::{self, PlanarScaffold};
use super::spheres::{TetGeometry, tet_geometry};
use crate::delaunay::door::Frame;
use crate::delaunay::{DelaunayError, Facet, Triangulation};
use crate::geometry::fixed::Grid;
use crate::geometry::predicates::edge_gabriel_perturbed;
use crate::geometry::{Sphere, TetId};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;

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
    let (spheres, signs): (Vec<Sphere>, Vec<u8>) = (0..t.num_finite() as u32)
        .into_par_iter()
        .map(|i| {
            let g: TetGeometry = tet_geometry(t, &points, grid, TetId(i));
            let sphere = Sphere {
                centre: g.sphere.centre.to_array().map(|v| frame.restore(v)).into(),
                radius: frame.restore(g.sphere.radius),
            };
            (sphere, g.outside | g.cospherical << 4)
        })
        .unzip();
    let mut out = FullScaffold {
        spheres,
        counts: CriticalCounts::default(),
        degenerate: Vec::new(),
        planar: None,
        signs,
        flows: Vec::new(),
    };
    let classified: Vec<FacetClasses> = (0..t.num_finite() as u32)
        .into_par_iter()
        .map(|i| classify(t, &points, &out, TetId(i)))
        .collect();
    out.counts = count(t, &out, &classified);
    out.flows = classified.into_iter().map(|c| c.flows).collect();
    out.degenerate = degenerate_vertices(t, &out);
    Ok(out)
}

/// What step 2 finds for the facets a tetrahedron owns: those whose other side has a larger id.
#[derive(Clone, Copy, Debug)]
struct FacetClasses {
    /// Flow, two bits a facet.
    flows: u8,
    /// For each facet, the place of the vertex with an angle that is not acute, or 4.
    obtuse: [u8; 4],
}

fn classify(t: &Triangulation, points: &[DVec3], scaffold: &FullScaffold, tet: TetId) -> FacetClasses {
    let mut out = FacetClasses {
        flows: 0,
        obtuse: [4; 4],
    };
    let v = t.tet(tet);
    for index in 0..4u8 {
        let facet = Facet { tet, index };
        let other = t.mirror(facet);
        if other < facet {
            continue;
        }
        let corner = |k: u8| points[v[k as usize].index()];
        let [x, y, z] = [(index + 1) & 3, (index + 2) & 3, (index + 3) & 3];
        let obtuse_at = |k: u8, l: u8, m: u8| edge_gabriel_perturbed(corner(l), corner(m), corner(k)) < 0.0;
        out.obtuse[index as usize] = if obtuse_at(x, y, z) {
            x
        } else if obtuse_at(y, z, x) {
            y
        } else if obtuse_at(z, x, y) {
            z
        } else {
            4
        };
        let gabriel = scaffold.opposite_is_outside(facet) && scaffold.opposite_is_outside(other);
        let acute = out.obtuse[index as usize] == 4;
        let code = 2 * u8::from(!gabriel) + u8::from(!acute);
        out.flows |= code << (2 * index);
    }
    out
}

/// Step 3. Edges come from Euler's formula; those without a sheet source are the ones that face an angle that is not acute
/// in some triangle (Delaunay edges need no other witness than their link), collected by smaller vertex and told apart.
fn count(t: &Triangulation, scaffold: &FullScaffold, classified: &[FacetClasses]) -> CriticalCounts {
    let n = t.points.len();
    let mut counts = CriticalCounts {
        generators: n as u64,
        ..CriticalCounts::default()
    };
    let mut triangles = 0u64;
    let mut starts = vec![0u32; n + 1];
    let facing = |tet: TetId, index: usize, at: u8| {
        let v = t.tet(tet);
        let mut edge = (0..4).filter(|&k| k != index && k != at as usize).map(|k| v[k].0);
        let (a, b) = (edge.next().unwrap_or(0), edge.next().unwrap_or(0));
        (a.min(b), a.max(b))
    };
    for tet in t.finite_tets() {
        let class = &classified[tet.index()];
        counts.sinks += u64::from(scaffold.is_sink(tet));
        for index in 0..4 {
            let facet = Facet {
                tet,
                index: index as u8,
            };
            if t.mirror(facet) < facet {
                continue;
            }
            triangles += 1;
            match class.flows >> (2 * index) & 3 {
                0 => counts.curve_sources += 1,
                1 => counts.relays += 1,
                _ => {}
            }
            if class.obtuse[index] < 4 {
                starts[facing(tet, index, class.obtuse[index]).0 as usize + 1] += 1;
            }
        }
    }
    for i in 0..n {
        starts[i + 1] += starts[i];
    }
    let mut ends = vec![0u32; starts[n] as usize];
    let mut fill = starts.clone();
    for tet in t.finite_tets() {
        let class = &classified[tet.index()];
        for index in 0..4 {
            if class.obtuse[index] < 4 {
                let (a, b) = facing(tet, index, class.obtuse[index]);
                ends[fill[a as usize] as usize] = b;
                fill[a as usize] += 1;
            }
        }
    }
    let mut crossed = 0u64;
    for i in 0..n {
        let run = &mut ends[starts[i] as usize..starts[i + 1] as usize];
        run.sort_unstable();
        crossed += run.chunk_by(|a, b| a == b).count() as u64;
    }
    let edges = n as u64 + triangles - t.num_finite() as u64 - 1;
    counts.sheet_sources = edges - crossed;
    counts.morse = counts.generators as i64 - counts.sheet_sources as i64 + counts.curve_sources as i64
        - counts.sinks as i64;
    counts
}
