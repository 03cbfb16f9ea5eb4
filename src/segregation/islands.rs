//! Parts too small to be meant.
//!
//! In: labels. Out: labels in which inside components and bounded outside components (cavities) that touch few points, or
//! hold next to no volume, are flipped, and a list of them. By points, not by volume alone: outliers that survived make
//! components of large volume but few points. Connected through facets; `O(n)`.

use crate::delaunay::Triangulation;
use crate::geometry::TetId;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Components with fewer points than this are never kept.
const LEAST_POINTS: usize = 12;
/// Components with less than this share of the largest one's volume are never kept.
const LEAST_VOLUME_SHARE: f64 = 0.001;

/// A component that was flipped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Island {
    /// `true` when inside became outside, `false` when a cavity was filled.
    pub removed: bool,
    /// Points it touched.
    pub points: usize,
    /// Its volume, mm^3.
    pub volume_mm3: f64,
    /// Its centre of volume, mm.
    pub place: DVec3,
}

/// Components of equal label.
struct Components {
    of: Vec<u32>,
    points: Vec<usize>,
    volume: Vec<f64>,
    moment: Vec<DVec3>,
    label: Vec<bool>,
    infinite: Vec<bool>,
}

/// Flips small components; `share` is the least share of the points a component must touch.
pub fn flip_islands(triangulation: &Triangulation, inside: &mut [bool], share: f64) -> Vec<Island> {
    let components = components(triangulation, inside);
    let least_points = ((share * triangulation.points.len() as f64).ceil() as usize).max(LEAST_POINTS);
    let largest = |label: bool| {
        (0..components.label.len())
            .filter(|&c| components.label[c] == label && !components.infinite[c])
            .map(|c| components.volume[c])
            .fold(0.0, f64::max)
    };
    let largest_inside = largest(true);
    let flip: Vec<bool> = (0..components.label.len())
        .map(|c| {
            !components.infinite[c]
                && (components.points[c] < least_points
                    || components.volume[c] < LEAST_VOLUME_SHARE * largest_inside)
                // The largest part stays whatever its size: a result without a surface helps nobody.
                && !(components.label[c] && components.volume[c] == largest_inside)
        })
        .collect();
    for tet in triangulation.finite_tets() {
        if flip[components.of[tet.index()] as usize] {
            inside[tet.index()] = !inside[tet.index()];
        }
    }
    (0..flip.len())
        .filter(|&c| flip[c])
        .map(|c| Island {
            removed: components.label[c],
            points: components.points[c],
            volume_mm3: components.volume[c],
            place: if components.volume[c] > 0.0 {
                components.moment[c] / components.volume[c]
            } else {
                DVec3::ZERO
            },
        })
        .collect()
}

fn components(triangulation: &Triangulation, inside: &[bool]) -> Components {
    let n = triangulation.num_tets();
    let mut out = Components {
        of: vec![u32::MAX; n],
        points: Vec::new(),
        volume: Vec::new(),
        moment: Vec::new(),
        label: Vec::new(),
        infinite: Vec::new(),
    };
    let mut last_seen = vec![u32::MAX; triangulation.points.len()];
    let mut stack = Vec::new();
    for start in triangulation.tets() {
        if out.of[start.index()] != u32::MAX {
            continue;
        }
        let number = out.label.len() as u32;
        let label = inside[start.index()];
        let (mut points, mut volume, mut moment, mut infinite) = (0, 0.0, DVec3::ZERO, false);
        out.of[start.index()] = number;
        stack.push(start);
        while let Some(tet) = stack.pop() {
            infinite |= !triangulation.is_finite(tet);
            if triangulation.is_finite(tet) {
                let v = tet_volume(triangulation, tet);
                volume += v;
                moment += v * triangulation.corners(tet).iter().sum::<DVec3>() / 4.0;
            }
            for (index, vertex) in triangulation.tet(tet).into_iter().enumerate() {
                if let Some(seen) = last_seen.get_mut(vertex.index())
                    && *seen != number
                {
                    *seen = number;
                    points += 1;
                }
                let next = triangulation.neighbour(tet, index);
                if out.of[next.index()] == u32::MAX && inside[next.index()] == label {
                    out.of[next.index()] = number;
                    stack.push(next);
                }
            }
        }
        out.points.push(points);
        out.volume.push(volume);
        out.moment.push(moment);
        out.label.push(label);
        out.infinite.push(infinite);
    }
    out
}

/// Volume of a finite tetrahedron, mm^3.
fn tet_volume(triangulation: &Triangulation, tet: TetId) -> f64 {
    let [a, b, c, d] = triangulation.corners(tet);
    (b - a).cross(c - a).dot(d - a) / 6.0
}
