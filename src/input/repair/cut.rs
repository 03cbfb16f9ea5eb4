//! Edges and points taken apart in which a surface touches itself.
//!
//! In: triangles that agree patch by patch ([`mod@super`] has turned them). Out: the same surface, with a copy of a point
//! wherever two parts of it met only in an edge or in a point.
//!
//! Two solids that share an edge bound it with four triangles, as do two limbs of one solid that touch there. Such a mesh
//! encloses a volume, but it is no surface. Which triangles belong together is known from their sides:
//!
//! 1. Triangles round an edge are sorted by angle. Each has the solid before it or behind it, so it ends a solid wedge or
//!    begins one.
//! 2. Beginnings and ends are matched as brackets are, and the two triangles of a wedge are joined: parts that touch are taken
//!    apart, and no solid is cut. (Joining across the empty wedges would glue them together with a bridge without thickness.)
//!    Wedges inside one another belong to shells that overlap; of triangles at one angle an end comes first.
//! 3. The corners at a point that are not connected through edges get a point each; the first keeps the old one.
//! 4. Where two wedges still share both ends (the surface is connected round either), the second is given a point in the middle
//!    of the edge, which cuts its two triangles in two.
//!
//! An edge with more triangles of one kind than of the other stays as it is and so do the corners about it. (Guéziec, Taubin,
//! Lazarus & Horn 2001 cut and stitch alike, without a choice by the solid.)
//!
//! Cost `O(n log n)` for the edges.

use crate::geometry::TriangleMesh;
use crate::geometry::mesh::DisjointSets;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// One triangle at an edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side {
    /// The edge, its smaller end first.
    pub edge: [u32; 2],
    /// The triangle.
    pub triangle: u32,
    /// It runs along the edge from the smaller index to the larger.
    pub forward: bool,
}

/// How often a mesh was taken apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cuts {
    /// Edges of four and more triangles.
    pub edges: usize,
    /// Points that are no end of such an edge.
    pub points: usize,
}

/// Takes the mesh apart where it touches itself; see the module. Points are only added, after the old ones; a triangle cut in
/// two leaves one half in its place and the other at the end.
pub(super) fn cut_apart(mesh: &mut TriangleMesh) -> Cuts {
    let sides = sorted_sides(mesh);
    let mut corners = DisjointSets::new(3 * mesh.triangles.len());
    let mut ends: BTreeSet<u32> = BTreeSet::new();
    let mut cut: Vec<Vec<[Side; 2]>> = Vec::new();
    for run in sides.chunk_by(|a, b| a.edge == b.edge) {
        match solid_wedges(mesh, run) {
            Some(wedges) => {
                ends.extend(run[0].edge);
                for [a, b] in &wedges {
                    join(mesh, &mut corners, *a, *b);
                }
                cut.push(wedges);
            }
            None => run
                .iter()
                .for_each(|&side| join(mesh, &mut corners, run[0], side)),
        }
    }
    // Places of the ends in the triangles, since the points there get new numbers.
    let places: Vec<Vec<[[u32; 2]; 2]>> = cut
        .iter()
        .map(|wedges| {
            wedges
                .iter()
                .map(|wedge| wedge.map(|side| side.edge.map(|end| corner_at(mesh, side.triangle, end))))
                .collect()
        })
        .collect();
    let copied = copy_points(mesh, &mut corners);
    split_shared(mesh, &places);
    Cuts {
        edges: cut.len(),
        points: copied.iter().filter(|p| !ends.contains(p)).count(),
    }
}

/// All sides of all triangles, those of one edge together.
pub(super) fn sorted_sides(mesh: &TriangleMesh) -> Vec<Side> {
    let mut sides: Vec<Side> = mesh
        .triangles
        .iter()
        .enumerate()
        .flat_map(|(i, &[a, b, c])| {
            [(a, b), (b, c), (c, a)].map(|(u, v)| Side {
                edge: [u.min(v), u.max(v)],
                triangle: i as u32,
                forward: u < v,
            })
        })
        .collect();
    sides.sort_unstable();
    sides
}

/// The pairs of triangles with solid between them, when the edge has four triangles or more and as many of each kind.
fn solid_wedges(mesh: &TriangleMesh, run: &[Side]) -> Option<Vec<[Side; 2]>> {
    if run.len() < 4 || 2 * run.iter().filter(|side| side.forward).count() != run.len() {
        return None;
    }
    let [u, v] = run[0].edge.map(|i| mesh.points[i as usize]);
    let axis = (v - u).try_normalize()?;
    let across = |side: &Side| -> Option<DVec3> {
        let corner = mesh.triangles[side.triangle as usize]
            .into_iter()
            .find(|i| !side.edge.contains(i))?;
        let arm = mesh.points[corner as usize] - u;
        (arm - axis * arm.dot(axis)).try_normalize()
    };
    let zero = across(&run[0])?;
    let quarter = axis.cross(zero);
    let mut round: Vec<(f64, Side)> = run
        .iter()
        .map(|side| {
            let arm = across(side)?;
            Some((arm.dot(quarter).atan2(arm.dot(zero)), *side))
        })
        .collect::<Option<_>>()?;
    round.sort_by(|a, b| {
        let ends_first = b.1.forward.cmp(&a.1.forward);
        a.0.total_cmp(&b.0).then(ends_first).then(a.1.cmp(&b.1))
    });
    // Seen along the edge, angles grow from a triangle that runs backward, through solid, up to one that runs forward.
    let mut open = 0;
    let (mut least, mut start) = (0, 0);
    for (i, (_, side)) in round.iter().enumerate() {
        open += if side.forward { -1 } else { 1 };
        if open < least {
            (least, start) = (open, i + 1);
        }
    }
    round.rotate_left(start);
    let mut begun: Vec<Side> = Vec::new();
    let mut wedges = Vec::with_capacity(run.len() / 2);
    for (_, side) in round {
        if side.forward {
            wedges.push([begun.pop()?, side]);
        } else {
            begun.push(side);
        }
    }
    Some(wedges)
}

