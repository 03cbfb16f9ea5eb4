//! What is said of the chosen pose: its distances, how freely it moves, and the two kinds of doubt.
//!
//! A pose is *ambiguous* when another one may be right instead: a rival, another size or the other hand that fits about as well. It is
//! *uncertain* when it is known to more than five degrees only, by its standard errors or because the shapes differ and fits to all and to the
//! part that agrees end that far apart.

use super::partial::{CLEAR_MARGIN, RIVAL_DEG};
use super::precision::standard_errors;
use super::refine::{Level, equations, resting_level};
use super::result::{AxisPrecision, Conditioning, Hypothesis, Method, Precision, Registration};
use super::significance::lead;
use super::sizes;
use super::surface::{self, Distances};
use super::verdict::{Candidate, INDISTINCT, Search, mirror_of, scale_of};
use crate::geometry::Rigid;
use glam::DVec3;
use rayon::prelude::*;
/// Standard errors in half a 95 % interval of one number.
const NINETY_FIVE: f64 = 2.0;

/// Both handednesses fit about equally when their residuals are within this factor.
const MIRROR_UNSURE: f64 = 1.05;

/// Closer than this a sample lies on the other surface, in units.
const ON_SURFACE: f64 = 0.03;

impl Search<'_> {
    /// The report of the first candidate. There always is one: the whole search keeps its first guesses and the partial search
    /// falls back to none only when no pair of points is alike.
    pub(super) fn report(&self, candidates: Vec<Candidate>, unit: f64) -> Registration {
        let Some(best) = candidates.first().cloned() else {
            return self.nothing(unit);
        };
        let (source, target) = self.views(&best);
        let fit = self.measure(&best);
        let precision = self.precision(&best, unit);
        let ambiguity = self.ambiguity(&candidates);
        let uncertainty = self.uncertainty(&best, precision.as_ref());
        let hypotheses = candidates
            .iter()
            .take(self.settings.hypotheses)
            .map(|c| Hypothesis {
                T_target_source: self.in_mm(c, unit),
                score: c.score,
                rms: c.rms * unit,
                mirrored: c.mirrored,
            })
            .collect();
        let pose = self.in_mm(&best, unit);
        Registration {
            T_target_source: pose,
            scale: scale_of(&pose),
            converged: best.converged,
            mirrored: best.mirrored,
            ambiguous: !ambiguity.is_empty(),
            ambiguity,
            uncertain: !uncertainty.is_empty(),
            uncertainty,
            hypotheses,
            rms: fit.rms * unit,
            p95: fit.p95 * unit,
            max: fit.max * unit,
            overlap: fit.overlap,
            overlap_target: fit.overlap_target,
            score: best.score,
            method: best.method,
            conditioning: self.conditioning(&best),
            precision,
            noise_source: source.noise * unit / source.size,
            noise_target: target.noise * unit,
        }
    }

    /// Said when the shapes share nothing at all: the centroids are joined and the result is not trusted.
    fn nothing(&self, unit: f64) -> Registration {
        let pose = Candidate {
            pose: Rigid::IDENTITY,
            pair: 0,
            mirrored: self.pairs[0].source.mirrored,
            method: Method::Partial,
            rms: 0.0,
            residual: 0.0,
            robust: false,
            other_kind: None,
            score: 0.0,
            converged: false,
        };
        let mut out = self.report(vec![pose], unit);
        out.ambiguity = vec!["no pair of points of one shape resembles one of the other".into()];
        out.ambiguous = true;
        out
    }

    fn ambiguity(&self, candidates: &[Candidate]) -> Vec<String> {
        let s = self.settings;
        let mut reasons = Vec::new();
        let Some(best) = candidates.first() else {
            return reasons;
        };
        let rival = candidates
            .iter()
            .skip(1)
            .find(|c| c.mirrored == best.mirrored && c.pose.rotation_angle_deg(&best.pose) > RIVAL_DEG);
        let other_hand = candidates.iter().find(|c| c.mirrored != best.mirrored);
        let other_size = candidates.iter().skip(1).find(|c| {
            c.mirrored == best.mirrored && (self.size(c) / self.size(best)).ln().abs() > sizes::OTHER_SIZE
        });
        match best.method {
            Method::Whole => {
                if let Some(r) =
                    rival.filter(|r| r.residual < s.rival_residual * best.residual.max(INDISTINCT))
                {
                    let angle = r.pose.rotation_angle_deg(&best.pose);
                    let ratio = r.residual / best.residual.max(INDISTINCT);
                    let (source, target) = self.views(best);
                    let clip = if best.robust {
                        surface::differs_beyond(best.residual)
                    } else {
                        f64::INFINITY
                    };
                    let lead = lead(source, target, &best.pose, &r.pose, clip);
                    // Where a part is missing, distances say less than what lies in free space does.
                    let open = !(source.closed && target.closed);
                    let by_free_space = open && best.score > r.score + CLEAR_MARGIN;
                    if (lead < s.rival_lead && !by_free_space) || r.residual < s.rival_residual * INDISTINCT {
                        reasons.push(format!(
                            "a pose {angle:.0} degrees away has only {ratio:.2} times the residual, a lead of {lead:.1} standard \
                             errors over the surface"
                        ));
                    }
                }
                let near = |a: f64, b: f64| a.max(b) < MIRROR_UNSURE * a.min(b).max(INDISTINCT);
                if let Some(o) = other_hand.filter(|o| near(o.residual, best.residual)) {
                    reasons.push(format!(
                        "the other handedness fits as well: {:.3} times the residual",
                        o.residual / best.residual.max(INDISTINCT)
                    ));
                }
            }
            Method::Partial => {
                if best.score < s.weak_score {
                    reasons.push(format!("the surfaces hardly agree: score {:.2}", best.score));
                }
                if let Some(r) = rival.filter(|r| r.score > best.score - s.rival_margin) {
                    let angle = r.pose.rotation_angle_deg(&best.pose);
                    reasons.push(format!(
                        "a pose {angle:.0} degrees away scores {:.2} against {:.2}",
                        r.score, best.score
                    ));
                }
                if let Some(o) = other_size.filter(|o| o.score > best.score - s.rival_margin) {
                    reasons.push(format!(
                        "{:.2} times that size scores {:.2} against {:.2}",
                        self.size(o) / self.size(best),
                        o.score,
                        best.score
                    ));
                }
                if let Some(o) = other_hand.filter(|o| o.score > best.score - s.rival_margin) {
                    reasons.push(format!(
                        "the other handedness scores {:.2} against {:.2}",
                        o.score, best.score
                    ));
                }
            }
        }
        reasons
    }

    /// The motion from the source's frame to the target's, mm.
    fn in_mm(&self, c: &Candidate, unit: f64) -> Rigid {
        let (source, target) = self.views(c);
        let linear = c.pose.linear * mirror_of(c.mirrored) * source.size;
        Rigid {
            linear,
            translation: target.centre + c.pose.translation * unit - linear * source.centre,
        }
    }

    fn conditioning(&self, c: &Candidate) -> Conditioning {
        let level = Level {
            iterations: 1,
            from: 0.06,
            to: 0.06,
            count: 2000,
            exact: false,
            cosine: 0.5,
            by_noise: false,
        };
        let (source, target) = self.views(c);
        let rows = equations(source, target, &c.pose, level, level.from);
        rows.conditioning(target.gyration(), self.settings.sliding_share)
    }

    fn precision(&self, c: &Candidate, unit: f64) -> Option<Precision> {
        let (source, target) = self.views(c);
        let level = resting_level(source, target);
        let robust = c.method == Method::Partial || c.robust || surface::ends_close(source, target, c.rms);
        // An untruncated fit used every pair; beyond four of its distances hardly any is left.
        let tolerance = if c.robust {
            level.to.max(surface::differs_beyond(c.residual))
        } else if robust {
            level.to
        } else {
            level.to.max(4.0 * c.rms)
        };
        let scale = self.settings.scale;
        let found = standard_errors(source, target, &c.pose, level, tolerance, robust, scale)?;
        let axes = found.axes.iter().map(|&(axis, error)| AxisPrecision {
            axis,
            deg: error.to_degrees(),
        });
        Some(Precision {
            rotation_deg: found.rotation.to_degrees(),
            axes: axes.collect(),
            translation_mm: found.translation * unit,
            scale_percent: found.growth.map(|g| 100.0 * g),
        })
    }

    /// What the standard errors say against a pose: that it slides, spins or grows too freely.
    fn uncertainty(&self, best: &Candidate, precision: Option<&Precision>) -> Vec<String> {
        let mut reasons = Vec::new();
        let apart = best.other_kind.map(|o| o.rotation_angle_deg(&best.pose));
        if let Some(angle) = apart.filter(|a| *a > self.settings.uncertain_deg) {
            reasons.push(format!(
                "the shapes differ: fitted as wholes and by the part that agrees best they lie {angle:.0} degrees apart"
            ));
        }
        let Some(p) = precision else {
            reasons.push("what the surfaces share does not say how precisely the pose is held".into());
            return reasons;
        };
        let reach = reach_deg(p);
        if reach > self.settings.uncertain_deg {
            let axis = p.axes.first().map_or(DVec3::ZERO, |a| a.axis);
            reasons.push(format!(
                "known to plus or minus {reach:.1} degrees (95 %), loosest about the axis ({:.2}, {:.2}, {:.2})",
                axis.x, axis.y, axis.z
            ));
        }
        if let Some(percent) = p.scale_percent
            && NINETY_FIVE * percent > self.settings.uncertain_scale_percent
        {
            reasons.push(format!(
                "the size is known to plus or minus {:.0} % (95 %)",
                NINETY_FIVE * percent
            ));
        }
        reasons
    }

    /// Distances and overlap of a pose.
    pub(super) fn measure(&self, c: &Candidate) -> Measured {
        let (source, target) = self.views(c);
        let d = Distances::new(source, target, &c.pose, usize::MAX);
        let share = |d: &[f64]| d.iter().filter(|d| **d < ON_SURFACE).count() as f64 / d.len().max(1) as f64;
        let (overlap, overlap_target) = (share(&d.there), share(&d.back));
        let counted = match c.method {
            Method::Whole => d,
            Method::Partial => Distances {
                there: d.there.into_iter().filter(|d| *d < ON_SURFACE).collect(),
                back: d.back.into_iter().filter(|d| *d < ON_SURFACE).collect(),
            },
        };
        let mut max = counted.quantile(1.0);
        if c.method == Method::Whole {
            let at_vertices: Vec<f64> = source
                .vertices
                .par_iter()
                .map(|&v| {
                    let q = c.pose.apply(v);
                    target.exact.touch(q).place.distance(q)
                })
                .collect();
            max = at_vertices.into_iter().fold(max, f64::max);
        }
        Measured {
            rms: counted.rms(),
            p95: counted.quantile(0.95),
            max,
            overlap,
            overlap_target,
        }
    }
}

/// Distances of a pose, units, and the shares of both surfaces that lie on each other.
pub(super) struct Measured {
    pub(super) rms: f64,
    pub(super) p95: f64,
    pub(super) max: f64,
    pub(super) overlap: f64,
    pub(super) overlap_target: f64,
}

/// The angle that the rotation's error stays below in 95 of 100 cases, degrees. The squared angle is a sum of independent squares about the
/// three axes, which is taken for a multiple of a chi-square variable with the same mean and variance (Satterthwaite 1946).
fn reach_deg(p: &Precision) -> f64 {
    let (sum, squares) = p.axes.iter().fold((0.0, 0.0), |(sum, squares), a| {
        let variance = a.deg * a.deg;
        (sum + variance, squares + variance * variance)
    });
    if squares == 0.0 {
        return 0.0;
    }
    let freedom: f64 = (sum * sum / squares).clamp(1.0, 3.0);
    // 95 % points of chi-square over its freedom for 1, 2 and 3 degrees of freedom.
    let quantiles = [3.841, 2.996, 2.605];
    let k = ((freedom - 1.0) as usize).min(1);
    let share = freedom - 1.0 - k as f64;
    (sum * (quantiles[k] + (quantiles[k + 1] - quantiles[k]) * share)).sqrt()
}
