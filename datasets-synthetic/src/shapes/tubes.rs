//! Tubes: solids that are unions of balls along curves. Round tubes have **wires**: medial curves without sheets.
//!
//! * A tube of radius `r` around a closed curve of length `L`, thinner than the curve's reach, has the curve as its medial set, volume
//!   `pi r^2 L` and area `2 pi r L` exactly (Pappus; Weyl 1939).
//! * **Y of capsules** (sharp union of three capsules of radius `r` in one plane, 120 degrees apart). Near the centre the nearest
//!   surface points lie on the creases between the capsules, above and below the plane, so the exact medial set has a small
//!   equilateral triangle there: in the sector between two arms, with `s` along the bisector and `u` across it, `radius^2 = r^2 - 3 s^2 + u^2`
//!   for `s <= r / (2 sqrt 3)`, where the two feet merge. Its corners lie on the arms at `r / sqrt 3`; the wires start there. Exact counts:
//!   1 sheet, 3 ribs, 3 wires, 6 nodes (`6 - 6 + 1 = 1`). The triangle stands for little of the shape, so at any sensible tolerance
//!   what is left is 3 wires that meet in one node.
//!   Volume: an arm owns its 120 degree wedge, which cuts `integral of |v| / sqrt 3 * 2 sqrt(r^2 - v^2) dv = 4 r^3 / (3 sqrt 3)` off its cylinder; area
//!   likewise loses `4 r^2 / sqrt 3` an arm.
//! * **Dumbbell** (sharp union of two balls of radius `R` and the cylinder of radius `r` between their centres). One wire from centre to centre. At distance `t`
//!   from a centre the nearest surface is the reflex circle at `a = sqrt(R^2 - r^2)`: `radius^2 = R^2 + t^2 - 2 a t` up to `t = a`, then `r`.

use super::Shape;
use super::grids::{Wrap, edge_for, parameter_grid};
use crate::implicit::Field;
use crate::mesh::{Bounds, TriangleMesh};
use crate::truth::{
    CurveKind, Medial, MedialCounts, MedialCurve, MedialNode, MedialSheet, Truth, with_radius,
};
use glam::DVec3;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Points of an analytic curve.
const CURVE_POINTS: usize = 720;

fn closed_wire(curve: impl Fn(f64) -> DVec3, radius: f64) -> Medial {
    let polyline = (0..=CURVE_POINTS)
        .map(|k| with_radius(curve((k % CURVE_POINTS) as f64 / CURVE_POINTS as f64), radius));
    let wire = MedialCurve {
        kind: CurveKind::Wire,
        closed: true,
        polyline: polyline.collect(),
    };
    Medial {
        curves: vec![wire],
        ..Medial::default()
    }
}

/// Torus around the z axis. One closed wire, the core circle.
pub fn torus(major: f64, minor: f64) -> Shape {
    let core = move |u: f64| DVec3::new(major * (TAU * u).cos(), major * (TAU * u).sin(), 0.0);
    let truth = Truth::solid_of_genus(1, "Torus: the core circle, one closed wire of constant radius.")
        .with_size(
            2.0 * PI * PI * major * minor * minor,
            4.0 * PI * PI * major * minor,
        )
        .with_medial(closed_wire(core, minor));
    let truth = Truth {
        rotational_symmetry: true,
        ..truth
    };
    let field = Field::Torus { major, minor };
    let projected = field.clone();
    Shape::from_mesher(
        "torus",
        Bounds::centred(DVec3::new(major + minor, major + minor, minor)),
        2.0 * minor,
        truth,
        Some(field),
        move |n| {
            tube_grid(n, TAU * major, minor, |u| {
                let radial = DVec3::new((TAU * u).cos(), (TAU * u).sin(), 0.0);
                (major * radial, radial, DVec3::Z)
            })
        },
        move |p| projected.project(p),
    )
}

/// Grid over a closed tube; `frame(u)` gives the centre and two normals (tangent = second x first).
fn tube_grid(
    triangles: usize,
    length: f64,
    radius: f64,
    frame: impl Fn(f64) -> (DVec3, DVec3, DVec3),
) -> TriangleMesh {
    let edge = edge_for(TAU * radius * length, triangles) * 0.93;
    let nv = ((TAU * radius / edge).round() as usize).max(6);
    let nu = ((length / edge).round() as usize).max(6);
    parameter_grid([nu, nv], Wrap::Around, true, |u, v| {
        let (centre, n1, n2) = frame(u);
        centre + radius * ((TAU * v).cos() * n1 + (TAU * v).sin() * n2)
    })
}

