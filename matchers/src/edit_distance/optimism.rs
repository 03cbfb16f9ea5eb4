//! What the heals that are still possible may at best save on one graph.
//!
//! In: a hypergraph, its heals, what is decided of its elements. Out: for every element the most that leaving it unmatched may
//! save, so that no set of possible heals saves more than the sum over what it leaves unmatched.
//!
//! Notation: a healed element is a group of original elements, known by its heaviest part, the **representative**; the other parts are
//! **absorbed**. A group is a tree of heals, so every heal removes one element x and absorbs one part y; x, y and what the heal
//! clears all stay unmatched.
//!
//! * **Possible** is a heal whose removed and cleared elements are not matched and whose joined elements may end up in one group: not
//!   both matched, and no matched one next to a heavier one, which would absorb it.
//! * **Saving** of a heal that absorbs y, against leaving all it takes unmatched and matching the representative as it was: the weight
//!   of y; each incidence of y that the group keeps, once as it was and once as strong as the heaviest element within reach makes
//!   it, because it may now agree with one of the other graph (a price `q`, turned into a gain of at most `2 min(q', .)`, of which
//!   the total pays one); an incidence that the representative has anyway only as it was. A contraction saves what its price is below
//!   the curve's weight and incidences, a merge of sheets the corners that it flattens.
//! * **Bearers.** The saving may be split in any way between the removed, the absorbed and the cleared elements, because all of them
//!   must be unmatched. It is counted with those that may yet be matched, in proportion to what they are worth to the bound of the
//!   match: as long as the worth of all that a heal takes is more than it saves, it does not loosen the bound at all.
//!
//! Cost: O(heals * degree).

use super::healing::{Heal, incident_strength};
use crate::hypergraph::{AttributedHypergraph, Kind};
use crate::matching_problem::{EvidenceSettings, INCIDENCE_KINDS, Side};

/// What is decided of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Nothing.
    Open,
    /// It represents a group that corresponds to one of the other graph.
    Matched,
    /// It is spliced, removed or absorbed.
    Unmatched,
}

/// The best case of one side under what is decided.
#[derive(Debug, Clone)]
pub struct Optimism {
    /// Most that leaving an element unmatched saves, by kind.
    pub bonus: [Vec<f64>; 3],
    /// Whether no possible heal adds parts to an element, by kind.
    pub alone: [Vec<bool>; 3],
    /// Positions of the possible heals.
    pub possible: Vec<usize>,
    /// The saving of every possible heal, in the same order.
    pub savings: Vec<f64>,
}

/// A hypergraph with its heals, tabulated for [`Self::optimism`].
#[derive(Debug, Clone)]
pub struct Healable {
    side: Side,
    heals: Vec<Heal>,
    /// Place of every element when the heaviest comes first.
    rank: [Vec<usize>; 3],
    /// Strength of one incidence for two elements of weight one, by kind pair.
    rates: [f64; 3],
    /// Ends of removed curves, for the corners that a merge flattens.
    ends: Vec<Vec<usize>>,
}

impl Healable {
    /// Tabulates a hypergraph and its heals.
    pub fn new(g: &AttributedHypergraph, heals: Vec<Heal>, evidence: &EvidenceSettings) -> Self {
        let rank = Kind::ALL.map(|k| {
            let weights = g.weights(k);
            let mut order: Vec<usize> = (0..weights.len()).collect();
            order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
            let mut rank = vec![0; order.len()];
            order.iter().enumerate().for_each(|(place, &x)| rank[x] = place);
            rank
        });
        let ends = g.curves().iter().map(|c| {
            let mut ends: Vec<usize> = c.ends.nodes().map(|n| n.index()).collect();
            ends.dedup();
            ends
        });
        Self {
            side: Side::new(g, evidence),
            heals,
            rank,
            rates: [evidence.node_curve, evidence.curve_sheet, evidence.corner],
            ends: ends.collect(),
        }
    }

    /// The heals, in the order given.
    pub fn heals(&self) -> &[Heal] {
        &self.heals
    }

    /// Weights and incidences of the graph.
    pub fn side(&self) -> &Side {
        &self.side
    }

    /// The joined element that is absorbed by the other, or by a heavier one together with it.
    pub fn lighter(&self, heal: &Heal) -> usize {
        let rank = &self.rank[heal.joined_kind.index()];
        let [a, b] = heal.joined.map(|x| x as usize);
        if rank[a] < rank[b] { b } else { a }
    }

