//! The edit path: every operation with its price; the prices add up to the distance.
//!
//! What incidences cost is booked where it arises: with the splice of the element that goes (the lower kind when both
//! go), else with the deformation of the element of the higher kind.

use super::healing::{Heal, Healed};
use crate::canonical::Canonical;
use crate::hypergraph::Kind;
use crate::matching_problem::{ElementMap, INCIDENCE_KINDS, MatchingProblem};
use serde::{Deserialize, Serialize};

/// One of the two graphs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GraphSide {
    /// The target.
    Target,
    /// The source.
    Source,
}

/// One edit; element lists are the original parts of an element, more than one when it was healed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "operation")]
pub enum Operation {
    /// A target element corresponds to a source element.
    Deform {
        /// Kind of both.
        kind: Kind,
        /// Target parts, heaviest first.
        target: Vec<u32>,
        /// Source parts, heaviest first.
        source: Vec<u32>,
        /// Price.
        price: f64,
    },
    /// An element that the other graph does not have.
    Splice {
        /// The graph that has it.
        side: GraphSide,
        /// Its kind.
        kind: Kind,
        /// Its parts, heaviest first.
        parts: Vec<u32>,
        /// Price.
        price: f64,
    },
    /// A curve shrinks to a point.
    Contract {
        /// The graph that has it.
        side: GraphSide,
        /// The curve.
        curve: u32,
        /// Its end nodes, which become one.
        nodes: [u32; 2],
        /// Price.
        price: f64,
    },
    /// Two curves become one across a node, or two sheets across a curve.
    Merge {
        /// The graph that has them.
        side: GraphSide,
        /// Kind of the element that goes.
        removed_kind: Kind,
        /// The element that goes.
        removed: u32,
        /// Kind of the elements that become one.
        joined_kind: Kind,
        /// The elements that become one.
        joined: [u32; 2],
        /// Price.
        price: f64,
    },
}

impl Operation {
    /// Price of the operation, in the weights' unit.
    pub fn price(&self) -> f64 {
        match self {
            Operation::Deform { price, .. }
            | Operation::Splice { price, .. }
            | Operation::Contract { price, .. }
            | Operation::Merge { price, .. } => *price,
        }
    }
}

impl Operation {
    /// Takes an operation of the canonical graphs to the graphs given.
    pub(super) fn carried(self, canonical: &Canonical) -> Self {
        let turn = |side: GraphSide| match (side, canonical.exchanged) {
            (GraphSide::Target, false) | (GraphSide::Source, true) => GraphSide::Target,
            _ => GraphSide::Source,
        };
        let orders = |side: GraphSide| match side {
            GraphSide::Target => &canonical.target_order,
            GraphSide::Source => &canonical.source_order,
        };
        let one = |side: GraphSide, kind: Kind, x: u32| orders(turn(side))[kind.index()][x as usize];
        let all = |side: GraphSide, kind: Kind, list: Vec<u32>| -> Vec<u32> {
            list.into_iter().map(|x| one(side, kind, x)).collect()
        };
        let two = |side: GraphSide, kind: Kind, [a, b]: [u32; 2]| {
            let (a, b) = (one(side, kind, a), one(side, kind, b));
            [a.min(b), a.max(b)]
        };
        match self {
            Operation::Deform {
                kind,
                target,
                source,
                price,
            } => {
                let (t, s) = (
                    all(GraphSide::Target, kind, target),
                    all(GraphSide::Source, kind, source),
                );
                let (target, source) = if canonical.exchanged { (s, t) } else { (t, s) };
                Operation::Deform {
                    kind,
                    target,
                    source,
                    price,
                }
            }
            Operation::Splice {
                side,
                kind,
                parts,
                price,
            } => Operation::Splice {
                side: turn(side),
                kind,
                parts: all(side, kind, parts),
                price,
            },
            Operation::Contract {
                side,
                curve,
                nodes,
                price,
            } => Operation::Contract {
                side: turn(side),
                curve: one(side, Kind::Curve, curve),
                nodes: two(side, Kind::Node, nodes),
                price,
            },
            Operation::Merge {
                side,
                removed_kind,
                removed,
                joined_kind,
                joined,
                price,
            } => Operation::Merge {
                side: turn(side),
                removed_kind,
                removed: one(side, removed_kind, removed),
                joined_kind,
                joined: two(side, joined_kind, joined),
                price,
            },
        }
    }
}

