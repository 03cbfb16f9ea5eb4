//! VTK XML poly data (`.vtp`): ASCII, inline base64, appended raw or base64; plain or zlib-compressed; both byte orders and
//! header widths; any number of pieces. The frame is taken from a field array named `SPACE` (3D Slicer).

use super::super::decompress;
use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Frame, Parsed, Stated, SurfaceBuilder},
    scalar::{Endian, Scalar},
    scan::{Scan, number},
    shape::SourceFormat,
};
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::DVec3;
use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};

/// Reads a VTP file.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let (markup, appended) = split_appended(bytes)?;
    let mut file = File {
        layout: Layout::default(),
        appended,
        surface: SurfaceBuilder::default(),
        frame: None,
    };
    let mut reader = Reader::from_reader(markup);
    let mut section = Section::None;
    let mut piece = Piece::default();
    let mut saw_poly_data = false;
    loop {
        let at = reader.buffer_position();
        let event = reader
            .read_event()
            .map_err(|e| damaged(at, format!("the XML is broken: {e}")))?;
        let empty = matches!(event, Event::Empty(_));
        match &event {
            Event::Start(tag) | Event::Empty(tag) => match tag.local_name().as_ref() {
                b"VTKFile" => file.layout = Layout::read(tag, at)?,
                b"PolyData" => saw_poly_data = true,
                b"Piece" => piece = Piece::read(tag, at)?,
                b"Points" => section = Section::Points,
                b"Polys" => section = Section::Polys,
                b"Strips" => section = Section::Strips,
                b"PointData" | b"CellData" | b"Verts" | b"Lines" => section = Section::None,
                b"FieldData" => section = Section::Field,
                b"DataArray" | b"Array" if section != Section::None => {
                    let array = ArrayTag::read(tag, at)?;
                    let text = if empty {
                        Vec::new()
                    } else {
                        inner_text(&mut reader)?
                    };
                    file.array(&array, &text, section, &mut piece)?;
                }
                _ => {}
            },
            Event::End(tag) => match tag.local_name().as_ref() {
                b"Piece" => file.finish_piece(std::mem::take(&mut piece))?,
                b"Points" | b"Polys" | b"Strips" | b"FieldData" => section = Section::None,
                _ => {}
            },
            Event::Eof => break,
            _ => {}
        }
    }
    if !saw_poly_data {
        return Err(Flaw::file(
            Fault::Unsupported,
            "the VTK file holds no PolyData",
            "only surfaces (.vtp) are read: extract the surface and save it as .vtp",
        ));
    }
    if piece.open {
        return Err(Flaw::truncated(
            Place::Byte(bytes.len() as u64),
            "the XML ends inside a Piece",
        ));
    }
    Ok(Parsed {
        format: SourceFormat::Vtp,
        content: Content::Surface(file.surface),
        frame: file.frame,
        units: None,
        warnings: Vec::new(),
        notes: Vec::new(),
    })
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Section {
    None,
    Points,
    Polys,
    Strips,
    Field,
}

/// The appended block, which is not XML, and how it is encoded.
struct Appended<'a> {
    data: &'a [u8],
    start: usize,
    base64: bool,
}

/// Cuts the appended data off, so that what is left can be read as XML.
fn split_appended(bytes: &[u8]) -> Result<(&[u8], Option<Appended<'_>>), Flaw> {
    let Some(tag) = find(bytes, b"<AppendedData") else {
        return Ok((bytes, None));
    };
    let open = bytes[tag..].iter().position(|&b| b == b'>').map(|i| tag + i + 1);
    let data = open.and_then(|o| bytes[o..].iter().position(|&b| b == b'_').map(|i| o + i + 1));
    let (Some(open), Some(start)) = (open, data) else {
        return Err(Flaw::truncated(
            Place::Byte(tag as u64),
            "the appended data have no beginning",
        ));
    };
    let base64 = find(&bytes[tag..open], b"base64").is_some();
    Ok((
        &bytes[..tag],
        Some(Appended {
            data: &bytes[start..],
            start,
            base64,
        }),
    ))
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|w| w == what)
}

