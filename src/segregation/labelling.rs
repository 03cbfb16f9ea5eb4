//! From pulls and facet costs to manifold labels without handles that are too narrow to be believed.
//!
//! In: a triangulation, what every tetrahedron wants, which facets are greedy. Out: [`Labelled`].
//!
//! 1. Minimum cut: a facet costs `0.02 + w`, a tenth of that when it is greedy ([`super::min_cut`]).
//! 2. Islands flipped, stars repaired ([`super::islands`], [`super::star_repair`]), twice; near points taken in.
//! 3. Narrow handles and tunnels ([`super::handles`]) are tried without: the pull of the small tetrahedra round one is raised
//!    (the tunnel fills) or lowered (the bridge breaks) step by step until the cut has one handle less. Of the two the one
//!    of less energy *by the first pulls* is taken, when that costs little more than the handle did; a real handle resists.
//!    Measured: of 13 wrong results with noise of half the spacing or more 8 had such handles.

use super::adopt::adopt_points;
use super::diffusion::slot;
use super::facets::FacetDepths;
use super::handles::{NarrowHandle, narrow_handles};
use super::islands::{Island, flip_islands};
use super::labels::{boundary_facets, boundary_triangles, mesh_of};
use super::min_cut::min_cut;
use super::openness::has_long_edge;
use super::star_repair::{StarRepair, repair_stars};
use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::{MeshTopology, TetId};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Energy of a facet of weight 0, so that the surface is short where nothing else speaks.
const LEAST_FACET_COST: f32 = 0.02;
/// Factor on the cost of facets that the greedy surface holds.
const ACCEPTED_FACTOR: f32 = 0.1;
/// Steps by which the pull round a narrow handle is changed; pulls reach 3.
const BIASES: [f32; 4] = [0.7, 1.2, 2.0, 3.5];
/// A handle is given up when that costs at most this much energy over its rings (a facet that looks nothing like surface
/// costs about 1): the narrower it is the less it is believed.
const MOST_ENERGY: f64 = 150.0;
/// Cuts tried at most, so that a sponge does not take for ever, and points over all of them (a large cloud gets fewer).
const MOST_CUTS: usize = 24;
const MOST_CUT_POINTS: usize = 400_000;

/// Labels of a minimum cut, made a manifold.
#[derive(Clone, Debug, Default)]
pub struct Labelled {
    /// Label of every tetrahedron.
    pub inside: Vec<bool>,
    /// Parts that were flipped.
    pub islands: Vec<Island>,
    /// What the star repair did.
    pub repair: StarRepair,
    /// Points taken onto the surface at the end.
    pub adopted: usize,
    /// Narrow handles given up.
    pub opened: Vec<RemovedHandle>,
    /// Narrow handles left, when they were looked for.
    pub handles: Vec<NarrowHandle>,
}

/// A narrow handle that was not believed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RemovedHandle {
    /// Where it was, mm.
    pub place: DVec3,
    /// Half the length of its loop, edges.
    pub rings: u32,
    /// `true`: a tunnel that was filled; `false`: a bridge that was broken.
    pub filled: bool,
    /// Energy that this cost.
    pub energy: f64,
}

/// A labelling to be made.
#[derive(Clone, Copy, Debug)]
pub struct LabellingProblem<'a> {
    /// The tetrahedra.
    pub triangulation: &'a Triangulation,
    /// Facet weights.
    pub depths: &'a FacetDepths,
    /// Greedy facets, by side.
    pub accepted: &'a [bool],
    /// What every finite tetrahedron wants; positive: inside.
    pub pull: &'a [f32],
    /// Local spacing of the generators, mm.
    pub spacing_mm: &'a [f64],
    /// Least share of the points a component must touch.
    pub least_component_share: f64,
    /// Factor on the cost of facets with an edge that no points support; 1 for none.
    pub unsupported_factor: f32,
}

