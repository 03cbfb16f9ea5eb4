//! Repair of a mesh, only when asked for, with a list of what was changed.
//!
//! In: a mesh as read. Out: the mesh with equal points joined, useless faces dropped, all faces turned one way and outward; maps
//! from old to new points and faces; counts of every change.
//!
//! 1. Points of equal coordinates (or nearer than a tolerance) become one.
//! 2. Faces with a repeated point are dropped. Faces on the same three points are dropped but for one, or altogether when they
//!    cancel (two faces back to back enclose nothing), unless the whole mesh is a sheet given with both its sides. Faces
//!    without area on three points stay: they hold the surface closed.
//! 3. Faces are turned to agree across every edge with two faces ([`orient`]).
//! 4. Walls and fins that bound nothing are dropped ([`walls`]).
//! 5. Where the surface touches itself in an edge or in a point it is taken apart ([`cut`]); points there are copied.
//! 6. A closed component that no other encloses is turned outward. One that lies inside another keeps the turn the file gave it
//!    relative to the outermost (a cavity stays a cavity), and becomes a cavity when the file gave it none.
//! 7. Points that no face uses are dropped.
//!
//! No face is added: holes stay holes and edges with three faces stay so; [`mod@super::check`] names them.
//! Cost `O(n log n)`, and `O(c)` winding numbers for each of `c` closed components.

mod cut;
mod orient;
mod walls;

use crate::geometry::{Neighbours, TriangleMesh, mesh::DisjointSets};
use cut::cut_apart;
use orient::{agree_patches, turn_outward};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use walls::without_walls;

/// What repair may do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RepairSettings {
    /// Points nearer than this are joined, mm; 0 joins exactly equal ones only.
    pub weld_mm: f64,
    /// Turn faces to agree and outward.
    pub orient: bool,
}

impl Default for RepairSettings {
    fn default() -> Self {
        Self {
            weld_mm: 0.0,
            orient: true,
        }
    }
}

/// No new element: the old one was dropped.
pub const DROPPED: u32 = u32::MAX;

/// A repaired mesh and what was changed.
#[derive(Clone, Debug, Default)]
pub struct Repaired {
    /// The mesh.
    pub mesh: TriangleMesh,
    /// New point of every old one, or [`DROPPED`]; the first copy where there are several.
    pub point_map: Vec<u32>,
    /// New triangle of every old one, or [`DROPPED`].
    pub triangle_map: Vec<u32>,
    /// What was changed.
    pub changes: RepairChanges,
}

/// Counts of the changes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RepairChanges {
    /// Points joined to another.
    pub welded_points: usize,
    /// Points dropped because no face uses them.
    pub unused_points: usize,
    /// Faces dropped because two of their corners are one point.
    pub degenerate_triangles: usize,
    /// Faces dropped because another has the same three points.
    pub duplicate_triangles: usize,
    /// Faces turned round.
    pub turned_triangles: usize,
    /// Faces dropped because they bound nothing: walls that divide a solid, small fins that hang on it.
    #[serde(default)]
    pub wall_triangles: usize,
    /// Edges of four or more faces, where the surface touched itself, that were taken apart into edges of two.
    #[serde(default)]
    pub cut_edges: usize,
    /// Other points in which the surface touched itself; they were doubled.
    #[serde(default)]
    pub cut_points: usize,
    /// Components that cannot be oriented (one-sided surfaces) and were left as they are.
    pub one_sided_components: usize,
}

