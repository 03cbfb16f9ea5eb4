//! Random hypergraphs shared by the tests.
#![allow(dead_code)] // each test file uses its part

use matchers::edit_distance::Heal;
use matchers::edit_distance::healing::{apply, candidates, unhealed};
use matchers::hypergraph::Kind;
use matchers::matching_problem::{AttributeScales, Side};
use matchers::{
    AttributedHypergraph, CurveEnds, CurveId, ElementCosts, EvidenceSettings, MatchingProblem, NodeId,
    SheetId,
};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Prices of the attributes that [`random_hypergraph`] makes.
pub fn settings_scales() -> AttributeScales {
    AttributeScales {
        nodes: vec![0.4],
        curves: vec![0.2, 0.1],
        sheets: vec![0.2],
    }
}

/// The problem of two random hypergraphs.
pub fn problem_of(g: &AttributedHypergraph, h: &AttributedHypergraph) -> MatchingProblem {
    let costs = ElementCosts::from_attributes(g, h, &settings_scales()).unwrap();
    MatchingProblem::new(g, h, &costs, &EvidenceSettings::default()).unwrap()
}

/// Nodes, curves (loops, parallel and closed ones among them) and sheets with random weights and attributes.
pub fn random_hypergraph(
    rng: &mut ChaCha8Rng,
    nodes: usize,
    curves: usize,
    sheets: usize,
) -> AttributedHypergraph {
    let mut g = AttributedHypergraph::new();
    for _ in 0..nodes {
        g.add_node(rng.random_range(0.2..2.0), vec![rng.random_range(1.0..6.0)])
            .unwrap();
    }
    for _ in 0..curves {
        let ends = if nodes == 0 || rng.random::<f64>() < 0.1 {
            CurveEnds::Closed
        } else {
            let end = |rng: &mut ChaCha8Rng| NodeId::from_index(rng.random_range(0..nodes));
            CurveEnds::Two(end(rng), end(rng))
        };
        let attributes = vec![rng.random_range(2.0..20.0), rng.random_range(0.0..3.0)];
        // Its two ends must come together; one curve in seven is short.
        let price = attributes[0] * if rng.random::<f64>() < 0.15 { 0.1 } else { 1.0 };
        let c = g.add_curve(ends, rng.random_range(0.2..3.0), attributes).unwrap();
        g.set_contract_price(c, Some(price)).unwrap();
    }
    for _ in 0..sheets {
        let boundary = 0..rng.random_range(0..4).min(curves);
        let list: Vec<_> = boundary
            .map(|_| CurveId::from_index(rng.random_range(0..curves)))
            .collect();
        let s = g
            .add_sheet(
                list,
                rng.random_range(0.5..4.0),
                vec![rng.random_range(5.0..30.0)],
            )
            .unwrap();
        if nodes > 0 {
            g.add_corner(
                s,
                NodeId::from_index(rng.random_range(0..nodes)),
                rng.random_range(0.0..1.0),
            )
            .unwrap();
        }
    }
    g
}

/// The same hypergraph with all elements in another order; also the new place of every old element.
pub fn permuted(g: &AttributedHypergraph, rng: &mut ChaCha8Rng) -> (AttributedHypergraph, [Vec<usize>; 3]) {
    let shuffled = |n: usize, rng: &mut ChaCha8Rng| {
        let mut order: Vec<usize> = (0..n).collect();
        order.shuffle(rng);
        order
    };
    let orders = Kind::ALL.map(|k| shuffled(g.count(k), rng));
    let mut places = Kind::ALL.map(|k| vec![0; g.count(k)]);
    for k in 0..3 {
        orders[k]
            .iter()
            .enumerate()
            .for_each(|(new, &old)| places[k][old] = new);
    }
    let mut h = AttributedHypergraph::new();
    for &old in &orders[0] {
        let n = &g.nodes()[old];
        h.add_node(n.weight, n.attributes.clone()).unwrap();
    }
    let node = |n: NodeId| NodeId::from_index(places[0][n.index()]);
    for &old in &orders[1] {
        let c = &g.curves()[old];
        let ends = match c.ends {
            CurveEnds::Closed => CurveEnds::Closed,
            CurveEnds::One(a) => CurveEnds::One(node(a)),
            CurveEnds::Two(a, b) => CurveEnds::Two(node(b), node(a)),
        };
        let id = h.add_curve(ends, c.weight, c.attributes.clone()).unwrap();
        h.set_contract_price(id, c.contract_price).unwrap();
        h.set_class(id, c.class).unwrap();
    }
    for &old in &orders[2] {
        let s = &g.sheets()[old];
        let mut curves: Vec<_> = s
            .curves
            .iter()
            .map(|c| CurveId::from_index(places[1][c.index()]))
            .collect();
        curves.shuffle(rng);
        h.add_sheet(curves, s.weight, s.attributes.clone()).unwrap();
    }
    for c in g.corners() {
        h.add_corner(
            SheetId::from_index(places[2][c.sheet.index()]),
            node(c.node),
            c.turn,
        )
        .unwrap();
    }
    (h, places)
}

