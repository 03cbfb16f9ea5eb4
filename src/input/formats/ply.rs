//! PLY: ASCII, little and big endian; points, normals, polygons and triangle strips; other elements and properties skipped.
//! The frame is taken from a `comment SPACE=...` line.

use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Parsed, SurfaceBuilder, space_comment},
    scalar::{Endian, Scalar, not_finite},
    scan::{Scan, tokens},
    shape::SourceFormat,
};
use glam::DVec3;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Binary(Endian),
}

#[derive(Clone, Debug)]
struct Property {
    name: String,
    /// Type of the length when the property is a list.
    length: Option<Scalar>,
    scalar: Scalar,
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: i64,
    properties: Vec<Property>,
}

impl Element {
    /// The fewest bytes one of these can take.
    fn least_bytes(&self, encoding: Encoding) -> usize {
        match encoding {
            Encoding::Ascii => self.properties.len(),
            Encoding::Binary(_) => self
                .properties
                .iter()
                .map(|p| p.length.unwrap_or(p.scalar).size())
                .sum(),
        }
    }
}

/// Reads a PLY file.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let header = Header::read(&mut scan)?;
    let mut surface = SurfaceBuilder::default();
    for element in &header.elements {
        if element.properties.is_empty() {
            continue; // takes no bytes, holds nothing
        }
        let count = scan.promise(
            element.count,
            &format!("`{}` elements", element.name),
            element.least_bytes(header.encoding),
        )?;
        let mut row = Row::new(element);
        let roles = Roles::of(element);
        surface
            .points
            .reserve(if roles.position.is_some() { count } else { 0 });
        for index in 0..count {
            let place = row.read(&mut scan, header.encoding)?;
            roles.store(&row, index, place, &mut surface)?;
        }
    }
    if surface.normals.len() != surface.points.len() {
        surface.normals.clear();
    }
    let frame = header.comments.iter().find_map(|c| space_comment(c.as_bytes()));
    Ok(Parsed {
        format: SourceFormat::Ply,
        content: Content::Surface(surface),
        frame,
        units: None,
        warnings: Vec::new(),
        notes: Vec::new(),
    })
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    comments: Vec<String>,
}

impl Header {
    fn read(scan: &mut Scan) -> Result<Self, Flaw> {
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut comments = Vec::new();
        loop {
            let Some(line) = scan.line() else {
                return Err(Flaw::truncated(
                    scan.here(),
                    "the header has no `end_header` line",
                ));
            };
            let place = scan.last_line();
            let bad = |what: &str| {
                Flaw::new(
                    place,
                    Fault::Header,
                    format!("{what}: {}", quote(line)),
                    "the PLY header is damaged: export the file again",
                )
            };
            let words: Vec<&str> = tokens(line)
                .map(|t| std::str::from_utf8(t).unwrap_or(""))
                .collect();
            match words.as_slice() {
                ["ply"] | [] | ["obj_info", ..] => {}
                ["comment", ..] => comments.push(String::from_utf8_lossy(line).into_owned()),
                ["format", "ascii", _] => encoding = Some(Encoding::Ascii),
                ["format", "binary_little_endian", _] => encoding = Some(Encoding::Binary(Endian::Little)),
                ["format", "binary_big_endian", _] => encoding = Some(Encoding::Binary(Endian::Big)),
                ["element", name, count] => elements.push(Element {
                    name: (*name).to_owned(),
                    count: count
                        .parse()
                        .map_err(|_| bad("an element count is not a number"))?,
                    properties: Vec::new(),
                }),
                ["property", "list", length, scalar, name] => {
                    let property = Property {
                        name: (*name).to_owned(),
                        length: Some(
                            ply_type(length)
                                .filter(|t| !t.is_float())
                                .ok_or_else(|| bad("unknown list length type"))?,
                        ),
                        scalar: ply_type(scalar).ok_or_else(|| bad("unknown type"))?,
                    };
                    elements
                        .last_mut()
                        .ok_or_else(|| bad("a property without an element"))?
                        .properties
                        .push(property);
                }
                ["property", scalar, name] => {
                    let property = Property {
                        name: (*name).to_owned(),
                        length: None,
                        scalar: ply_type(scalar).ok_or_else(|| bad("unknown type"))?,
                    };
                    elements
                        .last_mut()
                        .ok_or_else(|| bad("a property without an element"))?
                        .properties
                        .push(property);
                }
                ["end_header"] => {
                    let encoding = encoding.ok_or_else(|| bad("the header names no format before"))?;
                    return Ok(Self {
                        encoding,
                        elements,
                        comments,
                    });
                }
                _ => return Err(bad("unknown header line")),
            }
        }
    }
}

