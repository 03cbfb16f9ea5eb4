//! Who is who in two sets of shapes: the bones of one wrist named by those of another.
//!
//! In: two sets of [`RegistrationShape`]s. Out: a [`Naming`]: pairs one to one, what parts them, and which of them are in doubt.
//!
//! 1. Every shape becomes a view at its own size (its radius of gyration is the unit), so that size is out of the comparison;
//!    of a surface with another within it the outer one ([`super::outer`]).
//! 2. Every pair is laid on each other with a similarity ([`super::surface`], the survey of whole shapes); the symmetric root mean square distance
//!    that is left, as a share of the size, is their difference `d`.
//! 3. Two persons differ in size by a factor that all their bones share, and by little more. So what counts is not the ratio of
//!    two sizes but its distance from that factor: a pair costs `d^2 + (w ln(ratio / factor))^2`.
//! 4. The factor is unknown. Every ratio of a pair is tried, the assignment of least cost solved for each (Jonker and Volgenant
//!    1987), and the factor of the best one is the mean of its pairs, until the pairs stay.
//! 5. With `mirror auto` the whole set is mirrored or none of it: the cheaper way.
//! 6. A pair is in doubt when the second best naming, the best one without that pair, costs hardly more ([`NamingSettings::doubt`]).
//!
//! Why surfaces: between a fine wrist and one of 34 to 90 vertices a bone, scaffolds name 7 of 15 bones with size and 11 without,
//! because a scaffold of so few facets is that of a polyhedron; the surfaces name all whose counterpart is there.
//!
//! Cost: one survey a pair of shapes, some 0.05 s. Degenerate: an empty set names nobody; of sets of different sizes the smaller one is
//! named whole.

use super::oriented::{self, View};
use super::outer::outer_samples;
use super::settings::{Mirror, RegistrationSettings};
use super::shape::{RegistrationError, RegistrationShape, Surface};
use super::surface::{Distances, survey};
use glam::DVec3;
use matchers::{Table, assignment};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Samples of each surface.
const SAMPLES: usize = 1500;
/// Samples that measure the difference of a pair.
const MEASURED: usize = 1000;
/// Share of the samples that must lie within the shape to be left out, and the fewest that must remain.
const HIDDEN: f64 = 0.1;
const FEWEST_OUTSIDE: usize = 100;
/// Most factors of size tried.
const MOST_FACTORS: usize = 200;
/// Rounds in which the factor follows the pairs.
const ROUNDS: usize = 10;

/// Settings of [`name_shapes`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NamingSettings {
    /// Whether the sources are mirrored (left bones named by right ones): all of them or none.
    pub mirror: Mirror,
    /// What a difference in relative size counts: that of `ln` ratios, in differences of shape as shares of the size. 0.2: between two wrists the bones'
    /// ratios scatter by 5 %, which then counts 1 %, and their shapes differ by 5 to 10 %. 0 leaves size out.
    pub size_weight: f64,
    /// A pair is in doubt when naming without it raises the sum of squares by less than this many times its mean over the pairs.
    pub doubt: f64,
    /// Seed of the sampling.
    pub seed: u64,
}

impl Default for NamingSettings {
    fn default() -> Self {
        Self {
            mirror: Mirror::No,
            size_weight: 0.2,
            doubt: 0.5,
            seed: 0,
        }
    }
}

/// A source and the target it is named by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedPair {
    /// Index of the target.
    pub target: usize,
    /// Index of the source.
    pub source: usize,
    /// Root mean square distance of the surfaces at equal size, as a share of the radius of gyration.
    pub difference: f64,
    /// Size of the source over that of the target.
    pub size_ratio: f64,
    /// By how much the sum of squares rises without this pair, in means of the pairs.
    pub lead: f64,
    /// Another naming without this pair is hardly worse.
    pub ambiguous: bool,
}

/// Who is who.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Naming {
    /// The sources were mirrored.
    pub mirrored: bool,
    /// Size of the source set over that of the target set, as the pairs agree on it.
    pub size_ratio: f64,
    /// The pairs, by target.
    pub pairs: Vec<NamedPair>,
    /// Targets without a source.
    pub unnamed_targets: Vec<usize>,
    /// Sources without a target.
    pub unnamed_sources: Vec<usize>,
    /// Difference of every target (row) and source.
    pub differences: Vec<Vec<f64>>,
    /// Size of every source over that of every target (row).
    pub size_ratios: Vec<Vec<f64>>,
}

