//! Box, slab, triangular prism, L-block: polyhedra whose medial set is known piece by piece.
//!
//! **Counting.** In a convex polyhedron whose faces are in general position, a sheet of the medial set starts at every edge
//! (the bisector of its two faces; the edge is its rib), an axial curve starts at every vertex (the bisector of its three faces), and
//! what is left inside depends on which faces are nearest there.
//!
//! * **Box** `a < b < c`: 12 edge sheets and one middle sheet between the two largest faces, the rectangle
//!   `(b - a) x (c - a)`: 13 sheets; 8 axial curves to the corners and the 4 sides of the rectangle: 12; 12 ribs;
//!   8 corners and 4 corners of the rectangle: 12 nodes. Euler number `12 - 24 + 13 = 1`.
//! * **Prism** over an equilateral triangle with inradius `rho` and height above `2 rho`: 9 edge sheets; 6 axial curves to
//!   the corners and one on the axis: 7; 9 ribs; 6 corners and 2 ends of the axis: 8 nodes. `8 - 16 + 9 = 1`.
//! * **L-block**: an L of arm width `w` and length `l`, of height `h < w`. With `e = h / 2`, the middle sheet is the L
//!   shrunk by `e`, with an arc of radius `e` around the reflex corner. The reflex edge makes no rib; the two horizontal
//!   edges that meet at it share **one** sheet (plane, cone around the reflex edge, plane, smoothly joined). So
//!   5 + 5 horizontal-edge sheets, 5 vertical-edge sheets, 1 middle: 16 sheets. Axial: 5 around the middle, 10 to the convex
//!   corners: 15. Ribs: 5 + 5 + 5 = 15 (the one past the reflex corner has a kink there). Nodes: 10 corners and 5 inner: 15.
//!   `15 - 30 + 16 = 1`. A tool that cuts ribs at surface corners counts 17 ribs and 17 nodes.

use super::Shape;
use super::grids::{rectilinear_solid, subdivide};
use crate::implicit::Field;
use crate::mesh::{Bounds, TriangleMesh};
use crate::truth::{CurveKind, Medial, MedialCurve, MedialNode, MedialSheet, Truth, with_radius, xyz};
use glam::DVec3;

/// Straight pieces of analytic medial curves are given with this many steps.
const STEPS: usize = 64;

fn straight(kind: CurveKind, a: [f64; 4], b: [f64; 4]) -> MedialCurve {
    let polyline = (0..=STEPS)
        .map(|k| {
            let t = k as f64 / STEPS as f64;
            std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
        })
        .collect();
    MedialCurve {
        kind,
        closed: false,
        polyline,
    }
}

/// A convex planar piece on which the radius is linear, as a finely divided polygon.
fn flat_sheet(corners: &[[f64; 4]]) -> MedialSheet {
    let coarse = MedialSheet::fan(corners[0], &corners[1..], false);
    let mesh = TriangleMesh {
        points: coarse.vertices.iter().map(|&v| xyz(v)).collect(),
        triangles: coarse.triangles.clone(),
    };
    let radius = TriangleMesh {
        points: coarse
            .vertices
            .iter()
            .map(|v| DVec3::new(v[3], 0.0, 0.0))
            .collect(),
        triangles: coarse.triangles,
    };
    let (fine, fine_radius) = (subdivide(&mesh, 16), subdivide(&radius, 16));
    let vertices = fine
        .points
        .iter()
        .zip(&fine_radius.points)
        .map(|(&p, r)| with_radius(p, r.x))
        .collect();
    MedialSheet::new(vertices, fine.triangles)
}

/// Axis-aligned box around the origin with the given edge lengths (in any order). Equal lengths are degenerate: then the
/// medial truth is left out.
pub fn box_shape(x: f64, y: f64, z: f64) -> Shape {
    let half = 0.5 * DVec3::new(x, y, z);
    let mut truth = Truth::solid_of_genus(
        0,
        "Box a < b < c: 12 edge bisectors and the middle rectangle (b-a) x (c-a): 13 sheets, 12 axial curves, 12 ribs, 12 nodes.",
    )
    .with_size(x * y * z, 2.0 * (x * y + y * z + z * x));
    if x != y && y != z && z != x {
        truth = truth.with_medial(box_medial(half));
    }
    let area = 2.0 * (x * y + y * z + z * x);
    Shape::from_mesher(
        "box",
        Bounds::centred(half),
        x.min(y).min(z),
        truth,
        Some(Field::Box {
            min: -half,
            max: half,
        }),
        move |n| {
            // Squares, not equilateral triangles: two triangles for each square of that area.
            let edge = (2.0 * area / n as f64).sqrt();
            let lines = [[-half.x, half.x], [-half.y, half.y], [-half.z, half.z]];
            rectilinear_solid([&lines[0], &lines[1], &lines[2]], |_| true, edge)
        },
        // Meshes of polyhedra are exact: their points are on the surface already.
        |p| p,
    )
}

