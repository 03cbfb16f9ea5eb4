//! Segregation: splitting the full scaffold into the part that crosses the surface (triangles) and the rest.
//!
//! In: the triangulation, and the known surface when the input has one; or a raw cloud. Out: [`Segregation`]: the surface
//! mesh over the generators and the inside/outside label of every tetrahedron.
//!
//! * [`known_surface`]: a mesh or mask says where its surface is; one winding number a region ([`flood`]); [`refine`] adds
//!   generators where that does not give the surface's topology, and [`known_repair`] changes the last labels that no sampling would.
//! * [`cloud`]: a raw cloud is prepared ([`prepare`]: outliers, noise), shows its surface by greedy gap transforms
//!   ([`gap_transforms`] at the price of [`gap_cost`]), is closed ([`closure`]: [`diffusion`], [`labelling`] with [`min_cut`], [`islands`],
//!   [`star_repair`], [`adopt`], [`handles`]), judged open or closed (`judge`, [`openness`]), joined where open sheets cross ([`crossing`]), tried otherwise where noise is strong (`runs`), oriented ([`orient`]), reported
//!   ([`report`]) and looked over for faults ([`self_check`]).
//! * [`mesh_repair`]: a damaged mesh keeps its good triangles; the rest is found anew from its points. [`mend()`] closes holes.

pub mod adopt;
pub mod balls;
pub mod closure;
pub mod cloud;
pub mod crossing;
pub mod diffusion;
pub mod error;
pub mod facets;
pub mod flood;
pub mod gap_cost;
pub mod gap_transforms;
pub mod handles;
mod homotopic_growth;
pub mod islands;
mod judge;
pub mod known_queries;
pub mod known_repair;
pub mod known_surface;
pub mod labelling;
pub mod labels;
pub mod mend;
pub mod mesh_repair;
pub mod min_cut;
pub mod openness;
pub mod orient;
pub mod prepare;
pub mod refine;
pub mod report;
mod runs;
pub mod self_check;
pub mod settings;
pub mod star_repair;
mod stars;

pub use balls::Balls;
pub use cloud::{CloudSegregation, segregate_cloud};
pub use crossing::Crossing;
pub use error::SegregationError;
pub use gap_cost::CostRule;
pub use known_queries::KnownSurface;
pub use known_repair::RepairedPlace;
pub use known_surface::{
    KnownSurfaceReport, KnownSurfaceSegregation, KnownSurfaceSettings, RefinementPlace, RefinementReason,
    segregate_known,
};
pub use labels::{Segregation, boundary_facets, boundary_triangles};
pub use mend::{MendedMesh, Mending, mend};
pub use mesh_repair::{Change, ChangeKind, MeshRepair, MeshRepairReport, segregate_mesh};
pub use prepare::Strength;
pub use refine::{RefinedSegregation, segregate_known_refined};
pub use report::CloudReport;
pub use self_check::{Doubt, DoubtKind};
pub use settings::{ClosedOrOpen, Denoise, SegregationSettings};
