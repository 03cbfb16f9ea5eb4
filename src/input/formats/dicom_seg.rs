//! DICOM segmentations (`.dcm`: Segmentation Storage, binary or fractional, and Label Map Segmentation Storage).
//!
//! In: one multi-frame file, native pixel data, explicit or implicit VR, little endian. Out: a label volume whose labels are the segment
//! numbers, in LPS mm. Steps:
//! 1. the data set becomes a tree of elements, every length checked against the bytes that follow;
//! 2. each frame's segment, position and orientation come from its functional groups, or the shared ones;
//! 3. frames are put in their places along the normal: empty slices may be left out, frames may come in any order;
//! 4. bits are unpacked (one stream over all frames, lowest bit first), fractions count from half of their maximum.
//!
//! Voxels of two segments keep the higher number, and a warning counts them. The reader is ours because a length in a damaged file must not
//! reserve memory, and messages name the byte.

use super::volume::checked_dims;
use crate::input::{
    error::{Fault, Flaw, Place},
    parsed::{Content, Frame, Parsed, Stated, Units, Volume},
    shape::SourceFormat,
};
use glam::{DMat3, DVec3};

/// A tag, group and element.
type Tag = (u16, u16);

const TRANSFER_SYNTAX: Tag = (0x0002, 0x0010);
const SOP_CLASS: Tag = (0x0008, 0x0016);
const SLICE_THICKNESS: Tag = (0x0018, 0x0050);
const SLICE_SPACING: Tag = (0x0018, 0x0088);
const POSITION: Tag = (0x0020, 0x0032);
const ORIENTATION: Tag = (0x0020, 0x0037);
const PLANE_POSITION: Tag = (0x0020, 0x9113);
const PLANE_ORIENTATION: Tag = (0x0020, 0x9116);
const FRAMES: Tag = (0x0028, 0x0008);
const ROWS: Tag = (0x0028, 0x0010);
const COLUMNS: Tag = (0x0028, 0x0011);
const PIXEL_SPACING: Tag = (0x0028, 0x0030);
const BITS_ALLOCATED: Tag = (0x0028, 0x0100);
const PIXEL_MEASURES: Tag = (0x0028, 0x9110);
const SEGMENTATION_TYPE: Tag = (0x0062, 0x0001);
const SEGMENTS: Tag = (0x0062, 0x0002);
const SEGMENT_NUMBER: Tag = (0x0062, 0x0004);
const SEGMENT_LABEL: Tag = (0x0062, 0x0005);
const SEGMENT_IDENTIFICATION: Tag = (0x0062, 0x000a);
const REFERENCED_SEGMENT: Tag = (0x0062, 0x000b);
const MOST_FRACTION: Tag = (0x0062, 0x000e);
const SHARED_GROUPS: Tag = (0x5200, 0x9229);
const FRAME_GROUPS: Tag = (0x5200, 0x9230);
const PIXELS: Tag = (0x7fe0, 0x0010);
const ITEM: Tag = (0xfffe, 0xe000);
const ITEM_END: Tag = (0xfffe, 0xe00d);
const SEQUENCE_END: Tag = (0xfffe, 0xe0dd);

const SEGMENTATION: &str = "1.2.840.10008.5.1.4.1.1.66.4";
const LABEL_MAP: &str = "1.2.840.10008.5.1.4.1.1.66.7";
const IMPLICIT: &str = "1.2.840.10008.1.2";
const EXPLICIT: &str = "1.2.840.10008.1.2.1";

/// Length of a sequence or item that ends with a mark.
const OPEN: u32 = u32::MAX;
/// Sequences within sequences; segmentations have about six.
const DEEPEST: usize = 24;
/// A frame off its slice by more than this share of the distance between slices is not on one grid.
const OFF_GRID: f64 = 0.02;

/// Whether the bytes begin like a DICOM file.
pub(in crate::input) fn is_dicom(head: &[u8]) -> bool {
    head.get(128..132) == Some(b"DICM")
}

/// One element: bytes, or the items of a sequence.
struct Element<'a> {
    tag: Tag,
    bytes: &'a [u8],
    items: Vec<DataSet<'a>>,
}

/// Elements in the order of the file.
#[derive(Default)]
struct DataSet<'a> {
    elements: Vec<Element<'a>>,
}

