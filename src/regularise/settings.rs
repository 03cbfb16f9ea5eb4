//! Settings and errors of the regularisation.

use crate::fine_scaffold::Betti;
use crate::geometry::Length;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a sheet's removal is held to cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Erosion thickness, with the movement of the surface as veto: lengths, independent of the sampling.
    #[default]
    Length,
    /// Counts of generators, as in Chang & Kimia, "Regularizing 3D medial axis using medial scaffold transforms" (2008);
    /// depends on the sampling and is kept for comparison.
    Count,
}

/// Settings of the regularisation. Factors multiply the tolerance unless they say otherwise; the defaults were measured on
/// tarsal and carpal bones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegulariseSettings {
    /// How much the shape may change.
    pub tolerance: Length,
    /// What is cheapest first.
    pub cost: Cost,
    /// Facets of erosion thickness below this many tolerances are collapsed before sheets are looked at.
    pub collapse: f64,
    /// The cut: sheets and fins of erosion thickness below this many tolerances are removed. Below 1, because the surface moves by up
    /// to the erosion thickness of what goes, and what the tolerance forbids to remove comes and goes with the sampling.
    pub splice: f64,
    /// Elements of erosion thickness below this many spacings say more of the sampling than of the shape: the cut is never
    /// below it, and never above one tolerance for its sake.
    pub splice_spacings: f64,
    /// Sheets without which the surface moves by no more than this many tolerances are spliced up to
    /// [`Self::slight_erosion`]. Where the two sides of a sheet are nearly parallel to it (round shafts, swellings, near concave
    /// edges) the sampling makes sheets of large erosion thickness that stand for nothing.
    pub slight_move: f64,
    /// Largest erosion thickness, in tolerances, of sheets spliced for their slight movement.
    pub slight_erosion: f64,
    /// Sheets grow back across their ribs to this erosion thickness, in tolerances.
    pub grow_back: f64,
    /// Facets that lengthen an axial curve grow back to this erosion thickness, in tolerances. Where an axial curve fades out, its
    /// end wanders with the sampling, and what is fainter than this is sampling too. Over all pairs of six samplings of 25 bones
    /// sheets change in views by 19, 16 and 21 % with 0.45, 0.3 and 0.15.
    pub grow_back_axial: f64,
    /// Fingers along ribs up to twice this many tolerances wide are trimmed.
    pub fringe_width: f64,
    /// Facets of erosion thickness below this many tolerances may be trimmed as fringe, when the surface moves by no more.
    pub fringe_erosion: f64,
    /// Rounds of splicing and trimming; they end sooner when nothing changes.
    pub rounds: u32,
    /// Wires are pruned at this many times the threshold of sheets, because the erosion thickness of a curve of finite
    /// sampling overshoots that of a sheet.
    pub wire: f64,
    /// The persistence of an axial curve is what it has along this length, in local tolerances, or along half of itself where that is less: its
    /// single most persistent edge is often at a node, where one facet more or less decides.
    pub persistence_length: f64,
    /// Longest seam, in tolerances: a gap between the end of an axial curve and a border that is narrower is closed. Over all pairs of
    /// six samplings of 25 bones the number of sheets changes by 20, 14, 14 and 15 % with 3, 4.5, 5.2 and 6.5.
    pub seam_length: f64,
    /// Generators farther than this many tolerances from every medial ball get a spine to a ball that comes nearer; see
    /// [`Regularised::spines`](super::Regularised::spines). 1 for none: what is within the tolerance may stay away.
    pub spine_from: f64,
    /// Longest spine, in tolerances.
    pub spine_length: f64,
    /// With [`Cost::Count`]: sheets with fewer generators than this are spliced.
    pub count_threshold: u32,
}

impl Default for RegulariseSettings {
    fn default() -> Self {
        Self {
            tolerance: Length::PercentDiagonal(1.0),
            cost: Cost::Length,
            collapse: 0.4,
            splice: 0.75,
            splice_spacings: 0.9,
            slight_move: 0.1,
            slight_erosion: 6.0,
            grow_back: 0.15,
            grow_back_axial: 0.3,
            fringe_width: 1.5,
            fringe_erosion: 0.5,
            rounds: 3,
            wire: 1.15,
            persistence_length: 1.0,
            seam_length: 4.5,
            spine_from: 0.55,
            spine_length: 20.0,
            count_threshold: 100,
        }
    }
}

/// Why a scaffold could not be regularised.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RegulariseError {
    /// A setting outside its range.
    #[error("{setting} is {value}, but must be {must}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value given.
        value: f64,
        /// What is allowed.
        must: &'static str,
    },
    /// A stage changed the homotopy type: a defect of this program, reported rather than passed on.
    #[error("Betti numbers {after:?} after {stage}, {before:?} before: please report this shape")]
    Topology {
        /// Stage.
        stage: &'static str,
        /// Before.
        before: Betti,
        /// After.
        after: Betti,
    },
}

impl RegulariseSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The first setting that is not a finite number in its range.
    pub fn check(&self) -> Result<(), RegulariseError> {
        let tolerance = match self.tolerance {
            Length::Millimetres(v)
            | Length::PercentDiagonal(v)
            | Length::Spacings(v)
            | Length::LocalRadii(v) => v,
        };
        let positive = |setting, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(RegulariseError::Setting {
                    setting,
                    value,
                    must: "a positive number",
                })
            }
        };
        positive("tolerance", tolerance)?;
        positive("collapse", self.collapse)?;
        positive("splice", self.splice)?;
        positive("slight_move", self.slight_move)?;
        positive("slight_erosion", self.slight_erosion)?;
        positive("splice_spacings", self.splice_spacings)?;
        positive("grow_back", self.grow_back)?;
        positive("grow_back_axial", self.grow_back_axial)?;
        positive("fringe_width", self.fringe_width)?;
        positive("fringe_erosion", self.fringe_erosion)?;
        positive("wire", self.wire)?;
        positive("persistence_length", self.persistence_length)?;
        positive("seam_length", self.seam_length)?;
        positive("spine_from", self.spine_from)?;
        positive("spine_length", self.spine_length)
    }
}
