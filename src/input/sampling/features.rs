//! Samples along the sharp edges of a mesh.
//!
//! In: a mesh, an angle, a spacing. Out: points on its creases, corners first.
//!
//! 1. An edge is sharp when its two triangles bend more than the angle, or when it does not have two triangles.
//! 2. Sharp edges are joined to chains between corners; a corner is a vertex where not two chains meet or the chain itself
//!    turns more than the angle.
//! 3. Chains much shorter than the spacing are noise and get none.
//! 4. Corners and evenly spaced points of the other chains are taken, but none nearer to an earlier one than half a step.
//!
//! Cost `O(n log n)`; the order is that of the mesh.

use crate::geometry::TriangleMesh;
use glam::DVec3;
use std::collections::HashMap;

/// Step along a chain, in spacings: as dense as the nearest neighbours of a blue-noise sampling.
const STEP: f64 = 0.8;

/// Shortest chain that counts, in spacings.
const SHORTEST: f64 = 2.0;

/// Points on the sharp edges of `mesh`, about `0.8 spacing_mm` apart. An angle of 180 degrees or more means none.
pub fn samples(mesh: &TriangleMesh, angle_deg: f64, spacing_mm: f64) -> Vec<DVec3> {
    if angle_deg >= 180.0 {
        return Vec::new();
    }
    let cosine = angle_deg.to_radians().cos();
    let chains = chains(mesh, &sharp_edges(mesh, cosine), cosine);
    let mut corners = Vec::new();
    let mut along = Vec::new();
    for chain in &chains {
        let points: Vec<DVec3> = chain.iter().map(|&v| mesh.points[v as usize]).collect();
        let length: f64 = points.windows(2).map(|w| (w[1] - w[0]).length()).sum();
        if length < SHORTEST * spacing_mm {
            continue;
        }
        corners.push(points[0]);
        corners.push(points[points.len() - 1]);
        let steps = (length / (STEP * spacing_mm)).round().max(1.0) as usize;
        divide(&points, length / steps as f64, steps, &mut along);
    }
    spread(corners.into_iter().chain(along), 0.5 * STEP * spacing_mm)
}

/// Edges by their smaller and larger vertex, in order.
fn sharp_edges(mesh: &TriangleMesh, cosine: f64) -> Vec<(u32, u32)> {
    let mut sides: Vec<((u32, u32), u32)> = mesh
        .triangles
        .iter()
        .enumerate()
        .flat_map(|(i, &[a, b, c])| [(a, b), (b, c), (c, a)].map(|(u, v)| ((u.min(v), u.max(v)), i as u32)))
        .filter(|((u, v), _)| u != v)
        .collect();
    sides.sort_unstable();
    let normal = |t: u32| {
        let [a, b, c] = mesh.triangles[t as usize].map(|v| mesh.points[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    sides
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|run| match run {
            [(_, s), (_, t)] => {
                let (m, n) = (normal(*s), normal(*t));
                m != DVec3::ZERO && n != DVec3::ZERO && m.dot(n) < cosine
            }
            _ => true,
        })
        .map(|run| run[0].0)
        .collect()
}

/// Maximal paths of sharp edges between corners; rings end where they begin.
fn chains(mesh: &TriangleMesh, edges: &[(u32, u32)], cosine: f64) -> Vec<Vec<u32>> {
    let mut incident: HashMap<u32, Vec<u32>> = HashMap::new();
    for (e, &(u, v)) in edges.iter().enumerate() {
        incident.entry(u).or_default().push(e as u32);
        incident.entry(v).or_default().push(e as u32);
    }
    let other = |e: u32, v: u32| {
        let (a, b) = edges[e as usize];
        if a == v { b } else { a }
    };
    let at = |v: u32| mesh.points[v as usize];
    let is_corner = |v: u32| match incident[&v].as_slice() {
        [e, f] => {
            let (d, g) = (at(v) - at(other(*e, v)), at(other(*f, v)) - at(v));
            d.normalize_or_zero().dot(g.normalize_or_zero()) < cosine
        }
        _ => true,
    };
    let mut used = vec![false; edges.len()];
    let mut out = Vec::new();
    let mut trace = |start: u32, first: u32, used: &mut Vec<bool>| {
        let mut chain = vec![start];
        let (mut v, mut e) = (start, first);
        loop {
            used[e as usize] = true;
            v = other(e, v);
            chain.push(v);
            if v == start || is_corner(v) {
                break;
            }
            match incident[&v].iter().find(|&&f| !used[f as usize]) {
                Some(&f) => e = f,
                None => break,
            }
        }
        out.push(chain);
    };
    for (e, &(u, v)) in edges.iter().enumerate() {
        for start in [u, v] {
            if !used[e] && is_corner(start) {
                trace(start, e as u32, &mut used);
            }
        }
    }
    for (e, &(u, _)) in edges.iter().enumerate() {
        if !used[e] {
            trace(u, e as u32, &mut used);
        }
    }
    out
}

/// The inner points that divide a path into `steps` of equal length.
fn divide(path: &[DVec3], step: f64, steps: usize, out: &mut Vec<DVec3>) {
    let mut walked = 0.0;
    let mut next = 1;
    for w in path.windows(2) {
        let length = (w[1] - w[0]).length();
        while next < steps && walked + length >= next as f64 * step {
            let t = (next as f64 * step - walked) / length;
            out.push(w[0] + (w[1] - w[0]) * t.clamp(0.0, 1.0));
            next += 1;
        }
        walked += length;
    }
}

/// Keeps the points that are no nearer than `radius` to one kept before.
fn spread(points: impl Iterator<Item = DVec3>, radius: f64) -> Vec<DVec3> {
    let mut grid = super::blue_noise::Grid::new(radius);
    let mut kept: Vec<DVec3> = Vec::new();
    for p in points {
        let free = grid
            .near(p)
            .all(|i| (kept[i as usize] - p).length_squared() >= radius * radius);
        if free {
            grid.insert(p, kept.len() as u32);
            kept.push(p);
        }
    }
    kept
}
