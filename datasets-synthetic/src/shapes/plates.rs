//! Plates: all points within `radius` of a disk with round holes. Any genus, with an exact medial set.
//!
//! The solid is the union of the balls of one radius `h` around a planar domain `D`. As long as holes are wider than `h` and apart,
//! the normals of the offset surface do not cross, so the medial set is `D` itself: **one** sheet of constant radius `h` whose
//! borders (the disk's and the holes') are ribs. Genus = number of holes = b1 of the solid.
//!
//! Volume and area (Steiner; the border's half round has cross section `pi h^2 / 2` with centroid `4 h / (3 pi)` outside `D`):
//! `V = 2 h |D| + sum over borders of (pi h^2 / 2) 2 pi (R_i +- 4 h / (3 pi))`,
//! `A = 2 |D| + sum of (pi h) 2 pi (R_i +- 2 h / pi)`; plus for the disk, minus for holes (Pappus).

use super::Shape;
use crate::implicit::Field;
use crate::mesh::Bounds;
use crate::truth::{CurveKind, Medial, MedialCurve, MedialSheet, Truth};
use glam::DVec3;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A round hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole {
    /// Centre in the plane, mm.
    pub centre: [f64; 2],
    /// Radius in the medial sheet, mm; the visible hole is narrower by the plate's radius.
    pub radius: f64,
}

/// Plate of half thickness `radius` around the disk of radius `disk` in the plane z = 0, with holes.
///
/// # Panics
/// When a hole is not wider than the plate is thick, leaves the disk or meets another.
pub fn plate_with_holes(disk: f64, radius: f64, holes: &[Hole]) -> Shape {
    let mut bridge = 2.0 * radius;
    for (i, a) in holes.iter().enumerate() {
        let out = a.centre[0].hypot(a.centre[1]);
        assert!(
            a.radius > 1.2 * radius,
            "holes must be wider than the plate is thick"
        );
        bridge = bridge
            .min(disk - out - a.radius + 2.0 * radius)
            .min(2.0 * (a.radius - radius));
        assert!(out + a.radius < disk, "holes must lie inside the disk");
        for b in &holes[i + 1..] {
            let gap = (a.centre[0] - b.centre[0]).hypot(a.centre[1] - b.centre[1]) - a.radius - b.radius;
            assert!(gap > 0.0, "holes must lie apart");
        }
    }
    let h = radius;
    let domain = PI * (disk * disk - holes.iter().map(|o| o.radius * o.radius).sum::<f64>());
    let mut volume = 2.0 * h * domain + 0.5 * PI * h * h * TAU * (disk + 4.0 * h / (3.0 * PI));
    let mut area = 2.0 * domain + PI * h * TAU * (disk + 2.0 * h / PI);
    for o in holes {
        volume += 0.5 * PI * h * h * TAU * (o.radius - 4.0 * h / (3.0 * PI));
        area += PI * h * TAU * (o.radius - 2.0 * h / PI);
    }
    let mut truth = Truth::solid_of_genus(
        holes.len() as u32,
        "Balls of one radius around a disk with holes: the medial set is that domain, one sheet; every border is a closed rib.",
    )
    .with_size(volume, area)
    .with_medial(plate_medial(disk, h, holes));
    truth.rotational_symmetry = holes.is_empty();
    let field = Field::Plate {
        disk,
        holes: Arc::new(holes.iter().map(|o| (o.centre, o.radius)).collect()),
        radius,
    };
    let reach = disk + radius;
    Shape::from_field(
        "plate",
        field,
        Bounds::centred(DVec3::new(reach, reach, radius)),
        bridge,
        truth,
    )
}

/// Plate with five holes around its centre at unequal places: genus 5, spans 22 mm.
pub fn genus_five() -> Shape {
    let holes: Vec<Hole> = (0..5)
        .map(|k| {
            let angle = TAU * (k as f64 + 0.08 * (k * k % 5) as f64) / 5.0;
            let out = 6.0 + 0.2 * (k as f64 - 2.0);
            Hole {
                centre: [out * angle.cos(), out * angle.sin()],
                radius: 2.2 + 0.1 * (k % 3) as f64,
            }
        })
        .collect();
    let mut shape = plate_with_holes(10.0, 1.0, &holes);
    shape.name = "genus_five".into();
    shape
}

fn plate_medial(disk: f64, h: f64, holes: &[Hole]) -> Medial {
    let circle = |[x, y]: [f64; 2], r: f64| -> Vec<[f64; 4]> {
        let at = |k: usize| {
            let a = TAU * (k % 360) as f64 / 360.0;
            [x + r * a.cos(), y + r * a.sin(), 0.0, h]
        };
        (0..=360).map(at).collect()
    };
    let mut borders = vec![circle([0.0, 0.0], disk)];
    borders.extend(holes.iter().map(|o| circle(o.centre, o.radius)));
    let curves = borders.into_iter().map(|polyline| MedialCurve {
        kind: CurveKind::Rib,
        closed: true,
        polyline,
    });
    Medial {
        nodes: Vec::new(),
        curves: curves.collect(),
        sheets: vec![domain_sheet(disk, h, holes)],
    }
}

/// A square grid of the cells that lie inside the domain (within a cell of its borders); the area given is the exact one.
fn domain_sheet(disk: f64, h: f64, holes: &[Hole]) -> MedialSheet {
    let n = 160usize;
    let cell = 2.0 * disk / n as f64;
    let inside = |p: [f64; 2]| {
        p[0].hypot(p[1]) <= disk
            && holes
                .iter()
                .all(|o| (p[0] - o.centre[0]).hypot(p[1] - o.centre[1]) >= o.radius)
    };
    let at = |i: usize, j: usize| [i as f64 * cell - disk, j as f64 * cell - disk];
    let mut ids = vec![u32::MAX; (n + 1) * (n + 1)];
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for j in 0..n {
        for i in 0..n {
            let quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            if !quad.iter().all(|&(a, b)| inside(at(a, b))) {
                continue;
            }
            let corner = quad.map(|(a, b)| {
                let id = &mut ids[b * (n + 1) + a];
                if *id == u32::MAX {
                    *id = vertices.len() as u32;
                    let p = at(a, b);
                    vertices.push([p[0], p[1], 0.0, h]);
                }
                *id
            });
            triangles.extend([
                [corner[0], corner[1], corner[2]],
                [corner[0], corner[2], corner[3]],
            ]);
        }
    }
    // The border circles are given exactly by the ribs, so the staircase only leaves slivers narrower than a cell.
    let area = PI * (disk * disk - holes.iter().map(|o| o.radius * o.radius).sum::<f64>());
    MedialSheet {
        vertices,
        triangles,
        area_mm2: area,
    }
}
