//! Wavefront OBJ: `v` and `f` lines (indices from 1, negative ones from the end); texture, material and grouping lines are
//! skipped. Vertex normals are kept for point clouds only, where every vertex has one. The frame is taken from a
//! `# SPACE=...` comment.

use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Parsed, SurfaceBuilder, space_comment},
    scan::{Scan, integer, number, tokens},
    shape::SourceFormat,
};
use glam::DVec3;
use std::borrow::Cow;

/// Keywords that have nothing to do with points and faces.
const SKIPPED: &[&[u8]] = &[
    b"vt",
    b"vp",
    b"o",
    b"g",
    b"s",
    b"mg",
    b"mtllib",
    b"usemtl",
    b"maplib",
    b"usemap",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"ctech",
    b"stech",
];

/// Reads an OBJ file.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let mut surface = SurfaceBuilder::default();
    let mut faces: Vec<Face> = Vec::new();
    let mut corners: Vec<i64> = Vec::new();
    let mut frame = None;
    let mut unknown: Option<String> = None;
    let mut unknown_lines = 0;
    while let Some(line) = scan.line() {
        let place = scan.last_line();
        let line = continued(line, &mut scan);
        let mut words = tokens(&line);
        match words.next() {
            Some(b"v") => surface.points.push(vector(&mut words, place)?),
            Some(b"vn") => surface.normals.push(vector(&mut words, place)?),
            Some(b"f") => {
                let start = corners.len();
                for word in words {
                    corners.push(corner(word, surface.points.len(), place)?);
                }
                faces.push(Face { start, place });
            }
            Some(b"l" | b"p") => surface.ignored_lines += 1,
            Some(word) if word.starts_with(b"#") => frame = frame.or_else(|| space_comment(&line)),
            Some(word) if SKIPPED.contains(&word) || line.is_empty() => {}
            Some(word) => {
                unknown.get_or_insert_with(|| format!("{place}{} is no OBJ keyword", quote(word)));
                unknown_lines += 1;
            }
            None => {}
        }
    }
    // Faces may stand before the vertices they use, so they are checked at the end.
    for (i, face) in faces.iter().enumerate() {
        let end = faces.get(i + 1).map_or(corners.len(), |next| next.start);
        surface.polygon(&corners[face.start..end], face.place)?;
    }
    if !surface.triangles.is_empty() || surface.normals.len() != surface.points.len() {
        surface.normals.clear();
    }
    Ok(Parsed {
        notes: Vec::new(),
        format: SourceFormat::Obj,
        content: Content::Surface(surface),
        frame,
        units: None,
        warnings: unknown
            .map(|first| format!("{unknown_lines} lines were not understood and skipped; the first: {first}"))
            .into_iter()
            .collect(),
    })
}

struct Face {
    start: usize,
    place: Place,
}

/// A line with its continuations (`\` at the end).
fn continued<'a>(line: &'a [u8], scan: &mut Scan<'a>) -> Cow<'a, [u8]> {
    let Some(head) = line.strip_suffix(b"\\") else {
        return Cow::Borrowed(line);
    };
    let mut whole = head.to_vec();
    while let Some(next) = scan.line() {
        whole.push(b' ');
        match next.strip_suffix(b"\\") {
            Some(head) => whole.extend_from_slice(head),
            None => {
                whole.extend_from_slice(next);
                break;
            }
        }
    }
    Cow::Owned(whole)
}

fn vector<'a>(words: &mut impl Iterator<Item = &'a [u8]>, place: Place) -> Result<DVec3, Flaw> {
    let mut next = |what: &str| number(words.next().unwrap_or_default(), what, place);
    Ok(DVec3::new(next("x")?, next("y")?, next("z")?))
}

/// Point index, from 0, of a face corner `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn corner(word: &[u8], points: usize, place: Place) -> Result<i64, Flaw> {
    let first = word.split(|&b| b == b'/').next().unwrap_or_default();
    match integer(first, "a face corner", place)? {
        0 => Err(Flaw::new(
            place,
            Fault::Index,
            "a face refers to point 0, but OBJ counts from 1",
            "export the file again with a program that follows the format",
        )),
        i if i > 0 => Ok(i - 1),
        i => Ok(i.saturating_add(points as i64)),
    }
}
