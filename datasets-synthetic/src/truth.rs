//! What is exactly known of a shape.
//!
//! A [`Truth`] travels with every shape and is written beside it as JSON. Fields that are not known in closed
//! form are `None`, never guessed. The medial part is a complex of polylines and triangulated sheets with
//! radii, exact up to the chords of curved pieces; [`Medial::distance`] measures to it.

use crate::deform::RigidMotion;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Exact facts about a shape, mm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// How the facts below are derived, in words.
    pub derivation: String,
    /// The surface bounds a solid.
    pub closed: bool,
    /// The surface has two sides.
    pub orientable: bool,
    /// Closed border curves of the surface.
    pub boundary_loops: usize,
    /// Connected components of the surface.
    pub surface_components: usize,
    /// Euler number of the surface.
    pub surface_euler: i64,
    /// Betti numbers b0, b1, b2 of the solid; `None` for open surfaces.
    pub solid_betti: Option<[u32; 3]>,
    /// Enclosed volume, mm^3.
    pub volume_mm3: Option<f64>,
    /// Surface area, mm^2.
    pub area_mm2: Option<f64>,
    /// Smallest and largest radius over the interior medial set, mm.
    pub medial_radius_mm: Option<[f64; 2]>,
    /// Numbers of the elements of the exact interior medial scaffold.
    pub counts: Option<MedialCounts>,
    /// The same once pieces that stand for less than a small tolerance are simplified away, where that differs.
    pub counts_at_tolerance: Option<MedialCounts>,
    /// Interior medial geometry.
    pub medial: Option<Medial>,
    /// The shape differs from its mirror image.
    pub chiral: bool,
    /// The shape has a continuous rotational symmetry, so its pose is not unique.
    pub rotational_symmetry: bool,
}

/// How many elements a scaffold has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MedialCounts {
    /// Ends of curves.
    pub nodes: usize,
    /// Curves where three or more sheets meet.
    pub axial_curves: usize,
    /// Boundary curves of sheets.
    pub rib_curves: usize,
    /// Curves without sheets.
    pub wires: usize,
    /// Sheets.
    pub sheets: usize,
}

/// What a medial curve is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CurveKind {
    /// Three or more sheets meet.
    Axial,
    /// Boundary of a sheet; maps to a ridge of the surface.
    Rib,
    /// No sheet at all.
    Wire,
}

/// A medial curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MedialCurve {
    /// What it is.
    pub kind: CurveKind,
    /// First and last point coincide.
    pub closed: bool,
    /// Points with radius `[x, y, z, r]`, mm.
    pub polyline: Vec<[f64; 4]>,
}

/// A medial sheet as triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MedialSheet {
    /// Vertices with radius `[x, y, z, r]`, mm.
    pub vertices: Vec<[f64; 4]>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Area, mm^2.
    pub area_mm2: f64,
}

/// A medial node.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MedialNode {
    /// Position and radius `[x, y, z, r]`, mm.
    pub position: [f64; 4],
}

/// Interior medial geometry.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Medial {
    /// Nodes.
    pub nodes: Vec<MedialNode>,
    /// Curves.
    pub curves: Vec<MedialCurve>,
    /// Sheets.
    pub sheets: Vec<MedialSheet>,
}

pub(crate) fn xyz(v: [f64; 4]) -> DVec3 {
    DVec3::new(v[0], v[1], v[2])
}

pub(crate) fn with_radius(p: DVec3, r: f64) -> [f64; 4] {
    [p.x, p.y, p.z, r]
}

impl MedialCurve {
    /// Length of the polyline, mm.
    pub fn length(&self) -> f64 {
        self.polyline
            .windows(2)
            .map(|w| xyz(w[0]).distance(xyz(w[1])))
            .sum()
    }
}

impl MedialSheet {
    /// A sheet from triangles; the area is summed.
    pub fn new(vertices: Vec<[f64; 4]>, triangles: Vec<[u32; 3]>) -> Self {
        let area_mm2 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| xyz(vertices[v as usize]));
                0.5 * (b - a).cross(c - a).length()
            })
            .sum();
        MedialSheet {
            vertices,
            triangles,
            area_mm2,
        }
    }

    /// A planar polygon as a fan around a point that sees all of it (a convex polygon's first corner, say).
    pub fn fan(centre: [f64; 4], ring: &[[f64; 4]], closed: bool) -> Self {
        let mut vertices = vec![centre];
        vertices.extend_from_slice(ring);
        let n = ring.len() as u32;
        let mut triangles: Vec<[u32; 3]> = (1..n).map(|i| [0, i, i + 1]).collect();
        if closed {
            triangles.push([0, n, 1]);
        }
        MedialSheet::new(vertices, triangles)
    }
}

impl Medial {
    /// Counts of the listed elements.
    pub fn counts(&self) -> MedialCounts {
        let of_kind = |kind: CurveKind| self.curves.iter().filter(|c| c.kind == kind).count();
        MedialCounts {
            nodes: self.nodes.len(),
            axial_curves: of_kind(CurveKind::Axial),
            rib_curves: of_kind(CurveKind::Rib),
            wires: of_kind(CurveKind::Wire),
            sheets: self.sheets.len(),
        }
    }

