//! Results as files that people and other programs open.
//!
//! In: what the stages made. Out, in the order of this list:
//! - [`atomic`]: every file is written whole, under a temporary name, then renamed;
//! - [`mesh_files`]: PLY with fields, STL, OBJ, OFF;
//! - [`vtp`]: sheets and curves for ParaView and 3D Slicer;
//! - [`medial_files`]: `fine.ma`, ITK transforms, CSV tables;
//! - [`colour`], [`scene`], [`glb`]: what is shown in 3D, as layers and as binary glTF;
//! - [`still`], [`plot`]: pictures without a GPU, plots as SVG;
//! - [`page`]: one offline HTML page with viewer, tables and data inside;
//! - [`facts`], [`mod@scaffold_report`], [`mod@match_report`], [`mod@change_report`]: the pages of the commands, from their JSON;
//! - [`tables`]: the tables of a page as CSV files;
//! - [`mod@rebuild`]: a page again from the files of a run.
//!
//! Coordinates are LPS mm in every file, and every format that can say so does. Bytes depend on the data alone.

pub mod atomic;
pub mod change_report;
pub mod colour;
pub mod facts;
pub mod glb;
pub mod match_report;
pub mod medial_files;
pub mod mesh_files;
pub mod page;
pub mod plot;
pub mod rebuild;
pub mod scaffold_report;
pub mod scene;
pub mod still;
pub mod tables;
pub mod vtp;

pub use atomic::{WriteError, write_atomically, write_bytes, write_json};
pub use change_report::{change_report, change_scene, write_growth};
pub use glb::{glb_bytes, scene_from_glb};
pub use match_report::match_report;
pub use medial_files::{MedialMesh, write_csv, write_ma, write_tfm};
pub use mesh_files::{
    FieldValues, PlyEncoding, VertexField, write_mesh, write_obj, write_off, write_ply, write_stl,
};
pub use page::{Cell, KeyFigure, NoteLevel, Plot, Report, ReportError, Section, Table};
pub use rebuild::rebuild;
pub use scaffold_report::scaffold_report;
pub use scene::{CorrespondenceLine, Layer, LayerKind, Quantity, Scene};
pub use still::View;
pub use tables::write_tables;
pub use vtp::{PolyData, curves_polydata, sheets_polydata, write_vtp};
