//! Exact edit distance with all operations (deform, splice, contract, merge) by branch and bound.
//!
//! In: two hypergraphs, their heals, costs, a first answer. Out: the cheapest set of heals and map found, a lower bound, and
//! whether the two meet.
//!
//! The price of heals H and a map M is the price W of removing everything, minus what H saves, minus what M gains between the healed
//! graphs.
//!
//! 1. A search node knows some pairs of representatives and some unmatched elements. Heals that contradict them are out; over the
//!    others the best case (`optimism`) bounds savings and gains, and what is left is a problem without heals, whose gain the
//!    bound of [`super::branch_and_bound`] limits (dual ascent over shared incidences, continued from the parent's shares).
//! 2. Branch on nodes and sheets as there. A matched element rules out the heals that would remove or absorb it, so the bound
//!    tightens fast: where everything is matched nothing can be healed, and the bound is that of fixed graphs.
//! 3. When nodes and sheets are decided, branch on the heals still possible, the one that may save most first: in or out.
//! 4. When those are decided too, heal, and the curves are one LSAP.
//!
//! Cost: a search node takes about twice one of the search without heals. The limit counts search nodes, so that the answer
//! does not depend on the machine.

use super::branch_and_bound::{Bound, NODE_ROUNDS, ROOT_ROUNDS, Search};
use super::costs::GroupCosts;
use super::healing::{self, Heal, Healed};
use super::optimism::{Healable, Optimism, Status};
use super::shares::{Couplings, Shares};
use crate::graduated_assignment::discrete::{Discrete, best_columns};
use crate::graduated_assignment::objective::{HypergraphObjective, Variable};
use crate::hypergraph::{AttributedHypergraph, Kind};
use crate::matching_problem::{ElementMap, EvidenceSettings, MatchingProblem, ProblemError, Side};
use crate::table::Table;

/// The graphs with everything that may happen to them.
pub(super) struct Question<'a> {
    pub target: &'a AttributedHypergraph,
    pub source: &'a AttributedHypergraph,
    pub costs: &'a dyn GroupCosts,
    pub evidence: &'a EvidenceSettings,
    pub heals: [Vec<Heal>; 2],
}

/// A set of heals with a map between the healed graphs.
#[derive(Debug, Clone)]
pub(super) struct Answer {
    pub heals: [Vec<Heal>; 2],
    pub healed: [Healed; 2],
    pub map: ElementMap,
    /// Price of heals and map.
    pub price: f64,
}

/// What a search ends with.
pub(super) struct Outcome {
    /// Cheaper than the first answer, when one was found.
    pub better: Option<Answer>,
    /// No answer is cheaper than this; infinite when nothing was left open.
    pub open: f64,
    pub search_nodes: usize,
    /// Sets of heals that were priced.
    pub heal_sets: usize,
}

/// Searches for answers cheaper than `known_price`; with a limit of 0 it only bounds.
pub(super) fn search(
    question: &Question,
    known_price: f64,
    tolerance: f64,
    limit: usize,
) -> Result<Outcome, ProblemError> {
    let graphs = [question.target, question.source];
    let healable = [0, 1].map(|g| Healable::new(graphs[g], question.heals[g].clone(), question.evidence));
    let sides = graphs.map(|g| Side::new(g, question.evidence));
    let table = |f: &dyn Fn(Kind, u32, u32) -> f64| {
        Kind::ALL.map(|k| {
            Table::from_fn(graphs[0].count(k), graphs[1].count(k), |x, y| {
                f(k, x as u32, y as u32)
            })
        })
    };
    let mut s = HealedSearch {
        total: sides[0].total() + sides[1].total(),
        alone: table(&|k, x, y| question.costs.cost(k, &[x], &[y])),
        least: table(&|k, x, y| {
            let difference = weight(graphs[0], k, x) - weight(graphs[1], k, y);
            question.costs.at_least(k, x, y).max(difference.abs())
        }),
        healable,
        question,
        best_price: known_price,
        tolerance,
        limit,
        out: Outcome {
            better: None,
            open: f64::INFINITY,
            search_nodes: 0,
            heal_sets: 0,
        },
    };
    let mut root = Decisions {
        status: graphs.map(|g| Kind::ALL.map(|k| vec![Status::Open; g.count(k)])),
        pairs: Vec::new(),
        closed: [0, 1].map(|g| vec![false; s.healable[g].heals().len()]),
        taken: Default::default(),
    };
    root.settle();
    // Nothing is cheaper than free.
    if known_price > tolerance {
        let inheritance = s.first_inheritance(&mut root);
        s.expand(&root, &inheritance)?;
    }
    Ok(s.out)
}

