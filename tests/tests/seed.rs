//! The baseline `sbdpt_seed`: with its approximations switched off it converges to what the path tracer converges to; with them on it
//! is off by what docs/seed.md says; its record has the seed's 224 bytes.

use glam::{DVec3, dvec3};
use kernelgen::config::model::{Effect, Selection};
use runtime::configs::Library;
use runtime::scene::LoadOptions;
use tests::material::Material;
use tests::rendering::{BuiltScene, Job, Rendering, shipped};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::sphere;
use tests::statistics::Comparison;

const BLOCK: usize = 8;
/// f32 sums of radiance, as a share of the value.
const ROUNDING: f64 = 1e-4;

/// The seed's pipeline in the seed's record.
fn seed(job: &Job) -> Job {
    job.clone().pipeline("sbdpt_seed").layout("seed_aos")
}

/// Every eye walk's meetings with light are counted as often as they happen: exact weights wherever densities do not depend on where
/// a path comes from.
fn counted(job: &Job) -> Job {
    seed(job).set("counting", "first").set("last_ray", "light").set("sky_strategy", "sampled")
}

/// No approximation at all.
fn exact(job: &Job) -> Job {
    counted(job).set("frozen_reverse_pdfs", false)
}

#[track_caller]
fn assert_agree(a: &Rendering, b: &Rendering, what: &str) {
    assert_eq!((a.rejected, b.rejected), (0, 0), "{what}: rejected contributions");
    let comparison = Comparison::of(&a.pixels, &b.pixels, BLOCK, ROUNDING);
    assert!(comparison.agrees(), "{what}: {comparison:?}");
    assert!(comparison.noise < 0.01, "{what}: {comparison:?} is too noisy to test anything");
}

#[test]
fn the_record_has_the_seeds_224_bytes_whatever_the_scene_calls_for() {
    let scene = runtime::scene::load(&shipped("cornell_box"), &LoadOptions::default()).expect("the scene loads");
    for all in [false, true] {
        let mut effects = scene.effects.clone();
        if all {
            let present = Effect { present: true, reason: "every effect is asked for".to_owned() };
            effects.values_mut().for_each(|effect| *effect = present.clone());
        }
        let selection = Selection {
            pipeline: "pipelines/sbdpt_seed.toml".to_owned(),
            layout: "layouts/seed_aos.toml".to_owned(),
            schedule: "schedules/wavefront.toml".to_owned(),
            precision: "precisions/f32.toml".to_owned(),
            set: Vec::new(),
            effects,
        };
        let library = Library::default();
        let generated = kernelgen::generate(&library.sources, &selection);
        let generated = generated.unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
        assert_eq!(generated.plan.bytes_per_path, 224);
        assert!(generated.warnings.is_empty(), "{:?}", generated.warnings);
    }
}

#[test]
fn the_record_gives_the_bits_of_any_other_layout() {
    let job = seed(&Job::of_file(shipped("cornell_box")).size(40, 24).samples(4).fixed_point());
    let placed = job.render();
    assert!(placed.sums.iter().any(|&sum| sum != 0), "a black image proves nothing");
    assert!(placed.sums == job.layout("soa").render().sums, "the image of seed_aos is not that of soa");
}

/// A walk that outlives the rounds of the pipeline fails the render.
#[test]
fn every_switch_renders() {
    let job = Job::of_file(shipped("light_kinds")).size(16, 16).samples(4);
    for (key, value) in [
        ("counting", "first"),
        ("last_ray", "none"),
        ("last_ray", "light"),
        ("frozen_reverse_pdfs", "false"),
        ("weigh_direct_particle", "true"),
        ("sky_strategy", "implicit"),
        ("sky_strategy", "sampled"),
        ("connection_min_distance", "1"),
        ("clamp_contribution", "10"),
        ("pdf_min", "0.0001"),
        ("regularise", "cut"),
        ("max_edges", "1"),
        ("max_edges", "12"),
    ] {
        let rendering = seed(&job).set(key, value).render();
        assert_eq!(rendering.rejected, 0, "{key} = {value}");
    }
}

