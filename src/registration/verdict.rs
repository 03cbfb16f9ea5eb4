//! The front door: which pose is reported. What is said of it is in `doubts`.
//!
//! 1. Both surfaces become views in one unit, raw clouds without their clutter; for `mirror auto` the source's mirror image too, for a
//!    sheet whose face is unknown the turned one.
//! 2. Whole search for every allowed handedness. It is believed at once when both surfaces agree nearly everywhere, or when both
//!    are closed and differ by no more than two persons' bones do.
//! 3. Otherwise the partial search runs too, and wins when free space says so; a doubt is raised when the whole pose is another one
//!    and neither shape has a part that the other lacks.
//! 4. A mirrored pose must be clearly better than an unmirrored one.

use super::faces::{ViewPair, pairs};
use super::isolated::without_isolated;
use super::oriented::{self, View};
use super::partial::{self, CLEAR_MARGIN, GOOD_SCORE, PartialFit, RIVAL_DEG};
use super::refine::rest;
use super::result::{Method, Registration};
use super::score::{FINE, both_ways};
use super::settings::{Extent, RegistrationSettings};
use super::shape::{RegistrationError, RegistrationShape, Surface};
use super::sizes;
use super::surface::{self, Distances, WholeFit};
use crate::geometry::Rigid;
use crate::matching::{MatchingSettings, pose_hypotheses};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Free-space score over which whole shapes agree nearly everywhere (2 is everywhere).
const SURELY_WHOLE: f64 = 1.4;
/// Largest symmetric distance of two closed shapes of one kind, in units; two persons' carpals reach 0.04.
const ONE_KIND: f64 = 0.06;
/// Share of samples at a border above which a shape may be cut: noise makes up to 0.06 of a whole one, a cut through the middle 0.12.
const CUT_RIM: f64 = 0.08;
/// A whole pose farther than this from the chosen partial one, degrees, is another answer.
const WHOLE_TOO_DEG: f64 = 5.0;
/// A mirrored whole pose must have at most this share of the unmirrored residual.
const MIRROR_SHARE: f64 = 0.97;
/// A mirrored partial pose must score this much more.
const MIRROR_MARGIN: f64 = 0.05;
/// A hand whose surveyed residual is this many times the other's has lost: what the finish still gains is within 15 %.
const LOST_HAND: f64 = 1.3;
/// Residuals below this say nothing about which pose is right: facets of a tessellation make as much, in units.
pub(super) const INDISTINCT: f64 = 2e-4;
/// A partial pose replaces a whole one when its free-space score is this much higher.
const PARTIAL_MARGIN: f64 = 0.1;

/// Scores nearer than this are equal where the whole pose is one that the partial search could have found.
const SAME_SCORE: f64 = 0.05;
/// Noise above this, in units, may hide the rim of a cut.
const HIDES_RIM: f64 = 0.005;

/// A pose in view coordinates.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) pose: Rigid,
    /// Which of [`Search::pairs`] it lays on each other.
    pub(super) pair: usize,
    pub(super) mirrored: bool,
    pub(super) method: Method,
    /// Symmetric distance (units) for whole poses, score for partial ones.
    pub(super) rms: f64,
    /// What ranks whole poses, see [`WholeFit::residual`].
    pub(super) residual: f64,
    /// A whole pose fitted to the part that agrees.
    pub(super) robust: bool,
    /// See [`WholeFit::other_kind`].
    pub(super) other_kind: Option<Rigid>,
    pub(super) score: f64,
    pub(super) converged: bool,
}

