//! Two hypergraphs and their costs as one objective: the price of turning the target into the source.
//!
//! In: two hypergraphs, [`ElementCosts`] (what it costs to deform one element into another) and
//! [`EvidenceSettings`] (how much incidences count). Out: a [`MatchingProblem`], which both the graduated assignment
//! and the edit distance work on, so that they mean the same thing by "better".
//!
//! A match M is a partial one-to-one map of nodes to nodes, curves to curves, sheets to sheets. Its price is
//!
//! ```text
//! E(M) = sum over matched pairs   c(x, y)                               deform
//!      + sum over unmatched x, y  w(x)                                  splice
//!      + sum over incidences      | q(x, z) - q(M x, M z) |             incidences that change
//! ```
//!
//! where the sums take both graphs, `q` is the strength of an incidence, zero for pairs that are not incident, and
//! the image of an unmatched element is incident to nothing. There are three kinds of incidences, each a
//! real-valued table: curve ends at nodes, curves bounding sheets, and sheets turning at nodes (corners):
//!
//! ```text
//! q(node, curve)  = node_curve  * multiplicity * min(w(node), w(curve))
//! q(curve, sheet) = curve_sheet * multiplicity * min(w(curve), w(sheet))
//! q(node, sheet)  = corner      * turn         * min(w(node), w(sheet))
//! ```
//!
//! An incidence is thus worth at most what its weaker element is worth: the cost of an element near the cut goes to
//! zero together with all its incidences. If `c` obeys the triangle inequality and `|w(x) - w(y)| <= c(x, y)`
//! (what [`ElementCosts::from_attributes`] makes sure of), then `min E` is a pseudo-metric: compose the two maps, and
//! every term of the composition is bounded by the two terms it came from.
//!
//! Written with `| q - r | = q + r - 2 min(q, r)`, the price is a constant minus a gain with no negative coupling:
//!
//! ```text
//! E(M) = W - G(M),   G = sum M_xy (w_x + w_y - c_xy) + sum M_xy M_zt 2 min(q_xz, q_yt)
//! ```
//!
//! G is the objective of graduated assignment (Gold & Rangarajan 1996) with the slack at exactly zero. It is
//! linear in the curves once nodes and sheets are fixed, which the solvers use. Corner terms
//! follow Chang & Kimia (2009, "Measuring 3D shape similarity by matching the medial scaffolds"), where they are
//! third-order; as a node-sheet incidence they stay second-order and keep the curves independent of each other.

use crate::hypergraph::{AttributedHypergraph, Kind};
use crate::table::Table;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How much incidences count beside the elements themselves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EvidenceSettings {
    /// Strength of a curve end at a node, in units of the weaker weight. The default 0.5 makes the two ends of a
    /// curve together worth as much as the curve.
    pub node_curve: f64,
    /// Strength of a curve on a sheet, in units of the weaker weight. The default 0.5 makes the two sides of a slit
    /// worth as much as the curve.
    pub curve_sheet: f64,
    /// Strength of a corner whose turn is 1, in units of the weaker weight. The default 0.25 keeps corners, which the
    /// ends and boundaries mostly imply, below both.
    pub corner: f64,
}

impl Default for EvidenceSettings {
    fn default() -> Self {
        Self {
            node_curve: 0.5,
            curve_sheet: 0.5,
            corner: 0.25,
        }
    }
}

/// Why two hypergraphs and costs do not make a problem.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ProblemError {
    /// A cost table does not have a row for every target element and a column for every source element.
    #[error("{kind} costs are {rows} x {cols}, but the target has {target} and the source {source_count}")]
    CostSize {
        /// Kind of the elements.
        kind: Kind,
        /// Rows found.
        rows: usize,
        /// Columns found.
        cols: usize,
        /// Target elements.
        target: usize,
        /// Source elements.
        source_count: usize,
    },
    /// A cost is negative or NaN; costs are at least 0, `+inf` forbids the pair.
    #[error("{kind} cost of target {row} and source {col} is {value}; costs are at least 0, or +inf")]
    BadCost {
        /// Kind of the elements.
        kind: Kind,
        /// Target element.
        row: usize,
        /// Source element.
        col: usize,
        /// Cost found.
        value: f64,
    },
    /// Attributes cannot be compared: the counts differ between the graphs, or from the scales given.
    #[error("{kind} attributes: target has {target}, source has {source_count}, scales given for {scales}")]
    AttributeCount {
        /// Kind of the elements.
        kind: Kind,
        /// Attributes of target elements.
        target: usize,
        /// Attributes of source elements.
        source_count: usize,
        /// Scales given.
        scales: usize,
    },
    /// An incidence strength or attribute scale is negative or not finite.
    #[error("setting {name} is {value}; it must be a finite number of at least 0")]
    BadSetting {
        /// Name of the setting.
        name: &'static str,
        /// Value found.
        value: f64,
    },
}

