//! Step 2: the burn. Fire starts at the ribs of the fine scaffold when the wave from the surface reaches them, runs along the
//! sheets at unit speed, waits at axial curves until all but one of the sheets have burnt, and goes on in the last.
//! Burn time less radius is the **erosion thickness** (ET): how much further the shape goes on than the medial
//! ball says. Yan, Sykes, Chambers, Letscher & Ju, "Erosion thickness on medial axes of 3D shapes" (2016).
//!
//! Departure: time is propagated in straight lines from the source edge instead of along facets, because paths over polygons
//! zigzag and overestimate; a new source is set where the fire has waited. Cost `O(n log n)`.
//!
//! Facets that fire never reaches (closed sheets) have infinite ET.

use super::complex::Complex;
use super::measure::Measure;
use ordered_float::OrderedFloat;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Erosion thickness of each facet, mm.
pub(crate) fn burn(complex: &Complex, measure: &Measure) -> Vec<f64> {
    let fine = complex.fine;
    let mut count = complex.edge_count.clone();
    let mut source = measure.edge_middle.clone();
    let mut start_time = measure.edge_radius.clone();
    let mut burnt: Vec<bool> = complex.facet_alive.iter().map(|alive| !alive).collect();
    let mut erosion = vec![f64::INFINITY; fine.num_facets()];
    let mut fire = BinaryHeap::new();
    for e in 0..fine.num_edges() as u32 {
        if complex.is_rib(e)
            && let Some(f) = complex.alive_facets(e).next()
        {
            let run = measure.facet_centre[f as usize].distance(source[e as usize]);
            fire.push(Reverse((OrderedFloat(start_time[e as usize] + run), f, e)));
        }
    }
    while let Some(Reverse((OrderedFloat(time), f, e))) = fire.pop() {
        if burnt[f as usize] {
            continue;
        }
        burnt[f as usize] = true;
        erosion[f as usize] = time - measure.facet_radius[f as usize];
        for &g in fine.facet_edges(f as usize) {
            let at = g as usize;
            count[at] -= 1;
            if g == e || count[at] != 1 {
                continue;
            }
            let arrival = start_time[e as usize] + measure.edge_middle[at].distance(source[e as usize]);
            if complex.edge_count[at] == 2 && arrival >= measure.edge_radius[at] {
                source[at] = source[e as usize];
                start_time[at] = start_time[e as usize];
            } else {
                source[at] = measure.edge_middle[at];
                start_time[at] = arrival.max(time).max(measure.edge_radius[at]);
            }
            if let Some(h) = complex.alive_facets(g).find(|&h| !burnt[h as usize]) {
                let run = measure.facet_centre[h as usize].distance(source[at]);
                fire.push(Reverse((OrderedFloat(time.max(start_time[at] + run)), h, g)));
            }
        }
    }
    erosion
}
