//! The subcommands of `pathloom`: arguments, dispatch, exit codes.

mod check;
mod compare;
mod emit;
mod explain;
mod info;
mod input;
mod progress;
mod render;
mod study;
mod summary;
mod tune;

use clap::{Parser, Subcommand};
use runtime::error::Error;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

/// Generates wavefront light-transport kernels from a description, and renders with them.
#[derive(Debug, Parser)]
#[command(name = "pathloom", version, arg_required_else_help = true, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Renders a scene to an EXR file and a PNG beside it
    Render(render::Arguments),
    /// Writes the generated WGSL kernels, the layout and the plan of a variant
    Emit(emit::Arguments),
    /// Shows where fields live, what kernels read and write, which effects are kept, and why
    Explain(explain::Arguments),
    /// Generates and validates every config, or the named ones; needs no GPU
    Check(check::Arguments),
    /// Renders every variant of a study on every scene, and reports what they cost and how far off they are; or tunes for a scene
    Study(study::Arguments),
    /// Measures how far two images are apart
    Compare(compare::Arguments),
    /// Lists adapters with limits and features, or what is in a scene
    Info(info::Arguments),
}

/// Why a subcommand stopped.
#[derive(Debug)]
pub enum Failure {
    /// A message.
    Error(Error),
    /// Diagnostics of the generator, already rendered: the user's input is wrong.
    Refused(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::Error(error)
    }
}

/// Runs the command line; 0 done, 1 the work failed, 2 the user's input is wrong.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Emit(arguments) => emit::run(&arguments),
        Command::Explain(arguments) => explain::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Study(arguments) => study::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Info(arguments) => info::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Refused(text)) => {
            say(text.trim_end());
            ExitCode::from(2)
        }
        Err(Failure::Error(error)) => {
            let (bold, plain) = if colour() { ("\u{1b}[1;31m", "\u{1b}[0m") } else { ("", "") };
            say(&format!("{bold}error{plain}: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// A line for the user, on stderr; lost when nobody listens.
pub fn say(line: &str) {
    drop(writeln!(std::io::stderr().lock(), "{line}"));
}

/// A warning, on stderr.
pub fn warn(message: &str) {
    let (bold, plain) = if colour() { ("\u{1b}[1;33m", "\u{1b}[0m") } else { ("", "") };
    say(&format!("{bold}warning{plain}: {message}"));
}

/// Results, on stdout.
///
/// # Errors
/// Failed, when stdout cannot be written; a reader that went away (`| head`) is no failure.
pub fn print(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::failed(format!("cannot write the results: {error}")))
        }
        _ => Ok(()),
    }
}

/// One JSON object, on stdout.
///
/// # Errors
/// Failed, when stdout cannot be written.
pub fn print_json(value: &serde_json::Value) -> Result<(), Error> {
    print(&format!("{value:#}"))
}

/// Whether messages are coloured: on a terminal, unless `NO_COLOR` is set.
pub fn colour() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}
