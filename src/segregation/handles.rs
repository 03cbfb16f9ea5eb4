//! Handles and tunnels that are too narrow to be believed.
//!
//! In: a closed manifold surface. Out: the places round which a loop of at most [`LONGEST_LOOP`] edges does not bound: a
//! bridge or a tunnel no wider than about three points. Noise makes such handles (two sheets that touch, a gap between
//! neighbours that a curve of the scaffold slips through); a real one this narrow is beyond what the points can show.
//!
//! 1. Only components of positive genus are looked at.
//! 2. Round every vertex the triangles of the vertices up to [`RINGS`] edges away are gathered. They are a disk when
//!    `V - E + F = 1`, counted so that a border that touches itself counts as apart. A disk [`SKIRT`] rings wider holds
//!    those of all vertices within [`SKIRT`] edges, in which no loop can then fail to bound: they are not asked.
//! 3. When they are not: either they have genus themselves, or two of their border loops are joined by the rest of the
//!    surface. Both mean a loop that does not bound; border loops whose other sides are apart (a thin finger, a small
//!    pocket) mean nothing. The floods from the loops take turns, so that a small pocket costs no more than its size.
//!
//! Cost: `O(n)` for genus 0; else a few hundred triangles for every tenth vertex and one flood for each place that is not a
//! disk, of which at most [`MOST_FLOODS`] are made.

use crate::geometry::mesh::DisjointSets;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Edges from the middle vertex to the vertices whose triangles are gathered.
const RINGS: u32 = 4;
/// Rings that a disk may be wider, to answer for its inner vertices as well.
const SKIRT: u32 = 2;
/// The longest loop that such a neighbourhood must close round, edges.
pub const LONGEST_LOOP: u32 = 2 * RINGS + 1;
/// Floods of the whole surface at most, so that a sponge does not cost the square of its size.
const MOST_FLOODS: usize = 400;

/// A narrow handle or tunnel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NarrowHandle {
    /// Mean of the points round it, mm.
    pub place: DVec3,
    /// Rings of neighbours after which the loop closed: its length is about twice that in edges.
    pub rings: u32,
    /// The vertex it was seen from.
    #[serde(skip)]
    pub centre: u32,
    /// The vertices round it.
    #[serde(skip)]
    pub vertices: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// A closed oriented surface with the triangle across each edge.
struct Surface<'a> {
    triangles: &'a [[u32; 3]],
    /// Half-edge `3 t + k` runs from corner `k` to the next; its twin.
    twin: Vec<u32>,
    /// A half-edge out of each vertex.
    out: Vec<u32>,
}

