//! The way from one scaffold to the other in words and mm.
//!
//! In: the edit distance of two attributed hypergraphs, with the elements behind them. Out: an [`Edit`]: splices first, then the contractions
//! and merges they make possible, then the deformations of what stays, each with its price.
//!
//! * **Splice**: the persistence of an element above the cut (a rib counts a quarter, a node half), and the incidences that go with it.
//! * **Contract** a curve to a point: its length, since its two ends must come together.
//! * **Merge** two curves across a node, or two sheets across a curve, where all else that met there is gone: what
//!   splicing the node or curve costs.
//! * **Deform**: the cost of the pair of elements ([`super::compatibility`]), and the incidences that change with it.
//!
//! Operations after Sebastian, Klein and Kimia, "Recognition of shapes by editing their shock graphs", IEEE PAMI 26 (2004), on the transforms of
//! Chang and Kimia, "Regularizing 3D medial axis using medial scaffold transforms", CVPR 2008.

use super::evidence::Evidence;
use super::result::{Edit, EditElement, EditKind, EditOperation, EditSide};
use crate::coarse_scaffold::hypergraph::CurveKind;
use matchers::edit_distance::{EditDistance, GraphSide, Operation};
use matchers::hypergraph::Kind;

/// The path between `first` and `second`; `turned` when `first` is the source.
pub(crate) fn edit_path(distance: &EditDistance, first: &Evidence, second: &Evidence, turned: bool) -> Edit {
    let namer = Namer {
        first,
        second,
        turned,
    };
    let mut operations: Vec<(usize, EditOperation)> =
        distance.operations.iter().map(|o| namer.named(o)).collect();
    // Stable: within a group the order of the elements stays.
    operations.sort_by_key(|o| o.0);
    Edit {
        lower_bound: distance.lower_bound,
        upper_bound: distance.upper_bound,
        exact: distance.exact,
        operations: operations.into_iter().map(|o| o.1).collect(),
    }
}

struct Namer<'a> {
    first: &'a Evidence,
    second: &'a Evidence,
    turned: bool,
}

impl Namer<'_> {
    /// An operation with its place in the path.
    fn named(&self, operation: &Operation) -> (usize, EditOperation) {
        let price = operation.price();
        match operation {
            Operation::Splice {
                side, kind, parts, ..
            } => {
                let ids = self.ids(*side, *kind, parts);
                let element = self.element(*side, *kind, parts[0]);
                let side = self.side(*side);
                let text = format!("splice {} of {side}: {price:.3} mm", several(element, &ids));
                (
                    0,
                    one_sided(EditKind::Splice, element, side, ids, Vec::new(), price, text),
                )
            }
            Operation::Contract {
                side, curve, nodes, ..
            } => {
                let ids = self.ids(*side, Kind::Curve, &[*curve]);
                let joined = self.ids(*side, Kind::Node, nodes);
                let element = self.element(*side, Kind::Curve, *curve);
                let side = self.side(*side);
                let text = format!(
                    "contract {} of {side}, {} become one: {price:.3} mm",
                    several(element, &ids),
                    several(EditElement::Node, &joined)
                );
                (
                    1,
                    one_sided(EditKind::Contract, element, side, ids, joined, price, text),
                )
            }
            Operation::Merge {
                side,
                removed_kind,
                removed,
                joined_kind,
                joined,
                ..
            } => {
                let ids = self.ids(*side, *removed_kind, &[*removed]);
                let element = self.element(*side, *removed_kind, *removed);
                let merged = self.element(*side, *joined_kind, joined[0]);
                let joined = self.ids(*side, *joined_kind, joined);
                let side = self.side(*side);
                let text = format!(
                    "merge {} of {side} across {}: {price:.3} mm",
                    several(merged, &joined),
                    several(element, &ids)
                );
                (
                    1,
                    one_sided(EditKind::Merge, element, side, ids, joined, price, text),
                )
            }
            Operation::Deform {
                kind, target, source, ..
            } => {
                let element = self.element(GraphSide::Target, *kind, target[0]);
                let first = self.ids(GraphSide::Target, *kind, target);
                let second = self.ids(GraphSide::Source, *kind, source);
                let (target, source) = if self.turned {
                    (second, first)
                } else {
                    (first, second)
                };
                let text = format!(
                    "deform {} of target into {} of source: {price:.3} mm",
                    several(element, &target),
                    numbers(&source)
                );
                let operation = EditOperation {
                    operation: EditKind::Deform,
                    element,
                    side: None,
                    target,
                    source,
                    joined: Vec::new(),
                    price,
                    text,
                };
                (2, operation)
            }
        }
    }

    fn evidence(&self, side: GraphSide) -> &Evidence {
        match side {
            GraphSide::Target => self.first,
            GraphSide::Source => self.second,
        }
    }

    fn side(&self, side: GraphSide) -> EditSide {
        match (side, self.turned) {
            (GraphSide::Target, false) | (GraphSide::Source, true) => EditSide::Target,
            _ => EditSide::Source,
        }
    }

    /// Ids in the scaffold, the heaviest part first.
    fn ids(&self, side: GraphSide, kind: Kind, elements: &[u32]) -> Vec<u32> {
        let evidence = self.evidence(side);
        let id = |x: u32| match kind {
            Kind::Node => evidence.nodes[x as usize].id,
            Kind::Curve => evidence.curves[x as usize].id,
            Kind::Sheet => evidence.sheets[x as usize].id,
        };
        elements.iter().map(|&x| id(x)).collect()
    }

    fn element(&self, side: GraphSide, kind: Kind, x: u32) -> EditElement {
        match kind {
            Kind::Node => EditElement::Node,
            Kind::Sheet => EditElement::Sheet,
            Kind::Curve => match self.evidence(side).curves[x as usize].kind {
                CurveKind::Axial => EditElement::AxialCurve,
                CurveKind::Rib => EditElement::Rib,
                CurveKind::Wire => EditElement::Wire,
                CurveKind::Seam => EditElement::Seam,
            },
        }
    }
}

fn one_sided(
    operation: EditKind,
    element: EditElement,
    side: EditSide,
    ids: Vec<u32>,
    joined: Vec<u32>,
    price: f64,
    text: String,
) -> EditOperation {
    let (target, source) = match side {
        EditSide::Target => (ids, Vec::new()),
        EditSide::Source => (Vec::new(), ids),
    };
    EditOperation {
        operation,
        element,
        side: Some(side),
        target,
        source,
        joined,
        price,
        text,
    }
}

/// "axial curve 7", "ribs 3 + 5".
fn several(element: EditElement, ids: &[u32]) -> String {
    let s = if ids.len() > 1 { "s" } else { "" };
    format!("{element}{s} {}", numbers(ids))
}

fn numbers(ids: &[u32]) -> String {
    ids.iter().map(u32::to_string).collect::<Vec<_>>().join(" + ")
}
