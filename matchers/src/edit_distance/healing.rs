//! Contract and merge: removing an element and healing the two that it held apart into one.
//!
//! In: a hypergraph and a set of [`Heal`]s. Out: the healed hypergraph and, for each of its elements, the original
//! elements it is made of.
//!
//! All three operations have one form: an element x goes, with all its incidences, and two elements y, z that met at
//! it become one:
//!
//! * **contract** a curve: its two end nodes become one node; costs the curve's contract price, everything included, so that
//!   a curve of no length costs nothing;
//! * **merge at a node**: two curves of one class that end there become one curve; costs what splicing the node costs, its weight and the
//!   strengths of its incidences; all other curves that end there must go (**cleared**: spliced, or removed by another heal);
//! * **merge at a curve**: two sheets that it bounds, once each, become one sheet; costs what splicing the curve costs; all other
//!   sheets that it bounds must go.
//!
//! This is what a transition of a medial scaffold does around the element it removes: splicing a fin leaves its host rib in
//! two halves, which then are one rib. The healed element weighs as much as its heaviest part. (Chang & Kimia, "Regularizing
//! 3D medial axis using medial scaffold transforms", CVPR 2008, name the transforms; Sebastian, Klein & Kimia 2004
//! use deform, splice, contract and merge as edit operations of shock graphs.)
//!
//! Every element is removed or joined consistently: an element that is removed is not part of a healed one, no element is
//! removed twice, an element that is cleared is not part of a healed one, and a heal must join two things that are not one already.

use crate::hypergraph::{AttributedHypergraph, CurveEnds, CurveId, Kind, NodeId, SheetId};
use crate::matching_problem::Side;
use serde::{Deserialize, Serialize};

/// Removal of one element that heals two others into one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Heal {
    /// Kind of the element that goes.
    pub removed_kind: Kind,
    /// The element that goes.
    pub removed: u32,
    /// Kind of the two elements that become one.
    pub joined_kind: Kind,
    /// The two elements that become one, ascending.
    pub joined: [u32; 2],
    /// Elements of the same kind that also meet the removed one and must go, ascending; none for a contraction.
    pub cleared: Vec<u32>,
    /// Price: the contract price, or that of splicing the element with all its incidences.
    pub price: f64,
}

impl Heal {
    /// Whether this is a contraction (the joined elements are of the lower kind), else a merge.
    pub fn is_contraction(&self) -> bool {
        self.joined_kind < self.removed_kind
    }
}

/// A healed hypergraph, without attributes.
#[derive(Debug, Clone, PartialEq)]
pub struct Healed {
    /// Structure and weights.
    pub graph: AttributedHypergraph,
    /// Original elements of every element, heaviest first, for nodes, curves, sheets.
    pub parts: [Vec<Vec<u32>>; 3],
    /// Elements that must be spliced, because a heal clears them, for nodes, curves, sheets.
    pub cleared: [Vec<bool>; 3],
    /// Sum of the prices of the heals.
    pub price: f64,
}

/// All heals that a hypergraph admits, cheapest first.
///
/// # Complexity
/// O(sum of squared degrees).
pub fn candidates(g: &AttributedHypergraph, side: &Side, contract: bool, merge: bool) -> Vec<Heal> {
    let mut heals = Vec::new();
    if contract {
        for (c, curve) in g.curves().iter().enumerate() {
            if let (CurveEnds::Two(a, b), Some(price)) = (curve.ends, curve.contract_price)
                && a != b
            {
                heals.push(heal(Kind::Curve, c, Kind::Node, [a.0, b.0], &[], price));
            }
        }
    }
    if merge {
        merges_at_nodes(g, side, &mut heals);
        merges_at_curves(g, side, &mut heals);
    }
    heals.sort_by(|a, b| {
        let key = |h: &Heal| (h.removed_kind, h.removed, h.joined_kind, h.joined);
        a.price.total_cmp(&b.price).then_with(|| key(a).cmp(&key(b)))
    });
    heals
}

/// `meeting` are all elements of the joined kind that meet the removed one.
fn heal(
    removed_kind: Kind,
    removed: usize,
    joined_kind: Kind,
    [a, b]: [u32; 2],
    meeting: &[u32],
    price: f64,
) -> Heal {
    let mut cleared: Vec<u32> = meeting.iter().copied().filter(|&m| m != a && m != b).collect();
    cleared.sort_unstable();
    cleared.dedup();
    Heal {
        removed_kind,
        removed: removed as u32,
        joined_kind,
        joined: [a.min(b), a.max(b)],
        cleared,
        price,
    }
}

