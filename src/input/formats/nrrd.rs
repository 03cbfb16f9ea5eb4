//! NRRD label maps, attached or detached (`.nrrd`, `.nhdr`); raw, gzip and text encodings; any of the named spaces. Axes of size
//! one beside the three of space are allowed, so are oblique and sheared directions.

use super::volume::{self, Layout, Stored};
use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Frame, Parsed, Stated, Units, Volume},
    scalar::{Endian, Scalar},
    scan::{Scan, integer, number, tokens},
    shape::SourceFormat,
};
use glam::{DMat3, DVec3};
use std::{collections::BTreeMap, path::Path};

/// Reads a NRRD file; `path` is where a detached header looks for its data.
pub(in crate::input) fn read(bytes: &[u8], path: &Path, max_voxels: u64) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let fields = Fields::read(&mut scan)?;
    let mut warnings = Vec::new();
    let axes = Axes::read(&fields, max_voxels)?;
    let detached = fields.get(&["data file", "datafile"]);
    let external = detached.map(|f| f.open(path)).transpose()?;
    let data = external.as_deref().unwrap_or_else(|| scan.rest());
    let data = fields.skip(data, &axes)?;
    let layout = Layout {
        dims: axes.dims,
        scalar: fields.scalar()?,
        endian: fields.endian()?,
        slope: 1.0,
        intercept: 0.0,
    };
    let encoding = fields.require("encoding")?;
    let stored = match encoding.text.to_ascii_lowercase().as_str() {
        "raw" => Stored::Raw(data),
        "gzip" | "gz" => Stored::Deflated(data),
        "text" | "txt" | "ascii" => Stored::Text(data),
        _ => {
            return Err(Flaw::new(
                encoding.place,
                Fault::Unsupported,
                format!("the encoding is {}", quote(encoding.text.as_bytes())),
                "save it with raw, gzip or text encoding",
            ));
        }
    };
    let values = volume::labels(layout, &stored)?;
    let (frame, flip) = fields.space(&mut warnings)?;
    Ok(Parsed {
        format: SourceFormat::Nrrd,
        content: Content::Volume(Volume {
            dims: axes.dims,
            values,
            steps: flip * axes.steps,
            origin: flip * axes.origin,
        }),
        frame,
        units: fields.units(),
        warnings,
        notes: Vec::new(),
    })
}

#[derive(Clone, Debug)]
struct Field {
    text: String,
    place: Place,
}

impl Field {
    fn flaw(&self, fault: Fault, found: &str) -> Flaw {
        Flaw::new(
            self.place,
            fault,
            format!("{found}: {}", quote(self.text.as_bytes())),
            "the header is damaged: export the file again",
        )
    }

    fn numbers(&self, what: &str) -> Result<Vec<f64>, Flaw> {
        tokens(self.text.as_bytes())
            .map(|t| number(t, what, self.place))
            .collect()
    }

    /// A vector in parentheses.
    fn vector(text: &str, place: Place) -> Result<DVec3, Flaw> {
        let inner = text.trim().trim_start_matches('(').trim_end_matches(')');
        let v: Vec<f64> = inner
            .split(',')
            .map(|t| number(t.trim().as_bytes(), "a direction", place))
            .collect::<Result<_, _>>()?;
        match v.as_slice() {
            [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
            _ => Err(Flaw::new(
                place,
                Fault::Header,
                format!("{} is no vector of three numbers", quote(text.as_bytes())),
                "the image must live in three-dimensional space: export it again",
            )),
        }
    }

    /// The bytes of a detached data file beside the header.
    fn open(&self, header: &Path) -> Result<Vec<u8>, Flaw> {
        if self.text.contains('%') || self.text.to_ascii_uppercase().starts_with("LIST") {
            return Err(Flaw::new(
                self.place,
                Fault::Unsupported,
                "the voxels are spread over several files",
                "save the image as one .nrrd file",
            ));
        }
        let path = header.parent().unwrap_or(Path::new("")).join(&self.text);
        std::fs::read(&path).map_err(|e| {
            Flaw::new(
                self.place,
                Fault::Unreadable,
                format!("its data file {} cannot be read ({e})", path.display()),
                "keep the header and the data file together under the names the header uses",
            )
        })
    }
}

/// The fields of a header by lower-case name.
struct Fields {
    fields: BTreeMap<String, Field>,
}

impl Fields {
    fn read(scan: &mut Scan) -> Result<Self, Flaw> {
        let magic = scan.line().unwrap_or_default();
        if !magic.starts_with(b"NRRD") {
            return Err(Flaw::new(
                Place::Line(1),
                Fault::Header,
                format!("{} is no NRRD magic", quote(magic)),
                "the file is damaged or no NRRD file",
            ));
        }
        let mut fields = BTreeMap::new();
        while let Some(line) = scan.line() {
            let place = scan.last_line();
            if line.is_empty() {
                break;
            }
            let text = String::from_utf8_lossy(line);
            if text.starts_with('#') || text.contains(":=") {
                continue;
            }
            let Some((key, value)) = text.split_once(':') else {
                return Err(Flaw::new(
                    place,
                    Fault::Header,
                    format!("{} is no NRRD field", quote(line)),
                    "the header is damaged: export the file again",
                ));
            };
            let field = Field {
                text: value.trim().to_owned(),
                place,
            };
            fields.insert(key.trim().to_ascii_lowercase(), field);
        }
        Ok(Self { fields })
    }

