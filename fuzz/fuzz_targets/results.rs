//! Any bytes as edits of the results' JSON and of a scene: a page comes out, or an error, whatever the files hold.
//!
//! The first byte chooses `scaffold.json`, `match.json`, `change.json`, the scene or a coarse scaffold; the rest are edits. An edit of a
//! document goes to a place in its tree and drops, empties, repeats or replaces what is there; one of a scene changes bytes. Run with
//! `RUSTC_BOOTSTRAP=1 cargo fuzz run results -- -max_len=200 -max_total_time=900`.
#![no_main]

use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use medial_scaffold::coarse_scaffold::CoarseScaffold;
use medial_scaffold::geometry::{Rigid, TriangleMesh};
use medial_scaffold::reports::{
    Scene, change_report, glb_bytes, match_report, scaffold_report, scene_from_glb,
};
use serde_json::{Value, json};
use std::sync::OnceLock;

/// Results of a box, with all but the first items of every list left out.
const DOCUMENTS: [&str; 4] = [
    include_str!("../seeds/scaffold.json"),
    include_str!("../seeds/match.json"),
    include_str!("../seeds/change.json"),
    include_str!("../seeds/run.json"),
];

fuzz_target!(|data: &[u8]| {
    static SEEDS: OnceLock<[Value; 4]> = OnceLock::new();
    let seeds =
        SEEDS.get_or_init(|| DOCUMENTS.map(|text| serde_json::from_str(text).expect("a document of ours")));
    let [which, rest @ ..] = data else {
        return;
    };
    let which = usize::from(which % 5);
    if which == 3 {
        return scene(rest);
    }
    let mut document = seeds[which % 3].clone();
    let mut run = seeds[3].clone();
    for edit in rest.chunks_exact(6) {
        let target = if edit[5] & 8 == 8 { &mut run } else { &mut document };
        edit_document(target, [edit[0], edit[1], edit[2]], edit[3], edit[4]);
    }
    let report = match which {
        0 => scaffold_report("box", &document, &run, Scene::default()),
        1 => match_report("box on box", &document, &run, Scene::default()),
        2 => change_report("box", &document, &run, Scene::default()),
        _ => return coarse(document),
    };
    if let Ok(report) = report {
        report.html().expect("the template takes every report");
    }
});

/// Walks down a document, one byte a level, and changes what is at the end.
fn edit_document(document: &mut Value, path: [u8; 3], what: u8, byte: u8) {
    let mut at = document;
    for step in path {
        let step = usize::from(step);
        let deeper = match &*at {
            Value::Array(list) => !list.is_empty(),
            Value::Object(map) => !map.is_empty(),
            _ => false,
        };
        // One step in eight ends the walk early.
        if !deeper || step % 8 == 7 {
            break;
        }
        at = match at {
            Value::Array(list) => {
                let n = list.len();
                &mut list[step % n]
            }
            Value::Object(map) => {
                let n = map.len();
                map.values_mut().nth(step % n).expect("below the length")
            }
            _ => unreachable!("only lists and objects go deeper"),
        };
    }
    let byte_index = usize::from(byte);
    *at = match what % 12 {
        0 => Value::Null,
        1 => json!(f64::from(byte) - 128.0),
        2 => json!([1e300, -1e300, 1e-300, 5e-324, -0.0, 1.7976931348623157e308][byte_index % 6]),
        3 => json!([u64::MAX, 0, 1 << 53, u64::from(u32::MAX)][byte_index % 4]),
        4 => json!(["", "<script>", "\u{0}", "{{ x }}", "nan", "\u{202e}\u{1F9B4}"][byte_index % 6]),
        5 => json!([]),
        6 => json!({}),
        7 => json!(byte & 1 == 1),
        8 => json!([at.clone(), at.clone()]),
        9 => json!(vec![byte; 40]),
        10 => json!({ "id": byte, "x": at.clone() }),
        _ => {
            if let Value::Object(map) = at {
                let key = map.keys().nth(byte_index % map.len().max(1)).cloned();
                key.and_then(|k| map.remove(&k));
                return;
            }
            json!(-1)
        }
    };
}

/// The curves, nodes and sheets of a `scaffold.json` as a coarse scaffold, drawn when they are one.
fn coarse(mut document: Value) {
    if let Value::Object(map) = &mut document {
        map.entry("diagonal_mm").or_insert(json!(26.0));
    }
    if let Ok(scaffold) = serde_json::from_value::<CoarseScaffold>(document) {
        let text = serde_json::to_string(&scaffold).expect("numbers and names");
        serde_json::from_str::<CoarseScaffold>(&text).expect("what was written");
        Scene::default().add_scaffold("box", &scaffold, &Rigid::default());
    }
}

/// A scene with edited bytes: read back, drawn and written again.
fn scene(edits: &[u8]) {
    let mut scene = Scene::default();
    let mesh = TriangleMesh {
        points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    };
    scene.layers.push(medial_scaffold::reports::Layer {
        name: "surface".to_owned(),
        kind: medial_scaffold::reports::LayerKind::Surface,
        shape: String::new(),
        mesh,
        colour: [0.5, 0.5, 0.5, 1.0],
        quantity: Some(medial_scaffold::reports::Quantity::signed(
            "distance",
            "mm",
            vec![0.0, 1.0, -1.0, 2.0],
        )),
        properties: serde_json::Map::new(),
        visible: true,
    });
    let mut bytes = glb_bytes(&scene);
    for edit in edits.chunks_exact(3) {
        let at = usize::from(u16::from_le_bytes([edit[0], edit[1]])) % bytes.len();
        bytes[at] = edit[2];
    }
    if let Ok(scene) = scene_from_glb(&bytes) {
        glb_bytes(&scene);
    }
}
