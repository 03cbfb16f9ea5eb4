//! Reading a file into a [`Shape`].
//!
//! In: a path and what the user says of frame, units and label. Out: geometry in LPS mm with its provenance and warnings, or a
//! [`ReadError`] that names the file, the place, what was found and what to do.
//!
//! 1. The bytes are read and hashed; gzipped meshes are inflated within bounds.
//! 2. The format is what the content says; a name that says otherwise is an error, because one of the two is wrong.
//! 3. One reader a format ([`super::formats`]) gives the content in the file's own frame and units.
//! 4. Frame and units are settled (the user, else the file, else LPS and mm) and applied once, here.
//! 5. What no stage could use is refused: nothing finite, fewer than four distinct points, all in one plane, no such label.
//!
//! Nothing is repaired: points are not joined (but for STL, which has no points of its own), faces not turned.

use super::{
    decompress,
    error::{Fault, Flaw, Place, ReadError, quote},
    formats::{clouds, dicom_seg, gifti, medit, metaimage, nifti, nrrd, obj, off, ply, stl, vtk_legacy, vtp},
    parsed::{Content, Frame, Parsed, SurfaceBuilder, Units, Volume},
    shape::{Geometry, LabelMap, PointCloud, Provenance, Shape, SourceFormat},
};
use crate::geometry::{TriangleMesh, mesh::bounds};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::{borrow::Cow, path::Path};

/// What the user says of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ReadSettings {
    /// Unit of the file's coordinates; `None` takes what the file says, else mm.
    pub units: Option<Units>,
    /// Frame of the file's coordinates; `None` takes what the file says, else LPS (what ITK and 3D Slicer write).
    pub frame: Option<Frame>,
    /// The one label of a label map to keep; `None` keeps all.
    pub label: Option<i32>,
    /// Largest label map accepted, voxels. 2^28 is a whole-body CT of 512 x 512 x 1024; it takes 1 GB.
    pub max_voxels: u64,
}

impl Default for ReadSettings {
    fn default() -> Self {
        Self {
            units: None,
            frame: None,
            label: None,
            max_voxels: 1 << 28,
        }
    }
}

/// Coordinates beyond this, in mm, are no anatomy, and their squares lose the digits that geometry needs.
const LARGEST_MM: f64 = 1e9;

/// A cloud thinner than this share of its size is taken as flat. Coordinates stored in 32 bits are exact to 1e-7 of their
/// size; a real shape is thicker than that by far.
const FLAT: f64 = 1e-9;

/// Reads a shape from a file.
///
/// ```no_run
/// use medial_scaffold::input::{ReadSettings, Units, read_shape};
/// let settings = ReadSettings { units: Some(Units::M), ..Default::default() };
/// let bone = read_shape("capitate.stl".as_ref(), &settings)?;
/// # Ok::<(), medial_scaffold::input::ReadError>(())
/// ```
///
/// # Errors
/// See [`Fault`] for the kinds; every message names the place and a remedy.
pub fn read_shape(path: &Path, settings: &ReadSettings) -> Result<Shape, ReadError> {
    let bytes = std::fs::read(path).map_err(|e| {
        let remedy = match e.kind() {
            std::io::ErrorKind::NotFound => "check the name and the folder",
            std::io::ErrorKind::PermissionDenied => "check that you may read it",
            std::io::ErrorKind::IsADirectory => "give the path of one of its files",
            _ => "give the path of a file that can be read",
        };
        Flaw::file(Fault::Unreadable, format!("cannot be read ({e})"), remedy).in_file(path)
    })?;
    read_bytes(path, &bytes, settings)
}

/// Reads a shape from bytes already in memory; `path` gives the name, the extension, and the folder of detached data files.
///
/// # Errors
/// Those of [`read_shape`].
pub fn read_bytes(path: &Path, bytes: &[u8], settings: &ReadSettings) -> Result<Shape, ReadError> {
    parse(path, bytes, settings)
        .and_then(|parsed| settle(path, bytes, parsed, settings))
        .map_err(|flaw| flaw.in_file(path))
}

