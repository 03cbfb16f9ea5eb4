//! Scenes as binary glTF 2.0 (`.glb`), and back.
//!
//! In: a [`Scene`]. Out: one node a layer, named as the layer, with smooth normals, vertex colours of its quantity
//! (`COLOR_0`, linear light, as the standard says), the quantity itself (`_RADIUS`, `_THICKNESS`, ... one float a
//! vertex) and, on sheets, the id (`_ID`). What picking shows is in the node's `extras`.
//!
//! glTF is in metres with +Y up and +X to the left of a figure that faces +Z. Positions in the file are LPS mm, less the
//! centre of the scene (single precision keeps its digits); the node `LPS_mm` moves them back to their place, and the root
//! turns and scales them to glTF's frame. Both matrices are exact, so nothing is lost or mirrored.
//!
//! [`scene_from_glb`] reads what [`glb_bytes`] wrote; positions come back in single precision about the centre. It is not
//! a general glTF reader.

use super::colour::{Rgba, to_linear};
use super::scene::{Layer, LayerKind, Quantity, Scene};
use crate::geometry::TriangleMesh;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use thiserror::Error;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_BYTE: u32 = 5121;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BINARY_CHUNK: u32 = 0x004E_4942;

/// What a node's `extras` say of its layer.
#[derive(Serialize, Deserialize)]
struct Extras {
    kind: LayerKind,
    #[serde(default)]
    shape: String,
    colour: Rgba,
    visible: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    quantity: Option<QuantityExtras>,
    #[serde(default)]
    properties: Map<String, Value>,
}

#[derive(Serialize, Deserialize)]
struct QuantityExtras {
    name: String,
    unit: String,
    attribute: String,
    range: [f64; 2],
    scale: super::colour::ColourScale,
}

/// The parts of a glTF file while it grows.
#[derive(Default)]
struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Builder {
    /// Adds an accessor with its own buffer view; `stride_bytes` of data are one element.
    fn accessor(&mut self, data: &[u8], target: u32, mut accessor: Value) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(data);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views
            .push(json!({"buffer": 0, "byteOffset": offset, "byteLength": data.len(), "target": target}));
        accessor["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn vectors(&mut self, values: &[[f32; 3]], with_bounds: bool) -> usize {
        let data: Vec<u8> = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let mut accessor = json!({"componentType": FLOAT, "count": values.len(), "type": "VEC3"});
        if with_bounds {
            let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for v in values {
                for k in 0..3 {
                    lo[k] = lo[k].min(v[k]);
                    hi[k] = hi[k].max(v[k]);
                }
            }
            accessor["min"] = json!(lo);
            accessor["max"] = json!(hi);
        }
        self.accessor(&data, ARRAY_BUFFER, accessor)
    }

    fn scalars(&mut self, values: &[f32]) -> usize {
        let data: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let accessor = json!({"componentType": FLOAT, "count": values.len(), "type": "SCALAR"});
        self.accessor(&data, ARRAY_BUFFER, accessor)
    }

    fn colours(&mut self, quantity: &Quantity) -> usize {
        let data: Vec<u8> = (0..quantity.values.len())
            .flat_map(|i| {
                let [r, g, b] = quantity.colour(i).map(|c| (to_linear(c) * 255.0).round() as u8);
                [r, g, b, 255]
            })
            .collect();
        let accessor = json!({
            "componentType": UNSIGNED_BYTE, "normalized": true, "count": quantity.values.len(), "type": "VEC4"
        });
        self.accessor(&data, ARRAY_BUFFER, accessor)
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let data: Vec<u8> = triangles.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let accessor = json!({"componentType": UNSIGNED_INT, "count": 3 * triangles.len(), "type": "SCALAR"});
        self.accessor(&data, ELEMENT_ARRAY_BUFFER, accessor)
    }

    fn material(&mut self, layer: &Layer) -> usize {
        let [r, g, b, a] = layer.colour;
        // Vertex colours multiply the base colour, so a coloured layer has a white base.
        let coloured =
            layer.quantity.is_some() && matches!(layer.kind, LayerKind::Sheet | LayerKind::Surface);
        let base = if coloured {
            [1.0; 3]
        } else {
            [r, g, b].map(to_linear)
        };
        let surface = layer.kind == LayerKind::Surface;
        let alpha = if surface && !coloured { 0.3 * a } else { a };
        let material = json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [base[0], base[1], base[2], alpha],
                "metallicFactor": 0.0,
                "roughnessFactor": 0.65,
            },
            "doubleSided": true,
            "alphaMode": if alpha < 1.0 { "BLEND" } else { "OPAQUE" },
        });
        if let Some(i) = self.materials.iter().position(|m| *m == material) {
            return i;
        }
        self.materials.push(material);
        self.materials.len() - 1
    }

    fn layer(&mut self, layer: &Layer, centre: DVec3) -> usize {
        let positions: Vec<[f32; 3]> = layer
            .mesh
            .points
            .iter()
            .map(|p| (*p - centre).as_vec3().to_array())
            .collect();
        // A vertex that no triangle of any area uses has no normal; the standard wants unit length.
        let normals: Vec<[f32; 3]> = layer
            .mesh
            .vertex_normals()
            .iter()
            .map(|n| n.as_vec3().try_normalize().unwrap_or(glam::Vec3::Z).to_array())
            .collect();
        let mut attributes = json!({
            "POSITION": self.vectors(&positions, true),
            "NORMAL": self.vectors(&normals, false),
        });
        let mut quantity_extras = None;
        if let Some(q) = &layer.quantity {
            if matches!(layer.kind, LayerKind::Sheet | LayerKind::Surface) {
                attributes["COLOR_0"] = json!(self.colours(q));
            }
            let attribute = format!("_{}", super::mesh_files::token(&q.name).to_ascii_uppercase());
            attributes[&attribute] = json!(self.scalars(&q.values));
            quantity_extras = Some(QuantityExtras {
                name: q.name.clone(),
                unit: q.unit.clone(),
                attribute,
                range: q.range,
                scale: q.scale,
            });
        }
        if let (LayerKind::Sheet, Some(id)) = (layer.kind, layer.properties.get("id").and_then(Value::as_f64))
        {
            attributes["_ID"] = json!(self.scalars(&vec![id as f32; positions.len()]));
        }
        let indices = self.indices(&layer.mesh.triangles);
        let material = self.material(layer);
        self.meshes.push(json!({
            "name": layer.name,
            "primitives": [{"attributes": attributes, "indices": indices, "material": material, "mode": 4}],
        }));
        let extras = Extras {
            kind: layer.kind,
            shape: layer.shape.clone(),
            colour: layer.colour,
            visible: layer.visible,
            quantity: quantity_extras,
            properties: layer.properties.clone(),
        };
        self.nodes
            .push(json!({"name": layer.name, "mesh": self.meshes.len() - 1, "extras": extras}));
        self.nodes.len() - 1
    }
}

