//! Deformations with exact truth.
//!
//! * [`rigid`]: rigid motions, uniformly random rotations, mirror images;
//! * [`warp`]: smooth maps of space with Jacobian and inverse: bend, twist, taper, bumps, local growth;
//! * [`growth`]: lesions that grow or shrink by exactly known percentages;
//! * [`crop`]: half-spaces, several cuts, one-sided visibility, missing parts.
//!
//! A deformed mesh keeps its triangles, so that correspondence is by index.

pub mod crop;
pub mod growth;
pub mod rigid;
pub mod warp;

pub use crop::{Kept, crop_half_space, crop_half_spaces, remove_ball, visible_from};
pub use rigid::RigidMotion;
pub use warp::Warp;
