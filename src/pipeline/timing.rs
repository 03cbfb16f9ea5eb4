//! Seconds by stage, and word to whoever watches.

use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Wall-clock seconds of one stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// Name of the stage, the word its module has.
    pub name: String,
    /// Seconds.
    pub seconds: f64,
}

/// Told the name of each stage as it starts; a progress bar, or nothing.
pub type Observer<'a> = &'a (dyn Fn(&str) + Sync);

/// Runs stages, tells the observer and keeps the times.
pub struct Stages<'a> {
    observer: Observer<'a>,
    prefix: String,
    times: Vec<StageTime>,
}

impl<'a> Stages<'a> {
    /// No stage run yet. `prefix` names the shape where a command works on several ("target ", or empty).
    pub fn new(observer: Observer<'a>, prefix: &str) -> Self {
        Self {
            observer,
            prefix: prefix.to_owned(),
            times: Vec::new(),
        }
    }

    /// Runs one stage.
    pub fn run<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let name = format!("{}{name}", self.prefix);
        (self.observer)(&name);
        let start = Instant::now();
        let result = work();
        self.times.push(StageTime {
            name,
            seconds: start.elapsed().as_secs_f64(),
        });
        result
    }

    /// The times so far.
    pub fn into_times(self) -> Vec<StageTime> {
        self.times
    }
}
