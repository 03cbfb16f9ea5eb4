//! Nodes where nothing ends are none: where just two curves of one kind meet, they are one curve.
//!
//! A contraction leaves such a node where what it shrank hung on one curve alone (the seam of an axial curve that was hidden or
//! shrunk later); a view leaves one where the other curves went. Cost `O(curves + nodes)`.

use super::hypergraph::{Curve, CurveKind};
use crate::geometry::{CurveId, NodeId, SheetId};

/// Joins the curves at nodes where just two of one kind and of the same sheets end, their fine edges with them, and numbers curves and
/// nodes afresh; a node that is a corner stays. Returns the new number of each node, `None` for those that are gone.
pub(crate) fn dissolve(
    curves: &mut Vec<Curve>,
    edges: &mut Vec<Vec<u32>>,
    is_corner: &[bool],
) -> Vec<Option<NodeId>> {
    let nodes = is_corner.len();
    let ends = |curves: &[Curve]| {
        let mut any = vec![false; nodes];
        for n in curves.iter().flat_map(|c| &c.nodes) {
            any[n.index()] = true;
        }
        any
    };
    let before = ends(curves);
    join_curves(curves, edges, nodes, |node, a, b| {
        !is_corner[node]
            && matches!(a.kind, CurveKind::Rib | CurveKind::Axial)
            && sheets_of(a) == sheets_of(b)
    });
    let after = ends(curves);
    let mut next = 0;
    let number: Vec<Option<NodeId>> = before
        .into_iter()
        .zip(after)
        .map(|(before, after)| {
            (after || !before).then(|| {
                next += 1;
                NodeId::from_index(next - 1)
            })
        })
        .collect();
    for (i, c) in curves.iter_mut().enumerate() {
        c.id = CurveId::from_index(i);
        c.nodes = c.nodes.iter().filter_map(|n| number[n.index()]).collect();
    }
    number
}

fn sheets_of(curve: &Curve) -> Vec<SheetId> {
    let mut sheets = curve.sheets.clone();
    sheets.sort_unstable();
    sheets
}

/// Joins curves of one kind at nodes where nothing else ends and that `may` be joined. `edges` are what goes with each curve, in
/// order along it.
pub(crate) fn join_curves(
    curves: &mut Vec<Curve>,
    edges: &mut Vec<Vec<u32>>,
    nodes: usize,
    may: impl Fn(usize, &Curve, &Curve) -> bool,
) {
    edges.resize(curves.len(), Vec::new());
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); nodes];
    for (i, c) in curves.iter().enumerate() {
        for n in &c.nodes {
            at[n.index()].push(i);
        }
    }
    let mut gone = vec![false; curves.len()];
    for n in 0..nodes {
        let &[a, b] = at[n].as_slice() else { continue };
        let node = NodeId::from_index(n);
        if curves[a].kind != curves[b].kind || !may(n, &curves[a], &curves[b]) {
            continue;
        }
        if a == b {
            // A loop through a node that nothing else ends at: a closed curve without nodes.
            let c = &mut curves[a];
            c.nodes.clear();
            c.closed = true;
            if c.polyline.len() > 1 {
                c.polyline.pop();
            }
            continue;
        }
        join(curves, edges, &mut at, &mut gone, [a, b], node);
    }
    let mut keep = gone.iter().map(|g| !g);
    curves.retain(|_| keep.next().unwrap_or(true));
    let mut keep = gone.iter().map(|g| !g);
    edges.retain(|_| keep.next().unwrap_or(true));
}

/// Appends the second of two curves to the first at the node where both end. `at` are the curves at each node.
fn join(
    curves: &mut [Curve],
    edges: &mut [Vec<u32>],
    at: &mut [Vec<usize>],
    gone: &mut [bool],
    [a, b]: [usize; 2],
    node: NodeId,
) {
    let second = curves[b].clone();
    let mut second_edges = std::mem::take(&mut edges[b]);
    let first = &mut curves[a];
    if first.nodes[1] != node {
        first.nodes.reverse();
        first.polyline.reverse();
        edges[a].reverse();
    }
    let mut tail = second.polyline;
    let mut far = second.nodes;
    if far[0] != node {
        far.reverse();
        tail.reverse();
        second_edges.reverse();
    }
    first.polyline.extend(tail.into_iter().skip(1));
    edges[a].extend(second_edges);
    first.nodes[1] = far[1];
    first.closed = first.nodes[0] == first.nodes[1];
    first.length += second.length;
    let mut others = second.sheets;
    if second.persistence > first.persistence {
        first.persistence = second.persistence;
        // The order of the sheets is that of the most persistent place.
        std::mem::swap(&mut first.sheets, &mut others);
    }
    others.retain(|s| !first.sheets.contains(s));
    first.sheets.extend(others);
    gone[b] = true;
    // The far end now belongs to the joined curve.
    for slot in &mut at[far[1].index()] {
        if *slot == b {
            *slot = a;
        }
    }
}