fn weight(g: &AttributedHypergraph, kind: Kind, x: u32) -> f64 {
    match kind {
        Kind::Node => g.nodes()[x as usize].weight,
        Kind::Curve => g.curves()[x as usize].weight,
        Kind::Sheet => g.sheets()[x as usize].weight,
    }
}

/// What a search node knows.
#[derive(Debug, Clone)]
struct Decisions {
    /// Of every element of target and source.
    status: [[Vec<Status>; 3]; 2],
    /// Kind, target representative, source representative.
    pairs: Vec<(usize, usize, usize)>,
    /// Heals of target and source that will not be used.
    closed: [Vec<bool>; 2],
    /// Heals of target and source that will be used.
    taken: [Vec<usize>; 2],
}

impl Decisions {
    /// Sources that no undecided target can take are unmatched.
    fn settle(&mut self) {
        for k in [0, 2] {
            if self.status[0][k].iter().all(|s| *s != Status::Open) {
                for s in &mut self.status[1][k] {
                    if *s == Status::Open {
                        *s = Status::Unmatched;
                    }
                }
            }
        }
    }
}

struct HealedSearch<'a> {
    question: &'a Question<'a>,
    healable: [Healable; 2],
    /// Costs of elements that are not healed, and of groups at the least.
    alone: [Table; 3],
    least: [Table; 3],
    total: f64,
    best_price: f64,
    tolerance: f64,
    limit: usize,
    out: Outcome,
}

/// What a search node hands to its children.
struct Inheritance {
    shares: Shares,
    /// The couplings that the shares belong to.
    couplings: Couplings,
    /// What every element of target and source is worth matched, by kind.
    worth: [[Vec<f64>; 3]; 2],
}

/// How often the worths are revised at the root.
const ROOT_REVISIONS: usize = 12;

/// An element is worth what it contributes to the bound, and what leaving it unmatched was granted.
fn handed_down(bound: Bound, couplings: Couplings, best_case: &[Optimism; 2]) -> Option<Inheritance> {
    let mut worth = bound.worth?;
    for (worth, case) in worth
        .iter_mut()
        .flatten()
        .zip(best_case.iter().flat_map(|c| &c.bonus))
    {
        worth.iter_mut().zip(case).for_each(|(w, b)| *w += b);
    }
    Some(Inheritance {
        shares: bound.shares,
        couplings,
        worth,
    })
}

