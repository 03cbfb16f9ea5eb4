//! Medit `.mesh` (text): vertices, triangles, quadrilaterals; other sections are skipped. Indices count from 1.

use crate::input::{
    error::{Fault, Flaw, quote},
    parsed::{Content, Parsed, SurfaceBuilder},
    scan::Scan,
    shape::SourceFormat,
};
use glam::DVec3;

/// Reads a Medit mesh.
pub(in crate::input) fn read(bytes: &[u8]) -> Result<Parsed, Flaw> {
    let mut scan = Scan::new(bytes);
    let mut surface = SurfaceBuilder::default();
    let mut complete = false;
    while let Some(word) = scan.token() {
        match word {
            b"MeshVersionFormatted" => {
                scan.integer("the version")?;
            }
            b"Dimension" => {
                let place = scan.here();
                let d = scan.integer("the dimension")?;
                if d != 3 {
                    return Err(Flaw::new(
                        place,
                        Fault::Unsupported,
                        format!("the mesh has dimension {d}"),
                        "only three-dimensional meshes are read",
                    ));
                }
            }
            b"Vertices" => {
                let n = scan.count("vertices", 8)?;
                for _ in 0..n {
                    let p = DVec3::new(scan.number("x")?, scan.number("y")?, scan.number("z")?);
                    scan.number("a reference")?;
                    surface.points.push(p);
                }
            }
            b"Triangles" => faces::<3>(&mut scan, &mut surface)?,
            b"Quadrilaterals" => faces::<4>(&mut scan, &mut surface)?,
            b"End" => {
                complete = true;
                break;
            }
            word if word[0].is_ascii_alphabetic() => {
                while scan.peek().is_some_and(|t| !t[0].is_ascii_alphabetic()) {
                    scan.token();
                }
            }
            word => {
                return Err(Flaw::new(
                    scan.here(),
                    Fault::Header,
                    format!("a section name should follow, found {}", quote(word)),
                    "the section before has more items than it says: export the file again",
                ));
            }
        }
    }
    let warnings = if complete {
        Vec::new()
    } else {
        vec!["the file has no `End` line; it may be cut short".to_owned()]
    };
    Ok(Parsed {
        format: SourceFormat::Medit,
        content: Content::Surface(surface),
        frame: None,
        units: None,
        warnings,
        notes: Vec::new(),
    })
}

fn faces<const N: usize>(scan: &mut Scan, surface: &mut SurfaceBuilder) -> Result<(), Flaw> {
    let n = scan.count("faces", 2 * N + 2)?;
    for _ in 0..n {
        let mut corners = [0; N];
        for c in &mut corners {
            *c = scan.integer("a face corner")?.saturating_sub(1);
        }
        let place = scan.here();
        scan.integer("a reference")?;
        surface.polygon(&corners, place)?;
    }
    Ok(())
}