/// The hypergraph after a few heals and splices, with weights and attributes that differ by some `jitter`.
pub fn edited(
    g: &AttributedHypergraph,
    rng: &mut ChaCha8Rng,
    (heals, splices, jitter): (usize, usize, f64),
) -> AttributedHypergraph {
    let side = Side::new(g, &EvidenceSettings::default());
    let all = candidates(g, &side, true, true);
    let mut chosen: Vec<Heal> = Vec::new();
    let mut healed = unhealed(g);
    for _ in 0..if all.is_empty() { 0 } else { heals } {
        chosen.push(all[rng.random_range(0..all.len())].clone());
        match apply(g, &chosen) {
            Some(more) => healed = more,
            None => {
                chosen.pop();
            }
        }
    }
    let h = &healed.graph;
    let mut gone = Kind::ALL.map(|k| vec![false; h.count(k)]);
    for _ in 0..splices {
        let kind = Kind::ALL[rng.random_range(0..3)];
        if h.count(kind) > 0 {
            gone[kind.index()][rng.random_range(0..h.count(kind))] = true;
        }
    }
    let mut place = Kind::ALL.map(|k| vec![None; h.count(k)]);
    let mut other = |value: f64| value * (1.0 + jitter * rng.random_range(-1.0..1.0));
    let mut attributes = |kind: Kind, x: usize| -> Vec<f64> {
        let first = healed.parts[kind.index()][x][0] as usize;
        g.attributes(kind, first).iter().map(|&a| other(a)).collect()
    };
    let mut out = AttributedHypergraph::new();
    for (x, node) in h.nodes().iter().enumerate().filter(|(x, _)| !gone[0][*x]) {
        let list = attributes(Kind::Node, x);
        place[0][x] = Some(out.add_node(node.weight, list).unwrap().0);
    }
    for (x, curve) in h.curves().iter().enumerate().filter(|(x, _)| !gone[1][*x]) {
        let ends: Vec<NodeId> = curve
            .ends
            .nodes()
            .filter_map(|n| place[0][n.index()].map(NodeId))
            .collect();
        let ends = match ends[..] {
            [] => CurveEnds::Closed,
            [a] => CurveEnds::One(a),
            [a, b, ..] => CurveEnds::Two(a, b),
        };
        let list = attributes(Kind::Curve, x);
        let id = out.add_curve(ends, curve.weight, list).unwrap();
        out.set_contract_price(id, curve.contract_price).unwrap();
        out.set_class(id, curve.class).unwrap();
        place[1][x] = Some(id.0);
    }
    for (x, sheet) in h.sheets().iter().enumerate().filter(|(x, _)| !gone[2][*x]) {
        let curves = sheet
            .curves
            .iter()
            .filter_map(|c| place[1][c.index()].map(CurveId));
        let list = attributes(Kind::Sheet, x);
        let id = out.add_sheet(curves.collect(), sheet.weight, list).unwrap();
        place[2][x] = Some(id.0);
    }
    for c in h.corners() {
        if let (Some(s), Some(n)) = (place[2][c.sheet.index()], place[0][c.node.index()]) {
            out.add_corner(SheetId(s), NodeId(n), c.turn).unwrap();
        }
    }
    out
}
