//! An order of elements that does not depend on how the graphs were stored.
//!
//! In: a [`MatchingProblem`]. Out: the same problem with the elements of both sides in canonical order and, when that
//! is the smaller in a fixed order of graphs, target and source exchanged; and the way back.
//!
//! 1. Every element gets a colour: its weight and its sorted row of costs.
//! 2. Colours are refined by the multiset of (strength, colour) of the neighbours, until their number settles
//!    (Weisfeiler & Leman 1968).
//! 3. Elements are sorted by colour; equal colours keep their order, which matters only for elements that refinement
//!    cannot tell apart.
//!
//! Solvers that break ties by position and add in order of position then give the same bits for any order of the
//! elements and for either direction of the match. Cost: O((n m + I) log) a round, at most n rounds.

use crate::matching_problem::{ElementMap, INCIDENCE_KINDS, Incidences, Incident, MatchingProblem, Side};
use crate::table::Table;

/// A problem in canonical order.
#[derive(Debug, Clone)]
pub struct Canonical {
    /// The problem with elements reordered and perhaps sides exchanged.
    pub problem: MatchingProblem,
    /// Whether the sides were exchanged.
    pub exchanged: bool,
    /// Old position of every element of the target given, by kind, whether or not it became the source.
    pub target_order: [Vec<u32>; 3],
    /// The same for the source given.
    pub source_order: [Vec<u32>; 3],
}

impl Canonical {
    /// Puts a problem into canonical order.
    pub fn new(problem: &MatchingProblem) -> Self {
        let (target_order, target_key) = order(&problem.target, &problem.costs);
        let transposed = [0, 1, 2].map(|k| problem.costs[k].transposed());
        let (source_order, source_key) = order(&problem.source, &transposed);
        let exchanged = source_key < target_key;
        let mut ordered = MatchingProblem {
            target: reorder(&problem.target, &target_order),
            source: reorder(&problem.source, &source_order),
            costs: [0, 1, 2].map(|k| {
                let (t, s) = (&target_order[k], &source_order[k]);
                Table::from_fn(t.len(), s.len(), |r, c| {
                    problem.costs[k][(t[r] as usize, s[c] as usize)]
                })
            }),
        };
        if exchanged {
            ordered = ordered.transposed();
        }
        Self {
            problem: ordered,
            exchanged,
            target_order,
            source_order,
        }
    }

    /// Takes a map of the original problem to the canonical one.
    pub fn import(&self, map: &ElementMap) -> ElementMap {
        let counts = [0, 1, 2].map(|k| self.source_order[k].len());
        let mut inner = ElementMap {
            source_of_target: [0, 1, 2].map(|k| vec![None; self.target_order[k].len()]),
        };
        for k in 0..3 {
            let mut place = vec![0u32; counts[k]];
            self.source_order[k]
                .iter()
                .enumerate()
                .for_each(|(new, &old)| place[old as usize] = new as u32);
            for (new, &old) in self.target_order[k].iter().enumerate() {
                inner.source_of_target[k][new] =
                    map.source_of_target[k][old as usize].map(|y| place[y as usize]);
            }
        }
        if self.exchanged {
            inner.inverse(counts)
        } else {
            inner
        }
    }

    /// Takes a pair of the canonical problem to the original one.
    pub fn export_pair(&self, kind: usize, target: u32, source: u32) -> (u32, u32) {
        let (t, s) = if self.exchanged {
            (source, target)
        } else {
            (target, source)
        };
        (
            self.target_order[kind][t as usize],
            self.source_order[kind][s as usize],
        )
    }

    /// Takes a map of the canonical problem to the original one.
    pub fn export(&self, map: &ElementMap) -> ElementMap {
        let counts = [0, 1, 2].map(|k| self.target_order[k].len());
        let inner = if self.exchanged {
            map.inverse(counts)
        } else {
            map.clone()
        };
        let mut outer = ElementMap {
            source_of_target: counts.map(|n| vec![None; n]),
        };
        for k in 0..3 {
            for (new, y) in inner.source_of_target[k].iter().enumerate() {
                let old = self.target_order[k][new] as usize;
                outer.source_of_target[k][old] = y.map(|y| self.source_order[k][y as usize]);
            }
        }
        outer
    }
}

