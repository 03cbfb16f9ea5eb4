//! Sphere, ellipsoid, hollow sphere, balls with cavities.

use super::Shape;
use super::grids::{geodesic_sphere, integrate_sphere};
use crate::implicit::Field;
use crate::mesh::{Bounds, TriangleMesh};
use crate::truth::{CurveKind, Medial, MedialCurve, MedialNode, MedialSheet, Truth};
use glam::{DMat3, DVec3};
use std::f64::consts::{PI, TAU};

/// Points of a closed analytic medial curve.
const CURVE_POINTS: usize = 720;

/// Sphere around the origin. The medial set is the centre: one node, no curve.
pub fn sphere(radius: f64) -> Shape {
    let medial = Medial {
        nodes: vec![MedialNode {
            position: [0.0, 0.0, 0.0, radius],
        }],
        ..Medial::default()
    };
    let truth = Truth::solid_of_genus(
        0,
        "Sphere: every medial ball touches along all directions only at the centre.",
    )
    .with_size(4.0 / 3.0 * PI * radius.powi(3), 4.0 * PI * radius * radius)
    .with_medial(medial);
    let truth = Truth {
        rotational_symmetry: true,
        ..truth
    };
    Shape::from_mesher(
        "sphere",
        Bounds::centred(DVec3::splat(radius)),
        2.0 * radius,
        truth,
        Some(Field::Ball {
            centre: DVec3::ZERO,
            radius,
        }),
        move |n| geodesic_sphere(n).mapped(|p| p * radius),
        move |p| p.normalize_or(DVec3::Z) * radius,
    )
}

/// Ellipsoid with semi-axes `a > b > c` along x, y, z.
///
/// The medial set is one flat sheet in the plane z = 0: the ellipse with semi-axes `(a^2 - c^2) / a` and `(b^2 - c^2) / b`,
/// where `r^2 = c^2 (1 - x^2 / (a^2 - c^2) - y^2 / (b^2 - c^2))`. (The ball around `(x, y, 0)` touches at
/// `(x a^2 / (a^2 - c^2), y b^2 / (b^2 - c^2), +-z)`; the two points merge, `z = 0`, on the rib.) Tested against brute force.
///
/// With equal axes the sheet degenerates to a curve or a point and the counts are left out.
pub fn ellipsoid(a: f64, b: f64, c: f64) -> Shape {
    let radii = DVec3::new(a, b, c);
    let axes = DMat3::IDENTITY;
    let field = Field::superellipsoid(DVec3::ZERO, axes, radii, 2.0);
    let projected = field.clone();
    let volume = 4.0 / 3.0 * PI * a * b * c;
    // Area element of u -> (a u_x, b u_y, c u_z) on the unit sphere: a b c |(u_x / a, u_y / b, u_z / c)|.
    let area = integrate_sphere(96, |u| a * b * c * (u / radii).length());
    let mut truth = Truth::solid_of_genus(
        0,
        "Ellipsoid a > b > c: one flat sheet, the ellipse with semi-axes (a^2-c^2)/a and (b^2-c^2)/b in the plane of a and b, \
         r^2 = c^2 (1 - x^2/(a^2-c^2) - y^2/(b^2-c^2)); its border is one closed rib.",
    )
    .with_size(volume, area);
    if a > b && b > c {
        truth = truth.with_medial(ellipsoid_medial(a, b, c));
    }
    truth.rotational_symmetry = a == b || b == c || a == c;
    Shape::from_mesher(
        "ellipsoid",
        Bounds::centred(radii),
        2.0 * c.min(b).min(a),
        truth,
        Some(field),
        move |n| even_ellipsoid(n, radii),
        move |p| projected.project(p),
    )
}

/// A geodesic sphere stretched to the ellipsoid; elongated ones are meshed in even triangles instead.
fn even_ellipsoid(triangles: usize, radii: DVec3) -> TriangleMesh {
    if radii.max_element() < 1.6 * radii.min_element() {
        return geodesic_sphere(triangles).mapped(|p| p * radii);
    }
    let field = Field::superellipsoid(DVec3::ZERO, DMat3::IDENTITY, radii, 2.0);
    crate::implicit::mesh_with_triangles(
        &field,
        &Bounds::centred(radii),
        triangles,
        2.0 * radii.min_element(),
    )
    .expect("an ellipsoid fits its own bounds")
}

