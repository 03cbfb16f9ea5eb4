//! The front door: distance, bounds and path.
//!
//! In: two hypergraphs, [`GroupCosts`], an [`EditSettings`]. Out: an [`EditDistance`].
//!
//! 1. Without heals: graduated assignment gives an upper bound, the branch bound a lower one, and branch and bound closes
//!    the gap while the graphs are small and the limit lasts.
//! 2. Heals that lower the price are added, the most useful first; every one is judged by carrying the map over and
//!    polishing it.
//! 3. Small graphs: branch and bound over maps and heals together (`healed_search`).
//! 4. The path is written for the cheapest map found.
//!
//! For larger graphs step 3 only bounds, without branching.
//! All of it works on the graphs in canonical order, so that the answer is the same to the bit for either direction and any
//! order of the elements (elements that their surroundings cannot tell apart excepted).

use super::branch_and_bound::{self, RELATIVE_TOLERANCE, SearchResult};
use super::costs::{CanonicalCosts, GroupCosts};
use super::healed_search::{self, Question};
use super::healing::{self, Heal, Healed};
use super::operations::{Operation, edit_path};
use crate::canonical::Canonical;
use crate::graduated_assignment::MatchSettings;
use crate::graduated_assignment::hypergraphs::{match_as_stored, polished};
use crate::hypergraph::{AttributedHypergraph, Kind};
use crate::matching_problem::{
    ElementCosts, ElementMap, EvidenceSettings, MatchingProblem, ProblemError, Side,
};
use crate::table::Table;
use serde::{Deserialize, Serialize};

/// How to measure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EditSettings {
    /// Strengths of incidences.
    pub evidence: EvidenceSettings,
    /// Allow contractions.
    pub contract: bool,
    /// Allow merges.
    pub merge: bool,
    /// Largest number of nodes and of sheets of either graph for which the distance is proven.
    pub exact_up_to: usize,
    /// Most search nodes over all branch and bounds. Between two hypergraphs of 12 nodes, 18 curves and 6 sheets one takes 0.1 to
    /// 1 ms. 100 000: all pairs of graphs of up to 4 nodes are proven with contractions and merges, the complete graph against
    /// itself, attributed, with 80 388.
    pub max_search_nodes: usize,
    /// Most heals judged in one round of step 2, cheapest first.
    pub max_heals_tried: usize,
    /// How the first map is found.
    pub matching: MatchSettings,
}

impl Default for EditSettings {
    fn default() -> Self {
        Self {
            evidence: EvidenceSettings::default(),
            contract: true,
            merge: true,
            exact_up_to: 12,
            max_search_nodes: 100_000,
            max_heals_tried: 48,
            matching: MatchSettings::default(),
        }
    }
}

/// How far apart two hypergraphs are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EditDistance {
    /// No edit path is cheaper, in the weights' unit.
    pub lower_bound: f64,
    /// Price of the path given: the distance when `exact`.
    pub upper_bound: f64,
    /// Whether the path is proven cheapest (to 1e-10 of the price of removing everything).
    pub exact: bool,
    /// `1 - upper_bound / (price of removing everything)`; 1 when both graphs are empty.
    pub similarity: f64,
    /// The path: heals, splices, deformations; the prices add up to `upper_bound`.
    pub operations: Vec<Operation>,
    /// Search nodes visited over all branch and bounds.
    pub search_nodes: usize,
    /// Sets of heals looked at.
    pub heal_sets: usize,
}

