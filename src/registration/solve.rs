//! One Gauss-Newton step of a rigid or similarity fit, and how firmly the data hold it.
//!
//! In: rows `n . (p + w x (p - c) + v + s (p - c) - q)`, each a place, a direction, a residual and a weight. Out: the small
//! motion that reduces their weighted sum of squares (Chen and Medioni 1992; Low 2004), or the eigenvalues of the normal
//! matrix (Gelfand et al. 2003: small ones are the motions that slide).

use super::result::{Conditioning, SlidingDirection};
use crate::geometry::Rigid;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{SMatrix, SVector};

/// How much a small turn about the three axes, a shift along them and a growth move a point at `arm` from their centre along `direction`.
#[inline]
pub(crate) fn motion_row(arm: DVec3, direction: DVec3) -> [f64; 7] {
    let turn = arm.cross(direction);
    [
        turn.x,
        turn.y,
        turn.z,
        direction.x,
        direction.y,
        direction.z,
        arm.dot(direction),
    ]
}

/// The normal equations of a fit about a fixed centre.
pub(crate) struct NormalEquations {
    centre: DVec3,
    matrix: SMatrix<f64, 7, 7>,
    right: SVector<f64, 7>,
    /// Sum of weights of the rows so far.
    pub(crate) weight: f64,
}

/// A motion of the moving shape, applied after the pose it was computed at.
pub(crate) struct Step {
    pub(crate) motion: Rigid,
    /// Rotation angle (rad) plus translation plus change of scale: the size of the step in the unit of the points.
    pub(crate) size: f64,
}

impl NormalEquations {
    pub(crate) fn new(centre: DVec3) -> Self {
        Self {
            centre,
            matrix: SMatrix::zeros(),
            right: SVector::zeros(),
            weight: 0.0,
        }
    }

    /// Adds the row of a point at `place` whose offset along the unit `direction` is `residual`.
    #[inline]
    pub(crate) fn add(&mut self, place: DVec3, direction: DVec3, residual: f64, weight: f64) {
        let arm = place - self.centre;
        let row = motion_row(arm, direction);
        for i in 0..7 {
            let wi = weight * row[i];
            for j in 0..=i {
                self.matrix[(i, j)] += wi * row[j];
            }
            self.right[i] -= wi * residual;
        }
        self.weight += weight;
    }

    /// Solves for the step; `damping` is added to the diagonal (as a share of the mean weight). `None` without data.
    pub(crate) fn solve(&self, scale: bool, damping: f64, longest_turn: f64) -> Option<Step> {
        if self.weight <= 0.0 {
            return None;
        }
        let mut m = self.matrix;
        let mut b = self.right;
        for i in 0..7 {
            m[(i, i)] += (damping + 1e-12) * self.weight;
        }
        if !scale {
            for i in 0..6 {
                m[(6, i)] = 0.0;
            }
            m[(6, 6)] = self.weight;
            b[6] = 0.0;
        }
        let x = m.cholesky()?.solve(&b);
        let mut turn = DVec3::new(x[0], x[1], x[2]);
        let mut shift = DVec3::new(x[3], x[4], x[5]);
        let mut growth = x[6];
        let angle = turn.length();
        if angle > longest_turn {
            let share = longest_turn / angle;
            turn *= share;
            shift *= share;
            growth *= share;
        }
        let growth = growth.clamp(-0.2, 0.2);
        let linear = DMat3::from_quat(DQuat::from_scaled_axis(turn)) * (1.0 + growth);
        let motion = Rigid {
            linear,
            translation: self.centre + shift - linear * self.centre,
        };
        motion.linear.is_finite().then_some(Step {
            motion,
            size: turn.length() + shift.length() + growth.abs(),
        })
    }

    /// Stiffness of the six rigid motions, rotations measured in `gyration` (the radius of gyration).
    pub(crate) fn conditioning(&self, gyration: f64, sliding_share: f64) -> Conditioning {
        let unit = |i: usize| {
            if i < 3 {
                1.0 / gyration.max(f64::MIN_POSITIVE)
            } else {
                1.0
            }
        };
        let m = SMatrix::<f64, 6, 6>::from_fn(|i, j| self.matrix[(i.max(j), i.min(j))] * unit(i) * unit(j));
        let eigen = m.symmetric_eigen();
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let largest = eigen.eigenvalues[order[0]].max(f64::MIN_POSITIVE);
        let mut out = Conditioning::default();
        for (slot, &k) in order.iter().enumerate() {
            let stiffness = (eigen.eigenvalues[k] / largest).max(0.0);
            out.stiffness[slot] = stiffness;
            if stiffness < sliding_share {
                let v = eigen.eigenvectors.column(k);
                out.sliding.push(SlidingDirection {
                    rotation: DVec3::new(v[0], v[1], v[2]),
                    translation: DVec3::new(v[3], v[4], v[5]),
                    stiffness,
                });
            }
        }
        out
    }
}

/// A rigid motion with its linear part made a rotation again (products of many steps drift by rounding).
pub(crate) fn cleaned(pose: Rigid, scale: bool) -> Rigid {
    if scale {
        return pose;
    }
    let q = DQuat::from_mat3(&pose.linear).normalize();
    Rigid {
        linear: DMat3::from_quat(q),
        translation: pose.translation,
    }
}