fn damaged(at: u64, found: String) -> Flaw {
    Flaw::new(
        Place::Byte(at),
        Fault::Header,
        found,
        "the file is damaged or cut short: export it again",
    )
}

fn attribute(tag: &BytesStart, name: &str, at: u64) -> Result<Option<String>, Flaw> {
    let found = tag
        .try_get_attribute(name)
        .map_err(|e| damaged(at, format!("an XML attribute is broken: {e}")))?;
    Ok(found.map(|a| String::from_utf8_lossy(&a.value).into_owned()))
}

/// How binary arrays are laid out.
#[derive(Clone, Copy)]
struct Layout {
    endian: Endian,
    header: Scalar,
    zlib: bool,
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            endian: Endian::Little,
            header: Scalar::U32,
            zlib: false,
        }
    }
}

impl Layout {
    fn read(tag: &BytesStart, at: u64) -> Result<Self, Flaw> {
        let endian = match attribute(tag, "byte_order", at)?.as_deref() {
            Some("BigEndian") => Endian::Big,
            _ => Endian::Little,
        };
        let header = match attribute(tag, "header_type", at)?.as_deref() {
            Some("UInt64") => Scalar::U64,
            _ => Scalar::U32,
        };
        let zlib = match attribute(tag, "compressor", at)?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(Flaw::new(
                    Place::Byte(at),
                    Fault::Unsupported,
                    format!("the arrays are compressed with {}", quote(other.as_bytes())),
                    "save the file with zlib compression or none",
                ));
            }
        };
        Ok(Self { endian, header, zlib })
    }
}

/// The attributes of a DataArray element.
struct ArrayTag {
    at: u64,
    name: String,
    scalar: Option<Scalar>,
    format: String,
    offset: Option<u64>,
}

impl ArrayTag {
    fn read(tag: &BytesStart, at: u64) -> Result<Self, Flaw> {
        let scalar = match attribute(tag, "type", at)?.as_deref() {
            Some("Int8") => Some(Scalar::I8),
            Some("UInt8") => Some(Scalar::U8),
            Some("Int16") => Some(Scalar::I16),
            Some("UInt16") => Some(Scalar::U16),
            Some("Int32") => Some(Scalar::I32),
            Some("UInt32") => Some(Scalar::U32),
            Some("Int64") => Some(Scalar::I64),
            Some("UInt64") => Some(Scalar::U64),
            Some("Float32") => Some(Scalar::F32),
            Some("Float64") => Some(Scalar::F64),
            _ => None,
        };
        Ok(Self {
            at,
            name: attribute(tag, "Name", at)?.unwrap_or_default(),
            scalar,
            format: attribute(tag, "format", at)?.unwrap_or_else(|| "ascii".into()),
            offset: attribute(tag, "offset", at)?.and_then(|o| o.parse().ok()),
        })
    }
}

fn inner_text(reader: &mut Reader<&[u8]>) -> Result<Vec<u8>, Flaw> {
    let mut text = Vec::new();
    loop {
        let at = reader.buffer_position();
        match reader
            .read_event()
            .map_err(|e| damaged(at, format!("the XML is broken: {e}")))?
        {
            Event::Text(t) => text.extend_from_slice(&t),
            Event::CData(t) => text.extend_from_slice(&t),
            Event::Start(tag) => {
                let name = tag.to_end().into_owned();
                reader
                    .read_to_end(name.name())
                    .map_err(|e| damaged(at, format!("the XML is broken: {e}")))?;
            }
            Event::End(_) => return Ok(text),
            Event::Eof => return Err(Flaw::truncated(Place::Byte(at), "the XML ends inside an array")),
            _ => {}
        }
    }
}

/// The arrays of one piece.
#[derive(Default)]
struct Piece {
    open: bool,
    at: u64,
    points: Vec<f64>,
    polys: Lists,
    strips: Lists,
    promised_points: Option<u64>,
    promised_polys: Option<u64>,
    loose: u64,
}