fn ply_type(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

/// One element's values: a slot for every scalar property, and the lists.
struct Row<'e> {
    element: &'e Element,
    scalars: Vec<f64>,
    lists: Vec<Vec<i64>>,
    start: usize,
}

impl<'e> Row<'e> {
    fn new(element: &'e Element) -> Self {
        let n = element.properties.len();
        Self {
            element,
            scalars: vec![0.0; n],
            lists: vec![Vec::new(); n],
            start: 0,
        }
    }

    /// Reads the next element and returns its place.
    fn read(&mut self, scan: &mut Scan, encoding: Encoding) -> Result<Place, Flaw> {
        self.start = scan.offset();
        match encoding {
            Encoding::Ascii => self.read_ascii(scan),
            Encoding::Binary(endian) => self.read_binary(scan, endian),
        }
    }

    fn read_ascii(&mut self, scan: &mut Scan) -> Result<Place, Flaw> {
        for (i, p) in self.element.properties.iter().enumerate() {
            if p.length.is_some() {
                let n = scan.count(&format!("the length of `{}`", p.name), 1)?;
                self.lists[i].clear();
                for _ in 0..n {
                    self.lists[i].push(scan.integer(&p.name)?);
                }
            } else {
                self.scalars[i] = scan.number(&p.name)?;
            }
        }
        Ok(scan.here())
    }

    fn read_binary(&mut self, scan: &mut Scan, endian: Endian) -> Result<Place, Flaw> {
        for (i, p) in self.element.properties.iter().enumerate() {
            if let Some(length) = p.length {
                let n = length.integer(scan.take(length.size(), "a list length")?, endian);
                if n < 0 {
                    return Err(Flaw::new(
                        Place::Byte(self.start as u64),
                        Fault::Header,
                        format!("`{}` has {n} items", p.name),
                        "a count cannot be negative: export the file again",
                    ));
                }
                let bytes = scan.take((n as usize).saturating_mul(p.scalar.size()), &p.name)?;
                self.lists[i].clear();
                self.lists[i].extend(
                    bytes
                        .chunks_exact(p.scalar.size())
                        .map(|b| p.scalar.integer(b, endian)),
                );
            } else {
                self.scalars[i] = p.scalar.float(scan.take(p.scalar.size(), &p.name)?, endian);
            }
        }
        Ok(Place::Byte(self.start as u64))
    }
}

/// Which properties of an element mean what.
struct Roles {
    position: Option<[usize; 3]>,
    normal: Option<[usize; 3]>,
    polygon: Option<usize>,
    strip: Option<usize>,
}

impl Roles {
    fn of(element: &Element) -> Self {
        let named = |names: &[&str]| {
            element
                .properties
                .iter()
                .position(|p| names.contains(&p.name.as_str()))
        };
        let triple = |names: [&str; 3]| -> Option<[usize; 3]> {
            let found = names.map(|n| named(&[n]).filter(|&i| element.properties[i].length.is_none()));
            Some([found[0]?, found[1]?, found[2]?])
        };
        let list = |names: &[&str]| named(names).filter(|&i| element.properties[i].length.is_some());
        let vertex = element.name == "vertex";
        Self {
            position: vertex.then(|| triple(["x", "y", "z"])).flatten(),
            normal: vertex.then(|| triple(["nx", "ny", "nz"])).flatten(),
            polygon: (element.name == "face")
                .then(|| list(&["vertex_indices", "vertex_index"]))
                .flatten(),
            strip: (element.name == "tristrips")
                .then(|| list(&["vertex_indices", "vertex_index"]))
                .flatten(),
        }
    }

    fn store(&self, row: &Row, index: usize, place: Place, surface: &mut SurfaceBuilder) -> Result<(), Flaw> {
        let vector = |at: [usize; 3]| DVec3::from_array(at.map(|i| row.scalars[i]));
        if let Some(at) = self.position {
            let p = vector(at);
            if !p.is_finite() {
                let bad = p
                    .to_array()
                    .into_iter()
                    .find(|v| !v.is_finite())
                    .unwrap_or(f64::NAN);
                let mut flaw = not_finite(bad, row.start);
                flaw.found = format!("a coordinate of point {index} is {bad}");
                return Err(flaw);
            }
            surface.points.push(p);
        }
        if let Some(at) = self.normal {
            surface.normals.push(vector(at));
        }
        if let Some(i) = self.polygon {
            surface.polygon(&row.lists[i], place)?;
        }
        if let Some(i) = self.strip {
            // A strip restarts at -1.
            for piece in row.lists[i].split(|&c| c == -1) {
                surface.strip(piece, place)?;
            }
        }
        Ok(())
    }
}
