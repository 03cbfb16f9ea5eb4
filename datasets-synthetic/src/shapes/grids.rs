//! Mesh builders: subdivision, geodesic spheres, parameter grids, surfaces of revolution, rectilinear solids.

use crate::mesh::TriangleMesh;
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Splits every triangle into `n^2` congruent ones; vertices on shared edges stay shared. The old points come first.
pub fn subdivide(mesh: &TriangleMesh, n: usize) -> TriangleMesh {
    if n <= 1 {
        return mesh.clone();
    }
    let mut points = mesh.points.clone();
    // Only looked up, never iterated: hashing does not reach the result.
    let mut edge_start: HashMap<(u32, u32), u32> = HashMap::new();
    let mut triangles = Vec::with_capacity(mesh.triangles.len() * n * n);
    for &[a, b, c] in &mesh.triangles {
        let mut on_edge = |u: u32, v: u32, step: usize| -> u32 {
            if step == 0 {
                return u;
            }
            if step == n {
                return v;
            }
            let (low, high) = (u.min(v), u.max(v));
            let start = *edge_start.entry((low, high)).or_insert_with(|| {
                let start = points.len() as u32;
                let (p, q) = (points[low as usize], points[high as usize]);
                points.extend((1..n).map(|s| p.lerp(q, s as f64 / n as f64)));
                start
            });
            let from_low = if u == low { step } else { n - step };
            start + from_low as u32 - 1
        };
        // Row i runs from the point i along a -> b to the point i along a -> c.
        let mut rows: Vec<Vec<u32>> = Vec::with_capacity(n + 1);
        for i in 0..=n {
            let (left, right) = (on_edge(a, b, i), on_edge(a, c, i));
            let mut row = vec![left];
            if i == n {
                row.extend((1..n).map(|j| on_edge(b, c, j)));
            } else {
                row.extend((1..i).map(|_| u32::MAX));
            }
            if i > 0 {
                row.push(right);
            }
            rows.push(row);
        }
        for i in 2..n {
            let (p, q) = (points[rows[i][0] as usize], points[rows[i][i] as usize]);
            for j in 1..i {
                rows[i][j] = points.len() as u32;
                points.push(p.lerp(q, j as f64 / i as f64));
            }
        }
        for i in 0..n {
            for j in 0..=i {
                triangles.push([rows[i][j], rows[i + 1][j], rows[i + 1][j + 1]]);
                if j < i {
                    triangles.push([rows[i][j], rows[i + 1][j + 1], rows[i][j + 1]]);
                }
            }
        }
    }
    TriangleMesh { points, triangles }
}

/// The regular icosahedron inscribed in the unit sphere.
pub fn icosahedron() -> TriangleMesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let points = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let triangles = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    TriangleMesh {
        points: points.iter().map(|&p| DVec3::from_array(p).normalize()).collect(),
        triangles,
    }
}

/// Geodesic sphere of radius 1 with about that many triangles (`20 n^2`).
pub fn geodesic_sphere(triangles: usize) -> TriangleMesh {
    let n = (triangles as f64 / 20.0).sqrt().round().max(1.0) as usize;
    subdivide(&icosahedron(), n).mapped(DVec3::normalize)
}

/// How a grid closes in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Ends are borders.
    Open,
    /// The last row joins the first.
    Around,
    /// The last row joins the first with the other direction reversed (a Moebius band).
    Twisted,
}

/// Parameters `(u, v)` in [0, 1]^2 on a grid of `nu` x `nv` cells, mapped by `f`; normals point along
/// `df/du x df/dv`. The u direction wraps as asked, the v direction around or not at all.
pub fn parameter_grid(
    [nu, nv]: [usize; 2],
    wrap_u: Wrap,
    around_v: bool,
    f: impl Fn(f64, f64) -> DVec3,
) -> TriangleMesh {
    let columns = if wrap_u == Wrap::Open { nu + 1 } else { nu };
    let rows = if around_v { nv } else { nv + 1 };
    let mut points = Vec::with_capacity(columns * rows);
    for i in 0..columns {
        for j in 0..rows {
            points.push(f(i as f64 / nu as f64, j as f64 / nv as f64));
        }
    }
    let id = |i: usize, j: usize| -> u32 {
        let j = if around_v { j % nv } else { j };
        let (i, j) = match wrap_u {
            Wrap::Open => (i, j),
            Wrap::Around => (i % nu, j),
            Wrap::Twisted if i == nu => (0, nv - j),
            Wrap::Twisted => (i, j),
        };
        (i * rows + j) as u32
    };
    let mut triangles = Vec::with_capacity(2 * nu * nv);
    for i in 0..nu {
        for j in 0..nv {
            let quad = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            push_quad(quad, (i + j) % 2 == 0, &mut triangles);
        }
    }
    TriangleMesh { points, triangles }
}

