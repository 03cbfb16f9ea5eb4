//! Closing: inside and outside of every tetrahedron from a cloud alone.
//!
//! In: prepared points with local spacing. Out: [`Closure`]: the triangulation, the greedy facets, and labels whose boundary
//! is a closed manifold.
//!
//! 1. Delaunay, circumspheres, facet weights.
//! 2. Greedy gap transforms ([`super::gap_transforms`]): where the surface shows itself.
//! 3. Signed diffusion ([`super::diffusion`]): what that says of every tetrahedron.
//! 4. Minimum cut with pull `clamp(x) min(3, r / s)`, made a manifold without narrow handles ([`super::labelling`]).
//! 5. Points still off the surface, and points that stand alone on it, are dropped and all is done once more, so that no generator sits inside the solid.
//!
//! Labatut, Pons & Keriven 2009 use the same cut with lines of sight; a cloud has none, the diffusion takes their place.

use super::adopt::points_off;
use super::balls::Balls;
use super::diffusion::diffuse;
use super::error::SegregationError;
use super::facets::FacetDepths;
use super::gap_cost::CostRule;
use super::gap_transforms::{GapTransforms, gap_transforms};
use super::handles::NarrowHandle;
use super::islands::Island;
use super::labelling::{Labelled, LabellingProblem, RemovedHandle};
use super::labels::boundary_triangles;
use super::openness::{all_unsupported, unsupported};
use super::star_repair::StarRepair;
use crate::delaunay::{DelaunaySettings, Facet, Triangulation, delaunay};
use crate::geometry::{TetId, VertexId};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Factor on the cost of facets without support in [`Closure::supported`].
const UNSUPPORTED_FACTOR: f32 = 8.0;
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
    /// Narrow handles that were not believed.
    pub opened: Vec<RemovedHandle>,
    /// Narrow handles left, once [`Self::give_up_narrow_handles`] looked for them.
    pub handles: Vec<NarrowHandle>,
    /// Points off the surface in the first run, dropped for the second.
    pub dropped: usize,
    /// Points off the surface at the end.
    pub off: usize,
    /// Iterations of the diffusion.
    pub iterations: usize,
    /// Facet weights, kept for other labellings of the same triangulation.
    pub depths: FacetDepths,
    /// What every finite tetrahedron wants; positive: inside.
    pub pull: Vec<f32>,
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

/// Steps 1 to 4 for distinct points in lexicographic order; see the module.
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

/// Step 5: closes once more without the points that `first` left off its surface. For closed shapes only: the closed surface
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
    let mut off = points_off(&first.triangulation, &first.inside);
    let alone = standing_alone(&first);
    for &v in &alone {
        off[v as usize] = true;
    }
    if first.off + alone.len() == 0 {
        return Ok(first);
    }
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
        dropped: first.off + alone.len(),
        ..second
    })
}

/// Points of the surface all of whose triangles lack support: outliers that the surface reached for.
fn standing_alone(closure: &Closure) -> Vec<u32> {
    let triangles: Vec<[u32; 3]> = boundary_triangles(&closure.triangulation, &closure.inside)
        .into_iter()
        .map(|t| t.map(|v| v.0))
        .collect();
    let bare = unsupported(&closure.triangulation.points, &triangles, &closure.spacing_mm);
    all_unsupported(closure.triangulation.points.len(), &triangles, &bare)
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
    let Labelled {
        inside,
        islands,
        repair,
        adopted,
        ..
    } = LabellingProblem {
        triangulation: &triangulation,
        depths: &depths,
        accepted: &greedy.accepted,
        pull: &pull,
        spacing_mm,
        least_component_share: settings.least_component_share,
        unsupported_factor: 1.0,
    }
    .cut(&pull);
    let off = points_off(&triangulation, &inside).iter().filter(|o| **o).count();
    Ok(Closure {
        used: (0..points.len() as u32).collect(),
        spacing_mm: spacing_mm.to_vec(),
        greedy,
        inside,
        islands,
        repair,
        adopted,
        opened: Vec::new(),
        handles: Vec::new(),
        dropped: 0,
        off,
        iterations: diffusion.iterations,
        depths,
        pull,
        triangulation,
    })
}

impl Closure {
    /// The labelling problem this closure solved, with one thing changed.
    fn problem<'a>(&'a self, pull: &'a [f32], share: f64, unsupported_factor: f32) -> LabellingProblem<'a> {
        LabellingProblem {
            triangulation: &self.triangulation,
            depths: &self.depths,
            accepted: &self.greedy.accepted,
            pull,
            spacing_mm: &self.spacing_mm,
            least_component_share: share,
            unsupported_factor,
        }
    }

    fn labelled(&self) -> Labelled {
        Labelled {
            inside: self.inside.clone(),
            islands: self.islands.clone(),
            repair: self.repair,
            adopted: self.adopted,
            opened: self.opened.clone(),
            handles: self.handles.clone(),
        }
    }

    fn take(&mut self, labelled: Labelled) {
        self.off = points_off(&self.triangulation, &labelled.inside)
            .iter()
            .filter(|o| **o)
            .count();
        self.inside = labelled.inside;
        self.islands = labelled.islands;
        self.repair = labelled.repair;
        self.adopted = labelled.adopted;
        self.opened = labelled.opened;
        self.handles = labelled.handles;
    }

    /// Gives up narrow handles ([`super::labelling`], step 3).
    pub fn give_up_narrow_handles(&mut self, least_component_share: f64) {
        let labelled = self
            .problem(&self.pull, least_component_share, 1.0)
            .without_narrow_handles(self.labelled());
        if labelled.opened.is_empty() {
            self.handles = labelled.handles;
        } else {
            self.take(labelled);
        }
    }

    /// The labels had every pull been `factor` times what it is.
    pub fn relabelled(&self, factor: f32, least_component_share: f64) -> Labelled {
        let pull: Vec<f32> = self.pull.iter().map(|p| p * factor).collect();
        let problem = self.problem(&pull, least_component_share, 1.0);
        problem.without_narrow_handles(problem.cut(&pull))
    }

    /// The labels when triangles without support are dear: another way round where noise let a gap be filled (between two
    /// ears), the same or nothing where a hole can only be closed across.
    pub fn supported(&self, least_component_share: f64) -> Labelled {
        self.problem(&self.pull, least_component_share, UNSUPPORTED_FACTOR)
            .cut(&self.pull)
    }

    /// As [`Self::take`], for another module's choice.
    pub fn replace_labels(&mut self, labelled: Labelled) {
        self.take(labelled);
    }
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
