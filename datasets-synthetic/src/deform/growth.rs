//! Lesions that change by exactly known volumes.
//!
//! A lesion is a star-shaped blob ([`StarRadius`]); its follow-up is another one. The amount of change is solved for (bisection on the exact volume), so
//! that the percent change is what was asked for to 1e-10. The signed distance grown in a direction is `follow-up radius - baseline radius`,
//! exact along rays from the common origin.

use crate::sampling::generator;
use crate::shapes::star::{Lobe, StarRadius};
use glam::DVec3;
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Random stream of lesions.
const STREAM: u64 = 30;

/// How a lesion changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GrowthKind {
    /// Nothing changes.
    None,
    /// All radii scale alike (shrinks for negative change).
    Uniform,
    /// A broad bulge on one side.
    OneSided,
    /// A narrow new lobe where the baseline is flattest.
    NewLobe,
    /// A broad dent on one side.
    PartialShrink,
}

impl GrowthKind {
    /// All kinds.
    pub const ALL: [GrowthKind; 5] = [
        GrowthKind::None,
        GrowthKind::Uniform,
        GrowthKind::OneSided,
        GrowthKind::NewLobe,
        GrowthKind::PartialShrink,
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            GrowthKind::None => "none",
            GrowthKind::Uniform => "uniform",
            GrowthKind::OneSided => "one_sided",
            GrowthKind::NewLobe => "new_lobe",
            GrowthKind::PartialShrink => "partial_shrink",
        }
    }
}

/// A change with its truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Growth {
    /// How it changed.
    pub kind: GrowthKind,
    /// Before.
    pub baseline: StarRadius,
    /// After.
    pub followup: StarRadius,
    /// Volume before, mm^3.
    pub baseline_mm3: f64,
    /// Volume after, mm^3.
    pub followup_mm3: f64,
    /// `100 (after / before - 1)`.
    pub percent: f64,
    /// Where it grew or shrank most; `None` when it did so everywhere alike.
    pub direction: Option<DVec3>,
}

impl Growth {
    /// Signed distance that the surface moved along the ray towards `p`, mm; positive outwards.
    pub fn displacement_mm(&self, p: DVec3) -> f64 {
        self.followup.radius(p) - self.baseline.radius(p)
    }
}

fn random_direction(rng: &mut rand_chacha::ChaCha8Rng) -> DVec3 {
    let z = 2.0 * rng.random::<f64>() - 1.0;
    let a = TAU * rng.random::<f64>();
    let rho = (1.0 - z * z).sqrt();
    DVec3::new(rho * a.cos(), rho * a.sin(), z)
}

/// A random lesion of about that mean radius with three to five unequal lobes.
pub fn random_lesion(mean_radius_mm: f64, seed: u64) -> StarRadius {
    let mut rng = generator(seed, STREAM);
    let count = 3 + (rng.random::<f64>() * 3.0) as usize;
    let lobes = (0..count)
        .map(|_| Lobe {
            direction: random_direction(&mut rng),
            height_mm: mean_radius_mm * (0.15 + 0.35 * rng.random::<f64>()),
            sharpness: 3.0 + 5.0 * rng.random::<f64>(),
        })
        .collect();
    StarRadius {
        base_mm: 0.8 * mean_radius_mm,
        lobes,
    }
}

/// Changes a lesion so that its volume changes by exactly `percent`.
///
/// The sign must fit the kind: [`GrowthKind::OneSided`] and [`GrowthKind::NewLobe`] take the absolute value, [`GrowthKind::PartialShrink`] the
/// negative of it, [`GrowthKind::None`] ignores it. Shrinking is limited to 60 % (a dent must not reach the origin).
pub fn grow(baseline: &StarRadius, kind: GrowthKind, percent: f64, seed: u64) -> Growth {
    let before = baseline.volume();
    let signed = match kind {
        GrowthKind::None => 0.0,
        GrowthKind::Uniform => percent.max(-60.0),
        GrowthKind::OneSided | GrowthKind::NewLobe => percent.abs(),
        GrowthKind::PartialShrink => -percent.abs().min(60.0),
    };
    let target = before * (1.0 + signed / 100.0);
    let mut rng = generator(seed, STREAM + 1);
    let (followup, direction) = match kind {
        GrowthKind::None => (baseline.clone(), None),
        GrowthKind::Uniform => (scaled(baseline, (1.0 + signed / 100.0).cbrt()), None),
        GrowthKind::OneSided | GrowthKind::PartialShrink => {
            let direction = random_direction(&mut rng);
            (with_lobe(baseline, direction, 2.5, target), Some(direction))
        }
        GrowthKind::NewLobe => {
            // Of 64 directions the one with the least radius.
            let flattest = (0..64)
                .map(|_| random_direction(&mut rng))
                .min_by(|a, b| baseline.radius(*a).total_cmp(&baseline.radius(*b)))
                .expect("64 directions were drawn");
            (with_lobe(baseline, flattest, 20.0, target), Some(flattest))
        }
    };
    let after = followup.volume();
    Growth {
        kind,
        baseline: baseline.clone(),
        followup,
        baseline_mm3: before,
        followup_mm3: after,
        percent: 100.0 * (after / before - 1.0),
        direction,
    }
}

fn scaled(radius: &StarRadius, factor: f64) -> StarRadius {
    let lobes = radius
        .lobes
        .iter()
        .map(|l| Lobe {
            height_mm: factor * l.height_mm,
            ..*l
        })
        .collect();
    StarRadius {
        base_mm: factor * radius.base_mm,
        lobes,
    }
}

/// Adds one lobe (a dent when the target is smaller) whose height gives the target volume; the volume grows with the height.
fn with_lobe(radius: &StarRadius, direction: DVec3, sharpness: f64, target_mm3: f64) -> StarRadius {
    let candidate = |height_mm: f64| {
        let mut changed = radius.clone();
        changed.lobes.push(Lobe {
            direction,
            height_mm,
            sharpness,
        });
        changed
    };
    let (mut low, mut high) = (-0.95 * radius.base_mm, radius.base_mm);
    while candidate(high).volume() < target_mm3 {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if candidate(middle).volume() < target_mm3 {
            low = middle
        } else {
            high = middle
        }
    }
    candidate(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::star_blob;

    #[test]
    fn volumes_change_by_what_was_asked() {
        for seed in 0..4 {
            let lesion = random_lesion(10.0, seed);
            for (kind, percent) in [
                (GrowthKind::None, 0.0),
                (GrowthKind::Uniform, 25.0),
                (GrowthKind::Uniform, -30.0),
                (GrowthKind::OneSided, 40.0),
                (GrowthKind::NewLobe, 15.0),
                (GrowthKind::PartialShrink, -20.0),
            ] {
                let growth = grow(&lesion, kind, percent, seed);
                assert!(
                    (growth.percent - percent).abs() < 1e-8,
                    "{kind:?}: {}",
                    growth.percent
                );
                let volume = |r: &StarRadius| star_blob("x", r.clone()).mesh(80_000).volume();
                let meshed = 100.0 * (volume(&growth.followup) / volume(&growth.baseline) - 1.0);
                assert!((meshed - percent).abs() < 0.1, "{kind:?}: meshes say {meshed}");
                if let Some(direction) = growth.direction {
                    let most = growth.displacement_mm(direction);
                    assert!(
                        most * percent > 0.0 && growth.displacement_mm(-direction).abs() < 0.05 * most.abs()
                    );
                }
            }
        }
    }
}
