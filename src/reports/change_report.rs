//! The page of a change over time: each lesion before and after, its change with interval, and where it grew.
//!
//! In: `change.json`, `run.json` and a scene with surfaces of the shapes `baseline` and `followup` (the baseline carrying its
//! growth as a signed quantity). Out: a [`Report`].

use super::atomic::WriteError;
use super::colour;
use super::facts::{at, cell, items, number, run_section, shown, signed_cell};
use super::mesh_files::{PlyEncoding, VertexField, write_ply};
use super::page::{Cell, KeyFigure, NoteLevel, Plot, Report, ReportError, Section, Table};
use super::plot::{IntervalRow, interval_plot, pretty, signed};
use super::scene::{Layer, LayerKind, Quantity, Scene};
use super::still::View;
use crate::change::{Change, LesionChange};
use glam::DVec3;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The scene of a change: baseline surfaces coloured by their displacement, follow-up surfaces by their distance from the baseline, on
/// one scale, the follow-up to be switched on; new and vanished lesions plain.
pub fn change_scene(change: &Change) -> Scene {
    let mut scene = Scene::default();
    let all: Vec<f32> = change
        .lesions
        .iter()
        .flat_map(|l| l.growth_map.displacement_mm.iter().chain(&l.followup_distance_mm))
        .map(|h| *h as f32)
        .collect();
    let range = Quantity::signed("growth", "mm", all).range;
    let mut add = |what: &str, label: i32, shape: &str, mesh, colour, quantity, visible| {
        let mut properties = Map::new();
        properties.insert("label".to_owned(), json!(label));
        scene.layers.push(Layer {
            name: format!("{what} {label}"),
            kind: LayerKind::Surface,
            shape: shape.to_owned(),
            mesh,
            colour,
            quantity,
            properties,
            visible,
        });
    };
    for l in &change.lesions {
        let values = l.growth_map.displacement_mm.iter().map(|h| *h as f32).collect();
        let mut growth = Quantity::signed("growth", "mm", values);
        growth.range = range;
        let mesh = l.growth_map.mesh.clone();
        add(
            "baseline",
            l.label,
            "baseline",
            mesh,
            colour::BONE,
            Some(growth),
            true,
        );
        let values = l.followup_distance_mm.iter().map(|h| *h as f32).collect();
        let mut distance = Quantity::signed("growth", "mm", values);
        distance.range = range;
        let mesh = l.followup_surface.clone();
        add(
            "follow-up",
            l.label,
            "followup",
            mesh,
            colour::SECOND,
            Some(distance),
            false,
        );
    }
    for l in &change.vanished {
        add(
            "vanished",
            l.label,
            "baseline",
            l.surface.clone(),
            colour::BONE,
            None,
            true,
        );
    }
    for l in &change.new {
        add(
            "new",
            l.label,
            "followup",
            l.surface.clone(),
            colour::SECOND,
            None,
            false,
        );
    }
    let hidden = !change.lesions.is_empty();
    for (n, l) in change
        .segmentations
        .iter()
        .flat_map(|s| s.lesions.iter().enumerate())
    {
        let colour = colour::component_colour(n);
        let shape = l.segmentation.as_str();
        add(shape, l.label, shape, l.surface.clone(), colour, None, !hidden);
    }
    scene
}

/// The usual view, from the side where the surfaces moved most.
fn toward_growth(scene: &Scene) -> View {
    let mut view = View::broadside(scene);
    let mut moved = DVec3::ZERO;
    for layer in &scene.layers {
        let Some(q) = &layer.quantity else { continue };
        for (normal, h) in layer.mesh.vertex_normals().iter().zip(&q.values) {
            moved += f64::from(h * h) * *normal;
        }
    }
    if moved.dot(view.toward_camera) < 0.0 {
        view.toward_camera = -view.toward_camera;
    }
    view
}

/// Writes a lesion's growth map (`growth_<label>.ply`): baseline surface with `growth` a vertex, mm, outward positive.
///
/// # Errors
/// When the file cannot be written.
pub fn write_growth(path: &Path, lesion: &LesionChange) -> Result<(), WriteError> {
    let map = &lesion.growth_map;
    let growth = VertexField::real("growth", map.displacement_mm.clone());
    write_ply(path, &map.mesh, &[growth], PlyEncoding::Binary)
}

