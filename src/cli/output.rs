//! Where results go: the output directory, and JSON or text on stdout.

use super::Failure;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// Makes the output directory and its parents.
pub fn make_dir(dir: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(dir).map_err(|e| {
        Failure::usage(format!(
            "{}: cannot make the output directory: {e}; choose another with -o",
            dir.display()
        ))
    })
}

/// Prints JSON to stdout; a closed pipe is not an error.
pub fn print_json<T: Serialize + ?Sized>(value: &T) -> Result<(), Failure> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    print_text(&text)
}

/// Prints text to stdout; a closed pipe is not an error.
pub fn print_text(text: &str) -> Result<(), Failure> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::usage(format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}