/// Measures the edit distance.
///
/// # Errors
/// When costs or settings are out of range.
///
/// # Complexity
/// Exponential in the number of nodes and sheets in the worst case, bounded by the limits in the settings.
///
/// # Example
/// ```
/// use matchers::edit_distance::{EditSettings, edit_distance};
/// use matchers::matching_problem::AttributeScales;
/// use matchers::{AttributedHypergraph, CurveEnds, ElementCosts};
/// let sheet = |area: f64| {
///     let mut g = AttributedHypergraph::new();
///     let rib = g.add_curve(CurveEnds::Closed, 3.0, vec![]).unwrap();
///     g.add_sheet(vec![rib], 3.0, vec![area]).unwrap();
///     g
/// };
/// let (g, h) = (sheet(100.0), sheet(112.0));
/// let scales = AttributeScales { sheets: vec![0.1], ..Default::default() };
/// let costs = ElementCosts::from_attributes(&g, &h, &scales).unwrap();
/// let d = edit_distance(&g, &h, &costs, &EditSettings::default()).unwrap();
/// assert!(d.exact);
/// assert!((d.upper_bound - 1.2).abs() < 1e-12); // 12 units of area at 0.1
/// ```
pub fn edit_distance(
    target: &AttributedHypergraph,
    source: &AttributedHypergraph,
    costs: &dyn GroupCosts,
    settings: &EditSettings,
) -> Result<EditDistance, ProblemError> {
    let given = problem_of(
        (&healing::unhealed(target), &healing::unhealed(source)),
        costs,
        &settings.evidence,
    )?;
    let canonical = Canonical::new(&given);
    let costs = CanonicalCosts {
        costs,
        canonical: &canonical,
    };
    let (target, source) = (
        target.reordered(&canonical.target_order),
        source.reordered(&canonical.source_order),
    );
    let (first, second) = if canonical.exchanged {
        (&source, &target)
    } else {
        (&target, &source)
    };
    let mut distance = canonical_distance(&Model::new(first, second, &costs, settings))?;
    distance.operations = distance
        .operations
        .into_iter()
        .map(|o| o.carried(&canonical))
        .collect();
    Ok(distance)
}

/// One part in this many of the search nodes may go into every start.
const START_SHARE: usize = 20;

fn canonical_distance(model: &Model) -> Result<EditDistance, ProblemError> {
    let settings = model.settings;
    let healing = settings.contract || settings.merge;
    // With heals the map without them is only a start.
    let share = if healing { START_SHARE } else { 1 };
    let mut best = model
        .solve(&Heals::default(), settings.max_search_nodes / share)?
        .expect("no heals do not contradict each other");
    let mut proof = Proof {
        heal_sets: 1,
        search_nodes: best.found.search_nodes,
        open: best.found.lower_bound,
    };
    if healing {
        model.heal_greedily(&mut best, &mut proof)?;
        model.prove(&mut best, &mut proof)?;
    }
    let exact = proof.open >= best.price - model.tolerance;
    let problem = model.problem(&best.target, &best.source)?;
    let operations = edit_path(
        &problem,
        &best.found.map,
        (&best.target, &best.heals.target),
        (&best.source, &best.heals.source),
    );
    let total = model.total;
    Ok(EditDistance {
        lower_bound: if exact {
            best.price
        } else {
            proof.open.clamp(0.0, best.price)
        },
        upper_bound: best.price,
        exact,
        similarity: if total > 0.0 {
            1.0 - best.price / total
        } else {
            1.0
        },
        operations,
        search_nodes: proof.search_nodes,
        heal_sets: proof.heal_sets,
    })
}

/// Heals applied to either side, each list cheapest first.
#[derive(Debug, Clone, Default)]
struct Heals {
    target: Vec<Heal>,
    source: Vec<Heal>,
}

/// A set of heals and the cheapest map found for it.
struct Solution {
    heals: Heals,
    target: Healed,
    source: Healed,
    found: SearchResult,
    /// Price of the heals and the map.
    price: f64,
}

/// What the proof has spent, and the least lower bound of what it left open.
struct Proof {
    heal_sets: usize,
    search_nodes: usize,
    open: f64,
}

/// A heal that may be applied, and to which side.
#[derive(Clone)]
struct Candidate {
    on_target: bool,
    heal: Heal,
}

struct Model<'a> {
    target: &'a AttributedHypergraph,
    source: &'a AttributedHypergraph,
    costs: &'a dyn GroupCosts,
    settings: &'a EditSettings,
    /// All heals of both sides, cheapest first.
    candidates: Vec<Candidate>,
    total: f64,
    tolerance: f64,
}

impl<'a> Model<'a> {
    fn new(
        target: &'a AttributedHypergraph,
        source: &'a AttributedHypergraph,
        costs: &'a dyn GroupCosts,
        settings: &'a EditSettings,
    ) -> Self {
        let sides = [target, source].map(|g| Side::new(g, &settings.evidence));
        let mut candidates = Vec::new();
        for (side, on_target) in [(0, true), (1, false)] {
            let g = [target, source][side];
            let list = healing::candidates(g, &sides[side], settings.contract, settings.merge);
            candidates.extend(list.into_iter().map(|heal| Candidate { on_target, heal }));
        }
        candidates.sort_by(|a, b| a.heal.price.total_cmp(&b.heal.price));
        let total = sides[0].total() + sides[1].total();
        let tolerance = RELATIVE_TOLERANCE * total;
        Self {
            target,
            source,
            costs,
            settings,
            candidates,
            total,
            tolerance,
        }
    }

