//! Ordinary attributed graphs: one assignment coupled with itself through edges (the quadratic assignment form).
//!
//! In: the edges of two graphs, an affinity for every pair of nodes and for every pair of edges. Out: a
//! [`PairwiseMatch`] that maximises
//!
//! ```text
//! G(M) = sum M_ai A(a, i) + sum over edges e = (a, b), f = (i, j) of  M_ai M_bj B(e, f) + M_aj M_bi B'(e, f)
//! ```
//!
//! with affinities B for edges read forwards and B' for f read backwards (the same for undirected attributes). This is
//! Lawler's form with the pair affinities stored by pairs of edges, `O(m m')` numbers instead of `O(n^2 n'^2)`; a dense
//! problem is the complete graph. Affinities are at least zero, and staying unmatched gains zero.

use super::discrete::best_columns;
use super::multistart::{MatchSettings, maximise};
use super::objective::{Objective, Variable};
use super::starts::StartKind;
use crate::table::Table;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why affinities do not make a problem.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PairwiseError {
    /// An edge names a node that does not exist, or joins a node to itself; give loops as node affinities.
    #[error("{side} edge {edge} joins nodes {a} and {b}; ends must differ and be below {nodes}")]
    BadEdge {
        /// `"target"` or `"source"`.
        side: &'static str,
        /// Position of the edge.
        edge: usize,
        /// First end.
        a: u32,
        /// Second end.
        b: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A table has the wrong size.
    #[error("{name} affinities are {rows} x {cols}, expected {expected_rows} x {expected_cols}")]
    TableSize {
        /// Which table.
        name: &'static str,
        /// Rows found.
        rows: usize,
        /// Columns found.
        cols: usize,
        /// Rows expected.
        expected_rows: usize,
        /// Columns expected.
        expected_cols: usize,
    },
    /// An affinity is negative or not finite (a node affinity may be `-inf`, which forbids the pair).
    #[error("{name} affinity at row {row}, column {col} is {value}; affinities are finite and at least 0")]
    BadAffinity {
        /// Which table.
        name: &'static str,
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        col: usize,
        /// Value found.
        value: f64,
    },
}

/// Two ordinary graphs and the affinities between their nodes and edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairwiseProblem {
    node_affinity: [Table; 1],
    target_edges: Vec<(u32, u32)>,
    source_edges: Vec<(u32, u32)>,
    forward: Table,
    backward: Option<Table>,
    target_incident: Vec<Vec<HalfEdge>>,
    source_incident: Vec<Vec<HalfEdge>>,
}

/// An edge seen from one of its ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct HalfEdge {
    edge: u32,
    other: u32,
    /// Whether this end is the second of the edge.
    reversed: bool,
}

impl PairwiseProblem {
    /// Makes a problem from edge lists and tables.
    ///
    /// `node_affinity` has a row for every target node and a column for every source node, `edge_affinity` the same for
    /// edges; `reversed_edge_affinity` holds B' when reading an edge backwards changes its affinity.
    ///
    /// # Errors
    /// When an edge, a table's size or an affinity is refused.
    pub fn new(
        node_affinity: Table,
        target_edges: Vec<(u32, u32)>,
        source_edges: Vec<(u32, u32)>,
        edge_affinity: Table,
        reversed_edge_affinity: Option<Table>,
    ) -> Result<Self, PairwiseError> {
        let target_incident = incident("target", node_affinity.rows(), &target_edges)?;
        let source_incident = incident("source", node_affinity.cols(), &source_edges)?;
        check_affinities(
            "node",
            &node_affinity,
            node_affinity.rows(),
            node_affinity.cols(),
            true,
        )?;
        let (m, k) = (target_edges.len(), source_edges.len());
        check_affinities("edge", &edge_affinity, m, k, false)?;
        if let Some(b) = &reversed_edge_affinity {
            check_affinities("reversed edge", b, m, k, false)?;
        }
        Ok(Self {
            node_affinity: [node_affinity],
            target_edges,
            source_edges,
            forward: edge_affinity,
            backward: reversed_edge_affinity,
            target_incident,
            source_incident,
        })
    }

