//! Change against exact truth: spheres and solids known by construction, published reference values, a peer's own values, and
//! contours of one tumour on three grids.
//!
//! Real scans are looked for in `../shared/data` beside the workspace (or `MEDIAL_DATA`); tests that need them say so when they are
//! not there. `MEDIAL_SLOW=1` runs the full sweeps. Tables are printed: `cargo test --release --test change -- --nocapture`.

mod command;
mod common;
mod interval;
mod one_date;
mod sarcomas;
mod segmentations;
mod two_dates;
