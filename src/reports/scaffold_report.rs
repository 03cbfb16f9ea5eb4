//! The page of one scaffold.
//!
//! In: `scaffold.json`, `run.json` and the scene. Out: a [`Report`] with the bone, translucent, its sheets, curves and nodes;
//! how many elements each tolerance keeps; tables of sheets, curves and nodes; topology and fidelity checks.

use super::facts::{Digits, at, cell, items, number, required, run_section, shown};
use super::page::{Cell, KeyFigure, NoteLevel, Plot, Report, ReportError, Section, Table};
use super::plot::{Chart, Marker, Series, SeriesStyle, pretty};
use super::scene::Scene;
use serde_json::Value;

/// The report of a scaffold named `title`.
///
/// # Errors
/// When `scaffold.json` lacks its counts or tolerance.
pub fn scaffold_report(
    title: &str,
    scaffold: &Value,
    run: &Value,
    scene: Scene,
) -> Result<Report, ReportError> {
    let tolerance = required(scaffold, "tolerance_mm")?;
    let mut report = Report {
        kind: "Medial scaffold".to_owned(),
        title: title.to_owned(),
        subtitle: subtitle(scaffold),
        scene,
        tolerance_mm: Some(least_shown(scaffold, tolerance)),
        levels: at(scaffold, "levels").cloned().unwrap_or_default(),
        result: scaffold.clone(),
        run: run.clone(),
        ..Report::default()
    };
    figures(&mut report, scaffold, tolerance)?;
    notes(&mut report, scaffold, run);
    report.section(simplification(scaffold, tolerance));
    report.section(sheets(scaffold));
    report.section(curves(scaffold));
    report.section(nodes(scaffold));
    report.section(checks(scaffold));
    report.section(run_section(run));
    Ok(report)
}

/// Where the slider and the plot begin: the least persistence that is listed, so that the picture opens with all that the tables name.
fn least_shown(scaffold: &Value, tolerance: f64) -> f64 {
    let sheets = persistences(scaffold, "sheets", &[]);
    let curves = persistences(scaffold, "curves", &["axial", "wire"]);
    sheets.into_iter().chain(curves).fold(tolerance, f64::min)
}

fn subtitle(scaffold: &Value) -> String {
    let mut parts = Vec::new();
    if let Some(n) = number(scaffold, "full.generators") {
        parts.push(format!("{n} points"));
    }
    if let Some(n) = number(scaffold, "surface.triangles") {
        parts.push(format!("{n} surface triangles"));
    }
    if let Some(frame) = at(scaffold, "frame").and_then(Value::as_str) {
        parts.push(format!("frame {frame}"));
    }
    parts.join(", ")
}

fn figures(report: &mut Report, s: &Value, tolerance: f64) -> Result<(), ReportError> {
    if number(s, "surface.volume").is_some() {
        report
            .figures
            .push(KeyFigure::new("Volume", shown(s, "surface.volume"), "mm\u{b3}"));
        report.figures.push(KeyFigure::new(
            "Surface area",
            shown(s, "surface.area"),
            "mm\u{b2}",
        ));
    }
    for (label, field) in [
        ("Sheets", "sheets"),
        ("Axial curves", "axial_curves"),
        ("Ribs", "rib_curves"),
    ] {
        let n = required(s, &format!("counts.{field}"))?;
        report.figures.push(KeyFigure::new(label, pretty(n), ""));
    }
    report
        .figures
        .push(KeyFigure::new("Tolerance", pretty(tolerance), "mm").note("how much the shape may change"));
    if number(s, "fidelity.hausdorff").is_some() {
        let percent = number(s, "fidelity.hausdorff_percent_diag")
            .map(|p| format!("{} % of the diagonal", pretty(p)))
            .unwrap_or_default();
        report
            .figures
            .push(KeyFigure::new("Shape change", shown(s, "fidelity.hausdorff"), "mm").note(percent));
    }
    if let Some(agree) = at(s, "topology.agree").and_then(Value::as_bool) {
        let betti = format!("Betti numbers {}", shown(s, "topology.scaffold_betti"));
        let as_given = at(s, "topology.surface_as_given").and_then(Value::as_bool) != Some(false);
        let note = if as_given {
            betti
        } else {
            format!("{betti}; the surface given has others")
        };
        let agree = agree && as_given;
        report.figures.push(
            KeyFigure::new("Topology", if agree { "agrees" } else { "differs" }, "")
                .note(note)
                .check(agree),
        );
    }
    Ok(())
}

fn notes(report: &mut Report, s: &Value, run: &Value) {
    for w in items(run, "warnings")
        .iter()
        .chain(items(s, "warnings"))
        .filter_map(Value::as_str)
    {
        report.note(NoteLevel::Warning, w);
    }
    if at(s, "topology.agree").and_then(Value::as_bool) == Some(false) {
        report.note(
            NoteLevel::Error,
            format!(
                "The scaffold's Betti numbers ({}) are not the solid's ({}); do not rely on its topology.",
                shown(s, "topology.scaffold_betti"),
                shown(s, "topology.solid_betti")
            ),
        );
    }
}

/// One count of the levels as a step line: the value before each tolerance is that of the graph up to it.
fn steps(s: &Value, name: &str, colour: &str, counts: &[&str], from: f64) -> Series {
    let mut points: Vec<[f64; 2]> = Vec::new();
    let mut start = from;
    for level in items(s, "levels") {
        let count: f64 = counts.iter().filter_map(|c| number(level, c)).sum();
        points.push([start, count]);
        start = number(level, "tolerance_mm").unwrap_or(start).max(from);
        points.push([start, count]);
    }
    Series {
        name: name.to_owned(),
        colour: colour.to_owned(),
        style: SeriesStyle::Line,
        points,
    }
}

