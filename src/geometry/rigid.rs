//! Rigid motions, optionally mirrored or scaled, named by the frames they join: `T_target_source` takes source
//! coordinates to target coordinates.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// `x -> linear * x + translation` with `linear = scale * rotation` (or a reflection when the match is mirrored).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rigid {
    /// Rotation (times scale, times a reflection when mirrored).
    pub linear: DMat3,
    /// Translation, mm.
    pub translation: DVec3,
}

impl Default for Rigid {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Rigid {
    /// The motion that moves nothing.
    pub const IDENTITY: Self = Self {
        linear: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// The image of a point.
    #[inline]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.linear * point + self.translation
    }

    /// `self` after `first`: `(self.after(first)).apply(x) == self.apply(first.apply(x))` up to rounding.
    pub fn after(&self, first: &Rigid) -> Rigid {
        Rigid {
            linear: self.linear * first.linear,
            translation: self.apply(first.translation),
        }
    }

    /// The inverse motion. The linear part of a rigid motion, similarity or reflection is always invertible.
    pub fn inverse(&self) -> Rigid {
        let linear = self.linear.inverse();
        Rigid {
            linear,
            translation: -(linear * self.translation),
        }
    }

    /// Whether the motion changes handedness.
    pub fn is_mirrored(&self) -> bool {
        self.linear.determinant() < 0.0
    }

    /// Row-major 4x4 matrix for column vectors, as written to files.
    pub fn to_rows(&self) -> [[f64; 4]; 4] {
        let l = self.linear;
        let t = self.translation;
        [
            [l.x_axis.x, l.y_axis.x, l.z_axis.x, t.x],
            [l.x_axis.y, l.y_axis.y, l.z_axis.y, t.y],
            [l.x_axis.z, l.y_axis.z, l.z_axis.z, t.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    }

    /// Angle of the rotation that takes the linear part of `self` to that of `other`, degrees. Both must have the same
    /// handedness; scale is divided out.
    ///
    /// Uses `2 asin(|R1 - R2|_F / sqrt 8)`, which keeps its precision for small angles where `acos` loses half the digits.
    pub fn rotation_angle_deg(&self, other: &Rigid) -> f64 {
        let unit = |m: DMat3| m * m.determinant().abs().cbrt().recip();
        let d = unit(self.linear) - unit(other.linear);
        let frobenius =
            (d.x_axis.length_squared() + d.y_axis.length_squared() + d.z_axis.length_squared()).sqrt();
        2.0 * (frobenius / 8f64.sqrt()).clamp(0.0, 1.0).asin().to_degrees()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_and_composition() {
        let r = Rigid {
            linear: DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
            translation: DVec3::new(4.0, -5.0, 6.0),
        };
        let x = DVec3::new(0.3, 0.2, -9.0);
        assert!((r.inverse().after(&r).apply(x) - x).length() < 1e-12);
        assert!((r.rotation_angle_deg(&Rigid::IDENTITY) - 0.7f64.to_degrees()).abs() < 1e-9);
        assert!(!r.is_mirrored());
    }
}