/// Two triangles for a quad, with one diagonal or the other.
fn push_quad([a, b, c, d]: [u32; 4], first_diagonal: bool, triangles: &mut Vec<[u32; 3]>) {
    if first_diagonal {
        triangles.extend([[a, b, c], [a, c, d]]);
    } else {
        triangles.extend([[a, b, d], [b, c, d]]);
    }
}

/// Surface of revolution about the z axis: rings of about equal edges along a profile of `(rho, z)` points.
///
/// The profile is sampled as given (choose its points one edge apart); a first or last point with `rho = 0` becomes a pole.
/// With the profile running from low to high z on the outside, the surface is oriented outwards.
pub fn revolve(profile: &[[f64; 2]], edge: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut rings: Vec<(u32, u32)> = Vec::new();
    for (k, &[rho, z]) in profile.iter().enumerate() {
        let pole = rho <= 1e-12 && (k == 0 || k + 1 == profile.len());
        let count = if pole {
            1
        } else {
            ((TAU * rho / edge).round() as u32).max(3)
        };
        rings.push((mesh.points.len() as u32, count));
        let shift = ring_shift(k);
        mesh.points.extend((0..count).map(|s| {
            let angle = TAU * (s as f64 + shift) / count as f64;
            DVec3::new(rho * angle.cos(), rho * angle.sin(), z)
        }));
    }
    for (k, pair) in rings.windows(2).enumerate() {
        zip_rings(
            pair[0],
            ring_shift(k),
            pair[1],
            ring_shift(k + 1),
            &mut mesh.triangles,
        );
    }
    mesh
}

/// Every other ring is turned by half a step: more equilateral triangles.
fn ring_shift(ring: usize) -> f64 {
    if ring.is_multiple_of(2) { 0.0 } else { 0.5 }
}

/// Triangles between two rings, walking around both by angle.
fn zip_rings(
    (low, m): (u32, u32),
    low_shift: f64,
    (high, n): (u32, u32),
    high_shift: f64,
    triangles: &mut Vec<[u32; 3]>,
) {
    let (low_steps, high_steps) = (if m == 1 { 0 } else { m }, if n == 1 { 0 } else { n });
    let (mut i, mut j) = (0, 0);
    while i < low_steps || j < high_steps {
        let low_next = (i as f64 + 1.0 + low_shift) / m as f64;
        let high_next = (j as f64 + 1.0 + high_shift) / n as f64;
        let (a, b) = (low + i % m, high + j % n);
        if j >= high_steps || (i < low_steps && low_next <= high_next) {
            triangles.push([a, low + (i + 1) % m, b]);
            i += 1;
        } else {
            triangles.push([a, high + (j + 1) % n, b]);
            j += 1;
        }
    }
}