fn merges_at_nodes(g: &AttributedHypergraph, side: &Side, heals: &mut Vec<Heal>) {
    for n in 0..g.nodes().len() {
        let price = g.nodes()[n].weight + incident_strength(side, 0, n);
        let meeting: Vec<u32> = side.incidences[0].forward[n].iter().map(|i| i.element).collect();
        // A loop's own ends heal by removing the node alone.
        let is_loop = |c: &u32| matches!(g.curves()[*c as usize].ends, CurveEnds::Two(a, b) if a == b);
        let open: Vec<u32> = meeting.iter().copied().filter(|c| !is_loop(c)).collect();
        for (k, &c) in open.iter().enumerate() {
            let class = |c: u32| g.curves()[c as usize].class;
            open[..k]
                .iter()
                .filter(|&&d| class(d) == class(c))
                .for_each(|&d| heals.push(heal(Kind::Node, n, Kind::Curve, [c, d], &meeting, price)));
        }
    }
}

fn merges_at_curves(g: &AttributedHypergraph, side: &Side, heals: &mut Vec<Heal>) {
    for (c, curve) in g.curves().iter().enumerate() {
        let price = curve.weight + incident_strength(side, 1, c);
        let sheets: Vec<u32> = side.incidences[1].forward[c].iter().map(|i| i.element).collect();
        // A slit is met by its sheet from both sides: what else meets it there cannot become one with it.
        let times = |s: &u32| {
            g.sheets()[*s as usize]
                .curves
                .iter()
                .filter(|d| d.index() == c)
                .count()
        };
        let open: Vec<u32> = sheets.iter().copied().filter(|s| times(s) == 1).collect();
        for (k, &s) in open.iter().enumerate() {
            open[..k]
                .iter()
                .for_each(|&t| heals.push(heal(Kind::Curve, c, Kind::Sheet, [s, t], &sheets, price)));
        }
    }
}

/// Sum of the strengths of all incidences of an element.
pub fn incident_strength(side: &Side, kind: usize, x: usize) -> f64 {
    let sum = |list: &[crate::matching_problem::Incident]| list.iter().map(|i| i.strength).sum::<f64>();
    let [ends, bounds, corners] = &side.incidences;
    match kind {
        0 => sum(&ends.forward[x]) + sum(&corners.forward[x]),
        1 => sum(&ends.backward[x]) + sum(&bounds.forward[x]),
        _ => sum(&bounds.backward[x]) + sum(&corners.backward[x]),
    }
}

/// A hypergraph as it is, in the form of a healed one.
pub fn unhealed(g: &AttributedHypergraph) -> Healed {
    apply(g, &[]).expect("no heals do not contradict each other")
}

/// Applies heals; `None` when they contradict each other.
pub fn apply(g: &AttributedHypergraph, heals: &[Heal]) -> Option<Healed> {
    let mut removed = Kind::ALL.map(|k| vec![false; g.count(k)]);
    let mut leader = Kind::ALL.map(|k| (0..g.count(k) as u32).collect::<Vec<u32>>());
    for h in heals {
        let gone = &mut removed[h.removed_kind.index()][h.removed as usize];
        if std::mem::replace(gone, true) {
            return None;
        }
        let leaders = &mut leader[h.joined_kind.index()];
        let [a, b] = h.joined.map(|x| find(leaders, x));
        if a == b {
            return None;
        }
        leaders[a.max(b) as usize] = a.min(b);
    }
    let joined = |h: &Heal| {
        h.joined
            .iter()
            .any(|&x| removed[h.joined_kind.index()][x as usize])
    };
    if heals.iter().any(joined) {
        return None;
    }
    let mut part = Kind::ALL.map(|k| vec![false; g.count(k)]);
    for h in heals {
        h.joined
            .iter()
            .for_each(|&x| part[h.joined_kind.index()][x as usize] = true);
    }
    let kept = |h: &Heal| h.cleared.iter().any(|&x| part[h.joined_kind.index()][x as usize]);
    if heals.iter().any(kept) {
        return None;
    }
    Some(rebuild(g, heals, &removed, &mut leader))
}

fn find(leader: &mut [u32], mut x: u32) -> u32 {
    while leader[x as usize] != x {
        leader[x as usize] = leader[leader[x as usize] as usize];
        x = leader[x as usize];
    }
    x
}

