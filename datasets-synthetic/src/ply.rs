//! A small writer of binary little-endian PLY, so that data sets can be read by any tool.
//!
//! Coordinates are `double`; the header says `comment SPACE=LPS` and `comment UNITS=mm`.

use crate::cloud::Cloud;
use crate::mesh::TriangleMesh;
use glam::DVec3;
use std::io::{self, Write};

fn header(out: &mut impl Write, vertices: usize, normals: bool, faces: Option<usize>) -> io::Result<()> {
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment SPACE=LPS\ncomment UNITS=mm\nelement vertex {vertices}\n"
    )?;
    for name in ["x", "y", "z"] {
        writeln!(out, "property double {name}")?;
    }
    if normals {
        for name in ["nx", "ny", "nz"] {
            writeln!(out, "property double {name}")?;
        }
    }
    if let Some(faces) = faces {
        write!(
            out,
            "element face {faces}\nproperty list uchar int vertex_indices\n"
        )?;
    }
    writeln!(out, "end_header")
}

fn vector(out: &mut impl Write, p: DVec3) -> io::Result<()> {
    p.to_array()
        .iter()
        .try_for_each(|x| out.write_all(&x.to_le_bytes()))
}

/// Writes a mesh.
///
/// # Errors
/// Those of the writer.
pub fn write_mesh(out: &mut impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    header(out, mesh.points.len(), false, Some(mesh.triangles.len()))?;
    mesh.points.iter().try_for_each(|&p| vector(out, p))?;
    for t in &mesh.triangles {
        out.write_all(&[3])?;
        t.iter()
            .try_for_each(|&v| out.write_all(&(v as i32).to_le_bytes()))?;
    }
    Ok(())
}

/// Writes a cloud, with its normals when `with_normals` and it has them.
///
/// # Errors
/// Those of the writer.
pub fn write_cloud(out: &mut impl Write, cloud: &Cloud, with_normals: bool) -> io::Result<()> {
    let normals = with_normals && cloud.normals.len() == cloud.len();
    header(out, cloud.len(), normals, None)?;
    for i in 0..cloud.len() {
        vector(out, cloud.points[i])?;
        if normals {
            vector(out, cloud.normals[i])?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_from_the_header() {
        let mesh = crate::shapes::sphere(1.0).mesh(80);
        let mut bytes = Vec::new();
        write_mesh(&mut bytes, &mesh).expect("writing to memory");
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
        assert_eq!(
            bytes.len() - start,
            24 * mesh.points.len() + 13 * mesh.triangles.len()
        );
        let x = f64::from_le_bytes(bytes[start..start + 8].try_into().expect("eight bytes"));
        assert_eq!(x, mesh.points[0].x);
        let cloud = crate::sample_uniform(&mesh, 10, 1);
        let mut with = Vec::new();
        write_cloud(&mut with, &cloud, true).expect("writing to memory");
        assert!(with.ends_with(&cloud.normals[9].z.to_le_bytes()));
    }
}
