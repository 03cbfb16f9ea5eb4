//! VTK legacy files (`.vtk`): versions 1 to 4 and the 5.1 that VTK 9 writes, ASCII and binary; `POLYDATA`, and the surface cells
//! of an `UNSTRUCTURED_GRID`. Reading stops at `POINT_DATA`. The frame is taken from `SPACE=...` in the title.

use crate::input::{
    error::{Fault, Flaw, Place, quote},
    parsed::{Content, Parsed, SurfaceBuilder, space_comment},
    scalar::{Endian, Scalar},
    scan::{Scan, tokens},
    shape::SourceFormat,
};
use glam::DVec3;

/// Reads a legacy VTK file.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let version = version(scan.line().unwrap_or_default())?;
    let title = scan.line().unwrap_or_default();
    let binary = match scan.token() {
        Some(b"ASCII") => false,
        Some(b"BINARY") => true,
        other => {
            return Err(header(
                &scan,
                format!(
                    "ASCII or BINARY should follow the title, found {}",
                    quote(other.unwrap_or_default())
                ),
            ));
        }
    };
    let mut file = File {
        scan,
        binary,
        offsets: version >= 5.0,
        surface: SurfaceBuilder::default(),
        cells: None,
    };
    file.sections()?;
    Ok(Parsed {
        format: SourceFormat::VtkLegacy,
        content: Content::Surface(file.surface),
        frame: space_comment(title),
        units: None,
        warnings: Vec::new(),
        notes: Vec::new(),
    })
}

fn version(line: &[u8]) -> Result<f64, Flaw> {
    std::str::from_utf8(line)
        .ok()
        .and_then(|t| t.split_whitespace().last())
        .and_then(|v| v.parse().ok())
        .filter(|v| (1.0..6.0).contains(v))
        .ok_or_else(|| {
            Flaw::new(
                Place::Line(1),
                Fault::Unsupported,
                format!("{} is no known version", quote(line)),
                "legacy versions 1 to 5 are read; write the file again or save it as .vtp",
            )
        })
}

fn header(scan: &Scan, found: String) -> Flaw {
    Flaw::new(
        scan.here(),
        Fault::Header,
        found,
        "the file is damaged: export it again",
    )
}

struct File<'a> {
    scan: Scan<'a>,
    binary: bool,
    /// Cells are stored as offsets and connectivity (version 5) rather than as counted lists.
    offsets: bool,
    surface: SurfaceBuilder,
    /// Cells of an unstructured grid, which wait for their types.
    cells: Option<Lists>,
}

/// Lists of point indices, one after another.
struct Lists {
    /// Where each list begins, and where the last ends.
    starts: Vec<usize>,
    items: Vec<i64>,
    place: Place,
}

impl Lists {
    fn iter(&self) -> impl Iterator<Item = &[i64]> {
        self.starts.windows(2).map(|w| &self.items[w[0]..w[1]])
    }
}

