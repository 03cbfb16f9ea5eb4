//! Surface meshes as files: PLY (with fields), STL, OBJ, OFF.
//!
//! In: a [`TriangleMesh`] in LPS mm and, for PLY, one value a vertex for each named [`VertexField`]. Out: bytes that depend
//! on the data alone. PLY is binary little endian with double coordinates, so that it reads back exactly; the frame is
//! stated in the way 3D Slicer writes and reads it (`SPACE=LPS`, in a comment or in the STL header).

use super::atomic::{WriteError, write_atomically};
use crate::geometry::TriangleMesh;
use std::io::{self, Write};
use std::path::Path;

/// The numbers of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldValues {
    /// Real numbers.
    Real(Vec<f64>),
    /// Ids and counts.
    Integer(Vec<i32>),
}

impl FieldValues {
    /// How many values there are.
    pub fn len(&self) -> usize {
        match self {
            FieldValues::Real(v) => v.len(),
            FieldValues::Integer(v) => v.len(),
        }
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A named value at every vertex (or cell), e.g. `thickness`.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexField {
    /// Property name: letters, digits and underscores; anything else is written as `_`.
    pub name: String,
    /// One value a vertex.
    pub values: FieldValues,
}

impl VertexField {
    /// A field of real numbers.
    pub fn real(name: &str, values: Vec<f64>) -> Self {
        Self {
            name: name.to_owned(),
            values: FieldValues::Real(values),
        }
    }

    /// A field of integers.
    pub fn integer(name: &str, values: Vec<i32>) -> Self {
        Self {
            name: name.to_owned(),
            values: FieldValues::Integer(values),
        }
    }
}

/// The name as a token that every reader takes.
pub(super) fn token(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect()
}

fn check_fields(mesh: &TriangleMesh, fields: &[VertexField]) -> io::Result<()> {
    for f in fields {
        if f.values.len() != mesh.points.len() {
            return Err(io::Error::other(format!(
                "field `{}` has {} values for {} vertices",
                f.name,
                f.values.len(),
                mesh.points.len()
            )));
        }
    }
    Ok(())
}

/// How PLY numbers are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlyEncoding {
    /// Binary, little endian.
    #[default]
    Binary,
    /// Text; shortest digits that read back exactly.
    Ascii,
}

/// Writes a PLY mesh with vertex fields; a mesh without triangles gives a point cloud.
///
/// # Errors
/// When a field's length is not the number of vertices, or the file cannot be written.
pub fn write_ply(
    path: &Path,
    mesh: &TriangleMesh,
    fields: &[VertexField],
    encoding: PlyEncoding,
) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        check_fields(mesh, fields)?;
        ply_header(w, mesh, fields, encoding)?;
        match encoding {
            PlyEncoding::Binary => ply_binary(w, mesh, fields),
            PlyEncoding::Ascii => ply_ascii(w, mesh, fields),
        }
    })
}

fn ply_header(
    w: &mut dyn Write,
    mesh: &TriangleMesh,
    fields: &[VertexField],
    encoding: PlyEncoding,
) -> io::Result<()> {
    let format = match encoding {
        PlyEncoding::Binary => "binary_little_endian",
        PlyEncoding::Ascii => "ascii",
    };
    writeln!(w, "ply\nformat {format} 1.0\ncomment SPACE=LPS\ncomment units mm")?;
    writeln!(w, "element vertex {}", mesh.points.len())?;
    writeln!(w, "property double x\nproperty double y\nproperty double z")?;
    for f in fields {
        let kind = match f.values {
            FieldValues::Real(_) => "double",
            FieldValues::Integer(_) => "int",
        };
        writeln!(w, "property {kind} {}", token(&f.name))?;
    }
    writeln!(w, "element face {}", mesh.triangles.len())?;
    writeln!(w, "property list uchar int vertex_indices\nend_header")
}