/// The corner of a triangle at a point: three times the triangle and the place in it.
fn corner_at(mesh: &TriangleMesh, triangle: u32, point: u32) -> u32 {
    let place = mesh.triangles[triangle as usize]
        .iter()
        .position(|&i| i == point)
        .expect("a triangle has both ends of its edge");
    3 * triangle + place as u32
}

/// Joins the corners of two triangles at both ends of their edge.
fn join(mesh: &TriangleMesh, corners: &mut DisjointSets, a: Side, b: Side) {
    for end in a.edge {
        corners.union(corner_at(mesh, a.triangle, end), corner_at(mesh, b.triangle, end));
    }
}

/// Gives every group of corners at a point but the first a point of its own; returns which points were copied.
fn copy_points(mesh: &mut TriangleMesh, corners: &mut DisjointSets) -> BTreeSet<u32> {
    let mut copied = BTreeSet::new();
    let mut owned = vec![false; mesh.points.len()];
    let mut copy = vec![u32::MAX; 3 * mesh.triangles.len()];
    for corner in 0..copy.len() as u32 {
        let (t, k) = (corner as usize / 3, corner as usize % 3);
        let point = mesh.triangles[t][k];
        // The representative of a group is its smallest corner, so it is met before all others of the group.
        let root = corners.find(corner);
        if root == corner {
            copy[corner as usize] = if std::mem::replace(&mut owned[point as usize], true) {
                copied.insert(point);
                add_point(mesh, mesh.points[point as usize])
            } else {
                point
            };
        }
        mesh.triangles[t][k] = copy[root as usize];
    }
    copied
}

fn add_point(mesh: &mut TriangleMesh, at: DVec3) -> u32 {
    mesh.points.push(at);
    mesh.points.len() as u32 - 1
}