/// Finds them. The surface must be closed, manifold and oriented (others give an empty list).
pub fn narrow_handles(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<NarrowHandle> {
    let Some(surface) = Surface::new(points.len(), triangles) else {
        return Vec::new();
    };
    let genus = surface.has_genus(points.len());
    let mut ball = Ball::new(points.len(), triangles.len());
    let mut done = vec![false; points.len()];
    let mut found = Vec::new();
    let mut floods = 0usize;
    for v in 0..points.len() as u32 {
        if surface.out[v as usize] == NONE || !genus[v as usize] || done[v as usize] || floods >= MOST_FLOODS
        {
            continue;
        }
        let wide = RINGS + SKIRT;
        if ball.grow(&surface, v, wide, wide).is_none() {
            for (&w, &ring) in ball.vertices.iter().zip(&ball.ring) {
                done[w as usize] |= ring <= SKIRT;
            }
            continue;
        }
        if ball.handle_round(&surface, v, RINGS, &mut floods).is_none() {
            continue;
        }
        // The vertex from which it is narrowest; its neighbours see the same handle.
        let seen_from = ball.vertices.clone();
        let (mut centre, mut rings) = (v, RINGS + 1);
        for &w in &seen_from {
            done[w as usize] = true;
            if rings > 1
                && floods < MOST_FLOODS
                && let Some(r) = ball.handle_round(&surface, w, rings - 1, &mut floods)
            {
                (centre, rings) = (w, r);
            }
        }
        ball.handle_round(&surface, centre, rings, &mut floods);
        let n = ball.vertices.len() as f64;
        found.push(NarrowHandle {
            place: ball.vertices.iter().map(|&i| points[i as usize]).sum::<DVec3>() / n,
            rings,
            centre,
            vertices: ball.vertices.clone(),
        });
        for &w in &ball.vertices {
            done[w as usize] = true;
        }
    }
    found.sort_by_key(|h| (h.rings, h.centre));
    found.dedup_by_key(|h| h.centre);
    found
}

impl<'a> Surface<'a> {
    fn new(points: usize, triangles: &'a [[u32; 3]]) -> Option<Self> {
        let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
        let mut out = vec![NONE; points];
        for (t, corners) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let half = (3 * t + k) as u32;
                out[a as usize] = half;
                sides.push((a.min(b), a.max(b), half));
            }
        }
        sides.sort_unstable();
        let mut twin = vec![NONE; 3 * triangles.len()];
        for run in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let [x, y] = run else { return None };
            let from = |half: u32| triangles[half as usize / 3][half as usize % 3];
            if from(x.2) == from(y.2) {
                return None;
            }
            twin[x.2 as usize] = y.2;
            twin[y.2 as usize] = x.2;
        }
        Some(Self { triangles, twin, out })
    }

    fn next(half: u32) -> u32 {
        if half % 3 == 2 { half - 2 } else { half + 1 }
    }

    fn before(half: u32) -> u32 {
        if half.is_multiple_of(3) {
            half + 2
        } else {
            half - 1
        }
    }

    fn from(&self, half: u32) -> u32 {
        self.triangles[half as usize / 3][half as usize % 3]
    }

    fn to(&self, half: u32) -> u32 {
        self.from(Self::next(half))
    }

    /// For every vertex whether its component has positive genus.
    fn has_genus(&self, points: usize) -> Vec<bool> {
        let mut sets = DisjointSets::new(points);
        for t in self.triangles {
            sets.union(t[0], t[1]);
            sets.union(t[0], t[2]);
        }
        // V - E + F with E = 3 F / 2, doubled.
        let mut euler2 = vec![0i64; points];
        for t in self.triangles {
            euler2[sets.find(t[0]) as usize] -= 1;
        }
        for v in 0..points as u32 {
            if self.out[v as usize] != NONE {
                euler2[sets.find(v) as usize] += 2;
            }
        }
        (0..points as u32)
            .map(|v| euler2[sets.find(v) as usize] < 4)
            .collect()
    }
}

/// The triangles round a vertex; buffers reused from vertex to vertex.
struct Ball {
    vertices: Vec<u32>,
    ring: Vec<u32>,
    members: Vec<u32>,
    member: Vec<bool>,
    vertex_seen: Vec<bool>,
    /// Vertices all of whose triangles are members.
    whole: usize,
    /// Flood that has a triangle; `NONE` between questions.
    owner: Vec<u32>,
}

impl Ball {
    fn new(points: usize, triangles: usize) -> Self {
        Self {
            vertices: Vec::new(),
            ring: Vec::new(),
            members: Vec::new(),
            member: vec![false; triangles],
            vertex_seen: vec![false; points],
            whole: 0,
            owner: vec![NONE; triangles],
        }
    }

    fn clear(&mut self) {
        for &t in &self.members {
            self.member[t as usize] = false;
        }
        for &v in &self.vertices {
            self.vertex_seen[v as usize] = false;
        }
        self.members.clear();
        self.vertices.clear();
        self.ring.clear();
        self.whole = 0;
    }

