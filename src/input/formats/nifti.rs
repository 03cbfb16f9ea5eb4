//! NIfTI-1 and NIfTI-2 label maps in one file (`.nii`, `.nii.gz`), both byte orders.
//!
//! The affine is the sform when its code is set, else the qform, else the voxel sizes alone (with a warning: such a file does
//! not say where it lies). NIfTI coordinates are RAS; units come from `xyzt_units`.

use super::volume::{self, Layout, Stored};
use crate::input::{
    decompress,
    error::{Fault, Flaw, Place},
    parsed::{Content, Frame, Parsed, Stated, Units, Volume},
    scalar::{Endian, Scalar},
    shape::SourceFormat,
};
use glam::{DMat3, DVec3};
use std::io::Read;

const HEADER_1: usize = 348;
const HEADER_2: usize = 540;

/// Whether the bytes begin like a NIfTI file, in one file or as a separate header.
pub(in crate::input) fn is_nifti(head: &[u8]) -> bool {
    Header::variant(head).is_some()
}

/// Reads a NIfTI file, gzipped or not.
pub(in crate::input) fn read(bytes: &[u8], max_voxels: u64) -> Result<Parsed, Flaw> {
    let packed = decompress::is_gzip(bytes);
    let head = if packed {
        decompress::gzip_head(bytes, HEADER_2)
    } else {
        bytes[..bytes.len().min(HEADER_2)].to_vec()
    };
    let header = Header::read(&head)?;
    let dims = volume::checked_dims(header.dims()?, max_voxels)?;
    let offset = header.data_offset(if packed { u64::MAX } else { bytes.len() as u64 })?;
    let (slope, intercept) = header.scaling();
    let layout = Layout {
        dims,
        scalar: header.scalar()?,
        endian: header.endian,
        slope,
        intercept,
    };
    let values = if packed {
        let count: usize = dims.iter().product();
        let expected = (count as u64 * layout.scalar.size() as u64).saturating_add(offset);
        decompress::believable(expected, bytes.len() as u64)?;
        let mut stream = decompress::gzip_reader(bytes);
        std::io::copy(&mut (&mut stream).take(offset), &mut std::io::sink())
            .map_err(|e| decompress::broken(0, &e))?;
        volume::from_reader(layout, count, stream)?
    } else {
        volume::labels(layout, &Stored::Raw(&bytes[offset as usize..]))?
    };
    let mut warnings = Vec::new();
    let affine = header.affine(&mut warnings)?;
    Ok(Parsed {
        notes: Vec::new(),
        format: SourceFormat::Nifti,
        content: Content::Volume(Volume {
            dims,
            values,
            steps: affine.steps,
            origin: affine.origin,
        }),
        frame: Some(Stated {
            value: Frame::Ras,
            by: format!("the NIfTI format ({})", affine.source),
        }),
        units: header.units().map(|value| Stated {
            value,
            by: "the NIfTI header".into(),
        }),
        warnings,
    })
}

struct Affine {
    steps: DMat3,
    origin: DVec3,
    source: &'static str,
}

/// A header with the offsets of its fields; NIfTI-2 has wider ones at other places.
struct Header<'a> {
    bytes: &'a [u8],
    endian: Endian,
    wide: bool,
}

impl<'a> Header<'a> {
    fn variant(head: &[u8]) -> Option<(Endian, bool)> {
        let size = head.get(..4)?;
        for endian in [Endian::Little, Endian::Big] {
            match Scalar::I32.integer(size, endian) as usize {
                HEADER_1 if matches!(head.get(344..347), Some(b"n+1" | b"ni1")) => {
                    return Some((endian, false));
                }
                HEADER_2 if matches!(head.get(4..7), Some(b"n+2" | b"ni2")) => return Some((endian, true)),
                _ => {}
            }
        }
        None
    }

    fn read(bytes: &'a [u8]) -> Result<Self, Flaw> {
        let Some((endian, wide)) = Self::variant(bytes) else {
            return Err(Flaw::new(
                Place::Byte(0),
                Fault::Header,
                "the header is no NIfTI header",
                "the file is damaged or of another format: export it again",
            ));
        };
        let magic = if wide { &bytes[4..7] } else { &bytes[344..347] };
        if magic.starts_with(b"ni") {
            return Err(Flaw::new(
                Place::Byte(if wide { 4 } else { 344 }),
                Fault::Unsupported,
                "the header and the voxels are in two files (.hdr and .img)",
                "save it as one file, .nii or .nii.gz",
            ));
        }
        let needed = if wide { HEADER_2 } else { HEADER_1 };
        if bytes.len() < needed {
            return Err(Flaw::truncated(
                Place::Byte(bytes.len() as u64),
                format!("the header has {} bytes of {needed}", bytes.len()),
            ));
        }
        Ok(Self { bytes, endian, wide })
    }

    fn int(&self, scalar: Scalar, at: usize) -> i64 {
        scalar.integer(&self.bytes[at..at + scalar.size()], self.endian)
    }

    /// A float field: 32 bits in NIfTI-1, 64 in NIfTI-2.
    fn float(&self, at_1: usize, at_2: usize, index: usize) -> f64 {
        let (scalar, at) = if self.wide {
            (Scalar::F64, at_2)
        } else {
            (Scalar::F32, at_1)
        };
        let at = at + index * scalar.size();
        scalar.float(&self.bytes[at..at + scalar.size()], self.endian)
    }

    /// A code: 16 bits in NIfTI-1, 32 in NIfTI-2.
    fn code(&self, at_1: usize, at_2: usize) -> i64 {
        if self.wide {
            self.int(Scalar::I32, at_2)
        } else {
            self.int(Scalar::I16, at_1)
        }
    }

