//! How broad sheets are at their ribs.
//!
//! A rib is smoothed over a few tolerances and moved by up to two. Where its sheet is a strip narrower than that, one border would be drawn
//! across the other, and the mesh between them would fray. In: ribs and sheets as cells of the fine complex. Out: for every vertex of a rib
//! how deep its sheet is there, where that is less than [`DEEP`] tolerances.
//!
//! 1. from the ribs of a sheet inward, along its edges: the depth of its vertices, up to [`DEEP`];
//! 2. from where that was reached back again, up to [`BACK`]: rib vertices that are reached bound a broad sheet, the tips of teeth and short
//!    spikes too, which smoothing is for;
//! 3. for the others the largest depth within [`BACK`].
//!
//! All lengths are in local tolerances, or in spacings where those are more, so that thick and thin parts are treated alike. Cost `O(n log n)` in the vertices within
//! [`DEEP`] of a rib; for vertices of narrow strips the vertices within [`BACK`] each.

use super::hypergraph::CurveKind;
use super::network::Chain;
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::regularise::Regularised;
use ordered_float::OrderedFloat;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Depth from which a sheet is broad, in tolerances.
const DEEP: f64 = 1.5;
/// How far from a deep place a rib may be, in tolerances: spikes longer than the difference to [`DEEP`] are strips of their own.
const BACK: f64 = 5.0;

/// The unit of depths at a vertex, mm: the tolerance, or the spacing where that is more.
pub(crate) fn unit_mm(fine: &FineScaffold, regularised: &Regularised, v: u32) -> f64 {
    regularised.tolerance_at(v).max(fine.scale.spacing_mm)
}

/// Depth of the sheet at each vertex of each chain, in [`unit_mm`]; infinite where it is broad, and for what is no rib.
pub(crate) fn depths(
    fine: &FineScaffold,
    regularised: &Regularised,
    chains: &[Chain],
    sheet_of_chain: &[Option<u32>],
    sheet_of_facet: &[u32],
    strips: &mut Strips,
) -> Vec<Vec<f64>> {
    let mut ribs: Vec<Vec<usize>> = Vec::new();
    for (i, chain) in chains.iter().enumerate() {
        if let (CurveKind::Rib, Some(sheet)) = (chain.kind, sheet_of_chain[i]) {
            ribs.resize_with(ribs.len().max(sheet as usize + 1), Vec::new);
            ribs[sheet as usize].push(i);
        }
    }
    let mut out: Vec<Vec<f64>> = chains
        .iter()
        .map(|c| vec![f64::INFINITY; c.vertices.len()])
        .collect();
    let mut walk = Walk {
        fine,
        regularised,
        sheet_of_facet,
        sheet: NONE,
    };
    let mut around: Option<Distances> = None;
    for (sheet, ribs) in ribs.iter().enumerate() {
        walk.sheet = sheet as u32;
        let border = ribs.iter().flat_map(|&i| chains[i].vertices.iter().copied());
        strips.look(&walk, border, DEEP, BACK);
        for &i in ribs {
            for (k, &v) in chains[i].vertices.iter().enumerate() {
                if strips.is_narrow(v) {
                    let around = around.get_or_insert_with(|| Distances::new(fine.num_vertices()));
                    around.spread(&walk, std::iter::once(v), BACK, |_| true);
                    let depth = |&u: &u32| {
                        if around.at[u as usize] <= BACK {
                            strips.inward.at[u as usize]
                        } else {
                            0.0
                        }
                    };
                    out[i][k] = around.reached.iter().map(depth).fold(0.0, f64::max);
                }
            }
        }
    }
    out
}

/// Finds what is narrow of one sheet after the other.
pub(crate) struct Strips {
    deep: f64,
    back_to: f64,
    inward: Distances,
    back: Distances,
}

impl Strips {
    /// For so many vertices.
    pub fn new(vertices: usize) -> Self {
        Self {
            deep: 0.0,
            back_to: 0.0,
            inward: Distances::new(vertices),
            back: Distances::new(vertices),
        }
    }