/// The report of a change.
///
/// # Errors
/// When `change.json` has no list of lesions.
pub fn change_report(title: &str, change: &Value, run: &Value, scene: Scene) -> Result<Report, ReportError> {
    if !at(change, "lesions").is_some_and(Value::is_array) {
        return Err(ReportError::Missing {
            field: "lesions".to_owned(),
        });
    }
    let mut report = Report {
        kind: "Change over time".to_owned(),
        title: title.to_owned(),
        subtitle: subtitle(change),
        surface_colours: scene
            .layers
            .iter()
            .find_map(|l| l.quantity.as_ref().map(|q| q.name.clone())),
        view: Some(toward_growth(&scene)),
        scene,
        result: change.clone(),
        run: run.clone(),
        ..Report::default()
    };
    figures(&mut report, change);
    if !items(change, "lesions").is_empty() {
        report.note(
        NoteLevel::Info,
        "Response categories are research calculations from one pair of segmentations; they do not replace a reading by the criteria's own rules.",
    );
    }
    for w in items(run, "warnings")
        .iter()
        .chain(items(change, "warnings"))
        .filter_map(Value::as_str)
    {
        report.note(NoteLevel::Warning, w);
    }
    if !items(change, "lesions").is_empty() {
        report.section(changes(change));
    }
    report.section(segmentations(change));
    report.section(alignment(change));
    report.section(measures(change));
    report.section(agreement(change));
    report.section(responses(change));
    report.section(growth(change));
    report.section(unpaired(change));
    report.section(run_section(run));
    Ok(report)
}

/// The heading of the page: both dates by their names.
pub fn title(change: &Value) -> String {
    let text = |key: &str| at(change, key).and_then(Value::as_str).filter(|t| !t.is_empty());
    match (text("baseline_name"), text("followup_name")) {
        (Some(before), Some(after)) => format!("{before} \u{2192} {after}"),
        _ => "Segmentations compared".to_owned(),
    }
}

/// Which lesions were found; the segmentations, when it is about one date only.
fn subtitle(change: &Value) -> String {
    let count = |key: &str| items(change, key).len();
    if count("lesions") + count("new") + count("vanished") == 0 && at(change, "segmentations").is_some() {
        return "Segmentations of one date against each other".to_owned();
    }
    let lesions = if count("lesions") == 1 {
        "lesion"
    } else {
        "lesions"
    };
    format!(
        "{} {lesions} at both dates, {} new, {} vanished",
        count("lesions"),
        count("new"),
        count("vanished")
    )
}

fn name(lesion: &Value) -> String {
    match at(lesion, "name").and_then(Value::as_str) {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("lesion {}", shown(lesion, "label")),
    }
}

fn interval(value: &Value, path: &str) -> Option<[f64; 2]> {
    Some([
        number(value, &format!("{path}.0"))?,
        number(value, &format!("{path}.1"))?,
    ])
}

fn figures(report: &mut Report, change: &Value) {
    for (label, field) in [
        ("Total volume, baseline", "baseline"),
        ("Total volume, follow-up", "followup"),
    ] {
        if number(change, &format!("totals.{field}_mm3")).is_some_and(|v| v > 0.0) {
            let value = shown(change, &format!("totals.{field}_mm3"));
            report.figures.push(KeyFigure::new(label, value, "mm\u{b3}"));
        }
    }
    if let Some(percent) = number(change, "totals.percent") {
        let note = interval(change, "totals.ci95_percent")
            .map(|[lo, hi]| format!("95 %: {} to {} %", signed(lo), signed(hi)))
            .unwrap_or_default();
        report
            .figures
            .push(KeyFigure::new("Change", signed(percent), "%").note(note));
    }
    if items(change, "lesions").is_empty() {
        return;
    }
    let significant = items(change, "lesions")
        .iter()
        .filter(|l| at(l, "change.significant").and_then(Value::as_bool) == Some(true))
        .count();
    report.figures.push(
        KeyFigure::new("Beyond the measurement error", significant.to_string(), "")
            .note(format!("of {} lesions", items(change, "lesions").len())),
    );
}