#[derive(Default)]
struct Lists {
    connectivity: Vec<i64>,
    offsets: Vec<i64>,
}

impl Lists {
    /// The lists, shifted to the points of this piece.
    fn each(
        &self,
        base: i64,
        at: u64,
        mut use_list: impl FnMut(&[i64]) -> Result<(), Flaw>,
    ) -> Result<(), Flaw> {
        let mut start = 0usize;
        let mut shifted = Vec::new();
        for &end in &self.offsets {
            let list = usize::try_from(end)
                .ok()
                .and_then(|end| self.connectivity.get(start..end))
                .ok_or_else(|| {
                    Flaw::new(
                        Place::Byte(at),
                        Fault::Index,
                        format!("a cell ends at entry {end} of {}", self.connectivity.len()),
                        "the file is damaged: export it again",
                    )
                })?;
            start += list.len();
            shifted.clear();
            shifted.extend(
                list.iter()
                    .map(|i| if *i < 0 { *i } else { i.saturating_add(base) }),
            );
            use_list(&shifted)?;
        }
        Ok(())
    }
}

impl Piece {
    fn read(tag: &BytesStart, at: u64) -> Result<Self, Flaw> {
        let count = |name: &str| -> Result<Option<u64>, Flaw> {
            Ok(attribute(tag, name, at)?.and_then(|t| t.parse().ok()))
        };
        Ok(Self {
            open: true,
            at,
            promised_points: count("NumberOfPoints")?,
            promised_polys: count("NumberOfPolys")?,
            loose: count("NumberOfLines")?
                .unwrap_or(0)
                .saturating_add(count("NumberOfVerts")?.unwrap_or(0)),
            ..Self::default()
        })
    }
}

struct File<'a> {
    layout: Layout,
    appended: Option<Appended<'a>>,
    surface: SurfaceBuilder,
    frame: Option<Stated<Frame>>,
}

