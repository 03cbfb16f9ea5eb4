//! What a report shows in 3D: named layers, each a set of triangles in LPS mm with an optional quantity a vertex.
//!
//! In: surfaces, a coarse scaffold, correspondences. Out: a [`Scene`] that the GLB writer, the viewer and the still picture
//! all draw from, so that they cannot disagree. Curves become thin tubes and nodes small balls, so that every viewer shows
//! and picks them. Tube radius follows the scene's diagonal. Cost is linear in the geometry.

use super::colour::{self, ColourScale, Rgba};
use crate::coarse_scaffold::hypergraph::{CoarseScaffold, Curve, CurveKind, MedialPoint};
use crate::geometry::{Rigid, TriangleMesh};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// What a layer is; the viewer groups its switches by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LayerKind {
    /// A surface.
    Surface,
    /// A sheet.
    Sheet,
    /// A curve where sheets meet.
    Axial,
    /// A border of a sheet.
    Rib,
    /// A curve without a sheet.
    Wire,
    /// A path that closes a gap.
    Seam,
    /// An end of curves.
    Node,
    /// A line between two elements that correspond.
    Correspondence,
    /// Points or marks of another kind.
    Mark,
}

impl LayerKind {
    /// The word shown for many of them.
    pub fn plural(self) -> &'static str {
        match self {
            LayerKind::Surface => "Surface",
            LayerKind::Sheet => "Sheets",
            LayerKind::Axial => "Axial curves",
            LayerKind::Rib => "Ribs",
            LayerKind::Wire => "Wires",
            LayerKind::Seam => "Seams",
            LayerKind::Node => "Nodes",
            LayerKind::Correspondence => "Correspondences",
            LayerKind::Mark => "Marks",
        }
    }
}

/// A quantity at every vertex of a layer and how it is coloured.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Its name, e.g. `radius`.
    pub name: String,
    /// Its unit, e.g. `mm`.
    pub unit: String,
    /// One value a vertex.
    pub values: Vec<f32>,
    /// Values at the two ends of the colour scale.
    pub range: [f64; 2],
    /// The colour scale.
    pub scale: ColourScale,
}

impl Quantity {
    /// A one-sided quantity (thickness, radius), coloured from its 1st to its 99th percentile.
    pub fn positive(name: &str, unit: &str, values: Vec<f32>) -> Self {
        let range = percentile_range(&values);
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
            range,
            scale: ColourScale::Viridis,
        }
    }

    /// A signed quantity (distance, growth), coloured evenly about zero up to its 99th percentile in size.
    pub fn signed(name: &str, unit: &str, values: Vec<f32>) -> Self {
        let sizes: Vec<f32> = values.iter().map(|v| v.abs()).collect();
        let top = percentile_range(&sizes)[1].max(1e-6);
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
            range: [-top, top],
            scale: ColourScale::BlueWhiteRed,
        }
    }

    /// The colour of vertex `i`.
    pub fn colour(&self, i: usize) -> [f32; 3] {
        let [lo, hi] = self.range;
        let t = if hi > lo {
            (f64::from(self.values[i]) - lo) / (hi - lo)
        } else {
            0.5
        };
        self.scale.at(t)
    }
}

/// 1st and 99th percentile of the finite values; `[0, 1]` without any.
fn percentile_range(values: &[f32]) -> [f64; 2] {
    let mut v: Vec<f32> = values.iter().copied().filter(|x| x.is_finite()).collect();
    v.sort_unstable_by(f32::total_cmp);
    match v.len() {
        0 => [0.0, 1.0],
        n => {
            let at = |q: f64| f64::from(v[((n - 1) as f64 * q).round() as usize]);
            [at(0.01), at(0.99)]
        }
    }
}

/// One named thing in the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name of its node in the GLB, unique in the scene.
    pub name: String,
    /// What it is.
    pub kind: LayerKind,
    /// The shape it belongs to when there are several (`target`, `source`, `baseline`, `followup`), or empty.
    pub shape: String,
    /// Triangles, LPS mm.
    pub mesh: TriangleMesh,
    /// Colour without a quantity.
    pub colour: Rgba,
    /// The quantity it may be coloured by.
    pub quantity: Option<Quantity>,
    /// What picking shows: `id`, `persistence_mm`, `length_mm`, ...; numbers and texts only.
    pub properties: Map<String, Value>,
    /// Whether it is shown at first.
    pub visible: bool,
}

