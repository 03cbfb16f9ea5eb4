//! The follow-up on the baseline, before change is measured: by structures that do not grow.
//!
//! In: a structure at both dates, as labels of the masks or as shapes of their own. Out: an [`Alignment`] and the follow-up moved.
//! 1. A mask's labels become one surface (marching cubes, smoothed), a mesh is taken as it is.
//! 2. Both surfaces are registered.
//! 3. Two dates of one patient lie nearly the same way in the scanner: among poses that fit about as well as the best (a symmetric
//!    bone has several) the one with the least rotation is taken, and the result says that there was a choice.

use super::error::StageError;
use crate::change::Alignment;
use crate::geometry::{Rigid, TriangleMesh};
use crate::input::sampling::{LabelSurfaceSettings, SamplingError, label_surface};
use crate::input::{Geometry, LabelMap, Shape};
use crate::registration::{Hypothesis, RegistrationSettings, RegistrationShape, register};

/// Poses whose residual is below this multiple of the best one's fit about as well (the rival residual of registration).
const ABOUT_AS_WELL: f64 = 1.3;

/// The surface of a structure: of some labels of a mask (all when none is named), or of a mesh.
///
/// # Errors
/// When a label is not in the mask, or the shape is a cloud.
pub fn structure_surface(shape: &Shape, labels: &[i32]) -> Result<TriangleMesh, StageError> {
    match &shape.geometry {
        Geometry::Mesh(mesh) => Ok(mesh.clone()),
        Geometry::Cloud(_) => Err(StageError::Structure {
            name: shape.name.clone(),
        }),
        Geometry::Labels(map) => {
            for &label in labels {
                if !map.values.contains(&label) {
                    return Err(SamplingError::NoLabel { label }.into());
                }
            }
            let one = LabelMap {
                values: map
                    .values
                    .iter()
                    .map(|v| i32::from(*v != 0 && (labels.is_empty() || labels.contains(v))))
                    .collect(),
                ..map.clone()
            };
            let settings = LabelSurfaceSettings {
                label: Some(1),
                ..LabelSurfaceSettings::default()
            };
            Ok(label_surface(&one, &settings)?.mesh)
        }
    }
}

/// A motion and what is said of it.
#[derive(Clone, Debug)]
#[allow(non_snake_case, reason = "frames are written as they are read")]
pub struct Aligned {
    /// Takes the follow-up to the baseline.
    pub T_baseline_followup: Rigid,
    /// For the result.
    pub alignment: Alignment,
    /// What a user must know.
    pub warnings: Vec<String>,
}

/// Registers a structure of the follow-up on that of the baseline; `on` names it.
///
/// # Errors
/// Those of [`register`].
pub fn align_on(
    baseline: &TriangleMesh,
    followup: &TriangleMesh,
    on: &str,
    settings: &RegistrationSettings,
) -> Result<Aligned, StageError> {
    let found = register(
        &RegistrationShape::mesh(baseline),
        &RegistrationShape::mesh(followup),
        settings,
    )?;
    let turn = |h: &Hypothesis| h.T_target_source.rotation_angle_deg(&Rigid::IDENTITY);
    let fits = |h: &&Hypothesis| !h.mirrored && h.rms <= ABOUT_AS_WELL * found.rms;
    let nearest = found
        .hypotheses
        .iter()
        .filter(fits)
        .min_by(|a, b| turn(a).total_cmp(&turn(b)));
    // The chosen pose itself is refined best; a rival replaces it only when it lies clearly nearer to the files' frames.
    let own = found.T_target_source.rotation_angle_deg(&Rigid::IDENTITY);
    let (motion, rms) = match nearest {
        Some(h) if turn(h) + 5.0 < own => (h.T_target_source, h.rms),
        _ => (found.T_target_source, found.rms),
    };
    let centre = followup.points.iter().sum::<glam::DVec3>() / followup.points.len().max(1) as f64;
    let warnings = found.ambiguity.iter().map(|why| {
        format!("the alignment is ambiguous ({why}): of the poses that fit, the one nearest to the files' own frames was taken")
    });
    Ok(Aligned {
        T_baseline_followup: motion,
        alignment: Alignment {
            on: on.to_owned(),
            T_baseline_followup: motion.to_rows(),
            rotation_deg: motion.rotation_angle_deg(&Rigid::IDENTITY),
            shift_mm: motion.apply(centre).distance(centre),
            rms_mm: rms,
            ambiguous: found.ambiguous,
        },
        warnings: warnings.collect(),
    })
}

/// Moves a shape; a mask keeps its voxels and gets another grid frame.
pub fn move_shape(shape: &mut Shape, motion: &Rigid) {
    match &mut shape.geometry {
        Geometry::Mesh(mesh) => {
            for p in &mut mesh.points {
                *p = motion.apply(*p);
            }
        }
        Geometry::Labels(map) => {
            map.origin = motion.apply(map.origin);
            map.direction = motion.linear * map.direction;
        }
        Geometry::Cloud(cloud) => {
            for p in &mut cloud.points {
                *p = motion.apply(*p);
            }
            for n in &mut cloud.normals {
                *n = motion.linear * *n;
            }
        }
    }
}