    fn get(&self, names: &[&str]) -> Option<&Field> {
        names.iter().find_map(|n| self.fields.get(*n))
    }

    fn require(&self, name: &str) -> Result<&Field, Flaw> {
        self.get(&[name]).ok_or_else(|| {
            Flaw::file(
                Fault::Header,
                format!("the header has no field `{name}`"),
                "the file is cut short or damaged: export it again",
            )
        })
    }

    fn scalar(&self) -> Result<Scalar, Flaw> {
        let field = self.require("type")?;
        Ok(match field.text.as_str() {
            "signed char" | "int8" | "int8_t" => Scalar::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Scalar::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Scalar::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Scalar::U16,
            "int" | "signed int" | "int32" | "int32_t" => Scalar::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Scalar::U32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => Scalar::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
                Scalar::U64
            }
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            _ => return Err(field.flaw(Fault::Unsupported, "unknown type")),
        })
    }

    fn endian(&self) -> Result<Endian, Flaw> {
        match self.get(&["endian"]) {
            None => Ok(Endian::Little),
            Some(f) if f.text == "little" => Ok(Endian::Little),
            Some(f) if f.text == "big" => Ok(Endian::Big),
            Some(f) => Err(f.flaw(Fault::Header, "unknown byte order")),
        }
    }

    /// Drops the lines and bytes that the header says stand before the voxels; -1 means: count from the end.
    fn skip<'a>(&self, data: &'a [u8], axes: &Axes) -> Result<&'a [u8], Flaw> {
        let mut data = data;
        if let Some(field) = self.get(&["line skip", "lineskip"]) {
            let mut scan = Scan::new(data);
            for _ in 0..integer(field.text.as_bytes(), "line skip", field.place)?.clamp(0, data.len() as i64)
            {
                scan.line();
            }
            data = scan.rest();
        }
        let Some(field) = self.get(&["byte skip", "byteskip"]) else {
            return Ok(data);
        };
        let skip = integer(field.text.as_bytes(), "byte skip", field.place)?;
        let bytes = axes
            .dims
            .iter()
            .product::<usize>()
            .saturating_mul(self.scalar()?.size());
        let at = if skip == -1 {
            data.len().checked_sub(bytes)
        } else {
            usize::try_from(skip).ok()
        };
        at.and_then(|at| data.get(at..))
            .ok_or_else(|| field.flaw(Fault::Truncated, "there are fewer bytes than the header skips"))
    }

    /// The frame, and the matrix that takes other named spaces to it.
    fn space(&self, warnings: &mut Vec<String>) -> Result<(Option<Stated<Frame>>, DMat3), Flaw> {
        let Some(field) = self.get(&["space"]) else {
            warnings.push("the NRRD header names no space: LPS was assumed".into());
            return Ok((None, DMat3::IDENTITY));
        };
        let stated = |value| {
            Some(Stated {
                value,
                by: format!("its space field, {}", field.text),
            })
        };
        match field.text.to_ascii_lowercase().as_str() {
            "left-posterior-superior" | "lps" => Ok((stated(Frame::Lps), DMat3::IDENTITY)),
            "right-anterior-superior" | "ras" => Ok((stated(Frame::Ras), DMat3::IDENTITY)),
            // The third named space is mirrored; it is turned into LPS here, so that frames stay two.
            "left-anterior-superior" | "las" => Ok((
                stated(Frame::Lps),
                DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0)),
            )),
            "3d-right-handed" | "3d-left-handed" | "scanner-xyz" => {
                warnings.push(format!(
                    "the space {} says nothing of the body: LPS was assumed",
                    quote(field.text.as_bytes())
                ));
                Ok((None, DMat3::IDENTITY))
            }
            _ => Err(field.flaw(Fault::Unsupported, "unknown space")),
        }
    }

    fn units(&self) -> Option<Stated<Units>> {
        let field = self.get(&["space units"])?;
        let first = field.text.split('"').find(|t| !t.trim().is_empty())?;
        let value = match first.trim() {
            "mm" | "millimeter" | "millimetre" => Units::Mm,
            "um" | "micron" | "micrometer" => Units::Um,
            "m" | "meter" | "metre" => Units::M,
            _ => return None,
        };
        Some(Stated {
            value,
            by: "its space units".into(),
        })
    }
}

