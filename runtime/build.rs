//! Embeds `configs/`: every TOML file, and every file of the scenes in `configs/scenes`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = Path::new(&std::env::var("CARGO_MANIFEST_DIR")?).join("..").join("configs");
    println!("cargo::rerun-if-changed={}", root.display());
    let mut files = Vec::new();
    collect(&root, &mut files)?;
    files.sort();
    let mut configs = String::from("&[\n");
    let mut scenes = String::from("&[\n");
    for file in &files {
        let key = file.strip_prefix(&root)?.to_string_lossy().replace('\\', "/");
        let path = file.canonicalize()?;
        if let Some(name) = key.strip_prefix("scenes/") {
            writeln!(scenes, "    ({name:?}, include_bytes!({path:?})),")?;
        } else if key.ends_with(".toml") {
            writeln!(configs, "    ({key:?}, include_str!({path:?})),")?;
        }
    }
    configs.push(']');
    scenes.push(']');
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("configs.rs"), configs)?;
    std::fs::write(out.join("scenes.rs"), scenes)?;
    Ok(())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if !folder.is_dir() {
        return Ok(());
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        println!("cargo::rerun-if-changed={}", path.display());
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
