//! Star-shaped solids: a radius for every direction. Volume and area are exact, so they carry growth with known truth.
//!
//! `r(u) = base + sum height_i exp(sharpness_i (u . direction_i - 1))`: smooth lobes (von Mises-Fisher bumps) on a ball.
//! `V = 1/3 integral r^3`, `A = integral r sqrt(r^2 + |grad r|^2)` over directions, by Gauss quadrature on the sphere: spectrally accurate, checked
//! against meshes.

use super::Shape;
use super::grids::{geodesic_sphere, integrate_sphere};
use crate::implicit::Field;
use crate::mesh::Bounds;
use crate::truth::Truth;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A smooth lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lobe {
    /// Unit direction of its top.
    pub direction: DVec3,
    /// Height over the base, mm; negative for a dent.
    pub height_mm: f64,
    /// Concentration; the lobe falls to half at `acos(1 - ln 2 / sharpness)`.
    pub sharpness: f64,
}

/// Radius as a function of direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StarRadius {
    /// Radius without lobes, mm.
    pub base_mm: f64,
    /// Lobes and dents.
    pub lobes: Vec<Lobe>,
}

/// Gauss nodes from pole to pole; enough for sharpness up to about 60.
const ORDER: usize = 96;

impl StarRadius {
    /// Distance of the surface from the origin in the direction of `p`, mm.
    pub fn radius(&self, p: DVec3) -> f64 {
        let u = p.normalize_or(DVec3::Z);
        let lobes = self
            .lobes
            .iter()
            .map(|l| l.height_mm * (l.sharpness * (u.dot(l.direction) - 1.0)).exp());
        self.base_mm + lobes.sum::<f64>()
    }

    /// Tangential gradient of the radius at the unit direction `u`, mm/rad.
    fn slope(&self, u: DVec3) -> DVec3 {
        let sum: DVec3 = self
            .lobes
            .iter()
            .map(|l| {
                l.direction * (l.height_mm * l.sharpness * (l.sharpness * (u.dot(l.direction) - 1.0)).exp())
            })
            .sum();
        sum - u * sum.dot(u)
    }

    /// Volume, mm^3.
    pub fn volume(&self) -> f64 {
        integrate_sphere(ORDER, |u| self.radius(u).powi(3) / 3.0)
    }

    /// Surface area, mm^2.
    pub fn area(&self) -> f64 {
        integrate_sphere(ORDER, |u| {
            let r = self.radius(u);
            r * (r * r + self.slope(u).length_squared()).sqrt()
        })
    }

    /// Smallest and largest radius over a fine set of directions, mm.
    fn range(&self) -> [f64; 2] {
        geodesic_sphere(5_000)
            .points
            .iter()
            .fold([f64::INFINITY, 0.0], |[a, b], &u| {
                let r = self.radius(u);
                [a.min(r), b.max(r)]
            })
    }
}

/// A star-shaped blob.
///
/// # Panics
/// When dents reach the origin.
pub fn star_blob(name: &str, radius: StarRadius) -> Shape {
    let [least, most] = radius.range();
    assert!(least > 0.0, "dents must not reach the origin");
    let truth = Truth::solid_of_genus(
        0,
        "Star-shaped solid: volume and area by quadrature over directions.",
    )
    .with_size(radius.volume(), radius.area());
    let shared = Arc::new(radius);
    let (for_mesh, for_points) = (shared.clone(), shared.clone());
    Shape::from_mesher(
        name,
        Bounds::centred(DVec3::splat(1.02 * most)),
        least,
        truth,
        Some(Field::Star(shared)),
        move |n| geodesic_sphere(n).mapped(|u| u * for_mesh.radius(u)),
        move |p| {
            let u = p.normalize_or(DVec3::Z);
            u * for_points.radius(u)
        },
    )
}

/// Blob with three unequal lobes in the plane z = 0, like a small multi-lobed tumour; about 20 mm across.
pub fn three_lobed_blob() -> Shape {
    let lobe = |degrees: f64, height_mm: f64, sharpness: f64| {
        let a = degrees.to_radians();
        Lobe {
            direction: DVec3::new(a.cos(), a.sin(), 0.0),
            height_mm,
            sharpness,
        }
    };
    let lobes = vec![lobe(10.0, 6.0, 7.0), lobe(125.0, 5.0, 8.0), lobe(245.0, 4.0, 7.0)];
    star_blob("three_lobed_blob", StarRadius { base_mm: 6.0, lobes })
}
