//! Crossings of an open surface: lines where three or four half sheets meet.
//!
//! In: the greedy surface of a cloud that was judged open, its points as measured (before smoothing) and their spacing. Out:
//! [`Joined`]: the surface with every line as a chain of edges that carry one triangle a half sheet, and [`Crossing`] for the report.
//!
//! A cloud does not hit the line where its sheets cross, and triangles of two sheets that cut through each other are not facets of
//! one Delaunay triangulation: the greedy surface, a manifold, jumps there from one way of joining the half sheets to the other.
//!
//! 1. Find the lines ([`find`]): places where two planes explain the neighbours, three or four of their halves being there, traced
//!    from station to station, one spacing apart.
//! 2. Tell the points near a line apart by half sheet ([`mod@line`]); those within half a spacing of it are replaced by its stations,
//!    the others are smoothed by their own sheet's points alone when the cloud is noisy.
//! 3. Take out the triangles within a few spacings, the farther the smaller the angle, and triangulate each sheet anew in its own
//!    two coordinates, along the line and off it, with the line and the rim of what was left as constraints ([`sheet`]).
//!
//! 4. Where half sheets are nearer to each other than their points are apart, triangles of step 3 are no facets of the
//!    three-dimensional triangulation, which the scaffold needs: points are added on them until they are (`conform`).
//!
//! Cost: a plane fit a point, then what lies near lines. Sheets through three lines that meet in a point are joined up to a few
//! spacings of it only.

mod conform;
pub mod find;
pub mod line;
pub mod sheet;

use super::prepare::smooth::project;
use crate::delaunay::{DelaunayError, Triangulation};
use crate::geometry::Neighbours;
use conform::conform;
use find::find_lines;
use glam::DVec3;
use line::{Line, Place};
use serde::{Deserialize, Serialize};
use sheet::{Sheet, triangulate};
use std::collections::{BTreeMap, BTreeSet};

/// Half sheets are told apart from this many spacings over the sine of their angle on.
const APART: f64 = 1.8;
/// Least and most of that, spacings.
const ZONE: (f64, f64) = (2.2, 5.0);
/// Points are assigned to half sheets as far as the greedy loop may join one to another round its rim: this over the sine, at least
/// [`MARGIN`] beyond the zone and at most [`FARTHEST`], spacings.
const JOINED: f64 = 7.0;
const MARGIN: f64 = 3.0;
const FARTHEST: f64 = 16.0;
/// Noise over spacing from which the smoothed points are looked at instead of those measured: planes of few points are too
/// uncertain then.
const STRONG_NOISE: f64 = 0.15;
/// Noise over spacing from which no crossings are looked for: what is left of it folds into sheets that are none.
const TOO_NOISY: f64 = 0.35;
/// Shortest line believed then, spacings: folds that strong noise leaves are up to ten long.
const LONG: f64 = 15.0;
/// What smoothing leaves of strong noise.
const LEFT: f64 = 0.06;
/// Points nearer than this to a line are replaced by its stations, spacings.
const ON_LINE: f64 = 0.5;
/// Height of a triangle at a border that is none, spacings.
const THIN: f64 = 0.12;
/// Neighbours of the smoothing by one sheet.
const SHEET_NEIGHBOURS: usize = 24;

/// A line along which half sheets of an open surface meet.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crossing {
    /// Edges, each with one triangle a half sheet.
    pub edges: usize,
    /// Length, mm.
    pub length_mm: f64,
    /// Whether it is a loop.
    pub closed: bool,
    /// Half sheets that meet: four where two sheets cross, three where one ends on another.
    pub half_sheets: usize,
    /// Angle between the sheets, degrees (at most 90).
    pub angle_degrees: f64,
    /// Both ends (the same place twice for a loop), mm.
    pub ends: [DVec3; 2],
    /// Its middle, mm.
    pub place: DVec3,
    /// Points within half a spacing, which its edges replace.
    pub replaced_points: usize,
}

/// A surface with its crossings joined.
#[derive(Clone, Debug, Default)]
pub struct Joined {
    /// The triangulation of the points left and those of the lines.
    pub triangulation: Triangulation,
    /// Triangles over it, not oriented.
    pub triangles: Vec<[u32; 3]>,
    /// The former generator each point was, or is nearest to.
    pub origin: Vec<u32>,
    /// Local spacing, mm.
    pub spacing_mm: Vec<f64>,
    /// The lines.
    pub crossings: Vec<Crossing>,
    /// Points added to make triangles facets.
    pub added: usize,
    /// Triangles that are no facets of the triangulation all the same.
    pub loose: usize,
}

