//! Settings of the segregation of clouds, and where each number comes from.

use super::gap_cost::CostRule;
use super::prepare::PrepareReport;
use serde::{Deserialize, Serialize};

/// Share of the points beyond which outliers were no exception.
const MANY_OUTLIERS: f64 = 0.01;

/// Whether noise may be removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Denoise {
    /// As far as the measured noise demands.
    #[default]
    Auto,
    /// Never: every distinct point is used as given.
    Off,
    /// At least one pass.
    Always,
}

/// Whether the surface is to be closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClosedOrOpen {
    /// By the unsupported area.
    #[default]
    Auto,
    /// Closed, holes filled.
    Closed,
    /// Open, holes left.
    Open,
}

/// Settings of [`super::segregate_cloud`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegregationSettings {
    /// Whether noise may be removed.
    pub denoise: Denoise,
    /// Whether the surface is to be closed.
    pub closed: ClosedOrOpen,
    /// Lengths the gap-transform cost is measured against.
    pub cost: CostRule,
    /// Return only the component of this rank (0: most points); `None` returns all.
    pub component: Option<usize>,
    /// Seed of the thinning, the one random choice.
    pub seed: u64,
    /// Share of unsupported area from which a cloud is open. Measured: closing a hole of 4 % of the area takes at least
    /// 1.3 % (median 3.6 %, less than 4 because a patch is flat); right closed surfaces have at most 0.8 % with noise up to a
    /// quarter of the spacing.
    pub open_area_share: f64,
    /// The same for clouds whose noise reaches [`Self::second_opinion_noise`], of which right closed surfaces have up to
    /// 1.9 %, and for those that lost more than 1 % of their points as outliers (up to 2.2 %: with outliers go points of
    /// thin parts).
    pub noisy_open_area_share: f64,
    /// Least share of the points a component must touch; smaller ones are islands.
    pub least_component_share: f64,
    /// Noise over spacing from which a second seed is tried. Measured: below it no run of 108 was wrong.
    pub second_opinion_noise: f64,
}

impl Default for SegregationSettings {
    fn default() -> Self {
        Self {
            denoise: Denoise::Auto,
            closed: ClosedOrOpen::Auto,
            cost: CostRule::Local,
            component: None,
            seed: 0,
            open_area_share: 0.015,
            noisy_open_area_share: 0.03,
            least_component_share: 0.01,
            second_opinion_noise: 0.35,
        }
    }
}

impl SegregationSettings {
    /// The share from which a cloud prepared like this is open.
    pub(super) fn threshold(&self, prepared: &PrepareReport) -> f64 {
        let few_outliers = prepared.outliers as f64 <= MANY_OUTLIERS * prepared.points as f64;
        if few_outliers && prepared.noise_over_spacing < self.second_opinion_noise {
            self.open_area_share
        } else {
            self.noisy_open_area_share
        }
    }
}
