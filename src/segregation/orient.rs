//! Orientation of an open surface, as far as one exists.
//!
//! In: triangles. Out: the same triangles, each component turned alike from its first triangle on across edges with two
//! triangles and, where sheets cross, from each half sheet to the one that goes straight on, and whether that met no contradiction (a Moebius band does). Closed components are turned outward by their
//! signed volume. `O(n log n)`.

use super::openness::area;
use crate::geometry::mesh::{Side, sides};
use glam::DVec3;

/// Oriented triangles.
#[derive(Clone, Debug, Default)]
pub struct Oriented {
    /// The triangles, in the order given.
    pub triangles: Vec<[u32; 3]>,
    /// Whether every component is orientable.
    pub orientable: bool,
}

/// Propagates orientation; see the module.
pub fn orient(points: &[DVec3], triangles: &[[u32; 3]]) -> Oriented {
    let sides = sides(triangles);
    // Neighbours across manifold edges, with whether both run the edge the same way (then one must be turned).
    let mut links: Vec<Vec<(u32, bool)>> = vec![Vec::new(); triangles.len()];
    for run in sides.chunk_by(|a, b| a.edge == b.edge) {
        for (a, b) in straight_on(points, triangles, run) {
            let turn = a.forward == b.forward;
            links[a.triangle as usize].push((b.triangle, turn));
            links[b.triangle as usize].push((a.triangle, turn));
        }
    }
    let mut out = Oriented {
        triangles: triangles.to_vec(),
        orientable: true,
    };
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    for start in 0..triangles.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut members = vec![start];
        let mut at = 0;
        while at < members.len() {
            let t = members[at];
            at += 1;
            let own = turned[t].expect("members are turned or not");
            for &(next, turn) in &links[t] {
                match turned[next as usize] {
                    None => {
                        turned[next as usize] = Some(own != turn);
                        members.push(next as usize);
                    }
                    Some(state) => out.orientable &= state == (own != turn),
                }
            }
        }
        for &t in &members {
            if turned[t] == Some(true) {
                out.triangles[t].swap(1, 2);
            }
        }
        turn_outward(points, &mut out.triangles, &members);
    }
    out
}

/// Least cosine between one triangle and the straight continuation of another across an edge with more than two (45 degrees).
const STRAIGHT: f64 = 0.7;

/// The triangles at an edge that are one surface: both of two; of more, those that go straight on, the straightest first.
fn straight_on(points: &[DVec3], triangles: &[[u32; 3]], run: &[Side]) -> Vec<(Side, Side)> {
    match run {
        [_] => Vec::new(),
        [a, b] => vec![(*a, *b)],
        _ => {
            let (i, j) = run[0].edge;
            let (from, to) = (points[i as usize], points[j as usize]);
            let along = (to - from).normalize_or_zero();
            let away = |s: &Side| {
                let third = triangles[s.triangle as usize]
                    .into_iter()
                    .find(|&v| v != i && v != j);
                let d = third.map_or(DVec3::ZERO, |v| points[v as usize] - from);
                (d - d.dot(along) * along).normalize_or_zero()
            };
            let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
            for m in 0..run.len() {
                for n in 0..m {
                    pairs.push((-away(&run[m]).dot(away(&run[n])), n, m));
                }
            }
            pairs.sort_by(|p, q| q.0.total_cmp(&p.0).then((p.1, p.2).cmp(&(q.1, q.2))));
            let mut taken = vec![false; run.len()];
            let mut out = Vec::new();
            for (straightness, n, m) in pairs {
                if straightness >= STRAIGHT && !taken[n] && !taken[m] {
                    (taken[n], taken[m]) = (true, true);
                    out.push((run[n], run[m]));
                }
            }
            out
        }
    }
}

/// A component is turned so that its signed volume about its centroid is positive: outward when it is closed, away from
/// the side it bulges to when it is open.
fn turn_outward(points: &[DVec3], triangles: &mut [[u32; 3]], members: &[usize]) {
    let mut weight = 0.0;
    let mut centre = DVec3::ZERO;
    for &t in members {
        let a = area(points, triangles[t]);
        weight += a;
        centre += a * triangles[t].iter().map(|&i| points[i as usize]).sum::<DVec3>() / 3.0;
    }
    if weight <= 0.0 {
        return;
    }
    centre /= weight;
    let volume: f64 = members
        .iter()
        .map(|&t| {
            let [a, b, c] = triangles[t].map(|i| points[i as usize] - centre);
            a.dot(b.cross(c))
        })
        .sum();
    if volume < 0.0 {
        for &t in members {
            triangles[t].swap(1, 2);
        }
    }
}