    /// The best case under what is decided; `closed` heals are out of the question, `worth` is what elements are worth matched.
    pub fn optimism(&self, status: &[Vec<Status>; 3], closed: &[bool], worth: &[Vec<f64>; 3]) -> Optimism {
        let possible: Vec<usize> = (0..self.heals.len())
            .filter(|&h| !closed[h] && self.is_possible(h, status))
            .collect();
        let top = self.heaviest_in_reach(&possible);
        let mut out = Optimism {
            bonus: [0, 1, 2].map(|k| vec![0.0f64; self.rank[k].len()]),
            alone: [0, 1, 2].map(|k| vec![true; self.rank[k].len()]),
            savings: Vec::with_capacity(possible.len()),
            possible,
        };
        for &h in &out.possible {
            let heal = &self.heals[h];
            let k = heal.joined_kind.index();
            let mut largest = 0.0f64;
            let [a, b] = heal.joined.map(|x| x as usize);
            for (y, parent) in [(a, b), (b, a)] {
                out.alone[k][y] &= self.rank[k][y] > self.rank[k][parent];
                if status[k][y] != Status::Matched && top[k][y] != y {
                    let saving = self.saving(heal, y, parent, &top).max(0.0);
                    largest = largest.max(saving);
                    bear(heal, y, saving, status, worth, &mut out.bonus);
                }
            }
            out.savings.push(largest);
        }
        out
    }

    fn is_possible(&self, h: usize, status: &[Vec<Status>; 3]) -> bool {
        let heal = &self.heals[h];
        let k = heal.joined_kind.index();
        let matched = |kind: usize, x: usize| status[kind][x] == Status::Matched;
        !matched(heal.removed_kind.index(), heal.removed as usize)
            && !matched(k, self.lighter(heal))
            && !heal.cleared.iter().any(|&x| matched(k, x as usize))
    }

    /// The heaviest element of the group that an element may become part of.
    fn heaviest_in_reach(&self, possible: &[usize]) -> [Vec<usize>; 3] {
        let mut top = [0, 1, 2].map(|k| (0..self.rank[k].len()).collect::<Vec<usize>>());
        let find = |top: &[usize], mut x: usize| {
            while top[x] != x {
                x = top[x];
            }
            x
        };
        for &h in possible {
            let heal = &self.heals[h];
            let k = heal.joined_kind.index();
            let [a, b] = heal.joined.map(|x| find(&top[k], x as usize));
            if self.rank[k][a] < self.rank[k][b] {
                top[k][b] = a;
            } else {
                top[k][a] = b;
            }
        }
        [0, 1, 2].map(|k| (0..top[k].len()).map(|x| find(&top[k], x)).collect())
    }

    /// Most that is saved when `heal` adds `y` to the group of `parent`.
    fn saving(&self, heal: &Heal, y: usize, parent: usize, top: &[Vec<usize>; 3]) -> f64 {
        let (r, k) = (heal.removed_kind.index(), heal.joined_kind.index());
        let removed = heal.removed as usize;
        let heaviest = |kind: usize, x: usize| self.side.weights[kind][top[kind][x]];
        let mut sum = self.side.weights[k][y];
        for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
            let incidences = &self.side.incidences[pair];
            let (list, other) = if k == p {
                (&incidences.forward[y], q)
            } else if k == q {
                (&incidences.backward[y], p)
            } else {
                continue;
            };
            for i in list {
                let z = i.element as usize;
                if (other, z) == (r, removed) {
                    continue; // it goes with the removed element, whose price holds it
                }
                // How often the two meet, as a number of incidences or a turn.
                let times = |strength: f64, x: usize| {
                    let one = self.rates[pair] * self.side.weights[k][x].min(self.side.weights[other][z]);
                    if one > 0.0 { strength / one } else { 0.0 }
                };
                let mut more = times(i.strength, y);
                if k == 1 && other == 2 {
                    more = (more - times(incidences.strength(parent, z), parent)).max(0.0);
                }
                sum += i.strength + self.rates[pair] * more * heaviest(k, y).min(heaviest(other, z));
            }
        }
        if heal.is_contraction() {
            sum += self.side.weights[r][removed] + incident_strength(&self.side, r, removed) - heal.price;
        } else if heal.joined_kind == Kind::Sheet {
            let corner = |n: usize, s: usize| self.side.incidences[2].strength(n, s);
            sum += self.ends[removed]
                .iter()
                .map(|&n| corner(n, y) + corner(n, parent))
                .sum::<f64>();
        }
        sum
    }
}

/// Grants a saving to those who must be unmatched for it.
fn bear(
    heal: &Heal,
    y: usize,
    saving: f64,
    status: &[Vec<Status>; 3],
    worth: &[Vec<f64>; 3],
    bonus: &mut [Vec<f64>; 3],
) {
    let k = heal.joined_kind.index();
    let bearers: Vec<(usize, usize)> = [(heal.removed_kind.index(), heal.removed as usize), (k, y)]
        .into_iter()
        .chain(heal.cleared.iter().map(|&w| (k, w as usize)))
        .collect();
    // A little for everyone, so that there is always someone to bear it.
    let part = |b: &(usize, usize)| {
        if status[b.0][b.1] == Status::Open {
            worth[b.0][b.1] + 1e-9 * saving
        } else {
            0.0
        }
    };
    let sum: f64 = bearers.iter().map(part).sum();
    for b in &bearers {
        let share = if sum > 0.0 {
            part(b) / sum
        } else {
            f64::from(u8::from(*b == (k, y)))
        };
        bonus[b.0][b.1] = bonus[b.0][b.1].max(share * saving);
    }
}