fn parse(path: &Path, bytes: &[u8], settings: &ReadSettings) -> Result<Parsed, Flaw> {
    if bytes.is_empty() {
        return Err(Flaw::file(
            Fault::Empty,
            "the file is empty",
            "export or copy it again",
        ));
    }
    let packed = decompress::is_gzip(bytes);
    let head: Cow<[u8]> = if packed {
        Cow::Owned(decompress::gzip_head(bytes, 4096))
    } else {
        Cow::Borrowed(bytes)
    };
    let (format, warning) = format_of(path, &head)?;
    // Volumes inflate themselves, within what their header promises.
    let content: Cow<[u8]> = if packed && format != SourceFormat::Nifti {
        Cow::Owned(decompress::gzip_text(bytes)?)
    } else {
        Cow::Borrowed(bytes)
    };
    let mut parsed = match format {
        SourceFormat::Ply => ply::read(&content),
        SourceFormat::Stl => stl::read(&content),
        SourceFormat::Obj => obj::read(&content),
        SourceFormat::Off => off::read(&content),
        SourceFormat::Csv => clouds::read_csv(&content),
        SourceFormat::Xyz | SourceFormat::Generated => clouds::read_columns(&content),
        SourceFormat::VtkLegacy => vtk_legacy::read(&content),
        SourceFormat::Vtp => vtp::read(&content),
        SourceFormat::Medit => medit::read(&content),
        SourceFormat::Gifti => gifti::read(&content),
        SourceFormat::Nifti => nifti::read(&content, settings.max_voxels),
        SourceFormat::Nrrd => nrrd::read(&content, path, settings.max_voxels),
        SourceFormat::MetaImage => metaimage::read(&content, path, settings.max_voxels),
        SourceFormat::DicomSeg => dicom_seg::read(&content, settings.max_voxels),
    }?;
    parsed.warnings.extend(warning);
    Ok(parsed)
}

/// The format, from the content and the name, and a warning when the name does not say it.
fn format_of(path: &Path, head: &[u8]) -> Result<(SourceFormat, Option<String>), Flaw> {
    let named = format_of_name(path);
    let found = format_of_content(head);
    match (named, found) {
        (Some(n), Some(f)) if n == f => Ok((f, None)),
        (Some(n), Some(f)) => Err(Flaw::file(
            Fault::WrongExtension,
            format!("the name says {}, the content is {}", title(n), title(f)),
            format!("rename it to .{}, or find the right file", extension(f)),
        )),
        (Some(n), None) if !has_signature(n) => Ok((n, None)),
        (Some(n), None) => Err(Flaw::file(
            Fault::WrongExtension,
            format!(
                "the name says {}, but the content begins with {}",
                title(n),
                quote(head)
            ),
            "the file is damaged or of another format: export it again",
        )),
        (None, Some(f)) => Ok((
            f,
            Some(format!(
                "the name does not say so, but the content is {}",
                title(f)
            )),
        )),
        (None, None) => Err(Flaw::file(
            Fault::UnknownFormat,
            format!("the format is not known; the content begins with {}", quote(head)),
            "give PLY, STL, OBJ, OFF, XYZ, CSV, VTK, VTP, GIFTI, Medit, NIfTI, NRRD, MetaImage or a DICOM segmentation",
        )),
    }
}

/// Formats that can be told from their first bytes.
fn has_signature(format: SourceFormat) -> bool {
    !matches!(
        format,
        SourceFormat::Stl
            | SourceFormat::Obj
            | SourceFormat::Xyz
            | SourceFormat::Csv
            | SourceFormat::Generated
    )
}

fn format_of_name(path: &Path) -> Option<SourceFormat> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    Some(match name.rsplit_once('.')?.1 {
        "ply" => SourceFormat::Ply,
        "stl" => SourceFormat::Stl,
        "obj" => SourceFormat::Obj,
        "off" => SourceFormat::Off,
        "xyz" | "txt" | "pts" | "pwn" | "asc" => SourceFormat::Xyz,
        "csv" | "tsv" => SourceFormat::Csv,
        "vtk" => SourceFormat::VtkLegacy,
        "vtp" => SourceFormat::Vtp,
        "mesh" => SourceFormat::Medit,
        "gii" => SourceFormat::Gifti,
        "nii" => SourceFormat::Nifti,
        "nrrd" | "nhdr" => SourceFormat::Nrrd,
        "mha" | "mhd" => SourceFormat::MetaImage,
        "dcm" => SourceFormat::DicomSeg,
        _ => return None,
    })
}

