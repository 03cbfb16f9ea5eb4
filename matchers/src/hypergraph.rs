//! Attributed hypergraph: nodes, curves and sheets with weights and attributes.
//!
//! In: elements added one by one, checked at the door. Out: a structure whose references all resolve.
//!
//! * A **node** is a point where curves end.
//! * A **curve** has an identity of its own: two curves may join the same two nodes (parallel curves), a curve may
//!   begin and end at one node (a loop), and a closed curve may have no node at all.
//! * A **sheet** is a hyperedge: the list of the curves on its boundary; a curve that the sheet meets from both
//!   sides (a slit) is listed twice. A closed sheet has no curve.
//! * A **corner** says that a sheet turns at a node.
//!
//! The **weight** of an element is the evidence that it is there, in the unit in which matching is priced (mm of
//! persistence for a medial scaffold): leaving an element unmatched costs its weight, so an element that sits at the
//! simplification cut weighs about nothing and costs about nothing, whether the other side has it or not.
//!
//! Attributes are plain numbers, the same count for every element of a kind; what they mean is the caller's affair.

use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident, $word:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub struct $name(pub u32);

        impl $name {
            /// The id as a position in the list of its kind.
            pub fn index(self) -> usize {
                self.0 as usize
            }

            /// The id of the element at a position.
            ///
            /// # Panics
            /// When the position does not fit in 32 bits.
            pub fn from_index(index: usize) -> Self {
                Self(u32::try_from(index).expect("fewer than 2^32 elements"))
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!($word, " {}"), self.0)
            }
        }
    };
}

id!(
    /// Position of a node in its hypergraph.
    NodeId,
    "node"
);
id!(
    /// Position of a curve in its hypergraph.
    CurveId,
    "curve"
);
id!(
    /// Position of a sheet in its hypergraph.
    SheetId,
    "sheet"
);

/// The three kinds of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A node.
    Node,
    /// A curve.
    Curve,
    /// A sheet.
    Sheet,
}

impl Kind {
    /// All kinds, in the order used for arrays of three.
    pub const ALL: [Kind; 3] = [Kind::Node, Kind::Curve, Kind::Sheet];

    /// Position in [`Kind::ALL`].
    pub fn index(self) -> usize {
        self as usize
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Node => "node",
            Kind::Curve => "curve",
            Kind::Sheet => "sheet",
        })
    }
}

/// Why an element is refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum HypergraphError {
    /// A weight is negative or not finite; weights are evidence, zero or more.
    #[error("{kind} {index}: weight {value} is not a finite number of at least 0")]
    BadWeight {
        /// Kind of the element.
        kind: Kind,
        /// Position the element would have had.
        index: usize,
        /// The weight found.
        value: f64,
    },
    /// An attribute is not finite; replace or drop that attribute for all elements of the kind.
    #[error("{kind} {index}: attribute {attribute} is {value}; attributes must be finite")]
    BadAttribute {
        /// Kind of the element.
        kind: Kind,
        /// Position the element would have had.
        index: usize,
        /// Position of the attribute.
        attribute: usize,
        /// The value found.
        value: f64,
    },
    /// Elements of one kind have different numbers of attributes.
    #[error("{kind} {index}: {found} attributes, but the {kind}s before it have {expected}")]
    AttributeCount {
        /// Kind of the element.
        kind: Kind,
        /// Position the element would have had.
        index: usize,
        /// Attributes of the first element of the kind.
        expected: usize,
        /// Attributes found.
        found: usize,
    },
    /// A reference does not resolve; add the element referred to first.
    #[error("{kind} {index} refers to {referred_kind} {referred}, but there are only {count}")]
    UnknownReference {
        /// Kind of the element.
        kind: Kind,
        /// Position the element would have had.
        index: usize,
        /// Kind referred to.
        referred_kind: Kind,
        /// Position referred to.
        referred: usize,
        /// Number of elements of that kind.
        count: usize,
    },
}

