//! Closing: inside and outside of every tetrahedron from a cloud alone.
//!
//! In: prepared points with local spacing. Out: [`Closure`]: the triangulation, the greedy facets, and labels whose boundary
//! is a closed manifold.
//!
//! 1. Delaunay, circumspheres, facet weights.
//! 2. Greedy gap transforms ([`super::gap_transforms`]): where the surface shows itself.
//! 3. Signed diffusion ([`super::diffusion`]): what that says of every tetrahedron.
//! 4. Minimum cut ([`super::min_cut`]): pull `clamp(x) min(3, r / s)`, a facet costs `0.02 + w`, a tenth of that when greedy.
//! 5. Islands flipped, stars repaired ([`super::islands`], [`super::star_repair`]), twice; near points taken in.
//! 6. Points still off the surface are dropped and all is done once more, so that no generator sits inside the solid.
//!
//! Labatut, Pons & Keriven 2009 use the same cut with lines of sight; a cloud has none, the diffusion takes their place.

use super::adopt::{adopt_points, points_off};
use super::balls::Balls;
use super::diffusion::{diffuse, slot};
use super::error::SegregationError;
use super::facets::FacetDepths;
use super::gap_transforms::{CostRule, GapTransforms, gap_transforms};
use super::islands::{Island, flip_islands};
use super::min_cut::min_cut;
use super::star_repair::{StarRepair, repair_stars};
use crate::delaunay::{DelaunaySettings, Facet, Triangulation, delaunay};
use crate::geometry::{TetId, VertexId};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Energy of a facet of weight 0, so that the surface is short where nothing else speaks.
const LEAST_FACET_COST: f32 = 0.02;
/// Factor on the cost of facets that the greedy surface holds.
const ACCEPTED_FACTOR: f32 = 0.1;
/// Largest weight of a tetrahedron's pull: a ball of three spacings or more is not noise.
const MOST_PULL: f64 = 3.0;

/// Labels of a closed surface and what led to them.
#[derive(Clone, Debug, Default)]
pub struct Closure {
    /// The triangulation of the points in use.
    pub triangulation: Triangulation,
    /// The points given that are in use, in order.
    pub used: Vec<u32>,
    /// Local spacing of the points in use, mm.
    pub spacing_mm: Vec<f64>,
    /// Greedy surface facets.
    pub greedy: GapTransforms,
    /// Label of every tetrahedron.
    pub inside: Vec<bool>,
    /// Parts that were flipped.
    pub islands: Vec<Island>,
    /// What the star repair did.
    pub repair: StarRepair,
    /// Points taken onto the surface at the end.
    pub adopted: usize,
    /// Points off the surface in the first run, dropped for the second.
    pub dropped: usize,
    /// Points off the surface at the end.
    pub off: usize,
    /// Iterations of the diffusion.
    pub iterations: usize,
}

/// How the labelling is made.
#[derive(Clone, Copy, Debug)]
pub struct ClosureSettings<'a> {
    /// Cost of the greedy loop.
    pub cost: CostRule,
    /// Least share of the points a component must touch.
    pub least_component_share: f64,
    /// Triangles that are known to be surface, by point.
    pub preset: &'a [[u32; 3]],
}

/// Steps 1 to 5 for distinct points in lexicographic order; see the module.
///
/// # Errors
/// [`SegregationError::FewPoints`] when they do not span space, [`SegregationError::Triangulation`] when they are refused.
pub fn close(
    points: &[DVec3],
    spacing_mm: &[f64],
    settings: &ClosureSettings,
) -> Result<Closure, SegregationError> {
    close_once(points, spacing_mm, settings)
}

/// Step 6: closes once more without the points that `first` left off its surface. For closed shapes only: the closed surface
/// of an open one passes many of its points by.
///
/// # Errors
/// As [`close`].
pub fn close_without_off(
    first: Closure,
    points: &[DVec3],
    spacing_mm: &[f64],
    settings: &ClosureSettings,
) -> Result<Closure, SegregationError> {
    if first.off == 0 {
        return Ok(first);
    }
    let off = points_off(&first.triangulation, &first.inside);
    let used: Vec<u32> = (0..points.len() as u32).filter(|&i| !off[i as usize]).collect();
    let mut place = vec![u32::MAX; points.len()];
    for (new, &old) in used.iter().enumerate() {
        place[old as usize] = new as u32;
    }
    let preset: Vec<[u32; 3]> = settings
        .preset
        .iter()
        .map(|t| t.map(|i| place[i as usize]))
        .filter(|t| !t.contains(&u32::MAX))
        .collect();
    let kept: Vec<DVec3> = used.iter().map(|&i| points[i as usize]).collect();
    let kept_spacing: Vec<f64> = used.iter().map(|&i| spacing_mm[i as usize]).collect();
    let again = ClosureSettings {
        preset: &preset,
        ..*settings
    };
    let second = close_once(&kept, &kept_spacing, &again)?;
    Ok(Closure {
        used,
        dropped: first.off,
        ..second
    })
}