fn format_of_content(head: &[u8]) -> Option<SourceFormat> {
    let first_word = head.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    let begins_with = |text: &[u8]| {
        head[..head.len().min(4096)]
            .windows(text.len())
            .any(|w| w == text)
    };
    if dicom_seg::is_dicom(head) {
        Some(SourceFormat::DicomSeg)
    } else if first_word == b"ply" {
        Some(SourceFormat::Ply)
    } else if stl::is_binary(head) || first_word == b"solid" {
        Some(SourceFormat::Stl)
    } else if off::is_keyword(first_word) {
        Some(SourceFormat::Off)
    } else if head.starts_with(b"# vtk DataFile") {
        Some(SourceFormat::VtkLegacy)
    } else if head.starts_with(b"NRRD") {
        Some(SourceFormat::Nrrd)
    } else if nifti::is_nifti(head) {
        Some(SourceFormat::Nifti)
    } else if metaimage::is_metaimage(head) {
        Some(SourceFormat::MetaImage)
    } else if first_word.starts_with(b"MeshVersionFormatted") {
        Some(SourceFormat::Medit)
    } else if head.trim_ascii_start().starts_with(b"<") && begins_with(b"<VTKFile") {
        Some(SourceFormat::Vtp)
    } else if head.trim_ascii_start().starts_with(b"<") && begins_with(b"<GIFTI") {
        Some(SourceFormat::Gifti)
    } else {
        None
    }
}

fn title(format: SourceFormat) -> &'static str {
    match format {
        SourceFormat::Ply => "PLY",
        SourceFormat::Stl => "STL",
        SourceFormat::Obj => "OBJ",
        SourceFormat::Off => "OFF",
        SourceFormat::Xyz => "columns of points",
        SourceFormat::Csv => "CSV",
        SourceFormat::VtkLegacy => "legacy VTK",
        SourceFormat::Vtp => "VTK XML",
        SourceFormat::Medit => "Medit",
        SourceFormat::Gifti => "GIFTI",
        SourceFormat::Nifti => "NIfTI",
        SourceFormat::Nrrd => "NRRD",
        SourceFormat::MetaImage => "MetaImage",
        SourceFormat::DicomSeg => "DICOM",
        SourceFormat::Generated => "generated",
    }
}

fn extension(format: SourceFormat) -> &'static str {
    match format {
        SourceFormat::Ply => "ply",
        SourceFormat::Stl => "stl",
        SourceFormat::Obj => "obj",
        SourceFormat::Off => "off",
        SourceFormat::Xyz | SourceFormat::Generated => "xyz",
        SourceFormat::Csv => "csv",
        SourceFormat::VtkLegacy => "vtk",
        SourceFormat::Vtp => "vtp",
        SourceFormat::Medit => "mesh",
        SourceFormat::Gifti => "gii",
        SourceFormat::Nifti => "nii",
        SourceFormat::Nrrd => "nrrd",
        SourceFormat::MetaImage => "mha",
        SourceFormat::DicomSeg => "dcm",
    }
}

/// Frame and units, who said so, and the map to LPS mm.
struct Settled {
    to_lps_mm: DMat3,
    frame: String,
    units: String,
}

impl Settled {
    fn new(parsed: &Parsed, settings: &ReadSettings, warnings: &mut Vec<String>) -> Self {
        let (frame, frame_by) = match (settings.frame, &parsed.frame) {
            (Some(told), Some(stated)) if told != stated.value => {
                warnings.push(format!(
                    "the frame is {} by {}, but {told} was asked for and used",
                    stated.value, stated.by
                ));
                (told, "by request".to_owned())
            }
            (Some(told), _) => (told, "by request".to_owned()),
            (None, Some(stated)) => (stated.value, format!("by {}", stated.by)),
            (None, None) => (Frame::Lps, "assumed".to_owned()),
        };
        let (units, units_by) = match (settings.units, &parsed.units) {
            (Some(told), Some(stated)) if told != stated.value => {
                warnings.push(format!(
                    "the unit is {} by {}, but {told} was asked for and used",
                    stated.value, stated.by
                ));
                (told, "by request".to_owned())
            }
            (Some(told), _) => (told, "by request".to_owned()),
            (None, Some(stated)) => (stated.value, format!("by {}", stated.by)),
            (None, None) => (Units::Mm, "assumed".to_owned()),
        };
        Self {
            to_lps_mm: frame.to_lps() * units.to_mm(),
            frame: format!("{frame}, {frame_by}"),
            units: format!("{units}, {units_by}"),
        }
    }
}

