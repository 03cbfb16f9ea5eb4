//! How much two scaffolds of one shape agree: counts, curves found again, place of the medial points, fidelity.

use super::run::Run;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, Curve, CurveKind};
use medial_scaffold::geometry::closest::ClosestOnMesh;
use medial_scaffold::geometry::{Neighbours, TriangleMesh};

/// Heading of the lines that [`Agreement::print`] writes.
pub const HEADING: &str = "| variant | pairs | sheets change | axial change | axial, sheets % change in views of 1.25, 1.5, 2 and 2.5 tolerances | curves re-found | persistence change | same axial / all counts at the gap of the first | at the gap of both | of both, up to 3 tolerances | of both, about 2 tolerances | medial distance %D | fidelity median / max (tau) | Betti = surface's |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";

/// A gap is looked for up to this many tolerances.
pub const NEAR: f64 = 1.8;
const FAR: f64 = 3.0;
/// A tolerance of two is moved by up to this factor.
const MOVED: f64 = 1.35;

/// Views that counts are compared in, in tolerances.
const VIEWS: [f64; 4] = [1.25, 1.5, 2.0, 2.5];

/// Means over pairs of scaffolds.
#[derive(Default)]
pub struct Agreement {
    pub shapes: usize,
    sheets: f64,
    axial: f64,
    /// Axial curves and sheets in each of the views.
    in_views: [[f64; 2]; VIEWS.len()],
    kept: usize,
    found: usize,
    log_ratios: Vec<f64>,
    /// At the gap of the first, at that of both, at that of both when it may be wider, and about two tolerances: pairs with as many
    /// axial curves, and with as many sheets too.
    same: [[usize; 2]; 4],
    medial: f64,
    fidelity: Vec<f64>,
    betti: usize,
}

/// Relative change of a count.
fn change(x: usize, y: usize) -> f64 {
    x.abs_diff(y) as f64 / x.max(1) as f64
}

/// The axial curves.
pub fn axial(s: &CoarseScaffold) -> impl Iterator<Item = &Curve> {
    s.curves.iter().filter(|c| c.kind == CurveKind::Axial)
}

/// Axial curves, sheets.
pub fn counts(s: &CoarseScaffold) -> [usize; 2] {
    [axial(s).count(), s.sheets.len()]
}

impl Agreement {
    /// Adds a pair of scaffolds of one shape, in one frame.
    pub fn add(&mut self, a: &Run, b: &Run) {
        let d = a.coarse.diagonal_mm;
        self.shapes += 1;
        let ([axial_a, sheets_a], [axial_b, sheets_b]) = (counts(&a.coarse), counts(&b.coarse));
        self.sheets += change(sheets_a, sheets_b);
        self.axial += change(axial_a, axial_b);
        let tau = a.coarse.tolerance_mm;
        for (t, sums) in VIEWS.into_iter().zip(&mut self.in_views) {
            let [x, y] = [&a.coarse, &b.coarse].map(|s| counts(&s.view(t * tau)));
            for (sum, k) in sums.iter_mut().zip(0..) {
                *sum += change(x[k], y[k]);
            }
        }
        for curve in axial(&a.coarse).filter(|c| c.persistence >= 1.5 * tau) {
            self.kept += 1;
            if let Some(ratio) = found_again(curve, &b.coarse, 0.06 * d) {
                self.found += 1;
                self.log_ratios.push(ratio);
            }
        }
        let both = [&a.coarse, &b.coarse];
        let gaps = [
            gap_of(&both[..1], 1.0, NEAR),
            gap_of(&both, 1.0, NEAR),
            gap_of(&both, 1.0, FAR),
            gap_of(&both, 2.0 / MOVED, 2.0 * MOVED),
        ];
        for (gap, same) in gaps.into_iter().zip(&mut self.same) {
            let [x, y] = [&a.coarse, &b.coarse].map(|s| counts(&s.view(gap)));
            same[0] += usize::from(x[0] == y[0]);
            same[1] += usize::from(x == y);
        }
        self.medial +=
            50.0 * (medial_distance(&a.coarse, &b.coarse) + medial_distance(&b.coarse, &a.coarse)) / d;
        for r in [a, b] {
            self.fidelity.push(r.regularised.fidelity.max_tolerances);
            self.betti +=
                usize::from(r.regularised.betti() == r.solid && r.known.is_none_or(|k| k == r.solid));
        }
    }

    /// Adds the pairs of another.
    pub fn merge(&mut self, other: Agreement) {
        self.shapes += other.shapes;
        self.sheets += other.sheets;
        self.axial += other.axial;
        self.kept += other.kept;
        self.found += other.found;
        self.log_ratios.extend(other.log_ratios);
        for (sums, more) in self.in_views.iter_mut().zip(other.in_views) {
            for (sum, x) in sums.iter_mut().zip(more) {
                *sum += x;
            }
        }
        for (sums, more) in self.same.iter_mut().zip(other.same) {
            for (sum, x) in sums.iter_mut().zip(more) {
                *sum += x;
            }
        }
        self.medial += other.medial;
        self.fidelity.extend(other.fidelity);
        self.betti += other.betti;
    }

