//! Eight carpal-like bones: smooth closed genus-0 surfaces with the sizes, the facets and the handedness of small bones.
//!
//! None is copied from a scan. Each is a smooth union of superellipsoids (the poles, bodies and processes of the bone), carved by large
//! spheres and flattened by planes where a neighbour or a long bone articulates, with a little relief on top. What each has of its namesake:
//!
//! | bone | size, mm | features |
//! |---|---|---|
//! | scaphoid | 27 x 15 x 12 | boat: proximal pole, waist, distal tubercle bent to one side; hollow facet for the head of the capitate |
//! | lunate | 18 x 15 x 13 | crescent: deep distal hollow between two unequal horns, convex proximal side |
//! | triquetrum | 18 x 14 x 11 | pyramid: broad base, blunt apex, screw-shaped facet, flat round facet for the pisiform |
//! | pisiform | 14 x 11 x 9 | pea: an egg with one flat facet; nearly symmetric, its pose is hard to tell |
//! | trapezium | 22 x 17 x 14 | saddle facet at one end, crest with a groove beside it |
//! | trapezoid | 18 x 15 x 12 | boot-shaped wedge, broad behind and narrow in front |
//! | capitate | 25 x 17 x 15 | round head, neck, broad square body with a flat slanted base |
//! | hamate | 25 x 20 x 18 | wedge with a curved hook |
//!
//! `seed` 0 is the reference; any other seed is another individual: the reference under the modes of [`crate::population`], with weights drawn from the seed.

use crate::implicit::Field;
use crate::mesh::Bounds;
use crate::population;
use crate::shapes::Shape;
use crate::truth::Truth;
use glam::{DMat3, DQuat, DVec3, EulerRot};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A carpal-like bone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Bone {
    /// Boat with a tubercle.
    Scaphoid,
    /// Crescent.
    Lunate,
    /// Pyramid.
    Triquetrum,
    /// Pea.
    Pisiform,
    /// Saddle and crest.
    Trapezium,
    /// Wedge.
    Trapezoid,
    /// Head, neck and body.
    Capitate,
    /// Wedge with a hook.
    Hamate,
}

impl Bone {
    /// All eight, proximal row first.
    pub const ALL: [Bone; 8] = [
        Bone::Scaphoid,
        Bone::Lunate,
        Bone::Triquetrum,
        Bone::Pisiform,
        Bone::Trapezium,
        Bone::Trapezoid,
        Bone::Capitate,
        Bone::Hamate,
    ];

    /// Lower-case name.
    pub fn name(self) -> &'static str {
        match self {
            Bone::Scaphoid => "scaphoid",
            Bone::Lunate => "lunate",
            Bone::Triquetrum => "triquetrum",
            Bone::Pisiform => "pisiform",
            Bone::Trapezium => "trapezium",
            Bone::Trapezoid => "trapezoid",
            Bone::Capitate => "capitate",
            Bone::Hamate => "hamate",
        }
    }

    /// Lengths of the reference along x, y, z, mm (to about 1 %).
    pub fn size_mm(self) -> DVec3 {
        match self {
            Bone::Scaphoid => DVec3::new(27.0, 15.0, 12.0),
            Bone::Lunate => DVec3::new(18.0, 15.0, 13.0),
            Bone::Triquetrum => DVec3::new(18.0, 14.0, 11.0),
            Bone::Pisiform => DVec3::new(14.0, 11.0, 9.0),
            Bone::Trapezium => DVec3::new(22.0, 17.0, 14.0),
            Bone::Trapezoid => DVec3::new(18.0, 15.0, 12.0),
            Bone::Capitate => DVec3::new(25.0, 17.0, 15.0),
            Bone::Hamate => DVec3::new(25.0, 20.0, 18.0),
        }
    }

    fn design(self) -> Field {
        match self {
            Bone::Scaphoid => scaphoid(),
            Bone::Lunate => lunate(),
            Bone::Triquetrum => triquetrum(),
            Bone::Pisiform => pisiform(),
            Bone::Trapezium => trapezium(),
            Bone::Trapezoid => trapezoid(),
            Bone::Capitate => capitate(),
            Bone::Hamate => hamate(),
        }
    }

    /// Size and centre of the design as drawn, mm, measured on a fine mesh: it is stretched to the stated size around the origin.
    fn drawn_mm(self) -> [DVec3; 2] {
        let [size, centre] = match self {
            Bone::Scaphoid => [[26.27, 12.97, 10.14], [-0.21, 0.32, 0.26]],
            Bone::Lunate => [[18.44, 14.55, 11.69], [-0.02, -0.54, -0.01]],
            Bone::Triquetrum => [[17.36, 13.09, 11.17], [0.28, -0.07, -0.01]],
            Bone::Pisiform => [[13.64, 10.70, 8.66], [0.12, 0.11, -0.41]],
            Bone::Trapezium => [[18.64, 15.77, 12.87], [-0.28, 0.31, 0.28]],
            Bone::Trapezoid => [[19.51, 13.82, 11.60], [-0.04, 0.52, 0.21]],
            Bone::Capitate => [[24.29, 15.07, 13.82], [-0.50, 0.19, 0.12]],
            Bone::Hamate => [[22.01, 15.51, 18.72], [-0.69, -1.69, 0.50]],
        };
        [DVec3::from_array(size), DVec3::from_array(centre)]
    }

    /// Thickness of the thinnest part, mm.
    fn finest_feature(self) -> f64 {
        match self {
            Bone::Hamate | Bone::Lunate => 4.0,
            _ => 6.0,
        }
    }
}

