//! Input that must be refused: cases as files, and beside each what is said about it.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder `refuse/NAME` of the tests.
pub fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("refuse").join(name)
}

/// The root of the project.
pub fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Compares what `refuse` says about every file with this extension in a folder with the `.stderr` file beside it.
/// With `UPDATE_REFUSE=1` in the environment, writes these files anew.
///
/// # Panics
/// When a message differs, or when there are fewer than `least` cases.
pub fn check(folder: &Path, extension: &str, least: usize, refuse: impl Fn(&Path) -> String) {
    let update = std::env::var_os("UPDATE_REFUSE").is_some();
    let cases = files(folder, extension);
    assert!(cases.len() >= least, "only {} cases were found", cases.len());
    let mut failures = Vec::new();
    for case in cases {
        let expected_file = case.with_extension("stderr");
        let shown = refuse(&case);
        if update {
            fs::write(&expected_file, &shown).expect("the expectation can be written");
        }
        let expected = fs::read_to_string(&expected_file).unwrap_or_default();
        if shown != expected {
            failures.push(format!("{}\n--- expected\n{expected}--- shown\n{shown}", case.display()));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// The files of a folder with an extension, sorted.
///
/// # Panics
/// When the folder cannot be read.
pub fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let paths = entries.map(|entry| entry.expect("the folder can be read").path());
    let mut files: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|own| own == extension)).collect();
    files.sort();
    files
}