/// Where a curve ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CurveEnds {
    /// A closed curve without a node.
    Closed,
    /// One end at a node, the other free.
    One(NodeId),
    /// Both ends at nodes; the same node twice is a loop.
    Two(NodeId, NodeId),
}

impl CurveEnds {
    /// The end nodes, a loop's node twice.
    pub fn nodes(self) -> impl Iterator<Item = NodeId> {
        let (a, b) = match self {
            CurveEnds::Closed => (None, None),
            CurveEnds::One(a) => (Some(a), None),
            CurveEnds::Two(a, b) => (Some(a), Some(b)),
        };
        a.into_iter().chain(b)
    }
}

/// A node with its evidence and attributes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Evidence; the price of leaving the node unmatched.
    pub weight: f64,
    /// Attributes, as many as every other node has.
    pub attributes: Vec<f64>,
}

/// A curve with its ends, evidence and attributes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// End nodes.
    pub ends: CurveEnds,
    /// Evidence; the price of leaving the curve unmatched.
    pub weight: f64,
    /// Price of shrinking the curve to a point, so that its ends become one node, incidences included; `None` forbids it.
    pub contract_price: Option<f64>,
    /// Class of the curve: curves of different classes never merge.
    pub class: u32,
    /// Attributes, as many as every other curve has.
    pub attributes: Vec<f64>,
}

/// A sheet with its boundary curves, evidence and attributes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sheet {
    /// Curves on the boundary, a slit twice.
    pub curves: Vec<CurveId>,
    /// Evidence; the price of leaving the sheet unmatched.
    pub weight: f64,
    /// Attributes, as many as every other sheet has.
    pub attributes: Vec<f64>,
}

/// A place where the boundary of a sheet turns at a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Corner {
    /// The sheet.
    pub sheet: SheetId,
    /// The node.
    pub node: NodeId,
    /// Size of the turn, a number of at least 0 that both graphs measure alike (the angle in units of pi, say).
    pub turn: f64,
}

/// Nodes, curves and sheets with weights and attributes; see the module documentation.
///
/// ```
/// use matchers::{AttributedHypergraph, CurveEnds};
/// // One sheet bounded by a closed rib, with an axial curve as a slit in it.
/// let mut g = AttributedHypergraph::new();
/// let a = g.add_node(0.2, vec![3.0]).unwrap();
/// let b = g.add_node(0.2, vec![4.0]).unwrap();
/// let rib = g.add_curve(CurveEnds::Closed, 5.0, vec![40.0]).unwrap();
/// let axial = g.add_curve(CurveEnds::Two(a, b), 0.6, vec![9.0]).unwrap();
/// g.add_sheet(vec![rib, axial, axial], 5.0, vec![120.0]).unwrap();
/// assert_eq!(g.curves().len(), 2);
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AttributedHypergraph {
    nodes: Vec<Node>,
    curves: Vec<Curve>,
    sheets: Vec<Sheet>,
    corners: Vec<Corner>,
}

impl AttributedHypergraph {
    /// An empty hypergraph.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a node.
    ///
    /// # Errors
    /// When the weight or an attribute is refused.
    pub fn add_node(&mut self, weight: f64, attributes: Vec<f64>) -> Result<NodeId, HypergraphError> {
        let index = self.nodes.len();
        let expected = self.nodes.first().map(|n| n.attributes.len());
        check(Kind::Node, index, weight, &attributes, expected)?;
        self.nodes.push(Node { weight, attributes });
        Ok(NodeId::from_index(index))
    }