impl RepairChanges {
    /// The changes in plain words; empty when there were none.
    pub fn lines(&self) -> Vec<String> {
        [
            (
                self.welded_points,
                "points were joined to another at the same place",
            ),
            (
                self.degenerate_triangles,
                "triangles with two equal corners were dropped",
            ),
            (
                self.duplicate_triangles,
                "triangles that lie on another one were dropped",
            ),
            (self.turned_triangles, "triangles were turned round"),
            (
                self.wall_triangles,
                "triangles of walls and fins that bound nothing were dropped",
            ),
            (
                self.cut_edges,
                "edges in which the surface touches itself were taken apart",
            ),
            (
                self.cut_points,
                "points in which the surface touches itself were taken apart",
            ),
            (self.unused_points, "points that no triangle uses were dropped"),
            (
                self.one_sided_components,
                "one-sided components cannot be oriented and were left as they are",
            ),
        ]
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, what)| format!("{n} {what}"))
        .collect()
    }
}

/// Repairs a mesh; see the module's documentation.
pub fn repair(mesh: &TriangleMesh, settings: &RepairSettings) -> Repaired {
    let mut changes = RepairChanges::default();
    let welded = weld(mesh, settings.weld_mm);
    changes.welded_points = welded
        .iter()
        .enumerate()
        .filter(|(i, w)| *i != **w as usize)
        .count();
    let joined: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| welded[v as usize]))
        .collect();
    let mut triangle_map: Vec<u32> = (0..joined.len() as u32).collect();
    let kept = kept_triangles(&joined, &mut changes);
    let mut out = TriangleMesh {
        points: mesh.points.clone(),
        triangles: joined,
    };
    keep_triangles(&mut out.triangles, &kept, &mut triangle_map);
    if settings.orient {
        let mut turned = agree_patches(&mut out);
        let kept = without_walls(&out);
        changes.wall_triangles = kept.iter().filter(|k| !**k).count();
        keep_triangles(&mut out.triangles, &kept, &mut triangle_map);
        retain(&mut turned, &kept);
        let cuts = cut_apart(&mut out);
        (changes.cut_edges, changes.cut_points) = (cuts.edges, cuts.points);
        turned.resize(out.triangles.len(), false);
        let last = turn_outward(&mut out, &turned);
        changes.one_sided_components = last.one_sided_components;
        changes.turned_triangles = turned.iter().zip(&last.turned).filter(|(a, b)| a != b).count();
    }
    let point_map = drop_unused(&mut out, &welded, &mut changes);
    Repaired {
        mesh: out,
        point_map,
        triangle_map,
        changes,
    }
}

/// Drops triangles, and says so in the map from those of the file.
fn keep_triangles(triangles: &mut Vec<[u32; 3]>, kept: &[bool], map: &mut [u32]) {
    let mut next = 0;
    let slots: Vec<u32> = kept
        .iter()
        .map(|&k| {
            next += u32::from(k);
            if k { next - 1 } else { DROPPED }
        })
        .collect();
    for slot in map.iter_mut().filter(|slot| **slot != DROPPED) {
        *slot = slots[*slot as usize];
    }
    retain(triangles, kept);
}

fn retain<T>(items: &mut Vec<T>, kept: &[bool]) {
    let mut each = kept.iter();
    items.retain(|_| *each.next().expect("as many as items"));
}

/// Which triangles stay: those with three corners, and of those on the same corners what is left when opposite ones cancel.
fn kept_triangles(triangles: &[[u32; 3]], changes: &mut RepairChanges) -> Vec<bool> {
    // Sorted by corners; with them whether the turn is that of the sorted corners.
    let mut keyed: Vec<([u32; 3], u32, bool)> = triangles
        .iter()
        .enumerate()
        .map(|(i, &[a, b, c])| {
            let mut key = [a, b, c];
            key.sort_unstable();
            (key, i as u32, [[a, b, c], [b, c, a], [c, a, b]].contains(&key))
        })
        .collect();
    keyed.sort_unstable();
    let sound = |key: &[u32; 3]| key[0] != key[1] && key[1] != key[2];
    let groups = || keyed.chunk_by(|a, b| a.0 == b.0).filter(|g| sound(&g[0].0));
    let net = |g: &[([u32; 3], u32, bool)]| 2 * g.iter().filter(|f| f.2).count() as i64 - g.len() as i64;
    // A sheet given with both its sides cancels as a whole; then one side of each face is kept.
    let two_sided = groups().all(|g| net(g) == 0);
    let mut kept = vec![false; triangles.len()];
    for g in groups() {
        let side = match net(g) {
            0 if two_sided => Some(g[0].2),
            0 => None,
            n => Some(n > 0),
        };
        if let Some(first) = g.iter().find(|f| Some(f.2) == side) {
            kept[first.1 as usize] = true;
        }
    }
    changes.degenerate_triangles = keyed.iter().filter(|f| !sound(&f.0)).count();
    changes.duplicate_triangles =
        triangles.len() - changes.degenerate_triangles - kept.iter().filter(|k| **k).count();
    kept
}