    /// The ring after which a loop that does not bound closes round the vertex, when that is within `most` rings.
    fn handle_round(&mut self, surface: &Surface, v: u32, most: u32, floods: &mut usize) -> Option<u32> {
        let rings = self.first_not_a_disk(surface, v, most)?;
        if self.has_genus_inside(surface) {
            return Some(rings);
        }
        *floods += 1;
        self.borders_meet_outside(surface).then_some(rings)
    }

    /// The first ring after which the triangles are no disk. When they are one after the last ring no shorter loop can be
    /// one that does not bound, so the rings before are looked at only when they are not.
    fn first_not_a_disk(&mut self, surface: &Surface, v: u32, most: u32) -> Option<u32> {
        self.grow(surface, v, most, most)?;
        self.grow(surface, v, 1, most)
    }

    /// Grows ring by ring to `most`; stops with the first ring from `from` on after which the triangles are no disk.
    fn grow(&mut self, surface: &Surface, v: u32, from: u32, most: u32) -> Option<u32> {
        self.clear();
        self.vertices.push(v);
        self.vertex_seen[v as usize] = true;
        self.ring.push(0);
        let mut at = 0;
        for ring in 0..=most {
            while at < self.vertices.len() && self.ring[at] == ring {
                self.take_star(surface, self.vertices[at], ring + 1);
                at += 1;
            }
            if ring >= from && self.euler(surface) != 1 {
                return Some(ring);
            }
        }
        None
    }

    fn take_star(&mut self, surface: &Surface, v: u32, ring: u32) {
        let start = surface.out[v as usize];
        let mut half = start;
        loop {
            let t = half / 3;
            if !self.member[t as usize] {
                self.member[t as usize] = true;
                self.members.push(t);
            }
            let w = surface.to(half);
            if !self.vertex_seen[w as usize] {
                self.vertex_seen[w as usize] = true;
                self.vertices.push(w);
                self.ring.push(ring);
            }
            half = surface.twin[Surface::before(half) as usize];
            if half == start {
                break;
            }
        }
        self.whole += 1;
    }

    /// Border half-edges of the members.
    fn border(&self, surface: &Surface) -> Vec<u32> {
        self.members
            .iter()
            .flat_map(|&t| [3 * t, 3 * t + 1, 3 * t + 2])
            .filter(|&h| !self.member[surface.twin[h as usize] as usize / 3])
            .collect()
    }

    /// `V - E + F` of the members, a vertex counted once for each fan they make round it. Vertices that became whole
    /// without being asked for (all their triangles were taken by others) have no border and are counted as well.
    fn euler(&self, surface: &Surface) -> i64 {
        let border = self.border(surface).len() as i64;
        let mut whole = self.whole as i64;
        for &v in &self.vertices[self.whole..] {
            let start = surface.out[v as usize];
            let mut half = start;
            let mut all = true;
            loop {
                all &= self.member[half as usize / 3];
                half = surface.twin[Surface::before(half) as usize];
                if half == start {
                    break;
                }
            }
            whole += i64::from(all);
        }
        // V = whole + border, E = (3 F + border) / 2.
        whole + (border - self.members.len() as i64) / 2
    }

    /// The border loops: each half-edge's loop number, and the half-edges.
    fn loops(&self, surface: &Surface) -> Vec<Vec<u32>> {
        let mut border = self.border(surface);
        border.sort_unstable();
        let mut used = vec![false; border.len()];
        let mut out = Vec::new();
        for first in 0..border.len() {
            if used[first] {
                continue;
            }
            let mut round = Vec::new();
            let mut half = border[first];
            while let Ok(place) = border.binary_search(&half) {
                if std::mem::replace(&mut used[place], true) {
                    break;
                }
                round.push(half);
                // On from its end: turn through the members round that vertex to the next border half-edge.
                half = Surface::next(half);
                while self.member[surface.twin[half as usize] as usize / 3] {
                    half = Surface::next(surface.twin[half as usize]);
                }
            }
            out.push(round);
        }
        out
    }