fn changes(change: &Value) -> Section {
    let mut section = Section::new("Volume change");
    section.paragraphs.push(
        "A change counts only when its 95 % interval does not contain zero. The interval follows from voxel size and the \
         uncertainty of the boundary (or from repeated segmentations, when given)."
            .to_owned(),
    );
    let mut rows = Vec::new();
    let mut table = Table::new(
        "",
        &[
            ":lesion",
            "baseline [mm\u{b3}]",
            "follow-up [mm\u{b3}]",
            "change [mm\u{b3}]",
            "change [%]",
            "95 % interval from [%]",
            "to [%]",
            ":beyond error",
        ],
    );
    for l in items(change, "lesions") {
        let ends = interval(l, "change.ci95_percent");
        table.row([
            name(l).into(),
            cell(l, "baseline.volume_best"),
            cell(l, "followup.volume_best"),
            signed_cell(l, "change.volume_mm3"),
            signed_cell(l, "change.percent"),
            signed_cell(l, "change.ci95_percent.0"),
            signed_cell(l, "change.ci95_percent.1"),
            cell(l, "change.significant"),
        ]);
        if let (Some(value), Some(interval)) = (number(l, "change.percent"), ends) {
            rows.push(IntervalRow {
                label: name(l),
                value,
                interval,
                significant: at(l, "change.significant").and_then(Value::as_bool) == Some(true),
            });
        }
    }
    if !rows.is_empty() {
        section.plots.push(Plot {
            svg: interval_plot("Volume change with 95 % interval", "%", &rows),
            caption: "Red: grown, blue: shrunk, grey: within the error.".to_owned(),
        });
    }
    if !table.rows.is_empty() {
        section.tables.push(table);
    }
    section
}

/// Fields of a lesion at one date, with names and units.
const MEASURES: [(&str, &str, &str); 16] = [
    ("volume_mesh", "volume, marching cubes at 0.5", "mm\u{b3}"),
    ("volume_voxel", "volume, voxel count", "mm\u{b3}"),
    ("volume_scaffold", "volume, scaffold's surface", "mm\u{b3}"),
    ("area", "surface area, marching cubes", "mm\u{b2}"),
    ("area_smooth", "surface area, smoothed surface", "mm\u{b2}"),
    ("sphericity", "sphericity", ""),
    ("diameter_3d", "largest 3D diameter", "mm"),
    ("diameter_axial", "longest axial diameter", "mm"),
    ("diameter_perpendicular", "perpendicular to it", "mm"),
    ("axis_major", "major axis", "mm"),
    ("axis_minor", "minor axis", "mm"),
    ("axis_least", "least axis", "mm"),
    ("elongation", "elongation", ""),
    ("flatness", "flatness", ""),
    ("thickness.mean", "mean thickness over the sheets", "mm"),
    ("thickness.max", "largest thickness", "mm"),
];

fn measures(change: &Value) -> Section {
    let mut section = Section::new("Each lesion, both dates");
    for l in items(change, "lesions") {
        let mut table = Table::new(
            &name(l),
            &[":quantity", "baseline", "follow-up", "change [%]", ":unit"],
        );
        for (field, word, unit) in MEASURES {
            let (a, b) = (
                number(l, &format!("baseline.{field}")),
                number(l, &format!("followup.{field}")),
            );
            if a.is_none() && b.is_none() {
                continue;
            }
            let cell = |x: Option<f64>| x.map_or_else(Cell::missing, Cell::number);
            let percent = signed_cell(l, &format!("measures_change_percent.{field}"));
            table.row([word.into(), cell(a), cell(b), percent, unit.into()]);
        }
        section.tables.push(table);
    }
    section
}

