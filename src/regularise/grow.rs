//! Step 5: what survives grows back. Sheets go back across their ribs and wires from their tips, so that the surface is
//! given up only where whole sheets were removed. Elementary expansions only, and never a new axial curve: a facet returns when
//! the alive part of its ring is one arc of ribs, or when it lengthens an axial curve at its end.

use super::collapse::WireFire;
use super::complex::Complex;
use super::fins::axial_degree;
use super::measure::Measure;
use super::queue::Queue;

/// Facets of erosion thickness at least `least` tolerances grow back across ribs; those at least `least_axial` may lengthen
/// axial curves. Facets of any erosion thickness close the corners between a sheet and the `whisker` edges that hang on it, so
/// that a place brought back to keep the surface is part of the sheet and no wire. Returns the number of facets added.
pub(crate) fn grow_sheets(
    complex: &mut Complex,
    relative: &[f64],
    least: f64,
    least_axial: f64,
    whisker: &[bool],
) -> usize {
    let fine = complex.fine;
    let mut axial = axial_degree(complex);
    let mut queue = Queue::new();
    let offer = |queue: &mut Queue, f: u32| {
        let value = relative[f as usize];
        let closes = fine.facet_edges(f as usize).iter().any(|&e| whisker[e as usize]);
        if (value >= least || closes) && value.is_finite() {
            queue.push(-value, f);
        }
    };
    for f in 0..fine.num_facets() as u32 {
        if !complex.facet_alive[f as usize] && fine.facet_edges(f as usize).iter().any(|&e| complex.is_rib(e))
        {
            offer(&mut queue, f);
        }
    }
    let mut added = 0;
    while let Some((key, f)) = queue.pop() {
        if complex.facet_alive[f as usize] || !fits(complex, &axial, f, -key >= least_axial, whisker) {
            continue;
        }
        expand(complex, f);
        added += 1;
        for &e in fine.facet_edges(f as usize) {
            if complex.edge_count[e as usize] == 3 {
                for v in fine.edge_vertices[e as usize] {
                    axial[v as usize] += 1;
                }
            }
            for &g in fine.facets_of_edge(e as usize) {
                if !complex.facet_alive[g as usize] {
                    offer(&mut queue, g);
                }
            }
        }
    }
    added
}

/// Whether the alive part of a dead facet's ring is one arc that it may grow from: of ribs and whiskers, and of manifold edges
/// only in one run that goes on from the end of an axial curve.
fn fits(complex: &Complex, axial: &[u8], facet: u32, may_lengthen: bool, whisker: &[bool]) -> bool {
    let edges = complex.fine.facet_edges(facet as usize);
    let vertices = complex.fine.facet_vertices(facet as usize);
    let n = edges.len();
    let count = |k: usize| {
        let e = edges[k % n] as usize;
        match complex.edge_alive[e] {
            true if complex.edge_count[e] == 0 && whisker[e] => 1,
            true => complex.edge_count[e],
            false => u8::MAX,
        }
    };
    let (mut runs, mut at_end) = (0, false);
    for k in 0..n {
        match count(k) {
            1 | u8::MAX => {}
            2 => {
                let (first, last) = (count(k + n - 1) != 2, count(k + 1) != 2);
                runs += u32::from(first);
                at_end |= first && axial[vertices[k] as usize] == 1;
                at_end |= last && axial[vertices[(k + 1) % n] as usize] == 1;
            }
            _ => return false,
        }
    }
    (runs == 0 || (runs == 1 && at_end && may_lengthen)) && alive_part_is_arc(complex, facet)
}

/// Whether the alive edges and vertices of a facet's ring form one arc of at least one edge that is not the whole ring.
pub(crate) fn alive_part_is_arc(complex: &Complex, facet: u32) -> bool {
    let edges = complex.fine.facet_edges(facet as usize);
    let vertices = complex.fine.facet_vertices(facet as usize);
    let n = edges.len();
    let alive = |k: usize| complex.edge_alive[edges[k % n] as usize];
    let count = (0..n).filter(|&k| alive(k)).count();
    let starts = (0..n).filter(|&k| alive(k) && !alive(k + n - 1)).count();
    let points = vertices
        .iter()
        .filter(|&&v| complex.vertex_alive[v as usize])
        .count();
    starts == 1 && points == count + 1
}

/// Adds a facet whose ring is alive in one arc: the dead edges one by one from one end of the arc, then the facet
/// with the last.
pub(crate) fn expand(complex: &mut Complex, facet: u32) {
    let fine = complex.fine;
    let edges = fine.facet_edges(facet as usize);
    let n = edges.len();
    let alive = |complex: &Complex, k: usize| complex.edge_alive[edges[k % n] as usize];
    let Some(mut k) = (0..n).find(|&k| !alive(complex, k) && alive(complex, k + n - 1)) else {
        return;
    };
    while !alive(complex, k + 1) {
        let end = fine.facet_vertices(facet as usize)[(k + 1) % n];
        complex.add_edge(edges[k % n], end);
        k += 1;
    }
    complex.add_facet(facet, edges[k % n]);
}

/// Wires grow back from their tips along the vertices of highest erosion thickness, down to `least` tolerances. Returns
/// the number of edges added.
pub(crate) fn grow_wires(complex: &mut Complex, measure: &Measure, fire: &WireFire, least: f64) -> usize {
    let fine = complex.fine;
    let mut queue = Queue::new();
    let offer = |complex: &Complex, queue: &mut Queue, tip: u32| {
        for e in fine.edges_of_vertex(tip as usize) {
            let v = fine.other_end(e as usize, tip);
            if complex.edge_alive[e as usize] || complex.vertex_alive[v as usize] {
                continue;
            }
            if let Some(erosion) = fire.erosion(complex, v) {
                let value = erosion / measure.tolerance.at(v);
                if value >= least {
                    queue.push(-value, e);
                }
            }
        }
    };
    for v in 0..fine.num_vertices() as u32 {
        if complex.wire_at_tip(v).is_some() {
            offer(complex, &mut queue, v);
        }
    }
    let mut added = 0;
    while let Some((_, e)) = queue.pop() {
        let [a, b] = fine.edge_vertices[e as usize];
        let (tip, v) = if complex.vertex_alive[a as usize] {
            (a, b)
        } else {
            (b, a)
        };
        if complex.vertex_alive[v as usize] || complex.wire_at_tip(tip).is_none() {
            continue;
        }
        complex.add_edge(e, v);
        added += 1;
        offer(complex, &mut queue, v);
    }
    added
}
