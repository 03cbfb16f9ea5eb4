//! Circumspheres of the finite tetrahedra: the vertices (A1^4) of the full scaffold with their radii.
//!
//! In: the triangulation. Out: [`Balls`]: centre and radius of every finite tetrahedron, and which of them mean nothing
//! because the tetrahedron is flat (four cocircular points make one when ties are broken symbolically). Cost `O(n)`,
//! parallel over tetrahedra.

use crate::delaunay::Triangulation;
use crate::geometry::TetId;
use crate::geometry::circumsphere::{self, Sphere};
use glam::DVec3;
use rayon::prelude::*;

/// Circumspheres of the finite tetrahedra, indexed by [`TetId`].
#[derive(Clone, Debug, Default)]
pub struct Balls {
    /// Circumcentres, mm; of a flat tetrahedron the mean of its vertices.
    pub centres: Vec<DVec3>,
    /// Circumradii, mm; of a flat tetrahedron the largest distance of a vertex from the mean.
    pub radii: Vec<f64>,
    /// Whether the tetrahedron is flat (to rounding), so that its circumsphere is not determined by it.
    pub flat: Vec<bool>,
}

/// One circumsphere.
#[derive(Clone, Copy)]
struct Ball {
    sphere: Sphere,
    flat: bool,
}

impl Balls {
    /// Computes all circumspheres.
    pub fn new(triangulation: &Triangulation) -> Self {
        let balls: Vec<Ball> = (0..triangulation.num_finite() as u32)
            .into_par_iter()
            .map(|t| ball(triangulation.corners(TetId(t))))
            .collect();
        Self {
            centres: balls.iter().map(|b| b.sphere.centre).collect(),
            radii: balls.iter().map(|b| b.sphere.radius).collect(),
            flat: balls.iter().map(|b| b.flat).collect(),
        }
    }
}

/// The circumsphere of four points, or a stand-in when they lie in a plane.
fn ball(corners: [DVec3; 4]) -> Ball {
    let sphere = circumsphere::tetrahedron(corners);
    if sphere.centre.is_finite() && sphere.radius.is_finite() {
        return Ball { sphere, flat: false };
    }
    let centre = corners.iter().sum::<DVec3>() / 4.0;
    let radius = corners.iter().map(|x| x.distance(centre)).fold(0.0, f64::max);
    Ball {
        sphere: Sphere { centre, radius },
        flat: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_corner_and_a_flat_square() {
        let b = ball([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert!((b.sphere.centre - DVec3::splat(0.5)).length() < 1e-15 && !b.flat);
        assert!((b.sphere.radius - 0.75f64.sqrt()).abs() < 1e-15);
        let square = ball([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
        assert!(square.flat && square.sphere.radius.is_finite() && square.sphere.centre.is_finite());
    }

    #[test]
    fn far_from_the_origin_the_centre_keeps_its_digits() {
        let far = DVec3::new(1e5, -2e5, 3e5);
        let b = ball([far, far + DVec3::X, far + DVec3::Y, far + DVec3::Z]);
        assert!((b.sphere.centre - far - DVec3::splat(0.5)).length() < 1e-9);
    }
}
