//! All graphs that the views of one scaffold can be, in numbers: what a plot or a slider of the tolerance has to say.
//!
//! A view changes only where the tolerance passes a persistence, so one view just at each of them tells all. Cost: one view,
//! without its meshes, for each element.

use super::hypergraph::{CoarseScaffold, CurveKind, Sheet, SheetMesh};
use serde::{Deserialize, Serialize};

/// The graph up to a tolerance, from the tolerance of the level before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// The largest tolerance of this graph, mm.
    pub tolerance_mm: f64,
    /// Sheets.
    pub sheets: u32,
    /// Axial curves.
    pub axial_curves: u32,
    /// Wires.
    pub wires: u32,
    /// Nodes.
    pub nodes: u32,
}

impl CoarseScaffold {
    /// The graphs of [`CoarseScaffold::view`] from the scaffold's own tolerance up to its largest persistence. For any tolerance in
    /// between, the first level that is not below it counts the elements of its view.
    pub fn levels(&self) -> Vec<Level> {
        let bare = CoarseScaffold {
            sheets: self
                .sheets
                .iter()
                .map(|s| Sheet {
                    mesh: SheetMesh::default(),
                    ..s.clone()
                })
                .collect(),
            transforms: Vec::new(),
            fine: Default::default(),
            ..self.clone()
        };
        let mut at: Vec<f64> = self
            .sheets
            .iter()
            .map(|s| s.persistence)
            .chain(self.curves.iter().map(|c| c.persistence))
            .filter(|&p| p > self.tolerance_mm)
            .collect();
        at.push(self.tolerance_mm);
        at.sort_unstable_by(f64::total_cmp);
        at.dedup();
        at.into_iter()
            .map(|tolerance_mm| {
                let view = bare.view(tolerance_mm);
                let of_kind = |kind| view.curves.iter().filter(|c| c.kind == kind).count() as u32;
                Level {
                    tolerance_mm,
                    sheets: view.sheets.len() as u32,
                    axial_curves: of_kind(CurveKind::Axial),
                    wires: of_kind(CurveKind::Wire),
                    nodes: view.nodes.len() as u32,
                }
            })
            .collect()
    }
}