/// The bone of that kind; seed 0 is the reference, other seeds are other individuals.
pub fn bone(kind: Bone, seed: u64) -> Shape {
    let reference = reference(kind);
    if seed == 0 {
        reference
    } else {
        population::individual(&reference, seed).shape
    }
}

/// All eight bones of one individual.
pub fn all(seed: u64) -> Vec<Shape> {
    Bone::ALL.iter().map(|&kind| bone(kind, seed)).collect()
}

fn reference(kind: Bone) -> Shape {
    let mut truth = Truth::solid_of_genus(
        0,
        "Carpal-like bone: smooth union of superellipsoids carved by spheres and planes; one piece without holes.",
    );
    // The pisiform's handedness is too weak to rely on.
    truth.chiral = kind != Bone::Pisiform;
    let bounds = Bounds::centred(0.5 * kind.size_mm()).inflated(0.6);
    let [size, centre] = kind.drawn_mm();
    let scale = kind.size_mm() / size;
    let field = kind.design().stretched(scale, -centre * scale);
    Shape::from_field(kind.name(), field, bounds, kind.finest_feature(), truth)
}

/// Scaphoid-like bone.
pub fn scaphoid_like(seed: u64) -> Shape {
    bone(Bone::Scaphoid, seed)
}

/// Lunate-like bone.
pub fn lunate_like(seed: u64) -> Shape {
    bone(Bone::Lunate, seed)
}

/// Triquetrum-like bone.
pub fn triquetrum_like(seed: u64) -> Shape {
    bone(Bone::Triquetrum, seed)
}

/// Pisiform-like bone.
pub fn pisiform_like(seed: u64) -> Shape {
    bone(Bone::Pisiform, seed)
}

/// Trapezium-like bone.
pub fn trapezium_like(seed: u64) -> Shape {
    bone(Bone::Trapezium, seed)
}

/// Trapezoid-like bone.
pub fn trapezoid_like(seed: u64) -> Shape {
    bone(Bone::Trapezoid, seed)
}

/// Capitate-like bone.
pub fn capitate_like(seed: u64) -> Shape {
    bone(Bone::Capitate, seed)
}

/// Hamate-like bone.
pub fn hamate_like(seed: u64) -> Shape {
    bone(Bone::Hamate, seed)
}

/// Superellipsoid with its axes turned by Euler angles about x, y, z [degrees].
fn lump(centre: [f64; 3], radii: [f64; 3], power: f64, turn_deg: [f64; 3]) -> Field {
    let [x, y, z] = turn_deg.map(f64::to_radians);
    let axes = DMat3::from_quat(DQuat::from_euler(EulerRot::XYZ, x, y, z));
    Field::superellipsoid(DVec3::from_array(centre), axes, DVec3::from_array(radii), power)
}

fn ball(centre: [f64; 3], radius: f64) -> Field {
    Field::Ball {
        centre: DVec3::from_array(centre),
        radius,
    }
}

fn cone(a: [f64; 3], b: [f64; 3], radii: [f64; 2]) -> Field {
    Field::Cone {
        ends: [DVec3::from_array(a), DVec3::from_array(b)],
        radii,
    }
}

/// What lies beyond a plane, to be carved off: the half space on the side `normal` points to, from `offset` mm on.
fn beyond(normal: [f64; 3], offset: f64) -> Field {
    let normal = DVec3::from_array(normal).normalize();
    Field::HalfSpace {
        normal: -normal,
        offset: -offset,
    }
}