/// The trefoil `scale (sin t + 2 sin 2t, cos t - 2 cos 2t, -sin 3t)`, its derivative and second derivative by t.
fn trefoil(scale: f64, t: f64) -> [DVec3; 3] {
    let p = DVec3::new(
        t.sin() + 2.0 * (2.0 * t).sin(),
        t.cos() - 2.0 * (2.0 * t).cos(),
        -(3.0 * t).sin(),
    );
    let d = DVec3::new(
        t.cos() + 4.0 * (2.0 * t).cos(),
        -t.sin() + 4.0 * (2.0 * t).sin(),
        -3.0 * (3.0 * t).cos(),
    );
    let dd = DVec3::new(
        -t.sin() - 8.0 * (2.0 * t).sin(),
        -t.cos() + 8.0 * (2.0 * t).cos(),
        9.0 * (3.0 * t).sin(),
    );
    [scale * p, scale * d, scale * dd]
}

/// Knotted tube: radius `radius` around a trefoil of that `scale` (spans 6 scales). One closed wire; genus 1; chiral.
///
/// # Panics
/// Unless `radius < 0.7 scale`: a thicker tube would touch itself.
pub fn trefoil_tube(scale: f64, radius: f64) -> Shape {
    assert!(
        radius < 0.7 * scale,
        "the tube must be thinner than the reach of the knot, 0.7 scales"
    );
    // The trapezoid rule converges exponentially on a closed analytic curve.
    let steps = 4096;
    let length: f64 = (0..steps)
        .map(|k| trefoil(scale, TAU * k as f64 / steps as f64)[1].length() * TAU / steps as f64)
        .sum();
    let curve = move |u: f64| trefoil(scale, TAU * u)[0];
    let truth = Truth::solid_of_genus(
        1,
        "Tube around a trefoil, thinner than its reach: one closed wire of constant radius.",
    )
    .with_size(PI * radius * radius * length, TAU * radius * length)
    .with_medial(closed_wire(curve, radius));
    let centreline: Vec<DVec3> = (0..=1024).map(|k| curve((k % 1024) as f64 / 1024.0)).collect();
    let half = DVec3::new(3.0, 3.1, 1.0) * scale + DVec3::splat(radius);
    let frame = move |u: f64| {
        let [p, d, dd] = trefoil(scale, TAU * u);
        let tangent = d.normalize();
        let normal = (dd - tangent * dd.dot(tangent)).normalize();
        // (n1, n2) with n2 x n1 = tangent, so that the grid is oriented outwards.
        (p, normal, normal.cross(tangent))
    };
    Shape::from_mesher(
        "trefoil_tube",
        Bounds::centred(half),
        2.0 * radius,
        Truth {
            chiral: true,
            ..truth
        },
        Some(Field::Tube {
            centreline: Arc::new(centreline),
            radius,
        }),
        move |n| {
            tube_grid(n, length, radius, |u| {
                let (p, n1, n2) = frame(u);
                (p, n1, -n2)
            })
            .oriented_outwards()
        },
        move |p| {
            let t = nearest_parameter(p, |t| trefoil(scale, t));
            let centre = trefoil(scale, t)[0];
            centre + (p - centre).normalize_or(DVec3::Z) * radius
        },
    )
}

impl TriangleMesh {
    /// The mesh, flipped when its volume is negative.
    pub fn oriented_outwards(self) -> Self {
        if self.volume() < 0.0 { self.flipped() } else { self }
    }
}

/// Parameter of the point of a closed curve nearest to `p`: a scan, then Newton on the foot-point equation.
fn nearest_parameter(p: DVec3, curve: impl Fn(f64) -> [DVec3; 3]) -> f64 {
    let steps = 96;
    let at = |k: usize| TAU * k as f64 / steps as f64;
    let start = (0..steps)
        .min_by(|&a, &b| {
            curve(at(a))[0]
                .distance_squared(p)
                .total_cmp(&curve(at(b))[0].distance_squared(p))
        })
        .expect("there are steps");
    let mut t = at(start);
    for _ in 0..20 {
        let [c, d, dd] = curve(t);
        let slope = d.length_squared() - (p - c).dot(dd);
        let step = (p - c).dot(d) / if slope > 0.0 { slope } else { d.length_squared() };
        t += step.clamp(-0.05, 0.05);
        if step.abs() < 1e-15 {
            break;
        }
    }
    t
}

/// Capsule along x: a segment of that length grown by `radius`. One wire, two nodes.
pub fn capsule(length: f64, radius: f64) -> Shape {
    let end = DVec3::new(0.5 * length, 0.0, 0.0);
    let medial = Medial {
        nodes: [-end, end]
            .map(|p| MedialNode {
                position: with_radius(p, radius),
            })
            .to_vec(),
        curves: vec![wire(&[with_radius(-end, radius), with_radius(end, radius)])],
        sheets: Vec::new(),
    };
    let truth = Truth::solid_of_genus(0, "Capsule: its segment, one wire of constant radius.")
        .with_size(
            PI * radius * radius * (length + 4.0 / 3.0 * radius),
            TAU * radius * length + 4.0 * PI * radius * radius,
        )
        .with_medial(medial);
    let half = end + DVec3::splat(radius);
    let truth = Truth {
        rotational_symmetry: true,
        ..truth
    };
    Shape::from_field(
        "capsule",
        Field::capsule(-end, end, radius),
        Bounds::centred(half),
        2.0 * radius,
        truth,
    )
}

