//! Lines where two sheets of a cloud cross, or one ends on another.
//!
//! In: points with their spacing. Out: [`Line`]s with a station every spacing.
//!
//! 1. A plane is fitted to the few nearest of every point; points whose neighbours do not lie on it are where a line may pass.
//! 2. There the planes of the flat points around are tried on all neighbours within a few spacings: the one that explains most, then
//!    the one that explains most of the rest. Both are fitted anew to what is nearest to each. It is a crossing when they explain
//!    nearly all, make an angle, and three or four of their half planes have points on both sides of their common line.
//! 3. The line is followed a spacing at a time both ways, the planes fitted anew at each station, up to six missing, to its end or
//!    its beginning. An edge of a box has two half planes and is none.
//! 4. A line is believed when each of its half sheets is there over its whole length or not at all, with next to nothing between them.
//!    Its ends are where the first of the two sheets ends, or both when they end together; the stations are spread evenly between.
//!
//! `O(n log n)` and a few hundred operations a point of step 2 and a station.

use super::line::{Line, Station};
use crate::geometry::Neighbours;
use crate::segregation::prepare::local_fit::principal_frame;
use crate::segregation::prepare::noise::median;
use glam::DVec3;
use rayon::prelude::*;

/// Neighbours of the plane of step 1.
const FLAT_NEIGHBOURS: usize = 12;
/// Their rms distance from it, spacings, and per noise.
const FLAT: (f64, f64) = (0.15, 1.2);
/// Neighbours one of whose larger spacings is that of a place: near a line, where two sheets are counted as one, it reads too small.
const SPACING_NEIGHBOURS: usize = 96;
/// Share of them with a smaller one.
const SPACING_SHARE: f64 = 0.85;
/// Radius within which two planes must explain the points, spacings.
const REACH: f64 = 3.2;
/// Planes tried at a place.
const TRIALS: usize = 32;
/// Distance at which a plane explains a point, spacings, and per noise.
const NEAR: (f64, f64) = (0.2, 2.0);
/// Least share of the neighbours that the planes explain.
const EXPLAINED: f64 = 0.88;
/// Least points of a plane.
const LEAST: usize = 6;
/// Least sine of the angle of the planes (22 degrees).
const LEAST_SINE: f64 = 0.375;
/// Farthest line from the point it was asked for at, spacings.
const FARTHEST: f64 = 1.5;
/// A half plane is there when it has at least [`HALF_POINTS`] points this near along the line and between these distances off it, in
/// the nearer and in the farther half of them, spacings.
const HALF_ALONG: f64 = 2.2;
const HALF_OFF: (f64, f64) = (0.8, 2.8);
const HALF_POINTS: usize = 3;
/// Over a whole line the fullest half sheet has at least this share of the points that its area asks for at those distances; another
/// is there with this share of the fullest one's, and not there with at most that. Noise at an edge and thin parts give something between.
const FULLEST: f64 = 0.4;
const FULL: f64 = 0.5;
const EMPTY: f64 = 0.15;
/// Share of the points at those distances that may lie between half sheets.
const BETWEEN: f64 = 0.1;
/// A station may be this far from where it was expected, spacings for each step since the last, and turn this much (cosine).
const JUMP: f64 = 0.6;
const TURN: f64 = 0.85;
/// Stations in a row that may be missing.
const MISSES: usize = 6;
/// Shortest line, spacings: corners and noise make shorter ones.
const SHORTEST: f64 = 8.0;
/// Points nearer than this to a line tell where its sheets end, spacings.
const END_OFF: f64 = 2.5;
/// Sheets that end this near each other end together, spacings.
const TOGETHER: f64 = 2.0;
/// A line is not looked for this near another, spacings.
const KNOWN: f64 = 2.0;
/// Fits at a station.
const ROUNDS: usize = 3;

/// A plane as `normal . x = offset`.
#[derive(Clone, Copy)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

impl Plane {
    fn through(point: DVec3, normal: DVec3) -> Self {
        Self {
            normal,
            offset: normal.dot(point),
        }
    }

    fn distance(&self, p: DVec3) -> f64 {
        (self.normal.dot(p) - self.offset).abs()
    }

    fn fit(points: &[DVec3]) -> Option<Self> {
        let weights = vec![1.0; points.len()];
        let frame = principal_frame(points.iter().copied(), &weights)?;
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        Some(Self::through(mean, frame.z_axis))
    }
}

/// Two planes, their line and which of their halves are there.
#[derive(Clone, Copy)]
struct Pair {
    planes: [Plane; 2],
    station: Station,
    there: [bool; 4],
    spacing_mm: f64,
}

