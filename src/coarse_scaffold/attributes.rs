//! Attributes of curves and sheets: lengths, areas, radii, moments, meshes, boundaries.

use super::hypergraph::{Curve, CurveKind, Host, MedialPoint, Sheet, SheetMesh, SheetMoments};
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::{CurveId, SheetId};
use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen};
use ordered_float::OrderedFloat;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// Length of a polyline, mm; a closed one returns to its start.
pub(crate) fn length(polyline: &[MedialPoint], closed: bool) -> f64 {
    let open: f64 = polyline
        .windows(2)
        .map(|w| w[0].position.distance(w[1].position))
        .sum();
    match (closed, polyline.first(), polyline.last()) {
        (true, Some(a), Some(b)) => open + a.position.distance(b.position),
        _ => open,
    }
}

/// Smooths positions and radii along a curve with a Gaussian of standard deviation `width_mm` over arc length; the ends of an
/// open curve stay, because the curve is continued beyond them by its point reflection.
pub(crate) fn smooth(polyline: &mut [MedialPoint], closed: bool, width_mm: f64) {
    smooth_by(polyline, closed, |_| width_mm);
}

/// As [`smooth`] with a width for each point; where it is 0, the point stays.
pub(crate) fn smooth_by(polyline: &mut [MedialPoint], closed: bool, width_mm: impl Fn(usize) -> f64) {
    const CUT: f64 = 2.5;
    let n = polyline.len();
    if n < 3 {
        return;
    }
    let mut at = vec![0.0; n];
    for i in 1..n {
        at[i] = at[i - 1] + polyline[i].position.distance(polyline[i - 1].position);
    }
    let round = at[n - 1] + polyline[n - 1].position.distance(polyline[0].position);
    // A kernel wider than a third of the curve would see the curve twice.
    let whole = if closed { round } else { at[n - 1] };
    // Point k of the endless continuation: arc length, position and radius.
    let (first, last) = (polyline[0], polyline[n - 1]);
    let point = |k: isize| -> (f64, DVec3, f64) {
        let m = n as isize;
        if closed {
            let turn = k.div_euclid(m);
            let p = polyline[k.rem_euclid(m) as usize];
            (
                at[k.rem_euclid(m) as usize] + turn as f64 * round,
                p.position,
                p.radius,
            )
        } else if k < 0 {
            let p = polyline[(-k).min(m - 1) as usize];
            let s = at[(-k).min(m - 1) as usize];
            (
                -s,
                2.0 * first.position - p.position,
                2.0 * first.radius - p.radius,
            )
        } else if k >= m {
            let i = (2 * (m - 1) - k).max(0) as usize;
            let p = polyline[i];
            let s = 2.0 * at[n - 1] - at[i];
            (s, 2.0 * last.position - p.position, 2.0 * last.radius - p.radius)
        } else {
            let p = polyline[k as usize];
            (at[k as usize], p.position, p.radius)
        }
    };
    let smoothed: Vec<MedialPoint> = (0..n)
        .map(|i| {
            if !closed && (i == 0 || i == n - 1) {
                return polyline[i];
            }
            let (here, width) = (at[i], width_mm(i).min(whole / 6.0));
            if width <= 0.0 {
                return polyline[i];
            }
            let (mut weight, mut position, mut radius) = (0.0, DVec3::ZERO, 0.0);
            let mut add = |k: isize| {
                let (s, p, r) = point(k);
                let x = (s - here) / width;
                // Each point stands for half the way to its neighbours.
                let share = 0.5 * (point(k + 1).0 - point(k - 1).0);
                let w = share * (-0.5 * x * x).exp();
                weight += w;
                position += w * p;
                radius += w * r;
                x.abs() < CUT
            };
            let (mut up, mut down) = (i as isize, i as isize - 1);
            let limit = 2 * n as isize - 2;
            while add(up) && up - (i as isize) < limit {
                up += 1;
            }
            while add(down) && (i as isize) - down < limit {
                down -= 1;
            }
            if weight > 0.0 {
                MedialPoint {
                    position: position / weight,
                    radius: (radius / weight).max(0.0),
                }
            } else {
                polyline[i]
            }
        })
        .collect();
    polyline.copy_from_slice(&smoothed);
}

