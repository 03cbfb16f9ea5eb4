//! Looking at a shape before any work: what is in the file, and is it usable.
//!
//! In: a [`Shape`] as read. Out: a [`CheckReport`] with counts, sizes, orientation, self-intersections, labels, a list of
//! problems with their remedies, and for each use whether the shape is fit for it and why. Nothing is changed. `usable` is false
//! when it is fit for none: an open or one-sided sheet has a scaffold, though no volume to change.
//!
//! Cost `O(n log n)`; self-intersections by bounding boxes, exact signs decide.

use super::{
    sampling::cloud,
    shape::{Geometry, LabelMap, PointCloud, Provenance, Shape},
};
use crate::geometry::{MeshTopology, TriangleMesh, mesh::bounds};
use glam::DVec3;
use parry3d_f64::{
    bounding_volume::Aabb,
    partitioning::{Bvh, BvhBuildStrategy},
};
use rayon::prelude::*;
use robust::{Coord3D, orient3d};
use serde::{Deserialize, Serialize};

/// What is in a file and whether it is usable.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CheckReport {
    /// Name of the shape.
    pub name: String,
    /// Where it came from, its frame and units as the file has them.
    pub provenance: Provenance,
    /// Smallest and largest coordinates, LPS mm.
    pub bounds_mm: [[f64; 3]; 2],
    /// What it holds.
    pub content: CheckContent,
    /// Whether it is fit for any use as it is.
    pub usable: bool,
    /// What it can be used for, and what not.
    pub uses: Vec<Use>,
    /// What is wrong or worth knowing, the worst first.
    pub problems: Vec<Problem>,
}

/// What a shape may be wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// A scaffold, and what is measured on it.
    Scaffold,
    /// Registration and matching.
    Match,
    /// Change of volume over time.
    Change,
}

/// Whether a shape is fit for a purpose as it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Use {
    /// The purpose.
    pub purpose: Purpose,
    /// Whether it is.
    pub fit: bool,
    /// How it will be taken, or what stands against it and what to do.
    pub why: String,
}

/// The three kinds of content.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum CheckContent {
    /// A point cloud.
    Cloud(CloudCheck),
    /// A mesh.
    Mesh(MeshCheck),
    /// A label map.
    Labels(LabelsCheck),
}

/// What a cloud holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CloudCheck {
    /// Points in the file.
    pub points: usize,
    /// Points that are exact copies of another.
    pub duplicates: usize,
    /// Whether points have normals.
    pub normals: bool,
    /// Estimated mean spacing, mm.
    pub spacing_mm: f64,
}

/// Which way the faces of a mesh look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Orientation {
    /// Closed and outward.
    Outward,
    /// Closed and inward.
    Inward,
    /// Faces agree, but the surface is open and has no outside.
    Open,
    /// Some faces look the other way.
    Inconsistent,
    /// The surface is one-sided.
    OneSided,
}

/// What a mesh holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeshCheck {
    /// Points in the file.
    pub points: usize,
    /// Points that no triangle uses.
    pub unused_points: usize,
    /// Used points at the place of another used point.
    pub twin_points: usize,
    /// Topology of the triangles as given.
    pub topology: MeshTopology,
    /// Triangles without area.
    pub degenerate_triangles: usize,
    /// Triangles on the same three points as another.
    pub duplicate_triangles: usize,
    /// Pairs of triangles that cross each other.
    pub crossing_pairs: usize,
    /// Which way the faces look.
    pub orientation: Orientation,
    /// Area, mm^2.
    pub area_mm2: f64,
    /// Volume, mm^3; `None` when the mesh is not closed and oriented.
    pub volume_mm3: Option<f64>,
}

/// What a label map holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LabelsCheck {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// Voxel size along i, j, k, mm.
    pub spacing_mm: [f64; 3],
    /// Unit directions of i, j, k in LPS.
    pub directions: [[f64; 3]; 3],
    /// The labels.
    pub labels: Vec<LabelCheck>,
}

/// One label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelCheck {
    /// The label.
    pub label: i32,
    /// Its voxels.
    pub voxels: u64,
    /// Their volume, mm^3.
    pub volume_mm3: f64,
    /// It reaches the edge of the image.
    pub touches_border: bool,
}

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The shape cannot be used as it is.
    Error,
    /// It can be used, but the result may not be what was meant.
    Warning,
    /// Worth knowing.
    Note,
}

/// A problem and its remedy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Problem {
    /// How bad it is.
    pub severity: Severity,
    /// What was found.
    pub found: String,
    /// What to do about it; empty when nothing needs to be done.
    pub remedy: String,
}

