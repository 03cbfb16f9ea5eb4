//! DICOM segmentations written by another program's library are read voxel for voxel, and damaged ones are refused.

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use glam::DVec3;
use medial_scaffold::input::{Geometry, LabelMap, ReadSettings, Shape, SourceFormat, read_bytes};

type Element = DataElement<InMemDicomObject>;

fn text(group: u16, element: u16, vr: VR, value: &str) -> Element {
    DataElement::new(Tag(group, element), vr, PrimitiveValue::from(value))
}

fn short(group: u16, element: u16, value: u16) -> Element {
    DataElement::new(Tag(group, element), VR::US, PrimitiveValue::from(value))
}

fn object(elements: Vec<Element>) -> InMemDicomObject {
    InMemDicomObject::from_element_iter(elements)
}

fn sequence(group: u16, element: u16, items: Vec<InMemDicomObject>) -> Element {
    DataElement::new(Tag(group, element), VR::SQ, DataSetSequence::from(items))
}

/// Columns, rows, slices.
const DIMS: [usize; 3] = [5, 3, 6];
/// Between columns, rows, slices, mm.
const SPACING: DVec3 = DVec3::new(0.5, 0.75, 2.5);
const ORIGIN: DVec3 = DVec3::new(-12.0, 30.5, 101.25);
/// Rows run to the back, columns to the head: a sagittal stack.
const AXES: [DVec3; 2] = [DVec3::Y, DVec3::Z];

/// The truth: two segments, slices 2 and 4 empty of both.
fn label(i: usize, j: usize, k: usize) -> i32 {
    match (k, (i + 2 * j + k) % 3) {
        (2 | 4, _) | (_, 0) => 0,
        (_, 1) => 1,
        _ => 3,
    }
}

/// The frames of both segments, back to front, without empty ones.
fn frames() -> Vec<(usize, i32)> {
    let all = [1, 3]
        .into_iter()
        .flat_map(|s| (0..DIMS[2]).rev().map(move |k| (k, s)));
    all.filter(|(k, s)| (0..15).any(|p| label(p % 5, p / 5, *k) == *s))
        .collect()
}

fn file(syntax: &str) -> Vec<u8> {
    let frames = frames();
    let mut bits = vec![0u8; (15 * frames.len()).div_ceil(16) * 2];
    for (f, (k, s)) in frames.iter().enumerate() {
        for p in (0..15).filter(|p| label(p % 5, p / 5, *k) == *s) {
            let n = 15 * f + p;
            bits[n / 8] |= 1 << (n % 8);
        }
    }
    let normal = AXES[0].cross(AXES[1]);
    let place = |(k, s): &(usize, i32)| {
        let p = ORIGIN + *k as f64 * SPACING.z * normal;
        object(vec![
            sequence(
                0x0020,
                0x9113,
                vec![object(vec![text(
                    0x0020,
                    0x0032,
                    VR::DS,
                    &format!("{}\\{}\\{}", p.x, p.y, p.z),
                )])],
            ),
            sequence(
                0x0062,
                0x000a,
                vec![object(vec![short(0x0062, 0x000b, *s as u16)])],
            ),
        ])
    };
    let shared = object(vec![
        sequence(
            0x0020,
            0x9116,
            vec![object(vec![text(0x0020, 0x0037, VR::DS, "0\\1\\0\\0\\0\\1")])],
        ),
        sequence(
            0x0028,
            0x9110,
            vec![object(vec![
                text(0x0018, 0x0050, VR::DS, "2.5"),
                text(0x0018, 0x0088, VR::DS, "2.5"),
                text(0x0028, 0x0030, VR::DS, "0.75\\0.5"),
            ])],
        ),
    ]);
    let segment = |number: u16, name: &str| {
        object(vec![
            short(0x0062, 0x0004, number),
            text(0x0062, 0x0005, VR::LO, name),
        ])
    };
    let set = object(vec![
        text(0x0008, 0x0016, VR::UI, "1.2.840.10008.5.1.4.1.1.66.4"),
        text(0x0008, 0x0018, VR::UI, "1.2.3.4"),
        text(0x0028, 0x0008, VR::IS, &frames.len().to_string()),
        short(0x0028, 0x0010, DIMS[1] as u16),
        short(0x0028, 0x0011, DIMS[0] as u16),
        short(0x0028, 0x0100, 1),
        text(0x0062, 0x0001, VR::CS, "BINARY"),
        sequence(0x0062, 0x0002, vec![segment(1, "Tumour"), segment(3, "Bone")]),
        sequence(0x5200, 0x9229, vec![shared]),
        sequence(0x5200, 0x9230, frames.iter().map(place).collect()),
        DataElement::new(Tag(0x7fe0, 0x0010), VR::OB, PrimitiveValue::U8(bits.into())),
    ]);
    let meta = FileMetaTableBuilder::new()
        .transfer_syntax(syntax)
        .media_storage_sop_class_uid("1.2.840.10008.5.1.4.1.1.66.4")
        .media_storage_sop_instance_uid("1.2.3.4");
    let mut bytes = Vec::new();
    set.with_meta(meta)
        .expect("a file's header")
        .write_all(&mut bytes)
        .expect("writes");
    bytes
}