impl Pair {
    fn halves_there(&self) -> usize {
        self.there.iter().filter(|t| **t).count()
    }
}

struct Finder<'a> {
    points: &'a [DVec3],
    spacing_mm: &'a [f64],
    noise: f64,
    tree: Neighbours,
    /// Normal of every point whose neighbours lie on a plane.
    normal: Vec<Option<DVec3>>,
}

/// Finds the lines; see the module. The spacing is local, `noise_over_spacing` that of the points given.
pub fn find_lines(points: &[DVec3], spacing_mm: &[f64], noise_over_spacing: f64) -> Vec<Line> {
    let tree = Neighbours::new(points);
    let limit = FLAT.0 + FLAT.1 * noise_over_spacing;
    let normal: Vec<Option<DVec3>> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            let near: Vec<DVec3> = tree
                .knn(points[i], FLAT_NEIGHBOURS)
                .iter()
                .map(|n| points[n.index as usize])
                .collect();
            let plane = Plane::fit(&near)?;
            let squares: f64 = near.iter().map(|&p| plane.distance(p).powi(2)).sum();
            let rms = (squares / near.len() as f64).sqrt();
            (rms <= limit * spacing_mm[i]).then_some(plane.normal)
        })
        .collect();
    let finder = Finder {
        points,
        spacing_mm,
        noise: noise_over_spacing,
        tree,
        normal,
    };
    let hits: Vec<Option<Pair>> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            finder.normal[i]
                .is_none()
                .then(|| finder.pair_at(points[i]))
                .flatten()
        })
        .collect();
    let mut lines: Vec<Line> = Vec::new();
    for hit in hits.into_iter().flatten() {
        let place = hit.station.place;
        if !lines
            .iter()
            .any(|l| l.place(place, KNOWN * l.spacing_mm).is_some())
            && let Some(line) = finder.trace(hit)
            && !lines
                .iter()
                .any(|l| l.length_mm >= line.length_mm && runs_along(&line, l))
        {
            lines.retain(|l| !runs_along(l, &line));
            lines.push(line);
        }
    }
    lines
}

/// Whether most of a line is another's too: a trace that broke off is found again from its far side.
fn runs_along(part: &Line, whole: &Line) -> bool {
    let near = |s: &&Station| whole.place(s.place, KNOWN * whole.spacing_mm).is_some();
    2 * part.stations.iter().filter(near).count() > part.stations.len()
}