/// For every point the smallest index among those joined with it.
fn weld(mesh: &TriangleMesh, tolerance_mm: f64) -> Vec<u32> {
    let mut sets = DisjointSets::new(mesh.points.len());
    if tolerance_mm > 0.0 {
        let tree = Neighbours::new(&mesh.points);
        for (i, &p) in mesh.points.iter().enumerate() {
            for n in tree.within(p, tolerance_mm) {
                sets.union(i as u32, n.index);
            }
        }
    } else {
        let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.points.len());
        for (i, &p) in mesh.points.iter().enumerate() {
            let key = (p + glam::DVec3::ZERO).to_array().map(f64::to_bits); // -0 is 0
            let twin = *first.entry(key).or_insert(i as u32);
            sets.union(i as u32, twin);
        }
    }
    (0..mesh.points.len() as u32).map(|i| sets.find(i)).collect()
}

fn drop_unused(mesh: &mut TriangleMesh, welded: &[u32], changes: &mut RepairChanges) -> Vec<u32> {
    let mut slot = vec![DROPPED; mesh.points.len()];
    for &v in mesh.triangles.iter().flatten() {
        slot[v as usize] = 0;
    }
    let mut points = Vec::new();
    for (i, s) in slot.iter_mut().enumerate() {
        if *s == 0 {
            *s = points.len() as u32;
            points.push(mesh.points[i]);
        } else if welded[i] as usize == i {
            changes.unused_points += 1;
        }
    }
    for t in &mut mesh.triangles {
        *t = t.map(|v| slot[v as usize]);
    }
    mesh.points = points;
    welded.iter().map(|&w| slot[w as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn tetrahedron(scale: f64) -> TriangleMesh {
        TriangleMesh {
            points: [
                [-1.0, -1.0, -1.0],
                [3.0, -1.0, -1.0],
                [-1.0, 3.0, -1.0],
                [-1.0, -1.0, 3.0],
            ]
            .map(|p| DVec3::from_array(p) * scale)
            .to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        }
    }

    fn joined(parts: &[TriangleMesh]) -> TriangleMesh {
        let mut out = TriangleMesh::default();
        for p in parts {
            let base = out.points.len() as u32;
            out.points.extend(&p.points);
            out.triangles
                .extend(p.triangles.iter().map(|t| t.map(|i| i + base)));
        }
        out
    }

    #[test]
    fn a_sound_mesh_is_left_alone() {
        let mesh = tetrahedron(1.0);
        let fixed = repair(&mesh, &RepairSettings::default());
        assert_eq!((fixed.mesh, fixed.changes), (mesh, RepairChanges::default()));
        assert_eq!(fixed.point_map, [0, 1, 2, 3]);
    }

    #[test]
    fn a_soup_with_every_fault_comes_out_closed_and_outward() {
        let sound = tetrahedron(1.0);
        let mut soup = TriangleMesh::default();
        for (i, t) in sound.triangles.iter().enumerate() {
            let base = soup.points.len() as u32;
            soup.points.extend(t.map(|v| sound.points[v as usize]));
            soup.triangles.push(if i == 1 {
                [base, base + 2, base + 1]
            } else {
                [base, base + 1, base + 2]
            });
        }
        soup.triangles.push([0, 0, 1]);
        soup.triangles.push(soup.triangles[2]);
        soup.points.push(DVec3::splat(9.0));
        let fixed = repair(&soup, &RepairSettings::default());
        let t = fixed.mesh.topology();
        assert!(t.watertight && t.oriented);
        assert!((fixed.mesh.signed_volume() - sound.signed_volume()).abs() < 1e-12);
        let expected = RepairChanges {
            welded_points: 8,
            unused_points: 1,
            degenerate_triangles: 1,
            duplicate_triangles: 1,
            turned_triangles: 1,
            wall_triangles: 0,
            cut_edges: 0,
            cut_points: 0,
            one_sided_components: 0,
        };
        assert_eq!(fixed.changes, expected);
        assert_eq!(fixed.triangle_map, [0, 1, 2, 3, DROPPED, DROPPED]);
        for (old, &new) in fixed.point_map.iter().enumerate().take(12) {
            assert_eq!(fixed.mesh.points[new as usize], soup.points[old]);
        }
        assert_eq!(fixed.point_map[12], DROPPED);
    }

    #[test]
    fn faces_back_to_back_cancel_but_a_two_sided_sheet_keeps_one_side() {
        let mut pillow = tetrahedron(1.0);
        pillow
            .points
            .extend([DVec3::X * 9.0, DVec3::X * 9.5, DVec3::Y * 9.0]);
        pillow.triangles.extend([[4, 5, 6], [5, 4, 6]]);
        let fixed = repair(&pillow, &RepairSettings::default());
        assert_eq!(fixed.mesh, tetrahedron(1.0));
        assert_eq!(
            (fixed.changes.duplicate_triangles, fixed.changes.unused_points),
            (2, 3)
        );
        let mut sheet = tetrahedron(1.0);
        sheet.triangles = vec![[0, 1, 2], [1, 3, 2], [2, 1, 0], [3, 1, 2]];
        let fixed = repair(&sheet, &RepairSettings::default());
        assert_eq!(fixed.mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
    }

    #[test]
    fn solids_that_share_an_edge_are_taken_apart_and_turned_outward() {
        // Two tetrahedra about the edge from 0 to 3, the second on the other side of it, and one of its faces turned.
        let one = tetrahedron(1.0);
        let mut both = one.clone();
        both.points
            .extend([DVec3::new(-5.0, -1.0, -1.0), DVec3::new(-1.0, -5.0, -1.0)]);
        both.triangles
            .extend(one.triangles.iter().map(|t| t.map(|i| [0, 4, 5, 3][i as usize])));
        both.triangles[6].swap(0, 1);
        assert_eq!(both.topology().nonmanifold_edges, 1);
        let fixed = repair(&both, &RepairSettings::default());
        assert_eq!(
            fixed.changes,
            RepairChanges {
                cut_edges: 1,
                turned_triangles: 1,
                ..Default::default()
            }
        );
        let t = fixed.mesh.topology();
        assert!(t.watertight && t.oriented);
        assert_eq!((t.components, t.nonmanifold_vertices), (2, 0));
        let volume = 2.0 * one.signed_volume();
        assert!((fixed.mesh.signed_volume() - volume).abs() < 1e-12);
        assert_eq!(fixed.mesh.points.len(), both.points.len() + 2);
        assert_eq!(fixed.point_map, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn walls_and_small_fins_are_dropped_and_sheets_that_meet_stay() {
        // Two tetrahedra on one face, the wall between them left in; a fin on an edge; both parts of a wider mesh.
        let mut mesh = tetrahedron(1.0);
        mesh.points.push(DVec3::splat(4.0));
        mesh.triangles.extend([[1, 4, 3], [2, 4, 1], [3, 4, 2]]);
        mesh.triangles.swap(0, 2);
        let solid = {
            let mut solid = mesh.clone();
            solid.triangles.remove(0);
            solid
        };
        assert!(solid.topology().watertight && solid.signed_volume() > 0.0);
        let with_wall = repair(&mesh, &RepairSettings::default());
        assert_eq!((&with_wall.mesh, with_wall.changes.wall_triangles), (&solid, 1));
        assert_eq!(with_wall.triangle_map, [DROPPED, 0, 1, 2, 3, 4, 5]);
        let mut with_fin = solid.clone();
        with_fin.points.push(DVec3::new(-1.1, -1.1, -1.0));
        with_fin.triangles.push([0, 3, 5]);
        let fixed = repair(&with_fin, &RepairSettings::default());
        assert_eq!((&fixed.mesh, fixed.changes.wall_triangles), (&solid, 1));
        // Three pages on one back: no page is a fin.
        let book = TriangleMesh {
            points: [
                [0., 0., 0.],
                [0., 0., 1.],
                [1., 0., 0.],
                [0., 1., 0.],
                [-1., -1., 0.],
            ]
            .map(DVec3::from_array)
            .to_vec(),
            triangles: vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]],
        };
        assert_eq!(repair(&book, &RepairSettings::default()).mesh, book);
    }

    #[test]
    fn cavities_stay_cavities_and_solids_solids() {
        let (outer, mut inner) = (tetrahedron(1.0), tetrahedron(0.2));
        inner.flip();
        let hollow = outer.signed_volume() + inner.signed_volume();
        let mut inward = joined(&[outer.clone(), inner.clone()]);
        inward.flip();
        let fixed = repair(&inward, &RepairSettings::default());
        assert!((fixed.mesh.signed_volume() - hollow).abs() < 1e-12);
        // Both outward by the file: stays so.
        let solid = joined(&[outer.clone(), tetrahedron(0.2)]);
        let fixed = repair(&solid, &RepairSettings::default());
        assert_eq!(fixed.changes, RepairChanges::default());
        // The inner one given no orientation: a cavity.
        let mut mixed = joined(&[outer, tetrahedron(0.2)]);
        mixed.triangles[5].swap(0, 1);
        let fixed = repair(&mixed, &RepairSettings::default());
        assert!((fixed.mesh.signed_volume() - hollow).abs() < 1e-12);
    }

    #[test]
    fn random_soups_are_taken_apart_and_keep_their_area() {
        use rand::{RngExt, SeedableRng};
        for seed in 0..400 {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let n = rng.random_range(4..9u32);
            let mut coordinate = || f64::from(rng.random_range(-1000..1000));
            let points = (0..n)
                .map(|_| DVec3::new(coordinate(), coordinate(), coordinate()))
                .collect();
            let triangles = (0..rng.random_range(4..40))
                .map(|_| [0; 3].map(|_| rng.random_range(0..n)))
                .collect();
            let soup = TriangleMesh { points, triangles };
            let fixed = repair(&soup, &RepairSettings::default());
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| soup.points[i as usize]);
                0.5 * (b - a).cross(c - a).length()
            };
            let kept = soup.triangles.iter().zip(&fixed.triangle_map);
            let kept: f64 = kept
                .filter(|(_, new)| **new != DROPPED)
                .map(|(t, _)| area(t))
                .sum();
            assert!((fixed.mesh.area() - kept).abs() <= 1e-9 * kept, "soup {seed}");
        }
    }

    #[test]
    fn near_points_are_joined_within_the_tolerance_only() {
        let mut mesh = tetrahedron(1.0);
        mesh.points.push(mesh.points[0] + DVec3::X * 1e-3);
        mesh.triangles[3][0] = 4;
        assert!(
            !repair(&mesh, &RepairSettings::default())
                .mesh
                .topology()
                .watertight
        );
        let settings = RepairSettings {
            weld_mm: 2e-3,
            ..Default::default()
        };
        assert!(repair(&mesh, &settings).mesh.topology().watertight);
    }
}