/// Price of one unit of difference of every attribute, per kind.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AttributeScales {
    /// One price per node attribute.
    pub nodes: Vec<f64>,
    /// One price per curve attribute.
    pub curves: Vec<f64>,
    /// One price per sheet attribute.
    pub sheets: Vec<f64>,
}

impl AttributeScales {
    /// The prices of a kind.
    pub fn of(&self, kind: Kind) -> &[f64] {
        match kind {
            Kind::Node => &self.nodes,
            Kind::Curve => &self.curves,
            Kind::Sheet => &self.sheets,
        }
    }
}

/// What it costs to deform an element of the target into one of the source, in the unit of the weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ElementCosts {
    /// Node costs, target rows, source columns; `+inf` forbids.
    pub nodes: Table,
    /// Curve costs.
    pub curves: Table,
    /// Sheet costs.
    pub sheets: Table,
}

impl ElementCosts {
    /// The table of a kind.
    pub fn of(&self, kind: Kind) -> &Table {
        match kind {
            Kind::Node => &self.nodes,
            Kind::Curve => &self.curves,
            Kind::Sheet => &self.sheets,
        }
    }

    /// The costs with target and source exchanged.
    pub fn transposed(&self) -> Self {
        Self {
            nodes: self.nodes.transposed(),
            curves: self.curves.transposed(),
            sheets: self.sheets.transposed(),
        }
    }

    /// Costs `max(|w - w'|, sum_k scale_k |a_k - a'_k|)`: a metric that respects the weights.
    ///
    /// # Errors
    /// When attribute counts do not agree or a scale is negative or not finite.
    pub fn from_attributes(
        target: &AttributedHypergraph,
        source: &AttributedHypergraph,
        scales: &AttributeScales,
    ) -> Result<Self, ProblemError> {
        Ok(Self {
            nodes: attribute_costs(Kind::Node, target, source, scales)?,
            curves: attribute_costs(Kind::Curve, target, source, scales)?,
            sheets: attribute_costs(Kind::Sheet, target, source, scales)?,
        })
    }
}

fn attribute_costs(
    kind: Kind,
    target: &AttributedHypergraph,
    source: &AttributedHypergraph,
    scales: &AttributeScales,
) -> Result<Table, ProblemError> {
    let scale = scales.of(kind);
    if let Some(&value) = scale.iter().find(|s| !s.is_finite() || **s < 0.0) {
        return Err(ProblemError::BadSetting {
            name: "attribute scale",
            value,
        });
    }
    let counts = [target.attribute_count(kind), source.attribute_count(kind)];
    if counts.iter().flatten().any(|&c| c != scale.len()) {
        let [t, s] = counts.map(|c| c.unwrap_or(scale.len()));
        return Err(ProblemError::AttributeCount {
            kind,
            target: t,
            source_count: s,
            scales: scale.len(),
        });
    }
    let (w_target, w_source) = (target.weights(kind), source.weights(kind));
    Ok(Table::from_fn(target.count(kind), source.count(kind), |r, c| {
        let pairs = target.attributes(kind, r).iter().zip(source.attributes(kind, c));
        let difference: f64 = pairs.zip(scale).map(|((a, b), s)| s * (a - b).abs()).sum();
        difference.max((w_target[r] - w_source[c]).abs())
    }))
}

/// The pairs of kinds that have incidences: node-curve, curve-sheet, node-sheet (corners).
pub const INCIDENCE_KINDS: [(usize, usize); 3] = [(0, 1), (1, 2), (0, 2)];

/// One neighbour in an incidence list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Incident {
    /// Element at the other end.
    pub element: u32,
    /// Strength of the incidence.
    pub strength: f64,
}

/// Incidences between two kinds, from both ends, each list ordered by element.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Incidences {
    /// For every element of the first kind, its neighbours of the second kind.
    pub forward: Vec<Vec<Incident>>,
    /// For every element of the second kind, its neighbours of the first kind.
    pub backward: Vec<Vec<Incident>>,
}

