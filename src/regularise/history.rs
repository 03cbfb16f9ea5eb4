//! The history: what was done, where, at which cost, and which steps of the log did it.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The kinds of event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// 3-cells collapsed.
    Cells,
    /// Facets and wires of small erosion thickness collapsed.
    Collapse,
    /// A whole sheet removed (transitions A1A3-I and A1^2A3-II).
    Splice,
    /// The fin behind an axial curve removed (transitions A5 and A1A3-II).
    TrimFin,
    /// Wires pruned from their tips.
    PruneWires,
    /// Sheets grown back across their ribs.
    GrowBack,
    /// Fingers narrower than the tolerance trimmed off the ribs.
    TrimFringe,
    /// Wires grown back from their tips.
    GrowWires,
    /// Removed pieces put back because the surface had moved by more than the tolerance.
    Restore,
    /// A short path between the end of an axial curve and a rib declared a border between sheets.
    Seam,
    /// Paths of single edges grown back for the generators farthest from the medial balls; no elements of the graph.
    Spines,
    /// A short curve shrunk to a node (transitions A1^5 and A1^2A3-I).
    ContractCurve,
    /// A small sheet shrunk to a node (transition A1^5).
    ContractSheet,
    /// An axial curve below the cut that the surface cannot do without, left out of the graph.
    HideCurve,
    /// A node joined to a near curve or node across a sheet (transitions A1A3-II, A1^2A3-I, A1^4).
    Merge,
}

/// One event of the history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// What was done.
    pub kind: Kind,
    /// Cost: how much of the shape it stands for, mm (a number of generators when costs are counts).
    pub cost_mm: f64,
    /// Where.
    pub position: DVec3,
    /// First step of the log that belongs to it.
    pub first_step: u32,
    /// One past the last step.
    pub last_step: u32,
    /// `false` when it was not allowed (the homotopy type or the tolerance would have been broken) and was skipped.
    pub applied: bool,
}

impl Event {
    pub(crate) fn applied(kind: Kind, cost_mm: f64, position: DVec3, first: usize, last: usize) -> Self {
        Self {
            kind,
            cost_mm,
            position,
            first_step: first as u32,
            last_step: last as u32,
            applied: true,
        }
    }

    pub(crate) fn skipped(kind: Kind, cost_mm: f64, position: DVec3) -> Self {
        Self {
            applied: false,
            ..Self::applied(kind, cost_mm, position, 0, 0)
        }
    }
}
