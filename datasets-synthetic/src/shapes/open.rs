//! Open, one-sided and crossing surfaces: what segregation must not close or tear.

use super::Shape;
use super::grids::{Wrap, edge_for, parameter_grid, revolve};
use crate::mesh::{Bounds, TriangleMesh};
use crate::truth::{Medial, MedialSheet, Truth, with_radius};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Upper half of a sphere. One border loop, Euler number 1.
pub fn hemisphere(radius: f64) -> Shape {
    let mut shape = spherical_cap(radius, FRAC_PI_2);
    shape.name = "hemisphere".into();
    shape
}

/// Sphere with a cap around -z missing that holds the share `missing` of its area (0 to 1). One border loop, Euler number 1.
///
/// A cap of height `c` has area `2 pi R c`, so the cut is at `z = -R (1 - 2 missing)`.
pub fn sphere_with_cap_missing(radius: f64, missing: f64) -> Shape {
    let mut shape = spherical_cap(radius, (2.0 * missing - 1.0).acos());
    shape.name = "sphere_with_cap_missing".into();
    shape
}

/// The part of a sphere within the angle `polar` of +z [rad].
fn spherical_cap(radius: f64, polar: f64) -> Shape {
    let area = TAU * radius * radius * (1.0 - polar.cos());
    let mut truth = Truth::open(1, 1, "Part of a sphere with one border circle.");
    truth.area_mm2 = Some(area);
    truth.rotational_symmetry = true;
    let bottom = radius * polar.cos();
    let wide = radius * if polar < FRAC_PI_2 { polar.sin() } else { 1.0 };
    Shape::from_mesher(
        "spherical_cap",
        Bounds {
            min: DVec3::new(-wide, -wide, bottom),
            max: DVec3::new(wide, wide, radius),
        },
        radius,
        truth,
        None,
        move |n| {
            let edge = edge_for(area, n);
            let rows = (polar * radius / (edge * 0.87)).round().max(2.0) as usize;
            let profile: Vec<[f64; 2]> = (0..=rows)
                .map(|k| {
                    let a = polar * (1.0 - k as f64 / rows as f64);
                    [if k == rows { 0.0 } else { radius * a.sin() }, radius * a.cos()]
                })
                .collect();
            revolve(&profile, edge)
        },
        move |p| p.normalize_or(DVec3::Z) * radius,
    )
}

/// Side of a cylinder along z, both ends open. Two border loops, Euler number 0.
pub fn open_tube(radius: f64, length: f64) -> Shape {
    let mut truth = Truth::open(0, 2, "Side of a cylinder with two border circles.");
    truth.area_mm2 = Some(TAU * radius * length);
    truth.rotational_symmetry = true;
    Shape::from_mesher(
        "open_tube",
        Bounds::centred(DVec3::new(radius, radius, 0.5 * length)),
        radius,
        truth,
        None,
        move |n| {
            let edge = edge_for(TAU * radius * length, n);
            let rows = (length / (edge * 0.87)).round().max(1.0) as usize;
            let profile: Vec<[f64; 2]> = (0..=rows)
                .map(|k| [radius, length * (k as f64 / rows as f64 - 0.5)])
                .collect();
            revolve(&profile, edge)
        },
        move |p| {
            let rho = p.x.hypot(p.y).max(f64::MIN_POSITIVE);
            DVec3::new(p.x * radius / rho, p.y * radius / rho, p.z)
        },
    )
}

/// Moebius band of that width around the circle of that radius. One side, one border loop, Euler number 0.
pub fn moebius_band(radius: f64, width: f64) -> Shape {
    let mut truth = Truth::open(
        0,
        1,
        "Moebius band: half a turn of a segment along a circle; one side, one border.",
    );
    truth.orientable = false;
    truth.chiral = true;
    let direction = |a: f64| {
        DVec3::new(
            (0.5 * a).cos() * a.cos(),
            (0.5 * a).cos() * a.sin(),
            (0.5 * a).sin(),
        )
    };
    let centre = move |a: f64| radius * DVec3::new(a.cos(), a.sin(), 0.0);
    let reach = radius + 0.5 * width;
    Shape::from_mesher(
        "moebius_band",
        Bounds::centred(DVec3::new(reach, reach, 0.5 * width)),
        width,
        truth,
        None,
        move |n| {
            let edge = (2.0 * TAU * radius * width / n as f64).sqrt();
            let around = (TAU * radius / edge).round().max(8.0) as usize;
            let across = (width / edge).round().max(2.0) as usize;
            parameter_grid([around, across], Wrap::Twisted, false, |u, v| {
                centre(TAU * u) + (v - 0.5) * width * direction(TAU * u)
            })
        },
        // Near the band, the half plane at the point's own angle holds the right ruling.
        move |p| {
            let a = p.y.atan2(p.x);
            let d = direction(a);
            centre(a) + d * (p - centre(a)).dot(d).clamp(-0.5 * width, 0.5 * width)
        },
    )
}

