//! Writes the shipped scenes below `configs/scenes`: `cargo run -p tests --bin make_scenes`.

use std::error::Error;
use std::fs;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/scenes");
    for scene in tests::shipped_scenes::all() {
        fs::create_dir_all(root.join(scene.name))?;
        for (path, bytes) in scene.files()? {
            println!("{path}: {} bytes", bytes.len());
            fs::write(root.join(path), bytes)?;
        }
    }
    Ok(())
}
