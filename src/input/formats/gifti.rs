//! GIFTI surfaces (`.gii`): point sets and triangles, ASCII, base64 and gzipped base64, both index orders.
//!
//! GIFTI coordinates are RAS mm. The data space is reported; an unknown one is read all the same, because its surfaces fit each
//! other, but with a warning: FreeSurfer writes coordinates from the middle of its conformed volume (tkRAS) under that name,
//! and only the volume can tell the offset. The coordinate system matrix is not applied, for it leads to another space.

use crate::input::{
    decompress,
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Frame, Parsed, Stated, SurfaceBuilder},
    scalar::{Endian, Scalar},
    scan::{number, tokens},
    shape::SourceFormat,
};
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::DVec3;
use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};

/// Reads a GIFTI surface.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut reader = Reader::from_reader(bytes);
    let mut array: Option<Array> = None;
    let mut points: Option<Vec<DVec3>> = None;
    let mut triangles: Vec<[i64; 3]> = Vec::new();
    let mut triangles_at = 0;
    let mut space = None;
    let mut closed = false;
    let mut text_of: Option<&'static str> = None;
    let mut text = Vec::new();
    loop {
        let at = reader.buffer_position();
        let event = reader
            .read_event()
            .map_err(|e| damaged(at, format!("the XML is broken: {e}")))?;
        match &event {
            Event::Start(tag) => {
                match tag.local_name().as_ref() {
                    b"DataArray" => array = Some(Array::read(tag, at)?),
                    b"Data" => text_of = Some("Data"),
                    b"DataSpace" => text_of = Some("DataSpace"),
                    _ => text_of = None,
                }
                text.clear();
            }
            Event::Text(t) if text_of.is_some() => text.extend_from_slice(t),
            Event::CData(t) if text_of.is_some() => text.extend_from_slice(t),
            Event::End(tag) => {
                match (tag.local_name().as_ref(), &array) {
                    (b"Data", Some(a)) if a.intent == "NIFTI_INTENT_POINTSET" && points.is_none() => {
                        points = Some(
                            a.rows(&a.floats(&text)?)?
                                .into_iter()
                                .map(DVec3::from_array)
                                .collect(),
                        );
                    }
                    (b"Data", Some(a)) if a.intent == "NIFTI_INTENT_TRIANGLE" => {
                        triangles_at = at;
                        triangles = a.rows(&a.integers(&text)?)?;
                    }
                    (b"DataSpace", Some(a)) if a.intent == "NIFTI_INTENT_POINTSET" && space.is_none() => {
                        space = Some(String::from_utf8_lossy(text.trim_ascii()).into_owned());
                    }
                    (b"DataArray", _) => array = None,
                    (b"GIFTI", _) => closed = true,
                    _ => {}
                }
                text_of = None;
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if !closed {
        return Err(Flaw::truncated(
            Place::Byte(bytes.len() as u64),
            "the XML ends inside the GIFTI element",
        ));
    }
    let Some(points) = points else {
        return Err(Flaw::file(
            Fault::Unsupported,
            "the GIFTI file holds no point set",
            "give a surface (.surf.gii); this file holds values for one",
        ));
    };
    let mut surface = SurfaceBuilder {
        points,
        ..Default::default()
    };
    for t in &triangles {
        surface.polygon(t, Place::Byte(triangles_at))?;
    }
    let space = space.unwrap_or_else(|| "none given".into());
    let mut warnings = Vec::new();
    if !matches!(
        space.as_str(),
        "NIFTI_XFORM_SCANNER_ANAT"
            | "NIFTI_XFORM_ALIGNED_ANAT"
            | "NIFTI_XFORM_TALAIRACH"
            | "NIFTI_XFORM_MNI_152"
    ) {
        warnings.push(format!(
            "the GIFTI data space is {space}: surfaces of one subject fit each other, but may be shifted against its images (FreeSurfer's c_ras)"
        ));
    }
    Ok(Parsed {
        notes: Vec::new(),
        format: SourceFormat::Gifti,
        content: Content::Surface(surface),
        frame: Some(Stated {
            value: Frame::Ras,
            by: format!("the GIFTI format, data space {space}"),
        }),
        units: None,
        warnings,
    })
}

fn damaged(at: u64, found: String) -> Flaw {
    Flaw::new(
        Place::Byte(at),
        Fault::Header,
        found,
        "the file is damaged or cut short: export it again",
    )
}

/// The attributes of a DataArray element.
struct Array {
    at: u64,
    intent: String,
    scalar: Scalar,
    encoding: String,
    endian: Endian,
    /// Rows and columns, and whether rows stand one after another.
    rows: u64,
    columns: u64,
    row_major: bool,
}

impl Array {
    fn read(tag: &BytesStart, at: u64) -> Result<Self, Flaw> {
        let get = |name: &str| -> Result<String, Flaw> {
            let found = tag
                .try_get_attribute(name)
                .map_err(|e| damaged(at, format!("an XML attribute is broken: {e}")))?;
            Ok(found
                .map(|a| String::from_utf8_lossy(&a.value).into_owned())
                .unwrap_or_default())
        };
        let scalar = match get("DataType")?.as_str() {
            "NIFTI_TYPE_UINT8" => Scalar::U8,
            "NIFTI_TYPE_INT32" => Scalar::I32,
            "NIFTI_TYPE_UINT32" => Scalar::U32,
            "NIFTI_TYPE_INT64" => Scalar::I64,
            "NIFTI_TYPE_FLOAT32" => Scalar::F32,
            "NIFTI_TYPE_FLOAT64" => Scalar::F64,
            other => {
                return Err(damaged(
                    at,
                    format!("unknown data type {}", quote(other.as_bytes())),
                ));
            }
        };
        let count = |text: String| text.parse::<u64>().unwrap_or(1);
        Ok(Self {
            at,
            intent: get("Intent")?,
            scalar,
            encoding: get("Encoding")?,
            endian: if get("Endian")? == "BigEndian" {
                Endian::Big
            } else {
                Endian::Little
            },
            rows: count(get("Dim0")?),
            columns: count(get("Dim1")?),
            row_major: get("ArrayIndexingOrder")? != "ColumnMajorOrder",
        })
    }

    fn place(&self) -> Place {
        Place::Byte(self.at)
    }

    fn floats(&self, text: &[u8]) -> Result<Vec<f64>, Flaw> {
        if self.encoding == "ASCII" {
            return tokens(text)
                .map(|t| number(t, "a coordinate", self.place()))
                .collect();
        }
        self.scalar
            .finite(&self.bytes(text)?, self.endian, 0)
            .map_err(|f| Flaw {
                place: self.place(),
                ..f
            })
    }

    fn integers(&self, text: &[u8]) -> Result<Vec<i64>, Flaw> {
        if self.encoding == "ASCII" {
            return tokens(text)
                .map(|t| crate::input::scan::integer(t, "a point index", self.place()))
                .collect();
        }
        Ok(self.scalar.integers(&self.bytes(text)?, self.endian))
    }

    fn bytes(&self, text: &[u8]) -> Result<Vec<u8>, Flaw> {
        let clean: Vec<u8> = text
            .iter()
            .copied()
            .filter(|b| !b.is_ascii_whitespace())
            .collect();
        let packed = match self.encoding.as_str() {
            "Base64Binary" | "GZipBase64Binary" => STANDARD
                .decode(&clean)
                .map_err(|e| damaged(self.at, format!("the base64 text is broken: {e}")))?,
            other => {
                return Err(Flaw::new(
                    self.place(),
                    Fault::Unsupported,
                    format!("the encoding is {}", quote(other.as_bytes())),
                    "save the surface with its data inside the file",
                ));
            }
        };
        if self.encoding == "Base64Binary" {
            return Ok(packed);
        }
        let expected = self
            .rows
            .saturating_mul(self.columns)
            .saturating_mul(self.scalar.size() as u64);
        decompress::believable(expected, packed.len() as u64)
            .and_then(|()| decompress::zlib_all(&packed, expected))
            .map_err(|f| Flaw {
                place: self.place(),
                ..f
            })
    }

    /// The values as rows of three.
    fn rows<T: Copy>(&self, values: &[T]) -> Result<Vec<[T; 3]>, Flaw> {
        if self.columns != 3 || values.len() as u64 != self.rows.saturating_mul(3) {
            return Err(Flaw::truncated(
                self.place(),
                format!(
                    "{} rows of {} numbers are promised, {} numbers follow",
                    self.rows,
                    self.columns,
                    values.len()
                ),
            ));
        }
        let n = values.len() / 3;
        Ok((0..n)
            .map(|i| {
                [0, 1, 2].map(|c| {
                    if self.row_major {
                        values[3 * i + c]
                    } else {
                        values[n * c + i]
                    }
                })
            })
            .collect())
    }
}