    /// Distance from `p` to the medial set, mm. O(elements).
    pub fn distance(&self, p: DVec3) -> f64 {
        self.closest(p).0
    }

    /// Distance from `p` to the medial set and the radius there (interpolated), mm.
    pub fn closest(&self, p: DVec3) -> (f64, f64) {
        let mut best = (f64::INFINITY, f64::NAN);
        let mut offer = |d: f64, r: f64| {
            if d < best.0 {
                best = (d, r);
            }
        };
        for node in &self.nodes {
            offer(p.distance(xyz(node.position)), node.position[3]);
        }
        for curve in &self.curves {
            for w in curve.polyline.windows(2) {
                let (a, b) = (xyz(w[0]), xyz(w[1]));
                let t = crate::implicit::field::segment_parameter(p, a, b);
                offer(p.distance(a.lerp(b, t)), w[0][3] + t * (w[1][3] - w[0][3]));
            }
        }
        for sheet in &self.sheets {
            for t in &sheet.triangles {
                let corners = t.map(|v| sheet.vertices[v as usize]);
                let w = closest_in_triangle(p, corners.map(xyz));
                let at = |k: usize| w[0] * corners[0][k] + w[1] * corners[1][k] + w[2] * corners[2][k];
                offer(p.distance(DVec3::new(at(0), at(1), at(2))), at(3));
            }
        }
        best
    }

    /// About `n` points of the medial set with radii, vertices of its elements first to last, evenly thinned.
    pub fn sample(&self, n: usize) -> Vec<[f64; 4]> {
        let mut all: Vec<[f64; 4]> = self.nodes.iter().map(|node| node.position).collect();
        self.curves
            .iter()
            .for_each(|c| all.extend_from_slice(&c.polyline));
        for sheet in &self.sheets {
            for t in &sheet.triangles {
                let c = t.map(|v| sheet.vertices[v as usize]);
                all.push(std::array::from_fn(|k| (c[0][k] + c[1][k] + c[2][k]) / 3.0));
            }
        }
        let step = (all.len() as f64 / n.max(1) as f64).max(1.0);
        (0..)
            .map(|i| (i as f64 * step) as usize)
            .take_while(|&i| i < all.len())
            .map(|i| all[i])
            .collect()
    }

    /// Every position mapped, radii multiplied: for similarities only.
    pub fn moved(&self, map: impl Fn(DVec3) -> DVec3, scale: f64) -> Self {
        let at = |v: [f64; 4]| with_radius(map(xyz(v)), v[3] * scale);
        Medial {
            nodes: self
                .nodes
                .iter()
                .map(|n| MedialNode {
                    position: at(n.position),
                })
                .collect(),
            curves: self
                .curves
                .iter()
                .map(|c| MedialCurve {
                    polyline: c.polyline.iter().map(|&v| at(v)).collect(),
                    ..c.clone()
                })
                .collect(),
            sheets: self
                .sheets
                .iter()
                .map(|s| MedialSheet::new(s.vertices.iter().map(|&v| at(v)).collect(), s.triangles.clone()))
                .collect(),
        }
    }
}

impl Truth {
    /// A closed surface of that genus bounding one solid without cavities.
    pub fn solid_of_genus(genus: u32, derivation: &str) -> Self {
        Truth {
            derivation: derivation.to_string(),
            closed: true,
            orientable: true,
            surface_components: 1,
            surface_euler: 2 - 2 * genus as i64,
            solid_betti: Some([1, genus, 0]),
            ..Truth::default()
        }
    }

    /// An open surface.
    pub fn open(euler: i64, boundary_loops: usize, derivation: &str) -> Self {
        Truth {
            derivation: derivation.to_string(),
            closed: false,
            orientable: true,
            boundary_loops,
            surface_components: 1,
            surface_euler: euler,
            ..Truth::default()
        }
    }

    /// Puts in the medial geometry, its counts and the range of its radii.
    pub fn with_medial(mut self, medial: Medial) -> Self {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let mut see = |r: f64| range = [range[0].min(r), range[1].max(r)];
        medial
            .curves
            .iter()
            .flat_map(|c| &c.polyline)
            .for_each(|v| see(v[3]));
        medial
            .sheets
            .iter()
            .flat_map(|s| &s.vertices)
            .for_each(|v| see(v[3]));
        medial.nodes.iter().for_each(|n| see(n.position[3]));
        self.counts = Some(medial.counts());
        self.medial_radius_mm = Some(range);
        self.medial = Some(medial);
        self
    }

    /// Puts in volume and area.
    pub fn with_size(mut self, volume_mm3: f64, area_mm2: f64) -> Self {
        self.volume_mm3 = Some(volume_mm3);
        self.area_mm2 = Some(area_mm2);
        self
    }

    /// The facts of the shape after a rigid motion or mirror image.
    pub fn moved(&self, motion: &RigidMotion) -> Self {
        let mut truth = self.clone();
        truth.medial = self.medial.as_ref().map(|m| m.moved(|p| motion.apply(p), 1.0));
        truth
    }
}

/// Barycentric weights of the point of a triangle nearest to `p` (Ericson, *Real-Time Collision Detection*, 5.1.5).
pub(crate) fn closest_in_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    if sum == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    [va / sum, vb / sum, vc / sum]
}
