//! Loads every test scene beside the repository, when they are there, and checks what is packed.

use runtime::scene::{self, Accelerator, BuildPreset, LoadOptions, RESOURCES, Scene};
use std::path::{Path, PathBuf};

/// Deepest hierarchies that the traversal stacks of the kernels (32 and 64 entries) certainly hold: the wide one pushes up to
/// two groups a level.
const DEEPEST_WIDE: usize = 16;
const DEEPEST_BINARY: usize = 64;

/// Folder of the test scenes; they are not part of the repository.
fn scenes() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let candidates = [root.join("../shared/scenes"), root.join("../../shared/scenes")];
    let found = std::env::var_os("PATHLOOM_SCENES")
        .map(PathBuf::from)
        .into_iter()
        .chain(candidates)
        .find(|folder| folder.is_dir());
    if found.is_none() {
        println!("skipped: no folder with test scenes");
    }
    found
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "glb" || extension == "gltf") {
            found.push(path);
        }
    }
}

/// What the description beside a file says, as text.
fn described(file: &Path, key: &str) -> Option<String> {
    let text = std::fs::read_to_string(file.with_file_name("scene.toml")).ok()?;
    let table: toml::Table = text.parse().ok()?;
    table.get(key).map(|value| value.to_string().trim_matches('"').to_owned())
}

fn floats(scene: &Scene, name: &str) -> Vec<f32> {
    let bytes = scene.resource(name).unwrap_or_else(|| panic!("no {name}"));
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn check(scene: &Scene) {
    for name in RESOURCES {
        let bytes = scene.resource(name);
        assert_eq!(bytes.is_none(), name == "bvh2_nodes");
        assert!(bytes.is_none_or(|bytes| bytes.len() >= 16 && bytes.len() % 4 == 0), "{name}");
    }
    let count = scene.triangle_count();
    let length = |name: &str, words: usize| assert_eq!(floats(scene, name).len(), (count * words).max(4), "{name}");
    length("triangle_normals", 9);
    length("triangle_tangents", 12);
    length("triangle_colors", 12);
    assert_eq!(floats(scene, "bvh_triangles").len(), count.max(1) * 12);
    for name in ["triangle_normals", "triangle_uvs", "triangle_tangents", "triangle_colors", "sky_texels"] {
        assert!(floats(scene, name).iter().all(|value| value.is_finite()), "{name}");
    }
    for triangle in floats(scene, "bvh_triangles").chunks_exact(12).take(count) {
        let edge = |at: usize| [0, 1, 2].map(|i| f64::from(triangle[at + i]));
        let (a, b) = (edge(4), edge(8));
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        assert!(cross.iter().any(|c| *c != 0.0) && triangle[..3].iter().all(|c| c.is_finite()));
    }
    let lights = floats(scene, "lights");
    let total: f64 = lights.chunks_exact(16).map(|light| f64::from(light[1])).sum();
    assert!(lights.len() == 4 || (total - 1.0).abs() < 1e-5, "pick probabilities add up to {total}");
    check_light_links(scene, &lights);
    assert_eq!(scene.resource("scene").map(<[u8]>::len), Some(96));
    assert_eq!(scene.resource("sky_frame").map(<[u8]>::len), Some(32));
}

/// Triangles and lights must name each other.
fn check_light_links(scene: &Scene, lights: &[f32]) {
    let triangles = floats(scene, "bvh_triangles");
    for (prim, triangle) in triangles.chunks_exact(12).enumerate().take(scene.triangle_count()) {
        let light = triangle[11].to_bits();
        if light != u32::MAX {
            let entry = &lights[light as usize * 16..];
            assert_eq!((entry[0].to_bits(), entry[2].to_bits()), (0, prim as u32));
        }
    }
}

#[test]
fn every_scene_loads() {
    let Some(folder) = scenes() else { return };
    let mut found = Vec::new();
    files(&folder, &mut found);
    found.sort();
    let options = LoadOptions { build: BuildPreset::VeryFast, ..LoadOptions::default() };
    for file in found {
        let mut scene = scene::load(&file, &options).unwrap_or_else(|error| panic!("{error}"));
        check(&scene);
        let own = described(&file, "file").is_some_and(|name| file.ends_with(name));
        if let Some(triangles) = described(&file, "triangles").filter(|_| own) {
            assert_eq!((scene.triangle_count() + scene.dropped_count()).to_string(), triangles, "{}", file.display());
        }
        let stats = scene.stats();
        println!(
            "{}: {} triangles, {} dropped, depth {}, {:?}, {} KiB, {}",
            file.display(),
            stats.triangles,
            stats.dropped,
            stats.bvh.depth,
            stats.lights,
            stats.bytes / 1024,
            stats
                .effects
                .iter()
                .filter(|(_, effect)| effect.present)
                .map(|(name, _)| name.as_str())
                .collect::<Vec<_>>()
                .join(" ")
        );
        stats.warnings.iter().for_each(|warning| println!("    {warning}"));
        scene.set_accelerator(Accelerator::Bvh2).expect("the hierarchy can be traversed");
        let binary = scene.stats().bvh.depth;
        println!("    binary depth {binary}");
        assert!(stats.bvh.depth <= DEEPEST_WIDE && binary <= DEEPEST_BINARY);
    }
}

#[test]
fn a_folder_is_its_scene_and_the_binary_hierarchy_is_built_on_demand() {
    let Some(folder) = scenes() else { return };
    let mut scene =
        scene::load(&folder.join("cornell_box"), &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((scene.triangle_count(), scene.size()), (36, (512, 512)));
    scene.set_accelerator(Accelerator::Bvh2).expect("the hierarchy can be traversed");
    assert!(scene.resource("bvh_nodes").is_none());
    assert_eq!(scene.resource("bvh2_nodes").map(|bytes| bytes.len() % 32), Some(0));
    let error = scene::load(&folder.join("loader_pack"), &LoadOptions::default()).err().map(|error| error.to_string());
    assert!(error.is_some_and(|text| text.contains("`file` names no glTF file")));
}

#[test]
fn the_same_file_gives_the_same_bytes() {
    let Some(folder) = scenes() else { return };
    let load =
        || scene::load(&folder.join("lights_lamp"), &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let (a, b) = (load(), load());
    RESOURCES.iter().for_each(|name| assert!(a.resource(name) == b.resource(name), "{name}"));
}

#[test]
fn cameras_are_chosen_by_name_and_index() {
    let Some(folder) = scenes() else { return };
    let load = |scene: &str, camera: &str| {
        let options = LoadOptions { camera: Some(camera.into()), ..LoadOptions::default() };
        scene::load(&folder.join(scene), &options).map(|scene| scene.stats().camera).map_err(|error| error.to_string())
    };
    assert_eq!(load("cornell_box", "1"), load("cornell_box", "panorama_wide_120deg"));
    assert!(load("cornell_box", "nowhere").is_err_and(|text| text.contains("panorama_wide_120deg")));
    assert!(load("loader_pack/Cameras/Cameras.gltf", "1").is_err_and(|text| text.contains("orthographic")));
}
