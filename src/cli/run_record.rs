//! `run.json`: everything needed to do a run again, and what it cost.

use super::Failure;
use super::common::Common;
use serde::Serialize;
use std::path::Path;

use medial_scaffold::input::Provenance;
use medial_scaffold::pipeline::StageTime;

/// The record written beside every result.
#[derive(Debug, Serialize)]
pub struct RunRecord {
    /// Version of the program.
    pub version: &'static str,
    /// The command line, word by word.
    pub command: Vec<String>,
    /// Every setting with defaults filled in.
    pub settings: serde_json::Value,
    /// Input files with their hashes, frames and units.
    pub inputs: Vec<Provenance>,
    /// Seed of every random choice.
    pub seed: u64,
    /// Threads at work.
    pub threads: usize,
    /// Seconds by stage.
    pub stages: Vec<StageTime>,
    /// Peak resident memory of the process, where the system tells.
    pub peak_memory_bytes: Option<u64>,
    /// What a user should know.
    pub warnings: Vec<String>,
}

#[derive(Serialize)]
struct Settings<'a, S> {
    options: &'a Common,
    stages: &'a S,
}

impl RunRecord {
    /// A record of this process; stages, inputs and warnings are the caller's to give.
    pub fn new<S: Serialize>(common: &Common, settings: &S) -> Result<Self, Failure> {
        Ok(Self {
            version: env!("CARGO_PKG_VERSION"),
            command: std::env::args().collect(),
            settings: serde_json::to_value(Settings {
                options: common,
                stages: settings,
            })?,
            inputs: Vec::new(),
            seed: common.seed,
            threads: rayon::current_num_threads(),
            stages: Vec::new(),
            peak_memory_bytes: None,
            warnings: Vec::new(),
        })
    }

    /// Writes `run.json` into `dir`, with the peak memory as of now.
    pub fn write(&mut self, dir: &Path) -> Result<(), Failure> {
        self.peak_memory_bytes = peak_memory_bytes();
        Ok(medial_scaffold::reports::write_json(&dir.join("run.json"), self)?)
    }
}

/// Peak resident memory by `/proc/self/status`; `None` on systems without it.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