impl<'a> DataSet<'a> {
    fn get(&self, tag: Tag) -> Option<&Element<'a>> {
        self.elements.iter().find(|e| e.tag == tag)
    }

    fn items(&self, tag: Tag) -> &[DataSet<'a>] {
        self.get(tag).map_or(&[], |e| e.items.as_slice())
    }

    fn text(&self, tag: Tag) -> Option<String> {
        let bytes = self.get(tag)?.bytes;
        let text = String::from_utf8_lossy(bytes);
        Some(
            text.trim_matches(|c: char| c == '\0' || c.is_whitespace())
                .to_owned(),
        )
    }

    fn short(&self, tag: Tag) -> Option<u16> {
        let bytes = self.get(tag)?.bytes.get(..2)?;
        Some(u16::from_le_bytes([bytes[0], bytes[1]]))
    }

    /// Decimal strings joined by backslashes.
    fn numbers(&self, tag: Tag) -> Option<Vec<f64>> {
        let text = self.text(tag)?;
        let parts = text.split('\\').map(|p| p.trim().parse::<f64>());
        parts
            .collect::<Result<Vec<f64>, _>>()
            .ok()
            .filter(|v| v.iter().all(|x| x.is_finite()))
    }

    fn vector(&self, tag: Tag) -> Option<DVec3> {
        match self.numbers(tag)?.as_slice() {
            &[x, y, z] => Some(DVec3::new(x, y, z)),
            _ => None,
        }
    }
}

/// A place in the file and how its elements are written.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    explicit: bool,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, n: usize, what: &str) -> Result<&'a [u8], Flaw> {
        let found = self
            .at
            .checked_add(n)
            .and_then(|end| self.bytes.get(self.at..end));
        let Some(found) = found else {
            return Err(Flaw::truncated(
                Place::Byte(self.at as u64),
                format!("{what} needs {n} bytes, {} follow", self.bytes.len() - self.at),
            ));
        };
        self.at += n;
        Ok(found)
    }

    fn short(&mut self) -> Result<u16, Flaw> {
        let b = self.take(2, "a number")?;
        Ok(u16::from_le_bytes([b[0], b[1]]))
    }

    fn long(&mut self) -> Result<u32, Flaw> {
        let b = self.take(4, "a number")?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    fn tag(&mut self) -> Result<Tag, Flaw> {
        Ok((self.short()?, self.short()?))
    }

    /// Elements up to `end`, or to the mark that ends an open item.
    fn data_set(&mut self, end: Option<usize>, depth: usize) -> Result<DataSet<'a>, Flaw> {
        let mut out = DataSet::default();
        while self.at < end.unwrap_or(self.bytes.len()) {
            let start = self.at;
            let tag = self.tag()?;
            if tag == ITEM_END && end.is_none() {
                self.long()?;
                return Ok(out);
            }
            let element = self.element(tag, start, depth)?;
            out.elements.push(element);
        }
        Ok(out)
    }

    fn element(&mut self, tag: Tag, start: usize, depth: usize) -> Result<Element<'a>, Flaw> {
        let mut sequence = matches!(
            tag,
            PLANE_POSITION
                | PLANE_ORIENTATION
                | PIXEL_MEASURES
                | SEGMENTS
                | SEGMENT_IDENTIFICATION
                | SHARED_GROUPS
                | FRAME_GROUPS
        );
        let was_explicit = self.explicit;
        let length = if self.explicit {
            let vr: [u8; 2] = self.take(2, "a type")?.try_into().unwrap_or_default();
            sequence = &vr == b"SQ";
            if matches!(
                &vr,
                b"OB"
                    | b"OD"
                    | b"OF"
                    | b"OL"
                    | b"OV"
                    | b"OW"
                    | b"SQ"
                    | b"SV"
                    | b"UC"
                    | b"UN"
                    | b"UR"
                    | b"UT"
                    | b"UV"
            ) {
                self.short()?;
                // What is of unknown type and open is written without types.
                let length = self.long()?;
                self.explicit = &vr != b"UN" || length != OPEN;
                length
            } else {
                u32::from(self.short()?)
            }
        } else {
            self.long()?
        };
        if tag == PIXELS && length == OPEN {
            return Err(Flaw::new(
                Place::Byte(start as u64),
                Fault::Unsupported,
                "the pixels are compressed",
                "save the segmentation uncompressed (Explicit VR Little Endian), as most programs do by default",
            ));
        }
        let out = if sequence || length == OPEN {
            if depth >= DEEPEST {
                return Err(Flaw::new(
                    Place::Byte(start as u64),
                    Fault::Header,
                    "sequences lie too deep within each other",
                    "the file is damaged: export it again",
                ));
            }
            Element {
                tag,
                bytes: &[],
                items: self.items(length, depth)?,
            }
        } else {
            Element {
                tag,
                bytes: self.take(length as usize, "a value")?,
                items: Vec::new(),
            }
        };
        self.explicit = was_explicit;
        Ok(out)
    }

    fn end_of(&self, length: u32, what: &str) -> Result<Option<usize>, Flaw> {
        if length == OPEN {
            return Ok(None);
        }
        let end = self.at + length as usize;
        if end > self.bytes.len() {
            return Err(Flaw::truncated(
                Place::Byte(self.at as u64),
                format!(
                    "{what} needs {length} bytes, {} follow",
                    self.bytes.len() - self.at
                ),
            ));
        }
        Ok(Some(end))
    }

    fn items(&mut self, length: u32, depth: usize) -> Result<Vec<DataSet<'a>>, Flaw> {
        let end = self.end_of(length, "a sequence")?;
        let mut items = Vec::new();
        while self.at < end.unwrap_or(usize::MAX) {
            let start = self.at;
            let tag = self.tag()?;
            let length = self.long()?;
            match tag {
                SEQUENCE_END if end.is_none() => break,
                ITEM => {
                    let end = self.end_of(length, "an item")?;
                    items.push(self.data_set(end, depth + 1)?);
                }
                _ => {
                    return Err(Flaw::new(
                        Place::Byte(start as u64),
                        Fault::Header,
                        format!("({:04x},{:04x}) stands where an item should begin", tag.0, tag.1),
                        "the file is damaged: export it again",
                    ));
                }
            }
        }
        Ok(items)
    }
}

