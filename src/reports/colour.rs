//! Colours: perceptually even scales for quantities and well-separated hues for components.
//!
//! Viridis (Smith & van der Walt 2015, CC0) for one-sided quantities, a blue-white-red scale (after Moreland 2009) for
//! signed ones, and a palette of twelve hues chosen to stay apart for the common colour-vision deficiencies as far as twelve
//! hues can. All values are sRGB.

use serde::{Deserialize, Serialize};

/// An sRGB colour with opacity, each 0 to 1.
pub type Rgba = [f32; 4];

/// How a quantity becomes a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColourScale {
    /// Dark violet to yellow, for quantities from small to large.
    Viridis,
    /// Blue through near-white to red, for signed quantities; the middle is zero.
    BlueWhiteRed,
}

const VIRIDIS: [[u8; 3]; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x24, 0x75],
    [0x41, 0x44, 0x87],
    [0x35, 0x5f, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x44, 0xbf, 0x70],
    [0x7a, 0xd1, 0x51],
    [0xbd, 0xdf, 0x26],
    [0xfd, 0xe7, 0x25],
];

const BLUE_WHITE_RED: [[u8; 3]; 9] = [
    [0x21, 0x66, 0xac],
    [0x43, 0x93, 0xc3],
    [0x92, 0xc5, 0xde],
    [0xd1, 0xe5, 0xf0],
    [0xf7, 0xf7, 0xf7],
    [0xfd, 0xdb, 0xc7],
    [0xf4, 0xa5, 0x82],
    [0xd6, 0x60, 0x4d],
    [0xb2, 0x18, 0x2b],
];

/// Hues of components; component `i` takes hue `i` modulo twelve.
const PALETTE: [[u8; 3]; 12] = [
    [0xe0, 0x9f, 0x3e],
    [0x3a, 0x86, 0xc8],
    [0x5b, 0xa8, 0x5f],
    [0xb0, 0x6a, 0xb3],
    [0x4f, 0xb3, 0xbf],
    [0xd9, 0x77, 0x57],
    [0x8c, 0x9e, 0x3d],
    [0x6c, 0x7b, 0xc9],
    [0xc7, 0x6d, 0x96],
    [0x9a, 0x7b, 0x5f],
    [0x7f, 0xc2, 0x9b],
    [0xd4, 0xc0, 0x5a],
];

impl ColourScale {
    /// The colour stops, evenly spaced from 0 to 1.
    pub fn stops(self) -> &'static [[u8; 3]] {
        match self {
            ColourScale::Viridis => &VIRIDIS,
            ColourScale::BlueWhiteRed => &BLUE_WHITE_RED,
        }
    }

    /// The colour at `t`, clamped to 0..1; not-a-number is grey.
    pub fn at(self, t: f64) -> [f32; 3] {
        if t.is_nan() {
            return [0.6; 3];
        }
        let stops = self.stops();
        let x = t.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
        let i = (x.floor() as usize).min(stops.len() - 2);
        let f = (x - i as f64) as f32;
        std::array::from_fn(|k| (f32::from(stops[i][k]) * (1.0 - f) + f32::from(stops[i + 1][k]) * f) / 255.0)
    }
}

/// The hue of component `index`.
pub fn component_colour(index: usize) -> Rgba {
    let [r, g, b] = PALETTE[index % PALETTE.len()].map(|x| f32::from(x) / 255.0);
    [r, g, b, 1.0]
}

/// `#rrggbb`.
pub fn hex(colour: [f32; 3]) -> String {
    let [r, g, b] = colour.map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// sRGB to linear light, as glTF wants its colours.
pub fn to_linear(x: f32) -> f32 {
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

/// The colour of axial curves.
pub const AXIAL: Rgba = [0.84, 0.12, 0.16, 1.0];
/// The colour of ribs.
pub const RIB: Rgba = [0.10, 0.32, 0.86, 1.0];
/// The colour of wires.
pub const WIRE: Rgba = [0.48, 0.16, 0.62, 1.0];
/// The colour of seams.
pub const SEAM: Rgba = [0.95, 0.55, 0.05, 1.0];
/// The colour of a surface without a quantity: bone.
pub const BONE: Rgba = [0.90, 0.86, 0.76, 1.0];
/// The colour of a second surface (source, baseline).
pub const SECOND: Rgba = [0.36, 0.62, 0.80, 1.0];