fn persistences(s: &Value, list: &str, kinds: &[&str]) -> Vec<f64> {
    items(s, list)
        .iter()
        .filter(|c| {
            kinds.is_empty()
                || at(c, "kind")
                    .and_then(Value::as_str)
                    .is_some_and(|k| kinds.contains(&k))
        })
        .filter_map(|c| number(c, "persistence"))
        .filter(|p| p.is_finite())
        .collect()
}

fn simplification(s: &Value, tolerance: f64) -> Section {
    let mut section = Section::new("What each tolerance keeps");
    let sheets = persistences(s, "sheets", &[]);
    let curves = persistences(s, "curves", &["axial", "wire"]);
    if sheets.is_empty() && curves.is_empty() {
        return section;
    }
    section.paragraphs.push(
        "Every sheet and curve carries its persistence: how much of the shape must be given up before it goes. Where a curve goes, \
         the sheets on its two sides become one, and what is left of the curves at its ends may become one. \
         A long flat step is a stable level of detail; the slider beside the picture hides what lies below a level."
            .to_owned(),
    );
    let from = least_shown(s, tolerance);
    let mut series = Vec::new();
    if !sheets.is_empty() {
        series.push(steps(s, "sheets", "#3a86c8", &["sheets"], from));
    }
    if !curves.is_empty() {
        let both = ["axial_curves", "wires"];
        series.push(steps(s, "axial curves and wires", "#d61f29", &both, from));
    }
    let chart = Chart {
        title: "The graph at each tolerance".to_owned(),
        x_label: "tolerance [mm], logarithmic".to_owned(),
        y_label: "elements".to_owned(),
        series,
        markers: vec![Marker {
            x: tolerance,
            label: format!("this run, {} mm", pretty(tolerance)),
        }],
        log_x: from > 0.0,
    };
    if !items(s, "levels").is_empty() {
        section.plots.push(Plot {
            svg: chart.svg(),
            caption: "Sheets and curves of the graph at each tolerance.".to_owned(),
        });
    }
    let shares: Vec<[f64; 2]> = items(s, "sheets")
        .iter()
        .filter_map(|x| Some([number(x, "id")?, 100.0 * number(x, "volume_share")?]))
        .collect();
    if !shares.is_empty() {
        let chart = Chart {
            title: "Share of the volume nearest to each sheet".to_owned(),
            x_label: "sheet".to_owned(),
            y_label: "share of volume [%]".to_owned(),
            series: vec![Series {
                name: "share".to_owned(),
                colour: "#5b8fbf".to_owned(),
                style: SeriesStyle::Bars,
                points: shares,
            }],
            ..Chart::default()
        };
        section.plots.push(Plot {
            svg: chart.svg(),
            caption: "How much of the solid each sheet stands for.".to_owned(),
        });
    }
    section
}

fn sheets(s: &Value) -> Section {
    let mut section = Section::new("Sheets");
    let mut table = Table::new(
        "",
        &[
            "sheet",
            "persistence [mm]",
            "area [mm\u{b2}]",
            "mean radius [mm]",
            "largest radius [mm]",
            "volume share [%]",
            "generators",
            "boundary chains",
        ],
    );
    for x in items(s, "sheets") {
        table.row([
            cell(x, "id"),
            cell(x, "persistence"),
            cell(x, "area"),
            cell(x, "mean_radius"),
            cell(x, "max_radius"),
            number(x, "volume_share").map_or_else(Cell::missing, |v| Cell::number(100.0 * v)),
            cell(x, "generators"),
            items(x, "boundary").len().to_string().into(),
        ]);
    }
    if !table.rows.is_empty() {
        section.tables.push(table);
    }
    section
}

fn curves(s: &Value) -> Section {
    let mut section = Section::new("Curves");
    let mut table = Table::new(
        "",
        &[
            "curve",
            ":kind",
            "persistence [mm]",
            "length [mm]",
            ":closed",
            ":nodes",
            ":sheets",
        ],
    );
    for x in items(s, "curves") {
        table.row(["id", "kind", "persistence", "length", "closed", "nodes", "sheets"].map(|f| cell(x, f)));
    }
    if !table.rows.is_empty() {
        section.tables.push(table);
    }
    section
}

fn nodes(s: &Value) -> Section {
    let mut section = Section::new("Nodes");
    let mut table = Table::new("", &["node", ":type", "radius [mm]", ":position [mm]", ":curves"]);
    for x in items(s, "nodes") {
        table.row(["id", "type", "radius", "position", "curves"].map(|f| cell(x, f)));
    }
    if !table.rows.is_empty() {
        section.tables.push(table);
    }
    section
}

fn checks(s: &Value) -> Section {
    let mut section = Section::new("Checks");
    section.paragraphs.push(
        "The alternating sum of sources, relays and sinks of the full scaffold is 1 for every point set, and the \
         scaffold's Betti numbers (components, tunnels, cavities) must equal those of the solid, counted independently."
            .to_owned(),
    );
    for (key, caption) in [
        ("topology", "Topology"),
        ("full", "Full scaffold"),
        ("surface", "Surface"),
        (
            "fidelity",
            "Distance between the shape and what the scaffold gives back",
        ),
    ] {
        if let Some(value) = at(s, key) {
            section
                .tables
                .push(super::facts::facts_table(caption, value, Digits::Few));
        }
    }
    section
}
