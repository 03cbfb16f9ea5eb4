//! One offline HTML page from parts: figures, notes, a 3D scene, sections of text, plots and tables, the result as JSON.
//!
//! In: a [`Report`]. Out: a page that holds everything it shows: the scene as the GLB that is also exported, the viewer
//! (three.js, vendored), a still picture for print and for browsers without WebGL, the result and the run record as JSON.
//! All text is escaped by the template engine; JSON is put in with `<` coded, so that nothing in it can end its element.
//! A content security policy forbids the page any network access.

use super::colour::ColourScale;
use super::glb::glb_bytes;
use super::plot::{pretty, signed};
use super::scene::{LayerKind, Scene};
use super::still::{self, View};
use crate::geometry::Rigid;
use base64::{Engine, engine::general_purpose::STANDARD};
use serde::Serialize;
use serde_json::{Value, json};
use thiserror::Error;

const TEMPLATE: &str = include_str!("assets/report.html");
const STYLE: &str = include_str!("assets/report.css");
const VIEWER: &str = include_str!("assets/viewer.js");

/// A page that could not be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The template engine failed.
    #[error("the report page could not be put together: {0}")]
    Template(#[from] minijinja::Error),
    /// The result could not be written as JSON.
    #[error("the result could not be written as JSON into the report: {0}")]
    Json(#[from] serde_json::Error),
    /// The result lacks something that the page is about.
    #[error(
        "the result has no `{field}`; it was made by another version or is damaged: run the command again"
    )]
    Missing {
        /// Path of the field in the JSON.
        field: String,
    },
}

/// The colour of a key figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// Neither good nor bad.
    #[default]
    Plain,
    /// A check that passed.
    Good,
    /// A check that failed.
    Bad,
}

/// A number at the top of the page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct KeyFigure {
    /// What it is.
    pub label: String,
    /// The number as text.
    pub value: String,
    /// Its unit.
    pub unit: String,
    /// A short remark below.
    pub note: String,
    /// Its colour.
    pub tone: Tone,
}

impl KeyFigure {
    /// A figure without remark or colour.
    pub fn new(label: &str, value: impl Into<String>, unit: &str) -> Self {
        Self {
            label: label.to_owned(),
            value: value.into(),
            unit: unit.to_owned(),
            ..Self::default()
        }
    }

    /// With a remark.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Coloured as passed or failed.
    pub fn check(mut self, passed: bool) -> Self {
        self.tone = if passed { Tone::Good } else { Tone::Bad };
        self
    }
}

/// How serious a note is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoteLevel {
    /// To know.
    Info,
    /// To look at.
    Warning,
    /// Something is wrong.
    Error,
}

/// A sentence under the key figures.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// How serious.
    pub level: NoteLevel,
    /// The sentence.
    pub text: String,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Unit, below the name.
    pub unit: String,
    /// Left-aligned text rather than numbers.
    pub text: bool,
}

/// A cell of a table: a number has few digits on the page and all of them in the CSV file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Cell {
    /// What stands on the page.
    pub shown: String,
    /// What stands in the CSV file.
    pub exact: String,
}

impl Cell {
    /// A number.
    pub fn number(x: f64) -> Self {
        Self {
            shown: pretty(x),
            exact: x.to_string(),
        }
    }

    /// A number whose sign is always shown.
    pub fn signed(x: f64) -> Self {
        Self {
            shown: signed(x),
            exact: x.to_string(),
        }
    }

