//! Small text files with a fixed layout: the fine scaffold (`.ma`), ITK transforms (`.tfm`), CSV tables.

use super::atomic::{WriteError, write_atomically};
use crate::coarse_scaffold::hypergraph::{CoarseScaffold, CurveKind, MedialPoint};
use crate::geometry::Rigid;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// A medial mesh as the `.ma` files of Q-MAT and its successors hold it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MedialMesh {
    /// Vertices with radii.
    pub vertices: Vec<MedialPoint>,
    /// Edges by vertex index.
    pub edges: Vec<[u32; 2]>,
    /// Triangles by vertex index.
    pub triangles: Vec<[u32; 3]>,
}

impl MedialMesh {
    /// The sheets, wires and seams of a coarse scaffold as one complex: points with equal coordinates and radius (those that
    /// sheets share along axial curves) are one vertex. Vertices come in order of first use; edges and triangles are sorted
    /// and named once.
    pub fn from_scaffold(scaffold: &CoarseScaffold) -> Self {
        let mut out = Self::default();
        let mut known: BTreeMap<[u64; 4], u32> = BTreeMap::new();
        for s in &scaffold.sheets {
            let ids: Vec<u32> = s.mesh.vertices.iter().map(|&v| out.weld(&mut known, v)).collect();
            for t in &s.mesh.triangles {
                let [a, b, c] = t.map(|i| ids[i as usize]);
                out.triangles.push([a, b, c]);
                out.edges
                    .extend([(a, b), (b, c), (c, a)].map(|(a, b)| [a.min(b), a.max(b)]));
            }
        }
        // Axial curves and ribs lie on sheets and are in their triangles already.
        for c in &scaffold.curves {
            if matches!(c.kind, CurveKind::Wire | CurveKind::Seam) {
                let mut ids: Vec<u32> = c.polyline.iter().map(|&v| out.weld(&mut known, v)).collect();
                if c.closed {
                    ids.extend(ids.first().copied());
                }
                out.edges
                    .extend(ids.windows(2).map(|e| [e[0].min(e[1]), e[0].max(e[1])]));
            }
        }
        out.edges.retain(|e| e[0] != e[1]);
        out.edges.sort_unstable();
        out.edges.dedup();
        out
    }

    fn weld(&mut self, known: &mut BTreeMap<[u64; 4], u32>, v: MedialPoint) -> u32 {
        let key = <[f64; 4]>::from(v).map(f64::to_bits);
        *known.entry(key).or_insert_with(|| {
            self.vertices.push(v);
            self.vertices.len() as u32 - 1
        })
    }
}

/// Writes `V E F` counts, then `v x y z r`, `e i j`, `f i j k` (indices from 0, shortest exact digits).
///
/// # Errors
/// When the file cannot be written.
pub fn write_ma(path: &Path, mesh: &MedialMesh) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        writeln!(
            w,
            "{} {} {}",
            mesh.vertices.len(),
            mesh.edges.len(),
            mesh.triangles.len()
        )?;
        for v in &mesh.vertices {
            let p = v.position;
            writeln!(w, "v {} {} {} {}", p.x, p.y, p.z, v.radius)?;
        }
        for [a, b] in &mesh.edges {
            writeln!(w, "e {a} {b}")?;
        }
        for [a, b, c] in &mesh.triangles {
            writeln!(w, "f {a} {b} {c}")?;
        }
        Ok(())
    })
}

/// Writes an ITK text transform that shows the source aligned when it is applied, in 3D Slicer or with ANTs, to the source
/// **image**.
///
/// ITK transforms take points of the target (fixed) space to the source (moving) space, the reverse of the matrix that
/// moves points; so what is stored is the **inverse** of `T_target_source`, in LPS mm, as an `AffineTransform_double_3_3`
/// (reflections and scales allowed). 3D Slicer inverts it again on loading, so a linear transform node made from the
/// file moves the source model onto the target.
///
/// # Errors
/// When the file cannot be written.
#[allow(non_snake_case)]
pub fn write_tfm(path: &Path, T_target_source: &Rigid) -> Result<(), WriteError> {
    let rows = T_target_source.inverse().to_rows();
    write_atomically(path, |w| {
        writeln!(w, "#Insight Transform File V1.0")?;
        writeln!(w, "#Transform 0")?;
        writeln!(w, "Transform: AffineTransform_double_3_3")?;
        let linear = rows.iter().take(3).flat_map(|r| r[..3].to_vec());
        let shift = rows.iter().take(3).map(|r| r[3]);
        let numbers: Vec<String> = linear.chain(shift).map(|x| x.to_string()).collect();
        writeln!(w, "Parameters: {}", numbers.join(" "))?;
        writeln!(w, "FixedParameters: 0 0 0")
    })
}

/// Writes a table as RFC 4180 CSV: one header, decimal points, fields quoted where needed.
///
/// # Errors
/// When a row's length is not that of the header, or the file cannot be written.
pub fn write_csv<S: AsRef<str>>(path: &Path, header: &[S], rows: &[Vec<String>]) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        let mut csv = csv::Writer::from_writer(w);
        csv.write_record(header.iter().map(AsRef::as_ref))
            .map_err(io::Error::other)?;
        for row in rows {
            csv.write_record(row).map_err(io::Error::other)?;
        }
        csv.flush()
    })
}