    fn dims(&self) -> Result<[i64; 3], Flaw> {
        let dim = |i: usize| {
            if self.wide {
                self.int(Scalar::I64, 16 + 8 * i)
            } else {
                self.int(Scalar::I16, 40 + 2 * i)
            }
        };
        let place = Place::Byte(if self.wide { 16 } else { 40 });
        let rank = dim(0);
        if !(1..=7).contains(&rank) {
            return Err(Flaw::new(
                place,
                Fault::Header,
                format!("the header says {rank} dimensions"),
                "the file is damaged: export it again",
            ));
        }
        for i in 4..=rank {
            if dim(i as usize) > 1 {
                return Err(Flaw::new(
                    place,
                    Fault::Unsupported,
                    format!("the image has {} volumes along dimension {i}", dim(i as usize)),
                    "give one three-dimensional label map: split the file first",
                ));
            }
        }
        Ok([1, 2, 3].map(|i| if i as i64 <= rank { dim(i) } else { 1 }))
    }

    fn scalar(&self) -> Result<Scalar, Flaw> {
        Ok(match self.int(Scalar::I16, if self.wide { 12 } else { 70 }) {
            2 => Scalar::U8,
            4 => Scalar::I16,
            8 => Scalar::I32,
            16 => Scalar::F32,
            64 => Scalar::F64,
            256 => Scalar::I8,
            512 => Scalar::U16,
            768 => Scalar::U32,
            1024 => Scalar::I64,
            1280 => Scalar::U64,
            other => {
                return Err(Flaw::new(
                    Place::Byte(if self.wide { 12 } else { 70 }),
                    Fault::Unsupported,
                    format!("the voxels have data type {other}"),
                    "save the label map with whole numbers of 8, 16 or 32 bits",
                ));
            }
        })
    }

    fn data_offset(&self, length: u64) -> Result<u64, Flaw> {
        let (least, offset) = if self.wide {
            (HEADER_2 as f64, self.int(Scalar::I64, 168) as f64)
        } else {
            (HEADER_1 as f64, self.float(108, 0, 0))
        };
        if offset >= least && offset.fract() == 0.0 && offset <= (length as f64).min(1e9) {
            Ok(offset as u64)
        } else {
            Err(Flaw::new(
                Place::Byte(if self.wide { 168 } else { 108 }),
                Fault::Header,
                format!("the header says that the voxels begin at byte {offset}"),
                "the file is cut short or damaged: export it again",
            ))
        }
    }

    /// Slope and intercept; a slope of 0 or one that is no number means none.
    fn scaling(&self) -> (f64, f64) {
        let (slope, intercept) = (self.float(112, 176, 0), self.float(116, 184, 0));
        if slope.is_finite() && slope != 0.0 && intercept.is_finite() {
            (slope, intercept)
        } else {
            (1.0, 0.0)
        }
    }

    fn units(&self) -> Option<Units> {
        let code = if self.wide {
            self.int(Scalar::I32, 500)
        } else {
            i64::from(self.bytes[123])
        };
        match code & 7 {
            1 => Some(Units::M),
            2 => Some(Units::Mm),
            3 => Some(Units::Um),
            _ => None,
        }
    }

    fn affine(&self, warnings: &mut Vec<String>) -> Result<Affine, Flaw> {
        let pixdim = |i: usize| self.float(76, 104, i);
        if self.code(254, 348) > 0 {
            let row = |r: usize| [0, 1, 2, 3].map(|c| self.float(280 + 16 * r, 400 + 32 * r, c));
            let rows = [row(0), row(1), row(2)];
            let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
            return Ok(Affine {
                steps: DMat3::from_cols(column(0), column(1), column(2)),
                origin: column(3),
                source: "sform",
            });
        }
        let sizes = DVec3::new(pixdim(1), pixdim(2), pixdim(3));
        if self.code(252, 344) > 0 {
            let [b, c, d] = [0, 1, 2].map(|i| self.float(256, 352, i));
            let qfac = if pixdim(0) < 0.0 { -1.0 } else { 1.0 };
            return Ok(Affine {
                steps: rotation(b, c, d) * DMat3::from_diagonal(sizes * DVec3::new(1.0, 1.0, qfac)),
                origin: DVec3::new(
                    self.float(268, 376, 0),
                    self.float(268, 376, 1),
                    self.float(268, 376, 2),
                ),
                source: "qform",
            });
        }
        warnings.push(
            "the NIfTI header has neither sform nor qform: voxel axes were taken as RAS from the origin"
                .into(),
        );
        Ok(Affine {
            steps: DMat3::from_diagonal(sizes),
            origin: DVec3::ZERO,
            source: "voxel sizes only",
        })
    }
}

/// Rotation of the unit quaternion with vector part (b, c, d), as NIfTI's nifti1.h defines it.
fn rotation(b: f64, c: f64, d: f64) -> DMat3 {
    let rest = 1.0 - (b * b + c * c + d * d);
    let (a, b, c, d) = if rest < 1e-7 {
        let n = (b * b + c * c + d * d).sqrt().recip();
        (0.0, b * n, c * n, d * n)
    } else {
        (rest.sqrt(), b, c, d)
    };
    DMat3::from_cols(
        DVec3::new(
            a * a + b * b - c * c - d * d,
            2.0 * (b * c + a * d),
            2.0 * (b * d - a * c),
        ),
        DVec3::new(
            2.0 * (b * c - a * d),
            a * a + c * c - b * b - d * d,
            2.0 * (c * d + a * b),
        ),
        DVec3::new(
            2.0 * (b * d + a * c),
            2.0 * (c * d - a * b),
            a * a + d * d - b * b - c * c,
        ),
    )
}
