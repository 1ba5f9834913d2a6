//! Writes the table of stage modules: every `.wgsl` file below `wgsl/`, so that a new stage is a new file and nothing else.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let crate_root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR"));
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let source_root = crate_root.join("wgsl");
    let mut modules = Vec::new();
    collect_modules(&source_root, &source_root, &mut modules)?;
    modules.sort();
    fs::write(out_dir.join("modules.rs"), module_table(&source_root, &modules))
}

/// Appends the path of every `.wgsl` file below `folder`, relative to `root`, with `/` between names and no extension.
fn collect_modules(root: &Path, folder: &Path, modules: &mut Vec<String>) -> io::Result<()> {
    println!("cargo::rerun-if-changed={}", folder.display());
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect_modules(root, &path, modules)?;
        } else if path.extension().is_some_and(|extension| extension == "wgsl") {
            println!("cargo::rerun-if-changed={}", path.display());
            modules.push(module_path(root, &path));
        }
    }
    Ok(())
}

fn module_path(root: &Path, file: &Path) -> String {
    let relative = file.strip_prefix(root).expect("the walk stays below its root").with_extension("");
    let names: Vec<_> = relative.iter().map(|name| name.to_string_lossy()).collect();
    names.join("/")
}

fn module_table(source_root: &Path, modules: &[String]) -> String {
    let mut table = String::from("&[\n");
    for path in modules {
        let file = source_root.join(format!("{path}.wgsl"));
        writeln!(
            table,
            "    Module {{ path: {path:?}, name: {:?}, text: include_str!({:?}) }},",
            format!("stages/wgsl/{path}.wgsl"),
            file.display().to_string(),
        )
        .expect("writing to a string cannot fail");
    }
    table.push_str("]\n");
    table
}