/// What the crossings of a surface are looked for in.
#[derive(Clone, Copy, Debug)]
pub struct OpenSurface<'a> {
    /// Generators, mm.
    pub points: &'a [DVec3],
    /// The same as measured, before any smoothing, mm.
    pub measured: &'a [DVec3],
    /// Local spacing, mm.
    pub spacing_mm: &'a [f64],
    /// Its triangles.
    pub triangles: &'a [[u32; 3]],
    /// Noise over spacing of the points as measured; 0 when they are not to be moved.
    pub noise_over_spacing: f64,
}

/// Finds the crossings and joins the sheets there; `None` when there are none. See the module.
///
/// # Errors
/// When the changed points cannot be triangulated.
pub fn join_crossings(surface: &OpenSurface) -> Result<Option<Joined>, DelaunayError> {
    if surface.noise_over_spacing >= TOO_NOISY {
        return Ok(None);
    }
    let strong = surface.noise_over_spacing >= STRONG_NOISE;
    let (measured, noise) = match strong {
        true => (surface.points, LEFT),
        false => (surface.measured, surface.noise_over_spacing),
    };
    let surface = &OpenSurface { measured, ..*surface };
    let mut lines = find_lines(measured, surface.spacing_mm, noise);
    lines.retain(|l| !strong || l.length_mm >= LONG * l.spacing_mm);
    if lines.is_empty() {
        return Ok(None);
    }
    let mut work = Work::new(surface, lines);
    if !strong && noise > 0.0 {
        work.smooth_by_sheet();
    }
    work.take_out();
    work.fill();
    work.finish().map(Some)
}

/// Where a point is in the frame of the line nearest to it.
#[derive(Clone, Copy)]
struct Located {
    line: u32,
    place: Place,
}

struct Work<'a> {
    surface: &'a OpenSurface<'a>,
    lines: Vec<Line>,
    zone_mm: Vec<f64>,
    located: Vec<Option<Located>>,
    points: Vec<DVec3>,
    /// First point of each line's stations.
    first_station: Vec<u32>,
    /// Points replaced by stations.
    gone: Vec<bool>,
    kept: Vec<[u32; 3]>,
    filled: Vec<[u32; 3]>,
}

impl<'a> Work<'a> {
    fn new(surface: &'a OpenSurface<'a>, lines: Vec<Line>) -> Self {
        let zone_mm: Vec<f64> = lines
            .iter()
            .map(|l| (APART / l.least_sine()).clamp(ZONE.0, ZONE.1) * l.spacing_mm)
            .collect();
        let reach_mm: Vec<f64> = lines
            .iter()
            .zip(&zone_mm)
            .map(|(l, zone)| {
                let joined = (JOINED / l.least_sine()).min(FARTHEST) * l.spacing_mm;
                joined.max(zone + MARGIN * l.spacing_mm)
            })
            .collect();
        let located: Vec<Option<Located>> = surface
            .measured
            .iter()
            .map(|&p| {
                let mut best: Option<Located> = None;
                for (number, line) in lines.iter().enumerate() {
                    let reach = reach_mm[number];
                    if let Some(place) = line.place(p, reach)
                        && best.is_none_or(|b| place.distance_mm < b.place.distance_mm)
                    {
                        best = Some(Located {
                            line: number as u32,
                            place,
                        });
                    }
                }
                best
            })
            .collect();
        let gone = located
            .iter()
            .map(|l| l.is_some_and(|l| l.place.distance_mm < ON_LINE * lines[l.line as usize].spacing_mm))
            .collect();
        let mut points = surface.points.to_vec();
        let mut first_station = Vec::new();
        for line in &lines {
            first_station.push(points.len() as u32);
            points.extend(line.stations.iter().map(|s| s.place));
        }
        Self {
            surface,
            zone_mm,
            located,
            points,
            first_station,
            gone,
            lines,
            kept: Vec::new(),
            filled: Vec::new(),
        }
    }

    /// The half sheet of a former generator: line, half.
    fn half(&self, v: u32) -> Option<(u32, u8)> {
        let l = (*self.located.get(v as usize)?)?;
        Some((l.line, l.place.half?))
    }