/// Names every source by a target, one to one.
///
/// # Errors
/// [`RegistrationError`] of the first shape that is empty, not finite, without extent or inconsistent.
///
/// # Complexity
/// One survey of poses a pair of shapes; `O(n^5)` for the assignments of up to 200 factors of size, milliseconds for a wrist.
///
/// # Example
/// ```
/// use medial_scaffold::registration::{NamingSettings, RegistrationShape, name_shapes};
/// let set: Vec<RegistrationShape> = Vec::new();
/// assert!(name_shapes(&set, &set, &NamingSettings::default())?.pairs.is_empty());
/// # Ok::<(), medial_scaffold::registration::RegistrationError>(())
/// ```
pub fn name_shapes(
    targets: &[RegistrationShape],
    sources: &[RegistrationShape],
    settings: &NamingSettings,
) -> Result<Naming, RegistrationError> {
    let size_weight = settings.size_weight;
    if !(size_weight.is_finite() && size_weight >= 0.0) {
        return Err(RegistrationError::Setting {
            name: "size_weight",
            value: size_weight,
            allowed: "at least 0",
        });
    }
    let targets = sized_views(targets, "target", settings.seed)?;
    let sources = sized_views(sources, "source", settings.seed.wrapping_add(1))?;
    let hands: &[bool] = match settings.mirror {
        Mirror::No => &[false],
        Mirror::Yes => &[true],
        Mirror::Auto => &[false, true],
    };
    let mut best: Option<(f64, Naming)> = None;
    for &mirrored in hands {
        let found = name_hand(&targets, &sources, mirrored, settings);
        if best.as_ref().is_none_or(|b| found.0 < b.0) {
            best = Some(found);
        }
    }
    Ok(best.map(|b| b.1).unwrap_or_default())
}

/// A view at unit size, and the size it had, mm.
struct Sized {
    view: View,
    size_mm: f64,
}

fn sized_views(
    shapes: &[RegistrationShape],
    role: &'static str,
    seed: u64,
) -> Result<Vec<Sized>, RegistrationError> {
    for shape in shapes {
        shape.validate(role)?;
    }
    let mut defaults = RegistrationSettings::default();
    defaults.samples = defaults.samples.min(SAMPLES);
    Ok(shapes
        .par_iter()
        .map(|shape| {
            // The search wants lengths in diagonals.
            let diagonal = oriented::diagonal(shape.points());
            let view = outside(View::new(shape, diagonal, defaults.samples, seed));
            let size_mm = view.gyration() * diagonal;
            Sized { view, size_mm }
        })
        .collect())
}

/// The view without what lies within it, when that is a good part of it.
fn outside(view: View) -> View {
    let outer = outer_samples(&view);
    let kept = |all: &[DVec3]| -> Vec<DVec3> {
        let both = all.iter().zip(&outer);
        both.filter(|(_, outer)| **outer).map(|(p, _)| *p).collect()
    };
    let (points, normals) = (kept(&view.points), kept(&view.normals));
    let hidden = view.points.len() - points.len();
    if (hidden as f64) < HIDDEN * view.points.len() as f64 || points.len() < FEWEST_OUTSIDE {
        return view;
    }
    let normals = Some(normals.as_slice());
    let shape = RegistrationShape {
        surface: Surface::Cloud {
            points: &points,
            normals,
        },
        scaffold: None,
    };
    View::new(&shape, 1.0, points.len(), 0)
}

/// The naming for one hand with its cost.
fn name_hand(
    targets: &[Sized],
    sources: &[Sized],
    mirrored: bool,
    settings: &NamingSettings,
) -> (f64, Naming) {
    let images: Vec<Option<View>> = sources
        .par_iter()
        .map(|s| mirrored.then(|| s.view.mirror_image()))
        .collect();
    let view = |j: usize| images[j].as_ref().unwrap_or(&sources[j].view);
    let (n, m) = (targets.len(), sources.len());
    let values: Vec<f64> = (0..n * m)
        .into_par_iter()
        .map(|k| difference(&targets[k / m].view, view(k % m)))
        .collect();
    let differences = Table::from_fn(n, m, |i, j| values[i * m + j]);
    let logs = Table::from_fn(n, m, |i, j| (sources[j].size_mm / targets[i].size_mm).ln());
    let (factor, cost, pairs) = assign(&differences, &logs, settings.size_weight);
    let costs = priced(&differences, &logs, factor, settings.size_weight);
    let mean = (cost / pairs.len().max(1) as f64).max(f64::MIN_POSITIVE);
    let named: Vec<NamedPair> = pairs
        .iter()
        .map(|&(i, j)| {
            let lead = (without(&costs, i, j) - cost) / mean;
            NamedPair {
                target: i,
                source: j,
                difference: differences[(i, j)],
                size_ratio: logs[(i, j)].exp(),
                lead,
                ambiguous: lead < settings.doubt,
            }
        })
        .collect();
    let rows = |t: &Table| -> Vec<Vec<f64>> { (0..n).map(|i| t.row(i).to_vec()).collect() };
    let naming = Naming {
        mirrored,
        size_ratio: factor.exp(),
        unnamed_targets: (0..n).filter(|i| named.iter().all(|p| p.target != *i)).collect(),
        unnamed_sources: (0..m).filter(|j| named.iter().all(|p| p.source != *j)).collect(),
        pairs: named,
        differences: rows(&differences),
        size_ratios: rows(&logs)
            .into_iter()
            .map(|row| row.into_iter().map(f64::exp).collect())
            .collect(),
    };
    (cost, naming)
}