impl Finder<'_> {
    fn spacing_at(&self, place: DVec3) -> f64 {
        let near = self.tree.knn(place, SPACING_NEIGHBOURS);
        let mut all: Vec<f64> = near.iter().map(|n| self.spacing_mm[n.index as usize]).collect();
        all.sort_unstable_by(f64::total_cmp);
        all.get((SPACING_SHARE * all.len() as f64) as usize)
            .copied()
            .unwrap_or(0.0)
    }

    /// Step 2.
    fn pair_at(&self, place: DVec3) -> Option<Pair> {
        let spacing_mm = self.spacing_at(place);
        let near = self.tree.within(place, REACH * spacing_mm);
        let flat: Vec<Plane> = near
            .iter()
            .filter_map(|n| {
                let i = n.index as usize;
                Some(Plane::through(self.points[i], self.normal[i]?))
            })
            .collect();
        let trials: Vec<Plane> = flat.iter().copied().step_by(flat.len() / TRIALS + 1).collect();
        let tolerance = (NEAR.0 + NEAR.1 * self.noise) * spacing_mm;
        let around: Vec<DVec3> = near.iter().map(|n| self.points[n.index as usize]).collect();
        let first = best(&trials, &around)(tolerance)?;
        let rest: Vec<DVec3> = around
            .iter()
            .copied()
            .filter(|&p| first.distance(p) > tolerance)
            .collect();
        if rest.len() < LEAST {
            return None;
        }
        let others: Vec<Plane> = trials
            .into_iter()
            .filter(|p| p.normal.cross(first.normal).length() >= LEAST_SINE)
            .collect();
        let second = best(&others, &rest)(tolerance)?;
        let pair = self.fit([first, second], place, spacing_mm)?;
        (pair.halves_there() >= 3 && pair.station.place.distance(place) <= FARTHEST * spacing_mm)
            .then_some(pair)
    }

    /// Fits two planes anew to the points near a place.
    fn fit(&self, mut planes: [Plane; 2], place: DVec3, spacing_mm: f64) -> Option<Pair> {
        let tolerance = (NEAR.0 + NEAR.1 * self.noise) * spacing_mm;
        let near: Vec<DVec3> = self
            .tree
            .within(place, REACH * spacing_mm)
            .iter()
            .map(|n| self.points[n.index as usize])
            .collect();
        for _ in 0..ROUNDS {
            let mut own: [Vec<DVec3>; 2] = Default::default();
            for &p in &near {
                let d = planes.map(|plane| plane.distance(p));
                let nearest = usize::from(d[1] < d[0]);
                if d[nearest] < 2.0 * tolerance {
                    own[nearest].push(p);
                }
            }
            for (plane, own) in planes.iter_mut().zip(&own) {
                if own.len() < LEAST {
                    return None;
                }
                let fresh = Plane::fit(own)?;
                let sign = if fresh.normal.dot(plane.normal) < 0.0 {
                    -1.0
                } else {
                    1.0
                };
                *plane = Plane {
                    normal: sign * fresh.normal,
                    offset: sign * fresh.offset,
                };
            }
        }
        let explained = near
            .iter()
            .filter(|&&p| planes.iter().any(|plane| plane.distance(p) < tolerance))
            .count();
        let [a, b] = planes;
        let across = a.normal.cross(b.normal);
        if (explained as f64) < EXPLAINED * near.len() as f64 || across.length() < LEAST_SINE {
            return None;
        }
        let tangent = across.normalize();
        let c = a.normal.dot(b.normal);
        let (da, db) = (a.offset - a.normal.dot(place), b.offset - b.normal.dot(place));
        // The shortest way to both planes lies in the plane of their normals.
        let scale = 1.0 / (1.0 - c * c);
        let on_line = place + scale * ((da - c * db) * a.normal + (db - c * da) * b.normal);
        let (u, v) = (a.normal.cross(tangent), b.normal.cross(tangent));
        let station = Station {
            place: on_line,
            tangent,
            halves: [u, -u, v, -v],
        };
        Some(Pair {
            planes,
            there: there(&station, &near, spacing_mm, tolerance),
            station,
            spacing_mm,
        })
    }

    /// Step 3, both ways.
    fn trace(&self, start: Pair) -> Option<Line> {
        let (ahead, closed) = self.follow(start, 1.0);
        let mut pairs: Vec<Pair> = Vec::new();
        if !closed {
            pairs = self.follow(start, -1.0).0;
            pairs.reverse();
        }
        pairs.push(start);
        pairs.extend(ahead);
        let spacing_mm = median(pairs.iter().map(|p| p.spacing_mm).collect());
        let stations = pairs.iter().map(|p| p.station).collect();
        let rough = Line::new(stations, closed, [true; 4], spacing_mm, self.noise);
        let (low, high) = if closed {
            (0.0, rough.length_mm)
        } else {
            self.ends(&rough)?
        };
        if high - low < SHORTEST * spacing_mm {
            return None;
        }
        let steps = ((high - low) / spacing_mm).round() as usize;
        let count = if closed { steps } else { steps + 1 };
        let even = (0..count)
            .map(|k| rough.at(low + (high - low) * k as f64 / steps as f64))
            .collect();
        let mut line = Line::new(even, closed, [true; 4], spacing_mm, self.noise);
        line.exists = self.half_sheets(&line)?;
        Some(line)
    }

    /// Which half sheets a line has; `None` when it is no crossing.
    fn half_sheets(&self, line: &Line) -> Option<[bool; 4]> {
        let s = line.spacing_mm;
        let mut count = [0usize; 4];
        let mut between = 0;
        for &p in self.points {
            let Some(place) = line.place(p, HALF_OFF.1 * s) else {
                continue;
            };
            let past = place.along_mm < 0.0 || place.along_mm > line.length_mm;
            if past || place.off_mm < HALF_OFF.0 * s {
                continue;
            }
            match place.half {
                Some(h) => count[h as usize] += 1,
                None => between += 1,
            }
        }
        let asked = (HALF_OFF.1 - HALF_OFF.0) * line.length_mm / s;
        let fullest = count.into_iter().max().unwrap_or(0) as f64;
        let full = count.map(|c| c as f64 >= FULL * fullest);
        let clear =
            fullest >= FULLEST * asked && (0..4).all(|h| full[h] || count[h] as f64 <= EMPTY * fullest);
        let all: usize = count.iter().sum();
        let found = full.iter().filter(|f| **f).count();
        (clear && found >= 3 && between as f64 <= BETWEEN * all as f64).then_some(full)
    }

    /// Stations one way; whether it came back to the start.
    fn follow(&self, start: Pair, way: f64) -> (Vec<Pair>, bool) {
        let mut out: Vec<Pair> = Vec::new();
        let mut at = start;
        let mut missed = Vec::new();
        // A line longer than all its points would be going round without closing.
        for step in 0..self.points.len() {
            let expected = at.station.place + way * at.spacing_mm * at.station.tangent;
            let found = self
                .fit(at.planes, expected, self.spacing_at(expected))
                .map(|p| p.turned_like(&at))
                .filter(|p| {
                    p.halves_there() >= 3
                        && p.station.place.distance(expected)
                            <= JUMP * (1 + missed.len()) as f64 * p.spacing_mm
                        && p.station.tangent.dot(at.station.tangent) >= TURN
                });
            let Some(pair) = found else {
                at.station.place = expected;
                at.there = [false; 4];
                missed.push(at);
                if missed.len() > MISSES {
                    break;
                }
                continue;
            };
            out.append(&mut missed);
            let back = pair.station.place.distance(start.station.place);
            let onwards = pair.station.tangent.dot(start.station.tangent) > 0.5;
            if step > 5 && back < 0.8 * pair.spacing_mm && onwards {
                return (out, true);
            }
            out.push(pair);
            at = pair;
        }
        (out, false)
    }

    /// Step 4.
    fn ends(&self, rough: &Line) -> Option<(f64, f64)> {
        let s = rough.spacing_mm;
        let mut range = [(f64::INFINITY, f64::NEG_INFINITY); 2];
        for &p in self.points {
            if let Some(place) = rough.place(p, 2.0 * END_OFF * s)
                && let Some(half) = place.half
                && place.off_mm < END_OFF * s
            {
                let r = &mut range[half as usize / 2];
                *r = (r.0.min(place.along_mm), r.1.max(place.along_mm));
            }
        }
        let end = |a: f64, b: f64| match (a - b).abs() < TOGETHER * s {
            true => a.max(b),
            false => a.min(b),
        };
        let low = -end(-range[0].0, -range[1].0);
        let high = end(range[0].1, range[1].1);
        (low < high).then_some((low, high))
    }
}