/// As [`smooth_by`], but bends do not shrink, up to the fourth power of width over radius: what a second smoothing takes away is what the first
/// one took of the smooth part, and is given back ("twicing", Tukey, "Exploratory Data Analysis", 1977).
pub(crate) fn smooth_in_place(polyline: &mut [MedialPoint], closed: bool, width_mm: impl Fn(usize) -> f64) {
    smooth_by(polyline, closed, &width_mm);
    let mut again = polyline.to_vec();
    smooth_by(&mut again, closed, &width_mm);
    for (p, again) in polyline.iter_mut().zip(&again) {
        p.position = 2.0 * p.position - again.position;
        p.radius = (2.0 * p.radius - again.radius).max(0.0);
    }
}

/// A sheet with everything but its boundary and shares.
pub(crate) fn sheet(
    fine: &FineScaffold,
    index: usize,
    facets: &[u32],
    persistence: f64,
    border: &BTreeMap<u32, MedialPoint>,
) -> Sheet {
    let mesh = mesh(fine, facets, border);
    let point = |i: u32| mesh.vertices[i as usize];
    let (mut area, mut weighted_radius, mut first) = (0.0, 0.0, DVec3::ZERO);
    let origin = mesh.vertices.first().map_or(DVec3::ZERO, |p| p.position);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(point);
        let s = 0.5 * (b.position - a.position).cross(c.position - a.position).length();
        area += s;
        weighted_radius += s * (a.radius + b.radius + c.radius) / 3.0;
        first += s * ((a.position + b.position + c.position) / 3.0 - origin);
    }
    let centroid = if area > 0.0 { origin + first / area } else { origin };
    Sheet {
        id: SheetId::from_index(index),
        persistence,
        boundary: Vec::new(),
        area,
        mean_radius: if area > 0.0 { weighted_radius / area } else { 0.0 },
        max_radius: mesh.vertices.iter().map(|p| p.radius).fold(0.0, f64::max),
        volume_share: 0.0,
        generators: 0,
        moments: moments(&mesh, centroid, area),
        mesh,
    }
}

/// Exact second moments of the triangles about the centroid.
fn moments(mesh: &SheetMesh, centroid: DVec3, area: f64) -> SheetMoments {
    let mut m = Matrix3::<f64>::zeros();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.vertices[i as usize].position - centroid);
        let s = 0.5 * (b - a).cross(c - a).length();
        // The integral of x x^T over a triangle is s/12 (sum over corners of v v^T + w w^T with w the sum of corners).
        for v in [a, b, c, a + b + c] {
            let v: nalgebra::Vector3<f64> = v.into();
            m += v * v.transpose() * (s / 12.0);
        }
    }
    if area <= 0.0 {
        return SheetMoments {
            centroid,
            axes: [DVec3::X, DVec3::Y, DVec3::Z],
            ..SheetMoments::default()
        };
    }
    principal(m / area, centroid)
}

/// Moments from the covariance about the centroid.
pub(crate) fn principal(covariance: Matrix3<f64>, centroid: DVec3) -> SheetMoments {
    let eigen = SymmetricEigen::new(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let axis = |k: usize| {
        let c = eigen.eigenvectors.column(order[k]);
        let v = DVec3::new(c[0], c[1], c[2]);
        // Sign by the largest component, so that equal shapes have equal axes.
        let largest = v
            .to_array()
            .into_iter()
            .max_by(|a, b| a.abs().total_cmp(&b.abs()));
        if largest.is_some_and(|x| x < 0.0) { -v } else { v }
    };
    let (first, second) = (axis(0), axis(1));
    SheetMoments {
        centroid,
        deviations: order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt()),
        axes: [first, second, first.cross(second)],
    }
}

/// Rings of vertices behind the border that give way when the border is moved to the smooth curves.
const GIVE_WAY: u32 = 5;
/// Where the border moves further than those rings are wide, what lies within this many times as far gives way.
const FOLLOW: f64 = 2.0;
/// Passes of relaxation of those vertices.
const RELAX: u32 = 30;