/// Boundary of a union of cells of a rectilinear grid, its faces cut into near-squares with sides of about `edge` mm.
pub fn rectilinear_solid(
    breaks: [&[f64]; 3],
    filled: impl Fn([usize; 3]) -> bool,
    edge: f64,
) -> TriangleMesh {
    // Coordinates of the refined grid, and which coarse cell each refined cell lies in.
    let mut lines: [Vec<f64>; 3] = Default::default();
    let mut owner: [Vec<usize>; 3] = Default::default();
    for axis in 0..3 {
        for (cell, w) in breaks[axis].windows(2).enumerate() {
            let parts = ((w[1] - w[0]) / edge).round().max(1.0) as usize;
            for s in 0..parts {
                lines[axis].push(w[0] + (w[1] - w[0]) * s as f64 / parts as f64);
                owner[axis].push(cell);
            }
        }
        lines[axis].push(*breaks[axis].last().expect("a grid has lines"));
    }
    let cells = [owner[0].len(), owner[1].len(), owner[2].len()];
    let solid = |c: [isize; 3]| -> bool {
        (0..3).all(|a| c[a] >= 0 && (c[a] as usize) < cells[a])
            && filled(std::array::from_fn(|a| owner[a][c[a] as usize]))
    };
    let mut mesh = TriangleMesh::default();
    let mut ids: HashMap<[usize; 3], u32> = HashMap::new();
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let cell = [i, j, k];
                if !solid(cell.map(|c| c as isize)) {
                    continue;
                }
                for axis in 0..3 {
                    for side in 0..2usize {
                        let mut other = cell.map(|c| c as isize);
                        other[axis] += 2 * side as isize - 1;
                        if solid(other) {
                            continue;
                        }
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let mut corner = |du: usize, dv: usize| -> u32 {
                            let mut at = cell;
                            at[axis] += side;
                            at[u] += du;
                            at[v] += dv;
                            *ids.entry(at).or_insert_with(|| {
                                mesh.points
                                    .push(DVec3::from_array(std::array::from_fn(|a| lines[a][at[a]])));
                                mesh.points.len() as u32 - 1
                            })
                        };
                        let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
                        let quad = if side == 1 { [a, b, c, d] } else { [a, d, c, b] };
                        push_quad(quad, (i + j + k) % 2 == 0, &mut mesh.triangles);
                    }
                }
            }
        }
    }
    mesh
}

/// Edge length that gives about that many equilateral triangles on that area.
pub fn edge_for(area: f64, triangles: usize) -> f64 {
    (4.0 * area / (3f64.sqrt() * triangles.max(1) as f64)).sqrt()
}

/// Gauss-Legendre nodes and weights on [-1, 1] (Newton on the Legendre polynomial).
pub(crate) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut before, mut now) = (1.0, x);
                for k in 2..=n {
                    let next = ((2 * k - 1) as f64 * x * now - (k - 1) as f64 * before) / k as f64;
                    (before, now) = (now, next);
                }
                slope = n as f64 * (x * now - before) / (x * x - 1.0);
                let step = now / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Integral over the unit sphere: Gauss-Legendre in z, equal steps around; spectrally accurate for smooth integrands.
pub(crate) fn integrate_sphere(order: usize, f: impl Fn(DVec3) -> f64) -> f64 {
    let around = 2 * order;
    let mut sum = 0.0;
    for (z, weight) in gauss_legendre(order) {
        let rho = (1.0 - z * z).sqrt();
        for s in 0..around {
            let angle = TAU * (s as f64 + 0.5) / around as f64;
            sum += weight * f(DVec3::new(rho * angle.cos(), rho * angle.sin(), z));
        }
    }
    sum * TAU / around as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        assert!((integrate_sphere(8, |_| 1.0) - 4.0 * std::f64::consts::PI).abs() < 1e-12);
        let z4 = integrate_sphere(8, |u| u.x.powi(4));
        assert!((z4 - 4.0 * std::f64::consts::PI / 5.0).abs() < 1e-12);
    }

    #[test]
    fn builders_make_what_they_say() {
        let ball = geodesic_sphere(5_000);
        assert_eq!(ball.triangles.len(), 20 * 16 * 16);
        assert!(ball.topology().is_closed_oriented_manifold());
        assert!(ball.volume() > 4.1 && ball.volume() < 4.0 * std::f64::consts::FRAC_PI_3);
        let profile: Vec<[f64; 2]> = (0..=40)
            .map(|k| {
                let a = std::f64::consts::PI * (k as f64 / 40.0 - 0.5);
                [
                    a.cos().max(0.0) * (if k == 0 || k == 40 { 0.0 } else { 1.0 }),
                    a.sin(),
                ]
            })
            .collect();
        let turned = revolve(&profile, 0.08);
        assert!(turned.topology().is_closed_oriented_manifold());
        assert!((turned.volume() / (4.0 * std::f64::consts::FRAC_PI_3) - 1.0).abs() < 0.01);
        let band = parameter_grid([30, 5], Wrap::Twisted, false, |u, v| {
            let (a, w) = (TAU * u, v - 0.5);
            let rho = 2.0 + w * (a / 2.0).cos();
            DVec3::new(rho * a.cos(), rho * a.sin(), w * (a / 2.0).sin())
        });
        let t = band.topology();
        assert_eq!(
            (t.euler, t.boundary_loops, t.oriented, t.nonmanifold_edges),
            (0, 1, false, 0)
        );
    }
}