/// Thin plate: the box 20 x 14 x 1 scaled by `thickness`. Nearly all of it is the middle sheet.
///
/// With the half thickness `h` the ball at the end of the middle sheet leaves `(sqrt 2 - 1) h = 0.41 h` of an edge uncovered, which is
/// also the erosion thickness of the sheet at that edge (fire comes from the edge over `sqrt 2 h` to where the radius is `h`), and
/// `(sqrt 3 - 1) h = 0.73 h` of a corner. So a scaffold that may change the shape by `tau` has one sheet for certain, its border cut into four
/// ribs by the corners, where `0.73 h <= tau`, and all 13 sheets of a box for certain where `0.41 h > tau`. In between a method may keep the edges or not. The diagonal is
/// `48.9 h`: 1.5 % of it are `0.73 h` and must give one sheet, 0.5 % are `0.24 h` and must give 13; 1 % are `0.49 h`, where the
/// sheets at the edges stand for 0.85 tolerances and the corners for 1.5.
pub fn slab(thickness: f64) -> Shape {
    let mut shape = box_shape(20.0 * thickness, 14.0 * thickness, thickness);
    shape.name = "slab".into();
    shape
}

fn box_medial(half: DVec3) -> Medial {
    let h = half.to_array();
    let least = h.iter().copied().fold(f64::INFINITY, f64::min);
    let flat = (0..3).find(|&k| h[k] == least).expect("one axis is the shortest");
    let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    let outer = |c: usize| [sign(c, 0) * h[0], sign(c, 1) * h[1], sign(c, 2) * h[2], 0.0];
    let inner = |c: usize| -> [f64; 4] {
        std::array::from_fn(|k| {
            if k == 3 {
                least
            } else {
                sign(c, k) * (h[k] - least)
            }
        })
    };
    let mut medial = Medial::default();
    let (u, v) = ((flat + 1) % 3, (flat + 2) % 3);
    let rectangle = [0, 1 << u, 1 << u | 1 << v, 1 << v];
    medial
        .nodes
        .extend((0..8).map(|c| MedialNode { position: outer(c) }));
    medial
        .nodes
        .extend(rectangle.iter().map(|&c| MedialNode { position: inner(c) }));
    for c in 0..8usize {
        medial.curves.push(straight(CurveKind::Axial, outer(c), inner(c)));
        for axis in 0..3 {
            let d = c | 1 << axis;
            if d != c {
                medial.curves.push(straight(CurveKind::Rib, outer(c), outer(d)));
                // Edges across the flat axis end in the same inner node: a triangle.
                let corners = [outer(c), outer(d), inner(d), inner(c)];
                medial
                    .sheets
                    .push(flat_sheet(if axis == flat { &corners[..3] } else { &corners }));
            }
        }
    }
    for k in 0..4 {
        medial.curves.push(straight(
            CurveKind::Axial,
            inner(rectangle[k]),
            inner(rectangle[(k + 1) % 4]),
        ));
    }
    medial.sheets.push(flat_sheet(&rectangle.map(inner)));
    medial
}

