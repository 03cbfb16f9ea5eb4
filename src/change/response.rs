//! Response categories by published thresholds, as research calculations.
//!
//! In: measures at two dates (or a lesion gone). Out: a category for each criterion, with the number it rests on:
//! - RECIST 1.1 (Eisenhauer et al. 2009): longest axial diameter; partial response from -30 %, progression from +20 % and 5 mm;
//!   measurable from 10 mm. Criteria sum over up to five target lesions and compare with the smallest sum so far; with two
//!   dates the baseline is that smallest sum;
//! - RANO (Wen et al. 2010): product of the longest axial diameter and its perpendicular; -50 %, +25 %; measurable when both are
//!   10 mm;
//! - volumetric (RANO 2.0, Wen et al. 2023): volume; -65 %, +40 %.

use super::morphology::Measures;
use serde::{Deserialize, Serialize};

/// The four categories.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[allow(clippy::upper_case_acronyms)]
pub enum Category {
    /// Complete response: gone.
    CR,
    /// Partial response.
    PR,
    /// Stable disease.
    SD,
    /// Progressive disease.
    PD,
}

/// A category and what it rests on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Assessment {
    /// The category.
    pub category: Category,
    /// The criterion's quantity at baseline (mm, mm^2 or mm^3).
    pub baseline: f64,
    /// At follow-up.
    pub followup: f64,
    /// Change in percent.
    pub percent: f64,
    /// Whether the lesion was large enough at baseline for the criterion to apply.
    pub measurable: bool,
}

/// The three criteria.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// By longest axial diameter.
    pub recist: Assessment,
    /// By product of diameters.
    pub rano: Assessment,
    /// By volume.
    pub volumetric: Assessment,
}

/// Least diameter of a measurable lesion, mm (both criteria).
const MEASURABLE_MM: f64 = 10.0;
/// Least growth of the sum of diameters that can be progression, mm (RECIST 1.1).
const RECIST_LEAST_GROWTH_MM: f64 = 5.0;

/// The quantities of the criteria, of one lesion or summed over several.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Burden {
    /// Longest axial diameter, mm.
    pub diameter: f64,
    /// Longest axial diameter times its perpendicular, mm^2.
    pub product: f64,
    /// Volume, mm^3.
    pub volume: f64,
    /// The smaller of the two diameters, mm; of a sum, the largest of them.
    pub short: f64,
}

impl Burden {
    /// Of one lesion.
    pub fn of(m: &Measures) -> Self {
        Self {
            diameter: m.diameter_axial,
            product: m.diameter_axial * m.diameter_perpendicular,
            volume: m.volume_best,
            short: m.diameter_axial.min(m.diameter_perpendicular),
        }
    }

    /// Sum over lesions.
    pub fn sum(all: impl Iterator<Item = Burden>) -> Burden {
        all.fold(Burden::default(), |a, b| Burden {
            diameter: a.diameter + b.diameter,
            product: a.product + b.product,
            volume: a.volume + b.volume,
            short: a.short.max(b.short),
        })
    }
}

fn assess(
    baseline: f64,
    followup: f64,
    shrink: f64,
    grow: f64,
    least_growth: f64,
    measurable: bool,
) -> Assessment {
    let percent = if baseline > 0.0 {
        100.0 * (followup - baseline) / baseline
    } else {
        0.0
    };
    let category = if followup <= 0.0 {
        Category::CR
    } else if percent <= -shrink {
        Category::PR
    } else if percent >= grow && followup - baseline >= least_growth {
        Category::PD
    } else {
        Category::SD
    };
    Assessment {
        category,
        baseline,
        followup,
        percent,
        measurable,
    }
}

/// The three criteria for a change from one burden to another.
pub fn response(baseline: Burden, followup: Burden) -> Response {
    Response {
        recist: assess(
            baseline.diameter,
            followup.diameter,
            30.0,
            20.0,
            RECIST_LEAST_GROWTH_MM,
            baseline.diameter >= MEASURABLE_MM,
        ),
        rano: assess(
            baseline.product,
            followup.product,
            50.0,
            25.0,
            0.0,
            baseline.short >= MEASURABLE_MM,
        ),
        volumetric: assess(
            baseline.volume,
            followup.volume,
            65.0,
            40.0,
            0.0,
            baseline.short >= MEASURABLE_MM,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(diameter: f64) -> Burden {
        Burden {
            diameter,
            product: diameter * diameter,
            volume: std::f64::consts::PI / 6.0 * diameter.powi(3),
            short: diameter,
        }
    }

    #[test]
    fn balls_meet_the_thresholds_that_were_worked_by_hand() {
        use Category::{CR, PD, PR, SD};
        // (follow-up diameter of a 30 mm ball, RECIST, RANO, volumetric)
        for (d, recist, rano, volumetric) in [
            (0.0, CR, CR, CR),
            (20.9, PR, PR, PR),
            (21.1, SD, PR, PR),
            (21.3, SD, SD, SD),
            (30.0, SD, SD, SD),
            (33.5, SD, SD, SD),
            (33.6, SD, PD, PD),
            (35.9, SD, PD, PD),
            (36.1, PD, PD, PD),
        ] {
            let r = response(ball(30.0), ball(d));
            let found = (r.recist.category, r.rano.category, r.volumetric.category);
            let volume = 100.0 * ((d / 30.0).powi(3) - 1.0);
            assert_eq!(found, (recist, rano, volumetric), "{d} mm, volume {volume:.1} %");
        }
        // 20 % of a small lesion is less than 5 mm.
        assert_eq!(response(ball(12.0), ball(15.0)).recist.category, SD);
        assert!(!response(ball(9.0), ball(15.0)).recist.measurable);
    }
}