fn missing(what: &str) -> Flaw {
    Flaw::file(
        Fault::Header,
        format!("{what} is missing or malformed"),
        "export the segmentation again, with one orientation and its functional groups",
    )
}

/// Reads a DICOM segmentation.
pub(in crate::input) fn read(bytes: &[u8], max_voxels: u64) -> Result<Parsed, Flaw> {
    let mut cursor = Cursor {
        bytes,
        at: 132,
        explicit: true,
    };
    // Group 2 is always explicit; its first element says how long it is.
    let tag = cursor.tag()?;
    let length = cursor.element(tag, 132, 0)?;
    let length: [u8; 4] = length
        .bytes
        .try_into()
        .map_err(|_| missing("the length of the file's own header"))?;
    let end = cursor.end_of(u32::from_le_bytes(length), "the file's own header")?;
    let meta = cursor.data_set(end, 0)?;
    let syntax = meta.text(TRANSFER_SYNTAX).unwrap_or_default();
    cursor.explicit = match syntax.as_str() {
        EXPLICIT => true,
        IMPLICIT => false,
        other => {
            return Err(Flaw::file(
                Fault::Unsupported,
                format!("the transfer syntax is {other}"),
                "save the segmentation uncompressed (Explicit VR Little Endian)",
            ));
        }
    };
    let set = cursor.data_set(Some(bytes.len()), 0)?;
    let class = set.text(SOP_CLASS).unwrap_or_default();
    if class != SEGMENTATION && class != LABEL_MAP {
        return Err(Flaw::file(
            Fault::Unsupported,
            format!("the DICOM object is of class {class}, not a segmentation"),
            "give a segmentation (SEG); images and RT structure sets are turned into one by 3D Slicer or dcmqi",
        ));
    }
    volume(&set, class == LABEL_MAP, max_voxels)
}

/// Where a frame lies and which segment it shows.
struct Slice {
    /// Along the normal, mm.
    along: f64,
    position: DVec3,
    segment: i32,
}

/// The grid of one slice.
struct Plane {
    steps: [DVec3; 2],
    normal: DVec3,
    /// Distance of slices that the file states, mm.
    stated: Option<f64>,
}

fn plane(shared: &DataSet, frame: &DataSet) -> Result<Plane, Flaw> {
    let group = |tag: Tag| frame.items(tag).first().or_else(|| shared.items(tag).first());
    let orientation = group(PLANE_ORIENTATION)
        .and_then(|g| g.numbers(ORIENTATION))
        .filter(|o| o.len() == 6)
        .ok_or_else(|| missing("the orientation of the planes"))?;
    let measures = group(PIXEL_MEASURES).ok_or_else(|| missing("the size of the pixels"))?;
    let [down, across] = match measures.numbers(PIXEL_SPACING).as_deref() {
        // Between rows first, then between columns.
        Some(&[down, across]) if down > 0.0 && across > 0.0 => [down, across],
        _ => return Err(missing("the size of the pixels")),
    };
    let row = DVec3::new(orientation[0], orientation[1], orientation[2]).normalize_or_zero();
    let column = DVec3::new(orientation[3], orientation[4], orientation[5]).normalize_or_zero();
    let one = |tag: Tag| {
        measures
            .numbers(tag)
            .and_then(|v| v.first().copied())
            .filter(|x| *x > 0.0)
    };
    Ok(Plane {
        steps: [row * across, column * down],
        normal: row.cross(column).normalize_or_zero(),
        stated: one(SLICE_SPACING).or_else(|| one(SLICE_THICKNESS)),
    })
}

