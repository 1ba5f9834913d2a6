//! Configs that must be refused, and what is said about them.
//!
//! A case is `refuse/config/NAME.toml`. Its first lines direct the test:
//!
//! ```text
//! # axis: layouts/soa.toml        the config that this text replaces or adds
//! # set: workgroup=100            a `--set`; any number of them
//! # layout: layouts/none.toml     another choice for an axis
//! ```
//!
//! Each `axis` begins a text; without one only the choices and the `--set` values are wrong. `NAME.stderr` holds the
//! diagnostics as they are printed. `UPDATE_REFUSE=1` writes it anew.

use kernelgen::config::{self, model};
use kernelgen::diagnostic;
use kernelgen::source::{FileKind, Sources};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tests::refuse::{check, files, folder, project};

const FOLDERS: [&str; 4] = ["pipelines", "layouts", "schedules", "precisions"];

/// What the cases see of the real configs: a new file must not change the lists in their diagnostics.
const KNOWN: [&str; 11] = [
    "pipelines/base.toml",
    "pipelines/nee.toml",
    "pipelines/pt.toml",
    "pipelines/lt.toml",
    "layouts/aos.toml",
    "layouts/soa.toml",
    "layouts/aosoa32.toml",
    "layouts/pt_placed.toml",
    "schedules/wavefront.toml",
    "schedules/inline.toml",
    "precisions/f32.toml",
];

#[test]
fn refused_configs_say_why() {
    check(&folder("config"), "toml", 25, refuse);
}

#[test]
fn every_shipped_combination_loads_without_a_word() {
    let sources = real_configs(|_| true);
    for selection in shipped_selections(&sources) {
        let mut sources = sources.clone();
        let findings = match config::load(&mut sources, &selection) {
            Ok((_, warnings)) => warnings,
            Err(errors) => errors,
        };
        assert!(findings.is_empty(), "{}", diagnostic::render(&findings, &sources, false));
    }
}

/// Layouts that place fields by hand, and the pipelines that have these fields.
const PLACED: [(&str, &str); 2] =
    [("layouts/pt_placed.toml", "pipelines/pt.toml"), ("layouts/seed_aos.toml", "pipelines/sbdpt_seed.toml")];

/// Every pipeline that has a start, in every layout, schedule and precision; placements by hand for their own pipeline.
fn shipped_selections(sources: &Sources) -> Vec<model::Selection> {
    let keys = |folder: &str| {
        let files = sources.of_kind(FileKind::Config).map(|(_, file)| file.key.clone());
        files.filter(|key| key.starts_with(folder)).collect::<Vec<_>>()
    };
    let mut selections = Vec::new();
    for pipeline in keys("pipelines/").into_iter().filter(|key| key != "pipelines/base.toml") {
        for layout in keys("layouts/") {
            if PLACED.iter().any(|(placed, its)| layout == *placed && pipeline != *its) {
                continue;
            }
            for schedule in keys("schedules/") {
                for precision in keys("precisions/") {
                    let (pipeline, layout, schedule) = (pipeline.clone(), layout.clone(), schedule.clone());
                    selections.push(model::Selection { pipeline, layout, schedule, precision, ..default_selection() });
                }
            }
        }
    }
    selections
}

/// What is printed about a case.
fn refuse(case: &Path) -> String {
    let text = fs::read_to_string(case).expect("the case can be read");
    let name = case.file_name().expect("a case has a name").to_string_lossy();
    let mut sources = real_configs(|key| KNOWN.contains(&key));
    let mut selection = default_selection();
    for (key, text) in axis_texts(&text) {
        choose(&mut selection, &key);
        sources.add(FileKind::Config, key, name.clone(), text);
    }
    for (word, value) in text.lines().filter_map(directive) {
        match word {
            "axis" => {}
            "set" => {
                let (key, value) = value.split_once('=').expect("`# set: KEY=VALUE`");
                selection.set.push((key.to_owned(), value.to_owned()));
            }
            "pipeline" => selection.pipeline = value.to_owned(),
            "layout" => selection.layout = value.to_owned(),
            "schedule" => selection.schedule = value.to_owned(),
            "precision" => selection.precision = value.to_owned(),
            other => panic!("{}: unknown directive `{other}`", case.display()),
        }
    }
    match config::load(&mut sources, &selection) {
        Ok(_) => panic!("{} was not refused", case.display()),
        Err(findings) => diagnostic::render(&findings, &sources, false),
    }
}

/// The texts of a case with their keys. Lines before a text become empty ones, so that its line numbers are the case's.
fn axis_texts(case: &str) -> Vec<(String, String)> {
    let mut texts: Vec<(String, String)> = Vec::new();
    for (number, line) in case.lines().enumerate() {
        if let Some(("axis", key)) = directive(line) {
            texts.push((key.to_owned(), "\n".repeat(number)));
        }
        if let Some((_, text)) = texts.last_mut() {
            text.push_str(line);
            text.push('\n');
        }
    }
    texts
}

/// `# word: value`.
fn directive(line: &str) -> Option<(&str, &str)> {
    let (word, value) = line.strip_prefix("# ")?.split_once(':')?;
    Some((word, value.trim()))
}

/// Chooses the file that a case brings, unless another file extends it.
fn choose(selection: &mut model::Selection, key: &str) {
    match key.split('/').next() {
        Some("pipelines") => selection.pipeline = key.to_owned(),
        Some("layouts") => selection.layout = key.to_owned(),
        Some("schedules") => selection.schedule = key.to_owned(),
        Some("precisions") => selection.precision = key.to_owned(),
        _ => panic!("`{key}` is no config of an axis"),
    }
}

fn default_selection() -> model::Selection {
    let effect = |present, reason: &str| model::Effect { present, reason: reason.to_owned() };
    model::Selection {
        pipeline: "pipelines/pt.toml".to_owned(),
        layout: "layouts/soa.toml".to_owned(),
        schedule: "schedules/wavefront.toml".to_owned(),
        precision: "precisions/f32.toml".to_owned(),
        set: Vec::new(),
        effects: BTreeMap::from([
            ("area_light".to_owned(), effect(true, "material `lamp` emits")),
            ("sky".to_owned(), effect(false, "no environment was given")),
            ("transmission".to_owned(), effect(true, "material `bottle` transmits")),
        ]),
    }
}

fn real_configs(wanted: impl Fn(&str) -> bool) -> Sources {
    let root = project().join("configs");
    let mut sources = Sources::default();
    sources.add(FileKind::Config, "codecs.toml", "stages/codecs.toml", stages::CODECS);
    for folder in FOLDERS {
        for path in files(&root.join(folder), "toml") {
            let name = path.file_name().expect("a file has a name").to_string_lossy();
            let key = format!("{folder}/{name}");
            if !wanted(&key) {
                continue;
            }
            let text = fs::read_to_string(&path).expect("a config can be read");
            sources.add(FileKind::Config, key.clone(), format!("configs/{key}"), text);
        }
    }
    sources
}
