//! What a segregation of a raw cloud says of itself: decisions, numbers, holes, doubts.

use super::crossing::Crossing;
use super::islands::Island;
use super::labelling::RemovedHandle;
use super::mesh_repair::MeshRepairReport;
use super::openness::{Patch, Rim};
use super::prepare::PrepareReport;
use super::self_check::{Doubt, SelfCheck};
use crate::geometry::MeshTopology;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Everything worth knowing of a cloud segregation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CloudReport {
    /// Outliers, noise, smoothing, thinning.
    pub prepare: PrepareReport,
    /// Open or closed, and why.
    pub decision: Decision,
    /// Topology of the surface.
    pub topology: MeshTopology,
    /// Surface components, most points first.
    pub components: Vec<ComponentReport>,
    /// Parts that the closed surface closed without any points to support it: holes that were filled.
    pub filled_holes: Vec<Patch>,
    /// Borders of the surface: holes that were left.
    pub rims: Vec<Rim>,
    /// Lines where half sheets of an open surface meet; the edges with three or more triangles are theirs and no damage.
    pub crossings: Vec<Crossing>,
    /// Points added on triangles near crossings, so that all are facets of the triangulation.
    pub crossing_points_added: usize,
    /// Small parts that were removed or filled.
    pub islands: Vec<Island>,
    /// Counts of the closing stage.
    pub closing: ClosingReport,
    /// Numbers of the self-check of a closed surface.
    pub self_check: SelfCheck,
    /// The same with one thing changed: they should agree.
    pub second_opinions: Vec<SecondOpinion>,
    /// What a mesh that was repaired kept and lost.
    pub repair: Option<MeshRepairReport>,
    /// Reasons to look at the result before using it; empty when there are none.
    pub doubts: Vec<Doubt>,
}

impl CloudReport {
    /// Whether the result marks itself as doubtful.
    pub fn doubtful(&self) -> bool {
        !self.doubts.is_empty()
    }
}

/// Open or closed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Whether the surface was taken to be closed.
    pub closed: bool,
    /// Whether the user said so, or the area decided.
    pub by_user: bool,
    /// Share of the closed surface's area that no points support.
    pub unsupported_area_share: f64,
    /// Share above which a cloud is taken to be open.
    pub threshold: f64,
    /// The decision in words.
    pub reason: String,
}

/// One component of the surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComponentReport {
    /// Points on it.
    pub points: usize,
    /// Area, mm^2.
    pub area_mm2: f64,
    /// Enclosed volume, mm^3, when closed (negative: a cavity).
    pub volume_mm3: Option<f64>,
    /// Euler number.
    pub euler: i64,
    /// Open edges.
    pub boundary_edges: usize,
    /// Mean of its points, mm.
    pub place: DVec3,
}

/// Counts of the closing stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClosingReport {
    /// Triangles of the greedy surface.
    pub greedy_triangles: usize,
    /// Greedy triangles undone on the way.
    pub greedy_undone: usize,
    /// Iterations of the diffusion.
    pub diffusion_iterations: usize,
    /// Pinched vertices before the star repair.
    pub pinched: usize,
    /// Tetrahedra flipped by the star repair.
    pub flips: usize,
    /// Pinched vertices after it.
    pub left_pinched: usize,
    /// Narrow handles that were not believed: tunnels filled, bridges broken.
    pub handles_removed: Vec<RemovedHandle>,
    /// Points taken onto the surface at the end.
    pub adopted: usize,
    /// Points off the surface, dropped before a second run.
    pub dropped: usize,
    /// Points off the surface at the end.
    pub off: usize,
    /// Share of the points that were off the surface at first.
    pub off_share: f64,
}

/// What was different in a second opinion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variation {
    /// Nothing: the result itself.
    None,
    /// Another seed of the thinning.
    Thinning {
        /// The seed.
        seed: u64,
    },
    /// Every tetrahedron's pull times a factor.
    Pull {
        /// The factor.
        factor: f64,
    },
}

/// The outcome of a run with one thing changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SecondOpinion {
    /// What was changed.
    pub variation: Variation,
    /// Its Euler number.
    pub euler: i64,
    /// Its components.
    pub components: usize,
}
