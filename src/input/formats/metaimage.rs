//! MetaImage label maps (`.mha`, and `.mhd` with its data file). The frame is LPS, as ITK reads and writes it whatever
//! `AnatomicalOrientation` says.

use super::volume::{self, Layout, Stored};
use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Frame, Parsed, Stated, Volume},
    scalar::{Endian, Scalar},
    scan::{Scan, integer, number, tokens},
    shape::SourceFormat,
};
use glam::{DMat3, DVec3};
use std::path::Path;

/// Whether the bytes begin like a MetaImage header.
pub(in crate::input) fn is_metaimage(head: &[u8]) -> bool {
    head.starts_with(b"ObjectType") || head.starts_with(b"NDims") || head.starts_with(b"Comment =")
}

/// Reads a MetaImage; `path` is where a header looks for its data file.
pub(in crate::input) fn read(bytes: &[u8], path: &Path, max_voxels: u64) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let header = Header::read(&mut scan)?;
    let data_file = header.require("ElementDataFile")?;
    let external;
    let mut data = scan.rest();
    if data_file.text != "LOCAL" {
        external = open(data_file, path)?;
        data = &external;
    }
    let dims = header.dims(max_voxels)?;
    let scalar = header.scalar()?;
    if header.number("ElementNumberOfChannels", 1.0)? != 1.0 {
        return Err(Flaw::file(
            Fault::Unsupported,
            "every voxel holds several numbers",
            "give a label map with one number a voxel",
        ));
    }
    let packed = header.flag("CompressedData");
    let skip = header.number("HeaderSize", 0.0)?;
    let voxels: usize = dims.iter().product();
    let start = if skip < 0.0 && !packed {
        data.len().checked_sub(voxels.saturating_mul(scalar.size()))
    } else {
        Some(skip.max(0.0) as usize)
    };
    let data = start.and_then(|s| data.get(s..)).ok_or_else(|| {
        Flaw::truncated(
            Place::File,
            "there are fewer bytes of voxels than the header says",
        )
    })?;
    let stored = match (
        packed,
        header
            .get("BinaryData")
            .is_some_and(|f| f.text.eq_ignore_ascii_case("False")),
    ) {
        (true, _) => Stored::Deflated(data),
        (false, true) => Stored::Text(data),
        (false, false) => Stored::Raw(data),
    };
    let big = header.flag("BinaryDataByteOrderMSB") || header.flag("ElementByteOrderMSB");
    let layout = Layout {
        dims,
        scalar,
        endian: if big { Endian::Big } else { Endian::Little },
        slope: 1.0,
        intercept: 0.0,
    };
    let values = volume::labels(layout, &stored)?;
    let spacing = header
        .vector(&["ElementSpacing", "ElementSize"])?
        .unwrap_or(DVec3::ONE);
    Ok(Parsed {
        format: SourceFormat::MetaImage,
        content: Content::Volume(Volume {
            dims,
            values,
            steps: header.directions()? * DMat3::from_diagonal(spacing),
            origin: header
                .vector(&["Offset", "Position", "Origin"])?
                .unwrap_or(DVec3::ZERO),
        }),
        frame: Some(Stated {
            value: Frame::Lps,
            by: "the MetaImage format as ITK reads it".into(),
        }),
        units: None,
        warnings: Vec::new(),
        notes: Vec::new(),
    })
}

fn open(field: &Field, header: &Path) -> Result<Vec<u8>, Flaw> {
    if field.text.contains('%') || field.text == "LIST" {
        return Err(Flaw::new(
            field.place,
            Fault::Unsupported,
            "the voxels are spread over several files",
            "save the image as one .mha file",
        ));
    }
    let path = header.parent().unwrap_or(Path::new("")).join(&field.text);
    std::fs::read(&path).map_err(|e| {
        Flaw::new(
            field.place,
            Fault::Unreadable,
            format!("its data file {} cannot be read ({e})", path.display()),
            "keep the header and the data file together under the names the header uses",
        )
    })
}

struct Field {
    key: String,
    text: String,
    place: Place,
}

struct Header {
    fields: Vec<Field>,
}

