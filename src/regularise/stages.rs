//! The stages of the regularisation in their order, and the result.

use super::burn::burn;
use super::cells::remove_cells;
use super::collapse::{WireFire, collapse_facets};
use super::complex::{Alive, Complex, Step};
use super::cover::Cover;
use super::fidelity::{self, Fidelity, Nearest};
use super::fins::trim_fins;
use super::fringe::{Fringe, trim_fringes};
use super::grow::{grow_sheets, grow_wires};
use super::history::{Event, Kind};
use super::measure::{Measure, Tolerance};
use super::seams::find_seams;
use super::settings::{Cost, RegulariseError, RegulariseSettings};
use super::spines::{Spines, grow_spines};
use super::splice::Splicer;
use super::wires::{remove_small_wires, remove_whiskers, whiskers};
use crate::fine_scaffold::{Betti, FineScaffold};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Betti numbers after a stage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageBetti {
    /// Stage.
    pub stage: String,
    /// Betti numbers of the complex after it.
    pub betti: Betti,
}

/// A regularised scaffold: a subcomplex of the fine scaffold, graded.
#[derive(Clone, Debug)]
pub struct Regularised {
    /// What is left of the fine scaffold.
    pub alive: Alive,
    /// Erosion thickness of every facet of the fine scaffold, mm; infinite where no fire comes (closed sheets).
    pub erosion_mm: Vec<f64>,
    /// Erosion thickness of the vertices that the fire on wires has reached, mm; NaN elsewhere.
    pub wire_erosion_mm: Vec<f64>,
    /// Seams as paths of edges, each from the end of an axial curve.
    pub seams: Vec<Vec<u32>>,
    /// Edges of the spines: paths from the sheets to single balls that generators far from all others need. They belong to the
    /// complex and to no element of the graph.
    pub spines: Vec<u32>,
    /// Every elementary step in order; [`super::replay`] makes `alive` of it.
    pub log: Vec<Step>,
    /// What was done, in order, with costs.
    pub history: Vec<Event>,
    /// Betti numbers of the fine scaffold and after every stage; all equal.
    pub betti: Vec<StageBetti>,
    /// Distance from the generators to the union of the medial balls that are left.
    pub fidelity: Fidelity,
    /// The tolerance, mm; with a tolerance relative to the radius, that of the thickest part.
    pub tolerance_mm: f64,
    /// Diagonal of the bounding box of the generators, mm.
    pub diagonal_mm: f64,
    /// What was cheapest first.
    pub cost: Cost,
    /// The cut, in local tolerances: what is less persistent has been removed, unless the surface would have moved too far. 0
    /// when costs are not lengths.
    pub cut: f64,
    /// Vertex of the medial ball nearest to each generator, where it had to be looked for.
    pub(crate) nearest_vertex: Vec<u32>,
    pub(crate) local_tolerance: Tolerance,
    /// Length that the persistence of a curve is taken along, in local tolerances.
    pub(crate) persistence_length: f64,
}

impl Regularised {
    /// The tolerance at a vertex of the fine scaffold, mm.
    pub fn tolerance_at(&self, vertex: u32) -> f64 {
        self.local_tolerance.at(vertex)
    }

    /// A number of local tolerances as a persistence, mm: of the tolerance itself, so that elements of thick and thin parts are graded alike;
    /// below the diagonal, which stands for what cannot go at any price.
    pub(crate) fn at_scale(&self, tolerances: f64) -> f64 {
        (tolerances * self.tolerance_mm).min(BELOW * self.diagonal_mm)
    }

    /// A length at some vertices as a persistence, mm: see [`Self::at_scale`]. Infinite (no fire comes) is the diagonal.
    pub(crate) fn persistence(&self, length_mm: f64, vertices: &[u32]) -> f64 {
        if length_mm.is_infinite() {
            return self.diagonal_mm;
        }
        let share = self.tolerance_mm / self.local_tolerance.over(vertices);
        (length_mm * share).min(BELOW * self.diagonal_mm)
    }

    /// The mean tolerance over some vertices, mm.
    pub(crate) fn tolerance_over(&self, vertices: &[u32]) -> f64 {
        self.local_tolerance.over(vertices)
    }

    /// The Betti numbers, the same at every stage.
    pub fn betti(&self) -> Betti {
        self.betti.last().map(|s| s.betti).unwrap_or_default()
    }
}

/// What can go at some price has a persistence of less than this share of the diagonal.
const BELOW: f64 = 0.999;

/// Times that growing back is tried anew with the offending pieces restored, before everything that offends without
/// growing back is restored, which always succeeds.
const ATTEMPTS: usize = 4;

