//! Holes of a mesh closed with every good triangle kept.
//!
//! In: a mesh with rims, its faces already joined, cleaned and turned alike. Out: [`MendedMesh`]: the mesh closed, or left as
//! it was, and what was changed.
//!
//! 1. The mesh is segregated with its triangles given ([`super::mesh_repair`]): open or closed is decided by the area that a
//!    closing would have to invent, and the holes of a closed one are filled from the tetrahedra between its points.
//! 2. Each connected patch of new triangles whose border is made of rims alone is grafted onto the mesh as it was given, so
//!    that triangles which are no Delaunay facets stay too.
//! 3. A rim left after that, when it is one simple loop, is closed by its triangulation of least area (Barequet & Sharir
//!    1995), found by dynamic programming.
//! 4. When that leaves rims (points that lie on one another lead a patch astray) every rim is closed as in step 3.
//! 5. When rims are still left (edges with three faces, very long rims) the whole segregated surface is taken instead, and every
//!    triangle that it replaces is listed. It must not drop more than one triangle in twenty, though: a surface found anew from
//!    too few points for its thinnest parts would lose them. Then the mesh is left as it was, and that is said.
//!
//! Cost: as for a cloud of its points.

use super::error::SegregationError;
use super::mesh_repair::{Change, ChangeKind, MeshRepairReport, segregate_mesh};
use super::openness::{area, open_edges};
use super::report::CloudReport;
use super::self_check::{Doubt, DoubtKind};
use super::settings::{ClosedOrOpen, SegregationSettings};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::DisjointSets;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// How a mesh was mended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mending {
    /// It had no rims.
    #[default]
    NotNeeded,
    /// All triangles kept, patches added.
    Grafted,
    /// Replaced by the segregated surface.
    Rebuilt,
    /// It is an open surface, and left so.
    LeftOpen,
    /// No way to close it kept its parts: left as it was.
    LeftDamaged,
}

/// Largest part of the triangles that the surface found anew may drop. A bone with damaged patches loses under one in a hundred,
/// neurites thinner than their points are apart one in two.
const MOST_STRAY: f64 = 0.05;

/// A mended mesh.
#[derive(Clone, Debug, Default)]
pub struct MendedMesh {
    /// The mesh; its points are those given.
    pub mesh: TriangleMesh,
    /// What was done.
    pub mending: Mending,
    /// Rim edges before.
    pub rim_edges: usize,
    /// Triangles that a surface found anew from the points would drop, where one was asked for.
    pub would_drop: usize,
    /// The segregation behind it: decision, holes that were filled, rims that were left, doubts, changes (`repair`).
    pub segregation: CloudReport,
}

impl MendedMesh {
    /// What a user should be told: the changes and the doubts.
    pub fn warnings(&self) -> Vec<String> {
        let done = match self.mending {
            Mending::LeftOpen | Mending::LeftDamaged => "not repaired",
            Mending::NotNeeded | Mending::Grafted | Mending::Rebuilt => "repaired",
        };
        let mut out: Vec<String> = self
            .lines()
            .into_iter()
            .map(|line| format!("{done}: {line}"))
            .collect();
        // The doubt about a mesh left damaged is the line itself.
        if self.mending != Mending::LeftDamaged {
            out.extend(self.segregation.doubts.iter().map(|d| d.text.clone()));
        }
        out
    }

    fn changes(&self) -> &MeshRepairReport {
        static NONE: MeshRepairReport = MeshRepairReport {
            given: 0,
            kept: 0,
            added: 0,
            changes: Vec::new(),
        };
        self.segregation.repair.as_ref().unwrap_or(&NONE)
    }

