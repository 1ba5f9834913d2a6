//! Bidirectional path tracing makes the images of the pipelines that join no walks, whatever the weights, the scene and the ends of walks.

use glam::{DVec3, dvec3};
use std::sync::LazyLock;
use tests::agreement::{assert_agree, assert_differ, assert_same, worst_of_blocks};
use tests::compared::{ball_beside_a_wall, beside_a_caustic, lamps, leaning_mirror, sun_and_sky};
use tests::material::Material;
use tests::rendering::{BuiltScene, Job, Rendering, shipped};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::{sphere, turned_cuboid};

/// Weights and counts of implicit samples.
type Weights = (&'static str, &'static str);

const BALANCE: Weights = ("balance", "measured");
const FIRST: Weights = ("balance", "first");
const POWER: Weights = ("power", "first");
const AVERAGE: Weights = ("average", "realised");

/// Renders by `sbdpt` with all these weights, by `pt` and, where it takes samples, by `lt`: the same image.
#[track_caller]
fn assert_pipelines_agree(job: &Job, weights: &[Weights], [ours, pt, lt]: [u32; 3]) {
    let expected = job.clone().pipeline("pt").samples(pt).render();
    for (mis, counting) in weights {
        let job = job.clone().pipeline("sbdpt").set("mis", mis).set("counting", counting);
        assert_agree(&job.samples(ours).render(), &expected, &format!("sbdpt ({mis}, {counting}) and pt"));
    }
    if lt > 0 {
        assert_agree(&job.clone().pipeline("lt").samples(lt).render(), &expected, "lt and pt");
    }
}

/// Check 10: an open scene in the light of a sun and of a sky.
#[test]
fn sbdpt_agrees_under_sun_and_sky() {
    assert_pipelines_agree(&sun_and_sky().job().size(32, 32).edges(4), &[BALANCE, AVERAGE], [32, 64, 0]);
}

/// Check 10: one light of each kind.
#[test]
fn sbdpt_agrees_on_one_light_of_each_kind() {
    let job = Job::of_file(shipped("light_kinds")).size(64, 40).edges(3);
    assert_pipelines_agree(&job, &[BALANCE], [32, 96, 192]);
}

/// Check 10: a panel that emits from both sides and is in the picture, a point light and a spot light; through a lens.
#[test]
fn sbdpt_agrees_on_lamps_seen_through_a_lens() {
    assert_pipelines_agree(&lamps().job().size(40, 40).edges(4).lens(0.1, 3.0), &[FIRST], [32, 64, 128]);
}

/// Check 10: lights without extent alone.
#[test]
fn sbdpt_agrees_on_delta_lights() {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.6, 0.5, 0.4]));
    let ball = scene.material(Material::glossy("ball", [0.5, 0.6, 0.7], 0.6));
    scene.floor(floor, 0.0, 4.0);
    scene.quad(floor, dvec3(-2.0, 0.0, -1.5), DVec3::X * 4.0, DVec3::Y * 2.0);
    scene.mesh(ball, sphere(dvec3(0.3, 0.5, 0.0), 0.5, 12));
    scene.point_light(dvec3(-0.8, 1.2, 0.4), [0.5, 1.0, 0.2]);
    scene.spot_light(dvec3(1.2, 2.0, 0.8), dvec3(-0.5, -1.0, -0.4), [3.0, 2.0, 6.0], 0.3, 0.5);
    scene.directional_light(dvec3(0.5, -1.0, -0.6), [0.7, 0.5, 0.4]);
    scene.camera("main", Camera { eye: dvec3(0.0, 1.3, 4.0), target: dvec3(0.0, 0.6, 0.0), yfov: 36.0, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, None);
    assert_pipelines_agree(&scene.job().size(56, 56).edges(4), &[FIRST], [32, 64, 128]);
}

/// Check 10: caustics of smooth glass.
#[test]
fn sbdpt_agrees_on_a_caustic_of_glass() {
    let scene = beside_a_caustic(Material::glass("glass", 1.5, 0.0), sphere(dvec3(0.0, 0.6, 0.0), 0.4, 16).flat());
    assert_pipelines_agree(&scene.job().size(64, 32).edges(5), &[BALANCE], [64, 256, 0]);
}

/// Check 10: caustics of a mirror whose normals lean.
#[test]
fn sbdpt_agrees_on_a_caustic_of_a_mirror() {
    let scene = beside_a_caustic(Material::metal("mirror", [0.9, 0.8, 0.7], 0.0), leaning_mirror());
    assert_pipelines_agree(&scene.job().size(64, 32).edges(4), &[POWER], [64, 256, 0]);
}

/// Check 10: rough glass that absorbs, with smooth normals.
#[test]
fn sbdpt_agrees_on_rough_glass() {
    let bottle = Some(([0.4, 0.7, 0.9], 0.5));
    let scene = ball_beside_a_wall(Material { attenuation: bottle, ..Material::glass("glass", 1.5, 0.5) }, 8);
    assert_pipelines_agree(&scene.job().size(72, 72).edges(4), &[FIRST], [32, 64, 0]);
}

