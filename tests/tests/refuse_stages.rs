//! Stages and wirings that must be refused, and what is said about them.
//!
//! A case is `refuse/stages/NAME.md`: blocks that change the small project in `refuse/stages/base`, as in the how-tos.
//! `NAME.stderr` holds the diagnostics as they are printed. `UPDATE_REFUSE=1` writes it anew.

use kernelgen::config::model::{Effect, Selection};
use kernelgen::source::{FileKind, Sources};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use tests::how_to::{Texts, apply, blocks};
use tests::refuse::{check, files, folder, project};

/// Which file of the small project is which axis.
const CONFIGS: [(&str, &str); 4] = [
    ("pipeline.toml", "pipelines/small.toml"),
    ("layout.toml", "layouts/small.toml"),
    ("schedule.toml", "schedules/small.toml"),
    ("precision.toml", "precisions/small.toml"),
];

#[test]
fn refused_stages_say_why() {
    check(&folder("stages"), "md", 12, |case| {
        let document = fs::read_to_string(case).expect("the case can be read");
        let mut texts = base();
        apply(&blocks(&document), &mut texts).unwrap_or_else(|error| panic!("{}: {error}", case.display()));
        match kernelgen::generate(&sources(&texts), &selection()) {
            Ok(_) => panic!("{} was not refused", case.display()),
            Err(refusal) => refusal.render(false),
        }
    });
}

#[test]
fn the_project_that_the_cases_change_is_accepted() {
    let generated = kernelgen::generate(&sources(&base()), &selection());
    let generated = generated.unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    assert!(generated.warnings.is_empty(), "{:?}", generated.warnings);
}

/// A code has one meaning, and one line in the list.
#[test]
fn every_code_is_documented_once() {
    let document = fs::read_to_string(project().join("docs/diagnostics.md")).expect("the list can be read");
    let listed: Vec<&str> = document.lines().filter_map(|line| line.strip_prefix("| K")?.split(' ').next()).collect();
    let distinct: BTreeSet<String> = listed.iter().map(|number| format!("K{number}")).collect();
    assert_eq!(listed.len(), distinct.len(), "a code is listed twice");
    let used = codes_below(&project().join("kernelgen/src"));
    let missing: Vec<&String> = used.difference(&distinct).collect();
    let stale: Vec<&String> = distinct.difference(&used).collect();
    assert!(missing.is_empty() && stale.is_empty(), "not listed: {missing:?}, no longer used: {stale:?}");
}

/// The codes that the sources in a folder write as strings.
fn codes_below(folder: &Path) -> BTreeSet<String> {
    let mut codes = BTreeSet::new();
    for file in files(folder, "rs") {
        let text = fs::read_to_string(file).expect("a source can be read");
        let quoted = text.match_indices("\"K0").filter_map(|(at, _)| text.get(at + 1..at + 6));
        codes.extend(quoted.filter(|code| code[1..].bytes().all(|byte| byte.is_ascii_digit())).map(str::to_owned));
    }
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let paths = entries.map(|entry| entry.expect("the folder can be read").path());
    paths.filter(|path| path.is_dir()).for_each(|path| codes.extend(codes_below(&path)));
    codes
}

/// The texts of the small project by their paths.
fn base() -> Texts {
    let folder = folder("stages/base");
    let mut texts = Texts::new();
    for path in files(&folder, "toml").into_iter().chain(files(&folder, "wgsl")) {
        let text = fs::read_to_string(&path).expect("a text can be read");
        let name = path.file_name().expect("a file has a name").to_string_lossy().into_owned();
        let place = match name.as_str() {
            "sphere.wgsl" => "stages/",
            name if name.ends_with(".wgsl") => "stages/stage/",
            _ => "",
        };
        texts.insert(format!("{place}{name}"), text);
    }
    texts
}

fn sources(texts: &Texts) -> Sources {
    let mut sources = Sources::default();
    for (path, text) in texts {
        let config = CONFIGS.iter().find(|(file, _)| file == path);
        match (config, path.strip_prefix("stages/").and_then(|path| path.strip_suffix(".wgsl"))) {
            (Some((_, key)), _) => sources.add(FileKind::Config, *key, path, text),
            (None, Some(key)) => sources.add(FileKind::Module, key, path, text),
            (None, None) => panic!("{path} is no part of the project"),
        };
    }
    sources
}

fn selection() -> Selection {
    let sky = Effect { present: false, reason: "no sky".to_owned() };
    let [pipeline, layout, schedule, precision] = CONFIGS.map(|(_, key)| key.to_owned());
    let effects = BTreeMap::from([("sky".to_owned(), sky)]);
    Selection { pipeline, layout, schedule, precision, set: Vec::new(), effects }
}
