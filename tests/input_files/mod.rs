//! Small valid files of every format, written from one octahedron and one label map, so that reading them must give the same.

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{
    Compression,
    write::{GzEncoder, ZlibEncoder},
};
use std::{fmt::Write as _, io::Write as _};

/// A file by name and content.
pub struct File {
    pub name: &'static str,
    pub bytes: Vec<u8>,
    pub holds: Holds,
}

/// What reading a file must give.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Holds {
    Mesh,
    Cloud,
    Labels,
}

/// Corners of a lopsided octahedron; all values are exact in 32 bits and in short decimals.
pub const POINTS: [[f64; 3]; 6] = [
    [4.5, 0.25, 0.0],
    [-4.0, 0.0, 0.5],
    [0.0, 5.0, 0.0],
    [0.75, -5.5, 0.0],
    [0.0, 0.0, 6.25],
    [0.0, 0.125, -6.0],
];

/// Its faces, outward.
pub const FACES: [[u32; 3]; 8] = [
    [0, 2, 4],
    [2, 1, 4],
    [1, 3, 4],
    [3, 0, 4],
    [2, 0, 5],
    [1, 2, 5],
    [3, 1, 5],
    [0, 3, 5],
];

/// Sides of the label map.
pub const DIMS: [usize; 3] = [7, 6, 5];

/// Voxel sizes and the position of the first voxel, LPS mm.
pub const SPACING: [f64; 3] = [0.5, 0.75, 2.0];
pub const ORIGIN: [f64; 3] = [-10.0, 20.5, 3.25];

/// Labels: a box of 1 with a 7 in its middle.
pub fn labels() -> Vec<u8> {
    let mut out = Vec::new();
    for k in 0..DIMS[2] {
        for j in 0..DIMS[1] {
            for i in 0..DIMS[0] {
                let inner = |a: usize, n: usize| a > 0 && a + 1 < n;
                let inside = inner(i, DIMS[0]) && inner(j, DIMS[1]) && inner(k, DIMS[2]);
                out.push(if [i, j, k] == [3, 2, 2] {
                    7
                } else {
                    u8::from(inside)
                });
            }
        }
    }
    out
}

/// One file of every flavour of every format.
pub fn all() -> Vec<File> {
    let file = |name, bytes, holds| File { name, bytes, holds };
    let mesh = |name, bytes| file(name, bytes, Holds::Mesh);
    let cloud = |name, bytes| file(name, bytes, Holds::Cloud);
    let map = |name, bytes| file(name, bytes, Holds::Labels);
    vec![
        mesh("ascii.ply", ply("ascii", false)),
        mesh("little.ply", ply("binary_little_endian", false)),
        mesh("big.ply", ply("binary_big_endian", true)),
        mesh("ascii.stl", stl_ascii()),
        mesh("binary.stl", stl_binary()),
        mesh("plain.obj", obj()),
        mesh("plain.off", off("OFF\n6 8 12\n")),
        mesh("commented.off", off("OFF 6 8 0\n# a comment\n")),
        cloud("three.xyz", columns(" ", "")),
        cloud("comma.txt", columns(",", "# a comment\n")),
        cloud("counted.pts", columns(" ", "6\n")),
        cloud("normals.pwn", pwn()),
        cloud("table.csv", csv()),
        mesh("four_ascii.vtk", vtk(4, false)),
        mesh("four_binary.vtk", vtk(4, true)),
        mesh("five_ascii.vtk", vtk(5, false)),
        mesh("five_binary.vtk", vtk(5, true)),
        mesh("ascii.vtp", vtp(Xml::Ascii)),
        mesh("inline.vtp", vtp(Xml::Inline)),
        mesh("inline_zlib.vtp", vtp(Xml::InlineZlib)),
        mesh("raw.vtp", vtp(Xml::AppendedRaw)),
        mesh("appended_zlib.vtp", vtp(Xml::AppendedZlib)),
        mesh("plain.mesh", medit()),
        mesh("ascii.gii", gifti("ASCII")),
        mesh("base64.gii", gifti("Base64Binary")),
        mesh("gzip.gii", gifti("GZipBase64Binary")),
        mesh("packed.gii.gz", gzip(&gifti("ASCII"))),
        map("sform.nii", nifti(Nifti::Sform)),
        map("qform_big.nii", nifti(Nifti::QformBig)),
        map("two.nii", nifti(Nifti::Two)),
        map("packed.nii.gz", gzip(&nifti(Nifti::Sform))),
        map("raw.nrrd", nrrd("raw")),
        map("packed.nrrd", nrrd("gzip")),
        map("text.nrrd", nrrd("text")),
        map("raw.mha", mha("raw")),
        map("packed.mha", mha("zlib")),
        map("text.mha", mha("text")),
    ]
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = GzEncoder::new(Vec::new(), Compression::default());
    out.write_all(bytes).expect("in memory");
    out.finish().expect("in memory")
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut out = ZlibEncoder::new(Vec::new(), Compression::default());
    out.write_all(bytes).expect("in memory");
    out.finish().expect("in memory")
}