    /// Prints the means as a line of a table.
    pub fn print(mut self, name: &str) {
        let n = self.shapes.max(1) as f64;
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        let share = |x: usize| format!("{:.0}", 100.0 * x as f64 / n);
        let median = |v: &mut Vec<f64>| {
            v.sort_by(f64::total_cmp);
            v.get(v.len() / 2).copied().unwrap_or(0.0)
        };
        let views: Vec<String> = self
            .in_views
            .iter()
            .map(|v| format!("{:.1}, {:.1}", 100.0 * v[0] / n, 100.0 * v[1] / n))
            .collect();
        println!(
            "| {name} | {} | {} | {} | {} | {}/{} | {} | {} / {} % | {} / {} % | {} / {} % | {} / {} % | {:.2} | {:.2} / {:.2} | {}/{} |",
            self.shapes,
            percent(self.sheets / n),
            percent(self.axial / n),
            views.join("; "),
            self.found,
            self.kept,
            percent(median(&mut self.log_ratios)),
            share(self.same[0][0]),
            share(self.same[0][1]),
            share(self.same[1][0]),
            share(self.same[1][1]),
            share(self.same[2][0]),
            share(self.same[2][1]),
            share(self.same[3][0]),
            share(self.same[3][1]),
            self.medial / n,
            median(&mut self.fidelity),
            self.fidelity.last().copied().unwrap_or(0.0),
            self.betti,
            2 * self.shapes
        );
    }
}

/// Least change of persistence (absolute logarithm) among the axial curves in the same place, when below 0.35.
fn found_again(curve: &Curve, other: &CoarseScaffold, near: f64) -> Option<f64> {
    axial(other)
        .filter(|c| distance_along(curve, c) <= near)
        .map(|c| (c.persistence / curve.persistence).ln().abs())
        .filter(|r| *r < 0.35)
        .min_by(f64::total_cmp)
}

/// Mean distance from the points of a curve to those of another.
pub fn distance_along(curve: &Curve, other: &Curve) -> f64 {
    let there = Neighbours::new(&other.polyline.iter().map(|p| p.position).collect::<Vec<_>>());
    let sum: f64 = curve
        .polyline
        .iter()
        .filter_map(|p| there.nearest(p.position).map(|n| n.distance2.sqrt()))
        .sum();
    sum / curve.polyline.len() as f64
}

/// The middle of the widest gap that the persistences of some scaffolds leave between `least` and `most` tolerances.
pub fn gap_of(scaffolds: &[&CoarseScaffold], least: f64, most: f64) -> f64 {
    let tau = scaffolds[0].tolerance_mm;
    let (lo, hi) = (least * tau, most * tau);
    let mut p: Vec<f64> = scaffolds
        .iter()
        .flat_map(|s| axial(s))
        .map(|c| c.persistence)
        .filter(|p| (lo..hi).contains(p))
        .collect();
    p.extend([lo, hi]);
    p.sort_by(f64::total_cmp);
    p.windows(2)
        .max_by(|a, b| (a[1] / a[0]).total_cmp(&(b[1] / b[0])))
        .map_or(lo, |w| (w[0] * w[1]).sqrt())
}

/// Mean distance from the medial points of one scaffold to those of another, mm.
pub fn medial_distance(a: &CoarseScaffold, b: &CoarseScaffold) -> f64 {
    mean_distance(&medial_surface(a), &medial_surface(b))
}

/// The sheets of a scaffold as one mesh.
fn medial_surface(s: &CoarseScaffold) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for sheet in &s.sheets {
        let base = mesh.points.len() as u32;
        mesh.points.extend(sheet.mesh.vertices.iter().map(|v| v.position));
        mesh.triangles
            .extend(sheet.mesh.triangles.iter().map(|t| t.map(|i| i + base)));
    }
    mesh
}

/// Mean distance from one mesh to another, by area.
pub fn mean_distance(from: &TriangleMesh, to: &TriangleMesh) -> f64 {
    moment(from, to, |d| d)
}

/// Root mean square distance from one mesh to another, by area.
pub fn rms_distance(from: &TriangleMesh, to: &TriangleMesh) -> f64 {
    moment(from, to, |d| d * d).sqrt()
}

/// Mean of a function of the distance from one mesh to another, by area.
fn moment(from: &TriangleMesh, to: &TriangleMesh, of: impl Fn(f64) -> f64) -> f64 {
    let Some(to) = ClosestOnMesh::new(to) else {
        return f64::NAN;
    };
    let mut weight = vec![0.0; from.points.len()];
    for t in &from.triangles {
        let [p, q, r] = t.map(|i| from.points[i as usize]);
        let area = 0.5 * (q - p).cross(r - p).length();
        for &i in t {
            weight[i as usize] += area;
        }
    }
    let total: f64 = weight.iter().sum();
    let found = to.closest_many(&from.points);
    let sum: f64 = from
        .points
        .iter()
        .zip(&found)
        .zip(&weight)
        .map(|((p, c), w)| w * of(p.distance(c.point)))
        .sum();
    sum / total
}