/// Gentle relief (ligament marks, vessels): four waves 6 to 9 mm long with that amplitude, different for every bone.
fn with_relief(of: Field, amplitude: f64, key: f64) -> Field {
    let waves = (0..4)
        .map(|k| {
            let t = key + k as f64;
            // Directions and phases from irrational steps: fixed, unrelated, and without a seed.
            let (a, b) = (2.399_963 * t, 1.0 - 2.0 * (0.754_878 * t).fract());
            let rho = (1.0 - b * b).sqrt();
            let length = 6.0 + (k as f64);
            let vector = DVec3::new(rho * a.cos(), rho * a.sin(), b) * (std::f64::consts::TAU / length);
            (vector, 1.7 * t, amplitude)
        })
        .collect();
    Field::Relief {
        of: Arc::new(of),
        waves: Arc::new(waves),
    }
}

fn scaphoid() -> Field {
    let body = Field::blend(
        1.1,
        vec![
            lump([-6.6, 0.6, 0.0], [6.6, 5.6, 4.6], 2.5, [10.0, 0.0, -18.0]),
            lump([0.2, 1.6, 0.2], [5.6, 4.2, 3.9], 2.0, [0.0, 0.0, 6.0]),
            lump([6.8, 0.2, 0.6], [5.6, 5.0, 4.3], 2.5, [20.0, 10.0, 24.0]),
            lump([9.6, -3.4, 2.4], [2.8, 2.4, 2.2], 2.0, [0.0, 0.0, 0.0]),
        ],
    );
    let carved = body.carved(
        0.5,
        vec![
            // Head of the capitate, facing trapezium and trapezoid, and the flat lunate facet.
            ball([-3.4, -11.8, -1.8], 9.6),
            ball([17.4, 5.6, -3.2], 8.6),
            beyond([-0.75, -0.6, -0.35], 10.2),
        ],
    );
    with_relief(carved, 0.07, 0.3)
}

fn lunate() -> Field {
    let body = Field::blend(
        1.0,
        vec![
            lump([0.0, -1.4, 0.0], [8.2, 6.2, 5.8], 2.5, [0.0, 0.0, 0.0]),
            lump([-5.4, 2.6, 0.6], [3.4, 4.6, 5.0], 2.5, [0.0, 0.0, 14.0]),
            lump([5.8, 1.6, -0.5], [2.9, 4.4, 4.2], 2.5, [0.0, 0.0, -20.0]),
        ],
    );
    let carved = body.carved(
        0.5,
        vec![
            ball([0.8, 9.6, 0.4], 7.4),
            beyond([0.25, 0.1, 1.0], 5.7),
            beyond([-0.1, 0.35, -1.0], 5.9),
        ],
    );
    with_relief(carved, 0.06, 5.1)
}

fn triquetrum() -> Field {
    let body = Field::blend(
        1.2,
        vec![
            lump([-4.0, 0.0, 0.0], [4.8, 6.4, 5.0], 2.5, [15.0, 0.0, 10.0]),
            lump([1.6, 0.6, 0.2], [5.0, 4.9, 4.2], 2.5, [25.0, 0.0, -10.0]),
            lump([5.8, -0.6, -0.6], [3.2, 3.4, 3.0], 2.0, [0.0, 0.0, 0.0]),
        ],
    );
    let carved = body.carved(
        0.45,
        vec![
            // Hamate (a screw: two spheres out of line), lunate (flat), pisiform (flat, round).
            ball([-5.6, 12.8, 3.8], 8.4),
            ball([6.4, 11.4, -4.6], 8.0),
            beyond([-1.0, 0.1, 0.25], 8.0),
            beyond([0.45, -0.35, 0.85], 4.9),
        ],
    );
    with_relief(carved, 0.06, 9.7)
}

fn pisiform() -> Field {
    let body = Field::blend(
        0.8,
        vec![
            lump([-0.8, 0.0, 0.0], [5.8, 5.2, 4.4], 2.0, [0.0, 0.0, 0.0]),
            lump([2.2, 0.0, -0.1], [4.6, 4.6, 3.9], 2.0, [0.0, 0.0, 0.0]),
        ],
    );
    with_relief(body.carved(0.5, vec![beyond([-0.15, 0.0, 1.0], 3.9)]), 0.05, 2.2)
}