fn text(build: impl FnOnce(&mut String)) -> Vec<u8> {
    let mut out = String::new();
    build(&mut out);
    out.into_bytes()
}

fn row(p: &[f64; 3]) -> String {
    format!("{} {} {}", p[0], p[1], p[2])
}

fn ply(format: &str, doubles: bool) -> Vec<u8> {
    let real = if doubles { "double" } else { "float" };
    let mut out = format!(
        "ply\nformat {format} 1.0\ncomment SPACE=LPS\nelement vertex 6\nproperty {real} x\nproperty {real} y\nproperty {real} z\nproperty uchar quality\nelement face 8\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let big = format.contains("big");
    let ascii = format == "ascii";
    let put = |out: &mut Vec<u8>, little: &[u8]| {
        if big {
            out.extend(little.iter().rev());
        } else {
            out.extend(little);
        }
    };
    for p in &POINTS {
        if ascii {
            out.extend(format!("{} 9\n", row(p)).bytes());
            continue;
        }
        for x in p {
            if doubles {
                put(&mut out, &x.to_le_bytes());
            } else {
                put(&mut out, &(*x as f32).to_le_bytes());
            }
        }
        out.push(9);
    }
    for f in &FACES {
        if ascii {
            out.extend(format!("3 {} {} {}\n", f[0], f[1], f[2]).bytes());
            continue;
        }
        out.push(3);
        for i in f {
            put(&mut out, &i.to_le_bytes());
        }
    }
    out
}

fn stl_ascii() -> Vec<u8> {
    text(|out| {
        out.push_str("solid octahedron SPACE=LPS\n");
        for f in &FACES {
            out.push_str(" facet normal 0 0 0\n  outer loop\n");
            for &i in f {
                let _ = writeln!(out, "   vertex {}", row(&POINTS[i as usize]));
            }
            out.push_str("  endloop\n endfacet\n");
        }
        out.push_str("endsolid octahedron\n");
    })
}

fn stl_binary() -> Vec<u8> {
    let mut out = [b"solid but binary, SPACE=LPS".as_slice(), &[b' '; 53]].concat();
    out.extend(8u32.to_le_bytes());
    for f in &FACES {
        out.extend([0u8; 12]);
        for &i in f {
            for x in POINTS[i as usize] {
                out.extend((x as f32).to_le_bytes());
            }
        }
        out.extend([0u8; 2]);
    }
    out
}

fn obj() -> Vec<u8> {
    text(|out| {
        out.push_str("# SPACE=LPS\no octahedron\nmtllib none.mtl\n");
        for p in &POINTS {
            let _ = writeln!(out, "v {}", row(p));
        }
        out.push_str("vn 0 0 1\nvt 0 0\n");
        for (i, f) in FACES.iter().enumerate() {
            let _ = match i % 3 {
                0 => writeln!(out, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1),
                1 => writeln!(out, "f {}/1/1 {}//1 \\\n {}/1", f[0] + 1, f[1] + 1, f[2] + 1),
                _ => writeln!(
                    out,
                    "f {} {} {}",
                    f[0] as i32 - 6,
                    f[1] as i32 - 6,
                    f[2] as i32 - 6
                ),
            };
        }
    })
}

fn off(head: &str) -> Vec<u8> {
    text(|out| {
        out.push_str(head);
        for p in &POINTS {
            let _ = writeln!(out, "{}", row(p));
        }
        for f in &FACES {
            let _ = writeln!(out, "3 {} {} {} 255 0 0", f[0], f[1], f[2]);
        }
    })
}

fn columns(separator: &str, head: &str) -> Vec<u8> {
    text(|out| {
        out.push_str(head);
        for p in &POINTS {
            let _ = writeln!(out, "{}", row(p).replace(' ', separator));
        }
    })
}

fn pwn() -> Vec<u8> {
    let normals = "1 0 0\n".repeat(6);
    [columns(" ", "6\n"), normals.into_bytes()].concat()
}

fn csv() -> Vec<u8> {
    text(|out| {
        out.push_str("label,y,x,z\r\n");
        for p in &POINTS {
            let _ = write!(out, "\"a, b\",{},{},{}\r\n", p[1], p[0], p[2]);
        }
    })
}

fn big_floats() -> Vec<u8> {
    POINTS
        .iter()
        .flatten()
        .flat_map(|x| (*x as f32).to_be_bytes())
        .collect()
}

fn vtk(version: u32, binary: bool) -> Vec<u8> {
    let (number, kind) = (
        if version == 4 { "4.2" } else { "5.1" },
        if binary { "BINARY" } else { "ASCII" },
    );
    let mut out = format!(
        "# vtk DataFile Version {number}\nvtk output SPACE=LPS\n{kind}\nDATASET POLYDATA\nPOINTS 6 float\n"
    )
    .into_bytes();
    let line = |out: &mut Vec<u8>, text: String| out.extend(text.bytes());
    if binary {
        out.extend(big_floats());
        out.push(b'\n');
    } else {
        for p in &POINTS {
            line(&mut out, format!("{} \n", row(p)));
        }
    }
    if version == 4 {
        line(&mut out, "POLYGONS 8 32\n".into());
        for f in &FACES {
            if binary {
                out.extend([3u32, f[0], f[1], f[2]].iter().flat_map(|i| i.to_be_bytes()));
            } else {
                line(&mut out, format!("3 {} {} {}\n", f[0], f[1], f[2]));
            }
        }
    } else {
        line(
            &mut out,
            "METADATA\nINFORMATION 0\n\nPOLYGONS 9 24\nOFFSETS vtktypeint64\n".into(),
        );
        let offsets: Vec<i64> = (0..=8).map(|i| 3 * i).collect();
        let items: Vec<i64> = FACES.iter().flatten().map(|&i| i64::from(i)).collect();
        for (i, list) in [offsets, items].iter().enumerate() {
            if i == 1 {
                line(&mut out, "CONNECTIVITY vtktypeint64\n".into());
            }
            if binary {
                out.extend(list.iter().flat_map(|v| v.to_be_bytes()));
            } else {
                for v in list {
                    line(&mut out, format!("{v} "));
                }
            }
            out.push(b'\n');
        }
    }
    line(
        &mut out,
        "\nPOINT_DATA 6\nSCALARS radius float\nLOOKUP_TABLE default\n1 1 1 1 1 1\n".into(),
    );
    out
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Xml {
    Ascii,
    Inline,
    InlineZlib,
    AppendedRaw,
    AppendedZlib,
}

fn vtp(kind: Xml) -> Vec<u8> {
    let points: Vec<u8> = POINTS
        .iter()
        .flatten()
        .flat_map(|x| (*x as f32).to_le_bytes())
        .collect();
    let items: Vec<u8> = FACES
        .iter()
        .flatten()
        .flat_map(|&i| i64::from(i).to_le_bytes())
        .collect();
    let offsets: Vec<u8> = (1..=8i64).flat_map(|i| (3 * i).to_le_bytes()).collect();
    let mut appended: Vec<u8> = Vec::new();
    let mut array = |attributes: &str, bytes: &[u8], ascii: String| -> String {
        let (format, offset, inside) = match kind {
            Xml::Ascii => ("ascii", String::new(), ascii),
            Xml::Inline => {
                let whole = [&(bytes.len() as u64).to_le_bytes(), bytes].concat();
                ("binary", String::new(), STANDARD.encode(whole))
            }
            Xml::InlineZlib => ("binary", String::new(), compressed(bytes).concat()),
            Xml::AppendedRaw => {
                let at = appended.len();
                appended.extend((bytes.len() as u64).to_le_bytes());
                appended.extend(bytes);
                ("appended", format!(" offset=\"{at}\""), String::new())
            }
            Xml::AppendedZlib => {
                let at = appended.len();
                appended.extend(compressed(bytes).concat().bytes());
                ("appended", format!(" offset=\"{at}\""), String::new())
            }
        };
        format!("<DataArray {attributes} format=\"{format}\"{offset}>\n{inside}\n</DataArray>\n")
    };
    let ascii = |v: Vec<String>| v.join(" ");
    let p = array(
        "type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\"",
        &points,
        ascii(POINTS.iter().map(row).collect()),
    );
    let c = array(
        "type=\"Int64\" Name=\"connectivity\"",
        &items,
        ascii(FACES.iter().flatten().map(u32::to_string).collect()),
    );
    let o = array(
        "type=\"Int64\" Name=\"offsets\"",
        &offsets,
        ascii((1..=8).map(|i| (3 * i).to_string()).collect()),
    );
    let compressor = if matches!(kind, Xml::InlineZlib | Xml::AppendedZlib) {
        " compressor=\"vtkZLibDataCompressor\""
    } else {
        ""
    };
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{compressor}>\n<PolyData>\n<FieldData><DataArray type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">76 80 83 0</DataArray></FieldData>\n<Piece NumberOfPoints=\"6\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"8\">\n<PointData></PointData>\n<Points>{p}</Points>\n<Polys>{c}{o}</Polys>\n</Piece>\n</PolyData>\n"
    )
    .into_bytes();
    if !appended.is_empty() {
        let encoding = if kind == Xml::AppendedRaw { "raw" } else { "base64" };
        out.extend(format!("<AppendedData encoding=\"{encoding}\">\n _").bytes());
        out.extend(&appended);
        out.extend(b"\n</AppendedData>\n");
    }
    out.extend(b"</VTKFile>\n");
    out
}

/// Two blocks, as VTK writes them: sizes in one run of base64, data in the next.
fn compressed(bytes: &[u8]) -> [String; 2] {
    let full = bytes.len() / 2 + 1;
    let blocks: Vec<Vec<u8>> = bytes.chunks(full).map(zlib).collect();
    let last = bytes.len() - full;
    let mut head: Vec<u64> = vec![2, full as u64, last as u64];
    head.extend(blocks.iter().map(|b| b.len() as u64));
    let head: Vec<u8> = head.iter().flat_map(|v| v.to_le_bytes()).collect();
    [STANDARD.encode(head), STANDARD.encode(blocks.concat())]
}

fn medit() -> Vec<u8> {
    text(|out| {
        out.push_str("MeshVersionFormatted 2\nDimension\n3\n\nVertices\n6\n");
        for p in &POINTS {
            let _ = writeln!(out, "{} 0", row(p));
        }
        out.push_str("Edges\n1\n1 2 0\nTriangles\n8\n");
        for f in &FACES {
            let _ = writeln!(out, "{} {} {} 1", f[0] + 1, f[1] + 1, f[2] + 1);
        }
        out.push_str("End\n");
    })
}

fn gifti(encoding: &str) -> Vec<u8> {
    // GIFTI is RAS: x and y change sign on the way.
    let ras: Vec<f64> = POINTS.iter().flat_map(|p| [-p[0], -p[1], p[2]]).collect();
    let data = |bytes: Vec<u8>, ascii: String| match encoding {
        "ASCII" => ascii,
        "Base64Binary" => STANDARD.encode(bytes),
        _ => STANDARD.encode(zlib(&bytes)),
    };
    let points = data(
        ras.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect(),
        ras.iter().map(f64::to_string).collect::<Vec<_>>().join(" "),
    );
    let faces = data(
        FACES.iter().flatten().flat_map(|i| i.to_le_bytes()).collect(),
        FACES
            .iter()
            .flatten()
            .map(u32::to_string)
            .collect::<Vec<_>>()
            .join(" "),
    );
    let tag = |intent: &str, kind: &str, rows: usize| {
        format!(
            "<DataArray Intent=\"{intent}\" DataType=\"{kind}\" ArrayIndexingOrder=\"RowMajorOrder\" Dimensionality=\"2\" Dim0=\"{rows}\" Dim1=\"3\" Encoding=\"{encoding}\" Endian=\"LittleEndian\">\n"
        )
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE GIFTI SYSTEM \"http://gifti.projects.nitrc.org/gifti.dtd\">\n<GIFTI Version=\"1.0\" NumberOfDataArrays=\"2\">\n<MetaData><MD><Name><![CDATA[Date]]></Name><Value><![CDATA[today]]></Value></MD></MetaData>\n{}<CoordinateSystemTransformMatrix><DataSpace><![CDATA[NIFTI_XFORM_SCANNER_ANAT]]></DataSpace><MatrixData>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</MatrixData></CoordinateSystemTransformMatrix>\n<Data>{points}</Data>\n</DataArray>\n{}<Data>{faces}</Data>\n</DataArray>\n</GIFTI>\n",
        tag("NIFTI_INTENT_POINTSET", "NIFTI_TYPE_FLOAT32", 6),
        tag("NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32", 8)
    )
    .into_bytes()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Nifti {
    Sform,
    QformBig,
    Two,
}

/// Writes a field at an offset in either byte order.
fn put(header: &mut [u8], big: bool, at: usize, little: &[u8]) {
    let target = &mut header[at..at + little.len()];
    target.copy_from_slice(little);
    if big {
        target.reverse();
    }
}

fn nifti(kind: Nifti) -> Vec<u8> {
    // LPS to RAS: x and y of origin and axes change sign.
    let affine = [
        [-SPACING[0], 0.0, 0.0, -ORIGIN[0]],
        [0.0, -SPACING[1], 0.0, -ORIGIN[1]],
        [0.0, 0.0, SPACING[2], ORIGIN[2]],
    ];
    if kind == Nifti::Two {
        let mut h = vec![0u8; 544];
        put(&mut h, false, 0, &540i32.to_le_bytes());
        h[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
        put(&mut h, false, 12, &2i16.to_le_bytes());
        for (i, d) in [3i64, 7, 6, 5, 1, 1, 1, 1].iter().enumerate() {
            put(&mut h, false, 16 + 8 * i, &d.to_le_bytes());
        }
        put(&mut h, false, 168, &544i64.to_le_bytes());
        put(&mut h, false, 348, &1i32.to_le_bytes());
        for (r, row) in affine.iter().enumerate() {
            for (c, v) in row.iter().enumerate() {
                put(&mut h, false, 400 + 32 * r + 8 * c, &v.to_le_bytes());
            }
        }
        put(&mut h, false, 500, &2i32.to_le_bytes());
        return [h, labels()].concat();
    }
    let big = kind == Nifti::QformBig;
    let mut h = vec![0u8; 352];
    let float = |h: &mut [u8], at: usize, v: f64| put(h, big, at, &(v as f32).to_le_bytes());
    put(&mut h, big, 0, &348i32.to_le_bytes());
    for (i, d) in [3i16, 7, 6, 5, 1, 1, 1, 1].iter().enumerate() {
        put(&mut h, big, 40 + 2 * i, &d.to_le_bytes());
    }
    put(&mut h, big, 70, &4i16.to_le_bytes());
    put(&mut h, big, 72, &16i16.to_le_bytes());
    for (i, v) in [1.0, SPACING[0], SPACING[1], SPACING[2]].iter().enumerate() {
        float(&mut h, 76 + 4 * i, *v);
    }
    float(&mut h, 108, 352.0);
    h[123] = 2;
    h[344..348].copy_from_slice(b"n+1\0");
    if big {
        // Half a turn about z: quaternion (0, 0, 0, 1).
        put(&mut h, big, 252, &1i16.to_le_bytes());
        float(&mut h, 264, 1.0);
        for (i, v) in [-ORIGIN[0], -ORIGIN[1], ORIGIN[2]].iter().enumerate() {
            float(&mut h, 268 + 4 * i, *v);
        }
    } else {
        put(&mut h, big, 254, &1i16.to_le_bytes());
        for (r, row) in affine.iter().enumerate() {
            for (c, v) in row.iter().enumerate() {
                float(&mut h, 280 + 16 * r + 4 * c, *v);
            }
        }
    }
    for v in labels() {
        let v = i16::from(v);
        h.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
    }
    h
}

fn voxels(encoding: &str) -> Vec<u8> {
    match encoding {
        "text" => labels()
            .iter()
            .map(u8::to_string)
            .collect::<Vec<_>>()
            .join(" ")
            .into_bytes(),
        "gzip" => gzip(&labels()),
        "zlib" => zlib(&labels()),
        _ => labels(),
    }
}

fn nrrd(encoding: &str) -> Vec<u8> {
    let head = format!(
        "NRRD0005\n# a comment\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: 7 6 5\nspace directions: (0.5,0,0) (0,0.75,0) (0,0,2)\nkinds: domain domain domain\nendian: little\nencoding: {encoding}\nspace origin: (-10,20.5,3.25)\nkey:=value\n\n"
    );
    [head.into_bytes(), voxels(encoding)].concat()
}

fn mha(encoding: &str) -> Vec<u8> {
    let data = voxels(encoding);
    let head = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = {}\nBinaryDataByteOrderMSB = False\nCompressedData = {}\nCompressedDataSize = {}\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -10 20.5 3.25\nCenterOfRotation = 0 0 0\nAnatomicalOrientation = RAI\nElementSpacing = 0.5 0.75 2\nDimSize = 7 6 5\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
        if encoding == "text" { "False" } else { "True" },
        if encoding == "zlib" { "True" } else { "False" },
        data.len()
    );
    [head.into_bytes(), data].concat()
}