/// Simplifies a fine scaffold; see the module for the stages.
///
/// # Errors
/// A setting out of range, or [`RegulariseError::Topology`] should a stage ever change the Betti numbers.
///
/// # Complexity
/// `O(n log n)` in the size of the fine scaffold.
pub fn regularise(
    fine: &FineScaffold,
    settings: &RegulariseSettings,
) -> Result<Regularised, RegulariseError> {
    settings.check()?;
    let mut run = Run::new(fine, settings);
    let sampling = settings.splice_spacings * fine.scale.spacing_mm / run.largest_tolerance();
    run.cut = settings.splice.max(sampling.min(1.0));
    run.checked("fine scaffold")?;
    run.stage(Kind::Cells, |run| remove_cells(&mut run.complex));
    run.checked("3-cells")?;
    run.burn();
    run.stage(Kind::Collapse, Run::collapse);
    run.checked("collapse")?;
    let mut cover = Cover::new(&run.complex, &run.measure, None);
    run.simplify(&mut cover);
    run.checked("splice and trim")?;
    let mut nearest = run.grow_within_tolerance(&cover);
    run.checked("grow back")?;
    let seams = find_seams(&run.complex, &run.measure, settings, &mut run.history);
    let spines = run.grow_spines(&cover, &mut nearest);
    run.checked("spines")?;
    let fidelity = Fidelity::of(&nearest.distance_mm, &cover);
    Ok(run.finish(seams, spines, fidelity, nearest.vertex))
}

struct Run<'a> {
    fine: &'a FineScaffold,
    settings: &'a RegulariseSettings,
    complex: Complex<'a>,
    measure: Measure,
    fire: WireFire,
    /// Erosion thickness of facets, mm and in tolerances.
    erosion: Vec<f64>,
    relative: Vec<f64>,
    /// Elements of less persistence go, in tolerances.
    cut: f64,
    history: Vec<Event>,
    betti: Vec<StageBetti>,
}

impl<'a> Run<'a> {
    fn new(fine: &'a FineScaffold, settings: &'a RegulariseSettings) -> Self {
        Self {
            fine,
            settings,
            complex: Complex::new(fine),
            measure: Measure::new(fine, Tolerance::new(settings.tolerance, fine)),
            fire: WireFire::new(fine.num_vertices()),
            erosion: Vec::new(),
            relative: Vec::new(),
            cut: 0.0,
            history: Vec::new(),
            betti: Vec::new(),
        }
    }

    /// Records the Betti numbers after a stage and compares them with those before.
    fn checked(&mut self, stage: &'static str) -> Result<(), RegulariseError> {
        let after = self.complex.betti();
        if let Some(last) = self.betti.last()
            && last.betti != after
        {
            return Err(RegulariseError::Topology {
                stage,
                before: last.betti,
                after,
            });
        }
        self.betti.push(StageBetti {
            stage: stage.to_owned(),
            betti: after,
        });
        Ok(())
    }

    /// Runs a stage that is one event of the history.
    fn stage(&mut self, kind: Kind, work: impl FnOnce(&mut Self)) {
        let first = self.complex.log.len();
        work(self);
        let last = self.complex.log.len();
        if last > first {
            let cost = match kind {
                Kind::Collapse => self.settings.collapse * self.largest_tolerance(),
                _ => 0.0,
            };
            self.history
                .push(Event::applied(kind, cost, DVec3::ZERO, first, last));
        }
    }

    fn largest_tolerance(&self) -> f64 {
        self.measure.tolerance.largest()
    }

    fn burn(&mut self) {
        self.erosion = burn(&self.complex, &self.measure);
        self.relative = self
            .erosion
            .iter()
            .enumerate()
            .map(|(f, et)| et / self.measure.tolerance.over(self.fine.facet_vertices(f)))
            .collect();
    }

    fn collapse(&mut self) {
        let limit = self.settings.collapse;
        let relative = &self.relative;
        collapse_facets(
            &mut self.complex,
            &self.measure,
            0..self.fine.num_facets() as u32,
            |f| (relative[f as usize] < limit).then_some(relative[f as usize]),
        );
        self.fire
            .prune(&mut self.complex, &self.measure, self.settings.wire * limit);
    }

    fn splice(&mut self, cover: &mut Cover) -> usize {
        let splicer = Splicer {
            measure: &self.measure,
            relative: &self.relative,
            limit: self.cut,
            slight_move: self.settings.slight_move,
            slight_erosion: self.settings.slight_erosion,
            wire: self.settings.wire,
            count: (self.settings.cost == Cost::Count).then_some(self.settings.count_threshold),
        };
        splicer.run(&mut self.complex, &mut self.fire, cover, &mut self.history)
    }