fn agreement(change: &Value) -> Section {
    let mut section = Section::new("Overlap and surface distances");
    section.paragraphs.push(
        "Mesh convention: area-weighted point-to-surface distances between the surfaces. Voxel convention: distances between \
         border voxels, as in common segmentation challenges. The two differ by up to a voxel and are named."
            .to_owned(),
    );
    let mut table = Table::new(
        "",
        &[
            ":lesion",
            ":convention",
            "Dice",
            "Hausdorff [mm]",
            "HD95 [mm]",
            "mean [mm]",
            "surface Dice",
            "at tolerance [mm]",
        ],
    );
    for l in items(change, "lesions") {
        for convention in ["mesh", "voxel"] {
            let Some(a) = at(l, &format!("agreement.{convention}")) else {
                continue;
            };
            table.row([
                name(l).into(),
                convention.into(),
                cell(l, "agreement.dice"),
                cell(a, "hausdorff"),
                cell(a, "hd95"),
                cell(a, "assd"),
                cell(a, "surface_dice"),
                cell(l, "agreement.tolerance_mm"),
            ]);
        }
    }
    if table.rows.is_empty() {
        return Section::default();
    }
    section.tables.push(table);
    section
}

fn responses(change: &Value) -> Section {
    let mut section = Section::new("Response categories");
    let mut table = Table::new(
        "Each by its own published thresholds",
        &[
            ":lesion",
            ":RECIST 1.1 (diameter)",
            ":RANO (product of diameters)",
            ":volumetric (RANO 2.0)",
        ],
    );
    for l in items(change, "lesions") {
        let word = |criterion: &str| {
            let at = |field: &str| format!("response.{criterion}.{field}");
            let percent =
                number(l, &at("percent")).map_or_else(String::new, |p| format!(" ({} %)", signed(p)));
            let small = super::facts::at(l, &at("measurable")).and_then(Value::as_bool) == Some(false);
            let remark = if small { ", too small to be measurable" } else { "" };
            format!("{}{percent}{remark}", shown(l, &at("category")))
        };
        table.row([name(l), word("recist"), word("rano"), word("volumetric")]);
    }
    if let Some(r) = at(change, "totals.response") {
        table.row([
            "all lesions".to_owned(),
            shown(r, "recist.category"),
            shown(r, "rano.category"),
            shown(r, "volumetric.category"),
        ]);
    }
    if !table.rows.is_empty() {
        section.tables.push(table);
    }
    section
}

fn growth(change: &Value) -> Section {
    let mut section = Section::new("Where it changed");
    section.paragraphs.push(
        "Signed distance from the baseline surface to the follow-up surface, outward positive; the picture above shows it on \
         the baseline, and on the follow-up each point's distance from the baseline's surface. The residual compares the volume that these distances imply with the change measured directly."
            .to_owned(),
    );
    let mut table = Table::new(
        "",
        &[
            ":lesion",
            "most outward [mm]",
            "most inward [mm]",
            "mean [mm]",
            "identity residual [%]",
        ],
    );
    let mut parts = Table::new(
        "Part by part",
        &[
            ":lesion",
            ":part",
            "change [mm\u{b3}]",
            "share of what moved [%]",
            "area [mm\u{b2}]",
            "mean displacement [mm]",
            "change of mean radius [mm]",
        ],
    );
    for l in items(change, "lesions") {
        table.row([
            name(l).into(),
            cell(l, "growth.max_outward"),
            cell(l, "growth.max_inward"),
            signed_cell(l, "growth.mean"),
            signed_cell(l, "growth.identity_residual_percent"),
        ]);
        for p in items(l, "parts") {
            parts.row([
                name(l).into(),
                cell(p, "name"),
                signed_cell(p, "change_mm3"),
                cell(p, "share_percent"),
                cell(p, "area_mm2"),
                signed_cell(p, "mean_displacement_mm"),
                signed_cell(p, "radius_change_mm"),
            ]);
        }
    }
    if table.rows.is_empty() {
        return Section::default();
    }
    section.tables.push(table);
    if !parts.rows.is_empty() {
        section.tables.push(parts);
    }
    section
}