/// A wire through some points, straight pieces finely divided.
fn wire(points: &[[f64; 4]]) -> MedialCurve {
    let mut polyline = vec![points[0]];
    for pair in points.windows(2) {
        polyline.extend((1..=64).map(|k| -> [f64; 4] {
            std::array::from_fn(|i| pair[0][i] + k as f64 / 64.0 * (pair[1][i] - pair[0][i]))
        }));
    }
    MedialCurve {
        kind: CurveKind::Wire,
        closed: false,
        polyline,
    }
}

/// Sharp union of three capsules of that radius from the origin, in the plane z = 0, 120 degrees apart, each of that length.
///
/// # Panics
/// Unless `length > radius`.
pub fn y_of_capsules(length: f64, radius: f64) -> Shape {
    assert!(length > radius, "arms must be longer than their radius");
    let arm = |k: usize| DVec3::new((TAU * k as f64 / 3.0).cos(), (TAU * k as f64 / 3.0).sin(), 0.0);
    let (l, r) = (length, radius);
    let root3 = 3f64.sqrt();
    let corner = |k: usize| with_radius(arm(k % 3) * r / root3, r);
    let mut medial = Medial::default();
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let steps = 24u32;
    for k in 0..3 {
        let tip = with_radius(arm(k) * l, r);
        medial.nodes.push(MedialNode { position: corner(k) });
        medial.nodes.push(MedialNode { position: tip });
        medial.curves.push(wire(&[corner(k), tip]));
        // The sector towards the next arm: bisector b, across w; the rib is the line s = r / (2 sqrt 3).
        let b = 0.5 * (arm(k) + arm((k + 1) % 3)) * 2.0;
        let w = DVec3::Z.cross(b);
        let at = |s: f64, u: f64| with_radius(s * b + u * w, (r * r - 3.0 * s * s + u * u).max(0.0).sqrt());
        let edge = r / (2.0 * root3);
        let rib = (0..=64).map(|i| at(edge, edge * root3 * (2.0 * i as f64 / 64.0 - 1.0)));
        medial.curves.push(MedialCurve {
            kind: CurveKind::Rib,
            closed: false,
            polyline: rib.collect(),
        });
        let base = vertices.len() as u32;
        for i in 0..=steps {
            let s = edge * i as f64 / steps as f64;
            vertices.extend((0..=i).map(|j| {
                at(
                    s,
                    if i == 0 {
                        0.0
                    } else {
                        s * root3 * (2.0 * j as f64 / i as f64 - 1.0)
                    },
                )
            }));
        }
        let id = |i: u32, j: u32| base + i * (i + 1) / 2 + j;
        for i in 0..steps {
            for j in 0..=i {
                triangles.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
                if j < i {
                    triangles.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
                }
            }
        }
    }
    medial.sheets.push(MedialSheet::new(vertices, triangles));
    let volume = 3.0 * (PI * r * r * l + 2.0 / 3.0 * PI * r.powi(3) - 4.0 * r.powi(3) / (3.0 * root3));
    let area = 3.0 * (TAU * r * l + TAU * r * r - 4.0 * r * r / root3);
    let mut truth = Truth::solid_of_genus(
        0,
        "Three capsules, sharp union: three wires and, at the centre, an equilateral triangle with corners r/sqrt 3 out on the arms, \
         which any sensible tolerance contracts to one node.",
    )
    .with_size(volume, area)
    .with_medial(medial);
    truth.counts_at_tolerance = Some(MedialCounts {
        nodes: 4,
        wires: 3,
        ..MedialCounts::default()
    });
    let field = Field::union(
        (0..3)
            .map(|k| Field::capsule(DVec3::ZERO, arm(k) * l, r))
            .collect(),
    );
    let bounds = Bounds {
        min: DVec3::new(-0.5 * l - r, -0.5 * root3 * l - r, -r),
        max: DVec3::new(l + r, 0.5 * root3 * l + r, r),
    };
    Shape::from_field("y_of_capsules", field, bounds, 2.0 * r, truth)
}