fn ellipsoid_medial(a: f64, b: f64, c: f64) -> Medial {
    let (fx, fy) = (a * a - c * c, b * b - c * c);
    let at = |share: f64, angle: f64| {
        let (x, y) = (share * fx / a * angle.cos(), share * fy / b * angle.sin());
        [x, y, 0.0, c * (1.0 - x * x / fx - y * y / fy).sqrt()]
    };
    let rib = (0..=CURVE_POINTS).map(|k| at(1.0, TAU * (k % CURVE_POINTS) as f64 / CURVE_POINTS as f64));
    let (rings, around) = (32u32, 240u32);
    let mut vertices = vec![[0.0, 0.0, 0.0, c]];
    let mut triangles = Vec::new();
    for ring in 1..=rings {
        vertices.extend((0..around).map(|s| at(ring as f64 / rings as f64, TAU * s as f64 / around as f64)));
        for s in 0..around {
            let id = |ring: u32, s: u32| {
                if ring == 0 {
                    0
                } else {
                    1 + (ring - 1) * around + s % around
                }
            };
            triangles.push([id(ring - 1, s), id(ring, s), id(ring, s + 1)]);
            if ring > 1 {
                triangles.push([id(ring - 1, s), id(ring, s + 1), id(ring - 1, s + 1)]);
            }
        }
    }
    Medial {
        nodes: Vec::new(),
        curves: vec![MedialCurve {
            kind: CurveKind::Rib,
            closed: true,
            polyline: rib.collect(),
        }],
        sheets: vec![MedialSheet::new(vertices, triangles)],
    }
}

/// Ball with a concentric spherical cavity. The medial set is the sphere half way: one closed sheet of constant radius
/// `(outer - inner) / 2`; the solid has b2 = 1.
pub fn hollow_sphere(outer: f64, inner: f64) -> Shape {
    let middle = 0.5 * (outer + inner);
    let half = 0.5 * (outer - inner);
    let sheet = geodesic_sphere(20 * 24 * 24);
    let vertices = sheet
        .points
        .iter()
        .map(|p| [p.x * middle, p.y * middle, p.z * middle, half])
        .collect();
    let medial = Medial {
        sheets: vec![MedialSheet::new(vertices, sheet.triangles)],
        ..Medial::default()
    };
    let mut truth = ball_with_cavities_truth(outer, &[(DVec3::ZERO, inner)]).with_medial(medial);
    truth.derivation =
        "Ball with a concentric cavity: the sphere half way between, constant radius (outer-inner)/2; no curve.".into();
    truth.rotational_symmetry = true;
    let mut shape = ball_with_cavities(outer, &[(DVec3::ZERO, inner)]);
    shape.name = "hollow_sphere".into();
    shape.truth = truth;
    shape
}

fn ball_with_cavities_truth(radius: f64, cavities: &[(DVec3, f64)]) -> Truth {
    let n = cavities.len();
    let cube: f64 = radius.powi(3) - cavities.iter().map(|c| c.1.powi(3)).sum::<f64>();
    let square: f64 = radius * radius + cavities.iter().map(|c| c.1 * c.1).sum::<f64>();
    Truth {
        derivation:
            "Ball with disjoint spherical cavities: volumes subtract, areas add, b2 counts the cavities."
                .into(),
        closed: true,
        orientable: true,
        surface_components: 1 + n,
        surface_euler: 2 * (1 + n as i64),
        solid_betti: Some([1, 0, n as u32]),
        ..Truth::default()
    }
    .with_size(4.0 / 3.0 * PI * cube, 4.0 * PI * square)
}

/// Ball around the origin with disjoint spherical cavities given by centre and radius.
///
/// # Panics
/// When a cavity leaves the ball or meets another.
pub fn ball_with_cavities(radius: f64, cavities: &[(DVec3, f64)]) -> Shape {
    let mut wall = 2.0 * radius;
    for (i, &(c, r)) in cavities.iter().enumerate() {
        wall = wall.min(radius - r - c.length());
        for &(d, s) in &cavities[i + 1..] {
            wall = wall.min(c.distance(d) - r - s);
        }
    }
    assert!(
        wall > 0.0,
        "cavities must lie inside the ball and apart from each other"
    );
    let holes: Vec<(DVec3, f64)> = cavities.to_vec();
    let for_projection = holes.clone();
    let mut terms = vec![Field::Ball {
        centre: DVec3::ZERO,
        radius,
    }];
    terms.extend(
        holes
            .iter()
            .map(|&(centre, radius)| Field::Ball { centre, radius }.outside()),
    );
    let total: f64 = radius * radius + holes.iter().map(|h| h.1 * h.1).sum::<f64>();
    Shape::from_mesher(
        "ball_with_cavities",
        Bounds::centred(DVec3::splat(radius)),
        wall,
        ball_with_cavities_truth(radius, cavities),
        Some(Field::intersection(terms)),
        move |n| {
            let part = |share: f64| geodesic_sphere((n as f64 * share / total).round() as usize);
            let mut mesh = part(radius * radius).mapped(|p| p * radius);
            for &(c, r) in &holes {
                mesh.append(&part(r * r).mapped(|p| c + p * r).flipped());
            }
            mesh
        },
        move |p| {
            let spheres = std::iter::once((DVec3::ZERO, radius)).chain(for_projection.iter().copied());
            let feet = spheres.map(|(c, r)| c + (p - c).normalize_or(DVec3::Z) * r);
            feet.min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)))
                .expect("the outer sphere is always there")
        },
    )
}