/// Finds the motion that takes `source` to `target`.
///
/// # Errors
/// [`RegistrationError`] when a shape is empty, not finite, without extent or inconsistent, or a setting is out of range.
///
/// # Example
/// ```
/// use glam::{DMat3, DVec3};
/// use medial_scaffold::geometry::{Rigid, TriangleMesh};
/// use medial_scaffold::registration::{register, RegistrationSettings, RegistrationShape};
/// // A box with three different edges, and the same box turned and moved.
/// let corner = |i: u32| DVec3::new((i & 1) as f64 * 3.0, ((i >> 1) & 1) as f64 * 2.0, ((i >> 2) & 1) as f64);
/// let target = TriangleMesh {
///     points: (0..8).map(corner).collect(),
///     triangles: vec![[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
///                     [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]],
/// };
/// let motion = Rigid { linear: DMat3::from_rotation_z(1.0), translation: DVec3::new(5.0, -2.0, 1.0) };
/// let mut source = target.clone();
/// source.points.iter_mut().for_each(|p| *p = motion.apply(*p));
/// let found = register(
///     &RegistrationShape::mesh(&target),
///     &RegistrationShape::mesh(&source),
///     &RegistrationSettings::default(),
/// )?;
/// assert!(found.rms < 1e-6);
/// assert!(found.ambiguous); // a box looks the same after half a turn
/// # Ok::<(), medial_scaffold::registration::RegistrationError>(())
/// ```
pub fn register(
    target: &RegistrationShape,
    source: &RegistrationShape,
    settings: &RegistrationSettings,
) -> Result<Registration, RegistrationError> {
    settings.validate()?;
    target.validate("target")?;
    source.validate("source")?;
    let (target_kept, source_kept) = rayon::join(|| uncluttered(target), || uncluttered(source));
    let (target, source) = (&of_kept(target, &target_kept), &of_kept(source, &source_kept));
    let unit = oriented::diagonal(target.points()).max(oriented::diagonal(source.points()));
    let (target_view, source_view) = rayon::join(
        || View::new(target, unit, settings.samples, settings.seed),
        || View::new(source, unit, settings.samples, settings.seed.wrapping_add(1)),
    );
    let pairs = pairs(target_view, source_view, settings.mirror);
    let guesses: Vec<Vec<Rigid>> = pairs
        .par_iter()
        .map(|pair| scaffold_guesses(target, source, pair, unit, settings))
        .collect();
    let mut search = Search {
        pairs,
        guesses,
        settings,
    };
    let (candidates, doubt) = search.run();
    let mut found = search.report(candidates, unit);
    found.ambiguous |= doubt.is_some();
    found.ambiguity.extend(doubt);
    Ok(found)
}

/// The points of a raw cloud that belong to a surface, when some do not.
fn uncluttered(shape: &RegistrationShape) -> Option<Vec<DVec3>> {
    match shape.surface {
        Surface::Cloud {
            points,
            normals: None,
        } => without_isolated(points),
        _ => None,
    }
}

/// The shape, of the kept points when some were dropped.
fn of_kept<'a>(shape: &RegistrationShape<'a>, kept: &'a Option<Vec<DVec3>>) -> RegistrationShape<'a> {
    let surface = kept.as_ref().map_or(shape.surface, |points| Surface::Cloud {
        points,
        normals: None,
    });
    RegistrationShape { surface, ..*shape }
}

/// Poses that the scaffolds allow, in view coordinates; none when a scaffold is missing.
fn scaffold_guesses(
    target: &RegistrationShape,
    source: &RegistrationShape,
    pair: &ViewPair,
    unit: f64,
    settings: &RegistrationSettings,
) -> Vec<Rigid> {
    let (Some(t), Some(s)) = (target.scaffold, source.scaffold) else {
        return Vec::new();
    };
    let (target_view, source_view) = (&pair.target, &pair.source);
    let matching = MatchingSettings {
        mirrored: source_view.mirrored,
        seed: settings.seed,
        ..Default::default()
    };
    let flip = mirror_of(source_view.mirrored);
    pose_hypotheses(t, s, &matching)
        .iter()
        .map(|h| {
            let linear = h.T_target_source.linear * flip;
            let centre = h.T_target_source.apply(source_view.centre);
            Rigid {
                linear,
                translation: (centre - target_view.centre) / unit,
            }
        })
        .collect()
}

/// Factor of size of a pose.
pub(super) fn scale_of(pose: &Rigid) -> f64 {
    pose.linear.determinant().abs().cbrt()
}

/// What a mirrored view does to the source's coordinates about its centre.
pub(super) fn mirror_of(mirrored: bool) -> DMat3 {
    DMat3::from_diagonal(if mirrored {
        DVec3::new(-1.0, 1.0, 1.0)
    } else {
        DVec3::ONE
    })
}

