//! Segregation by a known surface with the sampling refined until the topology is right.
//!
//! In: generators and the closed surface they lie on. Out: the refined generators' triangulation, its segregation, and how
//! many points were added. Each round triangulates, segregates, and adds the places that
//! [`segregate_known`] lists: crossings of the surface with curves of the full scaffold that cross
//! it more than once, farthest from the generators by construction (Boissonnat & Oudot 2005). It ends when the topology
//! agrees, nothing is left to add, or a limit is reached; then the best round is returned and its warnings say what was not
//! resolved.

use super::error::SegregationError;
use super::known_queries::KnownSurface;
use super::known_surface::{KnownSurfaceSegregation, KnownSurfaceSettings, segregate_known};
use crate::delaunay::{DelaunaySettings, Triangulation, delaunay};
use crate::geometry::TriangleMesh;
use glam::DVec3;

/// A segregation and the sampling it needed.
#[derive(Clone, Debug, Default)]
pub struct RefinedSegregation {
    /// The triangulation of all generators, the added ones included.
    pub triangulation: Triangulation,
    /// Labels, triangles and numbers of the last round.
    pub result: KnownSurfaceSegregation,
    /// Rounds of refinement made.
    pub rounds: usize,
    /// Generators added.
    pub added: usize,
}

/// Triangulates, segregates and refines; see the module.
///
/// # Errors
/// As [`segregate_known`]; [`SegregationError::Triangulation`] when the points are refused.
pub fn segregate_known_refined(
    points: &[DVec3],
    surface: &TriangleMesh,
    settings: &KnownSurfaceSettings,
) -> Result<RefinedSegregation, SegregationError> {
    let known = KnownSurface::new(surface).ok_or(SegregationError::OpenSurface {
        boundary_edges: 0,
        triangles: 0,
    })?;
    let mut triangulation = delaunay(points, &DelaunaySettings::default())?;
    let given = triangulation.points.len();
    let limit = (given as f64 * settings.max_growth) as usize + SMALL_SAMPLE;
    let mut best: Option<RefinedSegregation> = None;
    for round in 0..=settings.max_rounds {
        let result = segregate_known(&triangulation, surface, &known, settings)?;
        let places = result.report.needs_refinement.clone();
        let mut all = triangulation.points.clone();
        all.extend(places.iter().map(|p| p.point));
        let now = RefinedSegregation {
            added: triangulation.points.len() - given,
            triangulation,
            result,
            rounds: round,
        };
        let agree = now.result.report.agree;
        if best.as_ref().is_none_or(|b| now.fault() < b.fault()) {
            best = Some(now);
        }
        let idle = round - best.as_ref().map_or(0, |b| b.rounds);
        if agree || places.is_empty() || idle == settings.max_idle_rounds || all.len() > limit {
            break;
        }
        triangulation = delaunay(&all, &DelaunaySettings::default())?;
    }
    let mut best = best.expect("the first round always gives a segregation");
    if !best.result.report.agree {
        best.result.segregation.warnings.push(format!(
            "refinement (best after {} rounds and {} added generators) did not resolve the surface's topology: some part of it is \
             thinner than any sampling tried",
            best.rounds, best.added
        ));
    }
    Ok(best)
}

/// Generators that may always be added, so that very small samples can be refined at all.
const SMALL_SAMPLE: usize = 1000;

impl RefinedSegregation {
    /// How wrong the topology is: pinches first, then components and Euler numbers.
    fn fault(&self) -> [u64; 2] {
        let r = &self.result.report;
        let sum = |eulers: &[i64]| eulers.iter().sum::<i64>();
        [
            (r.found.nonmanifold_edges + r.found.nonmanifold_vertices + r.found.boundary_edges) as u64,
            r.expected_euler.len().abs_diff(r.found_euler.len()) as u64
                + sum(&r.expected_euler).abs_diff(sum(&r.found_euler)),
        ]
    }
}