fn read(bytes: &[u8]) -> Result<Shape, String> {
    read_bytes("seg.dcm".as_ref(), bytes, &ReadSettings::default()).map_err(|e| e.to_string())
}

fn labels(shape: &Shape) -> &LabelMap {
    match &shape.geometry {
        Geometry::Labels(map) => map,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_segmentation_is_read_voxel_for_voxel() {
    for syntax in ["1.2.840.10008.1.2.1", "1.2.840.10008.1.2"] {
        let shape = read(&file(syntax)).expect("a segmentation");
        assert_eq!(shape.provenance.format, SourceFormat::DicomSeg);
        assert!(
            shape.notes.iter().any(|n| n == "label 1 is Tumour"),
            "{:?}",
            shape.notes
        );
        let map = labels(&shape);
        assert_eq!(map.dims, DIMS);
        assert!((map.spacing_mm - SPACING).length() < 1e-12);
        for n in 0..map.values.len() {
            let [i, j, k] = [n % 5, n / 5 % 3, n / 15];
            assert_eq!(map.values[n], label(i, j, k), "{syntax}: {i} {j} {k}");
            let index = DVec3::new(i as f64, j as f64, k as f64);
            let normal = AXES[0].cross(AXES[1]);
            let s = SPACING * index;
            let truth = ORIGIN + s.x * AXES[0] + s.y * AXES[1] + s.z * normal;
            assert!(map.position(index).distance(truth) < 1e-9);
        }
    }
}

#[test]
fn the_same_labels_come_from_metaimage() {
    let mut bytes = "ObjectType = Image\nNDims = 3\nDimSize = 5 3 6\nElementSpacing = 0.5 0.75 2.5\nOffset = -12 30.5 101.25\n\
         TransformMatrix = 0 1 0 0 0 1 1 0 0\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
        .as_bytes()
        .to_vec();
    bytes.extend((0..90).map(|n| label(n % 5, n / 5 % 3, n / 15) as u8));
    let image = read_bytes("same.mha".as_ref(), &bytes, &ReadSettings::default()).expect("a label map");
    let seg = read(&file("1.2.840.10008.1.2.1")).expect("a segmentation");
    let (a, b) = (labels(&image), labels(&seg));
    assert_eq!((a.dims, &a.values), (b.dims, &b.values));
    for corner in [DVec3::ZERO, DVec3::new(4.0, 2.0, 5.0), DVec3::new(0.0, 2.0, 1.0)] {
        assert!(a.position(corner).distance(b.position(corner)) < 1e-9);
    }
}

#[test]
fn damaged_segmentations_are_refused_or_read_never_more() {
    let whole = file("1.2.840.10008.1.2.1");
    for cut in (0..whole.len()).step_by(7) {
        assert!(read(&whole[..cut]).is_err(), "cut at {cut}");
    }
    // Any byte changed: an error or a map, never a panic or a hang.
    for at in (128..whole.len()).step_by(3) {
        for value in [0, 0xff, whole[at] ^ 0x10] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            let _ = read(&bytes);
        }
    }
    let mut image = whole.clone();
    let class = b"1.2.840.10008.5.1.4.1.1.66.4";
    let places: Vec<usize> = (0..image.len() - class.len())
        .filter(|i| image[*i..].starts_with(class))
        .collect();
    for at in places {
        image[at + class.len() - 4..at + class.len()].copy_from_slice(b"2\0\0\0");
    }
    let error = read(&image).expect_err("not a segmentation");
    assert!(error.contains("not a segmentation"), "{error}");
}