/// Writes the path: heals of the target, heals of the source, splices, deformations.
pub(super) fn edit_path(
    problem: &MatchingProblem,
    map: &ElementMap,
    target: (&Healed, &[Heal]),
    source: (&Healed, &[Heal]),
) -> Vec<Operation> {
    let books = Books::new(problem, map);
    let mut path: Vec<Operation> = target.1.iter().map(|h| healing(GraphSide::Target, h)).collect();
    path.extend(source.1.iter().map(|h| healing(GraphSide::Source, h)));
    for kind in Kind::ALL {
        let k = kind.index();
        for (x, y) in map.source_of_target[k].iter().enumerate() {
            if y.is_none() {
                let (parts, price) = (target.0.parts[k][x].clone(), books.target[k][x]);
                path.push(Operation::Splice {
                    side: GraphSide::Target,
                    kind,
                    parts,
                    price,
                });
            }
        }
        for (y, x) in map
            .target_of_source(k, problem.source.count(k))
            .iter()
            .enumerate()
        {
            if x.is_none() {
                let (parts, price) = (source.0.parts[k][y].clone(), books.source[k][y]);
                path.push(Operation::Splice {
                    side: GraphSide::Source,
                    kind,
                    parts,
                    price,
                });
            }
        }
    }
    for kind in Kind::ALL {
        let k = kind.index();
        for (x, y) in map.source_of_target[k].iter().enumerate() {
            if let Some(y) = *y {
                path.push(Operation::Deform {
                    kind,
                    target: target.0.parts[k][x].clone(),
                    source: source.0.parts[k][y as usize].clone(),
                    price: books.target[k][x],
                });
            }
        }
    }
    path
}

fn healing(side: GraphSide, h: &Heal) -> Operation {
    if h.is_contraction() {
        Operation::Contract {
            side,
            curve: h.removed,
            nodes: h.joined,
            price: h.price,
        }
    } else {
        Operation::Merge {
            side,
            removed_kind: h.removed_kind,
            removed: h.removed,
            joined_kind: h.joined_kind,
            joined: h.joined,
            price: h.price,
        }
    }
}

/// Price booked on every target element (deformations and splices) and every unmatched source element.
struct Books {
    target: [Vec<f64>; 3],
    source: [Vec<f64>; 3],
}

impl Books {
    fn new(problem: &MatchingProblem, map: &ElementMap) -> Self {
        let back = [0, 1, 2].map(|k| map.target_of_source(k, problem.source.count(k)));
        let mut books = Self {
            target: problem.target.weights.clone(),
            source: problem.source.weights.clone(),
        };
        for k in 0..3 {
            for (x, y) in map.source_of_target[k].iter().enumerate() {
                if let Some(y) = *y {
                    books.target[k][x] = problem.costs[k][(x, y as usize)];
                    books.source[k][y as usize] = 0.0;
                }
            }
        }
        for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
            let (in_target, in_source) = (&problem.target.incidences[pair], &problem.source.incidences[pair]);
            for (x, list) in in_target.forward.iter().enumerate() {
                for i in list {
                    let z = i.element as usize;
                    match (map.source_of_target[p][x], map.source_of_target[q][z]) {
                        (Some(y), Some(t)) => {
                            let other = in_source.strength(y as usize, t as usize);
                            books.target[q][z] += (i.strength - other).abs();
                        }
                        (Some(_), None) => books.target[q][z] += i.strength,
                        (None, _) => books.target[p][x] += i.strength,
                    }
                }
            }
            for (y, list) in in_source.forward.iter().enumerate() {
                for i in list {
                    let t = i.element as usize;
                    match (back[p][y], back[q][t]) {
                        (Some(x), Some(z)) => {
                            if in_target.strength(x as usize, z as usize) == 0.0 {
                                books.target[q][z as usize] += i.strength;
                            }
                        }
                        (Some(_), None) => books.source[q][t] += i.strength,
                        (None, _) => books.source[p][y] += i.strength,
                    }
                }
            }
        }
        books
    }
}