fn settle(path: &Path, bytes: &[u8], parsed: Parsed, settings: &ReadSettings) -> Result<Shape, Flaw> {
    let mut warnings = parsed.warnings.clone();
    let settled = Settled::new(&parsed, settings, &mut warnings);
    let geometry = match parsed.content {
        Content::Surface(surface) => {
            if settings.label.is_some() {
                return Err(Flaw::file(
                    Fault::Label,
                    "a label was asked for, but the file holds a surface",
                    "leave the label out, or give a label map",
                ));
            }
            warnings.extend(surface.remarks());
            settle_surface(surface, &settled, &mut warnings)?
        }
        Content::Volume(volume) => {
            Geometry::Labels(settle_volume(volume, &settled, settings.label, &mut warnings)?)
        }
    };
    let digest = Sha256::digest(bytes);
    Ok(Shape {
        name: name_of(path),
        geometry,
        provenance: Provenance {
            path: path.to_path_buf(),
            format: parsed.format,
            sha256: digest.iter().map(|b| format!("{b:02x}")).collect(),
            frame: settled.frame,
            units: settled.units,
        },
        warnings,
        notes: parsed.notes,
    })
}

/// The file name without its extensions.
fn name_of(path: &Path) -> String {
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let lower = name.to_ascii_lowercase();
    let base = if lower.ends_with(".gz") {
        &name[..name.len() - 3]
    } else {
        &name
    };
    base.rsplit_once('.').map_or(base, |(stem, _)| stem).to_owned()
}

fn settle_surface(
    surface: SurfaceBuilder,
    settled: &Settled,
    warnings: &mut Vec<String>,
) -> Result<Geometry, Flaw> {
    if surface.points.len() >= u32::MAX as usize || surface.triangles.len() >= u32::MAX as usize {
        return Err(Flaw::file(
            Fault::TooLarge,
            "the file has more than 4 294 967 294 points or faces",
            "decimate it first",
        ));
    }
    let points: Vec<DVec3> = surface.points.iter().map(|&p| settled.to_lps_mm * p).collect();
    usable_points(&points)?;
    warn_of_size(&points, warnings);
    if !surface.triangles.is_empty() {
        return Ok(Geometry::Mesh(TriangleMesh {
            points,
            triangles: surface.triangles,
        }));
    }
    let normals: Vec<DVec3> = surface
        .normals
        .iter()
        .map(|&n| (settled.to_lps_mm * n).normalize_or_zero())
        .collect();
    let usable = normals.iter().all(|n| n.is_finite() && *n != DVec3::ZERO);
    if !usable {
        warnings.push("some normals are zero or not finite: all normals were left out".into());
    }
    Ok(Geometry::Cloud(PointCloud {
        points,
        normals: if usable { normals } else { Vec::new() },
    }))
}

/// Refuses points that no shape can be made of.
fn usable_points(points: &[DVec3]) -> Result<(), Flaw> {
    if points.is_empty() {
        return Err(Flaw::file(
            Fault::Empty,
            "the file holds no points",
            "export it again",
        ));
    }
    for (i, p) in points.iter().enumerate() {
        if !p.is_finite() || p.abs().max_element() > LARGEST_MM {
            return Err(Flaw::new(
                Place::Element {
                    kind: "point",
                    index: i as u64,
                },
                Fault::Number,
                format!("its coordinates are {:e}, {:e}, {:e} mm", p.x, p.y, p.z),
                format!(
                    "coordinates must stay within {LARGEST_MM:e} mm: check the units, or mend that point"
                ),
            ));
        }
    }
    let spread = Spread::of(points);
    let degenerate = |found: String| {
        Flaw::file(
            Fault::Degenerate,
            found,
            "a shape needs at least four points that do not lie in one plane: export it again or give another file",
        )
    };
    if points.len() < 4 {
        return Err(degenerate(format!("the file holds only {} points", points.len())));
    }
    match spread.rank() {
        0 => Err(degenerate(format!("all {} points are the same", points.len()))),
        1 => Err(degenerate(format!("all {} points lie on one line", points.len()))),
        2 => Err(degenerate(format!(
            "all {} points lie in one plane",
            points.len()
        ))),
        _ => Ok(()),
    }
}

/// How far points reach from a point, from a line and from a plane through some of them.
struct Spread {
    from_point: f64,
    from_line: f64,
    from_plane: f64,
}