    /// Looks at the sheet that is walked on, from the vertices of its ribs: it is broad within `back_to` of where it is `deep` deep. Returns
    /// whether it is so anywhere.
    pub fn look(&mut self, walk: &Walk, border: impl Iterator<Item = u32>, deep: f64, back_to: f64) -> bool {
        (self.deep, self.back_to) = (deep, back_to);
        self.inward.spread(walk, border, self.deep, |_| true);
        let deep = |&v: &u32| self.inward.at[v as usize] >= self.deep;
        let deep = self.inward.reached.iter().copied().filter(deep);
        let shallow = |v: u32| self.inward.at[v as usize] < self.deep;
        self.back.spread(walk, deep, self.back_to, shallow);
        !self.back.reached.is_empty()
    }

    /// Whether a vertex lies in a strip, if it is less than `deep` from a rib.
    pub fn is_narrow(&self, v: u32) -> bool {
        self.back.at[v as usize] > self.back_to
    }

    /// How far a vertex is from where the sheet is deep, up to `back_to`; infinite or more beyond.
    pub fn distance_to_deep(&self, v: u32) -> f64 {
        self.back.at[v as usize]
    }

    /// The vertices near the ribs.
    pub fn near_ribs(&self) -> impl Iterator<Item = u32> + '_ {
        self.inward.reached.iter().copied()
    }
}

/// Where distances are measured: along the edges of one sheet, in [`unit_mm`].
pub(super) struct Walk<'a> {
    pub fine: &'a FineScaffold,
    pub regularised: &'a Regularised,
    pub sheet_of_facet: &'a [u32],
    pub sheet: u32,
}

impl Walk<'_> {
    /// Neighbours of a vertex on the sheet, and how far they are.
    fn neighbours(&self, v: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let Self {
            fine, regularised, ..
        } = *self;
        let on_sheet = move |e: &u32| {
            let facets = fine.facets_of_edge(*e as usize);
            facets
                .iter()
                .any(|&f| self.sheet_of_facet[f as usize] == self.sheet)
        };
        fine.edges_of_vertex(v as usize).filter(on_sheet).map(move |e| {
            let u = fine.other_end(e as usize, v);
            let [a, b] = [u, v].map(|v| fine.vertex_position[v as usize]);
            let unit = [u, v].map(|v| unit_mm(fine, regularised, v));
            (u, a.distance(b) / (0.5 * (unit[0] + unit[1])))
        })
    }
}

/// Distances from some vertices, kept from one use to the next so that only what was reached is cleared.
struct Distances {
    at: Vec<f64>,
    reached: Vec<u32>,
    queue: BinaryHeap<Reverse<(OrderedFloat<f64>, u32)>>,
}

impl Distances {
    fn new(vertices: usize) -> Self {
        Self {
            at: vec![f64::INFINITY; vertices],
            reached: Vec::new(),
            queue: BinaryHeap::new(),
        }
    }

    /// Distances from some vertices over those that may be entered. The first vertices beyond `limit` get theirs too, and nothing is looked
    /// for behind them.
    fn spread(
        &mut self,
        walk: &Walk,
        from: impl Iterator<Item = u32>,
        limit: f64,
        enter: impl Fn(u32) -> bool,
    ) {
        for v in self.reached.drain(..) {
            self.at[v as usize] = f64::INFINITY;
        }
        for v in from {
            self.come(v, 0.0);
        }
        while let Some(Reverse((distance, v))) = self.queue.pop() {
            if distance.0 > self.at[v as usize] || distance.0 >= limit {
                continue;
            }
            for (u, step) in walk.neighbours(v) {
                if enter(u) {
                    self.come(u, distance.0 + step);
                }
            }
        }
    }

    fn come(&mut self, v: u32, distance: f64) {
        let known = &mut self.at[v as usize];
        if distance < *known {
            if known.is_infinite() {
                self.reached.push(v);
            }
            *known = distance;
            self.queue.push(Reverse((OrderedFloat(distance), v)));
        }
    }
}
