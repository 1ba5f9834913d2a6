//! The invariants of ARCHITECTURE.md that are about the text of the project itself. Each fails when somebody breaks the rule.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests crate lies in the workspace").to_path_buf()
}

fn files_below(folder: &str, extension: &str) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut pending = vec![root().join(folder)];
    while let Some(next) = pending.pop() {
        for entry in fs::read_dir(&next).expect("the folder exists") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                let text = fs::read_to_string(&path).expect("UTF-8");
                found.push((path, text));
            }
        }
    }
    assert!(!found.is_empty(), "no .{extension} below {folder}");
    found.sort();
    found
}

/// The text in front of the unit tests of a source file.
fn production(text: &str) -> &str {
    text.split("#[cfg(test)]").next().unwrap_or(text)
}

fn assert_absent(files: &[(PathBuf, String)], words: &[&str], rule: &str) {
    for (path, text) in files {
        for word in words {
            assert!(!production(text).contains(word), "{rule}: {} contains `{word}`", path.display());
        }
    }
}

#[test]
fn kernelgen_touches_no_gpu_no_file_and_no_clock() {
    let sources = files_below("kernelgen/src", "rs");
    let forbidden = ["std::fs", "std::time", "std::env", "std::io::", "std::process", "wgpu", "HashMap", "HashSet"];
    assert_absent(&sources, &forbidden, "kernelgen is pure and deterministic");
}

#[test]
fn dependencies_point_one_way() {
    let manifest = |name: &str| fs::read_to_string(root().join(name).join("Cargo.toml")).expect("manifest");
    let dependencies = |name: &str| {
        let text = manifest(name);
        let normal = text.split("[dependencies]").nth(1).unwrap_or("").to_string();
        normal.split("\n[").next().unwrap_or("").to_string()
    };
    for forbidden in ["runtime", "stages", "wgpu", "gltf", "exr"] {
        assert!(
            !dependencies("kernelgen").lines().any(|line| line.starts_with(forbidden)),
            "kernelgen must not depend on {forbidden}"
        );
    }
    assert!(dependencies("stages").trim().is_empty(), "stages is text and depends on nothing");
}

#[test]
fn no_stage_knows_where_a_field_lives() {
    let stages = files_below("stages/wgsl", "wgsl");
    let words = ["state[", "state_", "queue[", "path_count", "@group", "@binding"];
    assert_absent(&stages, &words, "stages know no address");
}

#[test]
fn runtime_knows_no_stage_and_no_field_by_name() {
    let mut names = BTreeSet::new();
    for (_, text) in files_below("configs/pipelines", "toml") {
        let table: toml::Table = text.parse().expect("TOML");
        for key in ["stages", "streams", "state", "tallies", "layers"] {
            if let Some(entries) = table.get(key).and_then(toml::Value::as_table) {
                names.extend(entries.keys().cloned());
            }
        }
        for record in table.get("records").and_then(toml::Value::as_table).into_iter().flat_map(|t| t.values()) {
            names.extend(record.as_table().into_iter().flat_map(|t| t.keys().cloned()));
        }
    }
    // Words that the runtime uses for things of its own: glTF members, film and file words.
    for own in
        ["position", "direction", "distance", "normal", "hit", "length", "path", "sample", "pixel", "light", "eye"]
    {
        names.remove(own);
    }
    assert!(names.len() > 10, "the pipelines declare names");
    for (path, text) in files_below("runtime/src", "rs") {
        if path.components().any(|part| part.as_os_str() == "scene") {
            continue;
        }
        for name in &names {
            let quoted = format!("\"{name}\"");
            assert!(
                !production(&text).contains(&quoted),
                "runtime/ interprets the plan: {} names {quoted}",
                path.display()
            );
        }
    }
}

#[test]
fn every_stage_function_is_documented() {
    for (path, text) in files_below("stages/wgsl", "wgsl") {
        let lines: Vec<&str> = text.lines().collect();
        for (index, line) in lines.iter().enumerate() {
            if line.starts_with("fn ") {
                let before = index.checked_sub(1).map_or("", |above| lines[above]);
                assert!(
                    before.starts_with("///") || before.starts_with('@'),
                    "{}:{}: `{line}` has no `///`",
                    path.display(),
                    index + 1
                );
            }
        }
    }
}

#[test]
fn nothing_is_left_open_in_the_text() {
    let open = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("todo", "!("), concat!("unimplemented", "!(")];
    for folder in ["kernelgen/src", "runtime/src", "stages/src"] {
        assert_absent(&files_below(folder, "rs"), &open, "no open ends");
    }
    assert_absent(&files_below("stages/wgsl", "wgsl"), &open, "no open ends");
    assert_absent(&files_below("configs", "toml"), &open, "no open ends");
}