fn unpaired(change: &Value) -> Section {
    let mut section = Section::new("New, vanished, split and merged");
    for (key, word) in [
        ("new", "New"),
        ("vanished", "Vanished"),
        ("split", "Split"),
        ("merged", "Merged"),
    ] {
        for l in items(change, key) {
            let sentence = if number(l, "label").is_some() {
                format!("{word}: {}, {} mm\u{b3}.", name(l), shown(l, "volume_best"))
            } else {
                format!(
                    "{word}: {} at baseline, {} at follow-up.",
                    shown(l, "baseline"),
                    shown(l, "followup")
                )
            };
            section.paragraphs.push(sentence);
        }
    }
    section
}

fn alignment(change: &Value) -> Section {
    let mut section = Section::new("Alignment");
    let Some(a) = at(change, "alignment") else {
        return section;
    };
    section.paragraphs.push(format!(
        "The follow-up was moved onto the baseline by {} before anything was measured: {} mm and {}\u{b0}; the structure's \
         surfaces then lie {} mm apart (root mean square).",
        shown(a, "on"),
        shown(a, "shift_mm"),
        shown(a, "rotation_deg"),
        shown(a, "rms_mm")
    ));
    let mut matrix = Table::new(
        "T_baseline_followup (LPS mm, column vectors)",
        &["", "", "", "mm"],
    );
    for row in items(a, "T_baseline_followup") {
        matrix.row((0..4).map(|j| {
            number(row, &j.to_string()).map_or_else(Cell::missing, |x| Cell {
                shown: format!("{x:.6}"),
                exact: x.to_string(),
            })
        }));
    }
    section.tables.push(matrix);
    section
}

fn segmentations(change: &Value) -> Section {
    let mut section = Section::new("Segmentations of one date");
    let Some(s) = at(change, "segmentations") else {
        return section;
    };
    section
        .paragraphs
        .push(match at(s, "reference").and_then(Value::as_str) {
            Some(truth) => format!("Each segmentation against the truth, {truth}."),
            None => "Each segmentation against each other.".to_owned(),
        });
    if let Some(spread) = at(s, "pooled") {
        section.paragraphs.push(format!(
            "Repeated segmentation spreads the volume by {} % (coefficient of variation, {} degrees of freedom).",
            pretty(100.0 * number(spread, "cv").unwrap_or(f64::NAN)),
            shown(spread, "degrees_of_freedom")
        ));
    }
    let mut sizes = Table::new(
        "Size of each",
        &[
            "label",
            ":segmentation",
            "volume, voxel count [mm\u{b3}]",
            "volume, mesh [mm\u{b3}]",
            "area [mm\u{b2}]",
            "sphericity",
            "3D diameter [mm]",
            "axial diameter [mm]",
            "perpendicular [mm]",
        ],
    );
    for l in items(s, "lesions") {
        sizes.row(
            [
                "label",
                "segmentation",
                "volume_voxel",
                "volume_mesh",
                "area",
                "sphericity",
                "diameter_3d",
                "diameter_axial",
                "diameter_perpendicular",
            ]
            .map(|f| cell(l, f)),
        );
    }
    let mut pairs = Table::new(
        "Agreement (mesh: by area of the surfaces; voxel: by border voxels)",
        &[
            "label",
            ":segmentation",
            ":against",
            "volume [%]",
            "Dice",
            ":convention",
            "Hausdorff [mm]",
            "HD95 [mm]",
            "mean [mm]",
            "surface Dice",
            "at tolerance [mm]",
        ],
    );
    for p in items(s, "pairs") {
        for convention in ["mesh", "voxel"] {
            let Some(a) = at(p, &format!("agreement.{convention}")) else {
                continue;
            };
            pairs.row([
                cell(p, "label"),
                cell(p, "second"),
                cell(p, "first"),
                signed_cell(p, "volume_difference_percent"),
                cell(p, "agreement.dice"),
                convention.into(),
                cell(a, "hausdorff"),
                cell(a, "hd95"),
                cell(a, "assd"),
                cell(a, "surface_dice"),
                cell(p, "agreement.tolerance_mm"),
            ]);
        }
    }
    section.tables.extend([sizes, pairs]);
    section
}
