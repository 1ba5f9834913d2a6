//! `pathloom check`.

use super::input;
use super::{Failure, colour, print, print_json, say};
use clap::Args;
use kernelgen::Refusal;
use kernelgen::config::model::{Effects, Selection};
use kernelgen::source::FileKind;
use rayon::prelude::*;
use runtime::configs::{Axis, Library};
use runtime::error::Error;
use runtime::settings::{RenderFile, Target};
use runtime::study::Study;
use serde_json::json;
use std::path::Path;

/// Generates every combination of the shipped configs, or of the named files with all shipped configs of the other axes, for a
/// scene with every effect and for the shipped Cornell box. A layout with tables or a placement by hand, which name the
/// instances or fields of one pipeline, need only fit one.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// Configs to check; all shipped ones when not given
    #[arg(value_name = "FILES")]
    files: Vec<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// A combination to be checked.
struct Case {
    selection: Selection,
    scene: &'static str,
    placed: bool,
}

/// What came of it.
struct Outcome<'a> {
    case: &'a Case,
    refusal: Option<Refusal>,
}

/// Checks and lists.
///
/// # Errors
/// User input, when a config is refused.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut library = Library::default();
    let scenes =
        [("every effect", input::every_effect()?), ("cornell_box", input::load_scene(&RenderFile::default())?.effects)];
    let cases = cases(&mut library, &arguments.files, &scenes)?;
    let outcomes: Vec<Outcome> = cases
        .par_iter()
        .map(|case| Outcome { case, refusal: kernelgen::generate(&library.sources, &case.selection).err() })
        .collect();
    let failed: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.fails(&outcomes)).collect();
    for outcome in &failed {
        say(&format!("{}:", outcome.case.title()));
        if let Some(refusal) = &outcome.refusal {
            say(refusal.render(colour()).trim_end());
        }
    }
    if arguments.json {
        print_json(&json!({
            "checked": outcomes.len(),
            "failed": failed.len(),
            "configs": outcomes.iter().map(|outcome| outcome.json(&outcomes)).collect::<Vec<_>>(),
        }))?;
    } else {
        let lines: Vec<String> =
            outcomes.iter().map(|outcome| format!("{:<8} {}", outcome.word(&outcomes), outcome.case.title())).collect();
        print(&format!("{}\n{} checked, {} failed", lines.join("\n"), outcomes.len(), failed.len()))?;
    }
    if failed.is_empty() {
        Ok(())
    } else {
        Err(Error::input(format!("{} of {} combinations are refused", failed.len(), outcomes.len())).into())
    }
}

impl Case {
    fn title(&self) -> String {
        let selection = &self.selection;
        let axes =
            [&selection.pipeline, &selection.layout, &selection.schedule, &selection.precision].map(|key| stem(key));
        let set: String = selection.set.iter().map(|(key, value)| format!(", {key}={value}")).collect();
        format!("{}{set} ({})", axes.join(" x "), self.scene)
    }
}

impl Outcome<'_> {
    /// Refused, and not just because a placement by hand belongs to another pipeline.
    fn fails(&self, all: &[Outcome]) -> bool {
        self.refusal.is_some() && !self.fits_elsewhere(all)
    }

    fn fits_elsewhere(&self, all: &[Outcome]) -> bool {
        let about_layout = self
            .refusal
            .iter()
            .flat_map(|refusal| &refusal.diagnostics)
            .all(|diagnostic| diagnostic.code.starts_with("K04"));
        let same = |other: &&Outcome| {
            other.case.selection.layout == self.case.selection.layout && other.case.scene == self.case.scene
        };
        self.case.placed && about_layout && all.iter().filter(same).any(|other| other.refusal.is_none())
    }

    fn word(&self, all: &[Outcome]) -> &'static str {
        match (&self.refusal, self.fits_elsewhere(all)) {
            (None, _) => "ok",
            (Some(_), true) => "no fit",
            (Some(_), false) => "refused",
        }
    }

    fn json(&self, all: &[Outcome]) -> serde_json::Value {
        let selection = &self.case.selection;
        let codes: Vec<_> =
            self.refusal.iter().flat_map(|refusal| &refusal.diagnostics).map(|diagnostic| diagnostic.code).collect();
        json!({
            "pipeline": stem(&selection.pipeline),
            "layout": stem(&selection.layout),
            "schedule": stem(&selection.schedule),
            "precision": stem(&selection.precision),
            "scene": self.case.scene,
            "result": self.word(all),
            "codes": codes,
        })
    }
}

fn stem(key: &str) -> &str {
    let name = key.rsplit_once('/').map_or(key, |(_, name)| name);
    name.strip_suffix(".toml").unwrap_or(name)
}

