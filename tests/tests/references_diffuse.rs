//! Images of an independent renderer whose materials differ from this one's: their diffuse regions, lit by way of those materials.
//!
//! Six agree as they are; ten where this renderer takes over the other one's conventions (`tests::following`), all at once. At these
//! sample counts a difference of some per cent shows; docs/validation.md has what longer renders give, by the program
//! `reference_table`. Without the folder `shared` these tests say so and pass.
//!
//! `odd_degenerate` has faces of two colours in one place, which tint the room; the other renderer's own two back ends show different
//! ones. Its mean alone is compared, in `references.rs`.

use glam::{DVec3, dvec3};
use std::path::Path;
use tests::following;
use tests::mask::Mask;
use tests::material::Material;
use tests::references::{Reference, Score, expect_errors, reference, shared};
use tests::rendering::{BuiltScene, Job, shipped};
use tests::scene_builder::{Camera, SceneBuilder};

/// Error that both renderers share by rounding, and that of the errors themselves, as a share of the mean.
const ROUNDING: f64 = 1e-3;

#[track_caller]
fn score(shared: &Path, reference: &Reference, job: Job, mask: &Mask, samples: u32) -> Score {
    let wanted = reference.image(shared);
    let mut rendering = job.pipeline("pt").samples(samples).render();
    assert_eq!(rendering.rejected, 0, "{}: rejected contributions", reference.name);
    expect_errors(&mut rendering.pixels, &wanted, reference.spp / samples);
    Score::of(&rendering.pixels, &wanted, Some(mask), ROUNDING)
}

#[track_caller]
fn assert_agrees_as_it_is(name: &str, samples: u32) {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, name);
    let job = reference.job(&shared, 1);
    let mask = Mask::of(&job);
    let score = score(&shared, &reference, job, &mask, samples);
    assert!(score.agrees(), "{name}: {score:?}");
}

#[track_caller]
fn assert_agrees_following(name: &str, samples: u32) {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, name);
    let mask = Mask::of(&reference.job(&shared, 1));
    assert_follows(&shared, &reference, &mask, samples);
}

#[track_caller]
fn assert_follows(shared: &Path, reference: &Reference, mask: &Mask, samples: u32) {
    let scene = following::converted(shared, reference);
    let score = score(shared, reference, following::job(&scene, reference), mask, samples);
    assert!(score.agrees(), "{}, following: {score:?}", reference.name);
}

/// The test can fail: without the conventions of the other renderer its picture is refuted at the same sample count.
#[track_caller]
fn assert_agrees_following_alone(name: &str, samples: u32) {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, name);
    let job = reference.job(&shared, 1);
    let mask = Mask::of(&job);
    assert_follows(&shared, &reference, &mask, samples);
    let score = score(&shared, &reference, job, &mask, samples);
    assert!(!score.agrees(), "{name} agrees without following: {score:?}");
}

#[test]
fn cbox_bulb() {
    assert_agrees_as_it_is("cbox_bulb", 4);
}

#[test]
fn many_lights_points() {
    assert_agrees_as_it_is("many_lights_points", 4);
}

#[test]
fn smallvcm_ceiling() {
    assert_agrees_as_it_is("smallvcm_ceiling", 8);
}

#[test]
fn veach_ajar() {
    assert_agrees_as_it_is("veach_ajar", 8);
}

#[test]
fn veach_bidir() {
    assert_agrees_as_it_is("veach_bidir", 6);
}

#[test]
fn veach_mis() {
    assert_agrees_as_it_is("veach_mis", 16);
}

#[test]
fn lights_lamp() {
    assert_agrees_following("lights_lamp", 8);
}

#[test]
fn pine_hills() {
    assert_agrees_following("pine_hills", 4);
}

#[test]
fn smallvcm_point() {
    assert_agrees_following("smallvcm_point", 8);
}

#[test]
fn smallvcm_sky() {
    assert_agrees_following("smallvcm_sky", 8);
}

#[test]
fn smallvcm_sun() {
    assert_agrees_following("smallvcm_sun", 8);
}

#[test]
fn testballs_outdoor() {
    assert_agrees_following("testballs_outdoor", 8);
}

#[test]
fn vase_flowers() {
    assert_agrees_following("vase_flowers", 4);
}

/// Glass that absorbs around a flame, where the other renderer's neither absorbs nor has textures: half of the light.
#[test]
fn candle_glass_without_the_references_conventions_differs() {
    assert_agrees_following_alone("candle_glass", 8);
}

/// The ring between the cones of a spot light, and the sky.
#[test]
fn flight_helmet_without_the_references_conventions_differs() {
    assert_agrees_following_alone("flight_helmet", 48);
}

/// The ring between the cones of a spot light.
#[test]
fn lights_suzanne_without_the_references_conventions_differs() {
    assert_agrees_following_alone("lights_suzanne", 48);
}

#[test]
fn the_edits_fit_the_stages() {
    for scene in ["bottle", "light_kinds", "outdoor"] {
        let job = following::edited(Job::of_file(shipped(scene)).pipeline("pt"));
        assert_eq!(job.check(), Ok(()), "{scene}");
        assert_eq!(job.layout("compact").schedule("ordered").check(), Ok(()), "{scene}");
    }
}

#[test]
fn the_mask_leaves_out_what_is_not_diffuse() {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(Material::lambert("wall", [0.5; 3]));
    let glaze = scene.material(Material::glossy("glaze", [0.5; 3], 1.0));
    scene.quad(wall, dvec3(-9.0, -9.0, 0.0), DVec3::X * 9.0, DVec3::Y * 18.0);
    scene.quad(glaze, dvec3(0.0, -9.0, 0.0), DVec3::X * 9.0, DVec3::Y * 18.0);
    scene.camera("main", Camera { eye: DVec3::Z * 3.0, target: DVec3::ZERO, yfov: 40.0, aspect: 1.0 });
    let mask = Mask::of(&BuiltScene::new(&scene, None).job().size(16, 16));
    let expected: Vec<bool> = (0..256).map(|pixel| pixel % 16 < 8).collect();
    assert_eq!(mask.inside, expected);
    assert_eq!(mask.blocks(8), [true, false, true, false]);
}
