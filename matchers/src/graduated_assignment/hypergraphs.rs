//! Graduated assignment of two hypergraphs: coupled soft maps of nodes, curves and sheets.
//!
//! In: a [`MatchingProblem`], a [`MatchSettings`], optionally hypotheses. Out: a [`HypergraphMatch`].
//!
//! 1. For every start (uniform, spectral, the hypotheses): anneal, discretise, ascend, local search.
//! 2. Keep the greatest gain; ties go to the earliest start.
//! 3. Report the price in the weights' unit, the similarity `1 - price / total`, and every pair's soft confidence.
//!
//! Cost: a start takes a few hundred gradient steps, each O(I_target I_source) for I incidences.

use super::discrete::Discrete;
use super::multistart::{MatchSettings, Maximum, maximise, polish};
use super::objective::HypergraphObjective;
use super::starts::StartKind;
use crate::canonical::Canonical;
use crate::matching_problem::{ElementMap, MatchingProblem};
use serde::{Deserialize, Serialize};

/// One matched pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MatchedPair {
    /// Target element.
    pub target: u32,
    /// Source element.
    pub source: u32,
    /// Mean-field probability of the pair, in [0, 1]: near 1 when nothing competes.
    pub confidence: f64,
    /// Gain of the pair in the match it is in (its own and its couplings'), in the weights' unit: what the match
    /// would lose without it.
    pub gain: f64,
}

/// A match of two hypergraphs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HypergraphMatch {
    /// Matched nodes, by target.
    pub nodes: Vec<MatchedPair>,
    /// Matched curves, by target.
    pub curves: Vec<MatchedPair>,
    /// Matched sheets, by target.
    pub sheets: Vec<MatchedPair>,
    /// The same as a map.
    pub map: ElementMap,
    /// Price of the match: an upper bound of the edit distance, in the weights' unit.
    pub price: f64,
    /// `1 - price / (price of matching nothing)`: 1 for equal graphs, 0 when nothing matches; 1 when both are empty.
    pub similarity: f64,
    /// The start that led here.
    pub start: StartKind,
    /// Prices of all starts' ends, in the order tried, for judging how ambiguous the match is.
    pub prices: Vec<f64>,
    /// Whether that start's annealing settled.
    pub converged: bool,
}

/// Matches `source` to `target`.
///
/// Works in canonical order ([`crate::canonical`]), so that prices are the same to the bit for either direction and any
/// order of the elements.
///
/// # Complexity
/// About 25 temperatures of at most 4 steps a start; a step is O(I I' + n n') for I incidences and n elements.
///
/// # Example
/// ```
/// use matchers::graduated_assignment::{MatchSettings, match_hypergraphs};
/// use matchers::matching_problem::AttributeScales;
/// use matchers::*;
/// let mut g = AttributedHypergraph::new();
/// let a = g.add_node(1.0, vec![2.0]).unwrap();
/// let b = g.add_node(1.0, vec![5.0]).unwrap();
/// g.add_curve(CurveEnds::Two(a, b), 3.0, vec![10.0]).unwrap();
/// let scales = AttributeScales { nodes: vec![0.5], curves: vec![0.1], sheets: vec![] };
/// let costs = ElementCosts::from_attributes(&g, &g, &scales).unwrap();
/// let problem = MatchingProblem::new(&g, &g, &costs, &EvidenceSettings::default()).unwrap();
/// let found = match_hypergraphs(&problem, &[], &MatchSettings::default());
/// assert_eq!(found.price, 0.0);
/// assert_eq!((found.nodes[1].target, found.nodes[1].source), (1, 1));
/// ```
pub fn match_hypergraphs(
    problem: &MatchingProblem,
    hypotheses: &[ElementMap],
    settings: &MatchSettings,
) -> HypergraphMatch {
    let canonical = Canonical::new(problem);
    let inner: Vec<ElementMap> = hypotheses.iter().map(|h| canonical.import(h)).collect();
    let found = match_as_stored(&canonical.problem, &inner, settings);
    let carried = |kind: usize, pairs: Vec<MatchedPair>| -> Vec<MatchedPair> {
        let mut out: Vec<MatchedPair> = pairs
            .into_iter()
            .map(|p| {
                let (target, source) = canonical.export_pair(kind, p.target, p.source);
                MatchedPair { target, source, ..p }
            })
            .collect();
        out.sort_by_key(|p| p.target);
        out
    };
    HypergraphMatch {
        nodes: carried(0, found.nodes),
        curves: carried(1, found.curves),
        sheets: carried(2, found.sheets),
        map: canonical.export(&found.map),
        ..found
    }
}

/// The same without canonical order: ties and rounding depend on the order of the elements.
pub(crate) fn match_as_stored(
    problem: &MatchingProblem,
    hypotheses: &[ElementMap],
    settings: &MatchSettings,
) -> HypergraphMatch {
    let objective = HypergraphObjective::new(problem);
    let columns: Vec<_> = hypotheses.iter().map(columns_of).collect();
    report(problem, maximise(&objective, &columns, settings))
}

/// A map polished by block ascent and local search: never dearer than it was.
pub(crate) fn polished(problem: &MatchingProblem, map: &ElementMap, settings: &MatchSettings) -> ElementMap {
    let objective = HypergraphObjective::new(problem);
    map_of(&polish(
        &objective,
        Discrete::from_columns(&objective, &columns_of(map)),
        settings,
    ))
}

fn columns_of(map: &ElementMap) -> Vec<Vec<Option<usize>>> {
    map.source_of_target
        .iter()
        .map(|m| m.iter().map(|y| y.map(|y| y as usize)).collect())
        .collect()
}

fn map_of(state: &Discrete) -> ElementMap {
    let list = |k: usize| state.col_of_row[k].iter().map(|c| c.map(|c| c as u32)).collect();
    ElementMap {
        source_of_target: [list(0), list(1), list(2)],
    }
}

fn report(problem: &MatchingProblem, best: Maximum) -> HypergraphMatch {
    let map = map_of(&best.state);
    let pairs = |kind: usize| -> Vec<MatchedPair> {
        let matched = map.source_of_target[kind].iter().enumerate();
        matched
            .filter_map(|(x, y)| {
                let y = (*y)?;
                let place = (x, y as usize);
                let confidence = best.soft[kind][place].clamp(0.0, 1.0);
                let gain = best.state.gradient[kind][place];
                Some(MatchedPair {
                    target: x as u32,
                    source: y,
                    confidence,
                    gain,
                })
            })
            .collect()
    };
    let total = problem.total();
    let price = problem.price(&map);
    HypergraphMatch {
        nodes: pairs(0),
        curves: pairs(1),
        sheets: pairs(2),
        price,
        similarity: if total > 0.0 { 1.0 - price / total } else { 1.0 },
        start: best.start,
        prices: best.gains.iter().map(|g| total - g).collect(),
        converged: best.converged,
        map,
    }
}
