//! Settings of registration.

use super::shape::RegistrationError;
use serde::{Deserialize, Serialize};

/// Whether the source may be mirrored (a left bone on a right one).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mirror {
    /// Try both and let the surfaces decide.
    Auto,
    /// Always mirror.
    Yes,
    /// Never mirror.
    #[default]
    No,
}

/// How much of the shapes is taken to be shared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Extent {
    /// Try whole shapes first, partial ones when the surfaces ask for it.
    #[default]
    Auto,
    /// Both are whole.
    Whole,
    /// One or both may be cut.
    Partial,
}

/// Settings of [`register`](super::register). Lengths are shares of the larger shape's diagonal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegistrationSettings {
    /// Whether the source may be mirrored.
    pub mirror: Mirror,
    /// Whole shapes, partial ones, or find out.
    pub extent: Extent,
    /// Estimate a similarity (one scale factor) instead of a rigid motion. Of cut shapes factors from 0.8 to 1.25 are looked for.
    pub scale: bool,
    /// Points a surface is represented by while searching. 4 000 reach the accuracy measured on bones of any density.
    pub samples: usize,
    /// Poses tried for partial shapes. 10 000 found 50 of 50 half-overlapping carpals at 1 % noise, 3 000 48 of 48, 1 000
    /// 46 of 48.
    pub poses: usize,
    /// Poses tried when the first round is weak or ambiguous; no second round when not above `poses`.
    pub escalated_poses: usize,
    /// A partial pose whose free-space score is below this is ambiguous. 0.1: with 0.2 every fourth right pose at 2 % noise would be.
    pub weak_score: f64,
    /// A partial pose is ambiguous when a pose over 15 degrees away scores less than this below it. With 0.15 every pose in a
    /// wrong basin was flagged in 160 trials on bones, and 2 % of the right ones at half overlap, a third at 20 % overlap.
    pub rival_margin: f64,
    /// A whole pose may be ambiguous when a pose over 15 degrees away has a residual below this multiple of its own.
    /// Easy bones of one person have 5.5 to 7.6, the disc-like patella 1.08, two persons' bones 1.0 to 2.
    pub rival_residual: f64,
    /// ... and is, unless its lead over that pose is there over most of the surface: this many standard errors of the lead
    /// from patch to patch. 2: one chance in 40.
    pub rival_lead: f64,
    /// A pose is uncertain when its rotation is known to this many degrees only in less than 95 of 100 cases: it can slide or spin
    /// by that much. 5: what is called a right pose.
    pub uncertain_deg: f64,
    /// ... or when that of its size does, percent.
    pub uncertain_scale_percent: f64,
    /// Poses kept in [`Registration::hypotheses`](super::Registration::hypotheses).
    pub hypotheses: usize,
    /// A direction slides when its stiffness is below this share of the stiffest one.
    pub sliding_share: f64,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Default for RegistrationSettings {
    fn default() -> Self {
        Self {
            mirror: Mirror::No,
            extent: Extent::Auto,
            scale: false,
            samples: 4000,
            poses: 10_000,
            escalated_poses: 100_000,
            weak_score: 0.1,
            rival_margin: 0.15,
            rival_residual: 1.3,
            rival_lead: 2.0,
            uncertain_deg: 5.0,
            uncertain_scale_percent: 10.0,
            hypotheses: 6,
            sliding_share: 0.002,
            seed: 0,
        }
    }
}

impl RegistrationSettings {
    pub(crate) fn validate(&self) -> Result<(), RegistrationError> {
        let check = |name, value: f64, good: bool, allowed| {
            if good {
                Ok(())
            } else {
                Err(RegistrationError::Setting { name, value, allowed })
            }
        };
        check(
            "samples",
            self.samples as f64,
            (100..=200_000).contains(&self.samples),
            "100 to 200000",
        )?;
        check(
            "poses",
            self.poses as f64,
            (1..=10_000_000).contains(&self.poses),
            "1 to 10000000",
        )?;
        let many = self.escalated_poses;
        check(
            "escalated_poses",
            many as f64,
            many <= 10_000_000,
            "at most 10000000",
        )?;
        check(
            "hypotheses",
            self.hypotheses as f64,
            self.hypotheses > 0,
            "at least 1",
        )?;
        check(
            "weak_score",
            self.weak_score,
            self.weak_score.is_finite(),
            "a number",
        )?;
        check(
            "rival_margin",
            self.rival_margin,
            self.rival_margin >= 0.0,
            "at least 0",
        )?;
        check(
            "rival_residual",
            self.rival_residual,
            self.rival_residual >= 1.0,
            "at least 1",
        )?;
        check(
            "rival_lead",
            self.rival_lead,
            self.rival_lead >= 0.0,
            "at least 0",
        )?;
        check(
            "uncertain_deg",
            self.uncertain_deg,
            self.uncertain_deg > 0.0,
            "over 0",
        )?;
        check(
            "uncertain_scale_percent",
            self.uncertain_scale_percent,
            self.uncertain_scale_percent > 0.0,
            "over 0",
        )?;
        check(
            "sliding_share",
            self.sliding_share,
            (0.0..1.0).contains(&self.sliding_share),
            "0 to 1",
        )
    }
}