impl HealedSearch<'_> {
    fn expand(&mut self, decisions: &Decisions, inherited: &Inheritance) -> Result<(), ProblemError> {
        let (best_case, ceiling, mut bound, couplings) = self.bound(decisions, inherited);
        let at_least = ceiling - bound.gain;
        if at_least >= self.best_price - self.tolerance {
            return Ok(());
        }
        if self.limit == 0 {
            self.out.open = self.out.open.min(at_least);
            return Ok(());
        }
        let mut decisions = decisions.clone();
        self.close_hopeless(&mut decisions, &best_case, &bound, at_least);
        let branch = bound.branch.take();
        let Some(inheritance) = handed_down(bound, couplings, &best_case) else {
            return Ok(());
        };
        let Some(branch) = branch else {
            return self.branch_on_heals(&decisions, &best_case, at_least, &inheritance);
        };
        for (gain, choice) in branch.choices {
            let at_least = at_least.max(ceiling - gain);
            if at_least >= self.best_price - self.tolerance {
                continue;
            }
            if !self.visit(at_least) {
                continue;
            }
            let mut next = decisions.clone();
            match choice {
                Some(col) => {
                    next.status[0][branch.kind][branch.row] = Status::Matched;
                    next.status[1][branch.kind][col] = Status::Matched;
                    next.pairs.push((branch.kind, branch.row, col));
                }
                None => next.status[0][branch.kind][branch.row] = Status::Unmatched,
            }
            next.settle();
            self.expand(&next, &inheritance)?;
        }
        Ok(())
    }

    /// Counts a search node, or notes what is left open when the limit is reached.
    fn visit(&mut self, at_least: f64) -> bool {
        if self.out.search_nodes >= self.limit {
            self.out.open = self.out.open.min(at_least);
            return false;
        }
        self.out.search_nodes += 1;
        true
    }

    /// The problem without heals that is cheaper than any with.
    fn relaxed(&self, best_case: &[Optimism; 2]) -> MatchingProblem {
        let costs = [0, 1, 2].map(|k| {
            let [t, s] = best_case;
            Table::from_fn(t.alone[k].len(), s.alone[k].len(), |x, y| {
                let own = if t.alone[k][x] && s.alone[k][y] {
                    &self.alone
                } else {
                    &self.least
                };
                own[k][(x, y)] + t.bonus[k][x] + s.bonus[k][y]
            })
        });
        MatchingProblem {
            target: self.healable[0].side().clone(),
            source: self.healable[1].side().clone(),
            costs,
        }
    }

    /// The best case under what is decided, the price of everything less what it may save, and the bound of the gain.
    fn bound(
        &self,
        decisions: &Decisions,
        inherited: &Inheritance,
    ) -> ([Optimism; 2], f64, Bound, Couplings) {
        let best_case = [0, 1].map(|g| {
            self.healable[g].optimism(&decisions.status[g], &decisions.closed[g], &inherited.worth[g])
        });
        let problem = self.relaxed(&best_case);
        let ceiling = self.total
            - best_case
                .iter()
                .flat_map(|b| b.bonus.iter().flatten())
                .sum::<f64>();
        let to_beat = ceiling - self.best_price;
        let mut search = Search::new(&problem, to_beat, 0);
        search.tolerance = self.tolerance;
        for k in 0..3 {
            let open = |list: &[Status]| list.iter().map(|s| *s == Status::Open).collect();
            search.open_target[k] = open(&decisions.status[0][k]);
            search.open_source[k] = open(&decisions.status[1][k]);
        }
        for &(block, row, col) in &decisions.pairs {
            search.state.add(&search.objective, Variable { block, row, col });
        }
        let shares = inherited.shares.rescaled(&inherited.couplings, &search.couplings);
        let bound = search.bound(&shares, NODE_ROUNDS, to_beat);
        (best_case, ceiling, bound, search.couplings)
    }

    /// Closes the heals that cannot be part of an answer better than the best: taking one leaves all that it takes unmatched, and
    /// the bound falls by what those contribute to it.
    fn close_hopeless(
        &self,
        decisions: &mut Decisions,
        best_case: &[Optimism; 2],
        bound: &Bound,
        at_least: f64,
    ) {
        let Some(worth) = &bound.worth else { return };
        for g in 0..2 {
            for &h in &best_case[g].possible {
                let heal = &self.healable[g].heals()[h];
                let k = heal.joined_kind.index();
                let of = |kind: usize, x: u32| worth[g][kind][x as usize];
                let absorbed = of(k, heal.joined[0]).min(of(k, heal.joined[1]));
                let cleared: f64 = heal.cleared.iter().map(|&x| of(k, x)).sum();
                let loss = of(heal.removed_kind.index(), heal.removed) + absorbed + cleared;
                if at_least + loss >= self.best_price - self.tolerance && !decisions.taken[g].contains(&h) {
                    decisions.closed[g][h] = true;
                }
            }
        }
    }

    /// Shares and worths to start from: those of the match without savings, then a few times with them.
    fn first_inheritance(&self, decisions: &mut Decisions) -> Inheritance {
        let zero = [0, 1].map(|g| Kind::ALL.map(|k| vec![0.0; decisions.status[g][k.index()].len()]));
        let everything_closed = [0, 1].map(|g| vec![true; decisions.closed[g].len()]);
        let optimists = |closed: &[Vec<bool>; 2], worth: &[[Vec<f64>; 3]; 2]| {
            [0, 1].map(|g| self.healable[g].optimism(&decisions.status[g], &closed[g], &worth[g]))
        };
        let problem = self.relaxed(&optimists(&everything_closed, &zero));
        let search = Search::new(&problem, f64::NEG_INFINITY, 0);
        let bound = search.bound(&search.couplings.equal_shares(), ROOT_ROUNDS, f64::NEG_INFINITY);
        let mut inheritance = Inheritance {
            shares: bound.shares,
            couplings: search.couplings,
            worth: bound.worth.unwrap_or(zero),
        };
        for _ in 0..ROOT_REVISIONS {
            let (best_case, ceiling, bound, couplings) = self.bound(decisions, &inheritance);
            self.close_hopeless(decisions, &best_case, &bound, ceiling - bound.gain);
            match handed_down(bound, couplings, &best_case) {
                Some(next) => inheritance = next,
                None => break, // nothing is cheaper than the known answer
            }
        }
        inheritance
    }

    /// Nodes and sheets are decided.
    fn branch_on_heals(
        &mut self,
        decisions: &Decisions,
        best_case: &[Optimism; 2],
        at_least: f64,
        inherited: &Inheritance,
    ) -> Result<(), ProblemError> {
        let mut most: Option<(f64, usize, usize)> = None;
        for (g, case) in best_case.iter().enumerate() {
            for (&h, &saving) in case.possible.iter().zip(&case.savings) {
                let undecided = !decisions.taken[g].contains(&h) && !decisions.closed[g][h];
                if undecided && most.is_none_or(|m| saving > m.0) {
                    most = Some((saving, g, h));
                }
            }
        }
        let Some((_, g, h)) = most else {
            return self.price(decisions);
        };
        for take in [true, false] {
            if !self.visit(at_least) {
                continue;
            }
            let mut next = decisions.clone();
            if take {
                next.taken[g].push(h);
                self.close_rivals(&mut next, g, h);
            } else {
                next.closed[g][h] = true;
            }
            self.expand(&next, inherited)?;
        }
        Ok(())
    }

    /// Closes the heals that contradict one that is taken, and notes what it decides.
    fn close_rivals(&self, next: &mut Decisions, g: usize, h: usize) {
        let heals = self.healable[g].heals();
        let taken = &heals[h];
        let removes = |a: &Heal, b: &Heal| a.removed_kind == b.joined_kind && b.joined.contains(&a.removed);
        let clears = |a: &Heal, b: &Heal| {
            a.joined_kind == b.joined_kind && a.cleared.iter().any(|x| b.joined.contains(x))
        };
        for (k, other) in heals.iter().enumerate() {
            let same = (other.removed_kind, other.removed) == (taken.removed_kind, taken.removed);
            let against = |a, b| removes(a, b) || clears(a, b);
            if k != h && (same || against(other, taken) || against(taken, other)) {
                next.closed[g][k] = true;
            }
        }
        next.status[g][taken.removed_kind.index()][taken.removed as usize] = Status::Unmatched;
        let k = taken.joined_kind.index();
        next.status[g][k][self.healable[g].lighter(taken)] = Status::Unmatched;
        for &x in &taken.cleared {
            next.status[g][k][x as usize] = Status::Unmatched;
        }
    }

    /// Everything but the curves is decided: the price of it.
    fn price(&mut self, decisions: &Decisions) -> Result<(), ProblemError> {
        let q = self.question;
        let mut heals = [0, 1].map(|g| -> Vec<Heal> {
            let all = self.healable[g].heals();
            decisions.taken[g].iter().map(|&h| all[h].clone()).collect()
        });
        heals
            .iter_mut()
            .for_each(|l| l.sort_by(|a, b| a.price.total_cmp(&b.price)));
        let (Some(t), Some(s)) = (
            healing::apply(q.target, &heals[0]),
            healing::apply(q.source, &heals[1]),
        ) else {
            return Ok(());
        };
        self.out.heal_sets += 1;
        let problem = super::distance::problem_of((&t, &s), q.costs, q.evidence)?;
        let group = |healed: &Healed, kind: usize, x: usize| {
            healed.parts[kind].iter().position(|p| p[0] as usize == x)
        };
        let mut columns: Vec<Vec<Option<usize>>> = (0..3).map(|k| vec![None; t.parts[k].len()]).collect();
        for &(kind, row, col) in &decisions.pairs {
            // A pair of elements that are absorbed after all is not what was decided.
            let (Some(x), Some(y)) = (group(&t, kind, row), group(&s, kind, col)) else {
                return Ok(());
            };
            columns[kind][x] = Some(y);
        }
        let objective = HypergraphObjective::new(&problem);
        let state = Discrete::from_columns(&objective, &columns);
        columns[1] = best_columns(&state.gradient[1]);
        let list = |k: usize| columns[k].iter().map(|c| c.map(|c| c as u32)).collect();
        let map = ElementMap {
            source_of_target: [list(0), list(1), list(2)],
        };
        let price = t.price + s.price + problem.price(&map);
        if price < self.best_price - self.tolerance {
            self.best_price = price;
            self.out.better = Some(Answer {
                heals,
                healed: [t, s],
                map,
                price,
            });
        }
        Ok(())
    }
}
