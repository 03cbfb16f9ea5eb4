//! A lower bound of the price over every set of heals that is still open.
//!
//! In: a healed problem and the heals that may still be applied to either side. Out: a number that no map of no
//! further healed pair of graphs undercuts.
//!
//! Every open heal pays one price and makes two elements disappear from the count: the one removed and the one joined to
//! another. Half of its price is charged to each. With that, every kind is one assignment with prices of staying unmatched:
//!
//! * an element that no open heal touches, and none of whose neighbours is touched, pays what the branch bound
//!   says: its weight or cost, and half of its incidences;
//! * an element whose neighbour is touched pays no incidences;
//! * an element that an open heal may remove or join may disappear for half of the cheapest such heal, and, where it may be
//!   joined, deforms for the difference of the weights alone, because the attributes of the healed element are not known.
//!
//! Cost: one LSAP a kind, O(n^3).

use super::healing::Heal;
use crate::assignment::solve_partial;
use crate::matching_problem::{INCIDENCE_KINDS, MatchingProblem, Side};
use crate::table::Table;

/// How open heals touch the elements of one side, by kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Touched {
    /// Half of the cheapest open heal that may remove or join the element; infinite when none does.
    pub vanish: [Vec<f64>; 3],
    /// Whether an open heal may join it.
    pub joined: [Vec<bool>; 3],
}

impl Touched {
    /// Reads the open heals of a side; `place` tells which healed element an original element is part of now.
    pub fn new<'a>(
        counts: [usize; 3],
        place: &[Vec<Option<u32>>; 3],
        open: impl Iterator<Item = &'a Heal>,
    ) -> Self {
        let mut t = Self {
            vanish: counts.map(|n| vec![f64::INFINITY; n]),
            joined: counts.map(|n| vec![false; n]),
        };
        for h in open {
            let (r, j) = (h.removed_kind.index(), h.joined_kind.index());
            let parts = (
                place[r][h.removed as usize],
                h.joined.map(|x| place[j][x as usize]),
            );
            let (Some(x), [Some(y), Some(z)]) = parts else {
                continue;
            };
            let half = 0.5 * h.price;
            t.vanish[r][x as usize] = t.vanish[r][x as usize].min(half);
            for y in [y, z] {
                t.vanish[j][y as usize] = t.vanish[j][y as usize].min(half);
                t.joined[j][y as usize] = true;
            }
        }
        t
    }

    fn any(&self, kind: usize, x: usize) -> bool {
        self.vanish[kind][x] < f64::INFINITY
    }
}

/// The lower bound; with nothing open it is the branch bound at the root.
pub fn relaxed_lower_bound(problem: &MatchingProblem, target: &Touched, source: &Touched) -> f64 {
    let stars_t = stars(&problem.target, target);
    let stars_s = stars(&problem.source, source);
    let mut sum = 0.0;
    for kind in 0..3 {
        let unmatched =
            |side: &Side, touched: &Touched, stars: &[Vec<Option<[Vec<f64>; 3]>>; 3]| -> Vec<f64> {
                let price = |x: usize| {
                    let star: f64 = stars[kind][x].iter().flatten().flatten().sum();
                    (side.weights[kind][x] + 0.5 * star).min(touched.vanish[kind][x])
                };
                (0..side.count(kind)).map(price).collect()
            };
        let rows = unmatched(&problem.target, target, &stars_t);
        let cols = unmatched(&problem.source, source, &stars_s);
        let costs = Table::from_fn(rows.len(), cols.len(), |x, y| {
            let (w, v) = (problem.target.weights[kind][x], problem.source.weights[kind][y]);
            let own = if target.joined[kind][x] || source.joined[kind][y] {
                (w - v).abs()
            } else {
                problem.costs[kind][(x, y)]
            };
            let incidences = match (&stars_t[kind][x], &stars_s[kind][y]) {
                (Some(a), Some(b)) => (0..3).map(|pair| sorted_difference(&a[pair], &b[pair])).sum(),
                _ => 0.0,
            };
            own + 0.5 * incidences
        });
        sum += solve_partial(&costs, &rows, &cols)
            .expect("costs are not NaN")
            .cost;
    }
    sum
}

/// Strengths of every untouched element with untouched neighbours, descending, by kind pair; `None` for the others.
fn stars(side: &Side, touched: &Touched) -> [Vec<Option<[Vec<f64>; 3]>>; 3] {
    [0, 1, 2].map(|kind| {
        (0..side.count(kind))
            .map(|x| {
                let mut star: [Vec<f64>; 3] = Default::default();
                for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
                    let (list, other) = if kind == p {
                        (&side.incidences[pair].forward[x], q)
                    } else if kind == q {
                        (&side.incidences[pair].backward[x], p)
                    } else {
                        continue;
                    };
                    if list.iter().any(|i| touched.any(other, i.element as usize)) {
                        return None;
                    }
                    star[pair] = list.iter().map(|i| i.strength).collect();
                    star[pair].sort_by(|a, b| b.total_cmp(a));
                }
                (!touched.any(kind, x)).then_some(star)
            })
            .collect()
    })
}

/// Least sum of differences between two lists of strengths, either of which may stay unmatched: rank by rank.
fn sorted_difference(a: &[f64], b: &[f64]) -> f64 {
    let at = |list: &[f64], k: usize| list.get(k).copied().unwrap_or(0.0);
    (0..a.len().max(b.len()))
        .map(|k| (at(a, k) - at(b, k)).abs())
        .sum()
}