impl File<'_> {
    fn array(
        &mut self,
        tag: &ArrayTag,
        text: &[u8],
        section: Section,
        piece: &mut Piece,
    ) -> Result<(), Flaw> {
        if section == Section::Field {
            if tag.name.eq_ignore_ascii_case("SPACE") && tag.format == "ascii" {
                self.frame = space_codes(text);
            }
            return Ok(());
        }
        let Some(scalar) = tag.scalar else {
            return Err(damaged(
                tag.at,
                format!("array {} has an unknown type", quote(tag.name.as_bytes())),
            ));
        };
        match (section, tag.name.as_str()) {
            (Section::Points, _) if piece.points.is_empty() => {
                piece.points = self.floats(tag, scalar, text)?
            }
            (Section::Polys, "connectivity") => {
                piece.polys.connectivity = self.integers(tag, scalar, text)?
            }
            (Section::Polys, "offsets") => piece.polys.offsets = self.integers(tag, scalar, text)?,
            (Section::Strips, "connectivity") => {
                piece.strips.connectivity = self.integers(tag, scalar, text)?
            }
            (Section::Strips, "offsets") => piece.strips.offsets = self.integers(tag, scalar, text)?,
            _ => {}
        }
        Ok(())
    }

    fn finish_piece(&mut self, piece: Piece) -> Result<(), Flaw> {
        let found = piece.points.len() as u64 / 3;
        if piece.promised_points.is_some_and(|n| n != found) || !piece.points.len().is_multiple_of(3) {
            return Err(Flaw::truncated(
                Place::Byte(piece.at),
                format!(
                    "the piece says {} points, its array holds {} numbers",
                    piece.promised_points.unwrap_or(0),
                    piece.points.len()
                ),
            ));
        }
        let polys = piece.polys.offsets.len() as u64;
        if piece.promised_polys.is_some_and(|n| n != polys) {
            return Err(Flaw::truncated(
                Place::Byte(piece.at),
                format!(
                    "the piece says {} polygons, its array holds {polys}",
                    piece.promised_polys.unwrap_or(0)
                ),
            ));
        }
        let base = self.surface.points.len() as i64;
        self.surface
            .points
            .extend(piece.points.chunks_exact(3).map(DVec3::from_slice));
        let place = Place::Byte(piece.at);
        piece
            .polys
            .each(base, piece.at, |polygon| self.surface.polygon(polygon, place))?;
        piece
            .strips
            .each(base, piece.at, |strip| self.surface.strip(strip, place))?;
        self.surface.ignored_lines = self.surface.ignored_lines.saturating_add(piece.loose as usize);
        Ok(())
    }

    fn floats(&self, tag: &ArrayTag, scalar: Scalar, text: &[u8]) -> Result<Vec<f64>, Flaw> {
        let place = Place::Byte(tag.at);
        if tag.format == "ascii" {
            return tokens(text).map(|t| number(t, "a coordinate", place)).collect();
        }
        let mut values = scalar.finite(&self.binary(tag, text)?, self.layout.endian, 0);
        if let Err(flaw) = &mut values {
            flaw.place = place;
        }
        values
    }

    fn integers(&self, tag: &ArrayTag, scalar: Scalar, text: &[u8]) -> Result<Vec<i64>, Flaw> {
        if tag.format == "ascii" {
            let mut scan = Scan::new(text);
            let mut values = Vec::new();
            while scan.peek().is_some() {
                values.push(scan.integer("a point index").map_err(|f| Flaw {
                    place: Place::Byte(tag.at),
                    ..f
                })?);
            }
            return Ok(values);
        }
        Ok(scalar.integers(&self.binary(tag, text)?, self.layout.endian))
    }

    /// The bytes of a binary array, decoded and decompressed.
    fn binary(&self, tag: &ArrayTag, text: &[u8]) -> Result<Vec<u8>, Flaw> {
        let place = Place::Byte(tag.at);
        match (tag.format.as_str(), &self.appended) {
            ("binary", _) => {
                let clean: Vec<u8> = text
                    .iter()
                    .copied()
                    .filter(|b| !b.is_ascii_whitespace())
                    .collect();
                self.layout.decode(&mut Base64 { text: &clean, place }, place)
            }
            ("appended", Some(appended)) => {
                let offset = tag
                    .offset
                    .ok_or_else(|| damaged(tag.at, "an appended array has no offset".into()))?;
                let data = usize::try_from(offset)
                    .ok()
                    .and_then(|o| appended.data.get(o..))
                    .ok_or_else(|| {
                        Flaw::truncated(
                            place,
                            format!(
                                "an array begins at byte {offset} of the appended data, which have {}",
                                appended.data.len()
                            ),
                        )
                    })?;
                let place = Place::Byte((appended.start as u64).saturating_add(offset));
                if appended.base64 {
                    let end = data.iter().position(|&b| b == b'<').unwrap_or(data.len());
                    self.layout.decode(
                        &mut Base64 {
                            text: &data[..end],
                            place,
                        },
                        place,
                    )
                } else {
                    self.layout.decode(&mut Raw { bytes: data, place }, place)
                }
            }
            (other, _) => Err(damaged(
                tag.at,
                format!("array format {} cannot be read here", quote(other.as_bytes())),
            )),
        }
    }
}

/// Where the encoded bytes of an array come from. Each call to `next` returns one separately encoded run.
trait Encoded {
    fn next(&mut self, bytes: usize) -> Result<Vec<u8>, Flaw>;
    /// Goes back to the start of the run that `next` returned, to read more of it.
    fn peek(&self, bytes: usize) -> Result<Vec<u8>, Flaw>;
}

struct Raw<'a> {
    bytes: &'a [u8],
    place: Place,
}

impl Encoded for Raw<'_> {
    fn next(&mut self, bytes: usize) -> Result<Vec<u8>, Flaw> {
        let out = self.peek(bytes)?;
        self.bytes = &self.bytes[bytes..];
        Ok(out)
    }

    fn peek(&self, bytes: usize) -> Result<Vec<u8>, Flaw> {
        self.bytes.get(..bytes).map(<[u8]>::to_vec).ok_or_else(|| {
            Flaw::truncated(
                self.place,
                format!(
                    "{bytes} bytes of an array should follow, {} are left",
                    self.bytes.len()
                ),
            )
        })
    }
}