/// Checks a shape; see the module's documentation.
pub fn check(shape: &Shape) -> CheckReport {
    let mut problems: Vec<Problem> = shape
        .warnings
        .iter()
        .chain(&shape.notes)
        .map(|w| problem(Severity::Note, w.clone(), ""))
        .collect();
    let (content, corners) = match &shape.geometry {
        Geometry::Cloud(c) => (
            CheckContent::Cloud(check_cloud(c, &mut problems)),
            bounds(&c.points),
        ),
        Geometry::Mesh(m) => (
            CheckContent::Mesh(check_mesh(m, &mut problems)),
            bounds(&m.points),
        ),
        Geometry::Labels(l) => (
            CheckContent::Labels(check_labels(l, &mut problems)),
            Some(label_bounds(l)),
        ),
    };
    problems.sort_by_key(|p| p.severity); // stable: within one severity in the order found
    let useless = problems.iter().any(|p| p.severity == Severity::Error);
    let uses = uses(&content, useless);
    CheckReport {
        name: shape.name.clone(),
        provenance: shape.provenance.clone(),
        bounds_mm: corners.unwrap_or_default().map(|c| c.to_array()),
        content,
        usable: uses.iter().any(|u| u.fit),
        uses,
        problems,
    }
}

/// What the stages make of the content.
fn uses(content: &CheckContent, useless: bool) -> Vec<Use> {
    let wanted = [Purpose::Scaffold, Purpose::Match, Purpose::Change];
    let say = |purpose, (fit, why): (bool, &str)| Use {
        purpose,
        fit,
        why: why.to_owned(),
    };
    let all = |answers: [(bool, &str); 3]| {
        let pairs = wanted.into_iter().zip(answers);
        pairs.map(|(purpose, answer)| say(purpose, answer)).collect()
    };
    if useless {
        return all([(false, "nothing can be made of it, see the error"); 3]);
    }
    let mesh = match content {
        CheckContent::Labels(_) => return all([(true, "as the solid of its voxels"); 3]),
        CheckContent::Cloud(_) => {
            return all([
                (
                    true,
                    "as points: the surface is found, closed or not (`medial mesh --open` keeps it open)",
                ),
                (true, "as points"),
                (
                    false,
                    "points enclose no volume: make a closed mesh first (`medial mesh --closed`)",
                ),
            ]);
        }
        CheckContent::Mesh(mesh) => mesh,
    };
    let t = &mesh.topology;
    match mesh.orientation {
        Orientation::Inconsistent => all([
            (
                false,
                "its inside is not known while triangles look both ways: --repair turns them",
            ),
            (true, "by its points and faces; --repair makes the sides certain"),
            (
                false,
                "it encloses no certain volume: --repair turns the triangles",
            ),
        ]),
        _ if t.boundary_edges > 0 || mesh.orientation == Orientation::OneSided => all([
            (
                true,
                "as an open surface: the scaffold of both its sides, joined, of the cloud of its points",
            ),
            (true, "as a part of a surface"),
            (
                false,
                "it encloses no volume: close it (--repair when points are doubled, `medial mesh --closed` else)",
            ),
        ]),
        _ if t.nonmanifold_edges > 0 => all([
            (true, "as a solid, its inside by the winding number"),
            (true, "as a surface"),
            (
                false,
                "volume asks for two triangles at every edge: --repair, or `medial mesh --closed` on its points",
            ),
        ]),
        _ => all([(true, "as a closed solid"); 3]),
    }
}

fn problem(severity: Severity, found: impl Into<String>, remedy: &str) -> Problem {
    Problem {
        severity,
        found: found.into(),
        remedy: remedy.to_owned(),
    }
}

fn check_cloud(cloud: &PointCloud, problems: &mut Vec<Problem>) -> CloudCheck {
    let (points, _) = super::sampling::distinct(&cloud.points);
    let duplicates = cloud.points.len() - points.len();
    if points.len() < 4 {
        problems.push(problem(
            Severity::Error,
            format!("only {} points are distinct", points.len()),
            "a shape needs at least four points that do not lie in one plane",
        ));
    }
    if duplicates > 0 {
        problems.push(problem(
            Severity::Note,
            format!("{duplicates} points are exact copies of others"),
            "they are used once",
        ));
    }
    CloudCheck {
        points: cloud.points.len(),
        duplicates,
        normals: !cloud.normals.is_empty(),
        spacing_mm: cloud::spacing_mm(&points),
    }
}