/// Prism over an equilateral triangle of that side, axis along z (Leymarie & Kimia's example of two kinds of medial curves).
///
/// # Panics
/// Unless the height exceeds twice the inradius `side / (2 sqrt 3)`: otherwise the medial set has another structure.
pub fn prism(side: f64, height: f64) -> Shape {
    let inradius = side / (2.0 * 3f64.sqrt());
    assert!(
        height > 2.0 * inradius,
        "the height of the prism must exceed {}",
        2.0 * inradius
    );
    let circumradius = 2.0 * inradius;
    let corner = move |k: usize, z: f64| {
        let angle = std::f64::consts::TAU * k as f64 / 3.0;
        DVec3::new(circumradius * angle.cos(), circumradius * angle.sin(), z)
    };
    let top = 0.5 * height;
    let at = |k: usize, up: f64| with_radius(corner(k % 3, up * top), 0.0);
    let inner = |up: f64| [0.0, 0.0, up * (top - inradius), inradius];
    let mut medial = Medial::default();
    medial
        .curves
        .push(straight(CurveKind::Axial, inner(-1.0), inner(1.0)));
    for up in [-1.0, 1.0] {
        medial.nodes.push(MedialNode { position: inner(up) });
        for k in 0..3 {
            medial.nodes.push(MedialNode { position: at(k, up) });
            medial
                .curves
                .push(straight(CurveKind::Axial, at(k, up), inner(up)));
            medial
                .curves
                .push(straight(CurveKind::Rib, at(k, up), at(k + 1, up)));
            medial
                .sheets
                .push(flat_sheet(&[at(k, up), at(k + 1, up), inner(up)]));
        }
    }
    for k in 0..3 {
        medial
            .curves
            .push(straight(CurveKind::Rib, at(k, -1.0), at(k, 1.0)));
        medial
            .sheets
            .push(flat_sheet(&[at(k, -1.0), at(k, 1.0), inner(1.0), inner(-1.0)]));
    }
    let base = 3f64.sqrt() / 4.0 * side * side;
    let area = 2.0 * base + 3.0 * side * height;
    let truth = Truth::solid_of_genus(
        0,
        "Equilateral prism higher than twice its inradius: 9 edge sheets, the axis and 6 curves to the corners, 9 ribs, 8 nodes.",
    )
    .with_size(base * height, area)
    .with_medial(medial);
    let planes = (0..3).map(|k| Field::HalfSpace {
        normal: -corner(k, 0.0) / circumradius,
        offset: inradius,
    });
    let caps = [1.0, -1.0].map(|s| Field::HalfSpace {
        normal: s * DVec3::Z,
        offset: top,
    });
    let field = Field::intersection(planes.chain(caps).collect());
    let layers = (height / side).round().max(1.0) as usize;
    Shape::from_mesher(
        "prism",
        Bounds {
            min: DVec3::new(-inradius, -0.5 * side, -top),
            max: DVec3::new(circumradius, 0.5 * side, top),
        },
        2.0 * inradius,
        truth,
        Some(field),
        move |n| subdivide(&prism_mesh(layers, corner, top), divisions(2 + 6 * layers, n)),
        |p| p,
    )
}

/// Subdivision of a coarse mesh that gives about `wanted` triangles.
fn divisions(coarse: usize, wanted: usize) -> usize {
    (wanted as f64 / coarse as f64).sqrt().round().max(1.0) as usize
}

fn prism_mesh(layers: usize, corner: impl Fn(usize, f64) -> DVec3, top: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for layer in 0..=layers {
        let z = top * (2.0 * layer as f64 / layers as f64 - 1.0);
        mesh.points.extend((0..3).map(|k| corner(k, z)));
    }
    let last = 3 * layers as u32;
    mesh.triangles.push([0, 2, 1]);
    mesh.triangles.push([last, last + 1, last + 2]);
    for layer in 0..layers as u32 {
        for k in 0..3u32 {
            let (a, b) = (3 * layer + k, 3 * layer + (k + 1) % 3);
            mesh.triangles.extend([[a, b, b + 3], [a, b + 3, a + 3]]);
        }
    }
    mesh
}

/// An L-shaped block in the corner of the xy plane: arms of length `length` and width `width`, height `height` around z = 0.
///
/// # Panics
/// Unless `height < width < length - height`: otherwise the middle sheet has another structure.
pub fn l_block(length: f64, width: f64, height: f64) -> Shape {
    assert!(
        height < width && width < length - height,
        "an L-block needs height < width < length - height"
    );
    let (l, w, top) = (length, width, 0.5 * height);
    let base = 2.0 * l * w - w * w;
    let area = 2.0 * base + 4.0 * l * height;
    let truth = Truth::solid_of_genus(
        0,
        "L-block flatter than its arms: the shrunk L in the middle, 5 + 5 sheets from horizontal edges (those at the reflex corner \
         share one), 5 from vertical edges: 16 sheets, 15 axial curves, 15 ribs, 15 nodes (17 ribs and nodes when ribs are cut at the \
         two reflex corners).",
    )
    .with_size(base * height, area)
    .with_medial(l_block_medial(l, w, top));
    let arm = |x: f64, y: f64| Field::Box {
        min: DVec3::new(0.0, 0.0, -top),
        max: DVec3::new(x, y, top),
    };
    Shape::from_mesher(
        "l_block",
        Bounds {
            min: DVec3::new(0.0, 0.0, -top),
            max: DVec3::new(l, l, top),
        },
        height,
        truth,
        Some(Field::union(vec![arm(l, w), arm(w, l)])),
        move |n| {
            let edge = (2.0 * area / n as f64).sqrt();
            let line = [0.0, w, l];
            rectilinear_solid([&line, &line, &[-top, top]], |c| c[0] == 0 || c[1] == 0, edge)
        },
        |p| p,
    )
}

