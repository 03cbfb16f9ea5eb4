//! VTK polydata (`.vtp`): sheets and curves with their radii and ids, as ParaView and 3D Slicer read them.
//!
//! Arrays are appended and base64-coded, little endian, uncompressed, with 64-bit headers, in a fixed order: the same data
//! give the same bytes. Points are doubles.

use super::atomic::{WriteError, write_atomically};
use super::mesh_files::{FieldValues, VertexField, token};
use crate::coarse_scaffold::hypergraph::{CoarseScaffold, CurveKind};
use crate::geometry::TriangleMesh;
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::DVec3;
use std::io;
use std::path::Path;

/// Points, polylines and polygons with data on points and on cells (lines first, then polygons, as VTK orders them).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PolyData {
    /// Positions, LPS mm.
    pub points: Vec<DVec3>,
    /// Polylines by point index.
    pub lines: Vec<Vec<u32>>,
    /// Triangles by point index.
    pub triangles: Vec<[u32; 3]>,
    /// One value a point.
    pub point_data: Vec<VertexField>,
    /// One value a cell.
    pub cell_data: Vec<VertexField>,
}

impl PolyData {
    /// A surface with its vertex fields.
    pub fn from_mesh(mesh: &TriangleMesh, fields: &[VertexField]) -> Self {
        Self {
            points: mesh.points.clone(),
            triangles: mesh.triangles.clone(),
            point_data: fields.to_vec(),
            ..Self::default()
        }
    }
}

/// Number of a curve's kind in `curves.vtp`: axial 0, rib 1, wire 2, seam 3.
pub fn curve_kind_code(kind: CurveKind) -> i32 {
    match kind {
        CurveKind::Axial => 0,
        CurveKind::Rib => 1,
        CurveKind::Wire => 2,
        CurveKind::Seam => 3,
    }
}

/// The sheets of a coarse scaffold: triangles with `radius` on points, `sheet` and `persistence` on cells.
pub fn sheets_polydata(scaffold: &CoarseScaffold) -> PolyData {
    let mut out = PolyData::default();
    let (mut radius, mut point_sheet) = (Vec::new(), Vec::new());
    let (mut sheet, mut persistence) = (Vec::new(), Vec::new());
    for s in &scaffold.sheets {
        let base = out.points.len() as u32;
        for v in &s.mesh.vertices {
            out.points.push(v.position);
            radius.push(v.radius);
            point_sheet.push(s.id.0 as i32);
        }
        for t in &s.mesh.triangles {
            out.triangles.push(t.map(|i| i + base));
            sheet.push(s.id.0 as i32);
            persistence.push(s.persistence);
        }
    }
    out.point_data = vec![
        VertexField::real("radius", radius),
        VertexField::integer("sheet", point_sheet),
    ];
    out.cell_data = vec![
        VertexField::integer("sheet", sheet),
        VertexField::real("persistence", persistence),
    ];
    out
}

/// The curves of a coarse scaffold: polylines with `radius` on points; `curve`, `kind` (see [`curve_kind_code`]),
/// `persistence` and `length` on cells. A closed curve repeats its first point in the line, not in the points.
pub fn curves_polydata(scaffold: &CoarseScaffold) -> PolyData {
    let mut out = PolyData::default();
    let mut radius = Vec::new();
    let (mut ids, mut kinds, mut persistence, mut length) = (vec![], vec![], vec![], vec![]);
    for c in scaffold.curves.iter().filter(|c| c.polyline.len() > 1) {
        let base = out.points.len() as u32;
        for p in &c.polyline {
            out.points.push(p.position);
            radius.push(p.radius);
        }
        let mut line: Vec<u32> = (0..c.polyline.len() as u32).map(|i| base + i).collect();
        if c.closed {
            line.push(base);
        }
        out.lines.push(line);
        ids.push(c.id.0 as i32);
        kinds.push(curve_kind_code(c.kind));
        persistence.push(c.persistence);
        length.push(c.length);
    }
    out.point_data = vec![VertexField::real("radius", radius)];
    out.cell_data = vec![
        VertexField::integer("curve", ids),
        VertexField::integer("kind", kinds),
        VertexField::real("persistence", persistence),
        VertexField::real("length", length),
    ];
    out
}

