//! Several segmentations of the same lesions, compared with each other and with a reference.
//!
//! In: shapes in one frame, by name; optionally one of them as reference. Out: a [`Comparison`]: size of each, agreement of each
//! pair (or of each with the reference), and for every label the coefficient of variation of its volume; pooled over labels it is
//! what [`ChangeSettings::repeat_cv`] takes as the error of repeated segmentation. Labels say which lesion is which, however lesions
//! are paired over time. Cost: that of [`super::agreement`] for each pair.

use super::agreement::{Agreement, agreement};
use super::morphology::{Measures, measure};
use super::region::{Region, regions};
use super::{ChangeError, ChangeSettings, Pairing};
use crate::geometry::TriangleMesh;
use crate::input::shape::Shape;
use serde::Serialize;

/// One lesion in one segmentation.
#[derive(Clone, Debug, Serialize)]
pub struct SegmentedLesion {
    /// Name of the segmentation.
    pub segmentation: String,
    /// Label.
    pub label: i32,
    /// Size and form.
    #[serde(flatten)]
    pub measures: Measures,
    /// Its surface, LPS mm.
    #[serde(skip)]
    pub surface: TriangleMesh,
}

/// One lesion in two segmentations.
#[derive(Clone, Debug, Serialize)]
pub struct SegmentationPair {
    /// Label.
    pub label: i32,
    /// Name of one segmentation; the reference when there is one.
    pub first: String,
    /// Name of the other.
    pub second: String,
    /// Volume of the second less that of the first, in percent of the first.
    pub volume_difference_percent: f64,
    /// Overlap and distances.
    pub agreement: Agreement,
}

/// Spread of one lesion over the segmentations (the reference left out).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Repeatability {
    /// Label.
    pub label: i32,
    /// Segmentations that hold it.
    pub segmentations: usize,
    /// Mean volume, mm^3.
    pub mean_mm3: f64,
    /// Standard deviation (n - 1) over mean; left out for a single segmentation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cv: Option<f64>,
}

/// Spread over all lesions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PooledSpread {
    /// Coefficient of variation of a volume: root mean square over lesions, weighted by degrees of freedom.
    pub cv: f64,
    /// Segmentations less one, summed over lesions: how well `cv` is known.
    pub degrees_of_freedom: usize,
}

/// The result of [`compare`].
#[derive(Clone, Debug, Default, Serialize)]
pub struct Comparison {
    /// Name of the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<String>,
    /// Every lesion of every segmentation; the reference first.
    pub lesions: Vec<SegmentedLesion>,
    /// Pairs, by label.
    pub pairs: Vec<SegmentationPair>,
    /// Spread, by label.
    pub repeatability: Vec<Repeatability>,
    /// Spread over all labels; left out when no lesion was segmented twice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pooled: Option<PooledSpread>,
}

/// Compares segmentations by label; with a reference, each of them with it, else each with each.
///
/// # Errors
/// Those of [`regions`], naming the shape.
pub fn compare(
    segmentations: &[Shape],
    reference: Option<&Shape>,
    settings: &ChangeSettings,
) -> Result<Comparison, ChangeError> {
    let settings = &ChangeSettings {
        pairing: Pairing::Label,
        ..settings.clone()
    };
    let mut found: Vec<(&str, Vec<Region>)> = Vec::new();
    for shape in reference.into_iter().chain(segmentations) {
        found.push((&shape.name, regions(shape, settings)?));
    }
    let mut out = Comparison {
        reference: reference.map(|r| r.name.clone()),
        ..Comparison::default()
    };
    for (name, list) in &found {
        out.lesions.extend(list.iter().map(|r| SegmentedLesion {
            segmentation: (*name).to_owned(),
            label: r.label,
            measures: measure(r),
            surface: r.surface.clone(),
        }));
    }
    let mut labels: Vec<i32> = out.lesions.iter().map(|l| l.label).collect();
    labels.sort_unstable();
    labels.dedup();
    for label in labels {
        let of = |n: usize| found[n].1.iter().find(|r| r.label == label);
        let firsts = if reference.is_some() { 1 } else { found.len() };
        for i in 0..firsts {
            for j in i + 1..found.len() {
                if let (Some(a), Some(b)) = (of(i), of(j)) {
                    out.pairs.push(pair(
                        label,
                        (found[i].0, a),
                        (found[j].0, b),
                        &out.lesions,
                        settings,
                    ));
                }
            }
        }
        let skip = reference.map_or(0, |_| found[0].1.len());
        let volumes: Vec<f64> = out.lesions[skip..]
            .iter()
            .filter(|l| l.label == label)
            .map(|l| l.measures.volume_best)
            .collect();
        out.repeatability.push(spread(label, &volumes));
    }
    out.pooled = pooled(&out.repeatability);
    Ok(out)
}

fn pair(
    label: i32,
    (first, a): (&str, &Region),
    (second, b): (&str, &Region),
    lesions: &[SegmentedLesion],
    settings: &ChangeSettings,
) -> SegmentationPair {
    let volume = |name: &str| {
        let found = lesions
            .iter()
            .find(|l| l.segmentation == name && l.label == label);
        found.map_or(f64::NAN, |l| l.measures.volume_best)
    };
    SegmentationPair {
        label,
        first: first.to_owned(),
        second: second.to_owned(),
        volume_difference_percent: 100.0 * (volume(second) / volume(first) - 1.0),
        agreement: agreement(a, b, settings.surface_dice_tolerance_mm),
    }
}

fn spread(label: i32, volumes: &[f64]) -> Repeatability {
    let n = volumes.len() as f64;
    let mean = volumes.iter().sum::<f64>() / n.max(1.0);
    let cv = (volumes.len() > 1).then(|| {
        let squares: f64 = volumes.iter().map(|v| (v - mean).powi(2)).sum();
        (squares / (n - 1.0)).sqrt() / mean
    });
    Repeatability {
        label,
        segmentations: volumes.len(),
        mean_mm3: mean,
        cv,
    }
}

fn pooled(lesions: &[Repeatability]) -> Option<PooledSpread> {
    let known = lesions.iter().filter_map(|r| Some((r.segmentations - 1, r.cv?)));
    let (degrees_of_freedom, squares) = known.fold((0, 0.0), |(n, sum), (free, cv)| {
        (n + free, sum + free as f64 * cv * cv)
    });
    (degrees_of_freedom > 0).then(|| PooledSpread {
        cv: (squares / degrees_of_freedom as f64).sqrt(),
        degrees_of_freedom,
    })
}