    /// Generators of one sheet of a line, within its margin.
    fn of_sheet(&self, line: u32, sheet: u8) -> Vec<u32> {
        (0..self.surface.points.len() as u32)
            .filter(|&v| self.half(v).is_some_and(|(l, h)| l == line && h / 2 == sheet))
            .collect()
    }

    /// Step 2 for noisy clouds: points in a zone are put onto a quadratic through their own sheet's points alone.
    fn smooth_by_sheet(&mut self) {
        let noise = self.surface.noise_over_spacing;
        for line in 0..self.lines.len() as u32 {
            for sheet in 0..2 {
                let members = self.of_sheet(line, sheet);
                let measured: Vec<DVec3> = members
                    .iter()
                    .map(|&v| self.surface.measured[v as usize])
                    .collect();
                let tree = Neighbours::new(&measured);
                for (&v, &p) in members.iter().zip(&measured) {
                    let near: Vec<u32> = tree.knn(p, SHEET_NEIGHBOURS).iter().map(|n| n.index).collect();
                    if let Some(moved) = project(&measured, &near, p, noise) {
                        self.points[v as usize] = moved;
                    }
                }
            }
        }
    }

    /// Whether a generator is near a line and on one of its half sheets.
    fn in_zone(&self, v: u32) -> bool {
        self.gone[v as usize]
            || self.located[v as usize].is_some_and(|l| {
                l.place.half.is_some() && l.place.distance_mm < self.zone_mm[l.line as usize]
            })
    }

    /// Step 3, first half: triangles in the zone or from one sheet to the other go.
    fn take_out(&mut self) {
        self.kept = self
            .surface
            .triangles
            .iter()
            .copied()
            .filter(|t| {
                // The halves of one sheet are joined past an end of the line.
                let mut sheets = t
                    .iter()
                    .filter_map(|&v| self.half(v).map(|(line, h)| (line, h / 2)));
                let first = sheets.next();
                t.iter().all(|&v| !self.in_zone(v)) && sheets.all(|s| Some(s) == first)
            })
            .collect();
    }

    /// Step 3, second half.
    fn fill(&mut self) {
        let mut used = vec![false; self.points.len()];
        for &v in self.kept.iter().flatten() {
            used[v as usize] = true;
        }
        let rims = super::openness::open_edges(&self.kept);
        let present: BTreeSet<[u32; 3]> = self.kept.iter().map(|&t| sorted(t)).collect();
        for line in 0..self.lines.len() as u32 {
            for sheet in 0..2u8 {
                let Some(half_sheets) = self.lines[line as usize].halves_of(sheet) else {
                    continue;
                };
                let at = |v: u32| -> Option<Place> {
                    let l = (*self.located.get(v as usize)?)?;
                    (l.line == line && l.place.half? / 2 == sheet).then_some(l.place)
                };
                let free = (0..self.surface.points.len() as u32)
                    .filter(|&v| !used[v as usize] && !self.gone[v as usize])
                    .filter_map(|v| Some((v, at(v)?)))
                    .collect();
                let rim: Vec<((u32, Place), (u32, Place))> = rims
                    .iter()
                    .filter_map(|&(a, b)| Some(((a, at(a)?), (b, at(b)?))))
                    .collect();
                let strip = triangulate(&Sheet {
                    line: &self.lines[line as usize],
                    first_station: self.first_station[line as usize],
                    halves: half_sheets,
                    points: &self.points,
                    free,
                    rim,
                });
                self.filled
                    .extend(strip.into_iter().filter(|&t| !present.contains(&sorted(t))));
            }
        }
        self.drop_surplus();
        self.drop_slivers();
    }