fn close_once(
    points: &[DVec3],
    spacing_mm: &[f64],
    settings: &ClosureSettings,
) -> Result<Closure, SegregationError> {
    let triangulation = delaunay(points, &DelaunaySettings::default())?;
    if triangulation.dimension < 3 {
        return Err(SegregationError::FewPoints {
            points: points.len(),
            dimension: triangulation.dimension,
        });
    }
    debug_assert_eq!(triangulation.points.len(), points.len());
    let balls = Balls::new(&triangulation);
    let depths = FacetDepths::new(&triangulation, &balls);
    let preset = preset_facets(&triangulation, settings.preset);
    let greedy = gap_transforms(
        &triangulation,
        &balls,
        &depths,
        spacing_mm,
        settings.cost,
        &preset,
    );
    let diffusion = diffuse(&triangulation, &depths, &greedy.accepted);
    let pull = pulls(&triangulation, &balls, spacing_mm, &diffusion.value);
    let mut inside = min_cut(&triangulation, &pull, |facet| {
        let w = depths.weight(&triangulation, facet);
        let factor = if greedy.accepted[slot(facet)] {
            ACCEPTED_FACTOR
        } else {
            1.0
        };
        factor * (LEAST_FACET_COST + w)
    });
    let mut islands = Vec::new();
    let mut repair = StarRepair::default();
    for round in 0..2 {
        islands.extend(flip_islands(
            &triangulation,
            &mut inside,
            settings.least_component_share,
        ));
        let done = repair_stars(&triangulation, &pull, &mut inside);
        repair = StarRepair {
            pinched: if round == 0 { done.pinched } else { repair.pinched },
            flips: repair.flips + done.flips,
            left: done.left,
        };
    }
    let adopted = adopt_points(&triangulation, spacing_mm, &mut inside);
    let off = points_off(&triangulation, &inside).iter().filter(|o| **o).count();
    Ok(Closure {
        used: (0..points.len() as u32).collect(),
        spacing_mm: spacing_mm.to_vec(),
        greedy,
        inside,
        islands,
        repair,
        adopted,
        dropped: 0,
        off,
        iterations: diffusion.iterations,
        triangulation,
    })
}

/// What every tetrahedron wants: the diffused sign, the more the larger its ball is against the spacing.
fn pulls(triangulation: &Triangulation, balls: &Balls, spacing_mm: &[f64], value: &[f32]) -> Vec<f32> {
    (0..triangulation.num_finite())
        .into_par_iter()
        .map(|t| {
            if balls.flat[t] {
                return 0.0;
            }
            let spacing: f64 = triangulation
                .tet(TetId(t as u32))
                .iter()
                .map(|v| spacing_mm[v.index()])
                .sum::<f64>()
                / 4.0;
            let size = (balls.radii[t] / spacing.max(f64::MIN_POSITIVE)).min(MOST_PULL);
            value[t].clamp(-1.0, 1.0) * size as f32
        })
        .collect()
}

/// The facets of given triangles; triangles that are no facet of the triangulation are left out.
pub(super) fn preset_facets(triangulation: &Triangulation, triangles: &[[u32; 3]]) -> Vec<Facet> {
    if triangles.is_empty() {
        return Vec::new();
    }
    let mut by_vertices: BTreeMap<[VertexId; 3], Facet> = BTreeMap::new();
    for facet in triangulation.facets() {
        let mut v = triangulation.facet_vertices(facet);
        v.sort_unstable();
        by_vertices.insert(v, facet);
    }
    triangles
        .iter()
        .filter_map(|t| {
            let mut v = t.map(VertexId);
            v.sort_unstable();
            by_vertices.get(&v).copied()
        })
        .collect()
}
