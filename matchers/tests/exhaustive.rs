//! Edit distance against exhaustive search on every pair of small graphs.
//!
//! `MEDIAL_SLOW=1 cargo test --release -p matchers --test exhaustive -- --nocapture` goes through all graphs of up to 6 nodes without
//! heals and of up to 4 with them, and prints what it compared; without it every test takes a sample.

mod common;

use common::{random_hypergraph, settings_scales};
use matchers::edit_distance::branch_and_bound::{root_lower_bound, search};
use matchers::edit_distance::healing::{Healed, apply, candidates};
use matchers::edit_distance::{EditSettings, Heal, Operation, edit_distance};
use matchers::graduated_assignment::{MatchSettings, match_hypergraphs};
use matchers::hypergraph::Kind;
use matchers::matching_problem::{AttributeScales, Side};
use matchers::{
    AttributedHypergraph, CurveEnds, CurveId, ElementCosts, EvidenceSettings, MatchingProblem, NodeId, Table,
    assignment,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

fn slow() -> bool {
    std::env::var_os("MEDIAL_SLOW").is_some()
}

/// A graph by its edges.
#[derive(Clone, Debug)]
struct Plain {
    nodes: usize,
    edges: Vec<(u32, u32)>,
}

/// All partial one-to-one maps of n to m elements.
fn partial_maps(n: usize, m: usize) -> Vec<Vec<Option<usize>>> {
    let mut all = vec![Vec::new()];
    for _ in 0..n {
        all = all
            .into_iter()
            .flat_map(|map: Vec<Option<usize>>| {
                std::iter::once(None)
                    .chain((0..m).map(Some))
                    .filter(|y| y.is_none() || !map.contains(y))
                    .map(|y| [map.clone(), vec![y]].concat())
                    .collect::<Vec<_>>()
            })
            .collect();
    }
    all
}

/// All graphs of n nodes that differ by more than their numbering.
fn all_graphs(n: usize) -> Vec<Plain> {
    let pairs: Vec<(u32, u32)> = (0..n as u32).flat_map(|a| (0..a).map(move |b| (b, a))).collect();
    let orders: Vec<Vec<usize>> = partial_maps(n, n)
        .into_iter()
        .filter_map(|m| m.into_iter().collect())
        .collect();
    // Where every pair goes in every order.
    let moved: Vec<Vec<u32>> = orders
        .iter()
        .map(|o| {
            let place = |&(a, b): &(u32, u32)| {
                let (a, b) = (o[a as usize] as u32, o[b as usize] as u32);
                let wanted = (a.min(b), a.max(b));
                pairs.iter().position(|&p| p == wanted).expect("a pair") as u32
            };
            pairs.iter().map(place).collect()
        })
        .collect();
    let mut seen = vec![false; 1 << pairs.len()];
    let mut graphs = Vec::new();
    for mask in 0..1u32 << pairs.len() {
        if seen[mask as usize] {
            continue;
        }
        let set: Vec<usize> = (0..pairs.len()).filter(|k| mask >> k & 1 == 1).collect();
        for to in &moved {
            seen[set.iter().map(|&k| 1usize << to[k]).sum::<usize>()] = true;
        }
        let edges = set.iter().map(|&k| pairs[k]).collect();
        graphs.push(Plain { nodes: n, edges });
    }
    graphs
}

fn graphs_up_to(most: usize) -> Vec<Plain> {
    (0..=most).flat_map(all_graphs).collect()
}

/// What the elements of the graphs are like.
#[derive(Clone, Copy, Debug)]
enum Dress {
    /// All weights one, no attributes: nothing but structure, the hardest case for bounds.
    Bare,
    /// Weights, radii and lengths of their own, some alike and some far apart.
    Attributed,
}

impl Dress {
    fn graph(self, plain: &Plain, seed: u64) -> AttributedHypergraph {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut g = AttributedHypergraph::new();
        let mut draw = |low: f64, high: f64| match self {
            Dress::Bare => 1.0,
            Dress::Attributed => rng.random_range(low..high),
        };
        for _ in 0..plain.nodes {
            let (weight, radius) = (draw(0.2, 2.0), draw(1.0, 6.0));
            g.add_node(weight, vec![radius]).unwrap();
        }
        for &(a, b) in &plain.edges {
            let (weight, length, bend) = (draw(0.2, 3.0), draw(2.0, 20.0), draw(0.0, 3.0));
            let ends = CurveEnds::Two(NodeId(a), NodeId(b));
            let c = g.add_curve(ends, weight, vec![length, bend]).unwrap();
            g.set_contract_price(c, Some(0.4 * weight)).unwrap();
        }
        g
    }

    fn scales(self) -> AttributeScales {
        settings_scales()
    }
}

/// The cheapest price over all maps of the nodes. With the nodes fixed the curves are independent of one another, and the best
/// partial assignment of curves is an LSAP, which `assignment.rs` checks against brute force. Maps are tried in the order of
/// what their curves would gain if they could share partners, until that is no more than the best found.
fn exhaustive(problem: &MatchingProblem, maps: &[Vec<Option<usize>>]) -> f64 {
    let (n, m) = (problem.target.count(1), problem.source.count(1));
    let (nodes_t, nodes_s) = (problem.target.count(0), problem.source.count(0));
    let ends = |side: &Side, curve: usize| -> Vec<(usize, f64)> {
        let list = &side.incidences[0].backward[curve];
        list.iter().map(|i| (i.element as usize, i.strength)).collect()
    };
    let target_ends: Vec<_> = (0..n).map(|e| ends(&problem.target, e)).collect();
    let source_ends: Vec<_> = (0..m).map(|f| ends(&problem.source, f)).collect();
    // What curves e and f gain when the ends of e, in their order, go to the nodes given.
    let gain = |e: usize, f: usize, images: &[Option<usize>]| {
        let mut gain = problem.pair_gain(1, e, f);
        for (&(_, q), image) in target_ends[e].iter().zip(images) {
            for &(y, r) in &source_ends[f] {
                if *image == Some(y) {
                    gain += 2.0 * q.min(r);
                }
            }
        }
        gain.max(0.0)
    };
    let place = |image: Option<usize>| image.map_or(nodes_s, |y| y);
    let image = |place: usize| (place < nodes_s).then_some(place);
    let width = nodes_s + 1;
    let best_of_row: Vec<Vec<f64>> = (0..n)
        .map(|e| {
            (0..width * width)
                .map(|k| {
                    let images = [image(k / width), image(k % width)];
                    (0..m).map(|f| gain(e, f, &images)).fold(0.0, f64::max)
                })
                .collect()
        })
        .collect();
    let images = |map: &[Option<usize>], e: usize| -> [Option<usize>; 2] {
        let mut list = target_ends[e].iter().map(|&(x, _)| map[x]);
        [list.next().flatten(), list.next().flatten()]
    };
    let own: Vec<Vec<f64>> = (0..nodes_t)
        .map(|x| (0..nodes_s).map(|y| problem.pair_gain(0, x, y)).collect())
        .collect();
    let nodes = |map: &[Option<usize>]| -> f64 {
        let pairs = map.iter().enumerate().filter_map(|(x, y)| y.map(|y| own[x][y]));
        pairs.sum()
    };
    let mut order: Vec<(f64, usize)> = maps
        .iter()
        .enumerate()
        .map(|(k, map)| {
            let curves = (0..n).map(|e| {
                let [a, b] = images(map, e);
                best_of_row[e][place(a) * width + place(b)]
            });
            (nodes(map) + curves.sum::<f64>(), k)
        })
        .collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = 0.0;
    for (ceiling, k) in order {
        if ceiling <= best {
            break;
        }
        let table = Table::from_fn(n, m, |e, f| gain(e, f, &images(&maps[k], e)));
        let curves = -assignment::solve_max(&table).unwrap().cost;
        best = f64::max(best, nodes(&maps[k]) + curves);
    }
    problem.total() - best
}

fn without_heals() -> EditSettings {
    EditSettings {
        contract: false,
        merge: false,
        ..EditSettings::default()
    }
}

fn check_pair(dress: Dress, (t, ts): (&Plain, u64), (s, ss): (&Plain, u64), maps: &[Vec<Option<usize>>]) {
    let (g, h) = (dress.graph(t, ts), dress.graph(s, ss));
    let costs = ElementCosts::from_attributes(&g, &h, &dress.scales()).unwrap();
    let problem = MatchingProblem::new(&g, &h, &costs, &EvidenceSettings::default()).unwrap();
    let truth = exhaustive(&problem, maps);
    let d = edit_distance(&g, &h, &costs, &without_heals()).unwrap();
    let eps = 1e-9 * problem.total().max(1.0);
    assert!(d.exact, "{t:?} {s:?}");
    assert!(
        (d.upper_bound - truth).abs() < eps && d.lower_bound <= truth + eps,
        "{dress:?} {t:?} {s:?}: {} {truth}",
        d.upper_bound
    );
    assert!(root_lower_bound(&problem) <= truth + eps);
}

fn check_pairs(dress: Dress, most: usize, every: usize) {
    let graphs = graphs_up_to(most);
    let maps: Vec<Vec<_>> = (0..=most)
        .map(|n| (0..=most).map(|m| partial_maps(n, m)).collect())
        .collect();
    let pairs: Vec<(usize, usize)> = (0..graphs.len())
        .flat_map(|k| (0..=k).map(move |l| (k, l)))
        .collect();
    let chosen: Vec<_> = pairs.iter().step_by(every).collect();
    chosen.par_iter().for_each(|&&(k, l)| {
        let (t, s) = (&graphs[k], &graphs[l]);
        check_pair(
            dress,
            (t, k as u64),
            (s, 1000 + l as u64),
            &maps[t.nodes][s.nodes],
        );
    });
    println!(
        "{dress:?}: {} of {} pairs of up to {most} nodes",
        chosen.len(),
        pairs.len()
    );
}

/// All 21 945 pairs of the 209 graphs when slow; else all 190 of the 19 graphs of up to 4 nodes and a sample beyond.
#[test]
fn equals_exhaustive_search_on_all_pairs_of_bare_graphs() {
    assert_eq!(
        (0..=6).map(|n| all_graphs(n).len()).collect::<Vec<_>>(),
        [1, 1, 2, 4, 11, 34, 156]
    );
    if slow() {
        check_pairs(Dress::Bare, 6, 1);
    } else {
        check_pairs(Dress::Bare, 4, 1);
        check_pairs(Dress::Bare, 6, 499);
    }
}

/// The same with weights and attributes, where leaving an element out may be cheaper than deforming it.
#[test]
fn equals_exhaustive_search_on_all_pairs_of_attributed_graphs() {
    if slow() {
        check_pairs(Dress::Attributed, 6, 1);
    } else {
        check_pairs(Dress::Attributed, 4, 1);
        check_pairs(Dress::Attributed, 6, 499);
    }
}

/// Every set of heals that does not contradict itself.
fn heal_sets(g: &AttributedHypergraph) -> Vec<Healed> {
    let all = candidates(g, &Side::new(g, &EvidenceSettings::default()), true, true);
    let mut found = Vec::new();
    let mut chosen = Vec::new();
    extend(g, &all, 0, &mut chosen, &mut found);
    found
}

fn extend(
    g: &AttributedHypergraph,
    all: &[Heal],
    next: usize,
    chosen: &mut Vec<Heal>,
    found: &mut Vec<Healed>,
) {
    // A set that contradicts itself does so in every larger set.
    let Some(healed) = apply(g, chosen) else {
        return;
    };
    found.push(healed);
    for k in next..all.len() {
        chosen.push(all[k].clone());
        extend(g, all, k + 1, chosen, found);
        chosen.pop();
    }
}

/// Cheapest over all sets of heals of both sides, by `solve` of the healed problem and the least gain worth solving for.
fn exhaustive_heals(
    (g, h): (&AttributedHypergraph, &AttributedHypergraph),
    costs: &ElementCosts,
    solve: impl Fn(&MatchingProblem) -> f64,
) -> f64 {
    let evidence = EvidenceSettings::default();
    let (tg, th) = (heal_sets(g), heal_sets(h));
    let mut best = f64::INFINITY;
    let mut solved: Vec<(MatchingProblem, f64)> = Vec::new();
    for a in &tg {
        for b in &th {
            let price = a.price + b.price;
            if price >= best {
                continue;
            }
            let table = |kind: Kind| {
                let (t, s) = (&a.parts[kind.index()], &b.parts[kind.index()]);
                let gone = |r: usize, c: usize| a.cleared[kind.index()][r] || b.cleared[kind.index()][c];
                Table::from_fn(t.len(), s.len(), |r, c| {
                    if gone(r, c) {
                        return f64::INFINITY;
                    }
                    costs.of(kind)[(t[r][0] as usize, s[c][0] as usize)]
                })
            };
            let healed_costs = ElementCosts {
                nodes: table(Kind::Node),
                curves: table(Kind::Curve),
                sheets: table(Kind::Sheet),
            };
            let problem = MatchingProblem::new(&a.graph, &b.graph, &healed_costs, &evidence).unwrap();
            let known = solved.iter().find(|k| k.0 == problem).map(|k| k.1);
            let rest = known.unwrap_or_else(|| solve(&problem));
            if known.is_none() && solved.len() < 64 {
                solved.push((problem, rest));
            }
            best = best.min(price + rest);
        }
    }
    best
}

/// All pairs of graphs of up to 4 nodes when slow, else of up to 3, with contractions and merges.
#[test]
fn with_heals_equals_exhaustive_search_on_all_pairs_of_graphs() {
    let most = if slow() { 4 } else { 3 };
    let graphs = graphs_up_to(most);
    let maps: Vec<Vec<_>> = (0..=most)
        .map(|n| (0..=most).map(|m| partial_maps(n, m)).collect())
        .collect();
    let solve = |p: &MatchingProblem| exhaustive(p, &maps[p.target.count(0)][p.source.count(0)]);
    let pairs: Vec<(usize, usize)> = (0..graphs.len())
        .flat_map(|k| (0..=k).map(move |l| (k, l)))
        .collect();
    let healed: Vec<(bool, usize)> = pairs
        .par_iter()
        .flat_map_iter(|&(k, l)| [(Dress::Bare, k, l), (Dress::Attributed, k, l)])
        .map(|(dress, k, l)| {
            let (g, h) = (
                dress.graph(&graphs[k], k as u64),
                dress.graph(&graphs[l], 1000 + l as u64),
            );
            let costs = ElementCosts::from_attributes(&g, &h, &dress.scales()).unwrap();
            let truth = exhaustive_heals((&g, &h), &costs, solve);
            let d = edit_distance(&g, &h, &costs, &EditSettings::default()).unwrap();
            let case = format!("{dress:?} {:?} {:?}: {d:?} {truth}", graphs[k], graphs[l]);
            assert!(d.exact, "{case}");
            assert!(
                d.lower_bound <= truth + 1e-9 && truth <= d.upper_bound + 1e-9,
                "{case}"
            );
            assert!((d.upper_bound - truth).abs() < 1e-9, "{case}");
            (d.operations.iter().any(is_heal), d.search_nodes)
        })
        .collect();
    let used = healed.iter().filter(|h| h.0).count();
    let longest = healed.iter().map(|h| h.1).max();
    println!(
        "{} pairs of up to {most} nodes with heals, {used} healed, all proven within {longest:?} search nodes",
        healed.len()
    );
    assert!(used > 0, "no case needed a heal");
}

fn is_heal(o: &Operation) -> bool {
    matches!(o, Operation::Contract { .. } | Operation::Merge { .. })
}

/// Hypergraphs with sheets and corners, every set of heals solved by branch and bound.
#[test]
fn with_heals_equals_exhaustive_search_on_hypergraphs() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let (mut checked, mut healed) = (0, 0);
    let wanted = if slow() { 200 } else { 20 };
    while checked < wanted {
        let g = random_hypergraph(&mut rng, 3, 3, 2);
        let h = random_hypergraph(&mut rng, 2, 3, 2);
        if heal_sets(&g).len() * heal_sets(&h).len() > 4000 {
            continue;
        }
        let costs = ElementCosts::from_attributes(&g, &h, &settings_scales()).unwrap();
        let d = edit_distance(&g, &h, &costs, &EditSettings::default()).unwrap();
        let solve = |p: &MatchingProblem| {
            let first = match_hypergraphs(p, &[], &MatchSettings::default());
            search(p, &first.map, 1_000_000).upper_bound
        };
        let truth = exhaustive_heals((&g, &h), &costs, solve);
        assert!(d.exact);
        assert!((d.upper_bound - truth).abs() < 1e-9, "{} {truth}", d.upper_bound);
        healed += usize::from(d.operations.iter().any(is_heal));
        checked += 1;
    }
    assert!(healed > 0, "no case needed a heal");
}

