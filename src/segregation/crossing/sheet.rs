//! One sheet near a line, triangulated in its own two coordinates.
//!
//! In: a line, the points of one sheet near it, the rim of the triangles that were left. Out: triangles between the line and that
//! rim, on the halves that exist.
//!
//! 1. Coordinates: the length along the line and the distance off it, negative on the second half; for a loop the ring of that width.
//! 2. Constrained Delaunay triangulation (`spade`), the steps of the line and the edges of the rim as constraints.
//! 3. The triangles that can be reached from the line without passing a constraint, unless they are larger than the points explain.

use super::line::{Line, Place};
use glam::DVec3;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Longest edge, spacings.
const LONGEST: f64 = 5.0;
/// Least inner radius of a loop's ring over its width.
const RING: f64 = 1.5;

/// What is to be triangulated.
pub(super) struct Sheet<'a> {
    pub line: &'a Line,
    /// Point of the line's first station; the others follow.
    pub first_station: u32,
    /// Which halves exist.
    pub halves: [bool; 2],
    pub points: &'a [DVec3],
    /// Points without triangles.
    pub free: Vec<(u32, Place)>,
    /// Edges with one triangle left.
    pub rim: Vec<((u32, Place), (u32, Place))>,
}

struct Corner {
    position: Point2<f64>,
    point: u32,
}

impl HasPosition for Corner {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

impl Sheet<'_> {
    /// Signed distance off the line.
    fn off(&self, place: &Place) -> f64 {
        match place.half {
            Some(h) if h % 2 == 1 => -place.off_mm,
            _ => place.off_mm,
        }
    }

    fn ring_mm(&self) -> f64 {
        let widest = self
            .free
            .iter()
            .map(|(_, p)| p.off_mm)
            .chain(self.rim.iter().flat_map(|(a, b)| [a.1.off_mm, b.1.off_mm]))
            .fold(0.0, f64::max);
        (self.line.length_mm / TAU).max(RING * widest)
    }

    fn position(&self, along_mm: f64, off_mm: f64, ring_mm: f64) -> Point2<f64> {
        // No coordinate so small that it would underflow in the triangulation.
        let clean = |x: f64| {
            if x.abs() < 1e-12 * self.line.length_mm {
                0.0
            } else {
                x
            }
        };
        if self.line.closed {
            let (sin, cos) = (TAU * along_mm / self.line.length_mm).sin_cos();
            Point2::new(clean((ring_mm + off_mm) * cos), clean((ring_mm + off_mm) * sin))
        } else {
            Point2::new(clean(along_mm), clean(off_mm))
        }
    }
}

/// The triangles of a sheet; see the module.
pub(super) fn triangulate(sheet: &Sheet) -> Vec<[u32; 3]> {
    let mut flat: ConstrainedDelaunayTriangulation<Corner> = ConstrainedDelaunayTriangulation::new();
    let ring_mm = sheet.ring_mm();
    let mut off_of: BTreeMap<u32, f64> = BTreeMap::new();
    let mut corner_of = BTreeMap::new();
    let mut insert =
        |flat: &mut ConstrainedDelaunayTriangulation<Corner>, point: u32, along: f64, off: f64| {
            if let Some(&known) = corner_of.get(&point) {
                return Some(known);
            }
            let position = sheet.position(along, off, ring_mm);
            let corner = flat.insert(Corner { position, point }).ok()?;
            off_of.insert(point, off);
            corner_of.insert(point, corner);
            Some(corner)
        };
    let stations: Vec<_> = (0..sheet.line.stations.len())
        .filter_map(|k| {
            insert(
                &mut flat,
                sheet.first_station + k as u32,
                sheet.line.at_mm(k),
                0.0,
            )
        })
        .collect();
    for (v, place) in &sheet.free {
        insert(&mut flat, *v, place.along_mm, sheet.off(place));
    }
    let mut constraints: Vec<_> = (0..sheet.line.steps())
        .map(|k| (stations[k], stations[(k + 1) % stations.len()]))
        .collect();
    for ((a, p), (b, q)) in &sheet.rim {
        let ends = (
            insert(&mut flat, *a, p.along_mm, sheet.off(p)),
            insert(&mut flat, *b, q.along_mm, sheet.off(q)),
        );
        if let (Some(a), Some(b)) = ends {
            constraints.push((a, b));
        }
    }
    for (a, b) in constraints {
        if a != b && flat.can_add_constraint(a, b) {
            flat.add_constraint(a, b);
        }
    }
    reachable(sheet, &flat, &off_of)
}

/// Step 3.
fn reachable(
    sheet: &Sheet,
    flat: &ConstrainedDelaunayTriangulation<Corner>,
    off_of: &BTreeMap<u32, f64>,
) -> Vec<[u32; 3]> {
    let is_station =
        |v: u32| v >= sheet.first_station && v < sheet.first_station + sheet.line.stations.len() as u32;
    let longest = LONGEST * sheet.line.spacing_mm;
    let accepted = |t: [u32; 3]| {
        let p = t.map(|v| sheet.points[v as usize]);
        let size = p[0]
            .distance(p[1])
            .max(p[1].distance(p[2]))
            .max(p[2].distance(p[0]));
        size <= longest && !t.iter().all(|&v| is_station(v))
    };
    let mut seen = vec![false; flat.num_all_faces()];
    let mut stack = Vec::new();
    for face in flat.inner_faces() {
        let t = face.vertices().map(|v| v.data().point);
        let at_line = face
            .adjacent_edges()
            .iter()
            .any(|e| e.is_constraint_edge() && e.vertices().iter().all(|v| is_station(v.data().point)));
        let off: f64 = t.iter().map(|v| off_of[v]).sum();
        if at_line && sheet.halves[usize::from(off < 0.0)] {
            stack.push(face.fix());
        }
    }
    let mut out = Vec::new();
    while let Some(face) = stack.pop() {
        if std::mem::replace(&mut seen[face.index()], true) {
            continue;
        }
        let face = flat.face(face);
        let t = face.vertices().map(|v| v.data().point);
        if !accepted(t) {
            continue;
        }
        out.push(t);
        for edge in face.adjacent_edges() {
            if !edge.is_constraint_edge()
                && let Some(next) = edge.rev().face().as_inner()
                && !seen[next.fix().index()]
            {
                stack.push(next.fix());
            }
        }
    }
    out.sort_unstable();
    out
}