impl Header {
    /// Reads `key = value` lines up to and including `ElementDataFile`.
    fn read(scan: &mut Scan) -> Result<Self, Flaw> {
        let mut fields = Vec::new();
        while let Some(line) = scan.line() {
            let place = scan.last_line();
            if tokens(line).next().is_none() {
                continue;
            }
            let text = String::from_utf8_lossy(line);
            let Some((key, value)) = text.split_once('=') else {
                return Err(Flaw::new(
                    place,
                    Fault::Header,
                    format!("{} is no `key = value` line", quote(line)),
                    "the header is damaged: export the file again",
                ));
            };
            let field = Field {
                key: key.trim().to_owned(),
                text: value.trim().to_owned(),
                place,
            };
            let last = field.key == "ElementDataFile";
            fields.push(field);
            if last {
                break;
            }
        }
        Ok(Self { fields })
    }

    fn get(&self, key: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.key == key)
    }

    fn require(&self, key: &str) -> Result<&Field, Flaw> {
        self.get(key)
            .ok_or_else(|| Flaw::truncated(Place::File, format!("the header has no line `{key}`")))
    }

    fn flag(&self, key: &str) -> bool {
        self.get(key).is_some_and(|f| f.text.eq_ignore_ascii_case("True"))
    }

    fn number(&self, key: &str, default: f64) -> Result<f64, Flaw> {
        self.get(key)
            .map_or(Ok(default), |f| number(f.text.as_bytes(), key, f.place))
    }

    fn numbers(&self, field: &Field) -> Result<Vec<f64>, Flaw> {
        tokens(field.text.as_bytes())
            .map(|t| number(t, &field.key, field.place))
            .collect()
    }

    fn vector(&self, keys: &[&str]) -> Result<Option<DVec3>, Flaw> {
        let Some(field) = keys.iter().find_map(|k| self.get(k)) else {
            return Ok(None);
        };
        match self.numbers(field)?.as_slice() {
            [x, y, z] => Ok(Some(DVec3::new(*x, *y, *z))),
            other => Err(Flaw::new(
                field.place,
                Fault::Header,
                format!("{} has {} numbers instead of three", field.key, other.len()),
                "the image must be three-dimensional: export it again",
            )),
        }
    }

    fn dims(&self, max_voxels: u64) -> Result<[usize; 3], Flaw> {
        let field = self.require("DimSize")?;
        let sizes: Vec<i64> = tokens(field.text.as_bytes())
            .map(|t| integer(t, "DimSize", field.place))
            .collect::<Result<_, _>>()?;
        let sizes = <[i64; 3]>::try_from(sizes).map_err(|s| {
            Flaw::new(
                field.place,
                Fault::Unsupported,
                format!("the image has {} dimensions", s.len()),
                "give a three-dimensional label map",
            )
        })?;
        volume::checked_dims(sizes, max_voxels)
    }

    fn scalar(&self) -> Result<Scalar, Flaw> {
        let field = self.require("ElementType")?;
        Ok(match field.text.as_str() {
            "MET_CHAR" => Scalar::I8,
            "MET_UCHAR" => Scalar::U8,
            "MET_SHORT" => Scalar::I16,
            "MET_USHORT" => Scalar::U16,
            "MET_INT" => Scalar::I32,
            "MET_UINT" => Scalar::U32,
            "MET_LONG" | "MET_LONG_LONG" => Scalar::I64,
            "MET_ULONG" | "MET_ULONG_LONG" => Scalar::U64,
            "MET_FLOAT" => Scalar::F32,
            "MET_DOUBLE" => Scalar::F64,
            _ => {
                return Err(Flaw::new(
                    field.place,
                    Fault::Unsupported,
                    format!("the voxels have type {}", quote(field.text.as_bytes())),
                    "save the label map with whole numbers of 8, 16 or 32 bits",
                ));
            }
        })
    }

    /// Directions of the axes as columns; the file lists them axis by axis.
    fn directions(&self) -> Result<DMat3, Flaw> {
        let Some(field) = ["TransformMatrix", "Rotation", "Orientation"]
            .iter()
            .find_map(|k| self.get(k))
        else {
            return Ok(DMat3::IDENTITY);
        };
        let m = self.numbers(field)?;
        let m: [f64; 9] = m.try_into().map_err(|m: Vec<f64>| {
            Flaw::new(
                field.place,
                Fault::Header,
                format!("{} has {} numbers instead of nine", field.key, m.len()),
                "the header is damaged: export the file again",
            )
        })?;
        Ok(DMat3::from_cols_array(&m))
    }
}