    /// The changes in plain words.
    pub fn lines(&self) -> Vec<String> {
        let mut out = Vec::new();
        match self.mending {
            Mending::NotNeeded => {}
            Mending::Grafted => out.push(format!(
                "{} triangles were added to close {} open edges; every triangle given was kept",
                self.changes().added,
                self.rim_edges
            )),
            Mending::Rebuilt => {
                out.push(format!(
                    "the surface was found anew from its points: {} of {} triangles were kept, {} added",
                    self.changes().kept,
                    self.changes().given,
                    self.changes().added
                ));
                for (kind, what) in [
                    (ChangeKind::Degenerate, "without area were dropped"),
                    (ChangeKind::Duplicate, "that lie on another one were dropped"),
                    (ChangeKind::Turned, "were turned round"),
                    (ChangeKind::Replaced, "were replaced by others in the same place"),
                    (
                        ChangeKind::Stray,
                        "that do not belong to the surface were dropped",
                    ),
                ] {
                    let n = self.changes().changes.iter().filter(|c| c.kind == kind).count();
                    if n > 0 {
                        out.push(format!("{n} triangles {what}"));
                    }
                }
            }
            Mending::LeftDamaged => {
                let t = self.mesh.topology();
                out.push(format!(
                    "{} open edges and {} edges with three or more triangles were left: a surface found anew from the points \
                     would drop {} of {} triangles",
                    t.boundary_edges,
                    t.nonmanifold_edges,
                    self.would_drop,
                    self.mesh.triangles.len()
                ));
            }
            Mending::LeftOpen => out.push(format!(
                "{} open edges were left: {}",
                self.rim_edges, self.segregation.decision.reason
            )),
        }
        if matches!(self.mending, Mending::Grafted | Mending::Rebuilt) {
            for hole in self.segregation.filled_holes.iter().take(10) {
                out.push(format!(
                    "a hole of {:.3} mm^2, {:.3} mm round, was filled at ({:.3}, {:.3}, {:.3})",
                    hole.area_mm2, hole.perimeter_mm, hole.place.x, hole.place.y, hole.place.z
                ));
            }
        }
        out
    }
}

/// Closes the holes of a mesh; see the module.
///
/// # Errors
/// As [`segregate_mesh`].
pub fn mend(mesh: &TriangleMesh, settings: &SegregationSettings) -> Result<MendedMesh, SegregationError> {
    let before = mesh.topology();
    let mut out = MendedMesh {
        mesh: mesh.clone(),
        rim_edges: before.boundary_edges,
        ..Default::default()
    };
    if before.boundary_edges + before.nonmanifold_edges == 0 {
        out.segregation.decision.closed = true;
        out.segregation.decision.reason = "closed as given".to_owned();
        return Ok(out);
    }
    let mut settings = settings.clone();
    if before.boundary_edges == 0 && settings.closed == ClosedOrOpen::Auto {
        settings.closed = ClosedOrOpen::Closed;
    }
    let found = segregate_mesh(&mesh.points, &mesh.triangles, &settings)?;
    let surface: Vec<[u32; 3]> = found
        .cloud
        .segregation
        .triangles
        .iter()
        .map(|t| t.map(|v| found.cloud.source[v.index()]))
        .collect();
    let closed = found.cloud.segregation.closed;
    out.segregation = found.cloud.report;
    if !closed {
        out.mending = Mending::LeftOpen;
        out.segregation.repair = Some(kept_all(mesh, 0));
        return Ok(out);
    }
    let closed_up = |mut mesh: TriangleMesh| {
        for rim in simple_rims(&mesh.triangles) {
            let patch = least_area(&mesh.points, &rim);
            mesh.triangles.extend(patch);
        }
        let after = mesh.topology();
        (after.watertight && after.nonmanifold_vertices <= before.nonmanifold_vertices).then_some(mesh)
    };
    let grafted = closed_up(graft(mesh, &surface)).or_else(|| closed_up(mesh.clone()));
    let stray = |c: &&Change| c.kind == ChangeKind::Stray;
    out.would_drop = found.report.changes.iter().filter(stray).count();
    if let Some(grafted) = grafted {
        let added = grafted.triangles.len() - mesh.triangles.len();
        out.segregation.repair = Some(kept_all(mesh, added));
        // What else was doubted is the surface of the points, of which at most some patches are used.
        out.segregation
            .doubts
            .retain(|d| d.kind == DoubtKind::OpenOrClosed);
        out.mesh = grafted;
        out.mending = Mending::Grafted;
    } else if out.would_drop as f64 <= MOST_STRAY * mesh.triangles.len() as f64 {
        out.segregation.repair = Some(found.report);
        out.mesh.triangles = surface;
        out.mending = Mending::Rebuilt;
    } else {
        out.segregation.repair = Some(kept_all(mesh, 0));
        out.segregation.filled_holes.clear();
        out.mending = Mending::LeftDamaged;
        out.segregation.doubts = vec![Doubt {
            kind: DoubtKind::PartCutOff,
            value: out.would_drop as f64 / mesh.triangles.len() as f64,
            limit: MOST_STRAY,
            place: None,
            text: out.lines().concat(),
        }];
    }
    Ok(out)
}

/// Longest rim that is triangulated by dynamic programming, which takes the cube of its length.
const LONGEST_RIM: usize = 300;