/// The scene as the bytes of a `.glb`; layers without triangles are left out.
pub fn glb_bytes(scene: &Scene) -> Vec<u8> {
    let centre = scene
        .bounds()
        .map_or(DVec3::ZERO, |[lo, hi]| (0.5 * (lo + hi)).round());
    let mut b = Builder::default();
    let children: Vec<usize> = scene
        .layers
        .iter()
        .filter(|l| !l.mesh.triangles.is_empty())
        .map(|l| b.layer(l, centre))
        .collect();
    let lps = b.nodes.len();
    let mut lps_node = json!({
        "name": "LPS_mm", "translation": centre.to_array(), "extras": {"frame": "LPS", "units": "mm"}
    });
    if !children.is_empty() {
        lps_node["children"] = json!(children);
    }
    b.nodes.push(lps_node);
    // Column-major: (x, y, z) LPS mm -> (x, z, -y) / 1000.
    b.nodes.push(json!({
        "name": "medial-scaffold",
        "matrix": [0.001, 0.0, 0.0, 0.0, 0.0, 0.0, -0.001, 0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        "children": [lps],
    }));
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("medial-scaffold ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [lps + 1]}],
        "nodes": b.nodes,
    });
    if !b.meshes.is_empty() {
        document["meshes"] = json!(b.meshes);
        document["materials"] = json!(b.materials);
        document["accessors"] = json!(b.accessors);
        document["bufferViews"] = json!(b.views);
        document["buffers"] = json!([{"byteLength": b.bytes.len()}]);
    }
    assemble(&document, &b.bytes)
}

fn assemble(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary_part = if binary.is_empty() { 0 } else { 8 + binary.len() };
    let mut out = Vec::with_capacity(20 + text.len() + binary_part);
    out.extend_from_slice(b"glTF");
    out.extend_from_slice(&2u32.to_le_bytes());
    out.extend_from_slice(&((20 + text.len() + binary_part) as u32).to_le_bytes());
    out.extend_from_slice(&(text.len() as u32).to_le_bytes());
    out.extend_from_slice(&JSON_CHUNK.to_le_bytes());
    out.extend_from_slice(&text);
    if !binary.is_empty() {
        out.extend_from_slice(&(binary.len() as u32).to_le_bytes());
        out.extend_from_slice(&BINARY_CHUNK.to_le_bytes());
        out.extend_from_slice(binary);
    }
    out
}

/// A `.glb` that is not one of ours, or is damaged.
#[derive(Debug, Error)]
pub enum GlbError {
    /// Header or chunks do not fit the file.
    #[error("not a binary glTF 2.0 file: {0}; run the command again to make scene.glb anew")]
    Container(String),
    /// The JSON part is not what this program writes.
    #[error("the scene has no usable {0}; only files written by this program can be read back")]
    Content(String),
}

