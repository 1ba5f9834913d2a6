//! The files below `configs/scenes` are what the code says: `make_scenes` would change nothing.

use std::fs;
use std::path::Path;
use tests::shipped_scenes;

const LARGEST_FILE: usize = 300_000;

#[test]
fn committed_scenes_are_what_make_scenes_writes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/scenes");
    for scene in shipped_scenes::all() {
        for (path, bytes) in scene.files().expect("the scene has pixels") {
            let committed =
                fs::read(root.join(&path)).unwrap_or_else(|error| panic!("{path}: {error}; run make_scenes"));
            assert!(committed == bytes, "{path} differs from what make_scenes writes");
            assert!(bytes.len() <= LARGEST_FILE, "{path} has {} bytes", bytes.len());
        }
    }
}

#[test]
fn every_folder_of_scenes_is_written_by_make_scenes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/scenes");
    let names: Vec<_> = shipped_scenes::all().iter().map(|scene| scene.name.to_owned()).collect();
    for entry in fs::read_dir(root).expect("configs/scenes is there") {
        let name = entry.expect("the folder can be read").file_name().into_string().expect("names are UTF-8");
        assert!(names.contains(&name), "nothing writes configs/scenes/{name}");
    }
}