    /// Makes a dense problem on complete graphs from functions: `node(a, i)` and `pair(a, b, i, j)` for a < b, i != j.
    ///
    /// # Errors
    /// When an affinity is refused.
    ///
    /// # Complexity
    /// O(n^2 n'^2) calls and numbers.
    pub fn dense(
        target_nodes: usize,
        source_nodes: usize,
        node: impl FnMut(usize, usize) -> f64,
        mut pair: impl FnMut(usize, usize, usize, usize) -> f64,
    ) -> Result<Self, PairwiseError> {
        let complete = |n: usize| -> Vec<(u32, u32)> {
            (0..n as u32)
                .flat_map(|a| (a + 1..n as u32).map(move |b| (a, b)))
                .collect()
        };
        let (te, se) = (complete(target_nodes), complete(source_nodes));
        let at = |edges: &[(u32, u32)], k: usize| (edges[k].0 as usize, edges[k].1 as usize);
        let mut table = |swap: bool| {
            Table::from_fn(te.len(), se.len(), |e, f| {
                let ((a, b), (i, j)) = (at(&te, e), at(&se, f));
                if swap { pair(a, b, j, i) } else { pair(a, b, i, j) }
            })
        };
        let (forward, backward) = (table(false), table(true));
        Self::new(
            Table::from_fn(target_nodes, source_nodes, node),
            te,
            se,
            forward,
            Some(backward),
        )
    }

    /// Number of target nodes.
    pub fn target_nodes(&self) -> usize {
        self.node_affinity[0].rows()
    }

    /// Number of source nodes.
    pub fn source_nodes(&self) -> usize {
        self.node_affinity[0].cols()
    }

    /// Affinities of nodes.
    pub fn node_affinity(&self) -> &Table {
        &self.node_affinity[0]
    }

    /// Affinities of edges read forwards, a row for every target edge.
    pub fn edge_affinity(&self) -> &Table {
        &self.forward
    }

    fn backward(&self) -> &Table {
        self.backward.as_ref().unwrap_or(&self.forward)
    }
}

impl Objective for PairwiseProblem {
    fn linear(&self) -> &[Table] {
        &self.node_affinity
    }

    fn add_couplings(&self, soft: &[Table], out: &mut [Table]) {
        let (soft, out) = (&soft[0], &mut out[0]);
        for (e, &(a, b)) in self.target_edges.iter().enumerate() {
            let (a, b) = (a as usize, b as usize);
            let (forward, backward) = (self.forward.row(e), self.backward().row(e));
            let (soft_a, soft_b) = (soft.row(a), soft.row(b));
            let (out_a, out_b) = two_rows(out, a, b);
            for ((&(i, j), &f), &g) in self.source_edges.iter().zip(forward).zip(backward) {
                let (i, j) = (i as usize, j as usize);
                out_a[i] += f * soft_b[j];
                out_a[j] += g * soft_b[i];
                out_b[j] += f * soft_a[i];
                out_b[i] += g * soft_a[j];
            }
        }
    }

    fn add_variable(&self, v: Variable, factor: f64, out: &mut [Table]) {
        for e in &self.target_incident[v.row] {
            let row = out[0].row_mut(e.other as usize);
            let (forward, backward) = (
                self.forward.row(e.edge as usize),
                self.backward().row(e.edge as usize),
            );
            for f in &self.source_incident[v.col] {
                let table = if e.reversed == f.reversed {
                    forward
                } else {
                    backward
                };
                row[f.other as usize] += factor * table[f.edge as usize];
            }
        }
    }

    fn coupling(&self, a: Variable, b: Variable) -> f64 {
        let mut sum = 0.0;
        for e in self.target_incident[a.row]
            .iter()
            .filter(|e| e.other as usize == b.row)
        {
            for f in self.source_incident[a.col]
                .iter()
                .filter(|f| f.other as usize == b.col)
            {
                let table = if e.reversed == f.reversed {
                    &self.forward
                } else {
                    self.backward()
                };
                sum += table[(e.edge as usize, f.edge as usize)];
            }
        }
        sum
    }

    fn self_coupled(&self, _block: usize) -> bool {
        true
    }
}

