//! Regularise: homotopy-preserving simplification, cheapest first.
//!
//! In: the fine scaffold and one number, how much the shape may change. Out: [`Regularised`]: a subcomplex of the fine scaffold,
//! every facet graded by erosion thickness (ET), and the log of the steps that led there, which replays to the same complex.
//!
//! 1. [`cells`]: 3-cells are collapsed;
//! 2. [`burn`]: erosion thickness of every facet;
//! 3. [`collapse`]: facets of small ET, and wires, go from the ribs and tips inward;
//! 4. [`splice`] whole sheets by largest ET, [`fins`] by hysteresis, until nothing changes;
//! 5. [`grow`]: survivors grow back across their ribs and from their tips; [`fringe`]s are trimmed;
//! 6. small remnants and [`wires`] go;
//! 7. [`fidelity`]: what moves the surface by more than the tolerance is brought back;
//! 8. [`seams`]: gaps at the ends of axial curves become borders;
//! 9. [`spines`]: single edges grow back to the balls that the farthest generators need.
//!
//! Every change is an elementary collapse or expansion ([`complex`]), and the Betti numbers are checked after every stage all the
//! same. After Chang & Kimia, "Regularizing 3D medial axis using medial scaffold transforms" (2008), with lengths for
//! costs and ET for order. Cost `O(n log n)`.

pub(crate) mod balls;
pub(crate) mod burn;
pub(crate) mod cells;
pub(crate) mod collapse;
pub mod complex;
pub(crate) mod cover;
pub mod fidelity;
pub(crate) mod fins;
pub(crate) mod fringe;
pub(crate) mod grow;
pub mod history;
pub(crate) mod measure;
pub(crate) mod parts;
pub(crate) mod queue;
pub(crate) mod seams;
pub mod settings;
pub(crate) mod spines;
pub(crate) mod splice;
pub mod stages;
pub(crate) mod wires;

pub use complex::{Alive, Step, replay};
pub use fidelity::Fidelity;
pub use history::{Event, Kind};
pub use settings::{Cost, RegulariseError, RegulariseSettings};
pub use stages::{Regularised, StageBetti, regularise};