    /// Whether the distance is to be proven.
    fn small(&self) -> bool {
        let most = self.settings.exact_up_to;
        [self.target, self.source]
            .iter()
            .all(|g| g.nodes().len() <= most && g.sheets().len() <= most)
    }

    fn problem(&self, target: &Healed, source: &Healed) -> Result<MatchingProblem, ProblemError> {
        problem_of((target, source), self.costs, &self.settings.evidence)
    }

    fn apply(&self, heals: &Heals) -> Option<(Healed, Healed)> {
        Some((
            healing::apply(self.target, &heals.target)?,
            healing::apply(self.source, &heals.source)?,
        ))
    }

    /// The cheapest map for a set of heals, proven when the graphs are small. `None` when heals contradict each other.
    fn solve(&self, heals: &Heals, max_search_nodes: usize) -> Result<Option<Solution>, ProblemError> {
        let Some((target, source)) = self.apply(heals) else {
            return Ok(None);
        };
        let problem = self.problem(&target, &source)?;
        let first = match_as_stored(&problem, &[], &self.settings.matching);
        let found = if self.small() {
            branch_and_bound::search(&problem, &first.map, max_search_nodes)
        } else {
            let lower_bound = branch_and_bound::root_lower_bound(&problem).min(first.price);
            let exact = lower_bound >= first.price - self.tolerance;
            SearchResult {
                upper_bound: first.price,
                lower_bound,
                exact,
                map: first.map,
                search_nodes: 0,
            }
        };
        let price = target.price + source.price + found.upper_bound;
        Ok(Some(Solution {
            heals: heals.clone(),
            target,
            source,
            found,
            price,
        }))
    }

    /// The map of a solution carried to one more heal and polished: an upper bound, at a fraction of [`Self::solve`].
    fn carried(&self, from: &Solution, candidate: &Candidate) -> Result<Option<Solution>, ProblemError> {
        let heals = self.with(&from.heals, candidate);
        let Some((target, source)) = self.apply(&heals) else {
            return Ok(None);
        };
        let problem = self.problem(&target, &source)?;
        let mut map = ElementMap::empty(&problem);
        for k in 0..3 {
            let place = |parts: &[Vec<u32>], count: usize| {
                let mut at = vec![None; count];
                for (new, list) in parts.iter().enumerate() {
                    list.iter().for_each(|&x| at[x as usize] = Some(new as u32));
                }
                at
            };
            let kind = Kind::ALL[k];
            let target_place = place(&target.parts[k], self.target.count(kind));
            let source_place = place(&source.parts[k], self.source.count(kind));
            for (x, y) in from.found.map.source_of_target[k].iter().enumerate() {
                let Some(y) = *y else { continue };
                let (x, y) = (from.target.parts[k][x][0], from.source.parts[k][y as usize][0]);
                if let (Some(x), Some(y)) = (target_place[x as usize], source_place[y as usize])
                    && map.source_of_target[k][x as usize].is_none()
                {
                    map.source_of_target[k][x as usize] = Some(y);
                }
            }
        }
        let map = polished(&problem, &map, &self.settings.matching);
        let upper_bound = problem.price(&map);
        let price = target.price + source.price + upper_bound;
        let found = SearchResult {
            upper_bound,
            lower_bound: 0.0,
            exact: false,
            map,
            search_nodes: 0,
        };
        Ok(Some(Solution {
            heals,
            target,
            source,
            found,
            price,
        }))
    }

    /// Search nodes that are left to spend.
    fn left(&self, proof: &Proof) -> usize {
        self.settings.max_search_nodes.saturating_sub(proof.search_nodes)
    }

    fn with(&self, heals: &Heals, candidate: &Candidate) -> Heals {
        let mut more = heals.clone();
        let list = if candidate.on_target {
            &mut more.target
        } else {
            &mut more.source
        };
        list.push(candidate.heal.clone());
        list.sort_by(|a, b| a.price.total_cmp(&b.price));
        more
    }

