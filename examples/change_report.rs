//! Two dates of a made lesion, their change, and the page that tells it.
//!
//! `cargo run --release --example change_report -- OUT`: writes `change.json`, `scene.glb`, `growth_1.ply` and `report.html` to OUT.

use glam::{DMat3, DVec3};
use medial_scaffold::change::{ChangeSettings, change};
use medial_scaffold::input::shape::{Geometry, LabelMap, Provenance, Shape, SourceFormat};
use medial_scaffold::reports::{
    change_report, change_scene, glb_bytes, write_bytes, write_growth, write_json,
};
use std::path::PathBuf;

/// A mask on a 0.8 x 0.8 x 1.6 mm grid.
fn mask(name: &str, shift: f64, label: impl Fn(DVec3) -> i32) -> Shape {
    let (dims, spacing_mm) = ([90, 70, 34], DVec3::new(0.8, 0.8, 1.6));
    let origin = DVec3::new(-30.0, -28.0, -26.0) + shift;
    let values = (0..dims[0] * dims[1] * dims[2])
        .map(|v| {
            let index = DVec3::new(
                (v % dims[0]) as f64,
                (v / dims[0] % dims[1]) as f64,
                (v / dims[0] / dims[1]) as f64,
            );
            label(origin + spacing_mm * index)
        })
        .collect();
    Shape {
        name: name.to_owned(),
        geometry: Geometry::Labels(LabelMap {
            dims,
            values,
            spacing_mm,
            origin,
            direction: DMat3::IDENTITY,
        }),
        provenance: Provenance {
            path: PathBuf::from(name),
            format: SourceFormat::Generated,
            sha256: String::new(),
            frame: "lps".to_owned(),
            units: "mm".to_owned(),
        },
        warnings: Vec::new(),
        notes: Vec::new(),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = PathBuf::from(std::env::args().nth(1).ok_or("usage: change_report OUT")?);
    std::fs::create_dir_all(&out)?;
    // Lesion 1 grows a lobe to the left; lesion 2 shrinks; lesion 3 is new.
    let egg = |p: DVec3| (p / DVec3::new(13.0, 10.0, 14.0)).length() <= 1.0;
    let second = |p: DVec3, r: f64| p.distance(DVec3::new(30.0, 4.0, 2.0)) <= r;
    let baseline = mask("baseline", 0.0, |p| {
        if egg(p) { 1 } else { 2 * i32::from(second(p, 6.5)) }
    });
    let followup = mask("follow-up", 0.37, |p| {
        let lobe = p.distance(DVec3::new(9.0, -8.0, 5.0)) <= 8.0;
        match (
            egg(p) || lobe,
            second(p, 5.0),
            p.distance(DVec3::new(-22.0, 12.0, -12.0)) <= 4.0,
        ) {
            (true, _, _) => 1,
            (_, true, _) => 2,
            (_, _, true) => 3,
            _ => 0,
        }
    });
    let result = change(&baseline, &followup, &ChangeSettings::default())?;
    let scene = change_scene(&result);
    for lesion in &result.lesions {
        write_growth(&out.join(format!("growth_{}.ply", lesion.label)), lesion)?;
    }
    write_bytes(&out.join("scene.glb"), glb_bytes(&scene))?;
    write_json(&out.join("change.json"), &result)?;
    let json = serde_json::to_value(&result)?;
    let run = serde_json::json!({"settings": ChangeSettings::default()});
    let report = change_report("A made lesion at two dates", &json, &run, scene)?;
    write_bytes(&out.join("report.html"), report.html()?)?;
    println!("{}", out.join("report.html").display());
    Ok(())
}