fn check_mesh(mesh: &TriangleMesh, problems: &mut Vec<Problem>) -> MeshCheck {
    let topology = mesh.topology();
    let used: Vec<DVec3> = {
        let mut flags = vec![false; mesh.points.len()];
        for &v in mesh.triangles.iter().flatten() {
            flags[v as usize] = true;
        }
        mesh.points
            .iter()
            .zip(&flags)
            .filter(|(_, f)| **f)
            .map(|(p, _)| *p)
            .collect()
    };
    let closed = topology.watertight && topology.oriented;
    let volume = closed.then(|| mesh.signed_volume());
    let orientation = match volume {
        _ if !topology.orientable => Orientation::OneSided,
        _ if !topology.oriented => Orientation::Inconsistent,
        Some(v) if v < 0.0 => Orientation::Inward,
        Some(_) => Orientation::Outward,
        None => Orientation::Open,
    };
    let out = MeshCheck {
        points: mesh.points.len(),
        unused_points: mesh.points.len() - used.len(),
        twin_points: used.len() - super::sampling::distinct(&used).0.len(),
        degenerate_triangles: mesh.triangles.iter().filter(|t| is_degenerate(mesh, t)).count(),
        duplicate_triangles: duplicates(&mesh.triangles),
        crossing_pairs: crossing_pairs(mesh),
        orientation,
        area_mm2: mesh.area(),
        volume_mm3: volume.map(f64::abs),
        topology,
    };
    mesh_problems(&out, problems);
    out
}

fn mesh_problems(m: &MeshCheck, problems: &mut Vec<Problem>) {
    let t = &m.topology;
    let repair = "repair joins equal points, drops useless faces and turns faces outward";
    let mut push = |wrong: bool, severity, found: String, remedy: &str| {
        if wrong {
            problems.push(problem(severity, found, remedy));
        }
    };
    push(
        m.area_mm2 <= 0.0,
        Severity::Error,
        "the surface has no area".into(),
        "export the mesh again",
    );
    push(
        t.boundary_edges > 0,
        Severity::Warning,
        format!(
            "the surface is open: {} edges have one triangle",
            t.boundary_edges
        ),
        "close it (repair first, if points are doubled), or treat it as an open surface or as a cloud",
    );
    push(
        t.nonmanifold_edges > 0,
        Severity::Warning,
        format!("{} edges have three or more triangles", t.nonmanifold_edges),
        "repair drops useless faces and takes apart what touches itself in an edge",
    );
    push(
        m.orientation == Orientation::OneSided,
        Severity::Warning,
        "the surface is one-sided".into(),
        "it has no inside: treat it as an open surface",
    );
    push(
        m.orientation == Orientation::Inconsistent,
        Severity::Warning,
        "some triangles look the other way than their neighbours".into(),
        repair,
    );
    push(
        m.orientation == Orientation::Inward,
        Severity::Warning,
        "the triangles look inward".into(),
        "they are turned outward on use; repair does so for good",
    );
    push(
        m.crossing_pairs > 0,
        Severity::Warning,
        format!("{} pairs of triangles cross each other", m.crossing_pairs),
        "inside and outside are decided by the winding number there; look at the place",
    );
    push(
        t.nonmanifold_vertices > 0,
        Severity::Warning,
        format!("the surface touches itself in {} points", t.nonmanifold_vertices),
        "repair takes it apart there",
    );
    push(
        m.twin_points > 0,
        Severity::Note,
        format!("{} points lie on another one", m.twin_points),
        repair,
    );
    push(
        m.degenerate_triangles > 0,
        Severity::Note,
        format!("{} triangles have no area", m.degenerate_triangles),
        "",
    );
    push(
        m.duplicate_triangles > 0,
        Severity::Warning,
        format!("{} triangles lie on another one", m.duplicate_triangles),
        repair,
    );
    push(
        m.unused_points > 0,
        Severity::Note,
        format!("{} points belong to no triangle", m.unused_points),
        "",
    );
    push(
        t.components > 1,
        Severity::Note,
        format!("the surface has {} separate pieces", t.components),
        "",
    );
}

fn is_degenerate(mesh: &TriangleMesh, t: &[u32; 3]) -> bool {
    let [a, b, c] = t.map(|i| mesh.points[i as usize]);
    let longest2 = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    // Twice the area over the square of the longest side, at the precision of 64 bits.
    (b - a).cross(c - a).length() <= 1e-14 * longest2
}

fn duplicates(triangles: &[[u32; 3]]) -> usize {
    let mut keys: Vec<[u32; 3]> = triangles
        .iter()
        .map(|t| {
            let mut k = *t;
            k.sort_unstable();
            k
        })
        .collect();
    keys.par_sort_unstable();
    keys.windows(2).filter(|w| w[0] == w[1]).count()
}

