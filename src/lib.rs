//! # medial-scaffold
//!
//! Exact medial scaffolds of anatomical shapes, from a file to a report a clinician can open.
//!
//! The library reads in the order the data flows; every stage is a module with one front function
//! `stage(&input, &StageSettings) -> Result<Output, StageError>` that can be called alone, and
//! [`pipeline`] calls them in order with defaults.
//!
//! ```text
//! file --input--> Shape {cloud | mesh | label map}, LPS mm
//!   --input::sampling--> generators (+ known surface, when the input has one)
//!   --delaunay--> tetrahedra (canonical, exact)
//!   --full_scaffold--> flow types, arcs, sinks
//!   --segregation--> surface mesh  +  inside/outside label of every tetrahedron
//!   --fine_scaffold--> 2-complex of one side, dual to the solid's interior simplices
//!   --regularise--> collapses, then transforms, cheapest first
//!   --coarse_scaffold--> hypergraph of nodes, curves and sheets
//!       --measures--> thickness, ridges, centreline, parts, branches, landmarks
//!       --matching--> correspondences, edit path, shape distance
//!           --registration--> T_target_source, verified hypotheses
//!               --change--> volume change, growth map
//!               --atlas--> mean shape, modes, scores
//!   --reports--> JSON, CSV, PLY/VTP/GLB, one offline HTML page
//! ```
#![forbid(unsafe_code)]

pub mod geometry;

pub mod input;

pub mod delaunay;

pub mod full_scaffold;

pub mod segregation;

pub mod fine_scaffold;

pub mod regularise;

pub mod coarse_scaffold;

pub mod measures;

pub mod matching;

pub mod registration;

pub mod change;

pub mod reports;

pub mod pipeline;