fn volume(set: &DataSet, label_map: bool, max_voxels: u64) -> Result<Parsed, Flaw> {
    let nothing = DataSet::default();
    let shared = set.items(SHARED_GROUPS).first().unwrap_or(&nothing);
    let groups = set.items(FRAME_GROUPS);
    let count = set
        .numbers(FRAMES)
        .and_then(|v| v.first().copied())
        .unwrap_or(1.0) as usize;
    if groups.len() != count || count == 0 {
        return Err(missing(&format!("the place of each of the {count} frames")));
    }
    let grid = plane(shared, &groups[0])?;
    let mut slices = Vec::with_capacity(count);
    for (index, frame) in groups.iter().enumerate() {
        slices.push(slice(shared, frame, &grid, label_map).ok_or_else(|| {
            Flaw::new(
                Place::Element {
                    kind: "frame",
                    index: index as u64,
                },
                Fault::Header,
                "its position or segment is missing, or it is turned otherwise than the first",
                "export the segmentation again, on one grid",
            )
        })?);
    }
    let places = Places::of(&slices, &grid)?;
    let [rows, columns] = [ROWS, COLUMNS].map(|t| set.short(t).map_or(0, i64::from));
    let dims = checked_dims([columns, rows, places.slices as i64], max_voxels)?;
    let pixels = Pixels::of(set, label_map, dims[0] * dims[1], count)?;
    let mut values = vec![0i32; dims.iter().product()];
    let mut shared_voxels = 0u64;
    for (f, s) in slices.iter().enumerate() {
        let at = places.slice[f] * dims[0] * dims[1];
        for (p, value) in values[at..at + dims[0] * dims[1]].iter_mut().enumerate() {
            let label = pixels.label(f, p, s.segment);
            if label != 0 {
                shared_voxels += u64::from(*value != 0 && *value != label);
                *value = label.max(*value);
            }
        }
    }
    let mut warnings = Vec::new();
    if shared_voxels > 0 {
        warnings.push(format!(
            "{shared_voxels} voxels belong to several segments; the higher number was kept"
        ));
    }
    if pixels.most.is_some() {
        warnings.push("the segmentation is fractional; voxels count from half of the maximum on".to_owned());
    }
    let [x, y] = grid.steps;
    Ok(Parsed {
        format: SourceFormat::DicomSeg,
        content: Content::Volume(Volume {
            dims,
            values,
            steps: DMat3::from_cols(x, y, grid.normal * places.step),
            origin: places.origin,
        }),
        frame: Some(Stated {
            value: Frame::Lps,
            by: "the DICOM standard".into(),
        }),
        units: Some(Stated {
            value: Units::Mm,
            by: "the DICOM standard".into(),
        }),
        warnings,
        notes: names(set),
    })
}

fn names(set: &DataSet) -> Vec<String> {
    let name = |s: &DataSet| {
        Some(format!(
            "label {} is {}",
            s.short(SEGMENT_NUMBER)?,
            s.text(SEGMENT_LABEL)?
        ))
    };
    set.items(SEGMENTS).iter().filter_map(name).collect()
}

fn slice(shared: &DataSet, frame: &DataSet, grid: &Plane, label_map: bool) -> Option<Slice> {
    let own = plane(shared, frame).ok()?;
    let same = (0..2).all(|a| own.steps[a].distance(grid.steps[a]) <= 1e-4 * grid.steps[a].length());
    let position = frame.items(PLANE_POSITION).first()?.vector(POSITION)?;
    let identified = |set: &DataSet| {
        set.items(SEGMENT_IDENTIFICATION)
            .first()?
            .short(REFERENCED_SEGMENT)
    };
    let segment = if label_map {
        0
    } else {
        i32::from(identified(frame).or_else(|| identified(shared))?)
    };
    same.then_some(Slice {
        along: position.dot(grid.normal),
        position,
        segment,
    })
}