    /// Adds heals that lower the price, those that lower it most first, until none does.
    fn heal_greedily(&self, best: &mut Solution, proof: &mut Proof) -> Result<(), ProblemError> {
        loop {
            let mut useful = Vec::new();
            let affordable = self.candidates.iter().take_while(|c| c.heal.price < best.price);
            for candidate in affordable.take(self.settings.max_heals_tried) {
                proof.heal_sets += 1;
                if let Some(next) = self.carried(best, candidate)?
                    && next.price < best.price - self.tolerance
                {
                    useful.push((next.price, candidate));
                }
            }
            if useful.is_empty() {
                return Ok(());
            }
            useful.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, candidate) in useful {
                if let Some(next) = self.carried(best, candidate)?
                    && next.price < best.price - self.tolerance
                {
                    *best = next;
                }
            }
            proof.heal_sets += 1;
            let limit = self.left(proof) / START_SHARE;
            if let Some(anew) = self.solve(&best.heals, limit)? {
                proof.search_nodes += anew.found.search_nodes;
                if anew.price < best.price {
                    *best = anew;
                }
            }
        }
    }

    /// Searches over maps and heals together, or only bounds when the graphs are large.
    fn prove(&self, best: &mut Solution, proof: &mut Proof) -> Result<(), ProblemError> {
        let of = |on_target: bool| -> Vec<Heal> {
            let list = self.candidates.iter().filter(|c| c.on_target == on_target);
            list.map(|c| c.heal.clone()).collect()
        };
        let question = Question {
            target: self.target,
            source: self.source,
            costs: self.costs,
            evidence: &self.settings.evidence,
            heals: [of(true), of(false)],
        };
        let limit = if self.small() { self.left(proof) } else { 0 };
        let outcome = healed_search::search(&question, best.price, self.tolerance, limit)?;
        proof.search_nodes += outcome.search_nodes;
        proof.heal_sets += outcome.heal_sets;
        proof.open = outcome.open;
        if let Some(better) = outcome.better {
            let [target, source] = better.healed;
            let [target_heals, source_heals] = better.heals;
            *best = Solution {
                heals: Heals {
                    target: target_heals,
                    source: source_heals,
                },
                price: better.price,
                found: SearchResult {
                    upper_bound: better.price - target.price - source.price,
                    lower_bound: 0.0,
                    exact: false,
                    map: better.map,
                    search_nodes: 0,
                },
                target,
                source,
            };
        }
        Ok(())
    }
}

/// The problem of two healed hypergraphs.
pub(super) fn problem_of(
    (target, source): (&Healed, &Healed),
    costs: &dyn GroupCosts,
    evidence: &EvidenceSettings,
) -> Result<MatchingProblem, ProblemError> {
    let table = |kind: Kind| {
        let k = kind.index();
        let (t, s) = (&target.parts[k], &source.parts[k]);
        Table::from_fn(t.len(), s.len(), |r, c| {
            if target.cleared[k][r] || source.cleared[k][c] {
                f64::INFINITY
            } else {
                costs.cost(kind, &t[r], &s[c])
            }
        })
    };
    let costs = ElementCosts {
        nodes: table(Kind::Node),
        curves: table(Kind::Curve),
        sheets: table(Kind::Sheet),
    };
    MatchingProblem::new(&target.graph, &source.graph, &costs, evidence)
}

impl EditDistance {
    /// Pairs (target, source) of the heaviest parts of deformed elements of a kind, by target.
    pub fn correspondences(&self, kind: Kind) -> Vec<(u32, u32)> {
        let mut pairs: Vec<(u32, u32)> = self
            .operations
            .iter()
            .filter_map(|o| match o {
                Operation::Deform {
                    kind: k,
                    target,
                    source,
                    ..
                } if *k == kind => Some((target[0], source[0])),
                _ => None,
            })
            .collect();
        pairs.sort_unstable();
        pairs
    }

    /// The same as a map.
    pub fn map(&self, target: &AttributedHypergraph) -> ElementMap {
        let list = |kind: Kind| {
            let mut map = vec![None; target.count(kind)];
            self.correspondences(kind)
                .into_iter()
                .for_each(|(x, y)| map[x as usize] = Some(y));
            map
        };
        ElementMap {
            source_of_target: Kind::ALL.map(list),
        }
    }
}