pub(super) struct Search<'a> {
    pub(super) pairs: Vec<ViewPair>,
    /// First guesses from the scaffolds, in view coordinates, one list a pair.
    pub(super) guesses: Vec<Vec<Rigid>>,
    pub(super) settings: &'a RegistrationSettings,
}

impl Search<'_> {
    /// Source and target as a candidate takes them.
    pub(super) fn views(&self, c: &Candidate) -> (&View, &View) {
        let pair = &self.pairs[c.pair];
        (&pair.source, &pair.target)
    }

    /// Either handedness is allowed.
    fn both_hands(&self) -> bool {
        let mirrored = |pair: &&ViewPair| pair.source.mirrored;
        self.pairs.iter().any(|p| mirrored(&p)) && !self.pairs.iter().all(|p| mirrored(&p))
    }

    /// All verified poses, the chosen one first, and a doubt that only the other search can raise.
    fn run(&mut self) -> (Vec<Candidate>, Option<String>) {
        let whole = match self.settings.extent {
            Extent::Partial => Vec::new(),
            _ => self.whole(),
        };
        if self.settings.extent == Extent::Whole || whole.first().is_some_and(|w| self.believed(w)) {
            return (whole, None);
        }
        let partial = if self.settings.scale {
            self.partial_of_any_size()
        } else {
            self.partial()
        };
        match (whole.first(), partial.first()) {
            (Some(w), Some(p)) if self.prefers_part(w, p) => {
                let doubt = self.doubt_of_part(w, p);
                (partial, doubt)
            }
            (None, _) => (partial, None),
            _ => (whole, None),
        }
    }

    /// Whether the best partial pose `p` replaces the best whole one `w`. A whole fit to the part that agrees is one of the poses that
    /// the partial search ranks better, by free space, when parts are gone; and the better answer when they have changed.
    fn prefers_part(&self, w: &Candidate, p: &Candidate) -> bool {
        if !w.robust {
            return p.score > w.score + PARTIAL_MARGIN;
        }
        if self.may_be_cut(w) {
            return p.score > w.score - SAME_SCORE;
        }
        p.score > GOOD_SCORE && p.score > w.score + PARTIAL_MARGIN
    }

    /// A rim is seen, or noise may hide one and one surface has a part that the other lacks.
    fn may_be_cut(&self, w: &Candidate) -> bool {
        let (source, target) = self.views(w);
        let hidden = source.noise.max(target.noise) > HIDES_RIM && !self.nothing_missing(w);
        hidden || self.cut(w)
    }

    fn believed(&self, fit: &Candidate) -> bool {
        let (source, target) = self.views(fit);
        let closed = source.closed && target.closed;
        // A large part agrees closely, and the rest is there: it has changed.
        fit.score > SURELY_WHOLE || (closed && (fit.rms < ONE_KIND || fit.robust))
    }

    /// What speaks against a partial pose `p` of shapes that show no cut, `w` being the best pose of them as wholes.
    fn doubt_of_part(&self, w: &Candidate, p: &Candidate) -> Option<String> {
        if self.cut(p) {
            return None;
        }
        let angle = w.pose.rotation_angle_deg(&p.pose);
        if angle > WHOLE_TOO_DEG && self.nothing_missing(w) {
            let text = format!("neither shape lacks a part, and as wholes they fit {angle:.0} degrees away");
            return Some(text);
        }
        // Nothing is cut off, so the shapes differ; what they share may then be a likeness.
        (p.score < GOOD_SCORE).then(|| {
            format!(
                "neither shape is cut, and yet their surfaces agree in part only: score {:.2}",
                p.score
            )
        })
    }

    /// One of the surfaces shows the rim of a cut. Two halves of a ball fit each other without being wholes of anything; but each has
    /// a rim, unless noise hides it. So a missing rim raises a doubt and does not decide: a half of a triquetrum at 2 % noise fits
    /// the other upside down.
    fn cut(&self, fit: &Candidate) -> bool {
        let (source, target) = self.views(fit);
        let rim = |v: &View| v.border.iter().filter(|b| **b).count() as f64 / v.border.len().max(1) as f64;
        rim(source).max(rim(target)) > CUT_RIM
    }

    /// Neither surface has a part that the other lacks: a cut leaves many points farther away than two bones of one kind differ.
    fn nothing_missing(&self, fit: &Candidate) -> bool {
        let (source, target) = self.views(fit);
        let d = Distances::new(source, target, &fit.pose, 2000);
        [&d.there, &d.back]
            .iter()
            .all(|d| d.iter().filter(|d| **d > ONE_KIND).count() <= d.len() / 100)
    }

    fn whole(&self) -> Vec<Candidate> {
        let scale = self.settings.scale;
        let mut surveys: Vec<Vec<WholeFit>> = self
            .pairs
            .iter()
            .zip(&self.guesses)
            .map(|(pair, guesses)| surface::survey(&pair.source, &pair.target, guesses, scale, 4))
            .collect();
        let least = |fits: &[WholeFit]| fits.first().map_or(f64::INFINITY, |f| f.rms);
        let best = surveys
            .iter()
            .map(|fits| least(fits))
            .fold(f64::INFINITY, f64::min);
        let mut out: Vec<Candidate> = Vec::new();
        for (index, (pair, fits)) in self.pairs.iter().zip(&mut surveys).enumerate() {
            let (source, target) = (&pair.source, &pair.target);
            // A hand that has lost clearly is reported as it was surveyed.
            if least(fits) <= LOST_HAND * best.max(INDISTINCT) {
                surface::finish(source, target, fits, scale);
            }
            out.extend(fits.iter().map(|fit| Candidate {
                score: both_ways(source, target, &fit.pose, usize::MAX, FINE),
                pose: fit.pose,
                pair: index,
                mirrored: source.mirrored,
                method: Method::Whole,
                rms: fit.rms,
                residual: fit.residual,
                robust: fit.robust,
                other_kind: fit.other_kind,
                converged: fit.converged,
            }));
        }
        let both_hands = self.both_hands();
        let cost = |c: &Candidate| {
            if c.mirrored && both_hands {
                c.residual / MIRROR_SHARE
            } else {
                c.residual
            }
        };
        out.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        self.without_other_face(out)
    }

    /// Distances do not tell the faces of a sheet apart: of two candidates in one pose, one with the other face outside, free space
    /// keeps the better.
    fn without_other_face(&self, all: Vec<Candidate>) -> Vec<Candidate> {
        let better = |c: &Candidate, o: &Candidate| {
            o.pair != c.pair
                && o.mirrored == c.mirrored
                && o.score > c.score
                && o.pose.rotation_angle_deg(&c.pose) < surface::SAME_POSE_DEG
        };
        let lost: Vec<bool> = all.iter().map(|c| all.iter().any(|o| better(c, o))).collect();
        let kept = all.into_iter().zip(lost).filter(|(_, lost)| !lost);
        kept.map(|(c, _)| c).collect()
    }

    fn partial(&self) -> Vec<Candidate> {
        let s = self.settings;
        let mut out: Vec<Candidate> = Vec::new();
        for (index, (pair, guesses)) in self.pairs.iter().zip(&self.guesses).enumerate() {
            let (source, target) = (&pair.source, &pair.target);
            let fits = partial::partial(source, target, guesses, s.poses, s.escalated_poses, s.seed);
            out.extend(fits.into_iter().map(|fit| self.partial_candidate(fit, index)));
        }
        self.best_partial(out)
    }

    fn partial_candidate(&self, fit: PartialFit, pair: usize) -> Candidate {
        Candidate {
            pose: fit.pose,
            pair,
            mirrored: self.pairs[pair].source.mirrored,
            method: Method::Partial,
            rms: 0.0,
            residual: 0.0,
            robust: false,
            other_kind: None,
            score: fit.score,
            converged: true,
        }
    }

    /// The partial search with the source at every size of a grid; a second round for the most promising sizes.
    fn partial_of_any_size(&mut self) -> Vec<Candidate> {
        let s = self.settings;
        let others = sizes::at_other_sizes(&self.pairs);
        let each = others.len() / self.pairs.len().max(1);
        let guesses: Vec<Vec<Rigid>> = (0..others.len())
            .map(|k| self.guesses[k / each].clone())
            .collect();
        self.pairs.extend(others);
        self.guesses.extend(guesses);
        let round = |index: usize, guesses: &[Rigid], poses, seed| -> Vec<Candidate> {
            let pair = &self.pairs[index];
            let fits = partial::one_size(&pair.source, &pair.target, guesses, poses, seed);
            let fits = fits.into_iter().map(|fit| {
                let mut c = self.partial_candidate(fit, index);
                c.score *= self.per_smaller_area(&c);
                c
            });
            fits.collect()
        };
        let first = ((s.poses as f64 * sizes::FIRST_SHARE) as usize).max(1);
        let mut found: Vec<Vec<Candidate>> = (0..self.pairs.len())
            .map(|k| round(k, &self.guesses[k], first, s.seed))
            .collect();
        let sure = |found: &[Vec<Candidate>]| {
            let mut all: Vec<&Candidate> = found.iter().flatten().collect();
            all.sort_by(|a, b| b.score.total_cmp(&a.score));
            let Some(best) = all.first() else { return true };
            let unit = self.per_smaller_area(best);
            let far = |c: &&&Candidate| c.pose.rotation_angle_deg(&best.pose) > RIVAL_DEG;
            let rival = all.iter().find(far).map_or(f64::NEG_INFINITY, |c| c.score);
            best.score >= GOOD_SCORE * unit && rival <= best.score - CLEAR_MARGIN * unit
        };
        if s.escalated_poses > s.poses && !sure(&found) {
            let best_of = |c: &[Candidate]| c.iter().map(|c| c.score).fold(f64::NEG_INFINITY, f64::max);
            let mut order: Vec<usize> = (0..found.len()).collect();
            order.sort_by(|&a, &b| best_of(&found[b]).total_cmp(&best_of(&found[a])));
            for &k in order.iter().take(sizes::SECOND_ROUNDS) {
                let mut guesses = self.guesses[k].clone();
                guesses.extend(found[k].iter().map(|c| c.pose));
                found[k] = round(k, &guesses, s.escalated_poses, s.seed.wrapping_add(1));
            }
        }
        let mut all: Vec<Candidate> = found.into_iter().flatten().collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        // One pose was found from several sizes: the best of them stands for it.
        let mut kept: Vec<Candidate> = Vec::new();
        for c in all {
            if !kept.iter().any(|k| self.same_similarity(k, &c)) {
                kept.push(c);
            }
        }
        // Back to the score that is reported, in the areas of the best.
        if let Some(unit) = kept.first().map(|best| self.per_smaller_area(best)) {
            kept.iter_mut().for_each(|c| c.score /= unit);
        }
        self.best_partial(kept)
    }

    /// See [`sizes::per_smaller_area`].
    fn per_smaller_area(&self, c: &Candidate) -> f64 {
        let (source, target) = self.views(c);
        sizes::per_smaller_area(source, target, scale_of(&c.pose))
    }

    fn same_similarity(&self, a: &Candidate, b: &Candidate) -> bool {
        a.mirrored == b.mirrored
            && (self.size(a) / self.size(b)).ln().abs() < sizes::SAME_SIZE
            && a.pose.rotation_angle_deg(&b.pose) < sizes::SAME_TURN_DEG
    }

    /// Factor of the source's size in a candidate.
    pub(super) fn size(&self, c: &Candidate) -> f64 {
        self.views(c).0.size * scale_of(&c.pose)
    }

    /// The best of all partial poses, measured and at rest.
    fn best_partial(&self, mut out: Vec<Candidate>) -> Vec<Candidate> {
        let s = self.settings;
        let both_hands = self.both_hands();
        let gain = |c: &Candidate| {
            if c.mirrored && both_hands {
                c.score - MIRROR_MARGIN
            } else {
                c.score
            }
        };
        out.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        out.truncate(s.hypotheses.max(2));
        for c in &mut out {
            c.rms = self.measure(c).rms;
        }
        if let Some(best) = out.first_mut() {
            let (source, target) = self.views(best);
            let (pose, converged) = rest(source, target, best.pose, s.scale);
            best.converged = converged;
            if !s.scale || partial::near_its_size(&pose) {
                best.pose = pose;
            }
        }
        out
    }
}