    /// Slivers between the border of a sheet and its convex hull go, from outside: they have an open edge and next to no height over it.
    fn drop_slivers(&mut self) {
        let lines = self.line_edges();
        let height = |[a, b, c]: [u32; 3], e: (u32, u32)| {
            let [p, q, r] = [a, b, c].map(|v| self.points[v as usize]);
            (q - p).cross(r - p).length() / self.points[e.0 as usize].distance(self.points[e.1 as usize])
        };
        let thin_mm = THIN
            * self
                .lines
                .iter()
                .map(|l| l.spacing_mm)
                .fold(f64::INFINITY, f64::min);
        let thin = |t: [u32; 3], count: &BTreeMap<(u32, u32), u32>| {
            !edges(t).iter().any(|e| lines.contains_key(e))
                && edges(t).iter().any(|e| count[e] == 1 && height(t, *e) < thin_mm)
        };
        // Of the triangles left too, near lines: one may hang on a point now.
        let near = |t: [u32; 3]| t.iter().all(|&v| self.half(v).is_some());
        let (mut kept, mut filled) = (self.kept.clone(), self.filled.clone());
        loop {
            let mut count: BTreeMap<(u32, u32), u32> = BTreeMap::new();
            for e in kept.iter().chain(&filled).flat_map(|t| edges(*t)) {
                *count.entry(e).or_default() += 1;
            }
            let before = kept.len() + filled.len();
            filled.retain(|&t| !thin(t, &count));
            kept.retain(|&t| !near(t) || !thin(t, &count));
            if kept.len() + filled.len() == before {
                break;
            }
        }
        (self.kept, self.filled) = (kept, filled);
    }

    /// Edges off the lines have at most two triangles: of more, new ones go.
    fn drop_surplus(&mut self) {
        let mut count: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for e in self.kept.iter().flat_map(|t| edges(*t)) {
            *count.entry(e).or_default() += 1;
        }
        let stations = self.first_station.first().copied().unwrap_or(u32::MAX);
        self.filled.retain(|&t| {
            let fits = edges(t)
                .iter()
                .all(|e| e.0 >= stations || count.get(e).copied().unwrap_or(0) < 2);
            if fits {
                for e in edges(t) {
                    *count.entry(e).or_default() += 1;
                }
            }
            fits
        });
    }

    /// New points, their triangulation, the report.
    fn finish(mut self) -> Result<Joined, DelaunayError> {
        let triangles = [std::mem::take(&mut self.kept), std::mem::take(&mut self.filled)].concat();
        let points = std::mem::take(&mut self.points);
        let old = self.surface.points.len();
        let used: Vec<bool> = (0..points.len()).map(|v| v >= old || !self.gone[v]).collect();
        let least = self
            .lines
            .iter()
            .map(|l| l.spacing_mm)
            .fold(f64::INFINITY, f64::min);
        let found = conform(points, &used, triangles, self.line_edges(), least)?;
        let former = Neighbours::new(self.surface.measured);
        let origin: Vec<u32> = found
            .origin
            .iter()
            .zip(&found.triangulation.points)
            .map(|(&v, &p)| match (v as usize) < old {
                true => v,
                false => former.nearest(p).map_or(0, |n| n.index),
            })
            .collect();
        let mut edges = vec![0usize; self.lines.len()];
        for &line in found.line_edges.values() {
            edges[line as usize] += 1;
        }
        let crossings = (0..self.lines.len())
            .map(|k| Crossing {
                edges: edges[k],
                ..self.describe(k as u32)
            })
            .collect();
        Ok(Joined {
            spacing_mm: origin
                .iter()
                .map(|&o| self.surface.spacing_mm[o as usize])
                .collect(),
            origin,
            crossings,
            triangulation: found.triangulation,
            triangles: found.triangles,
            added: found.added,
            loose: found.loose,
        })
    }

    fn line_edges(&self) -> BTreeMap<(u32, u32), u32> {
        let mut out = BTreeMap::new();
        for (number, line) in self.lines.iter().enumerate() {
            let (first, count) = (self.first_station[number], line.stations.len() as u32);
            for k in 0..line.steps() as u32 {
                let (a, b) = (first + k, first + (k + 1) % count);
                out.insert((a.min(b), a.max(b)), number as u32);
            }
        }
        out
    }

    fn describe(&self, number: u32) -> Crossing {
        let line = &self.lines[number as usize];
        let stations = &line.stations;
        let last = if line.closed { 0 } else { stations.len() - 1 };
        Crossing {
            edges: line.steps(),
            length_mm: line.length_mm,
            closed: line.closed,
            half_sheets: line.exists.iter().filter(|e| **e).count(),
            angle_degrees: line.angle_degrees(),
            ends: [stations[0].place, stations[last].place],
            place: stations[stations.len() / 2].place,
            replaced_points: (0..self.gone.len())
                .filter(|&v| self.gone[v] && self.located[v].is_some_and(|l| l.line == number))
                .count(),
        }
    }
}

pub(super) fn sorted(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}

fn edges([a, b, c]: [u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)].map(|(i, j)| (i.min(j), i.max(j)))
}