fn rebuild(
    g: &AttributedHypergraph,
    heals: &[Heal],
    removed: &[Vec<bool>; 3],
    leader: &mut [Vec<u32>; 3],
) -> Healed {
    let weights = Kind::ALL.map(|k| g.weights(k));
    let mut parts: [Vec<Vec<u32>>; 3] = Default::default();
    let mut place = Kind::ALL.map(|k| vec![None; g.count(k)]);
    for k in 0..3 {
        let mut slot = vec![None; leader[k].len()];
        for x in 0..leader[k].len() {
            if removed[k][x] {
                continue;
            }
            let root = find(&mut leader[k], x as u32) as usize;
            let at = *slot[root].get_or_insert_with(|| {
                parts[k].push(Vec::new());
                parts[k].len() - 1
            });
            parts[k][at].push(x as u32);
            place[k][x] = Some(at as u32);
        }
        for list in &mut parts[k] {
            list.sort_by(|&a, &b| {
                weights[k][b as usize]
                    .total_cmp(&weights[k][a as usize])
                    .then(a.cmp(&b))
            });
        }
    }
    let graph = rebuilt_graph(g, heals, &weights, &parts, &place);
    let mut cleared = [0, 1, 2].map(|k| vec![false; parts[k].len()]);
    for h in heals {
        let k = h.joined_kind.index();
        let still_there = h.cleared.iter().filter_map(|&x| place[k][x as usize]);
        still_there.for_each(|at| cleared[k][at as usize] = true);
    }
    Healed {
        graph,
        parts,
        cleared,
        price: heals.iter().map(|h| h.price).sum(),
    }
}

fn rebuilt_graph(
    g: &AttributedHypergraph,
    heals: &[Heal],
    weights: &[Vec<f64>; 3],
    parts: &[Vec<Vec<u32>>; 3],
    place: &[Vec<Option<u32>>; 3],
) -> AttributedHypergraph {
    let sound = "elements of a checked hypergraph stay in range";
    let weight = |k: usize, list: &[u32]| weights[k][list[0] as usize];
    let mut h = AttributedHypergraph::new();
    for list in &parts[0] {
        h.add_node(weight(0, list), Vec::new()).expect(sound);
    }
    for list in &parts[1] {
        let ends: Vec<NodeId> = list
            .iter()
            .flat_map(|&c| g.curves()[c as usize].ends.nodes())
            .filter_map(|n| place[0][n.index()].map(NodeId))
            .collect();
        let ends = match ends[..] {
            [] => CurveEnds::Closed,
            [a] => CurveEnds::One(a),
            [a, b, ..] => CurveEnds::Two(a, b),
        };
        let id = h.add_curve(ends, weight(1, list), Vec::new()).expect(sound);
        let price = (list.len() == 1)
            .then(|| g.curves()[list[0] as usize].contract_price)
            .flatten();
        h.set_contract_price(id, price).expect(sound);
        h.set_class(id, g.curves()[list[0] as usize].class).expect(sound);
    }
    for list in &parts[2] {
        let mut boundary = Vec::new();
        for &s in list {
            // The parts of a merged curve bound a sheet together, once for every time the most frequent of them does.
            let mut times = vec![0usize; parts[1].len()];
            for (at, group) in parts[1].iter().enumerate() {
                let count = |c: &u32| g.sheets()[s as usize].curves.iter().filter(|d| d.0 == *c).count();
                times[at] = group.iter().map(count).max().unwrap_or(0);
            }
            for (at, &t) in times.iter().enumerate() {
                boundary.extend(std::iter::repeat_n(CurveId(at as u32), t));
            }
        }
        h.add_sheet(boundary, weight(2, list), Vec::new()).expect(sound);
    }
    for c in g.corners() {
        // Where two sheets were healed across a curve, neither turns at the curve's ends any more.
        let flattened = |x: &Heal| {
            x.joined_kind == Kind::Sheet
                && x.joined.contains(&c.sheet.0)
                && g.curves()[x.removed as usize].ends.nodes().any(|n| n == c.node)
        };
        if let (Some(s), Some(n)) = (place[2][c.sheet.index()], place[0][c.node.index()])
            && !heals.iter().any(flattened)
        {
            h.add_corner(SheetId(s), NodeId(n), c.turn).expect(sound);
        }
    }
    h
}