    /// Adds a curve that cannot be contracted; see [`Self::set_contract_price`].
    ///
    /// # Errors
    /// When the weight or an attribute is refused, or an end node does not exist.
    pub fn add_curve(
        &mut self,
        ends: CurveEnds,
        weight: f64,
        attributes: Vec<f64>,
    ) -> Result<CurveId, HypergraphError> {
        let index = self.curves.len();
        let expected = self.curves.first().map(|c| c.attributes.len());
        check(Kind::Curve, index, weight, &attributes, expected)?;
        for node in ends.nodes() {
            refer(Kind::Curve, index, Kind::Node, node.index(), self.nodes.len())?;
        }
        self.curves.push(Curve {
            ends,
            weight,
            contract_price: None,
            class: 0,
            attributes,
        });
        Ok(CurveId::from_index(index))
    }

    /// Sets what shrinking a curve to a point costs; `None` forbids it.
    ///
    /// # Errors
    /// When the curve does not exist or the price is negative or not finite.
    pub fn set_contract_price(&mut self, curve: CurveId, price: Option<f64>) -> Result<(), HypergraphError> {
        refer(
            Kind::Curve,
            curve.index(),
            Kind::Curve,
            curve.index(),
            self.curves.len(),
        )?;
        if let Some(p) = price {
            check(Kind::Curve, curve.index(), p, &[], None)?;
        }
        self.curves[curve.index()].contract_price = price;
        Ok(())
    }

    /// Sets the class of a curve, 0 unless set: curves of different classes never merge.
    ///
    /// # Errors
    /// When the curve does not exist.
    pub fn set_class(&mut self, curve: CurveId, class: u32) -> Result<(), HypergraphError> {
        let count = self.curves.len();
        refer(Kind::Curve, curve.index(), Kind::Curve, curve.index(), count)?;
        self.curves[curve.index()].class = class;
        Ok(())
    }

    /// Adds a sheet; a curve met from both sides is listed twice.
    ///
    /// # Errors
    /// When the weight or an attribute is refused, or a curve does not exist.
    pub fn add_sheet(
        &mut self,
        curves: Vec<CurveId>,
        weight: f64,
        attributes: Vec<f64>,
    ) -> Result<SheetId, HypergraphError> {
        let index = self.sheets.len();
        let expected = self.sheets.first().map(|s| s.attributes.len());
        check(Kind::Sheet, index, weight, &attributes, expected)?;
        for curve in &curves {
            refer(Kind::Sheet, index, Kind::Curve, curve.index(), self.curves.len())?;
        }
        self.sheets.push(Sheet {
            curves,
            weight,
            attributes,
        });
        Ok(SheetId::from_index(index))
    }

    /// Adds a corner: the boundary of `sheet` turns at `node` by `turn` (at least 0).
    ///
    /// # Errors
    /// When the sheet or node does not exist, or the turn is negative or not finite.
    pub fn add_corner(&mut self, sheet: SheetId, node: NodeId, turn: f64) -> Result<(), HypergraphError> {
        refer(
            Kind::Sheet,
            sheet.index(),
            Kind::Sheet,
            sheet.index(),
            self.sheets.len(),
        )?;
        refer(
            Kind::Sheet,
            sheet.index(),
            Kind::Node,
            node.index(),
            self.nodes.len(),
        )?;
        check(Kind::Sheet, sheet.index(), turn, &[], None)?;
        self.corners.push(Corner { sheet, node, turn });
        Ok(())
    }

    /// The nodes, by id.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The curves, by id.
    pub fn curves(&self) -> &[Curve] {
        &self.curves
    }

    /// The sheets, by id.
    pub fn sheets(&self) -> &[Sheet] {
        &self.sheets
    }

    /// The corners, in the order added.
    pub fn corners(&self) -> &[Corner] {
        &self.corners
    }

    /// Number of elements of a kind.
    pub fn count(&self, kind: Kind) -> usize {
        match kind {
            Kind::Node => self.nodes.len(),
            Kind::Curve => self.curves.len(),
            Kind::Sheet => self.sheets.len(),
        }
    }

    /// Weights of all elements of a kind.
    pub fn weights(&self, kind: Kind) -> Vec<f64> {
        match kind {
            Kind::Node => self.nodes.iter().map(|n| n.weight).collect(),
            Kind::Curve => self.curves.iter().map(|c| c.weight).collect(),
            Kind::Sheet => self.sheets.iter().map(|s| s.weight).collect(),
        }
    }