fn l_block_medial(l: f64, w: f64, e: f64) -> Medial {
    // Convex corners in order from the end of the x arm around the outside to the end of the y arm; the reflex corner comes after.
    let outline = [[l, w], [l, 0.0], [0.0, 0.0], [0.0, l], [w, l]];
    let inward = [[-e, -e], [-e, e], [e, e], [e, -e], [-e, -e]];
    let corner = |k: usize, z: f64| [outline[k][0], outline[k][1], z, 0.0];
    let inner = |k: usize| [outline[k][0] + inward[k][0], outline[k][1] + inward[k][1], 0.0, e];
    let arc: Vec<[f64; 4]> = (0..=STEPS)
        .map(|s| {
            // From below the reflex corner (angle -90 degrees) to its left (-180 degrees).
            let angle = -std::f64::consts::FRAC_PI_2 * (1.0 + s as f64 / STEPS as f64);
            [w + e * angle.cos(), w + e * angle.sin(), 0.0, e]
        })
        .collect();
    let mut medial = Medial::default();
    for k in 0..5 {
        medial.nodes.push(MedialNode { position: inner(k) });
        medial
            .curves
            .push(straight(CurveKind::Rib, corner(k, -e), corner(k, e)));
        medial
            .sheets
            .push(flat_sheet(&[corner(k, -e), corner(k, e), inner(k)]));
        for z in [-e, e] {
            medial.nodes.push(MedialNode {
                position: corner(k, z),
            });
            medial
                .curves
                .push(straight(CurveKind::Axial, corner(k, z), inner(k)));
            if k < 4 {
                medial
                    .curves
                    .push(straight(CurveKind::Rib, corner(k, z), corner(k + 1, z)));
                medial.sheets.push(flat_sheet(&[
                    corner(k, z),
                    corner(k + 1, z),
                    inner(k + 1),
                    inner(k),
                ]));
            }
        }
        if k < 4 {
            medial
                .curves
                .push(straight(CurveKind::Axial, inner(k), inner(k + 1)));
        }
    }
    // The last side of the middle sheet runs past the reflex corner: straight, arc, straight.
    let mut polyline = straight(CurveKind::Axial, inner(0), arc[0]).polyline;
    polyline.extend_from_slice(&arc[1..]);
    polyline.extend_from_slice(&straight(CurveKind::Axial, arc[STEPS], inner(4)).polyline[1..]);
    medial.curves.push(MedialCurve {
        kind: CurveKind::Axial,
        closed: false,
        polyline,
    });
    for z in [-e, e] {
        let reflex = [w, w, z, 0.0];
        let mut rib = straight(CurveKind::Rib, corner(0, z), reflex).polyline;
        rib.extend_from_slice(&straight(CurveKind::Rib, reflex, corner(4, z)).polyline[1..]);
        medial.curves.push(MedialCurve {
            kind: CurveKind::Rib,
            closed: false,
            polyline: rib,
        });
        let pieces = [
            flat_sheet(&[corner(0, z), reflex, arc[0], inner(0)]),
            MedialSheet::fan(reflex, &arc, false),
            flat_sheet(&[reflex, corner(4, z), inner(4), arc[STEPS]]),
        ];
        medial.sheets.push(joined(&pieces));
    }
    let mut ring: Vec<[f64; 4]> = (0..5).rev().map(inner).collect();
    ring.extend_from_slice(&arc);
    medial
        .sheets
        .push(MedialSheet::fan([0.5 * w, 0.5 * w, 0.0, e], &ring, true));
    medial
}

fn joined(pieces: &[MedialSheet]) -> MedialSheet {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for piece in pieces {
        let base = vertices.len() as u32;
        vertices.extend_from_slice(&piece.vertices);
        triangles.extend(piece.triangles.iter().map(|t| t.map(|v| v + base)));
    }
    MedialSheet::new(vertices, triangles)
}