/// Two squares of that side that cross at right angles along the y axis. Edges on the crossing have four triangles;
/// Euler number 1; the border is one connected graph.
pub fn crossing_planes(side: f64) -> Shape {
    let mut truth = Truth::open(
        1,
        1,
        "Two squares joined along their middle lines: Euler 1 + 1 - 1; the crossing is a line of non-manifold edges.",
    );
    truth.area_mm2 = Some(2.0 * side * side);
    truth.orientable = false;
    let half = 0.5 * side;
    Shape::from_mesher(
        "crossing_planes",
        Bounds::centred(DVec3::splat(half)),
        half,
        truth,
        None,
        move |n| crossing_mesh(half, ((n as f64 / 16.0).sqrt().round() as usize).max(1)),
        |p| p,
    )
}

/// Four half squares of `k` x `2k` cells that share the vertices of the crossing line.
fn crossing_mesh(half: f64, k: usize) -> TriangleMesh {
    let step = half / k as f64;
    let rows = 2 * k + 1;
    let mut mesh = TriangleMesh {
        points: (0..rows)
            .map(|j| DVec3::new(0.0, j as f64 * step - half, 0.0))
            .collect(),
        triangles: Vec::new(),
    };
    for direction in [DVec3::X, DVec3::Z, -DVec3::X, -DVec3::Z] {
        let base = mesh.points.len();
        for i in 1..=k {
            for j in 0..rows {
                mesh.points
                    .push(direction * (i as f64 * step) + DVec3::Y * (j as f64 * step - half));
            }
        }
        let id = |i: usize, j: usize| {
            if i == 0 {
                j as u32
            } else {
                (base + (i - 1) * rows + j) as u32
            }
        };
        for i in 0..k {
            for j in 0..rows - 1 {
                let (a, b, c, d) = (id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1));
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh
}

/// The paper's pair of planes (Leymarie & Kimia 2007; Leymarie 2003, ch. 6): a flat square z = 0 and, `gap` above it, one that is pushed
/// down by an elongated Gaussian of depth 0.45 gaps, widths 0.22 and 0.07 sides, along a slanted direction. 3 200 points are the paper's sampling.
///
/// Between them lies **one** medial sheet: under the surface point `s` with downward unit normal `n`, the ball of radius `r = s_z / (1 - n_z)` around
/// `s + r n` touches the plane below it. No axial curve, because the bump bends less than the balls (tested).
pub fn planes_with_bump(side: f64, gap: f64) -> Shape {
    let half = 0.5 * side;
    let mut truth = Truth::open(
        2,
        2,
        "Two sheets of surface that do not touch; between them one smooth medial sheet.",
    );
    truth.surface_components = 2;
    truth = truth.with_medial(bump_medial(half, gap));
    truth.counts = None;
    Shape::from_mesher(
        "planes_with_bump",
        Bounds {
            min: DVec3::new(-half, -half, 0.0),
            max: DVec3::new(half, half, gap),
        },
        0.5 * gap,
        truth,
        None,
        move |n| {
            let cells = ((n as f64 / 4.0).sqrt().round() as usize).max(2);
            let at = |u: f64, v: f64| ((2.0 * u - 1.0) * half, (2.0 * v - 1.0) * half);
            // Both squares look at the gap.
            let mut mesh = parameter_grid([cells, cells], Wrap::Open, false, |u, v| {
                let (x, y) = at(u, v);
                DVec3::new(x, y, 0.0)
            });
            let top = parameter_grid([cells, cells], Wrap::Open, false, |u, v| {
                let (x, y) = at(u, v);
                DVec3::new(x, y, bump_height(x, y, half, gap)[0])
            });
            mesh.append(&top.flipped());
            mesh
        },
        move |p| {
            let height = bump_height(p.x, p.y, half, gap)[0];
            DVec3::new(p.x, p.y, if p.z > 0.5 * height { height } else { 0.0 })
        },
    )
}

/// Height of the upper square and its two slopes.
fn bump_height(x: f64, y: f64, half: f64, gap: f64) -> [f64; 3] {
    let (c, s) = (20f64.to_radians().cos(), 20f64.to_radians().sin());
    let (long, short) = (0.44 * half, 0.14 * half);
    let (u, v) = (c * x + s * y, -s * x + c * y);
    let bump = 0.45 * gap * (-0.5 * ((u / long).powi(2) + (v / short).powi(2))).exp();
    let (du, dv) = (bump * u / (long * long), bump * v / (short * short));
    [gap - bump, c * du - s * dv, s * du + c * dv]
}

fn bump_medial(half: f64, gap: f64) -> Medial {
    let n = 120;
    let sheet = parameter_grid([n, n], Wrap::Open, false, |u, v| DVec3::new(u, v, 0.0));
    let vertices = sheet
        .points
        .iter()
        .map(|p| {
            let (x, y) = ((2.0 * p.x - 1.0) * half, (2.0 * p.y - 1.0) * half);
            let [z, zx, zy] = bump_height(x, y, half, gap);
            let normal = DVec3::new(zx, zy, -1.0).normalize();
            let r = z / (1.0 - normal.z);
            with_radius(DVec3::new(x, y, z) + r * normal, r)
        })
        .collect();
    Medial {
        sheets: vec![MedialSheet::new(vertices, sheet.triangles)],
        ..Medial::default()
    }
}
