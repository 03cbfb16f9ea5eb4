//! The command line: parse, check, run, exit.
//!
//! stdout carries results only; progress, log and messages go to stderr. Exit 0: fine. 1: ran, but a check or some case
//! said no. 2: usage or input error.

mod common;
mod output;
mod progress;
mod run_record;

mod change;
mod check;
mod demo;
mod match_command;
mod mesh;
mod names;
mod report;
mod scaffold;
mod synth;

use clap::{Parser, Subcommand};
use common::Common;
use std::process::ExitCode;

/// The medial scaffold of anatomical shapes: skeletons, thickness, matching and volume change from point clouds, meshes and
/// segmentation masks.
#[derive(Debug, Parser)]
#[command(name = "medial", version, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    common: Common,

    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make two carpal-like bones, match them and report: no input needed.
    Demo(demo::DemoArgs),
    /// What is in a file, in which frame and units, and what it can be used for; exit 1 if for nothing.
    Check(check::CheckArgs),
    /// Surface mesh of a point cloud, by segregation.
    Mesh(mesh::MeshArgs),
    /// Scaffold of one shape.
    Scaffold(scaffold::ScaffoldArgs),
    /// Correspondences, rigid transform and shape difference of two shapes.
    Match(match_command::MatchArgs),
    /// How much lesions grew between two dates, where, and whether that is more than the measurement's error.
    Change(change::ChangeArgs),
    /// Synthetic shapes, populations and deformations with truth.json.
    Synth(synth::SynthArgs),
    /// The page of a result folder, made again from its JSON.
    Report(report::ReportArgs),
}

/// Why a command did not end well: the message, what to do about it, and the exit code.
#[derive(Debug)]
pub struct Failure {
    message: String,
    code: u8,
}

impl Failure {
    /// A usage or input error, exit 2.
    pub fn usage(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            code: 2,
        }
    }
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        let mut message = error.to_string();
        let mut cause = error.source();
        while let Some(e) = cause {
            let text = e.to_string();
            // Wrappers often repeat their source; say each thing once.
            if !message.contains(&text) {
                message = format!("{message}: {text}");
            }
            cause = e.source();
        }
        Self::usage(message)
    }
}

/// How a command that ran to its end ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Exit 0.
    Fine,
    /// Ran, but a check or some case said no: exit 1.
    SaidNo,
}

/// Parses the command line, runs it and gives the exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    start_log(&cli.common);
    if let Err(e) = rayon::ThreadPoolBuilder::new()
        .num_threads(cli.common.threads)
        .build_global()
    {
        eprintln!("error: cannot start {} threads: {e}", cli.common.threads);
        return ExitCode::from(2);
    }
    let common = &cli.common;
    let done = match &cli.command {
        Command::Check(args) => check::run(args, common),
        Command::Mesh(args) => mesh::run(args, common),
        Command::Scaffold(args) => scaffold::run(args, common),
        Command::Match(args) => match_command::run(args, common),
        Command::Demo(args) => demo::run(args, common),
        Command::Change(args) => change::run(args, common),
        Command::Synth(args) => synth::run(args, common),
        Command::Report(args) => report::run(args, common),
    };
    match done {
        Ok(Verdict::Fine) => ExitCode::SUCCESS,
        Ok(Verdict::SaidNo) => ExitCode::from(1),
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            ExitCode::from(failure.code)
        }
    }
}

fn start_log(common: &Common) {
    let level = match (common.quiet, common.verbose) {
        (true, _) => "error",
        (_, 0) => "warn",
        (_, 1) => "info",
        _ => "debug",
    };
    // MEDIAL_LOG takes the usual filter syntax for whoever debugs one module.
    let filter = tracing_subscriber::EnvFilter::try_from_env("MEDIAL_LOG").unwrap_or_else(|_| level.into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .without_time()
        .init();
}

/// Prints warnings to stderr unless the user asked for quiet.
fn warn_all(common: &Common, warnings: &[String]) {
    if !common.quiet {
        for warning in warnings {
            eprintln!("warning: {warning}");
        }
    }
}