/// Pairs of triangles of which an edge of one passes through the inside of the other. Touching does not count, nor do
/// triangles in one plane.
pub fn crossing_pairs(mesh: &TriangleMesh) -> usize {
    let boxes: Vec<Aabb> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        })
        .collect();
    if boxes.is_empty() {
        return 0;
    }
    let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    (0..boxes.len())
        .into_par_iter()
        .map(|i| {
            bvh.intersect_aabb(&boxes[i])
                .filter(|&j| j as usize > i && cross(mesh, mesh.triangles[i], mesh.triangles[j as usize]))
                .count()
        })
        .sum() // integers: the order of the sum does not matter
}

fn cross(mesh: &TriangleMesh, s: [u32; 3], t: [u32; 3]) -> bool {
    let shared = s.iter().filter(|v| t.contains(v)).count();
    shared < 2 && (edge_pierces(mesh, s, t) || edge_pierces(mesh, t, s))
}

/// Whether an edge of `s` without a corner of `t` passes through the inside of `t`.
fn edge_pierces(mesh: &TriangleMesh, s: [u32; 3], t: [u32; 3]) -> bool {
    let at = |v: u32| {
        let p = mesh.points[v as usize];
        Coord3D {
            x: p.x,
            y: p.y,
            z: p.z,
        }
    };
    let [a, b, c] = t.map(at);
    [(s[0], s[1]), (s[1], s[2]), (s[2], s[0])].iter().any(|&(u, v)| {
        if t.contains(&u) || t.contains(&v) {
            return false;
        }
        let (p, q) = (at(u), at(v));
        if orient3d(a, b, c, p) * orient3d(a, b, c, q) >= 0.0 {
            return false;
        }
        let sides = [orient3d(p, q, a, b), orient3d(p, q, b, c), orient3d(p, q, c, a)];
        sides.iter().all(|&x| x > 0.0) || sides.iter().all(|&x| x < 0.0)
    })
}

fn label_bounds(map: &LabelMap) -> [DVec3; 2] {
    let last = map.dims.map(|d| d as f64 - 0.5);
    let corners = (0..8).map(|c| {
        let pick = |a: usize| if c >> a & 1 == 1 { last[a] } else { -0.5 };
        map.position(DVec3::new(pick(0), pick(1), pick(2)))
    });
    corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], p| {
        [lo.min(p), hi.max(p)]
    })
}

fn check_labels(map: &LabelMap, problems: &mut Vec<Problem>) -> LabelsCheck {
    let counts = map.label_counts();
    let border = border_labels(map);
    let voxel = map.voxel_volume_mm3();
    let labels: Vec<LabelCheck> = counts
        .iter()
        .map(|c| LabelCheck {
            label: c.label,
            voxels: c.voxels,
            volume_mm3: c.voxels as f64 * voxel,
            touches_border: border.binary_search(&c.label).is_ok(),
        })
        .collect();
    if labels.is_empty() {
        problems.push(problem(
            Severity::Error,
            "there is no label",
            "give a segmentation",
        ));
    }
    if labels.len() > 1 {
        problems.push(problem(
            Severity::Note,
            format!("the file holds {} labels", labels.len()),
            "choose one with its number; without a choice all are taken as one solid",
        ));
    }
    for l in labels.iter().filter(|l| l.touches_border) {
        problems.push(problem(
            Severity::Warning,
            format!("label {} reaches the edge of the image", l.label),
            "its surface is closed there; the structure may be cut off",
        ));
    }
    for l in labels.iter().filter(|l| l.voxels < 8) {
        problems.push(problem(
            Severity::Warning,
            format!("label {} has only {} voxels", l.label, l.voxels),
            "its shape is that of the voxels",
        ));
    }
    LabelsCheck {
        dims: map.dims,
        spacing_mm: map.spacing_mm.to_array(),
        directions: [map.direction.x_axis, map.direction.y_axis, map.direction.z_axis].map(|d| d.to_array()),
        labels,
    }
}

/// Labels of voxels on the edge of the image, sorted.
fn border_labels(map: &LabelMap) -> Vec<i32> {
    let [nx, ny, nz] = map.dims;
    let mut out: Vec<i32> = Vec::new();
    for (row, values) in map.values.chunks_exact(nx).enumerate() {
        let (j, k) = (row % ny, row / ny);
        if j == 0 || j + 1 == ny || k == 0 || k + 1 == nz {
            out.extend(values.iter().filter(|v| **v != 0));
            out.sort_unstable();
            out.dedup();
        } else {
            out.extend([values[0], values[nx - 1]].iter().filter(|v| **v != 0));
        }
    }
    out.sort_unstable();
    out.dedup();
    out
}