impl Incidences {
    fn from_triples(first: usize, second: usize, mut triples: Vec<(u32, u32, f64)>) -> Self {
        triples.sort_by_key(|t| (t.0, t.1));
        let mut s = Self {
            forward: vec![Vec::new(); first],
            backward: vec![Vec::new(); second],
        };
        let mut k = 0;
        while k < triples.len() {
            let (a, b, _) = triples[k];
            let mut strength = 0.0;
            while k < triples.len() && (triples[k].0, triples[k].1) == (a, b) {
                strength += triples[k].2;
                k += 1;
            }
            if strength > 0.0 {
                s.forward[a as usize].push(Incident { element: b, strength });
                s.backward[b as usize].push(Incident { element: a, strength });
            }
        }
        for list in &mut s.backward {
            list.sort_by_key(|i| i.element);
        }
        s
    }

    /// Strength of the incidence of two elements, zero when they are not incident.
    pub fn strength(&self, first: usize, second: usize) -> f64 {
        let list = &self.forward[first];
        list.binary_search_by_key(&(second as u32), |i| i.element)
            .map_or(0.0, |k| list[k].strength)
    }

    /// Sum of all strengths.
    pub fn total(&self) -> f64 {
        self.forward.iter().flatten().map(|i| i.strength).sum()
    }
}

/// One graph as the solvers see it: weights and incidences, no attributes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Side {
    /// Weights of nodes, curves, sheets.
    pub weights: [Vec<f64>; 3],
    /// Incidences for the pairs of [`INCIDENCE_KINDS`].
    pub incidences: [Incidences; 3],
}

impl Side {
    /// Reads weights and incidence strengths off a hypergraph.
    pub fn new(g: &AttributedHypergraph, evidence: &EvidenceSettings) -> Self {
        let weights = Kind::ALL.map(|k| g.weights(k));
        let weaker = |p: usize, a: u32, q: usize, b: u32| weights[p][a as usize].min(weights[q][b as usize]);
        let mut ends = Vec::new();
        for (c, curve) in g.curves().iter().enumerate() {
            for node in curve.ends.nodes() {
                ends.push((
                    node.0,
                    c as u32,
                    evidence.node_curve * weaker(0, node.0, 1, c as u32),
                ));
            }
        }
        let mut bounds = Vec::new();
        for (s, sheet) in g.sheets().iter().enumerate() {
            for curve in &sheet.curves {
                bounds.push((
                    curve.0,
                    s as u32,
                    evidence.curve_sheet * weaker(1, curve.0, 2, s as u32),
                ));
            }
        }
        let mut corners = Vec::new();
        for corner in g.corners() {
            let (n, s) = (corner.node.0, corner.sheet.0);
            corners.push((n, s, evidence.corner * corner.turn * weaker(0, n, 2, s)));
        }
        let [n, c, s] = Kind::ALL.map(|k| g.count(k));
        let incidences = [
            Incidences::from_triples(n, c, ends),
            Incidences::from_triples(c, s, bounds),
            Incidences::from_triples(n, s, corners),
        ];
        Self { weights, incidences }
    }

    /// Number of elements of a kind.
    pub fn count(&self, kind: usize) -> usize {
        self.weights[kind].len()
    }

    /// Price of deleting everything: all weights and all incidences.
    pub fn total(&self) -> f64 {
        self.weights.iter().flatten().sum::<f64>()
            + self.incidences.iter().map(Incidences::total).sum::<f64>()
    }
}

/// A partial one-to-one map of the three kinds, by position: the source element of every target element.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ElementMap {
    /// Source element of every target element, for nodes, curves, sheets.
    pub source_of_target: [Vec<Option<u32>>; 3],
}

impl ElementMap {
    /// The map that matches nothing.
    pub fn empty(problem: &MatchingProblem) -> Self {
        Self {
            source_of_target: [0, 1, 2].map(|k| vec![None; problem.target.count(k)]),
        }
    }

    /// The target element of every source element of a kind.
    pub fn target_of_source(&self, kind: usize, source_count: usize) -> Vec<Option<u32>> {
        let mut back = vec![None; source_count];
        for (x, y) in self.source_of_target[kind].iter().enumerate() {
            if let Some(y) = y {
                back[*y as usize] = Some(x as u32);
            }
        }
        back
    }

    /// The map from source to target.
    pub fn inverse(&self, source_counts: [usize; 3]) -> Self {
        Self {
            source_of_target: [0, 1, 2].map(|k| self.target_of_source(k, source_counts[k])),
        }
    }
}

