//! A validator that shares no code with the triangulation: predicates in whole numbers of any size, topology
//! recomputed from scratch.
#![allow(dead_code)]

use super::exact::{self, Point};
use glam::DVec3;
use medial_scaffold::delaunay::{Facet, INFINITE, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

/// Point sets up to this size are checked against every point instead of across facets only.
const BRUTE: usize = 24;

macro_rules! ensure {
    ($condition:expr, $($message:tt)*) => {
        if !$condition {
            return Err(format!($($message)*));
        }
    };
}

/// Everything a canonical Delaunay triangulation must be.
pub fn check(t: &Triangulation, input: &[DVec3]) -> Result<(), String> {
    points_are_the_set(t, input)?;
    let points = exact::whole(&t.points);
    let dimension = dimension(&points);
    ensure!(
        t.dimension == dimension,
        "dimension {} is {dimension}",
        t.dimension
    );
    if dimension < 3 {
        ensure!(t.num_tets() == 0, "tetrahedra of flat points");
        return Ok(());
    }
    topology(t)?;
    numbering(t)?;
    geometry(t, &points)
}

fn points_are_the_set(t: &Triangulation, input: &[DVec3]) -> Result<(), String> {
    let mut set: Vec<[f64; 3]> = input.iter().map(|p| p.to_array().map(|v| v + 0.0)).collect();
    set.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    set.dedup();
    ensure!(
        t.points.iter().map(|p| p.to_array()).eq(set),
        "points are not the sorted input"
    );
    Ok(())
}

fn dimension(points: &[Point]) -> u8 {
    let n = points.len();
    if n < 2 {
        return 0;
    }
    let Some(c) = (2..n).find(|&c| !exact::collinear(&points[0], &points[1], &points[c])) else {
        return 1;
    };
    let spans = |d: usize| exact::orient3d(&points[0], &points[1], &points[c], &points[d]) != 0;
    if (2..n).any(spans) { 3 } else { 2 }
}

/// Facets meet in pairs, each pair with opposite orientation; every vertex is used; a ball by its Euler numbers.
fn topology(t: &Triangulation) -> Result<(), String> {
    let mut edges = BTreeSet::new();
    let mut triangles = BTreeSet::new();
    let mut hull_edges: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let mut hull = 0i64;
    let mut hull_vertices = BTreeSet::new();
    let mut used = BTreeSet::new();
    for tet in t.tets() {
        let v = t.tet(tet);
        let infinite = v.iter().filter(|&&x| x == INFINITE).count();
        ensure!(
            infinite == usize::from(!t.is_finite(tet)),
            "{tet}: {v:?} has {infinite} infinite vertices"
        );
        ensure!(
            infinite == 0 || v[3] == INFINITE,
            "{tet}: infinite vertex not last"
        );
        for index in 0..4u8 {
            let facet = Facet { tet, index };
            let other = t.mirror(facet);
            ensure!(
                t.mirror(other) == facet && other.tet != tet,
                "{facet:?} and {other:?} are not mirrors"
            );
            let [a, b, c] = t.facet_vertices(facet);
            let back = t.facet_vertices(other);
            ensure!(
                [[a, c, b], [c, b, a], [b, a, c]].contains(&back),
                "{facet:?} {:?} does not match {back:?}",
                [a, b, c]
            );
        }
        if infinite == 0 {
            for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
                edges.insert((v[i].min(v[j]), v[i].max(v[j])));
            }
            for k in 0..4 {
                let mut f = t.facet_vertices(Facet { tet, index: k });
                f.sort_unstable();
                triangles.insert(f);
            }
            used.extend(v);
        } else {
            hull += 1;
            for k in 0..3 {
                hull_vertices.insert(v[k]);
                *hull_edges.entry((v[k].0, v[(k + 1) % 3].0)).or_default() += 1;
            }
        }
    }
    ensure!(
        used.len() == t.points.len(),
        "{} of {} points are vertices",
        used.len(),
        t.points.len()
    );
    let euler = used.len() as i64 - edges.len() as i64 + triangles.len() as i64 - t.num_finite() as i64;
    ensure!(euler == 1, "Euler number {euler} of the triangulation");
    ensure!(
        hull_edges
            .iter()
            .all(|(&(a, b), &n)| n == 1 && hull_edges.contains_key(&(b, a))),
        "hull is not a closed oriented surface"
    );
    let euler = hull_vertices.len() as i64 - hull_edges.len() as i64 / 2 + hull;
    ensure!(euler == 2, "Euler number {euler} of the hull");
    Ok(())
}

/// Finite before ghosts, both sorted; smallest vertex first, next smallest second (ghosts: infinite last).
fn numbering(t: &Triangulation) -> Result<(), String> {
    let mut last = None;
    for tet in t.tets() {
        let v = t.tet(tet);
        let key = (v[3] == INFINITE, v);
        ensure!(last < Some(key), "{tet}: {v:?} out of order");
        last = Some(key);
        ensure!(
            v[0] == *v.iter().min().expect("four"),
            "{tet}: {v:?} does not start with the smallest"
        );
        ensure!(
            v[3] == INFINITE || (v[1] < v[2] && v[1] < v[3]),
            "{tet}: {v:?} is not rotated"
        );
    }
    Ok(())
}

/// Positive orientation, convex hull, empty spheres (all points for small sets, across facets for large ones).
fn geometry(t: &Triangulation, points: &[Point]) -> Result<(), String> {
    for tet in t.tets() {
        let v = t.tet(tet);
        let [a, b, c] = [v[0], v[1], v[2]].map(|v| &points[v.index()]);
        let others: Vec<usize> = if points.len() <= BRUTE {
            (0..points.len())
                .filter(|&i| v.iter().all(|x| x.0 as usize != i))
                .collect()
        } else {
            (0..4u8)
                .map(|index| t.mirror(Facet { tet, index }))
                .map(|f| t.tet(f.tet)[f.index as usize])
                .filter(|&v| v != INFINITE)
                .map(|v| v.index())
                .collect()
        };
        if t.is_finite(tet) {
            let d = &points[v[3].index()];
            ensure!(
                exact::orient3d(a, b, c, d) == 1,
                "{tet} is not positively oriented"
            );
            for i in others {
                let s = exact::insphere(a, b, c, d, &points[i]);
                ensure!(s != 1, "point {i} lies in the sphere of {tet} {v:?}");
            }
        } else {
            for i in others {
                let s = exact::orient3d(a, b, c, &points[i]);
                ensure!(s != 1, "point {i} lies beyond the hull triangle {v:?}");
            }
        }
    }
    Ok(())
}
