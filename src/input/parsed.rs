//! What a format reader hands back, before frame and units are settled, and the builder all mesh readers share.

use super::{
    error::{Fault, Flaw, Place},
    shape::SourceFormat,
};
use glam::{DMat3, DVec3};

/// Frames a file can be in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// Left, posterior, superior: ITK, DICOM, Slicer's files. The frame inside.
    Lps,
    /// Right, anterior, superior: NIfTI, GIFTI, FreeSurfer.
    Ras,
}

impl Frame {
    /// The matrix that takes coordinates of this frame to LPS.
    pub fn to_lps(self) -> DMat3 {
        match self {
            Frame::Lps => DMat3::IDENTITY,
            Frame::Ras => DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)),
        }
    }
}

impl std::fmt::Display for Frame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Frame::Lps => "lps",
            Frame::Ras => "ras",
        })
    }
}

/// Units a file can be in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Micrometres.
    Um,
    /// Millimetres, the unit inside.
    Mm,
    /// Metres.
    M,
}

impl Units {
    /// Millimetres in one unit.
    pub fn to_mm(self) -> f64 {
        match self {
            Units::Um => 1e-3,
            Units::Mm => 1.0,
            Units::M => 1e3,
        }
    }
}

impl std::fmt::Display for Units {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Units::Um => "um",
            Units::Mm => "mm",
            Units::M => "m",
        })
    }
}

/// A value the file itself states, and where it says so.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stated<T> {
    pub(crate) value: T,
    /// "its SPACE comment", "the NIfTI header".
    pub(crate) by: String,
}

/// A file's content in its own frame and units.
#[derive(Debug)]
pub(crate) struct Parsed {
    pub(crate) format: SourceFormat,
    pub(crate) content: Content,
    pub(crate) frame: Option<Stated<Frame>>,
    pub(crate) units: Option<Stated<Units>>,
    pub(crate) warnings: Vec<String>,
    /// What is worth knowing, but nothing to worry about.
    pub(crate) notes: Vec<String>,
}

/// The three kinds of content.
#[derive(Debug)]
pub(crate) enum Content {
    Surface(SurfaceBuilder),
    Volume(Volume),
}

/// A label volume in the file's own frame and units.
#[derive(Debug)]
pub(crate) struct Volume {
    pub(crate) dims: [usize; 3],
    pub(crate) values: Vec<i32>,
    /// Steps from one voxel to the next along i, j, k as columns.
    pub(crate) steps: DMat3,
    pub(crate) origin: DVec3,
}

/// Points, normals and triangles as a mesh reader meets them.
#[derive(Debug, Default)]
pub(crate) struct SurfaceBuilder {
    pub(crate) points: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Polygons of more than three corners, cut into fans.
    pub(crate) fans: usize,
    /// Faces of fewer than three corners, dropped because they have no area.
    pub(crate) slivers: usize,
    /// Lines and vertices that are not part of a surface.
    pub(crate) ignored_lines: usize,
}

impl SurfaceBuilder {
    /// Adds a polygon by point index, cut into a fan from its first corner.
    pub(crate) fn polygon(&mut self, corners: &[i64], place: Place) -> Result<(), Flaw> {
        let n = self.points.len();
        if let Some(bad) = corners.iter().find(|&&c| c < 0 || c as u64 >= n as u64) {
            return Err(Flaw::new(
                place,
                Fault::Index,
                format!(
                    "a face refers to point {bad}, but there are {n} points (0 to {})",
                    n.saturating_sub(1)
                ),
                "the file is damaged or its points are missing: export it again",
            ));
        }
        if corners.len() < 3 {
            self.slivers += 1;
            return Ok(());
        }
        self.fans += usize::from(corners.len() > 3);
        for pair in corners[1..].windows(2) {
            self.triangles
                .push([corners[0] as u32, pair[0] as u32, pair[1] as u32]);
        }
        Ok(())
    }

    /// Adds a triangle strip, every second triangle turned so that all face one way.
    pub(crate) fn strip(&mut self, corners: &[i64], place: Place) -> Result<(), Flaw> {
        for (i, t) in corners.windows(3).enumerate() {
            let t = if i % 2 == 0 {
                [t[0], t[1], t[2]]
            } else {
                [t[1], t[0], t[2]]
            };
            self.polygon(&t, place)?;
        }
        Ok(())
    }

    /// What was cut, dropped or ignored, in plain words.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let mut out = Vec::new();
        if self.fans > 0 {
            out.push(format!(
                "{} polygons with more than three corners were cut into triangles",
                self.fans
            ));
        }
        if self.slivers > 0 {
            out.push(format!(
                "{} faces with fewer than three corners were ignored",
                self.slivers
            ));
        }
        if self.ignored_lines > 0 {
            out.push(format!(
                "{} lines or single vertices are not part of a surface; their points were kept",
                self.ignored_lines
            ));
        }
        out
    }
}

/// The frame stated as `SPACE=LPS` or `SPACE=RAS` in a comment, a title or a header (the convention of 3D Slicer).
pub(crate) fn space_comment(text: &[u8]) -> Option<Stated<Frame>> {
    let upper = text.to_ascii_uppercase();
    let at = upper.windows(6).position(|w| w == b"SPACE=")?;
    let frame = match upper.get(at + 6..at + 9)? {
        b"LPS" => Frame::Lps,
        b"RAS" => Frame::Ras,
        _ => return None,
    };
    Some(Stated {
        value: frame,
        by: "its SPACE comment".into(),
    })
}
