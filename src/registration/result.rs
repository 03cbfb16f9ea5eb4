//! What registration says: the pose, how well it fits, and what else it could be.

use crate::geometry::Rigid;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Which search gave the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Whole shapes: every sample of both surfaces counts.
    Whole,
    /// Partial shapes: free space and the shared part count.
    Partial,
}

/// A pose that was verified on the surfaces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub struct Hypothesis {
    /// Takes source coordinates to target coordinates; in files a row-major 4x4 matrix.
    #[serde(with = "rows")]
    pub T_target_source: Rigid,
    /// Agreement of the surfaces minus violations of free space, both directions: 2 for identical whole shapes, twice the
    /// overlap for partial ones, less for shapes that differ. Higher is better.
    pub score: f64,
    /// Symmetric root mean square distance of the surfaces (of the shared part for partial shapes), mm.
    pub rms: f64,
    /// Whether it mirrors.
    pub mirrored: bool,
}

/// A motion that hardly changes the fit: the pose is loose along it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlidingDirection {
    /// Rotation part: an axis scaled so that the whole motion has unit length, with rotations measured in radii of gyration.
    pub rotation: DVec3,
    /// Translation part, about the centroid of the target.
    pub translation: DVec3,
    /// Stiffness as a share of the stiffest direction's.
    pub stiffness: f64,
}

/// How firmly the surfaces hold the pose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Conditioning {
    /// Stiffness of the six motions as shares of the largest, largest first.
    pub stiffness: [f64; 6],
    /// The motions below the sliding share of the settings.
    pub sliding: Vec<SlidingDirection>,
}

/// How far the pose would scatter if the same surfaces were scanned again: standard errors from the scatter of the residuals from
/// one patch of the surface to the next. It says nothing of other basins; the runners-up do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Precision {
    /// Standard error of the rotation, degrees: root of the summed variances about three axes.
    pub rotation_deg: f64,
    /// The three axes about which the rotation errs independently, the loosest first.
    pub axes: Vec<AxisPrecision>,
    /// Standard error of the place of the middle of the shared surface, mm.
    pub translation_mm: f64,
    /// Standard error of the factor of size, percent; none for a rigid motion.
    pub scale_percent: Option<f64>,
}

/// How precisely the rotation about one axis is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisPrecision {
    /// Unit vector in the target's frame.
    pub axis: DVec3,
    /// Standard error of the rotation about it, degrees.
    pub deg: f64,
}

/// The pose of a source on a target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub struct Registration {
    /// Takes source coordinates to target coordinates; in files a row-major 4x4 matrix.
    #[serde(with = "rows")]
    pub T_target_source: Rigid,
    /// Factor of the similarity; 1 for rigid motions.
    pub scale: f64,
    /// The last step of the refinement was negligible (below 0.1 % of the spacing).
    pub converged: bool,
    /// The pose mirrors.
    pub mirrored: bool,
    /// The surfaces do not decide between this pose and a runner-up, or the evidence is weak.
    pub ambiguous: bool,
    /// Plain reasons for `ambiguous`, empty when it is not.
    pub ambiguity: Vec<String>,
    /// The pose is the right one of those that compete, as far as can be told, but known less precisely than
    /// [`uncertain_deg`](super::RegistrationSettings::uncertain_deg).
    pub uncertain: bool,
    /// Plain reasons for `uncertain`, empty when it is not.
    pub uncertainty: Vec<String>,
    /// Verified poses, the chosen one first; the runners-up are over 8 degrees apart from each other.
    pub hypotheses: Vec<Hypothesis>,
    /// Symmetric root mean square distance of the surfaces, mm; of the shared part for partial shapes.
    pub rms: f64,
    /// 95th percentile of those distances, mm.
    pub p95: f64,
    /// Largest of those distances, mm.
    pub max: f64,
    /// Share of the source's surface that lies on the target.
    pub overlap: f64,
    /// Share of the target's surface that lies on the source.
    pub overlap_target: f64,
    /// Free-space score of the pose, see [`Hypothesis::score`].
    pub score: f64,
    /// Which search gave it.
    pub method: Method,
    /// How firmly the surfaces hold the pose.
    pub conditioning: Conditioning,
    /// How precisely the pose is known; none where the surfaces share too little, or nothing holds one of the motions.
    pub precision: Option<Precision>,
    /// Noise found in a raw source cloud (standard deviation, mm); 0 when it was a mesh or came with normals.
    pub noise_source: f64,
    /// The same for the target.
    pub noise_target: f64,
}

/// A [`Rigid`] as the row-major 4x4 matrix that files hold.
pub(crate) mod rows {
    use super::{DMat3, DVec3, Rigid};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(rigid: &Rigid, s: S) -> Result<S::Ok, S::Error> {
        rigid.to_rows().serialize(s)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Rigid, D::Error> {
        let m = <[[f64; 4]; 4]>::deserialize(d)?;
        Ok(Rigid {
            linear: DMat3::from_cols_array_2d(&[
                [m[0][0], m[1][0], m[2][0]],
                [m[0][1], m[1][1], m[2][1]],
                [m[0][2], m[1][2], m[2][2]],
            ]),
            translation: DVec3::new(m[0][3], m[1][3], m[2][3]),
        })
    }
}