impl Spread {
    /// Greedy: the farthest point from the first, from their line, from the plane of the three. `O(n)`.
    fn of(points: &[DVec3]) -> Self {
        let a = points[0];
        let farthest = |distance: &dyn Fn(DVec3) -> f64| {
            points.iter().fold((0.0, a), |(best, at), &p| {
                let d = distance(p);
                if d > best { (d, p) } else { (best, at) }
            })
        };
        let (from_point, b) = farthest(&|p| (p - a).length());
        let along = (b - a).normalize_or_zero();
        let (from_line, c) = farthest(&|p| (p - a).cross(along).length());
        let normal = along.cross(c - a).normalize_or_zero();
        let (from_plane, _) = farthest(&|p| (p - a).dot(normal).abs());
        Self {
            from_point,
            from_line,
            from_plane,
        }
    }

    /// Dimension of the space the points fill.
    fn rank(&self) -> usize {
        let least = FLAT * self.from_point;
        if self.from_point == 0.0 {
            0
        } else if self.from_line <= least {
            1
        } else if self.from_plane <= least {
            2
        } else {
            3
        }
    }
}

/// Anatomy is larger than 0.1 mm and smaller than 3 m; what is not has the wrong unit more often than not.
fn warn_of_size(points: &[DVec3], warnings: &mut Vec<String>) {
    let Some([lo, hi]) = bounds(points) else { return };
    let size = (hi - lo).max_element();
    if !(0.1..=3000.0).contains(&size) {
        warnings.push(format!(
            "its longest side is {size:.4} mm: is the unit right? (um, mm or m can be given)"
        ));
    }
}

fn settle_volume(
    volume: Volume,
    settled: &Settled,
    label: Option<i32>,
    warnings: &mut Vec<String>,
) -> Result<LabelMap, Flaw> {
    let steps = settled.to_lps_mm * volume.steps;
    let origin = settled.to_lps_mm * volume.origin;
    let spacing = DVec3::new(
        steps.x_axis.length(),
        steps.y_axis.length(),
        steps.z_axis.length(),
    );
    let direction = DMat3::from_cols(
        steps.x_axis / spacing.x,
        steps.y_axis / spacing.y,
        steps.z_axis / spacing.z,
    );
    let volume_mm3 = steps.determinant().abs();
    let sound = spacing.is_finite()
        && origin.is_finite()
        && origin.abs().max_element() <= LARGEST_MM
        && direction.determinant().abs() > 1e-3;
    if !(sound && spacing.min_element() > 0.0 && spacing.max_element() <= LARGEST_MM) {
        return Err(Flaw::file(
            Fault::Header,
            format!(
                "the voxels measure {} x {} x {} mm (volume {volume_mm3} mm^3)",
                spacing.x, spacing.y, spacing.z
            ),
            "the voxel sizes and directions in the header must be finite, positive and not in one plane: export the file again",
        ));
    }
    let [x, y, z] = [direction.x_axis, direction.y_axis, direction.z_axis];
    if x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs()) > 1e-4 {
        warnings.push("the voxel axes are not at right angles; the grid is used as it is".into());
    }
    let mut map = LabelMap {
        dims: volume.dims,
        values: volume.values,
        spacing_mm: spacing,
        origin,
        direction,
    };
    select_label(&mut map, label, warnings)?;
    Ok(map)
}

/// Label maps with more labels than this are images.
const MANY_LABELS: usize = 1000;

fn select_label(map: &mut LabelMap, label: Option<i32>, warnings: &mut Vec<String>) -> Result<(), Flaw> {
    let counts = map.label_counts();
    let listed = || {
        let names: Vec<String> = counts.iter().take(20).map(|c| c.label.to_string()).collect();
        format!(
            "{}{}",
            names.join(", "),
            if counts.len() > 20 { ", ..." } else { "" }
        )
    };
    if counts.is_empty() {
        return Err(Flaw::file(
            Fault::Label,
            "every voxel is 0, there is no label",
            "give the segmentation, or segment the image first",
        ));
    }
    if counts.len() > MANY_LABELS {
        warnings.push(format!(
            "the file holds {} different values; it looks like an image rather than a label map",
            counts.len()
        ));
    }
    let Some(wanted) = label else { return Ok(()) };
    if wanted == 0 || !counts.iter().any(|c| c.label == wanted) {
        return Err(Flaw::file(
            Fault::Label,
            format!("label {wanted} is not in the file"),
            format!("choose one of its labels: {}", listed()),
        ));
    }
    for v in &mut map.values {
        if *v != wanted {
            *v = 0;
        }
    }
    Ok(())
}
