//! Step 6: dangling wires that stand for less than the tolerance are removed whole.

use super::complex::Complex;
use super::cover::Cover;
use super::history::{Event, Kind};
use super::measure::Measure;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;

/// Removes each wire between a tip and the next junction when the surface moves by no more than `limit` tolerances without
/// it, the shortest first. Returns the number of wires removed.
pub(crate) fn remove_small_wires(
    complex: &mut Complex,
    measure: &Measure,
    limit: f64,
    cover: &mut Cover,
    history: &mut Vec<Event>,
) -> usize {
    let fine = complex.fine;
    let mut wires: Vec<(f64, u32)> = (0..fine.num_vertices() as u32)
        .filter_map(|tip| complex.wire_at_tip(tip).map(|_| (wire_length(complex, tip), tip)))
        .collect();
    wires.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut removed = 0;
    for (length, tip) in wires {
        let since = complex.log.len();
        let mut at = tip;
        while let Some(edge) = complex.wire_at_tip(at) {
            let next = fine.other_end(edge as usize, at);
            complex.remove_edge(edge, at);
            let junction = complex.vertex_count[next as usize] != 1;
            at = next;
            if junction {
                break;
            }
        }
        if complex.log.len() == since {
            continue;
        }
        let movement = cover.movement(complex, since, Some(limit), limit);
        if movement.worst > limit {
            complex.undo_to(since);
            continue;
        }
        cover.accept(complex, since, movement);
        let tau = measure.tolerance.at(tip);
        history.push(Event::applied(
            Kind::PruneWires,
            length.min(limit * tau),
            fine.vertex_position[tip as usize],
            since,
            complex.log.len(),
        ));
        removed += 1;
    }
    removed
}

/// The whiskers: dangling wires on the borders of sheets, left over where a facet went through one of several free
/// edges or where sheets went before their corner, or brought back for a corner of the surface. A whisker is a tree of wire
/// edges that hangs on a facet and is no longer than `longest` tolerances in all. One flag an edge.
pub(crate) fn whiskers(complex: &Complex, measure: &Measure, longest: f64) -> Vec<bool> {
    let fine = complex.fine;
    let is_wire = |e: u32| complex.edge_alive[e as usize] && complex.edge_count[e as usize] == 0;
    let wires: Vec<u32> = (0..fine.num_edges() as u32).filter(|&e| is_wire(e)).collect();
    let holds_facet = |v: u32| {
        fine.edges_of_vertex(v as usize)
            .any(|e| complex.edge_alive[e as usize] && complex.edge_count[e as usize] > 0)
    };
    let mut place = vec![NONE; fine.num_vertices()];
    let mut trees = DisjointSets::new(wires.len());
    let mut hangs = vec![false; wires.len()];
    for (i, &e) in wires.iter().enumerate() {
        for v in fine.edge_vertices[e as usize] {
            if holds_facet(v) {
                hangs[i] = true;
            } else if place[v as usize] == NONE {
                place[v as usize] = i as u32;
            } else {
                trees.union(place[v as usize], i as u32);
            }
        }
    }
    let mut length = vec![0.0; wires.len()];
    let mut on_sheet = vec![false; wires.len()];
    for (i, &e) in wires.iter().enumerate() {
        let root = trees.find(i as u32) as usize;
        let [a, b] = fine.edge_vertices[e as usize].map(|v| fine.vertex_position[v as usize]);
        length[root] += a.distance(b);
        on_sheet[root] |= hangs[i];
    }
    let mut whisker = vec![false; fine.num_edges()];
    for (i, &e) in wires.iter().enumerate() {
        let root = trees.find(i as u32) as usize;
        let tau = measure.tolerance.over(&fine.edge_vertices[e as usize]);
        whisker[e as usize] = on_sheet[root] && length[root] <= longest * tau;
    }
    whisker
}

/// Removes the whiskers, which would keep the sheets from growing back. Returns the number of edges removed.
pub(crate) fn remove_whiskers(complex: &mut Complex, measure: &Measure, longest: f64) -> usize {
    let fine = complex.fine;
    let whisker = whiskers(complex, measure, longest);
    let mut removed = 0;
    for tip in 0..fine.num_vertices() as u32 {
        let mut at = tip;
        while let Some(edge) = complex.wire_at_tip(at).filter(|&e| whisker[e as usize]) {
            let next = fine.other_end(edge as usize, at);
            complex.remove_edge(edge, at);
            removed += 1;
            at = next;
        }
    }
    removed
}

/// Length of the wire from a tip to the next junction.
fn wire_length(complex: &Complex, tip: u32) -> f64 {
    let fine = complex.fine;
    let (mut at, mut last, mut length) = (tip, u32::MAX, 0.0);
    loop {
        let mut edges = fine
            .edges_of_vertex(at as usize)
            .filter(|&e| complex.edge_alive[e as usize] && e != last);
        let (Some(edge), None) = (edges.next(), edges.next()) else {
            return length;
        };
        if complex.edge_count[edge as usize] > 0 {
            return length;
        }
        let next = fine.other_end(edge as usize, at);
        length += fine.vertex_position[at as usize].distance(fine.vertex_position[next as usize]);
        (at, last) = (next, edge);
    }
}
