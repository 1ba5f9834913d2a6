//! `pathloom study`.

use super::input::DeviceArguments;
use super::{Failure, print, print_json, progress, say, tune};
use clap::Args;
use indicatif::ProgressBar;
use runtime::error::Error;
use runtime::render::Progress;
use runtime::settings::Target;
use runtime::study::results::{FILE, TABLE};
use runtime::study::run::REPORT;
use runtime::study::{Observer, Outcome, Study, run as run_study};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Pictures that the folder already holds are not rendered again: an interrupted study goes on where it stopped.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// A study file, or a shipped study by name
    #[arg(value_name = "STUDY.toml|NAME", required_unless_present = "tune", conflicts_with = "tune")]
    study: Option<String>,
    #[command(flatten)]
    pub tuning: tune::Arguments,
    #[command(flatten)]
    pub device: DeviceArguments,
    /// The folder to write to; named after the study when not given, `tuned` with --tune
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// Runs the study and says where its results are.
///
/// # Errors
/// User input, failed devices.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Some(study) = &arguments.study else { return tune::run(arguments) };
    let mut study = Study::load(study)?;
    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from(&study.name));
    check_folder(&folder)?;
    let gpu = arguments.device.open()?;
    study.target = Target::of(&gpu);
    progress::catch_interrupts()?;
    let outcome = run_study(&study, &folder, &gpu, &mut Terminal { bar: ProgressBar::hidden() })?;
    if outcome.stopped {
        say("stopped; the same command goes on with what is left");
    }
    let files = [FILE, TABLE, REPORT].map(|name| folder.join(name).display().to_string());
    if arguments.json {
        print_json(&summary(&outcome, &files))?
    } else {
        print(&text(&outcome, &files))?
    }
    Ok(())
}

/// Better now than after hours of rendering.
///
/// # Errors
/// User input, when a file is in the way.
pub fn check_folder(folder: &Path) -> Result<(), Error> {
    match folder.ancestors().find(|ancestor| ancestor.exists()).filter(|found| !found.is_dir()) {
        Some(file) => Err(Error::input(format!("the output `{}` cannot be put into a file", folder.display()))
            .help(format!("`{}` is not a folder", file.display()))),
        None => Ok(()),
    }
}

fn summary(outcome: &Outcome, files: &[String]) -> serde_json::Value {
    let results = &outcome.results;
    json!({
        "title": results.title,
        "pictures": results.runs.len(),
        "rendered": outcome.rendered,
        "stopped": outcome.stopped,
        "skipped": results.skipped.iter().map(|skipped| &skipped.scene).collect::<Vec<_>>(),
        "outputs": files,
    })
}

fn text(outcome: &Outcome, files: &[String]) -> String {
    let pictures = outcome.results.runs.len();
    let written: Vec<String> = files.iter().map(|file| format!("written       {file}")).collect();
    format!("pictures      {pictures}; {} rendered now, references included\n{}", outcome.rendered, written.join("\n"))
}

/// Shows renders one after the other.
struct Terminal {
    bar: ProgressBar,
}

impl Observer for Terminal {
    fn begin(&mut self, what: &str) -> bool {
        self.bar = progress::bar();
        self.bar.println(what);
        !progress::interrupted()
    }

    fn show(&mut self, state: &Progress) -> bool {
        progress::show(&self.bar, state);
        !progress::interrupted()
    }

    fn end(&mut self) {
        self.bar.finish_and_clear();
    }

    fn note(&mut self, line: &str) {
        self.bar.suspend(|| say(line));
    }
}