/// Check 10: rough metal.
#[test]
fn sbdpt_agrees_on_rough_metal() {
    let scene = ball_beside_a_wall(Material::metal("metal", [0.9, 0.7, 0.4], 0.4), 8);
    assert_pipelines_agree(&scene.job().size(56, 56).edges(4), &[FIRST], [32, 64, 0]);
}

/// Check 15 the other way round: a lamp inside a ball of glass that absorbs lights a floor outside.
#[test]
fn floor_beside_a_lamp_inside_glass() {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.7, 0.6, 0.5]));
    let bottle = Some(([0.4, 0.7, 0.9], 0.5));
    let glass = scene.material(Material { attenuation: bottle, ..Material::glass("glass", 1.5, 0.0) });
    let lamp = scene.material(Material::emitter("lamp", [5.0, 4.0, 3.0]));
    scene.floor(floor, 0.0, 4.0);
    scene.mesh(glass, sphere(dvec3(0.0, 0.7, 0.0), 0.5, 12).flat());
    scene.mesh(lamp, sphere(dvec3(0.0, 0.7, 0.0), 0.3, 8).flat());
    scene.camera("main", Camera { eye: dvec3(0.0, 0.15, 3.0), target: dvec3(0.0, 0.0, 0.0), yfov: 6.0, aspect: 2.0 });
    let scene = BuiltScene::new(&scene, None);
    let job = scene.job().size(64, 32).edges(4);
    let from_camera = job.clone().pipeline("pt").samples(128).render();
    assert_agree(&job.clone().pipeline("lt").samples(128).render(), &from_camera, "lt and pt");
    let job = job.pipeline("sbdpt").samples(32);
    assert_agree(&job.render(), &from_camera, "sbdpt and pt");
    let wrong = job.set("counting", "first").set("refraction_adjoint", false).render();
    assert_differ(&wrong, &from_camera, "as if importance were radiance");
}

/// Check 18: a coarse sphere with smooth normals. Without the correction of light walks the image is another one, which shows best
/// where neither sampled light nor joined walks help.
#[test]
fn sbdpt_agrees_on_a_coarse_sphere_with_smooth_normals() {
    let scene = ball_beside_a_wall(Material::lambert("clay", [0.8, 0.5, 0.3]), 3);
    let job = scene.job().size(64, 64).edges(4);
    let expected = job.clone().pipeline("pt").samples(64).render();
    let job = job.pipeline("sbdpt").set("counting", "first").samples(32);
    let splats = job.clone().set("use_explicit", false).set("use_connection", false);
    for rendering in [job.render(), splats.render()] {
        assert_agree(&rendering, &expected, "smooth normals");
        assert_same(&rendering.pixels, &expected.pixels, 8, 0.01, "smooth normals, small blocks");
    }
    let wrong = worst_of_blocks(&splats.set("shading_normal_adjoint", false).render().pixels, &expected.pixels, 8);
    assert!(wrong.largest > 12.0, "without the correction: {wrong:?}");
}