/// Named layers, drawn and exported in this order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The layers.
    pub layers: Vec<Layer>,
}

impl Scene {
    /// Corners of the box of all layers, or `None` when there is no point.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        self.layers
            .iter()
            .filter_map(|l| l.mesh.bounds())
            .reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
    }

    /// Diagonal of [`Scene::bounds`], mm; 0 for an empty scene.
    pub fn diagonal_mm(&self) -> f64 {
        self.bounds().map_or(0.0, |[lo, hi]| (hi - lo).length())
    }

    /// Adds a surface. `shape` names it among several, or is empty.
    pub fn add_surface(
        &mut self,
        shape: &str,
        mesh: &TriangleMesh,
        colour: Rgba,
        quantity: Option<Quantity>,
    ) {
        let name = if shape.is_empty() {
            "surface".to_owned()
        } else {
            format!("surface {shape}")
        };
        self.layers.push(Layer {
            name,
            kind: LayerKind::Surface,
            shape: shape.to_owned(),
            mesh: mesh.clone(),
            colour,
            quantity,
            properties: Map::new(),
            visible: true,
        });
    }

    /// Adds sheets, curves and nodes of a scaffold, moved by `motion` (the identity for a shape in its own place).
    ///
    /// Of a second shape (`source`, `followup`) only axial curves and wires are shown at first: two sets of sheets in one
    /// place hide each other.
    pub fn add_scaffold(&mut self, shape: &str, scaffold: &CoarseScaffold, motion: &Rigid) {
        let diagonal = if scaffold.diagonal_mm > 0.0 {
            scaffold.diagonal_mm
        } else {
            self.diagonal_mm()
        };
        let named = |what: &str, id: u32| {
            if shape.is_empty() {
                format!("{what} {id}")
            } else {
                format!("{shape} {what} {id}")
            }
        };
        let range = sheet_radius_range(scaffold);
        let first = self.layers.len();
        for s in &scaffold.sheets {
            let mut mesh = TriangleMesh {
                points: s.mesh.vertices.iter().map(|v| motion.apply(v.position)).collect(),
                triangles: s.mesh.triangles.clone(),
            };
            turn_alike(&mut mesh);
            let mut radius = Quantity::positive(
                "radius",
                "mm",
                s.mesh.vertices.iter().map(|v| v.radius as f32).collect(),
            );
            radius.range = range;
            self.layers.push(Layer {
                name: named("sheet", s.id.0),
                kind: LayerKind::Sheet,
                shape: shape.to_owned(),
                mesh,
                colour: colour::component_colour(s.id.index()),
                quantity: Some(radius),
                properties: properties(json!({
                    "id": s.id.0, "persistence_mm": s.persistence, "area_mm2": s.area,
                    "mean_radius_mm": s.mean_radius, "max_radius_mm": s.max_radius, "volume_share": s.volume_share,
                })),
                visible: true,
            });
        }
        for c in scaffold.curves.iter().filter(|c| c.polyline.len() > 1) {
            self.layers.push(curve_layer(named, shape, c, motion, diagonal));
        }
        for n in &scaffold.nodes {
            self.layers.push(Layer {
                name: named("node", n.id.0),
                kind: LayerKind::Node,
                shape: shape.to_owned(),
                mesh: ball(motion.apply(n.position), 0.006 * diagonal),
                colour: [0.13, 0.13, 0.16, 1.0],
                quantity: None,
                properties: properties(json!({
                    "id": n.id.0, "persistence_mm": n.persistence, "radius_mm": n.radius, "type": n.kind,
                    "curves": n.curves.len(),
                })),
                visible: true,
            });
        }
        if shape == "source" || shape == "followup" {
            for layer in &mut self.layers[first..] {
                layer.visible = matches!(layer.kind, LayerKind::Axial | LayerKind::Wire);
            }
        }
    }

    /// Adds straight lines between points that correspond, in target coordinates, coloured by the distance.
    pub fn add_correspondences(&mut self, pairs: &[CorrespondenceLine]) {
        let diagonal = self.diagonal_mm();
        for (k, c) in pairs.iter().enumerate() {
            let ends = [c.target, c.source_moved].map(|position| MedialPoint {
                position,
                radius: 0.0,
            });
            self.layers.push(Layer {
                name: format!("correspondence {k}"),
                kind: LayerKind::Correspondence,
                shape: String::new(),
                mesh: tube(&ends, false, 0.0018 * diagonal, &Rigid::IDENTITY).mesh,
                colour: [0.95, 0.72, 0.10, 1.0],
                quantity: None,
                properties: properties(json!({
                    "id": k, "pair": c.label, "weight": c.weight,
                    "distance_mm": c.target.distance(c.source_moved),
                })),
                visible: true,
            });
        }
    }
}

