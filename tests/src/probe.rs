//! Probes: stages of the tests that evaluate shipped functions and splat the results. The film is then a table.

use kernelgen::source::FileKind;
use runtime::configs::Library;

/// Units of one in the sums of a fixed-point film.
pub const ONE: i64 = 1 << 24;

/// The shipped library with modules of the tests, given as (key, text), and a pipeline `probe` of the one stage `entry`.
pub fn library(modules: &[(&str, &str)], entry: &str) -> Library {
    let mut library = Library::default();
    for (key, text) in modules {
        library.sources.add(FileKind::Module, *key, format!("{key}.wgsl"), *text);
    }
    let pipeline = format!(
        "extends = \"base.toml\"\nname = \"probe\"\ndoc = \"One stage that fills a table.\"\n\
         start = \"probe\"\nrounds = \"1\"\n\n[stages]\nprobe = {{ entry = \"{entry}\", on.done = \"end\" }}\n"
    );
    library.sources.add(FileKind::Config, "pipelines/probe.toml", "probe.toml", pipeline);
    library
}

/// Changes a shipped module: `old`, which must be there, becomes `new`.
pub fn broken(library: &mut Library, key: &str, old: &str, new: &str) {
    let file = library.sources.find(FileKind::Module, key).expect("there is such a module");
    let text = library.sources.file(file).text.clone();
    assert!(text.contains(old), "{key} has no `{old}`");
    library.sources.add(FileKind::Module, key, format!("{key}.wgsl"), text.replace(old, new));
}