#[test]
fn without_approximations_it_agrees_with_pt_on_one_light_of_each_kind() {
    let job = Job::of_file(shipped("light_kinds")).size(64, 40).edges(4).samples(512);
    assert_agree(&exact(&job).render(), &job.clone().pipeline("pt").render(), "all kinds of light");
}

/// The sky need not be a light to be counted rightly.
#[test]
fn an_implicit_sky_agrees_with_pt() {
    let job = Job::of_file(shipped("light_kinds")).size(64, 40).edges(4).samples(512);
    let implicit = exact(&job).set("sky_strategy", "implicit").render();
    assert_agree(&implicit, &job.clone().pipeline("pt").render(), "the sky met by eye walks alone");
}

/// Densities that depend on both directions, and deltas.
#[test]
fn without_approximations_it_agrees_with_pt_on_metal_and_mirror() {
    for (name, roughness) in [("rough metal", 0.4), ("mirror", 0.0)] {
        let mut scene = SceneBuilder::new();
        let wall = scene.material(Material::lambert("wall", [0.7, 0.6, 0.5]));
        let ball = scene.material(Material::metal("ball", [0.9, 0.7, 0.5], roughness));
        let light = scene.material(Material::emitter("light", [3.0; 3]));
        scene.floor(wall, 0.0, 3.0);
        scene.mesh(ball, sphere(dvec3(0.0, 0.6, 0.0), 0.5, 12));
        scene.quad(wall, dvec3(-1.5, 0.0, -1.0), DVec3::X * 3.0, DVec3::Y * 2.0);
        scene.ceiling(light, 2.2, 2.0);
        scene.camera(
            "main",
            Camera { eye: dvec3(0.4, 1.0, 4.0), target: dvec3(0.0, 0.6, 0.0), yfov: 34.0, aspect: 1.0 },
        );
        let scene = BuiltScene::new(&scene, None);
        let job = scene.job().size(48, 48).edges(5).samples(256);
        assert_agree(&exact(&job).render(), &job.clone().pipeline("pt").render(), name);
    }
}

/// Where all is Lambert, a frozen density is the true one.
#[test]
fn frozen_densities_are_exact_on_lambert() {
    let job = Job::of_file(shipped("cornell_box")).size(48, 48).samples(256);
    assert_agree(&counted(&job).render(), &job.clone().pipeline("pt").render(), "frozen densities in the Cornell box");
}

/// Mean over the channels of those pixels of an image that `chosen` takes.
fn mean_where(rendering: &Rendering, chosen: &[bool]) -> f64 {
    let pixels = rendering.pixels.rgb.iter().zip(chosen).filter(|(_, chosen)| **chosen);
    let values: Vec<f64> =
        pixels.map(|(rgb, _)| rgb.iter().map(|&value| f64::from(value)).sum::<f64>() / 3.0).collect();
    assert!(!values.is_empty(), "some pixels are chosen");
    values.iter().sum::<f64>() / values.len() as f64
}

/// The numbers of docs/seed.md: the lamp seen directly is met by 3.06 eye walks, which count as 4.25; what is indirect hardly suffers.
#[test]
fn a_constant_count_costs_what_is_written() {
    let job = Job::of_file(shipped("cornell_box")).size(48, 48).edges(5).samples(256);
    let expected = job.clone().pipeline("pt").render();
    let kept = seed(&job).render();
    assert_eq!((expected.rejected, kept.rejected), (0, 0), "rejected contributions");
    let darkest = |limit: f32| -> Vec<bool> { expected.pixels.rgb.iter().map(|rgb| rgb[0] < limit).collect() };
    let lamp: Vec<bool> = darkest(12.0).iter().map(|dark| !dark).collect();
    let rest = darkest(1.0);
    let ratio = |chosen: &[bool]| mean_where(&kept, chosen) / mean_where(&expected, chosen);
    assert!((ratio(&lamp) - 0.720).abs() < 0.03, "lamp: {}", ratio(&lamp));
    assert!((ratio(&rest) - 0.984).abs() < 0.012, "rest: {}", ratio(&rest));
}
