//! STL: ASCII and binary. A triangle soup by nature: corners of exactly equal coordinates are one point (the only welding any
//! reader does). The frame is taken from `SPACE=...` in the header or the solid's name (3D Slicer).

use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Parsed, SurfaceBuilder, space_comment},
    scalar::{Endian, Scalar},
    scan::{Scan, number, tokens},
    shape::SourceFormat,
};
use glam::DVec3;
use std::collections::HashMap;

const HEADER: usize = 80;
const FACET: usize = 50;

/// Whether the bytes are a binary STL file by their size: the facets counted at byte 80 fill the file to its end.
pub(in crate::input) fn is_binary(bytes: &[u8]) -> bool {
    facet_count(bytes).is_some_and(|n| bytes.len() as u64 == (HEADER + 4) as u64 + n * FACET as u64)
}

fn facet_count(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER..HEADER + 4)?;
    Some(Scalar::U32.integer(count, Endian::Little) as u64)
}

/// Reads an STL file.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut welder = Welder::default();
    // Binary files may begin with "solid" too, so size decides first.
    let ascii = !is_binary(bytes)
        && bytes.starts_with(b"solid")
        && std::str::from_utf8(&bytes[..bytes.len().min(512)])
            .is_ok_and(|t| t.contains("facet") || t.contains("endsolid"));
    let frame = if ascii {
        read_ascii(bytes, &mut welder)?;
        space_comment(bytes.split(|&b| b == b'\n').next().unwrap_or_default())
    } else {
        read_binary(bytes, &mut welder)?;
        space_comment(&bytes[..HEADER])
    };
    let corners = 3 * welder.surface.triangles.len();
    let notes = vec![format!(
        "STL stores loose triangles: {corners} corners with equal coordinates were joined to {} points",
        welder.surface.points.len()
    )];
    Ok(Parsed {
        format: SourceFormat::Stl,
        content: Content::Surface(welder.surface),
        frame,
        units: None,
        warnings: Vec::new(),
        notes,
    })
}

fn read_binary(bytes: &[u8], welder: &mut Welder) -> Result<(), Flaw> {
    let mut scan = Scan::new(bytes);
    let Some(count) = facet_count(bytes) else {
        return Err(Flaw::truncated(
            Place::Byte(bytes.len() as u64),
            format!(
                "a binary STL file has a header of {} bytes, this file has {}",
                HEADER + 4,
                bytes.len()
            ),
        ));
    };
    scan.take(HEADER + 4, "header")?;
    let needed = count * FACET as u64;
    if needed > scan.rest().len() as u64 {
        return Err(Flaw::truncated(
            Place::Byte(HEADER as u64),
            format!(
                "the header says {count} triangles ({needed} bytes), but {} bytes follow",
                scan.rest().len()
            ),
        ));
    }
    for _ in 0..count {
        let start = scan.offset() + 12; // the facet's own normal is redundant and often zero
        let facet = scan.take(FACET, "a triangle")?;
        let v = Scalar::F32.finite(&facet[12..48], Endian::Little, start)?;
        let corner = |i: usize| DVec3::new(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
        welder.triangle([corner(0), corner(1), corner(2)]);
    }
    let extra = scan.rest().len();
    if extra > 0 && count == 0 {
        return Err(Flaw::new(
            Place::Byte(HEADER as u64),
            Fault::Header,
            format!("the header says 0 triangles, but {extra} bytes follow"),
            "the file is damaged: export it again",
        ));
    }
    Ok(())
}

fn read_ascii(bytes: &[u8], welder: &mut Welder) -> Result<(), Flaw> {
    let mut scan = Scan::new(bytes);
    let mut corners: Vec<DVec3> = Vec::with_capacity(3);
    let mut ended = false;
    while let Some(line) = scan.line() {
        let place = scan.last_line();
        let mut words = tokens(line);
        let Some(word) = words.next() else { continue };
        match word.to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let mut next = |what: &str| number(words.next().unwrap_or_default(), what, place);
                corners.push(DVec3::new(next("x")?, next("y")?, next("z")?));
            }
            b"endloop" => {
                let Ok(triangle) = <[DVec3; 3]>::try_from(corners.as_slice()) else {
                    return Err(Flaw::new(
                        place,
                        Fault::Number,
                        format!("a facet has {} corners", corners.len()),
                        "STL facets have three: export the file again",
                    ));
                };
                welder.triangle(triangle);
                corners.clear();
            }
            b"endsolid" => ended = true,
            b"solid" => ended = false,
            b"facet" | b"outer" | b"endfacet" => {}
            _ => {
                return Err(Flaw::new(
                    place,
                    Fault::Header,
                    format!("{} is no STL keyword", quote(line)),
                    "the file is damaged or no STL file: export it again",
                ));
            }
        }
    }
    if !ended || !corners.is_empty() {
        return Err(Flaw::truncated(scan.here(), "the file ends without `endsolid`"));
    }
    Ok(())
}

/// Joins corners of equal coordinates, numbered in the order they first appear.
#[derive(Default)]
struct Welder {
    surface: SurfaceBuilder,
    known: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn triangle(&mut self, corners: [DVec3; 3]) {
        let triangle = corners.map(|p| {
            // Adding zero makes -0 and 0 the same point.
            let key = (p + DVec3::ZERO).to_array().map(f64::to_bits);
            *self.known.entry(key).or_insert_with(|| {
                self.surface.points.push(p);
                self.surface.points.len() as u32 - 1
            })
        });
        self.surface.triangles.push(triangle);
    }
}