/// Rims that are simple loops, each in the direction in which a patch must run.
fn simple_rims(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let open: BTreeSet<(u32, u32)> = open_edges(triangles).into_iter().collect();
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for t in triangles {
        for (a, b) in edges(*t) {
            if open.contains(&sorted_edge((a, b))) {
                next.entry(b).or_default().push(a);
            }
        }
    }
    let mut out = Vec::new();
    let mut seen: BTreeSet<u32> = BTreeSet::new();
    for &start in next.keys() {
        let mut rim = Vec::new();
        let mut at = start;
        while seen.insert(at) {
            rim.push(at);
            match next.get(&at).map(Vec::as_slice) {
                Some([one]) => at = *one,
                _ => break,
            }
        }
        if at == start && (3..=LONGEST_RIM).contains(&rim.len()) {
            out.push(rim);
        }
    }
    out
}

/// The triangulation of a loop with the least area.
fn least_area(points: &[DVec3], rim: &[u32]) -> Vec<[u32; 3]> {
    let n = rim.len();
    let at = |i: usize, j: usize| i * n + j;
    let mut cost = vec![0.0f64; n * n];
    let mut split = vec![0usize; n * n];
    for width in 2..n {
        for i in 0..n - width {
            let j = i + width;
            cost[at(i, j)] = f64::INFINITY;
            for k in i + 1..j {
                let c = cost[at(i, k)] + cost[at(k, j)] + area(points, [rim[i], rim[k], rim[j]]);
                if c < cost[at(i, j)] {
                    (cost[at(i, j)], split[at(i, j)]) = (c, k);
                }
            }
        }
    }
    let mut out = Vec::with_capacity(n - 2);
    let mut stack = vec![(0, n - 1)];
    while let Some((i, j)) = stack.pop() {
        if j > i + 1 {
            let k = split[at(i, j)];
            out.push([rim[i], rim[k], rim[j]]);
            stack.extend([(i, k), (k, j)]);
        }
    }
    out
}

fn kept_all(mesh: &TriangleMesh, added: usize) -> MeshRepairReport {
    MeshRepairReport {
        given: mesh.triangles.len(),
        kept: mesh.triangles.len(),
        added,
        changes: Vec::new(),
    }
}

fn edges(t: [u32; 3]) -> [(u32, u32); 3] {
    [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]
}

fn sorted_edge((a, b): (u32, u32)) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Step 2: the mesh and those patches of the surface that end at its rims, turned as the mesh is.
fn graft(mesh: &TriangleMesh, surface: &[[u32; 3]]) -> TriangleMesh {
    let key = |mut t: [u32; 3]| {
        t.sort_unstable();
        t
    };
    let given: BTreeSet<[u32; 3]> = mesh.triangles.iter().map(|&t| key(t)).collect();
    let fresh: Vec<[u32; 3]> = surface
        .iter()
        .copied()
        .filter(|&t| !given.contains(&key(t)))
        .collect();
    let rims: BTreeSet<(u32, u32)> = open_edges(&mesh.triangles).into_iter().collect();
    // The way each rim edge runs in its triangle: a patch must run it the other way.
    let mut runs: BTreeSet<(u32, u32)> = BTreeSet::new();
    for t in &mesh.triangles {
        runs.extend(edges(*t).into_iter().filter(|&e| rims.contains(&sorted_edge(e))));
    }
    let mut at_edge: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (i, t) in fresh.iter().enumerate() {
        for e in edges(*t) {
            at_edge.entry(sorted_edge(e)).or_default().push(i as u32);
        }
    }
    // Patches join across edges that are not rims.
    let mut patches = DisjointSets::new(fresh.len());
    for (edge, members) in &at_edge {
        if let ([a, b], false) = (&members[..], rims.contains(edge)) {
            patches.union(*a, *b);
        }
    }
    let mut fits = vec![true; fresh.len()];
    let mut turned = vec![false; fresh.len()];
    for (edge, members) in &at_edge {
        for &m in members {
            let patch = patches.find(m) as usize;
            if rims.contains(edge) {
                fits[patch] &= members.len() == 1;
                turned[patch] |= edges(fresh[m as usize]).iter().any(|e| runs.contains(e));
            } else {
                fits[patch] &= members.len() == 2;
            }
        }
    }
    let mut out = mesh.clone();
    for (i, &[a, b, c]) in fresh.iter().enumerate() {
        let patch = patches.find(i as u32) as usize;
        if fits[patch] {
            out.triangles
                .push(if turned[patch] { [a, c, b] } else { [a, b, c] });
        }
    }
    out
}
