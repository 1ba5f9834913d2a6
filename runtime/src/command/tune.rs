//! `pathloom study --tune`.

use super::study::{Arguments as StudyArguments, check_folder};
use super::{Failure, input, print, print_json, progress, say};
use clap::Args;
use runtime::device::Gpu;
use runtime::error::Error;
use runtime::output::make_folder;
use runtime::settings::{RenderFile, SetValue, Target};
use runtime::study::file::file_name;
use runtime::study::results::write_text;
use runtime::study::tune::{Candidate, Search, Tuned, tune};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Where configs go that nobody named a folder for.
const FOLDER: &str = "tuned";

/// What is searched.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// Search layouts and schedules for the fastest on these scenes, instead of a study: writes SCENE.toml, for `pathloom render`
    #[arg(long, value_name = "SCENE", num_args = 1.., requires = "budget", help_heading = "Tuning")]
    tune: Vec<String>,
    /// Time for the search, all scenes together
    #[arg(long, value_name = "SECONDS", value_parser = input::positive, allow_negative_numbers = true, requires = "tune", help_heading = "Tuning")]
    budget: Option<f64>,
    /// Pipeline: name or file; sbdpt when not given
    #[arg(long, value_name = "P", requires = "tune", help_heading = "Tuning")]
    pipeline: Option<String>,
    /// Layouts to search, names or files; all shipped ones that store fields exactly when not given
    #[arg(long, value_name = "L", value_delimiter = ',', requires = "tune", help_heading = "Tuning")]
    layouts: Vec<String>,
    /// Schedules to search, names or files; all shipped ones when not given
    #[arg(long, value_name = "S", value_delimiter = ',', requires = "tune", help_heading = "Tuning")]
    schedules: Vec<String>,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", value_parser = input::size, requires = "tune", help_heading = "Tuning")]
    size: Option<[u32; 2]>,
    /// A pipeline parameter or a key of an axis, such as max_edges=8
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = input::key_value, requires = "tune", help_heading = "Tuning")]
    set: Vec<(String, String)>,
}

/// The best of a scene, and where it was written.
struct Written {
    scene: String,
    tuned: Tuned,
    file: PathBuf,
}

/// Tunes for each scene, writes the winners, prints what was measured.
///
/// # Errors
/// User input, failed devices.
pub fn run(arguments: &StudyArguments) -> Result<(), Failure> {
    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from(FOLDER));
    check_folder(&folder)?;
    let gpu = arguments.device.open()?;
    progress::catch_interrupts()?;
    let mut written = Vec::new();
    for scene in &arguments.tuning.tune {
        written.push(tune_scene(&arguments.tuning, scene, &folder, &gpu)?);
        if progress::interrupted() {
            break;
        }
    }
    if arguments.json {
        print_json(&summary(&written))?
    } else {
        print(&text(&written))?
    }
    Ok(())
}

fn tune_scene(arguments: &Arguments, scene: &str, folder: &Path, gpu: &Gpu) -> Result<Written, Error> {
    let set = arguments.set.iter().map(|(key, value)| (key.clone(), SetValue::Text(value.clone()))).collect();
    let settings = RenderFile {
        pipeline: arguments.pipeline.clone(),
        scene: Some(scene.to_owned()),
        size: arguments.size,
        set,
        ..RenderFile::default()
    };
    let search = Search {
        settings: settings.with_defaults(Target::of(gpu)),
        layouts: arguments.layouts.clone(),
        schedules: arguments.schedules.clone(),
        budget: arguments.budget.unwrap_or_default() / arguments.tune.len() as f64,
    };
    let tuned = tune(&search, gpu, &mut |what| {
        say(&format!("scene `{scene}`, {what}"));
        !progress::interrupted()
    })?;
    let stem = Path::new(scene).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let file = folder.join(file_name(&stem)).with_extension("toml");
    make_folder(folder)?;
    write_text(&file, &tuned.winner.to_toml()?)?;
    Ok(Written { scene: scene.to_owned(), tuned, file })
}

fn summary(written: &[Written]) -> serde_json::Value {
    let scenes = written.iter().map(|written| {
        let Tuned { candidates, winner, seconds } = &written.tuned;
        json!({
            "scene": written.scene,
            "layout": winner.layout,
            "schedule": winner.schedule,
            "seconds": seconds,
            "candidates": candidates,
            "output": written.file.display().to_string(),
        })
    });
    json!({ "scenes": scenes.collect::<Vec<_>>() })
}

fn text(written: &[Written]) -> String {
    let of = |written: &Written| {
        let head = format!("scene {}, {:.1} s", written.scene, written.tuned.seconds);
        let rows = written.tuned.candidates.iter().map(row);
        let file = format!("written       {}", written.file.display());
        let columns = "  ms/Msample  rounds  layout x schedule".to_owned();
        [head, columns].into_iter().chain(rows).chain([file]).collect::<Vec<_>>().join("\n")
    };
    written.iter().map(of).collect::<Vec<_>>().join("\n\n")
}

fn row(candidate: &Candidate) -> String {
    let Candidate { layout, schedule, ms_per_msample, rounds, left_out } = candidate;
    let time = ms_per_msample.map_or(String::new(), |time| format!("{time:.3}"));
    let why = left_out.as_ref().map_or(String::new(), |why| format!(": {why}"));
    format!("{time:>12}  {rounds:>6}  {layout} x {schedule}{why}")
}
