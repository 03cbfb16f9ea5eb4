//! Segregation by a known surface with the sampling refined until the topology is right.
//!
//! In: generators and the closed surface they lie on. Out: the refined generators' triangulation, its segregation, and how
//! many points were added. Each round triangulates, segregates, and adds the places that
//! [`segregate_known`] lists: crossings of the surface with curves of the full scaffold that cross
//! it more than once, farthest from the generators by construction (Boissonnat & Oudot 2005). It ends when the topology
//! agrees, nothing is left to add, or a limit is reached; then the last labels of the best round are changed so that the topology agrees
//! ([`super::known_repair`]), and its warnings say where, or that it was not resolved.

use super::error::SegregationError;
use super::known_queries::KnownSurface;
use super::known_repair::{RepairedPlace, repair_topology};
use super::known_surface::{
    KnownSurfaceSegregation, KnownSurfaceSettings, component_eulers, eulers_in_words, segregate_known,
};
use super::labels::{boundary_triangles, mesh_of};
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
        best.repair(surface, &known);
    }
    Ok(best)
}

/// What a user should know of a repair; nothing when nothing moved.
fn moved_in_words(places: &[RepairedPlace], spacing_mm: f64) -> Option<String> {
    let worst = places.first()?;
    let [x, y, z] = worst.place.to_array();
    Some(format!(
        "the shape is thinner than its sampling in {} {}; the surface was moved there, by at most {:.4} mm ({:.1} spacings), at \
         ({x:.4}, {y:.4}, {z:.4}), so that its topology is right",
        places.len(),
        if places.len() == 1 { "place" } else { "places" },
        worst.moved_mm,
        worst.moved_mm / spacing_mm
    ))
}

/// Generators that may always be added, so that very small samples can be refined at all.
const SMALL_SAMPLE: usize = 1000;

impl RefinedSegregation {
    /// Changes the labels that stand between the result and the surface's topology, or at least a manifold; says which.
    fn repair(&mut self, surface: &TriangleMesh, known: &KnownSurface) {
        let segregation = &mut self.result.segregation;
        let repair = repair_topology(&self.triangulation, surface, known, &segregation.inside);
        segregation.inside = repair.inside;
        segregation.triangles = boundary_triangles(&self.triangulation, &segregation.inside);
        let mesh = mesh_of(&self.triangulation, &segregation.triangles);
        let report = &mut self.result.report;
        report.found = mesh.topology();
        report.found_euler = component_eulers(&mesh);
        report.agree = repair.agrees;
        report.repaired = repair.places;
        segregation.warnings.clear();
        if repair.agrees {
            report.needs_refinement.clear();
            segregation
                .warnings
                .extend(moved_in_words(&report.repaired, repair.spacing_mm));
        } else {
            segregation.warnings.push(format!(
                "the surface found has {}, the one given {}: its parts cross each other or it is thinner than the sampling in many places; refinement (best after {} \
                 rounds and {} added points) did not resolve that, a finer --spacing may",
                eulers_in_words(&report.found_euler),
                eulers_in_words(&report.expected_euler),
                self.rounds,
                self.added
            ));
        }
    }

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