/// Symmetric distance of two views under the best similarity, as a share of the target's radius of gyration.
fn difference(target: &View, source: &View) -> f64 {
    let fits = survey(source, target, &[], true, 4);
    let rms = fits.first().map_or(1.0, |fit| {
        Distances::new(source, target, &fit.pose, MEASURED).rms()
    });
    rms / target.gyration()
}

fn priced(differences: &Table, logs: &Table, factor: f64, weight: f64) -> Table {
    Table::from_fn(differences.rows(), differences.cols(), |i, j| {
        differences[(i, j)].powi(2) + (weight * (logs[(i, j)] - factor)).powi(2)
    })
}

/// Factor of size (logarithm), cost and pairs of the cheapest naming.
fn assign(differences: &Table, logs: &Table, weight: f64) -> (f64, f64, Vec<(usize, usize)>) {
    let (n, m) = (differences.rows(), differences.cols());
    let mut factors: Vec<f64> = (0..n).flat_map(|i| logs.row(i).to_vec()).collect();
    factors.sort_by(f64::total_cmp);
    let step = factors.len().div_ceil(MOST_FACTORS).max(1);
    let mut best = (0.0, f64::INFINITY, Vec::new());
    for &first in factors.iter().step_by(step) {
        let mut factor = first;
        let mut pairs = Vec::new();
        for _ in 0..ROUNDS {
            let found = solved(&priced(differences, logs, factor, weight));
            if found.1 == pairs {
                break;
            }
            pairs = found.1;
            factor = pairs.iter().map(|&(i, j)| logs[(i, j)]).sum::<f64>() / pairs.len().max(1) as f64;
        }
        let costs = priced(differences, logs, factor, weight);
        let cost: f64 = pairs.iter().map(|&p| costs[p]).sum();
        if n * m > 0 && cost < best.1 {
            best = (factor, cost, pairs);
        }
    }
    best
}

/// Cost and pairs of the cheapest assignment, by row.
fn solved(costs: &Table) -> (f64, Vec<(usize, usize)>) {
    match assignment::solve(costs) {
        Ok(found) => {
            let pairs = found.col_of_row.iter().enumerate();
            let pairs = pairs.filter_map(|(i, j)| Some((i, (*j)?))).collect();
            (found.cost, pairs)
        }
        // Only a pair that is forbidden and cannot be avoided ends here.
        Err(_) => (f64::INFINITY, Vec::new()),
    }
}

/// Cost of the cheapest assignment that does not hold a pair.
fn without(costs: &Table, i: usize, j: usize) -> f64 {
    let forbidden = |r: usize, c: usize| (r, c) == (i, j);
    let rest = Table::from_fn(costs.rows(), costs.cols(), |r, c| {
        if forbidden(r, c) {
            f64::INFINITY
        } else {
            costs[(r, c)]
        }
    });
    solved(&rest).0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_of_a_set_is_found_and_decides_between_like_shapes() {
        // Three shapes that look alike, of sizes 1, 2 and 4, against the same at one and a half: only the sizes tell, and only
        // relative to each other.
        let (ours, theirs) = ([1.0f64, 2.0, 4.0], [1.5f64, 3.0, 6.0]);
        let differences = Table::filled(3, 3, 0.05);
        let logs = Table::from_fn(3, 3, |i, j| (theirs[j] / ours[i]).ln());
        let (factor, cost, pairs) = assign(&differences, &logs, 0.2);
        assert_eq!(pairs, vec![(0, 0), (1, 1), (2, 2)]);
        assert!((factor.exp() - 1.5).abs() < 1e-12);
        assert!((cost - 3.0 * 0.0025).abs() < 1e-12);
    }

    #[test]
    fn a_set_that_is_one_short_leaves_one_out() {
        let differences = Table::from_fn(2, 3, |i, j| if i == j { 0.01 } else { 0.1 });
        let (_, _, pairs) = assign(&differences, &Table::zeros(2, 3), 0.2);
        assert_eq!(pairs, vec![(0, 0), (1, 1)]);
        assert!(without(&priced(&differences, &Table::zeros(2, 3), 0.0, 0.2), 0, 0) > 0.009);
    }
}
