//! Which of several runs on one cloud is believed.
//!
//! In: a cleaned cloud. Out: [`Chosen`]: one thinned cloud with its closure, and what the others said.
//!
//! 1. A run: thin, close, once more without the points left off, narrow handles given up.
//! 2. With strong noise a second thinning seed is tried, unless the first run has next to no *strain* ([`Run::strain`]; wide handles are
//!    none unless the noise is very strong), and a third
//!    when the two disagree on the topology or one has a fault that would be doubted. The least strain wins: parts, handles, area without support and
//!    points off the surface are what noise makes, so the run that needs least of them explains the cloud best. (A majority
//!    takes the commonest mistake: where an ear is thinner than the noise most seeds are wrong.)
//! 3. When that run is in several parts or has much area without support, a weaker and a stronger pull are tried on it.
//!
//! Tried and given up: raising the pull between parts that lie side by side, so that a minimum cut joins them. On ears torn by noise of
//! three quarters of the spacing it closes the gap between two ears, or adds a handle.
//!
//! Cost: one to five closings.

use super::closure::{Closure, ClosureSettings, close, close_without_off};
use super::error::SegregationError;
use super::handles::LONGEST_LOOP;
use super::judge::Judged;
use super::labels::boundary_triangles;
use super::prepare::{Cleaned, Prepared, thin_out};
use super::report::{SecondOpinion, Variation};
use super::self_check::{BLURRED, DOUBTFUL_OFF, PULL_FACTORS};
use super::settings::{ClosedOrOpen, Denoise, SegregationSettings};
use crate::geometry::TriangleMesh;
use std::collections::BTreeSet;

/// Strain below which a second opinion is not asked for.
const NO_STRAIN: f64 = 0.2;
/// Share of the threshold from which unsupported area is looked into.
const SUSPICIOUS: f64 = 0.5;

/// One prepared cloud and its closure.
pub(super) struct Run {
    pub prepared: Prepared,
    pub closure: Closure,
    pub seed: u64,
}

/// The run that is believed and the topology of all.
pub(super) struct Chosen {
    pub run: Run,
    pub opinions: Vec<SecondOpinion>,
}

/// What is wrong with a run, or would be if the object were a ball.
struct Strain {
    components: usize,
    euler: i64,
    /// Handles of all components.
    handles: f64,
    /// Unsupported area over the share from which the surface is open.
    unsupported: f64,
    /// Points off the surface over the share that is doubted.
    off: f64,
    /// Whether handles are left that are too narrow to be believed.
    narrow: bool,
    /// All of it in one number.
    total: f64,
}

impl Run {
    fn strain(&self, settings: &SegregationSettings) -> Strain {
        let topology = closed_mesh(&self.closure).topology();
        let components = topology.components as f64;
        let handles = components - 0.5 * topology.euler as f64;
        let judged = Judged::new(&self.closure, &BTreeSet::new());
        let unsupported = judged.share / settings.threshold(&self.prepared.report);
        let most_off = DOUBTFUL_OFF * self.prepared.points.len().max(1) as f64;
        let off = self.closure.dropped.max(self.closure.off) as f64 / most_off;
        Strain {
            components: topology.components,
            euler: topology.euler,
            handles,
            unsupported,
            off,
            narrow: self.closure.handles.iter().any(|h| h.rings < LONGEST_LOOP / 2),
            total: (components - 1.0).abs() + handles + unsupported + off,
        }
    }

    fn opinion(&self, variation: Variation, strain: &Strain) -> SecondOpinion {
        SecondOpinion {
            variation,
            euler: strain.euler,
            components: strain.components,
        }
    }
}

/// The closed surface of a labelling.
pub(super) fn closed_mesh(closure: &Closure) -> TriangleMesh {
    super::labels::mesh_of(
        &closure.triangulation,
        &boundary_triangles(&closure.triangulation, &closure.inside),
    )
}

/// The topology of a mesh as an opinion.
pub(super) fn opinion_of(mesh: &TriangleMesh, variation: Variation) -> SecondOpinion {
    let t = mesh.topology();
    SecondOpinion {
        variation,
        euler: t.euler,
        components: t.components,
    }
}

/// Step 1 for one seed; `preset` are triangles known to be surface, by prepared point.
pub(super) fn run(
    prepared: Prepared,
    preset: &[[u32; 3]],
    seed: u64,
    settings: &SegregationSettings,
) -> Result<Run, SegregationError> {
    let closure = close_prepared(&prepared, preset, settings)?;
    Ok(Run {
        prepared,
        closure,
        seed,
    })
}

