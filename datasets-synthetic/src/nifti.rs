//! A minimal NIfTI-1 writer for label masks (`.nii`, `.nii.gz`).
//!
//! 348-byte little-endian header, four bytes of padding, then `uint16` labels, x fastest. World coordinates go out as NIfTI's RAS through
//! both the sform (exact affine) and the qform (the same as quaternion), codes 1; LPS to RAS flips the first two axes.
//! See Cox et al. 2004 and the header `nifti1.h`.

use crate::masks::LabelMask;
use flate2::{Compression, GzBuilder};
use glam::{DMat3, DQuat, DVec3};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Byte offsets of the header's fields that are not zero.
mod at {
    pub const SIZE: usize = 0;
    pub const REGULAR: usize = 38;
    pub const DIM: usize = 40;
    pub const DATATYPE: usize = 70;
    pub const BITPIX: usize = 72;
    pub const PIXDIM: usize = 76;
    pub const VOX_OFFSET: usize = 108;
    pub const SCL_SLOPE: usize = 112;
    pub const XYZT_UNITS: usize = 123;
    pub const DESCRIPTION: usize = 148;
    pub const INTENT: usize = 68;
    pub const QFORM_CODE: usize = 252;
    pub const SFORM_CODE: usize = 254;
    pub const QUATERN: usize = 256;
    pub const QOFFSET: usize = 268;
    pub const SROW: usize = 280;
    pub const MAGIC: usize = 344;
}

const UINT16: i16 = 512;
const INTENT_LABEL: i16 = 1002;
const MILLIMETRES: u8 = 2;

/// The 352 bytes before the voxels.
fn header(mask: &LabelMask) -> [u8; 352] {
    let mut h = [0u8; 352];
    let grid = &mask.grid;
    let mut put = |offset: usize, bytes: &[u8]| h[offset..offset + bytes.len()].copy_from_slice(bytes);
    put(at::SIZE, &348i32.to_le_bytes());
    put(at::REGULAR, b"r");
    let dim = [
        3,
        grid.size[0] as i16,
        grid.size[1] as i16,
        grid.size[2] as i16,
        1,
        1,
        1,
        1,
    ];
    dim.iter()
        .enumerate()
        .for_each(|(k, d)| put(at::DIM + 2 * k, &d.to_le_bytes()));
    put(at::INTENT, &INTENT_LABEL.to_le_bytes());
    put(at::DATATYPE, &UINT16.to_le_bytes());
    put(at::BITPIX, &16i16.to_le_bytes());
    let flip = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
    let ras = flip * grid.direction;
    let origin = flip * grid.origin_mm;
    // The quaternion holds a proper rotation; a mirrored grid says so through qfac = -1.
    let qfac = if ras.determinant() < 0.0 { -1.0 } else { 1.0 };
    let proper = DMat3::from_cols(ras.x_axis, ras.y_axis, ras.z_axis * qfac);
    let q = DQuat::from_mat3(&proper);
    let q = if q.w < 0.0 { -q } else { q };
    let s = grid.spacing_mm;
    [qfac, s.x, s.y, s.z]
        .iter()
        .enumerate()
        .for_each(|(k, v)| put(at::PIXDIM + 4 * k, &(*v as f32).to_le_bytes()));
    put(at::VOX_OFFSET, &352f32.to_le_bytes());
    put(at::SCL_SLOPE, &1f32.to_le_bytes());
    put(at::XYZT_UNITS, &[MILLIMETRES]);
    put(at::DESCRIPTION, b"synthetic label mask, truth beside it");
    put(at::QFORM_CODE, &1i16.to_le_bytes());
    put(at::SFORM_CODE, &1i16.to_le_bytes());
    [q.x, q.y, q.z]
        .iter()
        .enumerate()
        .for_each(|(k, v)| put(at::QUATERN + 4 * k, &(*v as f32).to_le_bytes()));
    let (ox, oy, oz) = (origin.x, origin.y, origin.z);
    [ox, oy, oz]
        .iter()
        .enumerate()
        .for_each(|(k, v)| put(at::QOFFSET + 4 * k, &(*v as f32).to_le_bytes()));
    for row in 0..3 {
        let line = [
            ras.x_axis[row] * s.x,
            ras.y_axis[row] * s.y,
            ras.z_axis[row] * s.z,
            origin[row],
        ];
        for (k, v) in line.iter().enumerate() {
            put(at::SROW + 16 * row + 4 * k, &(*v as f32).to_le_bytes());
        }
    }
    put(at::MAGIC, b"n+1\0");
    h
}

