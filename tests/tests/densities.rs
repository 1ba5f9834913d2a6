//! The densities of camera and lights, asked on the device: each integrates to one, and is the one that is sampled.

use glam::{DVec3, dvec3};
use runtime::configs::Library;
use tests::material::Material;
use tests::probe::{ONE, library};
use tests::rendering::{BuiltScene, Job, Rendering, shipped};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::sky::Sky;
use tests::statistics::chi_square;

const CAMERA: &str = include_str!("../wgsl/probe_camera.wgsl");
const LIGHT: &str = include_str!("../wgsl/probe_light.wgsl");
const SKY: &str = include_str!("../wgsl/probe_sky.wgsl");

/// Sums of a channel over each pixel, in ones.
#[track_caller]
fn channel(rendering: &Rendering, channel: usize) -> Vec<f64> {
    assert_eq!(rendering.rejected, 0, "a probe gave a value that is no number");
    rendering.sums.chunks_exact(3).map(|sums| sums[channel] as f64 / ONE as f64).collect()
}

fn counts(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.round() as u64).collect()
}

fn probe(job: Job, library: Library) -> Job {
    job.library(library).pipeline("probe").fixed_point()
}

#[test]
fn the_density_of_camera_rays_integrates_to_one() {
    for lens in [false, true] {
        let library = library(&[("stage/probe_camera", CAMERA)], "project_wall");
        let rendering = with_camera(lens, |job| probe(job, library.clone()).size(24, 16).samples(4096).render());
        let pixels: Vec<f64> = channel(&rendering, 0).iter().map(|sum| sum / 4096.0).collect();
        let mean = pixels.iter().sum::<f64>() / pixels.len() as f64;
        assert!((mean - 1.0).abs() < 5e-3, "lens {lens}: the density integrates to {mean}");
        // 4096 / 1.5625 hits a pixel: a standard error of 1.6 %, or 2 % where the weights differ.
        let worst = pixels.iter().map(|pixel| (pixel - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst < 0.1, "lens {lens}: a pixel is off by {worst}");
    }
}

/// Runs with a scene that has little but a camera.
fn with_camera<T>(lens: bool, run: impl Fn(Job) -> T) -> T {
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::lambert("ground", [0.5; 3]));
    scene.floor(ground, 0.0, 1.0);
    scene.camera("main", Camera { eye: dvec3(1.0, 2.0, 3.0), target: DVec3::ZERO, yfov: 70.0, aspect: 1.5 });
    let scene = BuiltScene::new(&scene, None);
    let job = scene.job();
    run(if lens { job.lens(0.2, 2.0) } else { job })
}

#[test]
fn points_on_a_ray_are_projected_to_its_pixel() {
    for lens in [false, true] {
        let library = library(&[("stage/probe_camera", CAMERA)], "follow_rays");
        let rendering = with_camera(lens, |job| probe(job, library.clone()).size(48, 32).samples(256).render());
        let rays: f64 = channel(&rendering, 0).iter().sum();
        let lost: f64 = channel(&rendering, 1).iter().sum();
        // Some rays start on the very edge of a pixel.
        assert!(lost < 1e-4 * rays, "lens {lens}: {lost} of {rays} rays are projected elsewhere");
    }
}

#[test]
fn lights_are_picked_with_their_probability() {
    for scene in ["light_kinds", "cornell_box"] {
        let library = library(&[("stage/probe_light", LIGHT)], "pick_lights");
        let rendering = probe(Job::of_file(shipped(scene)), library).size(64, 64).samples(64).render();
        let probabilities: Vec<f64> = channel(&rendering, 0).iter().map(|sum| sum / 64.0).collect();
        let total: f64 = probabilities.iter().sum();
        assert!((total - 1.0).abs() < 1e-5, "{scene}: the probabilities add up to {total}");
        let drawn = f64::from(64 * 64 * 64);
        let expected: Vec<f64> = probabilities.iter().map(|probability| probability * drawn).collect();
        let test = chi_square(&counts(&channel(&rendering, 1)), &expected);
        assert!(test.p_value > 1e-4, "{scene}: {test:?}");
    }
}

#[test]
fn hitting_a_light_has_the_density_of_sampling_it() {
    for (scene, rows) in [("cornell_box", &[0][..]), ("light_kinds", &[0, 16]), ("outdoor", &[16])] {
        let library = library(&[("stage/probe_light", LIGHT)], "follow_light");
        let folder = shipped(scene).with_file_name("");
        let rendering = probe(Job::of_file(folder), library).size(64, 64).samples(64).render();
        let counted = channel(&rendering, 0);
        for &first in rows {
            let decades = &counted[first..first + 9];
            let all: f64 = decades.iter().sum();
            assert!(all > 1000.0, "{scene}: only {all} lights were met");
            // Both ends are taken off their surfaces, and directions are rounded: into another texel of the sky now and then.
            let off: f64 = decades[5..].iter().sum();
            assert!(off < 1e-3 * all, "{scene}, {first}: {decades:?}");
        }
        // Points within rounding of a light's edge may be missed by the ray to them.
        let missed = counted[32];
        assert!(
            missed <= 1e-4 * counted[..25].iter().sum::<f64>(),
            "{scene}: {missed} lights are not where they were said to be"
        );
    }
}

#[test]
fn the_sky_is_drawn_by_its_density() {
    let library = library(&[("stage/probe_sky", SKY)], "draw_sky");
    let folder = shipped("outdoor").with_file_name("");
    let samples = 64;
    let rendering = probe(Job::of_file(folder), library).size(256, 128).samples(samples).render();
    let shares: Vec<f64> = channel(&rendering, 0).iter().map(|sum| sum / f64::from(samples)).collect();
    let total: f64 = shares.iter().sum();
    assert!((total - 1.0).abs() < 1e-3, "the density integrates to {total}");
    let drawn = f64::from(256 * 128 * samples);
    let expected: Vec<f64> = shares.iter().map(|share| share * drawn).collect();
    let test = chi_square(&counts(&channel(&rendering, 1)), &expected);
    assert!(test.p_value > 1e-4, "{test:?}");
}

#[test]
fn no_direction_of_the_sky_is_drawn_with_density_zero() {
    let mut sky = Sky { width: 1024, height: 64, texels: vec![[0.0; 3]; 1024 * 64] };
    for texel in [20 * 1024 + 700, 40 * 1024 + 900] {
        sky.texels[texel] = [100.0; 3];
    }
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::lambert("ground", [0.5; 3]));
    scene.floor(ground, 0.0, 1.0);
    scene.camera("main", Camera { eye: DVec3::Y, target: DVec3::ZERO, yfov: 40.0, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, Some(&sky));
    let library = library(&[("stage/probe_sky", SKY)], "draw_corners");
    let rendering = probe(scene.job(), library).size(1024, 64).samples(4).render();
    let drawn: f64 = channel(&rendering, 0).iter().sum();
    let zero: f64 = channel(&rendering, 1).iter().sum();
    assert!(drawn > 0.0 && zero == 0.0, "{zero} of {drawn} directions");
}
