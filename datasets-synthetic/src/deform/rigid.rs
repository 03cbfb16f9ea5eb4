//! Rigid motions and mirror images.

use crate::sampling::{generator, stream};
use glam::{DMat3, DQuat, DVec3};
use rand::RngExt;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// `p -> rotation p + translation`; with determinant -1 it is a mirror image.
///
/// Named by frames where it is used: `T_target_source` takes source coordinates to target coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigidMotion {
    /// Orthonormal matrix (columns).
    pub rotation: DMat3,
    /// Translation, mm.
    pub translation: DVec3,
}

impl Default for RigidMotion {
    fn default() -> Self {
        RigidMotion {
            rotation: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        }
    }
}

impl RigidMotion {
    /// Rotation about an axis through a point (rad).
    pub fn about(point: DVec3, axis: DVec3, angle: f64) -> Self {
        let rotation = DMat3::from_axis_angle(axis.normalize(), angle);
        RigidMotion {
            rotation,
            translation: point - rotation * point,
        }
    }

    /// Mirror image in the plane through `point` with that normal.
    pub fn mirror(point: DVec3, normal: DVec3) -> Self {
        let n = normal.normalize();
        let rotation = DMat3::IDENTITY - 2.0 * DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        RigidMotion {
            rotation,
            translation: point - rotation * point,
        }
    }

    /// Image of a point.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }

    /// The motion back.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        RigidMotion {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// First `first`, then `self`.
    pub fn after(&self, first: &RigidMotion) -> Self {
        RigidMotion {
            rotation: self.rotation * first.rotation,
            translation: self.rotation * first.translation + self.translation,
        }
    }

    /// Whether the handedness changes.
    pub fn is_mirror(&self) -> bool {
        self.rotation.determinant() < 0.0
    }

    /// Row-major 4 x 4 matrix for column vectors.
    pub fn to_rows(&self) -> [[f64; 4]; 4] {
        let r = self.rotation.transpose();
        let t = self.translation;
        [
            [r.x_axis.x, r.x_axis.y, r.x_axis.z, t.x],
            [r.y_axis.x, r.y_axis.y, r.y_axis.z, t.y],
            [r.z_axis.x, r.z_axis.y, r.z_axis.z, t.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    }

    /// Angle of the rotation between two motions (degrees), by the Frobenius norm, which keeps its digits near 0.
    pub fn rotation_error_deg(&self, other: &RigidMotion) -> f64 {
        let d = self.rotation - other.rotation;
        let frobenius =
            (d.x_axis.length_squared() + d.y_axis.length_squared() + d.z_axis.length_squared()).sqrt();
        (2.0 * (frobenius / 8f64.sqrt()).clamp(0.0, 1.0).asin()).to_degrees()
    }
}

/// A rotation drawn uniformly from all rotations (normalised Gaussian quaternion: Marsaglia 1972; Shoemake 1992).
pub fn random_rotation(seed: u64) -> DMat3 {
    let mut rng = generator(seed, stream::RIGID);
    let mut normal = || -> f64 { rng.sample(StandardNormal) };
    DMat3::from_quat(DQuat::from_xyzw(normal(), normal(), normal(), normal()).normalize())
}

/// A uniformly random rotation with a translation uniform in the cube of half side 100 mm.
///
/// # Example
/// ```
/// use datasets_synthetic::rigid;
/// use glam::DVec3;
/// let motion = rigid::random(3);
/// let p = DVec3::new(1.0, 2.0, 3.0);
/// assert!(motion.inverse().apply(motion.apply(p)).distance(p) < 1e-12);
/// assert!(!motion.is_mirror());
/// ```
pub fn random(seed: u64) -> RigidMotion {
    random_within(seed, 100.0)
}

/// A uniformly random rotation with a translation uniform in the cube of half side `reach` mm.
pub fn random_within(seed: u64, reach: f64) -> RigidMotion {
    let mut rng = generator(seed, stream::RIGID + 100);
    let mut u = || (2.0 * rng.random::<f64>() - 1.0) * reach;
    RigidMotion {
        rotation: random_rotation(seed),
        translation: DVec3::new(u(), u(), u()),
    }
}

/// A rotation by exactly `degrees` about a random axis through the origin.
pub fn random_of_angle(seed: u64, degrees: f64) -> RigidMotion {
    let axis = random_rotation(seed) * DVec3::Z;
    RigidMotion::about(DVec3::ZERO, axis, degrees.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_compose_invert_and_measure() {
        let (a, b) = (random(1), random(2));
        let p = DVec3::new(0.3, -4.0, 7.0);
        assert!(a.after(&b).apply(p).distance(a.apply(b.apply(p))) < 1e-12);
        assert!(a.after(&a.inverse()).apply(p).distance(p) < 1e-12);
        let small = random_of_angle(5, 0.25);
        assert!((small.rotation_error_deg(&RigidMotion::default()) - 0.25).abs() < 1e-12);
        let half_turn = random_of_angle(5, 180.0);
        assert!((half_turn.rotation_error_deg(&RigidMotion::default()) - 180.0).abs() < 1e-5);
        let mirror = RigidMotion::mirror(DVec3::X, DVec3::new(1.0, 1.0, 0.0));
        assert!(mirror.is_mirror() && mirror.apply(mirror.apply(p)).distance(p) < 1e-12);
        assert!(mirror.apply(DVec3::X).distance(DVec3::X) < 1e-15);
        let rows = a.to_rows();
        let image = a.apply(p);
        for (row, value) in rows.iter().zip([image.x, image.y, image.z]) {
            assert!((row[0] * p.x + row[1] * p.y + row[2] * p.z + row[3] - value).abs() < 1e-12);
        }
    }

    /// For uniform rotations the image of a fixed axis is uniform on the sphere: its coordinates have mean 0
    /// and variance 1/3, and the rotation angle has mean pi/2 + 2/pi.
    #[test]
    fn random_rotations_are_uniform() {
        let n = 4000;
        let images: Vec<DVec3> = (0..n).map(|s| random_rotation(s) * DVec3::X).collect();
        let mean = images.iter().sum::<DVec3>() / n as f64;
        let square = images.iter().map(|p| *p * *p).sum::<DVec3>() / n as f64;
        assert!(mean.abs().max_element() < 0.04, "{mean}");
        assert!(
            (square - DVec3::splat(1.0 / 3.0)).abs().max_element() < 0.03,
            "{square}"
        );
        let identity = RigidMotion::default();
        let angle: f64 = (0..n)
            .map(|s| RigidMotion {
                rotation: random_rotation(s),
                translation: DVec3::ZERO,
            })
            .map(|m| m.rotation_error_deg(&identity).to_radians())
            .sum::<f64>()
            / n as f64;
        let expected = std::f64::consts::FRAC_PI_2 + 2.0 / std::f64::consts::PI;
        assert!((angle - expected).abs() < 0.04, "{angle} against {expected}");
    }
}
