//! Progress on stderr: a bar when stderr is a terminal and the user did not ask for quiet, nothing otherwise.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;

/// A spinner that names the stage at work.
pub struct Progress {
    bar: Option<ProgressBar>,
}

impl Progress {
    /// A new spinner; silent when `quiet` or when stderr is no terminal.
    pub fn new(quiet: bool) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self { bar: None };
        }
        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} [{elapsed}]") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar: Some(bar) }
    }

    /// Names the stage at work.
    pub fn stage(&self, name: &str) {
        tracing::debug!(stage = name, "start");
        if let Some(bar) = &self.bar {
            bar.set_message(name.to_owned());
        }
    }

    /// Takes the spinner away.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}
