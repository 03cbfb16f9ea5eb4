//! Label volumes: the part all volume formats share. Voxels are read in small blocks, so a header cannot make us reserve
//! more than the file can fill.

use crate::input::{
    decompress,
    error::{Fault, Flaw, Place},
    scalar::{Endian, Scalar},
};
use std::io::Read;

/// Bytes decoded at a time; a multiple of every scalar size.
const BLOCK: usize = 1 << 16;

/// A volume's shape and number type, as its header says.
#[derive(Clone, Copy, Debug)]
pub(in crate::input) struct Layout {
    pub(in crate::input) dims: [usize; 3],
    pub(in crate::input) scalar: Scalar,
    pub(in crate::input) endian: Endian,
    /// Stored value times `slope` plus `intercept` is the label.
    pub(in crate::input) slope: f64,
    pub(in crate::input) intercept: f64,
}

/// How the voxels are stored.
pub(in crate::input) enum Stored<'a> {
    Raw(&'a [u8]),
    /// gzip or zlib.
    Deflated(&'a [u8]),
    Text(&'a [u8]),
}

/// Sizes from a header: each at least one, together no more than allowed.
pub(in crate::input) fn checked_dims(dims: [i64; 3], max_voxels: u64) -> Result<[usize; 3], Flaw> {
    let show = format!("{} x {} x {}", dims[0], dims[1], dims[2]);
    if dims.iter().any(|&d| d < 1) {
        return Err(Flaw::file(
            Fault::Header,
            format!("the grid is {show} voxels"),
            "every side needs at least one voxel: the header is damaged, export the file again",
        ));
    }
    let total = dims.iter().fold(1u64, |a, &d| a.saturating_mul(d as u64));
    if total > max_voxels {
        return Err(Flaw::file(
            Fault::TooLarge,
            format!("the header says {show} voxels, more than the {max_voxels} allowed"),
            "crop the image to the structure (or raise the limit on voxels when the size is right)",
        ));
    }
    Ok(dims.map(|d| d as usize))
}

/// Reads the voxels as labels.
pub(in crate::input) fn labels(layout: Layout, stored: &Stored) -> Result<Vec<i32>, Flaw> {
    let count: usize = layout.dims.iter().product();
    let bytes = count as u64 * layout.scalar.size() as u64;
    match stored {
        Stored::Raw(data) => {
            if (data.len() as u64) < bytes {
                return Err(Flaw::truncated(
                    Place::File,
                    format!(
                        "the header says {count} voxels ({bytes} bytes), but {} bytes of voxels follow",
                        data.len()
                    ),
                ));
            }
            from_reader(layout, count, *data)
        }
        Stored::Deflated(data) => {
            decompress::believable(bytes, data.len() as u64)?;
            from_reader(layout, count, decompress::any_reader(data))
        }
        Stored::Text(data) => from_text(layout, count, data),
    }
}

/// Reads `count` voxels from a stream, block by block.
pub(in crate::input) fn from_reader(
    layout: Layout,
    count: usize,
    mut source: impl Read,
) -> Result<Vec<i32>, Flaw> {
    let size = layout.scalar.size();
    let mut values: Vec<i32> = Vec::new();
    let mut buffer = vec![0u8; BLOCK];
    while values.len() < count {
        let wanted = (count - values.len()).saturating_mul(size).min(BLOCK);
        let mut filled = 0;
        while filled < wanted {
            match source.read(&mut buffer[filled..wanted]) {
                Ok(0) => {
                    return Err(Flaw::truncated(
                        Place::File,
                        format!(
                            "the header says {count} voxels, the data end after {}",
                            values.len() + filled / size
                        ),
                    ));
                }
                Ok(n) => filled += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(decompress::broken((values.len() * size + filled) as u64, &e)),
            }
        }
        for item in buffer[..filled].chunks_exact(size) {
            let value = layout.label(item, values.len())?;
            values.push(value);
        }
    }
    Ok(values)
}

fn from_text(layout: Layout, count: usize, data: &[u8]) -> Result<Vec<i32>, Flaw> {
    let mut scan = crate::input::scan::Scan::new(data);
    scan.promise(count as i64 - 1, "voxels", 2)?;
    (0..count)
        .map(|i| {
            let v = scan.number("a voxel")?;
            whole(v * layout.slope + layout.intercept, i)
        })
        .collect()
}

impl Layout {
    fn label(&self, item: &[u8], index: usize) -> Result<i32, Flaw> {
        if !self.scalar.is_float() && self.slope == 1.0 && self.intercept == 0.0 {
            let v = self.scalar.integer(item, self.endian);
            return i32::try_from(v).map_err(|_| not_a_label(v as f64, index));
        }
        whole(
            self.scalar.float(item, self.endian) * self.slope + self.intercept,
            index,
        )
    }
}

/// A label from a float: whole within rounding.
fn whole(v: f64, index: usize) -> Result<i32, Flaw> {
    let r = v.round();
    if (v - r).abs() <= 1e-3 && r.abs() < f64::from(i32::MAX) {
        Ok(r as i32)
    } else {
        Err(not_a_label(v, index))
    }
}

fn not_a_label(v: f64, index: usize) -> Flaw {
    Flaw::new(
        Place::Element {
            kind: "voxel",
            index: index as u64,
        },
        Fault::Number,
        format!("the value is {v}"),
        "labels are whole numbers; this looks like an image: segment it or give its label map",
    )
}