/// Writes a mask, uncompressed.
///
/// # Errors
/// Those of the writer, and `InvalidInput` when an axis has more than 32 767 voxels.
pub fn write(out: &mut impl Write, mask: &LabelMask) -> io::Result<()> {
    if mask.grid.size.iter().any(|&n| n > i16::MAX as usize) {
        let text = format!(
            "NIfTI-1 holds at most {} voxels along an axis, not {:?}",
            i16::MAX,
            mask.grid.size
        );
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
    }
    out.write_all(&header(mask))?;
    let bytes: Vec<u8> = mask.labels.iter().flat_map(|l| l.to_le_bytes()).collect();
    out.write_all(&bytes)
}

/// Writes a mask to a file; compressed when the name ends in `.gz` (no time stamp, so equal masks give equal bytes).
///
/// # Errors
/// Those of the file system and of [`write()`].
pub fn save(path: &Path, mask: &LabelMask) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    if path.extension().is_some_and(|e| e == "gz") {
        let mut packed = GzBuilder::new().mtime(0).write(&mut file, Compression::default());
        write(&mut packed, mask)?;
        packed.finish()?;
    } else {
        write(&mut file, mask)?;
    }
    file.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masks::{VoxelGrid, sphere_mask};

    fn float(h: &[u8], offset: usize) -> f64 {
        f32::from_le_bytes(h[offset..offset + 4].try_into().expect("four bytes")) as f64
    }

    #[test]
    fn both_forms_place_voxels_at_their_lps_centres() {
        let base = sphere_mask(6.0, DVec3::new(0.5, 0.75, 2.0));
        let turned = base.grid.turned(crate::rigid::random_rotation(8));
        let mirrored = DMat3::from_cols(DVec3::X, DVec3::Y, -DVec3::Z);
        for grid in [
            base.grid,
            turned,
            VoxelGrid {
                direction: mirrored,
                ..base.grid
            },
        ] {
            let mask = LabelMask {
                grid,
                labels: base.labels.clone(),
            };
            let mut bytes = Vec::new();
            write(&mut bytes, &mask).expect("writing to memory");
            assert_eq!(bytes.len(), 352 + 2 * grid.len());
            let index = DVec3::new(3.0, 1.0, 2.0);
            let lps = grid.centre(index);
            let ras = DVec3::new(-lps.x, -lps.y, lps.z);
            let by_sform = DVec3::from_array(std::array::from_fn(|row| {
                let v = |k: usize| float(&bytes, at::SROW + 16 * row + 4 * k);
                v(0) * index.x + v(1) * index.y + v(2) * index.z + v(3)
            }));
            assert!(by_sform.distance(ras) < 1e-5);
            // The qform as nifti1.h defines it.
            let [b, c, d] = [0, 4, 8].map(|k| float(&bytes, at::QUATERN + k));
            let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
            let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a));
            let p = |k: usize| float(&bytes, at::PIXDIM + 4 * k);
            let scaled = DVec3::new(p(1) * index.x, p(2) * index.y, p(0) * p(3) * index.z);
            let offset = DVec3::new(
                float(&bytes, at::QOFFSET),
                float(&bytes, at::QOFFSET + 4),
                float(&bytes, at::QOFFSET + 8),
            );
            assert!((rotation * scaled + offset).distance(ras) < 1e-4);
        }
    }
}
