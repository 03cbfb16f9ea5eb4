//! Reading results back from their JSON: the pages are built from the files, so that `medial report` can build them again
//! and no number stands in a page that is not in its JSON.

use super::page::{Cell, ReportError, Section, Table};
use super::plot::pretty;
use serde_json::Value;

/// The value at a path of field names separated by dots (array elements by index); the value itself for an empty path.
pub fn at<'a>(value: &'a Value, path: &str) -> Option<&'a Value> {
    if path.is_empty() {
        return Some(value);
    }
    path.split('.').try_fold(value, |v, key| match v {
        Value::Object(map) => map.get(key),
        Value::Array(items) => key.parse::<usize>().ok().and_then(|i| items.get(i)),
        _ => None,
    })
}

/// The number at a path.
pub fn number(value: &Value, path: &str) -> Option<f64> {
    at(value, path).and_then(Value::as_f64)
}

/// The number at a path that the page cannot do without.
///
/// # Errors
/// When it is not there.
pub fn required(value: &Value, path: &str) -> Result<f64, ReportError> {
    number(value, path).ok_or_else(|| ReportError::Missing {
        field: path.to_owned(),
    })
}

/// The items of the array at a path; none when it is not there.
pub fn items<'a>(value: &'a Value, path: &str) -> &'a [Value] {
    at(value, path)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// A number at a path as text for people; a dash when it is not there.
pub fn shown(value: &Value, path: &str) -> String {
    at(value, path).map_or_else(|| "-".to_owned(), text)
}

/// The value at a path as a cell of a table; a dash when it is not there.
pub fn cell(value: &Value, path: &str) -> Cell {
    match at(value, path) {
        None | Some(Value::Null) => Cell::missing(),
        Some(Value::Number(n)) => Cell {
            shown: shown(value, path),
            exact: n.to_string(),
        },
        Some(Value::Array(list)) if list.iter().all(Value::is_number) => Cell {
            shown: shown(value, path),
            exact: list.iter().map(Value::to_string).collect::<Vec<_>>().join(" "),
        },
        Some(other) => text(other).into(),
    }
}

/// The number at a path as a cell with its sign; a dash when it is not there.
pub fn signed_cell(value: &Value, path: &str) -> Cell {
    number(value, path).map_or_else(Cell::missing, Cell::signed)
}

/// A plain value as text for people.
pub fn text(value: &Value) -> String {
    match value {
        Value::Null => "-".to_owned(),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        Value::Number(n) => match (n.as_i64(), n.as_f64()) {
            (Some(i), _) => i.to_string(),
            (None, Some(x)) => pretty(x),
            (None, None) => n.to_string(),
        },
        Value::String(s) => s.clone(),
        Value::Array(list) => list.iter().map(text).collect::<Vec<_>>().join(", "),
        Value::Object(map) => map
            .iter()
            .map(|(k, v)| format!("{k}: {}", text(v)))
            .collect::<Vec<_>>()
            .join(", "),
    }
}

/// A field of a record and its value as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// Path of the field, names joined by dots.
    pub name: String,
    /// Its value.
    pub value: Cell,
}

/// How numbers of a record are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// All of them: settings.
    All,
    /// Three significant ones: results.
    Few,
}

/// All plain values below a value; arrays of plain values are one fact, arrays of records one a record.
pub fn facts(value: &Value, digits: Digits) -> Vec<Fact> {
    let mut out = Vec::new();
    gather(String::new(), value, digits, &mut out);
    out
}

fn gather(name: String, value: &Value, digits: Digits, out: &mut Vec<Fact>) {
    let below = |key: &str| {
        if name.is_empty() {
            key.to_owned()
        } else {
            format!("{name}.{key}")
        }
    };
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| gather(below(k), v, digits, out)),
        Value::Array(list) if list.iter().any(Value::is_object) => {
            list.iter()
                .enumerate()
                .for_each(|(i, v)| gather(below(&i.to_string()), v, digits, out));
        }
        plain => out.push(Fact {
            name,
            value: match plain {
                Value::Number(n) if digits == Digits::All => n.to_string().into(),
                other => cell(other, ""),
            },
        }),
    }
}

/// Any record as a two-column table.
pub fn facts_table(caption: &str, value: &Value, digits: Digits) -> Table {
    let mut table = Table::new(caption, &[":field", ":value"]);
    for f in facts(value, digits) {
        table.row([f.name.into(), f.value]);
    }
    table
}

/// Settings, inputs, times and warnings of a run record.
pub fn run_section(run: &Value) -> Section {
    let mut section = Section {
        record: true,
        ..Section::new("Settings and provenance")
    };
    let Value::Object(map) = run else {
        return section;
    };
    let mut general = serde_json::Map::new();
    for (key, value) in map {
        match key.as_str() {
            "settings" | "inputs" | "stages" | "warnings" => {}
            _ => {
                general.insert(key.clone(), value.clone());
            }
        }
    }
    if !general.is_empty() {
        let general = Value::Object(general);
        section.tables.push(facts_table("Run", &general, Digits::All));
    }
    for (key, caption) in [("inputs", "Inputs"), ("settings", "Settings, defaults filled in")] {
        if let Some(value) = map.get(key) {
            section.tables.push(facts_table(caption, value, Digits::All));
        }
    }
    let stages = items(run, "stages");
    if !stages.is_empty() {
        let mut table = Table::new("Time", &[":stage", "time [s]"]);
        for s in stages {
            table.row([shown(s, "name"), shown(s, "seconds")]);
        }
        section.tables.push(table);
    }
    section
}