/// A match of two ordinary graphs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairwiseMatch {
    /// Source node of every target node in the match of greatest gain.
    pub source_of_target: Vec<Option<usize>>,
    /// Gain of that match.
    pub gain: f64,
    /// Source node of every target node in the most probable match: the assignment of the greatest sum of
    /// confidences, which expects the most right pairs. Where evidence is weak it is right more often.
    pub most_probable: Vec<Option<usize>>,
    /// Mean-field probability of every pair.
    pub confidence: Table,
    /// The start that led here.
    pub start: StartKind,
    /// Gains of all starts' ends, in the order tried.
    pub gains: Vec<f64>,
}

/// Matches two ordinary graphs; hypotheses give the source node of every target node.
///
/// # Complexity
/// A start takes some hundred steps of O(m m') for m and m' edges.
///
/// # Example
/// ```
/// use matchers::Table;
/// use matchers::graduated_assignment::{MatchSettings, PairwiseProblem, match_graphs};
/// // A path 0 - 1 - 2 with edge lengths 1 and 2, against the same path read backwards.
/// let length = [[1.0, 2.0], [2.0, 1.0]];
/// let edge = Table::from_fn(2, 2, |e, f| (-(length[0][e] - length[1][f] as f64).powi(2)).exp());
/// let path = vec![(0, 1), (1, 2)];
/// let problem = PairwiseProblem::new(Table::zeros(3, 3), path.clone(), path, edge, None).unwrap();
/// let found = match_graphs(&problem, &[], &MatchSettings::default());
/// assert_eq!(found.source_of_target, vec![Some(2), Some(1), Some(0)]);
/// ```
pub fn match_graphs(
    problem: &PairwiseProblem,
    hypotheses: &[Vec<Option<usize>>],
    settings: &MatchSettings,
) -> PairwiseMatch {
    let columns: Vec<_> = hypotheses.iter().map(|h| vec![h.clone()]).collect();
    let best = maximise(problem, &columns, settings);
    let confidence = best.soft.into_iter().next().expect("one block");
    PairwiseMatch {
        source_of_target: best.state.col_of_row[0].clone(),
        gain: best.state.gain,
        most_probable: best_columns(&confidence),
        confidence,
        start: best.start,
        gains: best.gains,
    }
}

fn two_rows(table: &mut Table, a: usize, b: usize) -> (&mut [f64], &mut [f64]) {
    let cols = table.cols();
    let values = table.values_mut();
    if a < b {
        let (low, high) = values.split_at_mut(b * cols);
        (&mut low[a * cols..(a + 1) * cols], &mut high[..cols])
    } else {
        let (low, high) = values.split_at_mut(a * cols);
        (&mut high[..cols], &mut low[b * cols..(b + 1) * cols])
    }
}

fn incident(
    side: &'static str,
    nodes: usize,
    edges: &[(u32, u32)],
) -> Result<Vec<Vec<HalfEdge>>, PairwiseError> {
    let mut lists = vec![Vec::new(); nodes];
    for (edge, &(a, b)) in edges.iter().enumerate() {
        if a == b || a as usize >= nodes || b as usize >= nodes {
            return Err(PairwiseError::BadEdge {
                side,
                edge,
                a,
                b,
                nodes,
            });
        }
        lists[a as usize].push(HalfEdge {
            edge: edge as u32,
            other: b,
            reversed: false,
        });
        lists[b as usize].push(HalfEdge {
            edge: edge as u32,
            other: a,
            reversed: true,
        });
    }
    Ok(lists)
}

fn check_affinities(
    name: &'static str,
    table: &Table,
    expected_rows: usize,
    expected_cols: usize,
    may_forbid: bool,
) -> Result<(), PairwiseError> {
    let (rows, cols) = (table.rows(), table.cols());
    if (rows, cols) != (expected_rows, expected_cols) {
        return Err(PairwiseError::TableSize {
            name,
            rows,
            cols,
            expected_rows,
            expected_cols,
        });
    }
    let bad = |v: &f64| !(v.is_finite() && *v >= 0.0 || may_forbid && *v == f64::NEG_INFINITY);
    match table.values().iter().position(bad) {
        Some(k) => Err(PairwiseError::BadAffinity {
            name,
            row: k / cols,
            col: k % cols,
            value: table.values()[k],
        }),
        None => Ok(()),
    }
}