struct Base64<'a> {
    text: &'a [u8],
    place: Place,
}

impl Base64<'_> {
    fn characters(&self, bytes: usize) -> Result<&[u8], Flaw> {
        let n = bytes.div_ceil(3).saturating_mul(4);
        self.text.get(..n).ok_or_else(|| {
            Flaw::truncated(
                self.place,
                format!(
                    "{bytes} bytes of an array should follow as {n} base64 characters, {} are left",
                    self.text.len()
                ),
            )
        })
    }
}

impl Encoded for Base64<'_> {
    fn next(&mut self, bytes: usize) -> Result<Vec<u8>, Flaw> {
        let out = self.peek(bytes)?;
        self.text = &self.text[bytes.div_ceil(3) * 4..];
        Ok(out)
    }

    fn peek(&self, bytes: usize) -> Result<Vec<u8>, Flaw> {
        let mut out = STANDARD.decode(self.characters(bytes)?).map_err(|e| {
            Flaw::new(
                self.place,
                Fault::Header,
                format!("the base64 text is broken: {e}"),
                "the file is damaged: export it again",
            )
        })?;
        if out.len() < bytes {
            // Padding in the middle of the text ends it early.
            return Err(Flaw::truncated(
                self.place,
                format!(
                    "{bytes} bytes of an array should follow, the base64 text holds {}",
                    out.len()
                ),
            ));
        }
        out.truncate(bytes);
        Ok(out)
    }
}

impl Layout {
    /// Plain arrays are a byte count and the bytes in one run; compressed ones are a run of block sizes and a run of blocks.
    fn decode(&self, source: &mut impl Encoded, place: Place) -> Result<Vec<u8>, Flaw> {
        let width = self.header.size();
        let size = |bytes: &[u8], i: usize| {
            self.header
                .integer(&bytes[i * width..(i + 1) * width], self.endian) as u64
        };
        let large = |n: u64| {
            usize::try_from(n)
                .ok()
                .filter(|n| *n < usize::MAX / 4)
                .ok_or_else(|| Flaw::truncated(place, format!("an array claims {n} bytes")))
        };
        if !self.zlib {
            let length = large(size(&source.peek(width)?, 0))?;
            let run = source.next(length.saturating_add(width))?;
            return Ok(run[width..].to_vec());
        }
        // The first word alone cannot be cut from base64 exactly, but a peek of it can.
        let blocks = large(size(&source.peek(width)?, 0))?;
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let header = source.next(width.saturating_mul(blocks.saturating_add(3)))?;
        let (full, last) = (size(&header, 1), size(&header, 2));
        let packed: Vec<u64> = (0..blocks).map(|i| size(&header, 3 + i)).collect();
        let total = packed.iter().fold(0u64, |a, b| a.saturating_add(*b));
        let run = source.next(large(total)?)?;
        let mut out = Vec::new();
        let mut at = 0usize;
        for (i, &length) in packed.iter().enumerate() {
            let expected = if i + 1 == blocks && last > 0 { last } else { full };
            let block = &run[at..at + length as usize];
            at += length as usize;
            out.extend(decompress::zlib_exact(block, expected).map_err(|f| Flaw { place, ..f })?);
        }
        Ok(out)
    }
}

fn tokens(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    crate::input::scan::tokens(text)
}

/// The frame written as character codes, as VTK writes string arrays.
fn space_codes(text: &[u8]) -> Option<Stated<Frame>> {
    let letters: Vec<u8> = tokens(text)
        .filter_map(|t| std::str::from_utf8(t).ok()?.parse().ok())
        .collect();
    let frame = match letters.split(|&b| b == 0).next()? {
        b"LPS" => Frame::Lps,
        b"RAS" => Frame::Ras,
        _ => return None,
    };
    Some(Stated {
        value: frame,
        by: "its SPACE field".into(),
    })
}