    fn has_genus_inside(&self, surface: &Surface) -> bool {
        let loops = self.loops(surface).len() as i64;
        // chi = 2 - 2 g - b
        2 - loops - self.euler(surface) > 0
    }

    /// Whether two border loops are joined by the rest of the surface. The floods from the loops take turns; once all but
    /// one have run dry nothing is left to meet.
    fn borders_meet_outside(&mut self, surface: &Surface) -> bool {
        let loops = self.loops(surface);
        let mut floods: Vec<VecDeque<u32>> = Vec::new();
        let mut touched: Vec<u32> = Vec::new();
        let mut meet = false;
        for (number, round) in loops.iter().enumerate() {
            let mut flood = VecDeque::new();
            for &half in round {
                meet |= self.claim(
                    surface.twin[half as usize] / 3,
                    number as u32,
                    &mut flood,
                    &mut touched,
                );
            }
            floods.push(flood);
        }
        while !meet && floods.iter().filter(|f| !f.is_empty()).count() > 1 {
            for (number, flood) in floods.iter_mut().enumerate() {
                let Some(t) = flood.pop_front() else { continue };
                for half in [3 * t, 3 * t + 1, 3 * t + 2] {
                    let other = surface.twin[half as usize] / 3;
                    meet |=
                        !self.member[other as usize] && self.claim(other, number as u32, flood, &mut touched);
                }
            }
        }
        for t in touched {
            self.owner[t as usize] = NONE;
        }
        meet
    }

    /// Takes a triangle for a flood; `true` when another flood has it.
    fn claim(&mut self, t: u32, number: u32, flood: &mut VecDeque<u32>, touched: &mut Vec<u32>) -> bool {
        let owner = &mut self.owner[t as usize];
        if *owner == NONE {
            *owner = number;
            flood.push_back(t);
            touched.push(t);
        }
        *owner != number
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A torus of `n` by `m` quads, each cut in two.
    fn torus(n: u32, m: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..n {
            for j in 0..m {
                let (a, b) = (
                    TAU * f64::from(i) / f64::from(n),
                    TAU * f64::from(j) / f64::from(m),
                );
                let r = 3.0 + b.cos();
                points.push(DVec3::new(r * a.cos(), r * a.sin(), b.sin()));
                let at = |i: u32, j: u32| (i % n) * m + j % m;
                let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                triangles.extend([[p, q, r], [p, r, s]]);
            }
        }
        (points, triangles)
    }

    #[test]
    fn a_wide_torus_has_none_and_a_narrow_one_has() {
        let (points, triangles) = torus(40, 20);
        assert!(narrow_handles(&points, &triangles).is_empty());
        let (points, triangles) = torus(40, 5);
        let found = narrow_handles(&points, &triangles);
        assert!(!found.is_empty() && found[0].rings <= 3, "{found:?}");
    }

    #[test]
    fn a_thin_finger_is_no_handle() {
        // A tube of five points round, closed at both ends, joined to nothing: genus 0.
        let mut triangles = Vec::new();
        let at = |i: u32, j: u32| 5 * i + j % 5;
        for i in 0..19 {
            for j in 0..5 {
                triangles.extend([
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                    [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                ]);
            }
        }
        for j in 0..5 {
            triangles.extend([[100, at(0, j), at(0, j + 1)], [101, at(19, j + 1), at(19, j)]]);
        }
        let points: Vec<DVec3> = (0..102).map(|i| DVec3::splat(f64::from(i))).collect();
        let surface = Surface::new(points.len(), &triangles).expect("closed and oriented");
        let mut ball = Ball::new(points.len(), triangles.len());
        assert!(ball.first_not_a_disk(&surface, at(9, 0), RINGS).is_some());
        assert!(!ball.has_genus_inside(&surface) && !ball.borders_meet_outside(&surface));
        assert!(narrow_handles(&points, &triangles).is_empty());
    }

    #[test]
    fn an_open_surface_has_none() {
        assert!(narrow_handles(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]).is_empty());
    }
}
