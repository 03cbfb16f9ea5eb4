//! Two scaffolds at a shared gap, as attributed hypergraphs.
//!
//! In: a coarse scaffold and the cut that both scaffolds share. Out: the elements above the cut with evidence and attributes that
//! no rigid motion changes.
//!
//! * The **cut** is the larger of the two tolerances: below it one of the scaffolds could not have kept an element.
//! * The **evidence** of a sheet, axial curve or wire is its persistence above the cut, mm: what must happen to the shape
//!   before the element is gone (a splice of Sebastian, Klein and Kimia 2004, priced in mm). An element at the cut weighs nothing, so that
//!   it does not matter which side of the cut it fell on. A node has half of what meets there. A rib says little beyond its sheet,
//!   and how ribs are split is the least stable thing of all: a quarter. Seams are a construction and carry nothing.
//! * The **attributes**: places are known by their distance from the centroid of the scaffold's sheets and wires, radii and lengths as they
//!   are.
//!
//! Cost: linear.

use super::samples::fade;
use crate::coarse_scaffold::hypergraph::{CoarseScaffold, Curve, CurveKind, MedialPoint, NodeKind};
use glam::DVec3;
use matchers::{AttributedHypergraph, CurveEnds};

/// Share of a rib's persistence that counts.
const RIB_SHARE: f64 = 0.25;
/// Share of a node's persistence that counts.
const NODE_SHARE: f64 = 0.5;
/// Places along a curve at which its radius is compared.
pub(crate) const PROFILE: usize = 9;

/// A node above the cut.
pub(crate) struct NodeFacts {
    pub(crate) id: u32,
    pub(crate) kind: NodeKind,
    pub(crate) position: DVec3,
    pub(crate) radius: f64,
    pub(crate) remoteness: f64,
    pub(crate) evidence: f64,
}

/// A curve above the cut.
pub(crate) struct CurveFacts {
    pub(crate) id: u32,
    pub(crate) kind: CurveKind,
    pub(crate) length: f64,
    pub(crate) closed: bool,
    /// Evenly spaced along the curve.
    pub(crate) profile: [MedialPoint; PROFILE],
    /// Distance of the profile's points from the centroid.
    pub(crate) remoteness: [f64; PROFILE],
    pub(crate) evidence: f64,
}

/// A sheet above the cut.
pub(crate) struct SheetFacts {
    pub(crate) id: u32,
    pub(crate) area: f64,
    pub(crate) mean_radius: f64,
    pub(crate) max_radius: f64,
    pub(crate) deviations: DVec3,
    pub(crate) centroid: DVec3,
    pub(crate) remoteness: f64,
    /// A few of its medial points, to say where it is.
    pub(crate) places: Vec<MedialPoint>,
    pub(crate) evidence: f64,
}

/// The elements of one scaffold above the cut.
pub(crate) struct Evidence {
    pub(crate) graph: AttributedHypergraph,
    pub(crate) nodes: Vec<NodeFacts>,
    pub(crate) curves: Vec<CurveFacts>,
    pub(crate) sheets: Vec<SheetFacts>,
    /// Root mean square distance of the medial points from their centroid.
    pub(crate) size_mm: f64,
}

