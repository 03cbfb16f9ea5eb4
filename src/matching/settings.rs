//! Settings of matching.

use serde::{Deserialize, Serialize};

/// Settings of [`match_scaffolds`](super::match_scaffolds). Values out of range are brought to the nearest end of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchingSettings {
    /// Match the mirror image of the source (a left bone on a right one).
    pub mirrored: bool,
    /// Medial points by which a scaffold is aligned, at least 50. 1 500 put bones within 0.3 degrees.
    pub samples: usize,
    /// How far apart corresponding elements may lie once the pose is known, as a share of the mean diagonal. 0.06: curves of
    /// persistence over 1.5 % re-appear within it on 93 to 99 % of re-sampled bones.
    pub reach: f64,
    /// Relative difference of attributes at which two elements have nothing in common. 0.5: one is three times the other.
    pub unlike: f64,
    /// Share of the price of a pair that is its attributes, the rest is its place under the pose; 0 to 1.
    pub attribute_share: f64,
    /// Most nodes of the search that proves the edit path the cheapest; beyond it the bounds stay apart.
    pub search_nodes: usize,
    /// Poses kept, at least 2.
    pub hypotheses: usize,
    /// A pose is ambiguous when another, over 15 degrees away, has a residual below this multiple of its own; at least 1.
    pub rival_residual: f64,
    /// Seed of the sampling.
    pub seed: u64,
}

impl Default for MatchingSettings {
    fn default() -> Self {
        Self {
            mirrored: false,
            samples: 1500,
            reach: 0.06,
            unlike: 0.5,
            attribute_share: 0.3,
            search_nodes: 2000,
            hypotheses: 6,
            rival_residual: 1.3,
            seed: 0,
        }
    }
}

impl MatchingSettings {
    /// The settings with every value in its range.
    pub(crate) fn in_range(&self) -> Self {
        let positive = |x: f64, least: f64| if x.is_finite() { x.max(least) } else { least };
        Self {
            samples: self.samples.max(50),
            reach: positive(self.reach, 1e-6),
            unlike: positive(self.unlike, 1e-6),
            attribute_share: positive(self.attribute_share, 0.0).min(1.0),
            hypotheses: self.hypotheses.max(2),
            rival_residual: positive(self.rival_residual, 1.0),
            ..self.clone()
        }
    }
}
