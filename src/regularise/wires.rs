//! Step 6: dangling wires that stand for less than the tolerance are removed whole.

use super::complex::Complex;
use super::cover::Cover;
use super::history::{Event, Kind};
use super::measure::Measure;

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
        let movement = cover.movement(complex, since, false);
        if movement.worst > limit {
            complex.undo_to(since);
            continue;
        }
        cover.accept(complex, since, movement);
        let tau = measure.tolerance.at(fine.vertex_radius[tip as usize]);
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
