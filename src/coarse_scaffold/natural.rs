//! Natural tolerances: the widest gaps in the sorted persistences of axial curves and wires. Inside a gap the graph does not
//! depend on the exact cut, and two shapes of a kind cut at a shared gap have the same graph most often.

use super::hypergraph::{Curve, CurveKind, NaturalTolerance};

/// Gaps reported.
const REPORTED: usize = 5;

/// The widest gaps from the tolerance up, by the ratio of their ends, the widest first.
pub(crate) fn natural_tolerances(
    curves: &[Curve],
    tolerance_mm: f64,
    never_mm: f64,
) -> Vec<NaturalTolerance> {
    let mut values: Vec<f64> = curves
        .iter()
        .filter(|c| matches!(c.kind, CurveKind::Axial | CurveKind::Wire))
        .map(|c| c.persistence)
        .filter(|&p| p > tolerance_mm && p < never_mm)
        .collect();
    let kept_always = curves
        .iter()
        .filter(|c| matches!(c.kind, CurveKind::Axial | CurveKind::Wire) && c.persistence >= never_mm)
        .count();
    values.push(tolerance_mm);
    values.sort_unstable_by(f64::total_cmp);
    let mut gaps: Vec<NaturalTolerance> = values
        .windows(2)
        .enumerate()
        .map(|(i, w)| NaturalTolerance {
            tolerance_mm: (w[0] * w[1]).sqrt(),
            ratio: w[1] / w[0],
            curves: (values.len() - 1 - i + kept_always) as u32,
        })
        .collect();
    gaps.sort_by(|a, b| {
        b.ratio
            .total_cmp(&a.ratio)
            .then(a.tolerance_mm.total_cmp(&b.tolerance_mm))
    });
    gaps.truncate(REPORTED);
    gaps
}
