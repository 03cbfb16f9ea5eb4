//! Step 7: seams. An axial curve of a simplified scaffold ends a little before the rib it would have met, and the two
//! sheets at its end leak into each other through the gap. A seam closes it: the shortest path over manifold edges from the end
//! to a near rib or curve. Nothing of the complex is removed; the path only counts as a border.
//!
//! A path to the curve's own rib is not a seam: the way along the curves must be longer than the path by half.
//!
//! Which two of the three sheets at an end run into each other is decided by the last facets that grew back, so without seams it differs
//! from sampling to sampling, also where the scaffold is thick; there a seam may meet another axial curve, which is what later
//! merges the two (transitions A1A3-II and A1^2A3-I).

use super::complex::Complex;
use super::fins::axial_degree;
use super::history::{Event, Kind};
use super::measure::Measure;
use super::queue::Queue;
use super::settings::RegulariseSettings;
use std::collections::BTreeMap;

/// The way along the curves must be this many times the seam. (2.5 left the number of sheets of 25 bones less stable by a twelfth.)
const DETOUR: f64 = 1.5;
/// Seams may always be this many spacings long: at a sampling as coarse as the tolerance the gap is as wide.
pub(crate) const SEAM_SPACINGS: f64 = 3.0;

/// Finds the seams: paths of edges, each from an axial end to a curve.
pub(crate) fn find_seams(
    complex: &Complex,
    measure: &Measure,
    settings: &RegulariseSettings,
    history: &mut Vec<Event>,
) -> Vec<Vec<u32>> {
    let fine = complex.fine;
    let degree = axial_degree(complex);
    let mut is_seam = vec![false; fine.num_edges()];
    let mut seams = Vec::new();
    for v in 0..fine.num_vertices() as u32 {
        let tau = measure.tolerance.at(v);
        if degree[v as usize] != 1 {
            continue;
        }
        let longest = settings.seam_length * tau;
        let longest = longest.max(SEAM_SPACINGS * fine.scale.spacing_mm);
        let Some(path) = seam_from(complex, &is_seam, v, longest) else {
            continue;
        };
        let length = path
            .iter()
            .map(|&e| {
                let [a, b] = fine.edge_vertices[e as usize];
                fine.vertex_position[a as usize].distance(fine.vertex_position[b as usize])
            })
            .sum();
        for &e in &path {
            is_seam[e as usize] = true;
        }
        let at = complex.log.len();
        history.push(Event::applied(
            Kind::Seam,
            length,
            fine.vertex_position[v as usize],
            at,
            at,
        ));
        seams.push(path);
    }
    seams
}

/// The seam from an axial end to the nearest curve.
fn seam_from(complex: &Complex, is_seam: &[bool], start: u32, longest: f64) -> Option<Vec<u32>> {
    let fine = complex.fine;
    let on_curve = |e: u32| complex.edge_count[e as usize] != 2 || is_seam[e as usize];
    let along = distances_along_curves(complex, &on_curve, start, DETOUR * longest);
    let mut reached: BTreeMap<u32, u32> = BTreeMap::new();
    let mut best: BTreeMap<u32, f64> = BTreeMap::from([(start, 0.0)]);
    let mut queue = Queue::new();
    queue.push(0.0, start);
    let mut done = std::collections::BTreeSet::new();
    while let Some((distance, v)) = queue.pop() {
        if !done.insert(v) {
            continue;
        }
        let touches_curve = fine
            .edges_of_vertex(v as usize)
            .any(|e| complex.edge_alive[e as usize] && on_curve(e));
        if v != start && touches_curve {
            let detour = along.get(&v).copied().unwrap_or(f64::INFINITY);
            if detour > DETOUR * distance {
                let mut path = Vec::new();
                let mut at = v;
                while let Some(&e) = reached.get(&at) {
                    path.push(e);
                    at = fine.other_end(e as usize, at);
                }
                path.reverse();
                return Some(path);
            }
            continue;
        }
        for e in fine.edges_of_vertex(v as usize) {
            if !complex.edge_alive[e as usize] || on_curve(e) {
                continue;
            }
            let next = fine.other_end(e as usize, v);
            let far =
                distance + fine.vertex_position[v as usize].distance(fine.vertex_position[next as usize]);
            if far <= longest && best.get(&next).is_none_or(|&known| far < known) {
                best.insert(next, far);
                reached.insert(next, e);
                queue.push(far, next);
            }
        }
    }
    None
}

fn distances_along_curves(
    complex: &Complex,
    on_curve: &impl Fn(u32) -> bool,
    start: u32,
    longest: f64,
) -> BTreeMap<u32, f64> {
    let fine = complex.fine;
    let mut queue = Queue::new();
    queue.push(0.0, start);
    let mut done = BTreeMap::new();
    while let Some((distance, v)) = queue.pop() {
        if done.contains_key(&v) {
            continue;
        }
        done.insert(v, distance);
        for e in fine.edges_of_vertex(v as usize) {
            if complex.edge_alive[e as usize] && on_curve(e) {
                let next = fine.other_end(e as usize, v);
                let far =
                    distance + fine.vertex_position[v as usize].distance(fine.vertex_position[next as usize]);
                if far <= longest {
                    queue.push(far, next);
                }
            }
        }
    }
    done
}