/// Appended arrays: one base64 block an array, each a 64-bit byte count and the bytes.
#[derive(Default)]
struct Appended {
    text: String,
}

impl Appended {
    fn push(&mut self, bytes: &[u8]) -> usize {
        let offset = self.text.len();
        let mut block = Vec::with_capacity(bytes.len() + 8);
        block.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
        block.extend_from_slice(bytes);
        STANDARD.encode_string(&block, &mut self.text);
        offset
    }
}

fn array(appended: &mut Appended, kind: &str, name: &str, components: usize, bytes: &[u8]) -> String {
    let offset = appended.push(bytes);
    format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{offset}\"/>\n"
    )
}

fn field_arrays(appended: &mut Appended, fields: &[VertexField]) -> String {
    fields
        .iter()
        .map(|f| {
            let name = token(&f.name);
            match &f.values {
                FieldValues::Real(v) => {
                    array(appended, "Float64", &name, 1, &le_bytes(v, |x| x.to_le_bytes()))
                }
                FieldValues::Integer(v) => {
                    array(appended, "Int32", &name, 1, &le_bytes(v, |x| x.to_le_bytes()))
                }
            }
        })
        .collect()
}

fn le_bytes<T: Copy, const N: usize>(values: &[T], bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&v| bytes(v)).collect()
}

fn cells<'a>(appended: &mut Appended, cells: impl Iterator<Item = &'a [u32]>) -> String {
    let (mut connectivity, mut offsets) = (Vec::<i64>::new(), Vec::<i64>::new());
    for cell in cells {
        connectivity.extend(cell.iter().map(|&i| i64::from(i)));
        offsets.push(connectivity.len() as i64);
    }
    let mut out = array(
        appended,
        "Int64",
        "connectivity",
        1,
        &le_bytes(&connectivity, i64::to_le_bytes),
    );
    out += &array(
        appended,
        "Int64",
        "offsets",
        1,
        &le_bytes(&offsets, i64::to_le_bytes),
    );
    out
}

fn check(data: &PolyData) -> io::Result<()> {
    let cells = data.lines.len() + data.triangles.len();
    for (fields, n, what) in [
        (&data.point_data, data.points.len(), "points"),
        (&data.cell_data, cells, "cells"),
    ] {
        if let Some(f) = fields.iter().find(|f| f.values.len() != n) {
            return Err(io::Error::other(format!(
                "field `{}` has {} values for {n} {what}",
                f.name,
                f.values.len()
            )));
        }
    }
    Ok(())
}

/// Writes a `.vtp`.
///
/// # Errors
/// When a field's length is not that of its points or cells, or the file cannot be written.
pub fn write_vtp(path: &Path, data: &PolyData) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        check(data)?;
        w.write_all(vtp_text(data).as_bytes())
    })
}

fn vtp_text(data: &PolyData) -> String {
    let mut appended = Appended::default();
    let mut xml = String::from("<?xml version=\"1.0\"?>\n<!-- SPACE=LPS units=mm -->\n");
    xml += "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n";
    xml += &format!(
        "<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"{}\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n",
        data.points.len(),
        data.lines.len(),
        data.triangles.len()
    );
    xml += &format!(
        "<PointData>\n{}</PointData>\n",
        field_arrays(&mut appended, &data.point_data)
    );
    xml += &format!(
        "<CellData>\n{}</CellData>\n",
        field_arrays(&mut appended, &data.cell_data)
    );
    let coordinates: Vec<f64> = data.points.iter().flat_map(|p| p.to_array()).collect();
    let points = array(
        &mut appended,
        "Float64",
        "Points",
        3,
        &le_bytes(&coordinates, f64::to_le_bytes),
    );
    xml += &format!("<Points>\n{points}</Points>\n");
    let lines = cells(&mut appended, data.lines.iter().map(Vec::as_slice));
    xml += &format!("<Lines>\n{lines}</Lines>\n");
    let polys = cells(&mut appended, data.triangles.iter().map(<[u32; 3]>::as_slice));
    xml += &format!("<Polys>\n{polys}</Polys>\n</Piece>\n</PolyData>\n");
    xml += &format!(
        "<AppendedData encoding=\"base64\">\n_{}\n</AppendedData>\n</VTKFile>\n",
        appended.text
    );
    xml
}
