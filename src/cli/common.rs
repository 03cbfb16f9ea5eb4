//! Options that every command understands, and what they mean once checked.

use super::Failure;
use clap::{Args, ValueEnum};
use medial_scaffold::fine_scaffold;
use medial_scaffold::geometry::Length;
use medial_scaffold::input::repair::{RepairSettings, repair};
use medial_scaffold::input::{self, Geometry, ReadSettings, Shape, read_shape};
use medial_scaffold::pipeline::ScaffoldSettings;
use medial_scaffold::segregation::{SegregationSettings, mend};
use serde::Serialize;
use std::path::Path;

/// Units of the coordinates in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Millimetres.
    Mm,
    /// Micrometres.
    Um,
    /// Metres.
    M,
}

/// Frame of the coordinates in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// x to the patient's left, y to the back, z to the head.
    Lps,
    /// x to the patient's right, y to the front, z to the head.
    Ras,
}

/// Which side of the surface the scaffold is taken of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Inside the shape: thickness, ridges, matching.
    #[default]
    Interior,
    /// Outside, as far as no large ball reaches: valleys and gaps.
    Exterior,
    /// Both.
    Both,
}

/// Options of every command.
#[derive(Clone, Debug, Args, Serialize)]
pub struct Common {
    /// Units of the input files; files that state theirs are believed unless this is given, the rest is mm.
    #[arg(long, value_enum, global = true, help_heading = "Input")]
    pub units: Option<Units>,

    /// Frame of the input files; files that state theirs are believed unless this is given.
    #[arg(long, value_enum, global = true, help_heading = "Input")]
    pub frame: Option<Frame>,

    /// Label to take from a segmentation mask with several.
    #[arg(long, value_name = "N", global = true, help_heading = "Input")]
    pub label: Option<i32>,

    /// Mend meshes before use: join equal points, drop useless faces, turn faces outward, take apart what touches itself in
    /// an edge, close holes; what was changed is listed.
    #[arg(long, global = true, help_heading = "Input")]
    pub repair: bool,

    /// Spacing at which a known surface is sampled: 0.5mm, 1%diag.
    #[arg(long, value_name = "LEN", global = true, help_heading = "Method")]
    pub spacing: Option<Length>,

    /// How much the shape may change when its scaffold is simplified: 0.5mm, 1%diag, 1.5x-spacing, 0.3radius [default: 1%diag; of a
    /// mask at least half its largest voxel edge].
    #[arg(long, value_name = "LEN", global = true, help_heading = "Method")]
    pub tolerance: Option<Length>,

    /// Side of the surface the scaffold is taken of; an open surface has both, joined.
    #[arg(
        long,
        value_enum,
        default_value = "interior",
        global = true,
        help_heading = "Method"
    )]
    pub side: Side,

    /// Threads to use, 0 for all; results do not depend on it.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        global = true,
        help_heading = "Method"
    )]
    pub threads: usize,

    /// Seed of every random choice.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        global = true,
        help_heading = "Method"
    )]
    pub seed: u64,

    /// Write the result as JSON to stdout.
    #[arg(long, global = true, help_heading = "Output")]
    pub json: bool,

    /// Do not write the HTML report.
    #[arg(long, global = true, help_heading = "Output")]
    pub no_report: bool,

    /// Say less (no progress, no warnings).
    #[arg(short, long, global = true, help_heading = "Output")]
    pub quiet: bool,

    /// Say more; twice for debugging.
    #[arg(short, long, action = clap::ArgAction::Count, global = true, help_heading = "Output")]
    #[serde(skip)]
    pub verbose: u8,
}

impl Side {
    /// The sides to work on.
    pub fn sides(self) -> &'static [fine_scaffold::Side] {
        match self {
            Side::Interior => &[fine_scaffold::Side::Interior],
            Side::Exterior => &[fine_scaffold::Side::Exterior],
            Side::Both => &[fine_scaffold::Side::Interior, fine_scaffold::Side::Exterior],
        }
    }
}

impl Common {
    /// Reads a shape as these options say.
    pub fn read(&self, path: &Path) -> Result<Shape, Failure> {
        let mut shape = self.read_faces(path)?;
        if let (true, Geometry::Mesh(mesh)) = (self.repair, &mut shape.geometry) {
            let settings = SegregationSettings {
                seed: self.seed,
                ..SegregationSettings::default()
            };
            let mended = mend(mesh, &settings)?;
            shape.warnings.extend(mended.warnings());
            *mesh = mended.mesh;
        }
        Ok(shape)
    }

    /// As [`Self::read`]; `--repair` mends points and faces only and leaves holes as they are.
    pub fn read_faces(&self, path: &Path) -> Result<Shape, Failure> {
        let settings = ReadSettings {
            units: self.units.map(|u| match u {
                Units::Mm => input::Units::Mm,
                Units::Um => input::Units::Um,
                Units::M => input::Units::M,
            }),
            frame: self.frame.map(|f| match f {
                Frame::Lps => input::Frame::Lps,
                Frame::Ras => input::Frame::Ras,
            }),
            label: self.label,
            ..ReadSettings::default()
        };
        let mut shape = read_shape(path, &settings)?;
        if let (true, Geometry::Mesh(mesh)) = (self.repair, &mut shape.geometry) {
            let repaired = repair(mesh, &RepairSettings::default());
            *mesh = repaired.mesh;
            shape.warnings.extend(
                repaired
                    .changes
                    .lines()
                    .into_iter()
                    .map(|line| format!("repaired: {line}")),
            );
        }
        Ok(shape)
    }

    /// Settings of every stage for one side, as these options say.
    pub fn scaffold_settings(&self, side: fine_scaffold::Side) -> ScaffoldSettings {
        let mut settings = ScaffoldSettings {
            side,
            ..ScaffoldSettings::default()
        };
        match self.tolerance {
            Some(tolerance) => settings.regularise.tolerance = tolerance,
            None => settings.least_tolerance_vox = 0.5,
        }
        settings.sampling.seed = self.seed;
        settings.sampling.label = self.label;
        settings.cloud.seed = self.seed;
        if let Some(spacing) = self.spacing {
            settings.sampling.spacing = Some(spacing);
        }
        settings
    }
}