    /// A dash on the page, nothing in the file.
    pub fn missing() -> Self {
        Self {
            shown: "-".to_owned(),
            exact: String::new(),
        }
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self {
            exact: text.clone(),
            shown: text,
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Table {
    /// Line above the table.
    pub caption: String,
    /// Columns.
    pub columns: Vec<Column>,
    /// Rows of cells, one a column.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table with columns written `name`, `name [unit]`, or `:name` for text.
    pub fn new(caption: &str, columns: &[&str]) -> Self {
        let column = |c: &&str| {
            let (text, c) = match c.strip_prefix(':') {
                Some(rest) => (true, rest),
                None => (false, *c),
            };
            let (name, unit) = match c.split_once(" [") {
                Some((name, unit)) => (name, unit.trim_end_matches(']')),
                None => (c, ""),
            };
            Column {
                name: name.to_owned(),
                unit: unit.to_owned(),
                text,
            }
        };
        Self {
            caption: caption.to_owned(),
            columns: columns.iter().map(column).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn row<C: Into<Cell>>(&mut self, cells: impl IntoIterator<Item = C>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Names of the columns with units, as the header of a CSV file.
    pub fn header(&self) -> Vec<String> {
        self.columns
            .iter()
            .map(|c| {
                if c.unit.is_empty() {
                    c.name.clone()
                } else {
                    format!("{} [{}]", c.name, c.unit)
                }
            })
            .collect()
    }
}

/// A plot with a line below.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Plot {
    /// An SVG element made by [`super::plot`].
    pub svg: String,
    /// What to see in it.
    pub caption: String,
}

/// A part of the page: paragraphs, then plots, then tables.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Sentences.
    pub paragraphs: Vec<String>,
    /// Plots, side by side where there is room.
    pub plots: Vec<Plot>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Whether its tables are results, also written as CSV files; settings and provenance are not.
    pub record: bool,
}

impl Section {
    /// An empty section.
    pub fn new(title: &str) -> Self {
        Self {
            title: title.to_owned(),
            ..Self::default()
        }
    }

    /// Whether there is nothing under the heading.
    pub fn is_empty(&self) -> bool {
        self.paragraphs.is_empty() && self.plots.is_empty() && self.tables.is_empty()
    }
}

/// Everything on a page.
#[derive(Clone, Debug, Default)]
#[allow(non_snake_case)]
pub struct Report {
    /// What kind of report, e.g. `Medial scaffold`.
    pub kind: String,
    /// Heading: the shape's name.
    pub title: String,
    /// Line below the heading.
    pub subtitle: String,
    /// Numbers at the top.
    pub figures: Vec<KeyFigure>,
    /// Sentences below them.
    pub notes: Vec<Note>,
    /// The 3D scene; a scene without layers is left out.
    pub scene: Scene,
    /// Where the camera starts; [`View::broadside`] when not given.
    pub view: Option<View>,
    /// Elements of lower persistence are hidden at first, mm.
    pub tolerance_mm: Option<f64>,
    /// `levels` of `scaffold.json`: what the graph of each tolerance holds, said beside the slider; null when there is none.
    pub levels: Value,
    /// Lets the viewer show layers of the shape `source` where they were before alignment.
    pub T_target_source: Option<Rigid>,
    /// Name of the surface quantity shown at first; none shows plain surfaces.
    pub surface_colours: Option<String>,
    /// Sections, in order.
    pub sections: Vec<Section>,
    /// The result (`scaffold.json`, `match.json`, ...): every number of the page comes from it.
    pub result: Value,
    /// The run record (`run.json`).
    pub run: Value,
}

/// A colour bar.
#[derive(Clone, Debug, Serialize)]
struct Legend {
    name: String,
    unit: String,
    /// Stops of a CSS gradient.
    gradient: String,
    ticks: [String; 3],
}

/// Pixels of the still picture.
const STILL_SIZE: [usize; 2] = [1200, 760];

impl Report {
    /// Adds a note, once.
    pub fn note(&mut self, level: NoteLevel, text: impl Into<String>) {
        let text = text.into();
        if self.notes.iter().all(|n| n.text != text) {
            self.notes.push(Note { level, text });
        }
    }

    /// Adds a section unless it is empty.
    pub fn section(&mut self, section: Section) {
        if !section.is_empty() {
            self.sections.push(section);
        }
    }

    /// The page.
    ///
    /// # Errors
    /// When the template engine or the JSON writer fails.
    pub fn html(&self) -> Result<String, ReportError> {
        let mut environment = minijinja::Environment::new();
        // The name ends in .html, which turns escaping on.
        environment.add_template("report.html", TEMPLATE)?;
        let has_scene = self.scene.layers.iter().any(|l| !l.mesh.triangles.is_empty());
        let view = self.view.unwrap_or_else(|| View::broadside(&self.scene));
        let (still, glb) = if has_scene {
            let image = still::render(&self.scene, &view, STILL_SIZE[0], STILL_SIZE[1]);
            (
                STANDARD.encode(image.png()),
                STANDARD.encode(glb_bytes(&self.scene)),
            )
        } else {
            (String::new(), String::new())
        };
        let context = minijinja::context! {
            version => env!("CARGO_PKG_VERSION"),
            kind => self.kind.as_str(),
            title => self.title.as_str(),
            subtitle => self.subtitle.as_str(),
            css => STYLE,
            figures => minijinja::value::Serde(&self.figures),
            notes => minijinja::value::Serde(&self.notes),
            sections => minijinja::value::Serde(&self.sections),
            still => still,
            still_alt => self.still_text(),
            legends => minijinja::value::Serde(self.still_legends()),
            glb => glb,
            view => script_json(&self.view_settings(&view))?,
            viewer => VIEWER,
            result => script_json(&self.result)?,
            run => if self.run.is_null() { String::new() } else { script_json(&self.run)? },
        };
        Ok(environment.get_template("report.html")?.render(context)?)
    }

    fn view_settings(&self, view: &View) -> Value {
        json!({
            "view": view,
            "tolerance_mm": self.tolerance_mm,
            "levels": self.levels,
            "T_target_source": self.T_target_source.map(|t| t.to_rows()),
            "surface_colours": self.surface_colours,
            "scales": {
                "viridis": ColourScale::Viridis.stops(),
                "blue-white-red": ColourScale::BlueWhiteRed.stops(),
            },
        })
    }

    /// The colour bars of the still picture: of every quantity that a visible surface is painted with.
    fn still_legends(&self) -> Vec<Legend> {
        let mut out: Vec<Legend> = Vec::new();
        let shown = self
            .scene
            .layers
            .iter()
            .filter(|l| l.visible && l.kind == LayerKind::Surface);
        for q in shown.filter_map(|l| l.quantity.as_ref()) {
            if self.surface_colours.as_ref() != Some(&q.name) || out.iter().any(|l| l.name == q.name) {
                continue;
            }
            let stops: Vec<String> = q
                .scale
                .stops()
                .iter()
                .map(|[r, g, b]| format!("rgb({r},{g},{b})"))
                .collect();
            let [lo, hi] = q.range;
            out.push(Legend {
                name: q.name.clone(),
                unit: q.unit.clone(),
                gradient: stops.join(","),
                ticks: [lo, 0.5 * (lo + hi), hi].map(pretty),
            });
        }
        out
    }

    /// What the still picture shows, in words.
    fn still_text(&self) -> String {
        let mut kinds: Vec<LayerKind> = self
            .scene
            .layers
            .iter()
            .filter(|l| l.visible)
            .map(|l| l.kind)
            .collect();
        kinds.sort_unstable();
        kinds.dedup();
        let words: Vec<String> = kinds.iter().map(|k| k.plural().to_lowercase()).collect();
        format!("{}: {}", self.title, words.join(", "))
    }
}

/// JSON that cannot end the script element it stands in.
fn script_json(value: &Value) -> Result<String, serde_json::Error> {
    Ok(serde_json::to_string(value)?
        .replace('<', "\\u003c")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_from_files_stays_text() {
        let evil = "</script><script>alert(1)</script>\"'&";
        let mut report = Report {
            kind: "Test".to_owned(),
            title: evil.to_owned(),
            subtitle: evil.to_owned(),
            figures: vec![KeyFigure::new(evil, evil, evil).note(evil)],
            result: json!({ "name": evil }),
            run: json!({ "name": evil }),
            ..Report::default()
        };
        report.note(NoteLevel::Warning, evil);
        let mut section = Section::new(evil);
        let mut table = Table::new(evil, &[":name", "x [mm]"]);
        table.row([evil.to_owned(), "1".to_owned()]);
        section.paragraphs.push(evil.to_owned());
        section.tables.push(table);
        report.section(section);
        let page = report.html().expect("a page");
        assert!(!page.contains("<script>alert"), "markup got through");
        assert_eq!(
            page.matches("</script>").count(),
            2,
            "result and run only: no scene"
        );
        assert_eq!(
            page.matches("http://").count() + page.matches("https://").count(),
            0
        );
    }
}