/// Reads a scene back from the bytes of [`glb_bytes`].
///
/// # Errors
/// When the container is damaged, or the file was not written by this program.
pub fn scene_from_glb(bytes: &[u8]) -> Result<Scene, GlbError> {
    let (document, binary) = split(bytes)?;
    let missing = |what: &str| GlbError::Content(what.to_owned());
    let nodes = document["nodes"].as_array().ok_or_else(|| missing("nodes"))?;
    let lps = nodes
        .iter()
        .find(|n| n["name"] == "LPS_mm")
        .ok_or_else(|| missing("node LPS_mm"))?;
    let t: [f64; 3] = serde_json::from_value(lps["translation"].clone()).map_err(|_| missing("centre"))?;
    let reader = Reader {
        document: &document,
        binary,
    };
    let mut scene = Scene::default();
    for child in lps["children"].as_array().into_iter().flatten() {
        let node = child
            .as_u64()
            .and_then(|i| nodes.get(i as usize))
            .ok_or_else(|| missing("child node"))?;
        scene.layers.push(reader.layer(node, DVec3::from_array(t))?);
    }
    Ok(scene)
}

fn split(bytes: &[u8]) -> Result<(Value, &[u8]), GlbError> {
    let bad = |what: &str| GlbError::Container(what.to_owned());
    let word = |at: usize| -> Option<usize> {
        let four: [u8; 4] = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(four) as usize)
    };
    if bytes.get(..4) != Some(b"glTF") {
        return Err(bad("it does not begin with `glTF`"));
    }
    let length = word(12).ok_or_else(|| bad("the header is cut short"))?;
    let text = bytes
        .get(20..20usize.saturating_add(length))
        .ok_or_else(|| bad("the JSON chunk is cut short"))?;
    let document = serde_json::from_slice(text).map_err(|e| GlbError::Container(e.to_string()))?;
    let start = 20 + length;
    let binary = match word(start) {
        None => &[][..],
        Some(n) => bytes
            .get(start + 8..(start + 8).saturating_add(n))
            .ok_or_else(|| bad("the binary chunk is cut short"))?,
    };
    Ok((document, binary))
}

struct Reader<'a> {
    document: &'a Value,
    binary: &'a [u8],
}

impl Reader<'_> {
    fn data(&self, accessor: &Value) -> Result<&[u8], GlbError> {
        let missing = || GlbError::Content("accessor".to_owned());
        let index = |v: &Value| v.as_u64().map(|i| i as usize);
        let accessor = &self.document["accessors"][index(accessor).ok_or_else(missing)?];
        let view = &self.document["bufferViews"][index(&accessor["bufferView"]).ok_or_else(missing)?];
        let offset = index(&view["byteOffset"]).ok_or_else(missing)?;
        let length = index(&view["byteLength"]).ok_or_else(missing)?;
        self.binary
            .get(offset..offset.saturating_add(length))
            .ok_or_else(missing)
    }

    fn floats(&self, accessor: &Value) -> Result<Vec<f32>, GlbError> {
        let words = self.data(accessor)?.chunks_exact(4);
        Ok(words
            .map(|w| f32::from_le_bytes([w[0], w[1], w[2], w[3]]))
            .collect())
    }

    fn layer(&self, node: &Value, centre: DVec3) -> Result<Layer, GlbError> {
        let missing = |what: &str| GlbError::Content(what.to_owned());
        let name = node["name"].as_str().ok_or_else(|| missing("node name"))?;
        let extras: Extras =
            serde_json::from_value(node["extras"].clone()).map_err(|_| missing("node extras"))?;
        let mesh_index = node["mesh"].as_u64().ok_or_else(|| missing("mesh"))? as usize;
        let primitive = &self.document["meshes"][mesh_index]["primitives"][0];
        let points: Vec<DVec3> = self
            .floats(&primitive["attributes"]["POSITION"])?
            .chunks_exact(3)
            .map(|p| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])) + centre)
            .collect();
        let indices = self.data(&primitive["indices"])?.chunks_exact(4);
        let indices: Vec<u32> = indices
            .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]))
            .collect();
        if indices.iter().any(|i| *i as usize >= points.len()) {
            return Err(missing("indices"));
        }
        let quantity = match extras.quantity {
            None => None,
            Some(q) => Some(Quantity {
                values: self.floats(&primitive["attributes"][&q.attribute])?,
                name: q.name,
                unit: q.unit,
                range: q.range,
                scale: q.scale,
            }),
        };
        if quantity.as_ref().is_some_and(|q| q.values.len() != points.len()) {
            return Err(missing("quantity"));
        }
        Ok(Layer {
            name: name.to_owned(),
            kind: extras.kind,
            shape: extras.shape,
            mesh: TriangleMesh {
                points,
                triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            },
            colour: extras.colour,
            quantity,
            properties: extras.properties,
            visible: extras.visible,
        })
    }
}
