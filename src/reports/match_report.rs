//! The page of a match: target and source aligned, what corresponds, and how the shapes differ.
//!
//! In: `match.json`, `run.json` and a scene whose layers are named by the shapes `target` and `source` (source layers already
//! moved). Out: a [`Report`].

use super::facts::{at, cell, items, number, run_section, shown, text};
use super::page::{Cell, KeyFigure, NoteLevel, Report, ReportError, Section, Table};
use super::plot::{pretty, signed};
use super::scene::Scene;
use crate::geometry::Rigid;
use glam::{DMat3, DVec3};
use serde_json::Value;

/// The report of a match.
///
/// # Errors
/// When `match.json` lacks its transform.
pub fn match_report(title: &str, result: &Value, run: &Value, scene: Scene) -> Result<Report, ReportError> {
    let motion = transform(result)?;
    let mut report = Report {
        kind: "Match".to_owned(),
        title: title.to_owned(),
        subtitle: "Target and source, aligned by T_target_source".to_owned(),
        scene,
        T_target_source: Some(motion),
        result: result.clone(),
        run: run.clone(),
        ..Report::default()
    };
    figures(&mut report, result, &motion);
    notes(&mut report, result, run);
    report.section(pose(result, &motion));
    report.section(difference(result));
    report.section(correspondences(result));
    report.section(edit(result));
    report.section(run_section(run));
    Ok(report)
}

fn transform(result: &Value) -> Result<Rigid, ReportError> {
    let missing = || ReportError::Missing {
        field: "T_target_source".to_owned(),
    };
    let rows: [[f64; 4]; 4] = at(result, "T_target_source")
        .and_then(|v| serde_json::from_value(v.clone()).ok())
        .ok_or_else(missing)?;
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    Ok(Rigid {
        linear: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    })
}

fn figures(report: &mut Report, r: &Value, motion: &Rigid) {
    for (label, field) in [
        ("Surface distance, rms", "rms"),
        ("95th percentile", "p95"),
        ("Largest", "max"),
    ] {
        if number(r, field).is_some() {
            report.figures.push(KeyFigure::new(label, shown(r, field), "mm"));
        }
    }
    if let Some(v) = number(r, "difference.volume_change_percent") {
        report.figures.push(
            KeyFigure::new("Volume, target to source", signed(v), "%").note(format!(
                "{} \u{2192} {} mm\u{b3}",
                shown(r, "difference.volume_target"),
                shown(r, "difference.volume_source")
            )),
        );
    }
    if let Some(v) = number(r, "overlap") {
        report
            .figures
            .push(KeyFigure::new("Overlap", pretty(100.0 * v), "%"));
    }
    if let Some(v) = number(r, "shape_distance") {
        report
            .figures
            .push(KeyFigure::new("Shape distance", pretty(v), "mm").note("size counts"));
    }
    let angle = if motion.is_mirrored() {
        let unmirrored = Rigid {
            linear: -motion.linear,
            ..*motion
        };
        unmirrored.rotation_angle_deg(&Rigid::IDENTITY)
    } else {
        motion.rotation_angle_deg(&Rigid::IDENTITY)
    };
    let mut notes = Vec::new();
    if motion.is_mirrored() {
        notes.push("after a point reflection".to_owned());
    }
    if let Some(error) = number(r, "precision.rotation_deg") {
        notes.push(format!("standard error {}\u{b0}", pretty(error)));
    }
    report
        .figures
        .push(KeyFigure::new("Rotation", pretty(angle), "\u{b0}").note(notes.join(", ")));
    if let Some(ok) = at(r, "converged").and_then(Value::as_bool) {
        let ambiguous = at(r, "ambiguous").and_then(Value::as_bool).unwrap_or(false);
        let uncertain = at(r, "uncertain").and_then(Value::as_bool).unwrap_or(false);
        let (word, good) = match (ok, ambiguous, uncertain) {
            (true, false, false) => ("decided", true),
            (true, false, true) => ("uncertain", false),
            (true, true, _) => ("ambiguous", false),
            (false, ..) => ("not converged", false),
        };
        report.figures.push(KeyFigure::new("Pose", word, "").check(good));
    }
}

fn notes(report: &mut Report, r: &Value, run: &Value) {
    let flag = |field: &str| at(r, field).and_then(Value::as_bool).unwrap_or(false);
    if flag("mirrored") {
        report.note(
            NoteLevel::Info,
            "The source is the mirror image of the target (a left and a right side); it was mirrored before alignment.",
        );
    }
    if flag("ambiguous") {
        report.note(
            NoteLevel::Warning,
            "Other poses fit almost as well (see the hypotheses): the shape is nearly symmetric, or the overlap too small to decide.",
        );
    }
    for w in items(run, "warnings")
        .iter()
        .chain(items(r, "warnings"))
        .filter_map(Value::as_str)
    {
        report.note(NoteLevel::Warning, w);
    }
}