/// A line of [`Scene::add_correspondences`].
#[derive(Clone, Debug, PartialEq)]
pub struct CorrespondenceLine {
    /// Position on the target, mm.
    pub target: DVec3,
    /// Position on the source after it was moved onto the target, mm.
    pub source_moved: DVec3,
    /// Weight of the pair, 0 to 1.
    pub weight: f64,
    /// What is paired, e.g. `node 3 - node 5`.
    pub label: String,
}

/// An object's members; anything else gives none.
pub(super) fn properties(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// Turns triangles that share a manifold edge the same way round, so that smooth normals do not cancel. A one-sided
/// (non-orientable) sheet keeps a line where they disagree. `O(n log n)`.
fn turn_alike(mesh: &mut TriangleMesh) {
    let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (i, t) in mesh.triangles.iter().enumerate() {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            sides.push((a.min(b), a.max(b), i as u32));
        }
    }
    sides.sort_unstable();
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); mesh.triangles.len()];
    for run in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        if let [x, y] = run {
            neighbours[x.2 as usize].push(y.2);
            neighbours[y.2 as usize].push(x.2);
        }
    }
    let mut seen = vec![false; mesh.triangles.len()];
    for start in 0..mesh.triangles.len() {
        let mut stack = Vec::new();
        if !std::mem::replace(&mut seen[start], true) {
            stack.push(start);
        }
        while let Some(i) = stack.pop() {
            let here = mesh.triangles[i];
            for &j in &neighbours[i] {
                if !std::mem::replace(&mut seen[j as usize], true) {
                    let there = &mut mesh.triangles[j as usize];
                    let same_way = (0..3).any(|k| {
                        let side = (here[k], here[(k + 1) % 3]);
                        (0..3).any(|m| side == (there[m], there[(m + 1) % 3]))
                    });
                    if same_way {
                        there.swap(1, 2);
                    }
                    stack.push(j as usize);
                }
            }
        }
    }
}

/// One colour range for all sheets of a scaffold, so that equal colours mean equal radii.
fn sheet_radius_range(scaffold: &CoarseScaffold) -> [f64; 2] {
    let radii: Vec<f32> = scaffold
        .sheets
        .iter()
        .flat_map(|s| s.mesh.vertices.iter().map(|v| v.radius as f32))
        .collect();
    percentile_range(&radii)
}

fn curve_layer(
    named: impl Fn(&str, u32) -> String,
    shape: &str,
    c: &Curve,
    motion: &Rigid,
    diagonal: f64,
) -> Layer {
    let (word, kind, colour, width) = match c.kind {
        CurveKind::Axial => ("axial", LayerKind::Axial, colour::AXIAL, 0.0042),
        CurveKind::Rib => ("rib", LayerKind::Rib, colour::RIB, 0.0019),
        CurveKind::Wire => ("wire", LayerKind::Wire, colour::WIRE, 0.0042),
        CurveKind::Seam => ("seam", LayerKind::Seam, colour::SEAM, 0.0032),
    };
    let tube = tube(&c.polyline, c.closed, width * diagonal, motion);
    Layer {
        name: named(word, c.id.0),
        kind,
        shape: shape.to_owned(),
        mesh: tube.mesh,
        colour,
        quantity: Some(Quantity::positive("radius", "mm", tube.radius)),
        properties: properties(json!({
            "id": c.id.0, "persistence_mm": c.persistence, "length_mm": c.length, "sheets": c.sheets.len(),
        })),
        visible: true,
    }
}

/// A tube round a polyline with the medial radius of the nearest polyline point at each vertex.
struct Tube {
    mesh: TriangleMesh,
    radius: Vec<f32>,
}

const TUBE_SIDES: usize = 6;