/// A closed room with a block, a light under the ceiling and a panel that emits from both sides, all in the picture.
fn closed_box() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(Material::lambert("wall", [0.75, 0.7, 0.65]));
    let block = scene.material(Material::lambert("block", [0.6, 0.3, 0.2]));
    let light = scene.material(Material::emitter("light", [6.0, 5.0, 4.0]));
    let panel = scene.material(Material::emitter("panel", [1.0, 2.0, 3.0]).two_sided());
    scene.room(wall, DVec3::splat(-1.0), DVec3::splat(1.0));
    scene.mesh(block, turned_cuboid(dvec3(-0.6, -1.0, -0.5), dvec3(0.0, 0.1, 0.1), 0.4));
    scene.ceiling(light, 0.98, 0.6);
    scene.quad(panel, dvec3(0.3, -0.3, -0.3), DVec3::X * 0.4, DVec3::Y * 0.5);
    scene.camera("main", Camera { eye: dvec3(0.3, 0.1, 0.95), target: dvec3(0.0, -0.1, 0.0), yfov: 80.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

/// Edges of the longest path in the closed box.
const BOX_EDGES: u32 = 4;

fn box_job(scene: &BuiltScene, pipeline: &str, samples: u32) -> Job {
    scene.job().pipeline(pipeline).size(32, 32).edges(BOX_EDGES).samples(samples).seed(2)
}

/// The closed box by `pt`.
static BOX: LazyLock<Rendering> = LazyLock::new(|| box_job(&closed_box(), "pt", 256).seed(1).render());

/// Checks 10 and 11: a closed box, whatever the weights and the count of implicit samples.
#[test]
fn sbdpt_agrees_on_a_closed_box() {
    let scene = closed_box();
    for (mis, counting) in [BALANCE, POWER, AVERAGE] {
        let rendering = box_job(&scene, "sbdpt", 32).set("mis", mis).set("counting", counting).render();
        assert_agree(&rendering, &BOX, &format!("{mis}, {counting}"));
    }
    assert_agree(&box_job(&scene, "lt", 64).render(), &BOX, "lt and pt");
}

/// What ends walks by chance leaves the mean of every pipeline as it was.
#[test]
fn roulette_keeps_the_mean() {
    let scene = closed_box();
    for (pipeline, samples, key, value) in [
        ("pt", 64, "roulette", "true"),
        ("nee", 64, "roulette", "true"),
        ("lt", 128, "roulette", "true"),
        ("sbdpt", 32, "roulette", "true"),
        ("pt", 64, "regularise", "roulette"),
        ("sbdpt", 32, "regularise", "roulette"),
    ] {
        let job = box_job(&scene, pipeline, samples).set("roulette_start", 1).set(key, value);
        assert_agree(&job.render(), &BOX, &format!("{pipeline}, {key}"));
    }
}

/// Walks that end by a chance that weights know of leave the mean as it was, whatever the weights, the count of implicit samples and the
/// other ways of saving eye walks, and beside glass, which is spared.
#[test]
fn mortal_walks_keep_the_mean() {
    let scene = closed_box();
    let mortal = |job: Job| job.set("eye_survival", 0.4).set("light_survival", 0.6);
    for (mis, counting) in [BALANCE, AVERAGE] {
        let job = box_job(&scene, "sbdpt", 48).set("mis", mis).set("counting", counting);
        assert_agree(&mortal(job).render(), &BOX, &format!("{mis}, {counting}"));
    }
    let few = box_job(&scene, "sbdpt", 64).set("walk_share", 0.5).set("roulette", true).set("roulette_start", 1);
    assert_agree(&mortal(few).render(), &BOX, "walk_share, roulette");
    assert_agree(&mortal(box_job(&scene, "sbdpt_pairs", 64)).render(), &BOX, "sbdpt_pairs");
    let scene = beside_a_caustic(Material::glass("glass", 1.5, 0.0), sphere(dvec3(0.0, 0.6, 0.0), 0.4, 16).flat());
    let job = scene.job().size(64, 32).edges(5);
    let expected = job.clone().pipeline("pt").samples(256).render();
    assert_agree(&mortal(job.pipeline("sbdpt").samples(96)).render(), &expected, "beside glass");
}

/// Light vertices without eye walks leave the mean as it was, whatever the weights and the count of implicit samples.
#[test]
fn a_share_of_eye_walks_keeps_the_mean() {
    let scene = closed_box();
    for ((mis, counting), share) in [(BALANCE, 0.3), (POWER, 0.3), (AVERAGE, 0.5), (BALANCE, 0.0)] {
        let job = box_job(&scene, "sbdpt", 32).set("mis", mis).set("counting", counting).set("walk_share", share);
        assert_agree(&job.render(), &BOX, &format!("{mis}, {counting}, {share}"));
    }
}

/// Eye walks that are joined to two light vertices make the same image, whatever the weights, the count of implicit samples and the
/// ends of walks, where only the second of a pair is joined, and with paths of an odd number of edges.
#[test]
fn eye_walks_of_pairs_keep_the_image() {
    let scene = closed_box();
    let job = box_job(&scene, "sbdpt_pairs", 48);
    for (mis, counting) in [BALANCE, POWER, AVERAGE] {
        let rendering = job.clone().set("mis", mis).set("counting", counting).render();
        assert_agree(&rendering, &BOX, &format!("{mis}, {counting}"));
    }
    assert_agree(&job.clone().set("early_end", true).render(), &BOX, "early_end");
    assert_agree(&job.clone().set("roulette", true).set("roulette_start", 1).render(), &BOX, "roulette");
    let without_first = job.clone().set("use_explicit", false).render();
    assert_agree(&without_first, &BOX, "where the first of a pair is not joined");
    let expected = box_job(&scene, "pt", 256).edges(5).seed(1).render();
    assert_agree(&job.edges(5).render(), &expected, "five edges");
}

/// Eye walks of pairs under a sun and a sky, where most light walks end before the second vertex.
#[test]
fn eye_walks_of_pairs_keep_the_image_in_the_open() {
    let scene = sun_and_sky();
    let job = scene.job().size(32, 32).edges(4);
    let expected = job.clone().pipeline("pt").samples(64).render();
    assert_agree(&job.pipeline("sbdpt_pairs").samples(48).render(), &expected, "sbdpt_pairs and pt");
}

/// What ends walks that can no longer be joined leaves the mean as it was.
#[test]
fn early_ends_keep_the_mean() {
    let rendering = box_job(&closed_box(), "sbdpt", 32).set("early_end", true).render();
    assert_agree(&rendering, &BOX, "early_end");
}

/// Walks that end behind two diffuse vertices take light away.
#[test]
fn cutting_walks_darkens() {
    let scene = closed_box();
    for pipeline in ["pt", "sbdpt"] {
        let cut = box_job(&scene, pipeline, 32).set("regularise", "cut").render();
        assert_differ(&cut, &BOX, pipeline);
        assert!(cut.pixels.mean_estimate().mean < BOX.pixels.mean_estimate().mean, "{pipeline} became brighter");
    }
}