fn ply_binary(w: &mut dyn Write, mesh: &TriangleMesh, fields: &[VertexField]) -> io::Result<()> {
    for (i, p) in mesh.points.iter().enumerate() {
        for x in p.to_array() {
            w.write_all(&x.to_le_bytes())?;
        }
        for f in fields {
            match &f.values {
                FieldValues::Real(v) => w.write_all(&v[i].to_le_bytes())?,
                FieldValues::Integer(v) => w.write_all(&v[i].to_le_bytes())?,
            }
        }
    }
    for t in &mesh.triangles {
        w.write_all(&[3])?;
        for i in t {
            w.write_all(&i.to_le_bytes())?;
        }
    }
    Ok(())
}

fn ply_ascii(w: &mut dyn Write, mesh: &TriangleMesh, fields: &[VertexField]) -> io::Result<()> {
    for (i, p) in mesh.points.iter().enumerate() {
        write!(w, "{} {} {}", p.x, p.y, p.z)?;
        for f in fields {
            match &f.values {
                FieldValues::Real(v) => write!(w, " {}", v[i])?,
                FieldValues::Integer(v) => write!(w, " {}", v[i])?,
            }
        }
        writeln!(w)?;
    }
    for [a, b, c] in &mesh.triangles {
        writeln!(w, "3 {a} {b} {c}")?;
    }
    Ok(())
}

/// Writes a binary STL. The format holds single precision and no shared vertices.
///
/// # Errors
/// When the file cannot be written or there are more than 2^32 - 1 triangles.
pub fn write_stl(path: &Path, mesh: &TriangleMesh) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        let mut header = [b' '; 80];
        let text = b"medial-scaffold SPACE=LPS units=mm";
        header[..text.len()].copy_from_slice(text);
        w.write_all(&header)?;
        let count = u32::try_from(mesh.triangles.len()).map_err(io::Error::other)?;
        w.write_all(&count.to_le_bytes())?;
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for x in [normal, a, b, c].iter().flat_map(|v| v.to_array()) {
                w.write_all(&(x as f32).to_le_bytes())?;
            }
            w.write_all(&[0, 0])?;
        }
        Ok(())
    })
}

/// Writes a Wavefront OBJ.
///
/// # Errors
/// When the file cannot be written.
pub fn write_obj(path: &Path, mesh: &TriangleMesh) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        writeln!(w, "# SPACE=LPS\n# units mm")?;
        for p in &mesh.points {
            writeln!(w, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for t in &mesh.triangles {
            writeln!(w, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1)?;
        }
        Ok(())
    })
}

/// Writes an OFF.
///
/// # Errors
/// When the file cannot be written.
pub fn write_off(path: &Path, mesh: &TriangleMesh) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        writeln!(
            w,
            "OFF\n# SPACE=LPS\n# units mm\n{} {} 0",
            mesh.points.len(),
            mesh.triangles.len()
        )?;
        for p in &mesh.points {
            writeln!(w, "{} {} {}", p.x, p.y, p.z)?;
        }
        for [a, b, c] in &mesh.triangles {
            writeln!(w, "3 {a} {b} {c}")?;
        }
        Ok(())
    })
}

/// The mesh formats written, by file extension.
pub const MESH_EXTENSIONS: [&str; 5] = ["ply", "stl", "obj", "off", "vtp"];

/// Writes a mesh in the format its extension names (see [`MESH_EXTENSIONS`]).
///
/// # Errors
/// When the extension names no mesh format, or the file cannot be written.
pub fn write_mesh(path: &Path, mesh: &TriangleMesh, fields: &[VertexField]) -> Result<(), WriteError> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default()
        .to_ascii_lowercase();
    match extension.as_str() {
        "ply" => write_ply(path, mesh, fields, PlyEncoding::Binary),
        "stl" => write_stl(path, mesh),
        "obj" => write_obj(path, mesh),
        "off" => write_off(path, mesh),
        "vtp" => super::vtp::write_vtp(path, &super::vtp::PolyData::from_mesh(mesh, fields)),
        _ => Err(WriteError {
            path: path.to_owned(),
            source: io::Error::other(format!(
                "`.{extension}` is not a mesh format that can be written; use one of {}",
                MESH_EXTENSIONS.join(", ")
            )),
        }),
    }
}