/// A pair of parallel curves and a loop are elements of their own.
#[test]
fn loops_and_parallel_curves_are_told_apart() {
    let graph = |ends: &[(u32, u32)]| {
        let mut g = AttributedHypergraph::new();
        let a = g.add_node(1.0, vec![1.0]).unwrap();
        let b = g.add_node(1.0, vec![1.0]).unwrap();
        for &(x, y) in ends {
            let at = |k: u32| if k == 0 { a } else { b };
            g.add_curve(CurveEnds::Two(at(x), at(y)), 1.0, vec![5.0, 1.0])
                .unwrap();
        }
        let all = (0..ends.len()).map(CurveId::from_index).collect();
        g.add_sheet(all, 2.0, vec![9.0]).unwrap();
        g
    };
    let distance = |g: &AttributedHypergraph, h: &AttributedHypergraph| {
        let costs = ElementCosts::from_attributes(g, h, &settings_scales()).unwrap();
        let d = edit_distance(g, h, &costs, &without_heals()).unwrap();
        assert!(d.exact);
        d.upper_bound
    };
    let (single, parallel, looped) = (
        graph(&[(0, 1)]),
        graph(&[(0, 1), (0, 1)]),
        graph(&[(0, 1), (0, 0)]),
    );
    // A curve more: its weight 1, its two ends and its place on the sheet 0.5 each.
    assert!((distance(&single, &parallel) - 2.5).abs() < 1e-12);
    assert!((distance(&single, &looped) - 2.5).abs() < 1e-12);
    // One end moves from one node to the other: gone there, doubled here.
    assert!((distance(&parallel, &looped) - 1.0).abs() < 1e-12);
}
