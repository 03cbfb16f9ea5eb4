//! Circumspheres of the finite tetrahedra: the vertices (A1^4) of the full scaffold with their radii.
//!
//! In: the triangulation. Out: [`Balls`]: centre and radius of every finite tetrahedron, and which of them mean nothing
//! because the tetrahedron is flat (four cocircular points make one when ties are broken symbolically). Cost `O(n)`,
//! parallel over tetrahedra.

use crate::delaunay::Triangulation;
use crate::geometry::TetId;
use glam::DVec3;
use rayon::prelude::*;

/// A circumcentre is trusted when its four distances to the vertices agree to this share of the radius.
const CENTRE_TOLERANCE: f64 = 1e-6;

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
    centre: DVec3,
    radius: f64,
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
            centres: balls.iter().map(|b| b.centre).collect(),
            radii: balls.iter().map(|b| b.radius).collect(),
            flat: balls.iter().map(|b| b.flat).collect(),
        }
    }
}

/// The circumsphere of four points, relative to the first so that digits survive far from the origin.
fn ball([a, b, c, d]: [DVec3; 4]) -> Ball {
    let (u, v, w) = (b - a, c - a, d - a);
    let det = 2.0 * u.dot(v.cross(w));
    let offset =
        (u.length_squared() * v.cross(w) + v.length_squared() * w.cross(u) + w.length_squared() * u.cross(v))
            / det;
    let radius = offset.length();
    let spread = [u, v, w]
        .iter()
        .map(|x| ((*x - offset).length() - radius).abs())
        .fold(0.0, f64::max);
    if radius.is_finite() && spread <= CENTRE_TOLERANCE * radius {
        return Ball {
            centre: a + offset,
            radius,
            flat: false,
        };
    }
    let centre = a + (u + v + w) / 4.0;
    let radius = [a, b, c, d]
        .iter()
        .map(|x| (*x - centre).length())
        .fold(0.0, f64::max);
    Ball {
        centre,
        radius,
        flat: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_corner_and_a_flat_square() {
        let b = ball([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert!((b.centre - DVec3::splat(0.5)).length() < 1e-15 && !b.flat);
        assert!((b.radius - 0.75f64.sqrt()).abs() < 1e-15);
        let square = ball([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
        assert!(square.flat && square.radius.is_finite() && square.centre.is_finite());
    }

    #[test]
    fn far_from_the_origin_the_centre_keeps_its_digits() {
        let far = DVec3::new(1e5, -2e5, 3e5);
        let b = ball([far, far + DVec3::X, far + DVec3::Y, far + DVec3::Z]);
        assert!((b.centre - far - DVec3::splat(0.5)).length() < 1e-9);
    }
}