/// Order of the elements, and a key of the whole graph that does not depend on how it was stored.
fn order(side: &Side, costs: &[Table; 3]) -> ([Vec<u32>; 3], Vec<u64>) {
    let signature = |k: usize, x: usize| -> Vec<u64> {
        let mut row: Vec<u64> = costs[k].row(x).iter().map(|v| sortable(*v)).collect();
        row.sort_unstable();
        row.insert(0, sortable(side.weights[k][x]));
        row
    };
    let mut keys: [Vec<Vec<u64>>; 3] =
        [0, 1, 2].map(|k| (0..side.count(k)).map(|x| signature(k, x)).collect());
    let first_keys = keys.clone();
    let mut colours = [0, 1, 2].map(|k| ranks(&keys[k]));
    let mut number = colours.iter().map(|c| distinct(c)).sum::<usize>();
    loop {
        for k in 0..3 {
            for x in 0..side.count(k) {
                keys[k][x] = neighbourhood(side, &colours, k, x);
            }
        }
        colours = [0, 1, 2].map(|k| ranks(&keys[k]));
        let now = colours.iter().map(|c| distinct(c)).sum::<usize>();
        if now == number {
            break;
        }
        number = now;
    }
    let orders = [0, 1, 2].map(|k| {
        let mut o: Vec<u32> = (0..side.count(k) as u32).collect();
        o.sort_by_key(|&x| (colours[k][x as usize], x));
        o
    });
    let mut key: Vec<u64> = (0..3).map(|k| side.count(k) as u64).collect();
    for k in 0..3 {
        for &x in &orders[k] {
            key.extend(&first_keys[k][x as usize]);
            key.extend(&keys[k][x as usize]);
        }
    }
    (orders, key)
}

/// Own colour, then the sorted (kind pair, strength, colour) of the neighbours.
fn neighbourhood(side: &Side, colours: &[Vec<u64>; 3], kind: usize, x: usize) -> Vec<u64> {
    let mut parts: Vec<[u64; 3]> = Vec::new();
    for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
        let (list, other): (&[Incident], usize) = if kind == p {
            (&side.incidences[pair].forward[x], q)
        } else if kind == q {
            (&side.incidences[pair].backward[x], p)
        } else {
            continue;
        };
        parts.extend(list.iter().map(|i| {
            [
                pair as u64,
                sortable(i.strength),
                colours[other][i.element as usize],
            ]
        }));
    }
    parts.sort_unstable();
    let mut key = vec![colours[kind][x]];
    key.extend(parts.into_iter().flatten());
    key
}

/// Bits of a number of at least zero sort as the number does.
fn sortable(v: f64) -> u64 {
    (v + 0.0).to_bits()
}

/// Rank of every key among the distinct keys.
fn ranks(keys: &[Vec<u64>]) -> Vec<u64> {
    let mut sorted: Vec<&Vec<u64>> = keys.iter().collect();
    sorted.sort_unstable();
    sorted.dedup();
    keys.iter()
        .map(|k| sorted.binary_search(&k).expect("every key is in the list") as u64)
        .collect()
}

fn distinct(colours: &[u64]) -> usize {
    colours.iter().max().map_or(0, |m| *m as usize + 1)
}

fn reorder(side: &Side, order: &[Vec<u32>; 3]) -> Side {
    let place = [0, 1, 2].map(|k| {
        let mut p = vec![0u32; order[k].len()];
        order[k]
            .iter()
            .enumerate()
            .for_each(|(new, &old)| p[old as usize] = new as u32);
        p
    });
    let lists = |old: &[Vec<Incident>], of: usize, to: usize| -> Vec<Vec<Incident>> {
        let renamed = |list: &Vec<Incident>| {
            let rename = |i: &Incident| Incident {
                element: place[to][i.element as usize],
                ..*i
            };
            let mut new: Vec<Incident> = list.iter().map(rename).collect();
            new.sort_by_key(|i| i.element);
            new
        };
        order[of].iter().map(|&x| renamed(&old[x as usize])).collect()
    };
    Side {
        weights: [0, 1, 2].map(|k| order[k].iter().map(|&x| side.weights[k][x as usize]).collect()),
        incidences: [0, 1, 2].map(|pair| {
            let (p, q) = INCIDENCE_KINDS[pair];
            let old = &side.incidences[pair];
            Incidences {
                forward: lists(&old.forward, p, q),
                backward: lists(&old.backward, q, p),
            }
        }),
    }
}