impl LabellingProblem<'_> {
    /// Steps 1 and 2, for these pulls or others.
    pub fn cut(&self, pull: &[f32]) -> Labelled {
        let inside = min_cut(self.triangulation, pull, |facet| self.facet_cost(facet));
        let mut out = Labelled {
            inside,
            ..Default::default()
        };
        let flip =
            |inside: &mut Vec<bool>| flip_islands(self.triangulation, inside, self.least_component_share);
        out.islands = flip(&mut out.inside);
        out.repair = repair_stars(self.triangulation, pull, &mut out.inside);
        // Once more when the repair changed anything, and the repair once more when that did.
        if out.repair.flips > 0 {
            let more = flip(&mut out.inside);
            if !more.is_empty() {
                let again = repair_stars(self.triangulation, pull, &mut out.inside);
                out.repair.flips += again.flips;
                out.repair.left = again.left;
            }
            out.islands.extend(more);
        }
        out.adopted = adopt_points(self.triangulation, self.spacing_mm, &mut out.inside);
        out
    }

    fn facet_cost(&self, facet: Facet) -> f32 {
        let w = self.depths.weight(self.triangulation, facet);
        let factor = if self.accepted[slot(facet)] {
            ACCEPTED_FACTOR
        } else {
            1.0
        };
        let dear = self.unsupported_factor != 1.0 && self.is_unsupported(facet);
        let bare = if dear { self.unsupported_factor } else { 1.0 };
        factor * bare * (LEAST_FACET_COST + w)
    }

    fn is_unsupported(&self, facet: Facet) -> bool {
        let v = self.triangulation.facet_vertices(facet);
        v.iter().all(|&v| v != INFINITE)
            && has_long_edge(&self.triangulation.points, v.map(|v| v.0), self.spacing_mm)
    }

    /// The energy that step 1 minimises.
    fn energy(&self, inside: &[bool]) -> f64 {
        let against: f64 = self
            .pull
            .iter()
            .zip(inside)
            .filter(|(p, i)| (**p > 0.0) != **i)
            .map(|(p, _)| f64::from(p.abs()))
            .sum();
        let surface: f64 = boundary_facets(self.triangulation, inside)
            .into_iter()
            .map(|f| f64::from(self.facet_cost(f)))
            .sum();
        against + surface
    }

    /// Step 3, from labels that the first steps gave.
    pub fn without_narrow_handles(&self, first: Labelled) -> Labelled {
        let mut best = first;
        let mut state = self.state(&best);
        if state.handles.is_empty() {
            best.handles.clear();
            return best;
        }
        let mut pull = self.pull.to_vec();
        let mut given_up: Vec<u32> = Vec::new();
        let mut opened = Vec::new();
        let mut cuts = 0;
        let most = (MOST_CUT_POINTS / self.triangulation.points.len()).clamp(8, MOST_CUTS);
        while cuts < most {
            let Some(handle) = state
                .handles
                .iter()
                .find(|h| !given_up.contains(&h.centre))
                .cloned()
            else {
                break;
            };
            given_up.push(handle.centre);
            let Some(attempt) = self.open(&handle, &state, &pull, &mut cuts) else {
                continue;
            };
            opened.push(RemovedHandle {
                place: handle.place,
                rings: handle.rings,
                filled: attempt.filled,
                energy: attempt.state.energy - state.energy,
            });
            best = attempt.labelled;
            pull = attempt.pull;
            state = attempt.state;
        }
        best.opened = opened;
        best.handles = state.handles;
        best
    }

    fn state(&self, labelled: &Labelled) -> State {
        let triangles = boundary_triangles(self.triangulation, &labelled.inside);
        let mesh = mesh_of(self.triangulation, &triangles);
        let handles = narrow_handles(&mesh.points, &mesh.triangles);
        State {
            energy: if handles.is_empty() {
                0.0
            } else {
                self.energy(&labelled.inside)
            },
            topology: mesh.topology(),
            handles,
        }
    }

    /// The cheaper of filling and breaking, at the first bias that takes a handle away.
    fn open(&self, handle: &NarrowHandle, now: &State, pull: &[f32], cuts: &mut usize) -> Option<Attempt> {
        let mut near = vec![false; self.triangulation.points.len()];
        for &v in &handle.vertices {
            near[v as usize] = true;
        }
        let round: Vec<TetId> = self
            .triangulation
            .finite_tets()
            .filter(|&t| self.triangulation.tet(t).iter().all(|v| near[v.index()]))
            .collect();
        let biased = |bias: f32, filled: bool| {
            let mut biased = pull.to_vec();
            for t in &round {
                biased[t.index()] += if filled { bias } else { -bias };
            }
            let labelled = self.cut(&biased);
            let state = self.state(&labelled);
            (biased, labelled, state)
        };
        // What the strongest bias cannot do no weaker one can.
        let strongest = BIASES[BIASES.len() - 1];
        let mut ways = [true, false].map(|filled| {
            *cuts += 1;
            let open = biased(strongest, filled).2.genus() < now.genus();
            Way { filled, open }
        });
        // The energy grows with the bias: a way that is too dear at one step is too dear at all later ones.
        for bias in BIASES {
            let mut best: Option<Attempt> = None;
            for way in ways.iter_mut().filter(|w| w.open) {
                *cuts += 1;
                let (pull, labelled, mut state) = biased(bias, way.filled);
                if state.genus() >= now.genus() || state.topology.components != now.topology.components {
                    continue;
                }
                state.energy = self.energy(&labelled.inside);
                way.open = state.energy - now.energy <= MOST_ENERGY / f64::from(handle.rings);
                if way.open && best.as_ref().is_none_or(|b| state.energy < b.state.energy) {
                    best = Some(Attempt {
                        labelled,
                        pull,
                        state,
                        filled: way.filled,
                    });
                }
            }
            if best.is_some() {
                return best;
            }
        }
        None
    }
}

/// Filling a tunnel or breaking a bridge.
struct Way {
    filled: bool,
    /// Whether it may still be taken.
    open: bool,
}

/// A labelling's surface.
struct State {
    energy: f64,
    topology: MeshTopology,
    handles: Vec<NarrowHandle>,
}

impl State {
    /// Handles of all components.
    fn genus(&self) -> i64 {
        self.topology.components as i64 - self.topology.euler / 2
    }
}

struct Attempt {
    labelled: Labelled,
    pull: Vec<f32>,
    state: State,
    filled: bool,
}