/// Sharp union of two balls of radius `ball` with centres `distance` apart on the x axis and the cylinder of radius `neck` between them.
///
/// # Panics
/// Unless `neck < ball` and the balls are apart.
pub fn dumbbell(distance: f64, ball: f64, neck: f64) -> Shape {
    let crease = (ball * ball - neck * neck).sqrt();
    assert!(
        neck < ball && 2.0 * ball < distance,
        "a dumbbell needs a neck thinner than its balls, and balls apart"
    );
    let half = 0.5 * distance;
    let profile = |x: f64| {
        let t = half - x.abs();
        let r = if t < crease {
            (ball * ball + t * t - 2.0 * crease * t).sqrt()
        } else {
            neck
        };
        [x, 0.0, 0.0, r]
    };
    let polyline: Vec<[f64; 4]> = (0..=512)
        .map(|k| profile(half * (2.0 * k as f64 / 512.0 - 1.0)))
        .collect();
    let medial = Medial {
        nodes: [-half, half]
            .map(|x| MedialNode { position: profile(x) })
            .to_vec(),
        curves: vec![MedialCurve {
            kind: CurveKind::Wire,
            closed: false,
            polyline,
        }],
        sheets: Vec::new(),
    };
    let cap = ball - crease;
    let volume = 2.0 * (4.0 / 3.0 * PI * ball.powi(3) - PI * cap * cap * (3.0 * ball - cap) / 3.0)
        + PI * neck * neck * (distance - 2.0 * crease);
    let area = 2.0 * (4.0 * PI * ball * ball - TAU * ball * cap) + TAU * neck * (distance - 2.0 * crease);
    let mut truth = Truth::solid_of_genus(
        0,
        "Two balls and a cylinder, sharp union: one wire from centre to centre; the radius falls as sqrt(R^2+t^2-2at) to the neck.",
    )
    .with_size(volume, area)
    .with_medial(medial);
    truth.rotational_symmetry = true;
    let end = DVec3::new(half, 0.0, 0.0);
    let field = Field::union(vec![
        Field::Ball {
            centre: -end,
            radius: ball,
        },
        Field::Ball {
            centre: end,
            radius: ball,
        },
        Field::capsule(-end, end, neck),
    ]);
    let bounds = Bounds::centred(DVec3::new(half + ball, ball, ball));
    Shape::from_field("dumbbell", field, bounds, 2.0 * neck, truth)
}

/// A branching tree of tubes, like an airway or a vessel: a trunk and `generations` binary splits, each generation shorter and
/// thinner by 0.78, smoothly joined. `2^(generations + 1) - 1` wires; as many nodes and one more.
///
/// Away from the joints (by four radii) the medial set is the centreline given, with its radii; at the joints the blend adds volume, so volume and area are
/// not given.
///
/// # Panics
/// For more than 6 generations.
pub fn tree_tube(generations: usize) -> Shape {
    assert!(generations <= 6, "at most 6 generations");
    let mut branches: Vec<(DVec3, DVec3, f64)> = Vec::new();
    // (start, direction, plane normal, length, radius) of the branches still to be split.
    let mut front = vec![(DVec3::ZERO, DVec3::Z, DVec3::X, 12.0, 1.2)];
    for generation in 0..=generations {
        let mut next = Vec::new();
        for &(start, direction, normal, length, radius) in &front {
            let end = start + direction * length;
            branches.push((start, end, radius));
            // The two children leave in a plane turned by 80 degrees from generation to generation, at unequal angles.
            let axis = glam::DQuat::from_axis_angle(direction, 80f64.to_radians()) * normal;
            for (side, angle) in [(1.0, 38f64), (-1.0, 47f64)] {
                let turn = glam::DQuat::from_axis_angle(axis, side * angle.to_radians());
                next.push((
                    end,
                    (turn * direction).normalize(),
                    axis,
                    0.78 * length,
                    0.78 * radius,
                ));
            }
        }
        if generation < generations {
            front = next;
        }
    }
    let mut medial = Medial::default();
    medial.nodes.push(MedialNode {
        position: with_radius(DVec3::ZERO, branches[0].2),
    });
    for &(a, b, r) in &branches {
        medial.nodes.push(MedialNode {
            position: with_radius(b, r),
        });
        medial.curves.push(wire(&[with_radius(a, r), with_radius(b, r)]));
    }
    let counts = medial.counts();
    let thinnest = branches.last().expect("there is a trunk").2;
    let ends: Vec<DVec3> = branches.iter().flat_map(|b| [b.0, b.1]).collect();
    let bounds = Bounds::of(&ends).expect("there is a trunk").inflated(1.6);
    let terms = branches
        .iter()
        .map(|&(a, b, r)| Field::capsule(a, b, r))
        .collect();
    let mut truth = Truth::solid_of_genus(
        0,
        "Tree of tubes, smooth union: the centreline graph, exact away from the joints; joints carry small sheets that a tolerance removes.",
    )
    .with_medial(medial);
    truth.counts = None;
    truth.counts_at_tolerance = Some(counts);
    truth.chiral = true;
    Shape::from_field(
        "tree_tube",
        Field::blend(0.12, terms),
        bounds,
        2.0 * thinnest,
        truth,
    )
}