/// Two hypergraphs and the costs between their elements; see the module documentation for the objective.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchingProblem {
    /// The target.
    pub target: Side,
    /// The source.
    pub source: Side,
    /// Deformation costs of nodes, curves, sheets; target rows, source columns.
    pub costs: [Table; 3],
}

impl MatchingProblem {
    /// Makes the problem of matching `source` to `target`.
    ///
    /// # Errors
    /// When a table does not fit the graphs or a number is out of range.
    pub fn new(
        target: &AttributedHypergraph,
        source: &AttributedHypergraph,
        costs: &ElementCosts,
        evidence: &EvidenceSettings,
    ) -> Result<Self, ProblemError> {
        for (name, value) in [
            ("node_curve", evidence.node_curve),
            ("curve_sheet", evidence.curve_sheet),
            ("corner", evidence.corner),
        ] {
            if !value.is_finite() || value < 0.0 {
                return Err(ProblemError::BadSetting { name, value });
            }
        }
        for kind in Kind::ALL {
            check_costs(kind, costs.of(kind), target.count(kind), source.count(kind))?;
        }
        Ok(Self {
            target: Side::new(target, evidence),
            source: Side::new(source, evidence),
            costs: Kind::ALL.map(|k| costs.of(k).clone()),
        })
    }

    /// Price of the map that matches nothing; every map's price is this minus its gain.
    pub fn total(&self) -> f64 {
        self.target.total() + self.source.total()
    }

    /// Gain of a pair by itself: `w_x + w_y - c_xy`; `-inf` when the pair is forbidden.
    pub fn pair_gain(&self, kind: usize, x: usize, y: usize) -> f64 {
        self.target.weights[kind][x] + self.source.weights[kind][y] - self.costs[kind][(x, y)]
    }

    /// Price of a map, summed term by term from the definition (not through the gain).
    ///
    /// # Complexity
    /// O(elements + incidences * log degree).
    pub fn price(&self, map: &ElementMap) -> f64 {
        let mut price = 0.0;
        let back = [0, 1, 2].map(|k| map.target_of_source(k, self.source.count(k)));
        for kind in 0..3 {
            for (x, y) in map.source_of_target[kind].iter().enumerate() {
                price += match y {
                    Some(y) => self.costs[kind][(x, *y as usize)],
                    None => self.target.weights[kind][x],
                };
            }
            for (y, x) in back[kind].iter().enumerate() {
                if x.is_none() {
                    price += self.source.weights[kind][y];
                }
            }
        }
        for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
            for (x, list) in self.target.incidences[pair].forward.iter().enumerate() {
                for i in list {
                    let image = (
                        map.source_of_target[p][x],
                        map.source_of_target[q][i.element as usize],
                    );
                    price += match image {
                        (Some(y), Some(t)) => {
                            (i.strength - self.source.incidences[pair].strength(y as usize, t as usize)).abs()
                        }
                        _ => i.strength,
                    };
                }
            }
            // Source incidences whose preimage is incident were counted above.
            for (y, list) in self.source.incidences[pair].forward.iter().enumerate() {
                for i in list {
                    let counted = match (back[p][y], back[q][i.element as usize]) {
                        (Some(x), Some(z)) => {
                            self.target.incidences[pair].strength(x as usize, z as usize) > 0.0
                        }
                        _ => false,
                    };
                    if !counted {
                        price += i.strength;
                    }
                }
            }
        }
        price
    }

    /// The problem with target and source exchanged.
    pub fn transposed(&self) -> Self {
        Self {
            target: self.source.clone(),
            source: self.target.clone(),
            costs: [0, 1, 2].map(|k| self.costs[k].transposed()),
        }
    }
}

fn check_costs(kind: Kind, table: &Table, target: usize, source_count: usize) -> Result<(), ProblemError> {
    if (table.rows(), table.cols()) != (target, source_count) {
        let (rows, cols) = (table.rows(), table.cols());
        return Err(ProblemError::CostSize {
            kind,
            rows,
            cols,
            target,
            source_count,
        });
    }
    match table.values().iter().position(|v| v.is_nan() || *v < 0.0) {
        Some(k) => Err(ProblemError::BadCost {
            kind,
            row: k / source_count,
            col: k % source_count,
            value: table.values()[k],
        }),
        None => Ok(()),
    }
}
