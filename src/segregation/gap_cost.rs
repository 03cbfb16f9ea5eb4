//! What a gap transform costs: the price of taking a facet as a surface triangle.
//!
//! In: triangulation, circumspheres, local spacing. Out: a [`Candidate`] for every facet that could be surface, and how much
//! an accepted neighbour changes its price.
//!
//! 1. *Cost* of a facet with vertices at distances within a few spacings: `perimeter / (R c^2)`, `c` its compactness (1 when
//!    equilateral), `R` the shorter of the two parts of its dual curve measured from the facet; small for a triangle whose
//!    curve runs far to both sides, as that of a surface triangle does (Chang, Leymarie & Kimia 2009).
//! 2. *Continuity*: an accepted triangle makes flat continuations across its edges cheaper and folds dearer by
//!    `((exp theta - 1)^2 - 1) |e| / (R c^2)`.
//!
//! Departure: the local spacing replaces the median over all Voronoi facets, so that uneven clouds stay whole
//! ([`CostRule::Authors`] keeps the published rule).

use super::balls::Balls;
use super::facets::FacetDepths;
use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::VertexId;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Which lengths the cost is measured against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CostRule {
    /// Half the local spacing, and edges of at most five local spacings.
    #[default]
    Local,
    /// The authors': the median of half the length of all Delaunay edges, and edges of at most six times that.
    Authors,
}

/// Longest edge over the local spacing.
const LOCAL_REACH: f64 = 5.0;
/// Longest edge over the median half edge, authors' rule.
const AUTHORS_REACH: f64 = 6.0;
/// Factor on the cost of a triangle that waits.
const DELAY: f64 = 1.2;

/// Where a candidate is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Has an entry in the queue (or had one and may get another).
    Waiting,
    Accepted,
    Refused,
}

/// A facet that could be surface.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub facet: Facet,
    pub vertices: [VertexId; 3],
    /// Cost without continuity.
    pub base: f64,
    /// `R c^2` of the current pass.
    pub divisor: f64,
    /// Continuity by edge (edge `k` is opposite vertex `k`).
    pub continuity: [f64; 3],
    pub state: State,
    pub preset: bool,
    pub undone: u8,
    pub delays: u8,
}

impl Candidate {
    pub fn cost(&self) -> f64 {
        let sum = self.base + (self.continuity[0] + self.continuity[1] + self.continuity[2]);
        sum.max(0.0) * DELAY.powi(i32::from(self.delays)) + 0.0
    }

    pub fn edge(&self, k: usize) -> [VertexId; 2] {
        [self.vertices[(k + 1) % 3], self.vertices[(k + 2) % 3]]
    }
}

/// Lengths and angles behind the costs of one triangulation.
pub(super) struct CostModel<'a> {
    triangulation: &'a Triangulation,
    balls: &'a Balls,
    depths: &'a FacetDepths,
    spacing_mm: &'a [f64],
    rule: CostRule,
    /// Median half Delaunay edge, authors' rule only, mm.
    median_half_edge: f64,
}

impl<'a> CostModel<'a> {
    pub fn new(
        triangulation: &'a Triangulation,
        balls: &'a Balls,
        depths: &'a FacetDepths,
        spacing_mm: &'a [f64],
        rule: CostRule,
    ) -> Self {
        Self {
            triangulation,
            balls,
            depths,
            spacing_mm,
            rule,
            median_half_edge: match rule {
                CostRule::Local => 0.0,
                CostRule::Authors => median_half_edge(triangulation),
            },
        }
    }

    fn position(&self, v: VertexId) -> DVec3 {
        self.triangulation.points[v.index()]
    }

    /// Half the spacing at a triangle (or its authors' stand-in), mm.
    fn half_spacing(&self, vertices: [VertexId; 3]) -> f64 {
        match self.rule {
            CostRule::Local => vertices.iter().map(|v| self.spacing_mm[v.index()]).sum::<f64>() / 6.0,
            CostRule::Authors => self.median_half_edge,
        }
    }

    /// The candidate of a facet, without continuity; `None` when it is infinite, oversized or has no area.
    pub fn candidate(&self, facet: Facet, second: bool) -> Option<Candidate> {
        let vertices = self.triangulation.facet_vertices(facet);
        if vertices.contains(&INFINITE) {
            return None;
        }
        let [a, b, c] = vertices.map(|v| self.position(v));
        let sides = [(c - b).length(), (a - c).length(), (b - a).length()];
        let longest = sides[0].max(sides[1]).max(sides[2]);
        let half = self.half_spacing(vertices);
        let reach = match self.rule {
            CostRule::Local => 2.0 * LOCAL_REACH * half,
            CostRule::Authors => AUTHORS_REACH * half,
        };
        if longest > reach {
            return None;
        }
        let area = 0.5 * (b - a).cross(c - a).length();
        let squares: f64 = sides.iter().map(|s| s * s).sum();
        let compactness = 4.0 * 3f64.sqrt() * area / squares;
        if compactness <= 1e-6 {
            return None;
        }
        let reach_mm = if second { half } else { self.shorter_curve(facet) };
        let divisor = (reach_mm * compactness * compactness).max(f64::MIN_POSITIVE);
        Some(Candidate {
            base: sides.iter().sum::<f64>() / divisor,
            divisor,
            preset: false,
            ..self.preset(facet)
        })
    }

    /// The candidate of a facet that is known to be surface: no cost, never undone.
    pub fn preset(&self, facet: Facet) -> Candidate {
        Candidate {
            facet,
            vertices: self.triangulation.facet_vertices(facet),
            base: 0.0,
            divisor: 1.0,
            continuity: [0.0; 3],
            state: State::Waiting,
            preset: true,
            undone: 0,
            delays: 0,
        }
    }

    /// The shorter part of the dual curve, measured from the facet, mm.
    fn shorter_curve(&self, facet: Facet) -> f64 {
        let part = |f: Facet| {
            if self.triangulation.is_finite(f.tet) && !self.balls.flat[f.tet.index()] {
                f64::from(self.depths.depth(f)).abs() * self.balls.radii[f.tet.index()]
            } else {
                f64::INFINITY
            }
        };
        part(facet).min(part(self.triangulation.mirror(facet)))
    }

    /// What an accepted triangle across edge `k` adds to the cost of a candidate: less than nothing when they are flat.
    pub fn fold(&self, candidate: &Candidate, k: usize, accepted: &Candidate) -> f64 {
        let [a, b] = candidate.edge(k);
        let (pa, pb) = (self.position(a), self.position(b));
        let edge = pb - pa;
        let length = edge.length();
        let across = |third: VertexId| {
            let d = self.position(third) - pa;
            (d - edge * (d.dot(edge) / (length * length))).normalize_or_zero()
        };
        let third = accepted.vertices.into_iter().find(|v| *v != a && *v != b);
        let other = across(third.expect("a triangle has a third vertex"));
        let theta = (-across(candidate.vertices[k]).dot(other))
            .clamp(-1.0, 1.0)
            .acos();
        ((theta.exp() - 1.0).powi(2) - 1.0) * length / candidate.divisor
    }
}

fn median_half_edge(triangulation: &Triangulation) -> f64 {
    let mut edges: Vec<(u32, u32)> = triangulation
        .finite_tets()
        .flat_map(|t| {
            let v = triangulation.tet(t).map(|v| v.0);
            [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| (v[i].min(v[j]), v[i].max(v[j])))
        })
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    let lengths = edges
        .iter()
        .map(|&(i, j)| 0.5 * triangulation.points[i as usize].distance(triangulation.points[j as usize]))
        .collect();
    super::prepare::noise::median(lengths)
}
