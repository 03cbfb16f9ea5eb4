//! Points as columns of text: XYZ, TXT, PTS, PWN and CSV.
//!
//! * XYZ, TXT: three columns, or six when the last three are unit normals; blanks, tabs, commas or semicolons between.
//! * PTS, PWN: the number of points stands on a line of its own before them; in PWN the normals may follow all points.
//! * CSV: columns `x`, `y`, `z` (and `nx`, `ny`, `nz`) by name when there is a header line, else the first three (six).
//!
//! Lines that begin with `#` or `//` are comments.

use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Parsed, SurfaceBuilder, space_comment},
    scan::{Scan, number},
    shape::SourceFormat,
};
use glam::DVec3;

/// Reads points from columns of text.
pub(in crate::input) fn read_columns(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let mut rows = Rows::default();
    let mut frame = None;
    let mut promised: Option<(i64, Place)> = None;
    let mut first = true;
    while let Some(line) = scan.line() {
        let place = scan.last_line();
        if is_comment(line) {
            frame = frame.or_else(|| space_comment(line));
            continue;
        }
        let mut words = columns(line);
        let Some(head) = words.next() else { continue };
        let second = words.next();
        if first && second.is_none() && promised.is_none() {
            promised = Some((
                crate::input::scan::integer(head, "the number of points", place)?,
                place,
            ));
            continue;
        }
        // A header line of names is allowed before the first row.
        if first && number(head, "x", place).is_err() && columns(line).all(|w| number(w, "x", place).is_err())
        {
            first = false;
            continue;
        }
        first = false;
        rows.push(columns(line), place)?;
    }
    rows.finish(promised, SourceFormat::Xyz, frame)
}

/// Reads points from a CSV table.
pub(in crate::input) fn read_csv(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let delimiter = match bytes.split(|&b| b == b'\n').find(|l| !is_comment(l)) {
        Some(line) if !line.contains(&b',') && line.contains(&b';') => b';',
        Some(line) if !line.contains(&b',') && line.contains(&b'\t') => b'\t',
        _ => b',',
    };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(bytes);
    let mut rows = Rows::default();
    let mut chosen: Option<Vec<usize>> = None;
    let mut record = csv::ByteRecord::new();
    loop {
        let more = reader.read_byte_record(&mut record).map_err(|e| {
            let line = e.position().map_or(1, csv::Position::line);
            Flaw::new(
                Place::Line(line),
                Fault::Header,
                format!("no CSV row: {e}"),
                "mend that line",
            )
        })?;
        if !more {
            break;
        }
        let place = Place::Line(record.position().map_or(1, csv::Position::line));
        if record.iter().all(<[u8]>::is_empty) {
            continue;
        }
        match &chosen {
            None => {
                let header = record
                    .iter()
                    .any(|f| !f.is_empty() && number(f, "x", place).is_err());
                chosen = Some(if header {
                    named_columns(&record, place)?
                } else {
                    (0..record.len()).collect()
                });
                if header {
                    continue;
                }
                rows.push(record.iter(), place)?;
            }
            Some(at) => rows.push(at.iter().map(|&i| record.get(i).unwrap_or_default()), place)?,
        }
    }
    let frame = bytes
        .split(|&b| b == b'\n')
        .take_while(|l| is_comment(l))
        .find_map(space_comment);
    rows.finish(None, SourceFormat::Csv, frame)
}

fn named_columns(header: &csv::ByteRecord, place: Place) -> Result<Vec<usize>, Flaw> {
    let find = |name: &str| {
        header
            .iter()
            .position(|f| f.eq_ignore_ascii_case(name.as_bytes()))
    };
    let points: Vec<usize> = ["x", "y", "z"].iter().filter_map(|n| find(n)).collect();
    if points.len() != 3 {
        return Err(Flaw::new(
            place,
            Fault::Header,
            format!(
                "the header {} names no columns x, y and z",
                quote(header.as_slice())
            ),
            "name the coordinate columns x, y, z (and nx, ny, nz), or leave the header out",
        ));
    }
    let normals: Vec<usize> = ["nx", "ny", "nz"].iter().filter_map(|n| find(n)).collect();
    Ok(if normals.len() == 3 {
        [points, normals].concat()
    } else {
        points
    })
}

fn is_comment(line: &[u8]) -> bool {
    let text = line.trim_ascii_start();
    text.starts_with(b"#") || text.starts_with(b"//")
}

fn columns(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|b| b.is_ascii_whitespace() || *b == b',' || *b == b';')
        .filter(|t| !t.is_empty())
}

/// Rows of numbers, of three columns or six.
#[derive(Default)]
struct Rows {
    points: Vec<DVec3>,
    others: Vec<DVec3>,
    extra_columns: bool,
}

impl Rows {
    fn push<'a>(&mut self, mut words: impl Iterator<Item = &'a [u8]>, place: Place) -> Result<(), Flaw> {
        let mut next = |what: &str| {
            words.next().map_or_else(
                || {
                    Err(Flaw::new(
                        place,
                        Fault::Number,
                        format!("{what} is missing"),
                        "every line needs at least three numbers, x y z: complete or remove that line",
                    ))
                },
                |w| number(w, what, place),
            )
        };
        self.points.push(DVec3::new(next("x")?, next("y")?, next("z")?));
        let more: Vec<f64> = words.map_while(|w| number(w, "a column", place).ok()).collect();
        match more.as_slice() {
            [] => {}
            [x, y, z] => self.others.push(DVec3::new(*x, *y, *z)),
            _ => self.extra_columns = true,
        }
        Ok(())
    }

    fn finish(
        mut self,
        promised: Option<(i64, Place)>,
        format: SourceFormat,
        frame: Option<crate::input::parsed::Stated<crate::input::parsed::Frame>>,
    ) -> Result<Parsed, Flaw> {
        let mut warnings = Vec::new();
        if let Some((count, place)) = promised {
            let rows = self.points.len() as i64;
            if rows == count.saturating_mul(2) && self.others.is_empty() {
                self.others = self.points.split_off(count as usize);
            } else if rows < count || count < 0 {
                return Err(Flaw::truncated(
                    place,
                    format!("the file says {count} points, but has {rows} lines of them"),
                ));
            } else if rows > count {
                return Err(Flaw::new(
                    place,
                    Fault::Header,
                    format!("the file says {count} points, but has {rows} lines of them"),
                    "correct the count or export the file again",
                ));
            }
        }
        let complete = self.others.len() == self.points.len();
        let unit = self
            .others
            .iter()
            .filter(|n| (n.length() - 1.0).abs() < 0.1)
            .count();
        let normals = if complete && 10 * unit >= 9 * self.others.len() {
            self.others
        } else {
            Vec::new()
        };
        if self.extra_columns
            || (normals.is_empty() && unit < self.points.len() && complete && !self.points.is_empty())
        {
            warnings.push("columns beyond x, y, z that are no unit normals were ignored".to_owned());
        }
        Ok(Parsed {
            format,
            content: Content::Surface(SurfaceBuilder {
                points: self.points,
                normals,
                ..Default::default()
            }),
            frame,
            units: None,
            warnings,
            notes: Vec::new(),
        })
    }
}