/// Gives a middle to every wedge that has both ends in common with one before it at its edge.
fn split_shared(mesh: &mut TriangleMesh, places: &[Vec<[[u32; 2]; 2]>]) {
    // Pieces of triangles that were cut already, by triangle.
    let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let now: Vec<Vec<[u32; 2]>> = places
        .iter()
        .map(|wedges| {
            wedges
                .iter()
                .map(|[first, _]| first.map(|c| mesh.triangles[c as usize / 3][c as usize % 3]))
                .collect()
        })
        .collect();
    for (wedges, edges) in places.iter().zip(&now) {
        for (i, wedge) in wedges.iter().enumerate() {
            if !edges[..i].contains(&edges[i]) {
                continue;
            }
            let [u, v] = edges[i];
            let middle = add_point(mesh, 0.5 * (mesh.points[u as usize] + mesh.points[v as usize]));
            for [corner, _] in wedge {
                let triangle = corner / 3;
                let mine = pieces.entry(triangle).or_insert_with(|| vec![triangle]);
                let whole = *mine
                    .iter()
                    .find(|t| {
                        [u, v]
                            .iter()
                            .all(|end| mesh.triangles[**t as usize].contains(end))
                    })
                    .expect("a side of a triangle is the side of one of its pieces");
                let t = mesh.triangles[whole as usize];
                mesh.triangles[whole as usize] = t.map(|i| if i == u { middle } else { i });
                mine.push(mesh.triangles.len() as u32);
                mesh.triangles.push(t.map(|i| if i == v { middle } else { i }));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit cubes at whole places, with the walls between neighbours left out.
    fn cubes(at: &[[i32; 3]]) -> TriangleMesh {
        let mut points: Vec<[i32; 3]> = Vec::new();
        let mut triangles = Vec::new();
        for &c in at {
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut beside = c;
                    beside[axis] += step;
                    if at.contains(&beside) {
                        continue;
                    }
                    let [mut d, mut e] = [[0; 3]; 2];
                    (d[(axis + 1) % 3], e[(axis + 2) % 3]) = (1, 1);
                    if step < 0 {
                        (d, e) = (e, d);
                    }
                    let mut low = c;
                    low[axis] += step.max(0);
                    let add = |p: [i32; 3], q: [i32; 3]| [p[0] + q[0], p[1] + q[1], p[2] + q[2]];
                    let corner = [low, add(low, d), add(add(low, d), e), add(low, e)].map(|p| {
                        points.iter().position(|q| *q == p).unwrap_or_else(|| {
                            points.push(p);
                            points.len() - 1
                        }) as u32
                    });
                    triangles.push([corner[0], corner[1], corner[2]]);
                    triangles.push([corner[0], corner[2], corner[3]]);
                }
            }
        }
        TriangleMesh {
            points: points
                .iter()
                .map(|p| DVec3::from_array(p.map(f64::from)))
                .collect(),
            triangles,
        }
    }

    /// The mesh after the cut, with its volume checked to be unchanged.
    fn taken_apart(mut mesh: TriangleMesh) -> TriangleMesh {
        let volume = mesh.signed_volume();
        let touching = mesh.topology().nonmanifold_edges;
        assert_eq!(cut_apart(&mut mesh).edges, touching);
        assert!((mesh.signed_volume() - volume).abs() < 1e-12 && volume > 0.0);
        let t = mesh.topology();
        assert!(t.watertight && t.oriented);
        assert_eq!(t.nonmanifold_vertices, 0);
        mesh
    }

    #[test]
    fn two_cubes_that_share_an_edge_become_two() {
        let touching = cubes(&[[0, 0, 0], [1, 1, 0]]);
        assert_eq!(touching.topology().nonmanifold_edges, 1);
        let points = touching.points.len();
        let mesh = taken_apart(touching);
        assert_eq!((mesh.points.len() - points, mesh.topology().components), (2, 2));
    }

    #[test]
    fn a_ring_of_cubes_closed_by_an_edge_opens_there() {
        let ring = [
            [0, 0, 0],
            [1, 0, 0],
            [2, 0, 0],
            [2, 1, 0],
            [2, 2, 0],
            [1, 2, 0],
            [0, 1, 0],
        ];
        let touching = cubes(&ring);
        assert_eq!(touching.topology().nonmanifold_edges, 1);
        let t = taken_apart(touching).topology();
        assert_eq!((t.components, t.euler), (1, 2));
    }

    #[test]
    fn two_cubes_that_share_a_point_become_two() {
        let mut mesh = cubes(&[[0, 0, 0], [1, 1, 1]]);
        assert_eq!(mesh.topology().nonmanifold_vertices, 1);
        assert_eq!(cut_apart(&mut mesh), Cuts { edges: 0, points: 1 });
        let t = mesh.topology();
        assert_eq!((t.nonmanifold_vertices, t.components, t.euler), (0, 2, 4));
    }

    #[test]
    fn a_handle_without_width_is_cut_in_the_middle_of_its_edge() {
        // The solid is connected above and below the edge that two of its parts share, so neither end falls apart.
        let block: Vec<[i32; 3]> = (0..12)
            .map(|i| [i % 2, i / 2 % 2, i / 4])
            .filter(|c| c[2] != 1 || c[0] == c[1])
            .collect();
        let touching = cubes(&block);
        assert_eq!(touching.topology().nonmanifold_edges, 1);
        let (points, triangles) = (touching.points.len(), touching.triangles.len());
        let mesh = taken_apart(touching);
        assert_eq!(
            (mesh.points.len() - points, mesh.triangles.len() - triangles),
            (1, 2)
        );
        let t = mesh.topology();
        assert_eq!((t.components, t.euler), (1, 0));
    }

    #[test]
    fn edges_of_three_and_sound_meshes_stay() {
        let sound = cubes(&[[0, 0, 0], [1, 0, 0]]);
        let mut fin = sound.clone();
        fin.points.push(DVec3::new(-1.0, -1.0, 0.5));
        let [a, b, _] = fin.triangles[0];
        fin.triangles.push([a, b, fin.points.len() as u32 - 1]);
        for given in [sound, fin] {
            let mut mesh = given.clone();
            assert_eq!(cut_apart(&mut mesh), Cuts::default());
            assert_eq!(mesh, given);
        }
    }

    #[test]
    fn shells_that_overlap_at_an_edge_become_two() {
        // A cube and a thinner one about the same edge and inside it: two wedges begin there before one ends.
        let mut mesh = cubes(&[[0, 0, 0]]);
        let base = mesh.points.len() as u32;
        let inner = mesh.clone();
        mesh.triangles
            .extend(inner.triangles.iter().map(|t| t.map(|i| i + base)));
        mesh.points.extend(
            inner
                .points
                .iter()
                .map(|p| DVec3::new(0.3 * p.x + 0.1 * p.y, 0.1 * p.x + 0.3 * p.y, p.z)),
        );
        // The edge x = y = 0 of both.
        for end in 0..base {
            if inner.points[end as usize].truncate() == glam::DVec2::ZERO {
                for t in &mut mesh.triangles {
                    *t = t.map(|i| if i == end + base { end } else { i });
                }
            }
        }
        assert_eq!(mesh.topology().nonmanifold_edges, 1);
        assert_eq!(taken_apart(mesh).topology().components, 2);
    }
}