fn cases(library: &mut Library, files: &[String], scenes: &[(&'static str, Effects)]) -> Result<Vec<Case>, Error> {
    let selections = if files.is_empty() {
        let mut all = product(library, None);
        for name in Axis::Render.names() {
            let text = Axis::Render.shipped(name).unwrap_or_default();
            all.push(render(library, RenderFile::parse(text, &format!("configs/renders/{name}.toml"))?)?);
        }
        for name in Axis::Study.names() {
            let new = study(library, &Study::load(name)?)?;
            all.extend(new.into_iter().filter(|selection| !all.contains(selection)).collect::<Vec<_>>());
        }
        all
    } else {
        let mut all = Vec::new();
        for file in files {
            all.extend(of_file(library, file)?);
        }
        all
    };
    let placed: Vec<bool> = selections.iter().map(|selection| is_placed(library, &selection.layout)).collect();
    let with_scenes = selections.iter().zip(placed).flat_map(|(selection, placed)| {
        scenes.iter().map(move |(scene, effects)| Case {
            selection: Selection { effects: effects.clone(), ..selection.clone() },
            scene,
            placed,
        })
    });
    Ok(with_scenes.collect())
}

fn of_file(library: &mut Library, file: &str) -> Result<Vec<Selection>, Error> {
    let path = Path::new(file);
    let text = std::fs::read_to_string(path)
        .map_err(|error| Error::input(format!("cannot read the file: {error}")).in_file(path))?;
    let axis = axis_of(path, &text);
    if axis == Axis::Render {
        let mut settings = RenderFile::parse(&text, file)?;
        settings.relative_to(path.parent().unwrap_or(Path::new("")));
        return Ok(vec![render(library, settings)?]);
    }
    // A bare `my.toml` is a file here, never a name.
    let word = if file.contains('/') { file.to_owned() } else { format!("./{file}") };
    if axis == Axis::Study {
        return study(library, &Study::load(&word)?);
    }
    let key = library.resolve(axis, &word)?;
    Ok(product(library, Some((axis, key))))
}

/// The axis of a file by its tables, or by its folder when it only extends another.
fn axis_of(path: &Path, text: &str) -> Axis {
    let table = text.parse::<toml::Table>().unwrap_or_default();
    let by_table = [("layout", Axis::Layout), ("schedule", Axis::Schedule), ("precision", Axis::Precision)];
    if table.get("pipeline").is_some_and(toml::Value::is_str) {
        return Axis::Render;
    }
    if table.get("variant").is_some_and(toml::Value::is_array) || table.contains_key("axes") {
        return Axis::Study;
    }
    if let Some((_, axis)) = by_table.iter().find(|(key, _)| table.get(*key).is_some_and(toml::Value::is_table)) {
        return *axis;
    }
    let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
    Axis::VARIANT.into_iter().find(|axis| folder == axis.folder()).unwrap_or(Axis::Pipeline)
}

/// What a study renders, once each.
fn study(library: &mut Library, study: &Study) -> Result<Vec<Selection>, Error> {
    let mut all = Vec::new();
    for scene in &study.scenes {
        for variant in &study.variants {
            let selection = study.wanted(variant, scene)?.settings.selection(library, Effects::new())?;
            if !all.contains(&selection) {
                all.push(selection);
            }
        }
    }
    Ok(all)
}

fn render(library: &mut Library, settings: RenderFile) -> Result<Selection, Error> {
    settings.with_defaults(Target::Gpu).selection(library, Effects::new())
}

/// All combinations, one axis fixed if asked for. Pipelines without a `start` are there to be extended and left out.
fn product(library: &Library, fixed: Option<(Axis, String)>) -> Vec<Selection> {
    let keys = Axis::VARIANT.map(|axis| match &fixed {
        Some((of, key)) if *of == axis => vec![key.clone()],
        _ => axis.names().iter().map(|name| format!("{}/{name}.toml", axis.folder())).collect(),
    });
    let [pipelines, layouts, schedules, precisions] = keys;
    let given = |key: &String| fixed.as_ref().is_some_and(|(_, fixed)| fixed == key);
    let mut all = Vec::new();
    for pipeline in
        pipelines.iter().filter(|key| given(key) || any_in_chain(library, key, &|table| table.contains_key("start")))
    {
        for layout in &layouts {
            for schedule in &schedules {
                for precision in &precisions {
                    all.push(Selection {
                        pipeline: pipeline.clone(),
                        layout: layout.clone(),
                        schedule: schedule.clone(),
                        precision: precision.clone(),
                        ..Selection::default()
                    });
                }
            }
        }
    }
    all
}

/// Whether a layout names fields or instances, which are those of one pipeline.
fn is_placed(library: &Library, layout: &str) -> bool {
    let places = |table: &toml::Table| {
        let layout = table.get("layout");
        let rows = layout.and_then(|layout| layout.get("place")).and_then(toml::Value::as_array);
        let tables = layout.and_then(|layout| layout.get("tables")).and_then(toml::Value::as_table);
        rows.is_some_and(|rows| !rows.is_empty()) || tables.is_some_and(|tables| !tables.is_empty())
    };
    any_in_chain(library, layout, &places)
}

/// Whether a config, or one that it extends, passes a test.
fn any_in_chain(library: &Library, key: &str, test: &dyn Fn(&toml::Table) -> bool) -> bool {
    let mut open = vec![key.to_owned()];
    let mut seen = Vec::new();
    while let Some(key) = open.pop() {
        let Some(file) = library.sources.find(FileKind::Config, &key) else { continue };
        let text = &library.sources.file(file).text;
        if text.parse::<toml::Table>().is_ok_and(|table| test(&table)) {
            return true;
        }
        let bases = runtime::configs::extends(text).into_iter().map(|base| runtime::configs::join(&key, &base));
        seen.push(key.clone());
        open.extend(bases.filter(|base| !seen.contains(base)));
    }
    false
}