/// Joins axial curves that go on through a node where only ribs and seams end beside them: two that share two sheets at least. A seam
/// that meets a curve from the side does not make it two. What ends there
/// beside them hung on something that is not shown, or the third sheet of each, a fin, stops short of the node: A1A3 ends that face each
/// other and that a seam made one (merge A1A3-II). In the next sampling the curve runs through. The fins stay two sheets, both
/// named by the joined curve; the ribs keep the node.
pub(crate) fn join_facing(curves: &mut Vec<Curve>, nodes: usize) {
    let mut edges = vec![Vec::new(); curves.len()];
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); nodes];
    for (i, c) in curves.iter().enumerate() {
        for n in &c.nodes {
            at[n.index()].push(i);
        }
    }
    let kind = |c: usize| curves[c].kind;
    let goes_on = |own: &[usize]| {
        let axial: Vec<usize> = own
            .iter()
            .copied()
            .filter(|&c| kind(c) == CurveKind::Axial)
            .collect();
        let &[a, b] = axial.as_slice() else { return false };
        own.iter()
            .all(|&c| matches!(kind(c), CurveKind::Axial | CurveKind::Rib | CurveKind::Seam))
            && a != b
            && shared(&curves[a].sheets, &curves[b].sheets) >= 2
    };
    let places: Vec<usize> = (0..nodes).filter(|&n| goes_on(&at[n])).collect();
    let mut gone = vec![false; curves.len()];
    for n in places {
        let axial: Vec<usize> = at[n]
            .iter()
            .copied()
            .filter(|&c| curves[c].kind == CurveKind::Axial)
            .collect();
        // Curves that go on in a ring end in a loop through the last node.
        if let &[a, b] = axial.as_slice()
            && a != b
        {
            join(
                curves,
                &mut edges,
                &mut at,
                &mut gone,
                [a, b],
                NodeId::from_index(n),
            );
            at[n].retain(|&c| c != a && c != b);
        }
    }
    let mut keep = gone.iter().map(|g| !g);
    curves.retain(|_| keep.next().unwrap_or(true));
}

/// How many entries two lists share, each entry of one with one of the other.
fn shared(first: &[SheetId], second: &[SheetId]) -> usize {
    let mut left = second.to_vec();
    let with = |s: &&SheetId| match left.iter().position(|t| t == *s) {
        Some(k) => {
            left.swap_remove(k);
            true
        }
        None => false,
    };
    first.iter().filter(with).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coarse_scaffold::MedialPoint;
    use glam::DVec3;

    fn rib(nodes: [u32; 2], sheet: u32, x: [f64; 2]) -> Curve {
        let point = |x: f64| MedialPoint {
            position: DVec3::new(x, 0.0, 0.0),
            radius: 1.0,
        };
        Curve {
            id: CurveId(0),
            kind: CurveKind::Rib,
            persistence: x[1],
            nodes: nodes.map(NodeId).to_vec(),
            closed: nodes[0] == nodes[1],
            sheets: vec![SheetId(sheet)],
            length: (x[1] - x[0]).abs(),
            polyline: x.map(point).to_vec(),
        }
    }

    #[test]
    fn two_ribs_of_one_sheet_become_one_and_ribs_of_two_sheets_do_not() {
        // Node 1 lies in the middle of a rib, told from its far end; node 3 has none of the curves, as a lone ball.
        let mut curves = vec![
            rib([1, 0], 0, [1.0, 0.0]),
            rib([1, 2], 0, [1.0, 3.0]),
            rib([2, 0], 1, [3.0, 9.0]),
        ];
        let mut edges = vec![vec![11, 10], vec![12, 13], vec![14]];
        let number = dissolve(&mut curves, &mut edges, &[false; 4]);
        assert_eq!(number, [Some(NodeId(0)), None, Some(NodeId(1)), Some(NodeId(2))]);
        assert_eq!(curves.len(), 2);
        assert_eq!(edges, [vec![10, 11, 12, 13], vec![14]]);
        let line: Vec<f64> = curves[0].polyline.iter().map(|p| p.position.x).collect();
        assert_eq!(line, [0.0, 1.0, 3.0]);
        assert_eq!((curves[0].length, curves[0].persistence), (3.0, 3.0));
        assert_eq!(curves[0].nodes, [NodeId(0), NodeId(1)]);
        assert_eq!(curves[1].nodes, [NodeId(1), NodeId(0)]);
        assert_eq!(curves[1].id, CurveId(1));
    }

    #[test]
    fn ribs_stay_two_at_a_corner() {
        let mut curves = vec![rib([1, 0], 0, [1.0, 0.0]), rib([1, 0], 0, [1.0, 3.0])];
        let number = dissolve(&mut curves, &mut vec![vec![1], vec![2]], &[false, true]);
        assert_eq!(number, [None, Some(NodeId(0))]);
        assert_eq!((curves.len(), curves[0].closed), (1, true));
        assert_eq!(curves[0].nodes, [NodeId(0), NodeId(0)]);
    }

    #[test]
    fn a_loop_through_its_only_node_is_a_closed_curve() {
        let mut curves = vec![rib([0, 0], 0, [0.0, 1.0])];
        let start = curves[0].polyline[0];
        curves[0].polyline.push(start);
        let number = dissolve(&mut curves, &mut vec![vec![5, 6]], &[false]);
        assert_eq!(number, [None]);
        assert!(curves[0].nodes.is_empty() && curves[0].closed);
        assert_eq!(curves[0].polyline.len(), 2);
    }
}
