//! The how-tos of `docs/`, followed to the letter: their files made, their changes applied, their promises checked.

use glam::{DVec3, dvec3};
use kernelgen::source::FileKind;
use runtime::configs::Library;
use std::fs;
use std::path::{Path, PathBuf};
use tests::how_to::{Texts, apply, blocks};
use tests::material::Material;
use tests::rendering::{BuiltScene, Job, shipped};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::sky::Sky;
use tests::statistics::{Estimate, spread, z_scores};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The shipped configs and stages with what a how-to makes of them.
#[track_caller]
fn library_after(how_to: &str) -> Library {
    let document = fs::read_to_string(root().join("docs").join(how_to)).expect("the how-to is there");
    let blocks = blocks(&document);
    assert!(!blocks.is_empty(), "{how_to} has no block with a file name");
    let mut texts = Texts::new();
    for block in &blocks {
        if let Ok(text) = fs::read_to_string(root().join(&block.path)) {
            texts.insert(block.path.clone(), text);
        }
    }
    apply(&blocks, &mut texts).unwrap_or_else(|message| panic!("{how_to}: {message}"));
    let mut library = Library::default();
    for (path, text) in texts {
        let (kind, key) = match path.strip_prefix("configs/") {
            Some(key) => (FileKind::Config, key),
            None => (FileKind::Module, module_key(&path)),
        };
        library.sources.add(kind, key, path.clone(), text);
    }
    library
}

/// The key of a stage module: its path below `stages/wgsl`, without extension.
#[track_caller]
fn module_key(path: &str) -> &str {
    let key = path.strip_prefix("stages/wgsl/").and_then(|key| key.strip_suffix(".wgsl"));
    key.unwrap_or_else(|| panic!("{path} is neither a config nor a stage"))
}

#[test]
fn a_layout_is_added() {
    let library = library_after("how-to-add-a-layout.md");
    for (pipeline, layouts) in [
        ("nee", &["blocks_of_eight", "two_tables"][..]),
        ("pt", &["blocks_of_eight", "two_tables"]),
        ("lt", &["blocks_of_eight"]),
    ] {
        let job = |layout: &str| {
            let job = Job::of_file(shipped("cornell_box")).library(library.clone()).pipeline(pipeline).layout(layout);
            job.size(32, 32).samples(4).fixed_point().render()
        };
        let expected = job("aos");
        assert!(expected.sums.iter().any(|&sum| sum != 0));
        for layout in layouts {
            assert!(job(layout).sums == expected.sums, "{pipeline}: the image of {layout} is not that of aos");
        }
    }
}

#[test]
fn a_bsdf_is_added() {
    let library = library_after("how-to-add-a-bsdf.md");
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::lambert("ground", [1.0; 3]));
    scene.floor(ground, 0.0, 20.0);
    scene.camera("main", Camera { eye: DVec3::Y, target: DVec3::ZERO, yfov: 0.1, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
    let job = scene.job().library(library).edges(2).size(16, 16).samples(1024);
    let dust = job.clone().set("diffuse_model", "dust").render().pixels.mean_estimate();
    let lambert = job.render().pixels.mean_estimate();
    let expected = 0.5 * (1.0 - std::f64::consts::LN_2);
    assert!(dust.error < 0.005 * expected, "{dust:?} is too noisy to test anything");
    assert!(dust.z(&Estimate::exact(expected), 3e-4 * expected).abs() < 4.5, "{dust:?}, expected {expected}");
    assert!(lambert.z(&Estimate::exact(1.0), 3e-4).abs() < 4.5, "{lambert:?}, expected 1");
}

#[test]
fn the_added_bsdf_works_below_a_coat() {
    let library = library_after("how-to-add-a-bsdf.md");
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::glossy("ground", [1.0; 3], 0.5));
    scene.floor(ground, 0.0, 20.0);
    scene.camera("main", Camera { eye: DVec3::Y, target: DVec3::ZERO, yfov: 0.1, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
    let render = |model: &str| {
        let job = scene.job().library(library.clone()).set("diffuse_model", model);
        job.edges(2).size(16, 16).samples(256).render().pixels.mean_estimate().mean
    };
    let (dust, lambert) = (render("dust"), render("lambert"));
    // The coat reflects 4 %; of the rest dust sends back less than a fifth.
    assert!(0.04 < dust && dust < 0.24 && 0.9 < lambert && lambert < 1.01, "dust {dust}, lambert {lambert}");
}

#[test]
fn the_added_bsdf_is_reciprocal() {
    let library = library_after("how-to-add-a-bsdf.md");
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::lambert("ground", [0.9; 3]));
    scene.floor(ground, 0.0, 4.0);
    scene.quad(ground, dvec3(-1.5, 0.0, -1.0), DVec3::X * 3.0, DVec3::Y * 2.0);
    scene.point_light(dvec3(0.4, 1.0, 0.3), [1.0; 3]);
    scene.camera("main", Camera { eye: dvec3(0.0, 1.2, 4.0), target: dvec3(0.0, 0.5, 0.0), yfov: 40.0, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, None);
    let render = |pipeline: &str| {
        let job = scene.job().library(library.clone()).pipeline(pipeline).set("diffuse_model", "dust");
        job.edges(4).size(32, 32).samples(512).render().pixels.block_estimates(8)
    };
    let spread = spread(&z_scores(&render("pt"), &render("lt"), 1e-3));
    assert!(spread.agrees(), "{spread:?}");
}

#[test]
fn a_field_and_a_stage_are_added() {
    let library = library_after("how-to-add-a-stage.md");
    let job = |pipeline: &str| {
        let job = Job::of_file(shipped("cornell_box")).library(library.clone()).pipeline(pipeline);
        job.size(32, 32).samples(4).fixed_point()
    };
    let open = job("pt").render();
    let gated = |gate: f64, layout: &str| job("gated").set("gate", gate).layout(layout).render();
    assert!(gated(1e6, "aos").sums == open.sums, "an open gate changes nothing");
    let half = gated(4.5, "aos");
    assert!(half.sums.iter().zip(&open.sums).all(|(half, open)| half <= open), "light that came through comes through");
    assert!(half.sums != open.sums && half.sums.iter().any(|&sum| sum != 0));
    assert!(gated(4.5, "compact").sums == half.sums, "the layout changes nothing");
    let fields = |pipeline: &str| {
        let tables = job(pipeline).layout("soa").report().tables;
        tables.iter().flat_map(|table| &table.fields).filter(|field| field.name == "eye.travelled").count()
    };
    assert_eq!((fields("gated"), fields("pt")), (1, 0));
}