impl Evidence {
    /// Collects what lies above the cut.
    pub(crate) fn new(scaffold: &CoarseScaffold, cut_mm: f64) -> Self {
        let (centroid, size_mm) = spread(scaffold, cut_mm);
        let above = |persistence: f64| (persistence - cut_mm).max(0.0);
        let mut out = Self {
            graph: AttributedHypergraph::new(),
            nodes: Vec::new(),
            curves: Vec::new(),
            sheets: Vec::new(),
            size_mm,
        };
        let sound = "evidence is finite and not negative, and ends are added before what refers to them";
        let mut node_slot = vec![None; scaffold.nodes.len()];
        for node in &scaffold.nodes {
            let evidence = NODE_SHARE * above(node.persistence);
            if evidence > 0.0 {
                node_slot[node.id.index()] = Some(out.graph.add_node(evidence, Vec::new()).expect(sound));
                out.nodes.push(NodeFacts {
                    id: node.id.0,
                    kind: node.kind,
                    position: node.position,
                    radius: node.radius,
                    remoteness: node.position.distance(centroid),
                    evidence,
                });
            }
        }
        let mut curve_slot = vec![None; scaffold.curves.len()];
        for curve in &scaffold.curves {
            let evidence = curve_evidence(curve, cut_mm);
            if evidence <= 0.0 || curve.polyline.is_empty() {
                continue;
            }
            let ends: Vec<_> = curve.nodes.iter().filter_map(|n| node_slot[n.index()]).collect();
            let ends = match ends[..] {
                [] => CurveEnds::Closed,
                [a] => CurveEnds::One(a),
                [a, b, ..] => CurveEnds::Two(a, b),
            };
            let slot = out.graph.add_curve(ends, evidence, Vec::new()).expect(sound);
            // Its two ends must come together for the curve to become a point.
            out.graph
                .set_contract_price(slot, Some(curve.length))
                .expect("a length is finite and not negative");
            out.graph.set_class(slot, curve.kind as u32).expect(sound);
            curve_slot[curve.id.index()] = Some(slot);
            let profile = profile(curve);
            out.curves.push(CurveFacts {
                id: curve.id.0,
                kind: curve.kind,
                length: curve.length,
                closed: curve.closed,
                remoteness: profile.map(|m| m.position.distance(centroid)),
                profile,
                evidence,
            });
        }
        for sheet in &scaffold.sheets {
            let evidence = above(sheet.persistence);
            if evidence <= 0.0 {
                continue;
            }
            // A slit is met from both sides: the curve lists the sheet twice, and so does the sheet here.
            let bounds: Vec<_> = scaffold
                .curves
                .iter()
                .flat_map(|c| c.sheets.iter().filter(|s| **s == sheet.id).map(|_| c.id))
                .filter_map(|c| curve_slot[c.index()])
                .collect();
            out.graph.add_sheet(bounds, evidence, Vec::new()).expect(sound);
            let vertices = &sheet.mesh.vertices;
            let step = vertices.len().div_ceil(40).max(1);
            out.sheets.push(SheetFacts {
                id: sheet.id.0,
                area: sheet.area,
                mean_radius: sheet.mean_radius,
                max_radius: sheet.max_radius,
                deviations: DVec3::from_array(sheet.moments.deviations),
                centroid: sheet.moments.centroid,
                remoteness: sheet.moments.centroid.distance(centroid),
                places: vertices.iter().copied().step_by(step).collect(),
                evidence,
            });
        }
        out
    }
}

/// Centroid and spread of the medial points by area, wires by half their tubes' surface; elements near the cut fade in. Sums of moments,
/// not of samples: a place must not shift with the luck of a draw.
fn spread(scaffold: &CoarseScaffold, cut_mm: f64) -> (DVec3, f64) {
    let mut parts: Vec<(f64, DVec3, f64)> = scaffold
        .sheets
        .iter()
        .map(|s| {
            let around = DVec3::from_array(s.moments.deviations).length_squared();
            (fade(s.persistence, cut_mm) * s.area, s.moments.centroid, around)
        })
        .collect();
    for c in scaffold.curves.iter().filter(|c| c.kind == CurveKind::Wire) {
        let next = c
            .polyline
            .iter()
            .skip(1)
            .chain(c.polyline.first().filter(|_| c.closed));
        for (a, b) in c.polyline.iter().zip(next) {
            let length = a.position.distance(b.position);
            let weight =
                fade(c.persistence, cut_mm) * std::f64::consts::PI * 0.5 * (a.radius + b.radius) * length;
            parts.push((weight, a.position.midpoint(b.position), length * length / 12.0));
        }
    }
    let total: f64 = parts.iter().map(|p| p.0).sum();
    if total <= 0.0 {
        return (DVec3::ZERO, 0.0);
    }
    let centroid = parts.iter().map(|p| p.1 * p.0).sum::<DVec3>() / total;
    let squares = parts.iter().map(|p| p.0 * (p.1.distance_squared(centroid) + p.2));
    (centroid, (squares.sum::<f64>() / total).sqrt())
}

/// Evidence of a curve, mm.
fn curve_evidence(curve: &Curve, cut_mm: f64) -> f64 {
    let above = (curve.persistence - cut_mm).max(0.0);
    match curve.kind {
        CurveKind::Axial | CurveKind::Wire => above,
        CurveKind::Rib => RIB_SHARE * above,
        CurveKind::Seam => 0.0,
    }
}

/// Evenly spaced points of a curve, ends included.
fn profile(curve: &Curve) -> [MedialPoint; PROFILE] {
    let mut line = curve.polyline.clone();
    if curve.closed {
        line.push(line[0]);
    }
    let mut sums = vec![0.0];
    for pair in line.windows(2) {
        sums.push(sums[sums.len() - 1] + pair[0].position.distance(pair[1].position));
    }
    let total = sums[sums.len() - 1];
    std::array::from_fn(|k| {
        let mark = total * k as f64 / (PROFILE - 1) as f64;
        let next = sums
            .partition_point(|s| *s < mark)
            .clamp(1, line.len().max(2) - 1);
        if next >= line.len() {
            return line[0];
        }
        let (a, b) = (line[next - 1], line[next]);
        let step = sums[next] - sums[next - 1];
        let t = if step > 0.0 {
            (mark - sums[next - 1]) / step
        } else {
            0.0
        };
        MedialPoint {
            position: a.position.lerp(b.position, t),
            radius: a.radius + (b.radius - a.radius) * t,
        }
    })
}