/// The three axes of space.
struct Axes {
    dims: [usize; 3],
    steps: DMat3,
    origin: DVec3,
}

impl Axes {
    fn read(fields: &Fields, max_voxels: u64) -> Result<Self, Flaw> {
        let sizes_field = fields.require("sizes")?;
        let sizes: Vec<i64> = tokens(sizes_field.text.as_bytes())
            .map(|t| integer(t, "a size", sizes_field.place))
            .collect::<Result<_, _>>()?;
        let dimension = fields.require("dimension")?;
        if integer(dimension.text.as_bytes(), "dimension", dimension.place)? != sizes.len() as i64 {
            return Err(sizes_field.flaw(Fault::Header, "the dimension and the number of sizes differ"));
        }
        let directions = fields.get(&["space directions"]).map(directions).transpose()?;
        let directions = directions.unwrap_or_else(|| vec![None; sizes.len()]);
        if directions.len() != sizes.len() {
            return Err(sizes_field.flaw(
                Fault::Header,
                "the number of space directions and of sizes differ",
            ));
        }
        // Axes without direction must be of size one, unless no axis has one.
        let undirected = directions.iter().all(Option::is_none);
        let spatial: Vec<usize> = (0..sizes.len())
            .filter(|&i| undirected || directions[i].is_some())
            .collect();
        if let Some(&extra) = (0..sizes.len())
            .collect::<Vec<_>>()
            .iter()
            .find(|i| !spatial.contains(i) && sizes[**i] != 1)
        {
            return Err(Flaw::new(
                sizes_field.place,
                Fault::Unsupported,
                format!("axis {extra} holds {} images", sizes[extra]),
                "give one label map: in 3D Slicer, export the segmentation to a label map",
            ));
        }
        let [i, j, k] = <[usize; 3]>::try_from(spatial)
            .map_err(|_| sizes_field.flaw(Fault::Unsupported, "the image is not three-dimensional"))?;
        let dims = volume::checked_dims([sizes[i], sizes[j], sizes[k]], max_voxels)?;
        let steps = match (directions[i], directions[j], directions[k]) {
            (Some(a), Some(b), Some(c)) => DMat3::from_cols(a, b, c),
            _ => DMat3::from_diagonal(spacings(fields, [i, j, k])?),
        };
        let origin = match fields.get(&["space origin"]) {
            Some(f) => Field::vector(&f.text, f.place)?,
            None => DVec3::ZERO,
        };
        Ok(Self { dims, steps, origin })
    }
}

fn spacings(fields: &Fields, axes: [usize; 3]) -> Result<DVec3, Flaw> {
    let Some(field) = fields.get(&["spacings"]) else {
        return Ok(DVec3::ONE);
    };
    let values = field.numbers("a spacing")?;
    let get = |i: usize| {
        values
            .get(i)
            .copied()
            .ok_or_else(|| field.flaw(Fault::Header, "too few spacings"))
    };
    Ok(DVec3::new(get(axes[0])?, get(axes[1])?, get(axes[2])?))
}

/// Directions in parentheses, `none` for an axis that is not in space.
fn directions(field: &Field) -> Result<Vec<Option<DVec3>>, Flaw> {
    let mut out = Vec::new();
    let mut rest = field.text.trim();
    while !rest.is_empty() {
        if let Some(tail) = rest.strip_prefix("none") {
            out.push(None);
            rest = tail.trim_start();
        } else if let Some(end) = rest.find(')') {
            out.push(Some(Field::vector(&rest[..=end], field.place)?));
            rest = rest[end + 1..].trim_start();
        } else {
            return Err(field.flaw(Fault::Header, "a direction is not closed"));
        }
    }
    Ok(out)
}