    /// Attributes of one element.
    ///
    /// # Panics
    /// When there is no such element.
    pub fn attributes(&self, kind: Kind, index: usize) -> &[f64] {
        match kind {
            Kind::Node => &self.nodes[index].attributes,
            Kind::Curve => &self.curves[index].attributes,
            Kind::Sheet => &self.sheets[index].attributes,
        }
    }

    /// The same hypergraph with its elements in another order: element k of a kind is the old element `order[kind][k]`.
    ///
    /// Ends of curves, boundaries of sheets and corners are put in ascending order.
    ///
    /// # Panics
    /// When an order is not a permutation of the elements of its kind.
    pub fn reordered(&self, order: &[Vec<u32>; 3]) -> Self {
        let place = Kind::ALL.map(|k| {
            let mut place = vec![u32::MAX; self.count(k)];
            order[k.index()]
                .iter()
                .enumerate()
                .for_each(|(new, &old)| place[old as usize] = new as u32);
            assert!(
                order[k.index()].len() == place.len() && !place.contains(&u32::MAX),
                "not a permutation"
            );
            place
        });
        let node = |n: NodeId| NodeId(place[0][n.index()]);
        let mut g = Self::new();
        g.nodes = order[0].iter().map(|&n| self.nodes[n as usize].clone()).collect();
        for &c in &order[1] {
            let mut curve = self.curves[c as usize].clone();
            curve.ends = match curve.ends {
                CurveEnds::Closed => CurveEnds::Closed,
                CurveEnds::One(a) => CurveEnds::One(node(a)),
                CurveEnds::Two(a, b) => CurveEnds::Two(node(a).min(node(b)), node(a).max(node(b))),
            };
            g.curves.push(curve);
        }
        for &s in &order[2] {
            let mut sheet = self.sheets[s as usize].clone();
            sheet
                .curves
                .iter_mut()
                .for_each(|c| *c = CurveId(place[1][c.index()]));
            sheet.curves.sort_unstable();
            g.sheets.push(sheet);
        }
        g.corners = self.corners.clone();
        for c in &mut g.corners {
            (c.sheet, c.node) = (SheetId(place[2][c.sheet.index()]), node(c.node));
        }
        g.corners.sort_by(|a, b| {
            (a.sheet, a.node)
                .cmp(&(b.sheet, b.node))
                .then(a.turn.total_cmp(&b.turn))
        });
        g
    }

    /// Number of attributes of every element of a kind; `None` when there is no element.
    pub fn attribute_count(&self, kind: Kind) -> Option<usize> {
        (self.count(kind) > 0).then(|| self.attributes(kind, 0).len())
    }
}

fn check(
    kind: Kind,
    index: usize,
    weight: f64,
    attributes: &[f64],
    expected: Option<usize>,
) -> Result<(), HypergraphError> {
    if !weight.is_finite() || weight < 0.0 {
        return Err(HypergraphError::BadWeight {
            kind,
            index,
            value: weight,
        });
    }
    if let Some(attribute) = attributes.iter().position(|v| !v.is_finite()) {
        return Err(HypergraphError::BadAttribute {
            kind,
            index,
            attribute,
            value: attributes[attribute],
        });
    }
    match expected {
        Some(expected) if expected != attributes.len() => Err(HypergraphError::AttributeCount {
            kind,
            index,
            expected,
            found: attributes.len(),
        }),
        _ => Ok(()),
    }
}

fn refer(
    kind: Kind,
    index: usize,
    referred_kind: Kind,
    referred: usize,
    count: usize,
) -> Result<(), HypergraphError> {
    if referred < count {
        Ok(())
    } else {
        Err(HypergraphError::UnknownReference {
            kind,
            index,
            referred_kind,
            referred,
            count,
        })
    }
}
