//! Shared by the examples: the way from points on a known surface to a scaffold, and a small z-buffer that draws it.
#![allow(dead_code)]

pub mod bones;
pub mod filters;
pub mod picture;
pub mod run;
pub mod stability;