fn pose(r: &Value, motion: &Rigid) -> Section {
    let mut section = Section::new("Pose");
    section.paragraphs.push(
        "T_target_source takes source coordinates to target coordinates (LPS mm, column vectors).".to_owned(),
    );
    let mut matrix = Table::new("T_target_source", &["", "", "", "mm"]);
    for row in motion.to_rows() {
        matrix.row(row.map(|x| Cell {
            shown: format!("{x:.6}"),
            exact: x.to_string(),
        }));
    }
    section.tables.push(matrix);
    let hypotheses = items(r, "hypotheses");
    if !hypotheses.is_empty() {
        let mut table = Table::new(
            "Hypotheses, best first",
            &["rank", "score", "rotation from the best [\u{b0}]"],
        );
        for (i, h) in hypotheses.iter().enumerate() {
            let angle = transform(h)
                .ok()
                .filter(|t| t.is_mirrored() == motion.is_mirrored())
                .map_or_else(
                    || "mirrored".into(),
                    |t| Cell::number(t.rotation_angle_deg(motion)),
                );
            table.row([(i + 1).to_string().into(), cell(h, "score"), angle]);
        }
        section.tables.push(table);
    }
    section
}

/// A field of the difference in words, with the short name people search for.
fn quantity(key: &str) -> String {
    match key {
        "volume_target" => "volume, target".to_owned(),
        "volume_source" => "volume, source".to_owned(),
        "volume_change_percent" => "volume, target to source".to_owned(),
        "area_target" => "surface area, target".to_owned(),
        "area_source" => "surface area, source".to_owned(),
        "area_change_percent" => "surface area, target to source".to_owned(),
        "hausdorff" => "largest surface distance (Hausdorff)".to_owned(),
        "hd95" => "95th percentile of the surface distance (HD95)".to_owned(),
        "assd" => "mean surface distance, both ways (ASSD)".to_owned(),
        "rms" => "root mean square surface distance (RMS)".to_owned(),
        other => other.replace('_', " "),
    }
}

fn difference(r: &Value) -> Section {
    let mut section = Section::new("Shape difference");
    let Some(Value::Object(map)) = at(r, "difference") else {
        return section;
    };
    let mut table = Table::new("", &[":quantity", "value", ":unit"]);
    for (key, value) in map.iter().filter(|(_, v)| v.is_number()) {
        let unit = if key.ends_with("percent") {
            "%"
        } else if key.starts_with("volume") {
            "mm\u{b3}"
        } else if key.starts_with("area") {
            "mm\u{b2}"
        } else {
            "mm"
        };
        table.row([quantity(key).into(), cell(value, ""), unit.into()]);
    }
    section.tables.push(table);
    let sheets = items(r, "difference.per_sheet");
    if let Some(Value::Object(first)) = sheets.first() {
        let mut names: Vec<&str> = first
            .iter()
            .filter(|(_, v)| !v.is_object())
            .map(|(k, _)| k.as_str())
            .collect();
        // Ids first, the rest in its order.
        names.sort_by_key(|n| match *n {
            "target" => 0,
            "source" => 1,
            _ => 2,
        });
        let words: Vec<String> = names.iter().map(|n| n.replace('_', " ")).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let mut table = Table::new(
            "Sheet by sheet (lengths mm, areas mm\u{b2}, volumes mm\u{b3})",
            &words,
        );
        for s in sheets {
            table.row(names.iter().map(|n| cell(s, n)));
        }
        section.tables.push(table);
    }
    section
}

fn correspondences(r: &Value) -> Section {
    let mut section = Section::new("Correspondences");
    for (key, word) in [("nodes", "Nodes"), ("curves", "Curves"), ("sheets", "Sheets")] {
        let list = items(r, &format!("correspondences.{key}"));
        if list.is_empty() {
            continue;
        }
        let mut table = Table::new(word, &["target", "source", "weight"]);
        for c in list {
            table.row(["target", "source", "weight"].map(|f| cell(c, f)));
        }
        section.tables.push(table);
    }
    for (key, word) in [
        ("unmatched_target", "Only in the target"),
        ("unmatched_source", "Only in the source"),
    ] {
        let named: Vec<String> = ["nodes", "curves", "sheets"]
            .into_iter()
            .filter_map(|kind| {
                let ids = at(r, &format!("correspondences.{key}.{kind}")).map(text)?;
                (!ids.is_empty()).then(|| format!("{kind} {ids}"))
            })
            .collect();
        if !named.is_empty() {
            section.paragraphs.push(format!("{word}: {}.", named.join("; ")));
        }
    }
    section
}

fn edit(r: &Value) -> Section {
    let mut section = Section::new("Edit distance");
    if at(r, "edit").is_none_or(Value::is_null) {
        return section;
    }
    let mut bounds = Table::new("", &[":way from target to source", ":price [mm]"]);
    if at(r, "edit.exact").and_then(Value::as_bool) == Some(true) {
        bounds.row(["cheapest, proven".into(), cell(r, "edit.upper_bound")]);
    } else {
        bounds.row(["the way below".into(), cell(r, "edit.upper_bound")]);
        bounds.row(["no way is cheaper than".into(), cell(r, "edit.lower_bound")]);
    }
    section.tables.push(bounds);
    let operations = items(r, "edit.operations");
    if !operations.is_empty() {
        let mut table = Table::new(
            "Operations that make source and target equal",
            &[":operation", "price [mm]"],
        );
        for o in operations {
            let words = shown(o, "text");
            // The price has a column of its own.
            let what = words.rsplit_once(": ").map_or(words.as_str(), |w| w.0);
            table.row([what.into(), cell(o, "price")]);
        }
        section.tables.push(table);
    }
    section
}