/// The facets as a fan of triangles each, over shared vertices; vertices on the border sit on the smooth curves, and those near
/// them are relaxed.
fn mesh(fine: &FineScaffold, facets: &[u32], border: &BTreeMap<u32, MedialPoint>) -> SheetMesh {
    let mut used: Vec<u32> = facets
        .iter()
        .flat_map(|&f| fine.facet_vertices(f as usize).iter().copied())
        .collect();
    used.sort_unstable();
    used.dedup();
    let slot = |v: u32| used.partition_point(|&u| u < v) as u32;
    let triangles = facets
        .iter()
        .flat_map(|&f| {
            let ring = fine.facet_vertices(f as usize);
            (1..ring.len() - 1).map(|k| [slot(ring[0]), slot(ring[k]), slot(ring[k + 1])])
        })
        .collect();
    let mut vertices: Vec<MedialPoint> = used
        .iter()
        .map(|&v| MedialPoint {
            position: fine.vertex_position[v as usize],
            radius: fine.vertex_radius[v as usize],
        })
        .collect();
    let mut near: Vec<[u32; 2]> = facets
        .iter()
        .flat_map(|&f| fine.facet_edges(f as usize))
        .map(|&e| fine.edge_vertices[e as usize].map(slot))
        .flat_map(|[a, b]| [[a, b], [b, a]])
        .collect();
    near.sort_unstable();
    near.dedup();
    let on_border: Vec<Option<MedialPoint>> = used.iter().map(|v| border.get(v).copied()).collect();
    let free = give_way(&mut vertices, &near, &on_border);
    let giving: Vec<&[[u32; 2]]> = near
        .chunk_by(|x, y| x[0] == y[0])
        .filter(|own| free[own[0][0] as usize])
        .collect();
    let mut next = Vec::with_capacity(giving.len());
    for _ in 0..RELAX {
        next.extend(giving.iter().map(|own| {
            let n = own.len() as f64;
            let here = vertices[own[0][0] as usize];
            let position: DVec3 = own.iter().map(|e| vertices[e[1] as usize].position).sum();
            let radius: f64 = own.iter().map(|e| vertices[e[1] as usize].radius).sum();
            MedialPoint {
                position: 0.5 * (here.position + position / n),
                radius: 0.5 * (here.radius + radius / n),
            }
        }));
        for (own, next) in giving.iter().zip(next.drain(..)) {
            vertices[own[0][0] as usize] = next;
        }
    }
    SheetMesh { vertices, triangles }
}

/// Puts the border of a mesh where it belongs and tells which other vertices give way: a few rings behind it, and where it moves
/// far, all that it might sweep over, which is moved along, the less the further away. `near` are the pairs of neighbours in order.
fn give_way(vertices: &mut [MedialPoint], near: &[[u32; 2]], border: &[Option<MedialPoint>]) -> Vec<bool> {
    let exact = vertices.to_vec();
    // Steps from the border, up to the last ring that gives way.
    let mut ring = vec![u32::MAX; vertices.len()];
    for (i, p) in border.iter().enumerate() {
        if let Some(p) = *p {
            ring[i] = 0;
            vertices[i] = p;
        }
    }
    for step in 0..GIVE_WAY {
        for &[a, b] in near {
            if ring[a as usize] == step && ring[b as usize] == u32::MAX {
                ring[b as usize] = step + 1;
            }
        }
    }
    let length = |a: u32, b: u32| exact[a as usize].position.distance(exact[b as usize].position);
    let at_border = || near.iter().filter(|pair| ring[pair[0] as usize] == 0);
    let mean = at_border().map(|&[a, b]| length(a, b)).sum::<f64>() / at_border().count().max(1) as f64;
    // How much of its reach the movement of a border vertex has left where it comes to, the furthest reaching first.
    let mut left = vec![0.0; vertices.len()];
    let mut queue = BinaryHeap::new();
    for (i, p) in exact.iter().enumerate() {
        let reach = FOLLOW * p.position.distance(vertices[i].position);
        if ring[i] == 0 && reach > f64::from(GIVE_WAY) * mean {
            left[i] = reach;
            queue.push((OrderedFloat(reach), Reverse(i as u32), i as u32));
        }
    }
    while let Some((here, Reverse(i), from)) = queue.pop() {
        if here.0 < left[i as usize] {
            continue;
        }
        let start = near.partition_point(|pair| pair[0] < i);
        for &[_, j] in near[start..].iter().take_while(|pair| pair[0] == i) {
            let there = here.0 - length(i, j);
            if ring[j as usize] == 0 || there <= left[j as usize] {
                continue;
            }
            left[j as usize] = there;
            let (old, new) = (exact[from as usize].position, vertices[from as usize].position);
            let share = there / (FOLLOW * old.distance(new));
            vertices[j as usize].position = exact[j as usize].position + share * (new - old);
            queue.push((OrderedFloat(there), Reverse(j), from));
        }
    }
    ring.iter()
        .zip(left)
        .map(|(&ring, left)| ring > 0 && (ring != u32::MAX || left > 0.0))
        .collect()
}