impl Pair {
    /// The same with its line running, and its planes turned, as another's.
    fn turned_like(mut self, other: &Pair) -> Self {
        if self.station.tangent.dot(other.station.tangent) < 0.0 {
            self.station.tangent = -self.station.tangent;
        }
        let t = self.station.tangent;
        for k in 0..2 {
            let mut u = self.planes[k].normal.cross(t);
            if u.dot(other.station.halves[2 * k]) < 0.0 {
                u = -u;
            }
            if u.dot(self.station.halves[2 * k]) < 0.0 {
                self.there.swap(2 * k, 2 * k + 1);
            }
            self.station.halves[2 * k] = u;
            self.station.halves[2 * k + 1] = -u;
        }
        self
    }
}

/// The plane with most points within a tolerance, the first of equals.
fn best<'a>(planes: &'a [Plane], points: &'a [DVec3]) -> impl Fn(f64) -> Option<Plane> + 'a {
    move |tolerance| {
        let count = |plane: &Plane| points.iter().filter(|&&p| plane.distance(p) < tolerance).count();
        let counts: Vec<usize> = planes.iter().map(count).collect();
        let most = *counts.iter().max()?;
        let place = counts.iter().position(|&c| c == most)?;
        (most >= LEAST).then_some(planes[place])
    }
}

fn there(station: &Station, near: &[DVec3], spacing_mm: f64, tolerance: f64) -> [bool; 4] {
    let mut count = [[0usize; 2]; 4];
    for &p in near {
        let d = p - station.place;
        let along = d.dot(station.tangent);
        if along.abs() > HALF_ALONG * spacing_mm {
            continue;
        }
        let d = d - along * station.tangent;
        let off = |h: usize| {
            let out = d.dot(station.halves[h]);
            if out > 0.0 {
                (d - out * station.halves[h]).length()
            } else {
                f64::INFINITY
            }
        };
        let h = (0..4).min_by(|&i, &j| off(i).total_cmp(&off(j))).unwrap_or(0);
        let r = d.length() / spacing_mm;
        if off(h) < tolerance && r > HALF_OFF.0 && r < HALF_OFF.1 {
            count[h][usize::from(2.0 * r > HALF_OFF.0 + HALF_OFF.1)] += 1;
        }
    }
    count.map(|[near, far]| near > 0 && far > 0 && near + far >= HALF_POINTS)
}
