//! OFF and its variants with normals or colours (NOFF, COFF, CNOFF); text only. Comments begin with `#`.

use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Parsed, SurfaceBuilder, space_comment},
    scan::{Scan, integer, number, tokens},
    shape::SourceFormat,
};
use glam::DVec3;

/// Whether the first word is an OFF keyword.
pub(in crate::input) fn is_keyword(word: &[u8]) -> bool {
    matches!(word, b"OFF" | b"COFF" | b"NOFF" | b"CNOFF" | b"STOFF")
}

/// Reads an OFF file.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut lines = Lines {
        scan: Scan::new(bytes),
        frame: None,
    };
    let (line, place) = lines.next("the keyword OFF")?;
    let mut words = tokens(line);
    let keyword = words.next().unwrap_or_default();
    if !is_keyword(keyword) {
        return Err(Flaw::new(
            place,
            Fault::Header,
            format!("an OFF file begins with OFF, found {}", quote(keyword)),
            "the file is damaged or no OFF file",
        ));
    }
    let mut counts: Vec<&[u8]> = words.collect();
    if counts.first() == Some(&b"BINARY".as_slice()) {
        return Err(Flaw::new(
            place,
            Fault::Unsupported,
            "binary OFF is not read",
            "export it as text OFF or as PLY",
        ));
    }
    let mut place = place;
    if counts.is_empty() {
        let (line, at) = lines.next("the counts of points and faces")?;
        counts = tokens(line).collect();
        place = at;
    }
    let count = |i: usize, what: &str, least: usize| -> Result<usize, Flaw> {
        let n = integer(counts.get(i).copied().unwrap_or_default(), what, place)?;
        let mut flaw_place = lines.scan.promise(n, what, least);
        if let Err(flaw) = &mut flaw_place {
            flaw.place = place;
        }
        flaw_place
    };
    let (points, faces) = (count(0, "points", 6)?, count(1, "faces", 2)?);
    let has_normals = matches!(keyword, b"NOFF");
    let mut surface = SurfaceBuilder::default();
    surface.points.reserve(points);
    for _ in 0..points {
        let (line, place) = lines.next("a point")?;
        let mut words = tokens(line);
        let mut next = |what: &str| number(words.next().unwrap_or_default(), what, place);
        surface
            .points
            .push(DVec3::new(next("x")?, next("y")?, next("z")?));
        if has_normals {
            surface
                .normals
                .push(DVec3::new(next("nx")?, next("ny")?, next("nz")?));
        }
    }
    let mut corners = Vec::new();
    for _ in 0..faces {
        let (line, place) = lines.next("a face")?;
        let mut words = tokens(line);
        let n = integer(
            words.next().unwrap_or_default(),
            "the corner count of a face",
            place,
        )?;
        corners.clear();
        for _ in 0..n.clamp(0, line.len() as i64) {
            corners.push(integer(words.next().unwrap_or_default(), "a face corner", place)?);
        }
        if corners.len() as i64 != n {
            return Err(Flaw::new(
                place,
                Fault::Number,
                format!("a face of {n} corners on a line of {} bytes", line.len()),
                "mend that line or export the file again",
            ));
        }
        surface.polygon(&corners, place)?;
    }
    Ok(Parsed {
        format: SourceFormat::Off,
        content: Content::Surface(surface),
        frame: lines.frame,
        units: None,
        warnings: Vec::new(),
        notes: Vec::new(),
    })
}

struct Lines<'a> {
    scan: Scan<'a>,
    frame: Option<crate::input::parsed::Stated<crate::input::parsed::Frame>>,
}

impl<'a> Lines<'a> {
    /// The next line that is neither blank nor a comment.
    fn next(&mut self, what: &str) -> Result<(&'a [u8], Place), Flaw> {
        while let Some(line) = self.scan.line() {
            let content = line.split(|&b| b == b'#').next().unwrap_or_default();
            if content.len() < line.len() && self.frame.is_none() {
                self.frame = space_comment(line);
            }
            if tokens(content).next().is_some() {
                return Ok((content, self.scan.last_line()));
            }
        }
        Err(Flaw::truncated(
            self.scan.here(),
            format!("the file ends where {what} should be"),
        ))
    }
}