/// The boundary of each sheet as chains of curves that share nodes, the longest first.
pub(crate) fn boundaries(sheets: &mut [Sheet], curves: &[Curve]) {
    let mut of_sheet: Vec<Vec<CurveId>> = vec![Vec::new(); sheets.len()];
    for c in curves.iter().filter(|c| c.kind != CurveKind::Wire) {
        for s in &c.sheets {
            if !of_sheet[s.index()].contains(&c.id) {
                of_sheet[s.index()].push(c.id);
            }
        }
    }
    for (sheet, own) in sheets.iter_mut().zip(of_sheet) {
        let mut chains = walk(&own, curves);
        let size = |chain: &[CurveId]| chain.iter().map(|c| curves[c.index()].length).sum::<f64>();
        chains.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.cmp(b)));
        sheet.boundary = chains;
    }
}

/// Connected pieces of a set of curves, each walked from its smallest curve, turning into the smallest unused neighbour.
fn walk(own: &[CurveId], curves: &[Curve]) -> Vec<Vec<CurveId>> {
    let mut used = vec![false; own.len()];
    let mut chains = Vec::new();
    for i in 0..own.len() {
        if used[i] {
            continue;
        }
        used[i] = true;
        let mut chain = vec![own[i]];
        let mut nodes = curves[own[i].index()].nodes.clone();
        // The last node first, so that the chain runs on from where it is.
        while let Some((j, node)) = nodes.iter().rev().find_map(|&node| {
            let near = (0..own.len()).find(|&j| !used[j] && curves[own[j].index()].nodes.contains(&node));
            near.map(|j| (j, node))
        }) {
            used[j] = true;
            chain.push(own[j]);
            let ends = &curves[own[j].index()].nodes;
            nodes.extend(ends.iter().copied().filter(|&n| n == node));
            nodes.extend(ends.iter().copied().filter(|&n| n != node));
        }
        chains.push(chain);
    }
    chains
}

/// Generators and volume shares of the sheets by the generator map.
pub(crate) fn shares(fine: &FineScaffold, sheets: &mut [Sheet], hosts: &[Host]) {
    let total = fine.solid_volume_mm3();
    for (g, host) in hosts.iter().enumerate() {
        if let Host::Sheet(s) = host {
            sheets[s.index()].generators += 1;
            if total > 0.0 {
                sheets[s.index()].volume_share += fine.generator_volume[g] / total;
            }
        }
    }
}

/// Area of a facet, mm^2.
pub(crate) fn facet_area(fine: &FineScaffold, facet: u32) -> f64 {
    let ring = fine.facet_vertices(facet as usize);
    debug_assert!(ring.iter().all(|&v| v != NONE));
    let p = |k: usize| fine.vertex_position[ring[k % ring.len()] as usize];
    let mut normal = DVec3::ZERO;
    for k in 1..ring.len() - 1 {
        normal += (p(k) - p(0)).cross(p(k + 1) - p(0));
    }
    0.5 * normal.length()
}