/// Where each frame goes along the normal.
struct Places {
    slices: usize,
    slice: Vec<usize>,
    step: f64,
    origin: DVec3,
}

impl Places {
    fn of(slices: &[Slice], grid: &Plane) -> Result<Self, Flaw> {
        let lowest = slices
            .iter()
            .min_by(|a, b| a.along.total_cmp(&b.along))
            .ok_or_else(|| missing("every frame"))?;
        let mut heights: Vec<f64> = slices.iter().map(|s| s.along - lowest.along).collect();
        heights.sort_by(f64::total_cmp);
        let near = 1e-3 * grid.steps[0].length();
        let gap = heights
            .windows(2)
            .map(|w| w[1] - w[0])
            .filter(|g| *g > near)
            .fold(f64::INFINITY, f64::min);
        let whole = |step: f64| {
            heights
                .iter()
                .all(|h| (h / step - (h / step).round()).abs() <= OFF_GRID)
        };
        // What the file states is believed when all frames fit it: empty slices may be left out everywhere.
        let step = match grid.stated {
            Some(stated) if whole(stated) => stated,
            _ if gap.is_finite() && whole(gap) => gap,
            _ => {
                return Err(Flaw::file(
                    Fault::Unsupported,
                    "the frames are not evenly spaced",
                    "resample the segmentation on a regular grid",
                ));
            }
        };
        let across = |s: &Slice| s.position - s.along * grid.normal;
        if slices
            .iter()
            .any(|s| across(s).distance(across(lowest)) > 0.05 * grid.steps[0].length())
        {
            return Err(Flaw::file(
                Fault::Unsupported,
                "the frames are shifted against each other",
                "resample the segmentation on a regular grid",
            ));
        }
        // Positions far apart are a damaged file, not a stack with empty slices.
        let span = heights.last().copied().unwrap_or(0.0) / step;
        if span > (1000 + 100 * slices.len()) as f64 {
            return Err(Flaw::file(
                Fault::Header,
                format!("{} frames span {span:.0} slices", slices.len()),
                "the positions are damaged: export the segmentation again",
            ));
        }
        let slice: Vec<usize> = slices
            .iter()
            .map(|s| ((s.along - lowest.along) / step).round() as usize)
            .collect();
        Ok(Self {
            slices: slice.iter().max().map_or(0, |m| m + 1),
            slice,
            step,
            origin: lowest.position,
        })
    }
}

/// The pixels of all frames.
struct Pixels<'a> {
    data: &'a [u8],
    bits: u16,
    frame: usize,
    label_map: bool,
    /// Largest fraction; `None` when not fractional.
    most: Option<u16>,
}

impl<'a> Pixels<'a> {
    fn of(set: &DataSet<'a>, label_map: bool, frame: usize, count: usize) -> Result<Self, Flaw> {
        let data = set.get(PIXELS).ok_or_else(|| missing("the pixel data"))?.bytes;
        let bits = set.short(BITS_ALLOCATED).unwrap_or(0);
        let fractional = set.text(SEGMENTATION_TYPE).as_deref() == Some("FRACTIONAL");
        if !matches!((bits, label_map), (1, false) | (8, _) | (16, true)) {
            return Err(Flaw::file(
                Fault::Unsupported,
                format!("a pixel has {bits} bits"),
                "give a segmentation of 1 or 8 bits, or a label map of 8 or 16",
            ));
        }
        let wanted = (frame as u128 * count as u128 * u128::from(bits)).div_ceil(8);
        if (data.len() as u128) < wanted {
            return Err(Flaw::truncated(
                Place::File,
                format!(
                    "{count} frames of {frame} pixels need {wanted} bytes, there are {}",
                    data.len()
                ),
            ));
        }
        Ok(Self {
            data,
            bits,
            frame,
            label_map,
            most: fractional.then(|| set.short(MOST_FRACTION).unwrap_or(255)),
        })
    }

    /// The label of a pixel; 0 for none.
    fn label(&self, frame: usize, pixel: usize, segment: i32) -> i32 {
        let n = frame * self.frame + pixel;
        let value = match self.bits {
            1 => u16::from(self.data[n / 8] >> (n % 8) & 1),
            8 => u16::from(self.data[n]),
            _ => u16::from_le_bytes([self.data[2 * n], self.data[2 * n + 1]]),
        };
        if self.label_map {
            return i32::from(value);
        }
        let set = self
            .most
            .map_or(value > 0, |most| 2 * u32::from(value) >= u32::from(most).max(1));
        if set { segment } else { 0 }
    }
}