    fn simplify(&mut self, cover: &mut Cover) {
        for _ in 0..self.settings.rounds {
            let mut changes = self.splice(cover);
            if self.settings.cost == Cost::Length {
                changes += trim_fins(
                    &mut self.complex,
                    &self.measure,
                    &self.relative,
                    self.cut,
                    self.settings.persistence_length,
                    self.settings.wire,
                    &mut self.fire,
                    cover,
                    &mut self.history,
                );
            }
            if changes == 0 {
                break;
            }
        }
    }

    /// Growth, then the last small remnants.
    fn grow(&mut self, cover: &Cover, clear_whiskers: bool) {
        if clear_whiskers {
            let longest = 2.0 * self.settings.seam_length;
            self.stage(Kind::PruneWires, |run| {
                remove_whiskers(&mut run.complex, &run.measure, longest);
            });
        }
        let (least, least_axial) = (self.settings.grow_back, self.settings.grow_back_axial);
        let whisker = whiskers(&self.complex, &self.measure, 2.0 * self.settings.seam_length);
        self.stage(Kind::GrowBack, |run| {
            grow_sheets(&mut run.complex, &run.relative, least, least_axial, &whisker);
        });
        self.stage(Kind::GrowWires, |run| {
            // Along a wire there is no sheet beside it to say where it ends.
            let least = run.settings.fringe_erosion.max(least);
            grow_wires(&mut run.complex, &run.measure, &run.fire, least);
        });
        let mut cover = Cover::new(&self.complex, &self.measure, Some(cover.clone()));
        if self.settings.cost == Cost::Length {
            self.stage(Kind::TrimFringe, |run| {
                let fringe = Fringe {
                    width: run.settings.fringe_width,
                    most: run.settings.fringe_erosion,
                    movement: run.settings.fringe_erosion,
                };
                trim_fringes(&mut run.complex, &run.measure, &run.relative, fringe, &mut cover);
            });
        }
        self.splice(&mut cover);
        remove_small_wires(
            &mut self.complex,
            &self.measure,
            self.cut,
            &mut cover,
            &mut self.history,
        );
    }

    /// Grows back, and starts again with pieces restored while the surface has moved too far anywhere. Returns the balls nearest to the
    /// generators.
    fn grow_within_tolerance(&mut self, cover: &Cover) -> Nearest {
        for attempt in 0..=ATTEMPTS {
            let start = (self.complex.log.len(), self.history.len());
            let fire = self.fire.clone();
            if attempt < ATTEMPTS {
                self.grow(cover, attempt == 0);
            }
            let tree = fidelity::alive_balls(&self.complex);
            let bad = match self.settings.cost {
                Cost::Length => fidelity::offending(&self.complex, &tree, cover),
                Cost::Count => Vec::new(),
            };
            if bad.is_empty() {
                return fidelity::nearest(&self.complex, &tree, cover);
            }
            self.complex.undo_to(start.0);
            self.history.truncate(start.1);
            self.fire = fire;
            self.stage(Kind::Restore, |run| {
                fidelity::restore(&mut run.complex, cover, &bad);
            });
        }
        self.grow(cover, false);
        let tree = fidelity::alive_balls(&self.complex);
        fidelity::nearest(&self.complex, &tree, cover)
    }

    /// Spines for the generators farthest from the balls; where costs are counts no length says which those are.
    fn grow_spines(&mut self, cover: &Cover, nearest: &mut Nearest) -> Vec<u32> {
        let mut edges = Vec::new();
        if self.settings.cost == Cost::Length {
            let spines = Spines {
                from: self.settings.spine_from,
                longest: self.settings.spine_length,
            };
            self.stage(Kind::Spines, |run| {
                edges = grow_spines(&mut run.complex, &run.measure, cover, spines, nearest);
            });
        }
        edges
    }

    fn finish(
        self,
        seams: Vec<Vec<u32>>,
        spines: Vec<u32>,
        fidelity: Fidelity,
        nearest_vertex: Vec<u32>,
    ) -> Regularised {
        let tolerance_mm = self.largest_tolerance();
        let wire_erosion_mm = (0..self.fine.num_vertices() as u32)
            .map(|v| self.fire.erosion(&self.complex, v).unwrap_or(f64::NAN))
            .collect();
        let log = self.complex.log.clone();
        Regularised {
            alive: self.complex.into(),
            erosion_mm: self.erosion,
            wire_erosion_mm,
            seams,
            spines,
            log,
            history: self.history,
            betti: self.betti,
            fidelity,
            tolerance_mm,
            diagonal_mm: self.fine.scale.diagonal_mm,
            cost: self.settings.cost,
            cut: match self.settings.cost {
                Cost::Length => self.cut,
                Cost::Count => 0.0,
            },
            nearest_vertex,
            persistence_length: self.settings.persistence_length,
            local_tolerance: self.measure.tolerance,
        }
    }
}