fn trapezium() -> Field {
    let body = Field::blend(
        1.0,
        vec![
            lump([-1.0, 0.0, -0.4], [8.6, 6.2, 5.2], 3.0, [8.0, -10.0, 14.0]),
            lump([5.4, -2.8, 0.4], [4.6, 4.8, 4.8], 2.5, [0.0, 20.0, 0.0]),
            // The crest.
            cone([-5.2, 4.8, 3.6], [3.6, 5.8, 4.4], [1.9, 2.3]),
        ],
    );
    let carved = body.carved(
        0.45,
        vec![
            // Saddle: hollow across y (a sphere far out on x) left convex along z by two shallow flanks.
            ball([17.2, -1.0, 0.4], 9.2),
            beyond([0.72, -0.2, 0.75], 8.4),
            beyond([0.70, -0.1, -0.78], 7.8),
            // Groove of the tendon beside the crest, scaphoid and trapezoid facets.
            Field::capsule(DVec3::new(-14.0, 1.4, 9.4), DVec3::new(14.0, 2.6, 10.6), 4.4),
            ball([-15.6, -5.0, -2.2], 8.6),
            beyond([-0.35, -1.0, -0.15], 6.6),
        ],
    );
    with_relief(carved, 0.06, 13.4)
}

fn trapezoid() -> Field {
    let body = Field::blend(
        0.9,
        vec![
            lump([-3.2, 0.4, 0.2], [6.2, 7.2, 5.6], 3.5, [0.0, 6.0, 6.0]),
            lump([4.2, -1.0, -0.6], [5.2, 4.6, 4.0], 3.0, [0.0, 12.0, -16.0]),
        ],
    );
    let carved = body.carved(
        0.4,
        vec![
            beyond([0.42, 1.0, 0.05], 6.0),
            beyond([0.25, -1.0, 0.1], 6.0),
            ball([1.6, 3.4, 12.2], 7.8),
            beyond([0.1, -0.25, -1.0], 5.2),
            ball([-2.4, -14.6, 1.8], 9.0),
        ],
    );
    with_relief(carved, 0.06, 17.9)
}

fn capitate() -> Field {
    let body = Field::blend(
        1.0,
        vec![
            lump([-7.4, 0.8, 0.4], [5.2, 5.4, 5.4], 2.0, [0.0, 0.0, 0.0]),
            lump([-1.6, 0.0, 0.0], [4.6, 4.6, 4.8], 2.5, [0.0, 0.0, 0.0]),
            lump([5.4, -0.4, -0.2], [6.8, 7.2, 6.2], 3.5, [6.0, -8.0, 8.0]),
            // Dorsal corner.
            lump([9.0, 4.4, 3.6], [2.8, 3.0, 2.8], 2.5, [0.0, 0.0, 0.0]),
        ],
    );
    let carved = body.carved(
        0.5,
        vec![
            // Slanted base, hamate facet (long, flat), hollow scaphoid side, trapezoid corner, palmar roughness.
            beyond([1.0, -0.28, 0.12], 10.6),
            beyond([-0.12, -1.0, 0.2], 6.4),
            ball([-2.2, 14.8, -2.6], 9.8),
            beyond([0.62, 0.72, -0.3], 10.3),
            ball([-1.8, 2.8, -12.4], 8.2),
        ],
    );
    with_relief(carved, 0.07, 21.5)
}

fn hamate() -> Field {
    let body = Field::blend(
        1.0,
        vec![
            lump([3.6, -1.4, -3.4], [7.0, 7.6, 5.2], 3.0, [0.0, 6.0, -8.0]),
            lump([-4.8, 0.4, -2.8], [6.8, 5.4, 4.4], 2.5, [0.0, 0.0, 20.0]),
            // The hook rises and curls towards +y.
            cone([6.0, -4.4, -0.6], [6.7, -5.0, 4.4], [3.4, 2.1]),
            cone([6.6, -4.6, 4.9], [5.6, -2.0, 7.9], [2.0, 1.9]),
        ],
    );
    let carved = body.carved(
        0.5,
        vec![
            // Two facets of the long bones meeting in a ridge, the capitate's plane, the screw of the triquetrum.
            beyond([1.0, 0.35, -0.1], 9.6),
            beyond([0.9, -0.5, -0.2], 11.0),
            beyond([-0.16, 1.0, 0.05], 5.6),
            ball([-9.6, -11.4, 0.4], 8.4),
        ],
    );
    with_relief(carved, 0.06, 26.8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_are_closed_genus_zero_and_of_the_stated_size() {
        for kind in Bone::ALL {
            for n in [3_000, 12_000] {
                let mesh = bone(kind, 0).mesh(n);
                let t = mesh.topology();
                assert!(t.is_closed_oriented_manifold(), "{kind:?}: {t:?}");
                assert_eq!((t.euler, t.components), (2, 1), "{kind:?}");
                let ratio = mesh.bounds().size() / kind.size_mm();
                assert!(
                    (ratio - 1.0).abs().max_element() < 0.03,
                    "{kind:?}: {} mm",
                    mesh.bounds().size()
                );
            }
        }
    }
}