/// Sweeps a hexagon along the polyline; its frame is carried from point to point without twist, so it never flips.
fn tube(line: &[MedialPoint], closed: bool, width: f64, motion: &Rigid) -> Tube {
    let mut points: Vec<(DVec3, f32)> = Vec::with_capacity(line.len() + 1);
    for p in line {
        let x = motion.apply(p.position);
        if points
            .last()
            .is_none_or(|(last, _)| last.distance(x) > 0.05 * width)
        {
            points.push((x, p.radius as f32));
        }
    }
    if closed && points.len() > 2 {
        points.push(points[0]);
    }
    let n = points.len();
    let mut out = Tube {
        mesh: TriangleMesh::default(),
        radius: Vec::with_capacity(n * TUBE_SIDES),
    };
    if n < 2 {
        return out;
    }
    let mut across = DVec3::ZERO;
    for (i, &(x, r)) in points.iter().enumerate() {
        let along = (points[(i + 1).min(n - 1)].0 - points[i.saturating_sub(1)].0)
            .try_normalize()
            .unwrap_or(DVec3::X);
        across = (across - along * across.dot(along))
            .try_normalize()
            .unwrap_or_else(|| along.any_orthonormal_vector());
        let third = along.cross(across);
        for k in 0..TUBE_SIDES {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / TUBE_SIDES as f64).sin_cos();
            out.mesh.points.push(x + width * (cos * across + sin * third));
            out.radius.push(r);
        }
    }
    let s = TUBE_SIDES as u32;
    for i in 0..n as u32 - 1 {
        for k in 0..s {
            let (a, b) = (i * s + k, i * s + (k + 1) % s);
            out.mesh.triangles.push([a, b, a + s]);
            out.mesh.triangles.push([b, b + s, a + s]);
        }
    }
    // Flat caps.
    let last = (n as u32 - 1) * s;
    for k in 1..s - 1 {
        out.mesh.triangles.push([0, k + 1, k]);
        out.mesh.triangles.push([last, last + k, last + k + 1]);
    }
    out
}

/// A small ball: an octahedron split twice.
pub(super) fn ball(centre: DVec3, radius: f64) -> TriangleMesh {
    let mut points = vec![
        DVec3::X,
        DVec3::NEG_X,
        DVec3::Y,
        DVec3::NEG_Y,
        DVec3::Z,
        DVec3::NEG_Z,
    ];
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    for _ in 0..2 {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32, points: &mut Vec<DVec3>| -> u32 {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let ab = middle(a, b, &mut points);
                let bc = middle(b, c, &mut points);
                let ca = middle(c, a, &mut points);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    TriangleMesh {
        points: points.iter().map(|p| centre + radius * *p).collect(),
        triangles,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tubes_and_balls_are_closed_and_outward() {
        let line: Vec<MedialPoint> = (0..9)
            .map(|i| MedialPoint {
                position: DVec3::new(i as f64, (i as f64 * 0.8).sin(), 0.2 * i as f64),
                radius: 1.0,
            })
            .collect();
        for mesh in [
            tube(&line, false, 0.1, &Rigid::IDENTITY).mesh,
            ball(DVec3::new(9.0, 0.0, 0.0), 2.0),
        ] {
            let t = mesh.topology();
            assert!(t.watertight && t.oriented, "{t:?}");
            assert_eq!(t.euler, 2);
            assert!(mesh.signed_volume() > 0.0);
        }
    }

    #[test]
    fn a_sheet_with_mixed_triangles_is_turned_one_way() {
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..25u32 {
            points.push(DVec3::new(f64::from(i % 5), f64::from(i / 5), 0.0));
        }
        for (j, i) in (0..4u32).flat_map(|j| (0..4u32).map(move |i| (j, i))) {
            let a = 5 * j + i;
            triangles.push([a, a + 1, a + 6]);
            triangles.push(if (i + j) % 2 == 0 {
                [a, a + 6, a + 5]
            } else {
                [a, a + 5, a + 6]
            });
        }
        let mut mesh = TriangleMesh { points, triangles };
        assert!(!mesh.topology().oriented);
        turn_alike(&mut mesh);
        assert!(mesh.topology().oriented);
    }

    #[test]
    fn a_signed_quantity_is_white_at_zero() {
        let q = Quantity::signed("growth", "mm", vec![-1.0, 0.0, 2.0]);
        assert_eq!(q.range[0], -q.range[1]);
        assert!(q.colour(1).iter().all(|c| *c > 0.95));
        assert!(q.colour(2)[0] > q.colour(2)[2]);
    }
}