impl File<'_> {
    fn sections(&mut self) -> Result<(), Flaw> {
        while let Some(word) = self.scan.token() {
            match word.to_ascii_uppercase().as_slice() {
                b"DATASET" => self.dataset()?,
                b"POINTS" => self.points()?,
                b"VERTICES" | b"LINES" => {
                    self.surface.ignored_lines += self.lists()?.iter().count();
                }
                b"POLYGONS" => {
                    let lists = self.lists()?;
                    for polygon in lists.iter() {
                        self.surface.polygon(polygon, lists.place)?;
                    }
                }
                b"TRIANGLE_STRIPS" => {
                    let lists = self.lists()?;
                    for strip in lists.iter() {
                        self.surface.strip(strip, lists.place)?;
                    }
                }
                b"CELLS" => self.cells = Some(self.lists()?),
                b"CELL_TYPES" => self.cell_types()?,
                b"METADATA" => self.skip_metadata(),
                b"FIELD" => self.skip_field()?,
                b"POINT_DATA" | b"CELL_DATA" => return Ok(()),
                _ => {
                    return Err(header(
                        &self.scan,
                        format!("a section name should follow, found {}", quote(word)),
                    ));
                }
            }
        }
        Ok(())
    }

    fn dataset(&mut self) -> Result<(), Flaw> {
        match self.scan.token().unwrap_or_default() {
            b"POLYDATA" | b"UNSTRUCTURED_GRID" => Ok(()),
            other => Err(Flaw::new(
                self.scan.here(),
                Fault::Unsupported,
                format!("the data set is {}", quote(other)),
                "POLYDATA and UNSTRUCTURED_GRID are read; save surfaces as .vtp and label maps as .nrrd or .nii.gz",
            )),
        }
    }

    fn points(&mut self) -> Result<(), Flaw> {
        let count = self.scan.integer("the number of points")?;
        let scalar = self.scalar_type()?;
        let n = self.promise(count, "points", 3 * scalar.size(), 6)?;
        let values = if self.binary {
            let start = self.scan.offset();
            scalar.finite(
                self.scan.take(3 * n * scalar.size(), "points")?,
                Endian::Big,
                start,
            )?
        } else {
            (0..3 * n)
                .map(|_| self.scan.number("a coordinate"))
                .collect::<Result<_, _>>()?
        };
        self.surface.points = values.chunks_exact(3).map(DVec3::from_slice).collect();
        Ok(())
    }

    /// A count whose items must fit into what is left of the file.
    fn promise(
        &self,
        count: i64,
        what: &str,
        binary_bytes: usize,
        ascii_bytes: usize,
    ) -> Result<usize, Flaw> {
        // The last ASCII item may lack its blank.
        let least = if self.binary { binary_bytes } else { ascii_bytes };
        self.scan.promise(
            count.saturating_sub(i64::from(!self.binary && count > 0)),
            what,
            least,
        )?;
        Ok(count as usize)
    }

    fn scalar_type(&mut self) -> Result<Scalar, Flaw> {
        let name = self.scan.token().unwrap_or_default();
        let scalar = match name.to_ascii_lowercase().as_slice() {
            b"float" => Scalar::F32,
            b"double" => Scalar::F64,
            b"char" | b"signed_char" => Scalar::I8,
            b"unsigned_char" => Scalar::U8,
            b"short" => Scalar::I16,
            b"unsigned_short" => Scalar::U16,
            b"int" => Scalar::I32,
            b"unsigned_int" => Scalar::U32,
            b"long" | b"vtktypeint64" | b"vtkidtype" => Scalar::I64,
            b"unsigned_long" | b"vtktypeuint64" => Scalar::U64,
            _ => {
                return Err(header(
                    &self.scan,
                    format!("{} is no known type of number", quote(name)),
                ));
            }
        };
        self.end_line();
        Ok(scalar)
    }

    /// Binary data begin right after the line end.
    fn end_line(&mut self) {
        if self.binary {
            self.scan.line();
        }
    }

    fn integers(&mut self, n: usize, scalar: Scalar, what: &str) -> Result<Vec<i64>, Flaw> {
        if self.binary {
            let bytes = n.saturating_mul(scalar.size());
            Ok(scalar.integers(self.scan.take(bytes, what)?, Endian::Big))
        } else {
            (0..n).map(|_| self.scan.integer(what)).collect()
        }
    }

    fn lists(&mut self) -> Result<Lists, Flaw> {
        let first = self.scan.integer("a number of cells")?;
        let second = self.scan.integer("a size of cells")?;
        if self.offsets {
            self.offset_lists(first, second)
        } else {
            self.counted_lists(first, second)
        }
    }

    /// Version 5: `n+1` offsets, then the connectivity.
    fn offset_lists(&mut self, offsets: i64, items: i64) -> Result<Lists, Flaw> {
        let place = self.scan.here();
        self.keyword(b"OFFSETS")?;
        let scalar = self.scalar_type()?;
        let n = self.promise(offsets, "offsets", scalar.size(), 2)?;
        let offsets = self.integers(n, scalar, "an offset")?;
        self.keyword(b"CONNECTIVITY")?;
        let scalar = self.scalar_type()?;
        let n = self.promise(items, "point indices", scalar.size(), 2)?;
        let items = self.integers(n, scalar, "a point index")?;
        let sound = offsets.first().is_none_or(|&o| o == 0)
            && offsets.windows(2).all(|w| w[0] <= w[1])
            && offsets.last().is_none_or(|&o| o as u64 == n as u64);
        if !sound {
            return Err(Flaw::new(
                place,
                Fault::Index,
                "the cell offsets do not fit the connectivity",
                "the file is damaged: export it again",
            ));
        }
        Ok(Lists {
            starts: offsets.iter().map(|&o| o as usize).collect(),
            items,
            place,
        })
    }

    /// Up to version 4: every list begins with its length, all as 32-bit integers.
    fn counted_lists(&mut self, cells: i64, size: i64) -> Result<Lists, Flaw> {
        let place = self.scan.here();
        self.end_line();
        let n = self.promise(size, "cell entries", Scalar::I32.size(), 2)?;
        let entries = self.integers(n, Scalar::I32, "a cell entry")?;
        let mut lists = Lists {
            starts: vec![0],
            items: Vec::with_capacity(n),
            place,
        };
        let mut rest = entries.as_slice();
        while let [length, tail @ ..] = rest {
            let list = usize::try_from(*length)
                .ok()
                .and_then(|l| tail.get(..l))
                .ok_or_else(|| {
                    Flaw::new(
                        place,
                        Fault::Index,
                        format!("a cell claims {length} points, {} entries are left", tail.len()),
                        "the file is damaged: export it again",
                    )
                })?;
            lists.items.extend_from_slice(list);
            lists.starts.push(lists.items.len());
            rest = &tail[list.len()..];
        }
        if lists.starts.len() as i64 - 1 != cells {
            return Err(Flaw::new(
                place,
                Fault::Header,
                format!(
                    "the header says {cells} cells, the data hold {}",
                    lists.starts.len() - 1
                ),
                "the file is damaged: export it again",
            ));
        }
        Ok(lists)
    }

    fn keyword(&mut self, expected: &[u8]) -> Result<(), Flaw> {
        match self.scan.token() {
            Some(word) if word.eq_ignore_ascii_case(expected) => Ok(()),
            other => Err(header(
                &self.scan,
                format!(
                    "{} should follow, found {}",
                    quote(expected),
                    quote(other.unwrap_or_default())
                ),
            )),
        }
    }

    /// Keeps the surface cells of an unstructured grid.
    fn cell_types(&mut self) -> Result<(), Flaw> {
        let n = self.scan.integer("a number of cell types")?;
        let n = self.promise(n, "cell types", 4, 2)?;
        self.end_line();
        let types = self.integers(n, Scalar::I32, "a cell type")?;
        let Some(lists) = self.cells.take() else {
            return Err(header(&self.scan, "CELL_TYPES stands before CELLS".into()));
        };
        for (cell, kind) in lists.iter().zip(&types) {
            match kind {
                5 | 7 | 9 => self.surface.polygon(cell, lists.place)?,
                6 => self.surface.strip(cell, lists.place)?,
                1..=4 => self.surface.ignored_lines += 1,
                other => {
                    return Err(Flaw::new(
                        lists.place,
                        Fault::Unsupported,
                        format!("a cell has type {other}, which is not a surface cell"),
                        "extract the surface first (vtkGeometryFilter, or Extract Surface in ParaView)",
                    ));
                }
            }
        }
        Ok(())
    }

    /// A METADATA block ends with a blank line.
    fn skip_metadata(&mut self) {
        self.scan.line();
        while self.scan.line().is_some_and(|l| tokens(l).next().is_some()) {}
    }

    fn skip_field(&mut self) -> Result<(), Flaw> {
        self.scan.token();
        let arrays = self.scan.count("field arrays", 2)?;
        for _ in 0..arrays {
            while self.scan.peek() == Some(b"METADATA") {
                self.scan.token();
                self.skip_metadata();
            }
            self.scan.token();
            let components = self.scan.integer("the components of a field array")?;
            let tuples = self.scan.integer("the tuples of a field array")?;
            let items = components.saturating_mul(tuples);
            if self
                .scan
                .peek()
                .is_some_and(|t| t.eq_ignore_ascii_case(b"string"))
            {
                self.scan.line();
                for _ in 0..self.scan.promise(items, "strings", 1)? {
                    self.scan.line();
                }
                continue;
            }
            let scalar = self.scalar_type()?;
            let n = self.promise(items, "field values", scalar.size(), 2)?;
            if self.binary {
                self.scan.take(n * scalar.size(), "a field array")?;
            } else {
                for _ in 0..n {
                    self.scan.token();
                }
            }
        }
        Ok(())
    }
}