fn close_prepared(
    prepared: &Prepared,
    preset: &[[u32; 3]],
    settings: &SegregationSettings,
) -> Result<Closure, SegregationError> {
    let closing = ClosureSettings {
        cost: settings.cost,
        least_component_share: settings.least_component_share,
        preset,
    };
    let share = settings.least_component_share;
    let threshold = settings.threshold(&prepared.report);
    let mut first = close(&prepared.points, &prepared.spacing_mm, &closing)?;
    prefer_supported(&mut first, threshold, settings);
    let judged = Judged::new(&first, &BTreeSet::new());
    if settings.denoise == Denoise::Off || !judged.decide(threshold, settings).closed {
        first.give_up_narrow_handles(share);
        return Ok(first);
    }
    let mut second = close_without_off(first, &prepared.points, &prepared.spacing_mm, &closing)?;
    prefer_supported(&mut second, threshold, settings);
    second.give_up_narrow_handles(share);
    Ok(second)
}

/// Takes the labels with less unsupported area when that halves it and the solid stays: noise can fill the gap between two
/// thin parts, which then looks like a large hole that was closed.
fn prefer_supported(closure: &mut Closure, threshold: f64, settings: &SegregationSettings) {
    let now = Judged::new(closure, &BTreeSet::new());
    if now.share < SUSPICIOUS * threshold || settings.closed == ClosedOrOpen::Open {
        return;
    }
    let mut other = closure.clone();
    other.replace_labels(closure.supported(settings.least_component_share));
    let judged = Judged::new(&other, &BTreeSet::new());
    let most_off = closure.triangulation.points.len() / 50;
    let volume = |c: &Closure| closed_mesh(c).signed_volume();
    if judged.share < 0.5 * now.share
        && other.off <= closure.off.max(most_off)
        && volume(&other) > 0.5 * volume(closure)
    {
        *closure = other;
    }
}

/// Steps 2 and 3.
pub(super) fn choose(cleaned: &Cleaned, settings: &SegregationSettings) -> Result<Chosen, SegregationError> {
    let first = run(thin_out(cleaned, settings.seed), &[], settings.seed, settings)?;
    if !cleaned.is_random() || cleaned.noise_over_spacing() < settings.second_opinion_noise {
        return Ok(Chosen {
            run: first,
            opinions: Vec::new(),
        });
    }
    let mut strains = vec![first.strain(settings)];
    let mut runs = vec![first];
    let blurred = cleaned.noise_over_spacing() >= BLURRED;
    while runs.len() < 3 && !settled(&strains, blurred) {
        let seed = settings.seed.wrapping_add(runs.len() as u64);
        let next = run(thin_out(cleaned, seed), &[], seed, settings)?;
        strains.push(next.strain(settings));
        runs.push(next);
    }
    let mut opinions: Vec<SecondOpinion> = runs
        .iter()
        .zip(&strains)
        .map(|(r, s)| r.opinion(Variation::Thinning { seed: r.seed }, s))
        .collect();
    let best = (0..runs.len())
        .min_by(|&i, &j| strains[i].total.total_cmp(&strains[j].total).then(i.cmp(&j)))
        .expect("there is a first run");
    let mut chosen = runs.swap_remove(best);
    let torn = strains[best].components > 1 || strains[best].unsupported >= SUSPICIOUS;
    if torn && strains[best].total >= 1.0 {
        opinions.extend(relax(&mut chosen, &strains[best], settings));
    }
    Ok(Chosen {
        run: chosen,
        opinions,
    })
}

/// Whether no further seed is needed.
fn settled(strains: &[Strain], blurred: bool) -> bool {
    match strains {
        [first] => {
            // Handles that are wide are no work of noise, unless it is wider than they are.
            let handles = if first.narrow || blurred {
                first.handles
            } else {
                0.0
            };
            first.total - first.handles + handles < NO_STRAIN
        }
        [first, second] => {
            (first.euler, first.components) == (second.euler, second.components)
                && strains
                    .iter()
                    .all(|s| s.unsupported < 1.0 && s.off < 1.0 && !s.narrow)
        }
        _ => false,
    }
}

/// Step 3: takes the labels of a weaker or stronger pull when they have less strain.
fn relax(run: &mut Run, strain: &Strain, settings: &SegregationSettings) -> Vec<SecondOpinion> {
    let share = settings.least_component_share;
    let first = run.closure.clone();
    let mut least = strain.total;
    let mut best = None;
    let mut opinions = Vec::new();
    for factor in PULL_FACTORS {
        let labelled = first.relabelled(factor, share);
        run.closure.replace_labels(labelled.clone());
        let strain = run.strain(settings);
        let variation = Variation::Pull {
            factor: f64::from(factor),
        };
        opinions.push(run.opinion(variation, &strain));
        if strain.total < least {
            least = strain.total;
            best = Some(labelled);
        }
    }
    run.closure = first;
    if let Some(labelled) = best {
        run.closure.replace_labels(labelled);
    }
    opinions
}
