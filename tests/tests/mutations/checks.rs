//! Comparisons that hold for the stages as they are, and have to notice errors in them.

use glam::{DVec3, dvec3};
use std::f64::consts::PI;
use tests::closed_form::{ball_in_a_constant_sky, floor_below_glass, furnace, grey, narrow, sky_above};
use tests::compared;
use tests::material::Material;
use tests::mutation::{Check, Stages, Verdict};
use tests::rendering::{BuiltScene, Job, shipped};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::{quad, sphere};
use tests::sky::Sky;

/// Pixels along an edge of a block whose mean is compared.
const BLOCK: usize = 4;

/// Two pipelines, each with its samples, must show the same image.
fn same(stages: Stages, job: Job, pipelines: [(&str, u32); 2]) -> Verdict {
    same_blocks(stages, job, pipelines, BLOCK)
}

fn same_blocks(stages: Stages, job: Job, pipelines: [(&str, u32); 2], block: usize) -> Verdict {
    let [a, b] = pipelines.map(|(name, samples)| stages.render(job.clone().pipeline(name).samples(samples)));
    Verdict::same(&a, &b, block)
}

/// A pipeline, with its samples, must show this radiance everywhere.
fn constant(stages: Stages, job: Job, (pipeline, samples): (&str, u32), expected: f64) -> Verdict {
    Verdict::constant(&stages.render(job.pipeline(pipeline).samples(samples)), expected, BLOCK)
}

/// A small image of paths of so many edges.
fn small(scene: &BuiltScene, edges: u32) -> Job {
    scene.job().size(24, 24).edges(edges)
}

fn seen(mut scene: SceneBuilder, camera: Camera) -> BuiltScene {
    scene.camera("main", camera);
    BuiltScene::new(&scene, None)
}

/// Looks straight down on the square of this half edge about the origin, from a height.
fn from_above(height: f64, half: f64) -> Camera {
    let yfov = 2.0 * (half / height).atan().to_degrees();
    Camera { eye: DVec3::Y * height, target: DVec3::ZERO, yfov, aspect: 1.0 }
}

pub static LAMPS_FROM_THE_LIGHTS: Check =
    Check::new("lt and pt, lamps", |stages| same(stages, small(&compared::lamps(), 4), [("lt", 512), ("pt", 256)]));

fn sun_and_sky(stages: Stages, pipelines: [(&str, u32); 2]) -> Verdict {
    same(stages, small(&compared::sun_and_sky(), 3), pipelines)
}

pub static SUN_AND_SKY_FROM_THE_CAMERA: Check =
    Check::new("pt and nee, sun and sky", |stages| sun_and_sky(stages, [("pt", 256), ("nee", 256)]));
pub static SUN_AND_SKY_FROM_THE_LIGHTS: Check =
    Check::new("lt and pt, sun and sky", |stages| sun_and_sky(stages, [("lt", 1024), ("pt", 128)]));
pub static SUN_AND_SKY_FROM_BOTH_SIDES: Check =
    Check::new("sbdpt and pt, sun and sky", |stages| sun_and_sky(stages, [("sbdpt", 256), ("pt", 128)]));

/// A floor under a sky, and a strong lamp below the floor that takes most of the light samples.
pub static SKY_AND_HIDDEN_LAMP: Check = Check::new("pt and nee, sky and hidden lamp", |stages| {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.6));
    scene.floor(floor, 0.0, 2.0);
    scene.point_light(DVec3::NEG_Y, [3.0; 3]);
    scene.camera("main", from_above(2.0, 0.8));
    let sky = Sky::from_directions(32, 16, |towards| [0.2 + 0.8 * towards.x.max(0.0), 0.3, 0.6 + 0.4 * towards.y]);
    let scene = BuiltScene::new(&scene, Some(&sky));
    same(stages, small(&scene, 2), [("pt", 1024), ("nee", 1024)])
});

/// A floor in the light of a large panel above it and of a small one beside it; a third shows it its dark back.
fn near_panels(stages: Stages, floor: Material, pipelines: [(&str, u32); 2]) -> Verdict {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(floor);
    let large = scene.material(Material::emitter("large", [1.0, 1.5, 1.2]));
    let near = scene.material(Material::emitter("near", [5.0, 3.0, 4.0]));
    scene.floor(floor, 0.0, 2.0);
    scene.ceiling(large, 0.5, 0.8);
    scene.quad(near, dvec3(0.35, 0.02, 0.15), DVec3::Y * 0.2, DVec3::NEG_Z * 0.3);
    scene.quad(near, dvec3(-0.35, 0.02, 0.15), DVec3::Y * 0.2, DVec3::NEG_Z * 0.3);
    let camera = Camera { eye: dvec3(0.0, 0.4, 1.5), target: DVec3::ZERO, yfov: 18.0, aspect: 1.0 };
    same(stages, small(&seen(scene, camera), 2), pipelines)
}

pub static NEAR_PANELS_FROM_THE_CAMERA: Check =
    Check::new("pt and nee, near panels", |stages| near_panels(stages, grey(0.6), [("pt", 512), ("nee", 512)]));
pub static NEAR_PANELS_FROM_THE_LIGHTS: Check =
    Check::new("lt and pt, near panels", |stages| near_panels(stages, grey(0.6), [("lt", 1024), ("pt", 256)]));
pub static NEAR_PANELS_FROM_BOTH_SIDES: Check =
    Check::new("sbdpt and pt, near panels", |stages| near_panels(stages, grey(0.6), [("sbdpt", 256), ("pt", 512)]));
pub static PANELS_OVER_METAL: Check = Check::new("pt and nee, near panels over rough metal", |stages| {
    near_panels(stages, Material::metal("metal", [0.9, 0.7, 0.4], 0.5), [("pt", 512), ("nee", 512)])
});

pub static CORNELL_BOX: Check = Check::new("pt and nee, Cornell box", |stages| {
    let job = Job::of_file(shipped("cornell_box")).size(24, 24).edges(5);
    same(stages, job, [("pt", 512), ("nee", 512)])
});

/// A floor below a ceiling whose normals lean, which a panel lights from below: no path of two edges.
pub static CEILING_FROM_BOTH_SIDES: Check = Check::new("sbdpt and pt, lit ceiling with leaning normals", |stages| {
    let mut scene = SceneBuilder::new();
    let white = scene.material(grey(0.8));
    let light = scene.material(Material::emitter("light", [3.0; 3]));
    let mut ceiling = quad(dvec3(-0.8, 0.8, -0.8), DVec3::X * 1.6, DVec3::Z * 1.6);
    ceiling.normals = vec![dvec3(0.4f64.sin(), -0.4f64.cos(), 0.0); 4];
    scene.mesh(white, ceiling);
    scene.floor(white, 0.0, 1.6);
    scene.quad(light, dvec3(-0.8, 0.4, 0.4), DVec3::X * 0.5, DVec3::NEG_Z * 0.8);
    let camera = Camera { eye: dvec3(0.0, 0.3, 2.0), target: DVec3::ZERO, yfov: 25.0, aspect: 1.0 };
    same(stages, small(&seen(scene, camera), 4), [("sbdpt", 512), ("pt", 2048)])
});

/// A ball with smooth normals of few rings in the light of a panel.
pub static COARSE_BALL: Check = Check::new("lt and pt, coarse ball with smooth normals", |stages| {
    let mut scene = SceneBuilder::new();
    let clay = scene.material(Material::lambert("clay", [0.8, 0.5, 0.3]));
    let light = scene.material(Material::emitter("light", [3.0; 3]));
    scene.mesh(clay, sphere(DVec3::ZERO, 0.5, 4));
    scene.ceiling(light, 1.0, 1.0);
    let camera = Camera { eye: dvec3(0.5, 0.3, 3.0), target: DVec3::ZERO, yfov: 20.0, aspect: 1.0 };
    same(stages, small(&seen(scene, camera), 2), [("lt", 2048), ("pt", 512)])
});

/// A plane whose normals lean, in parallel light that slants.
pub static LEANING_NORMALS: Check = Check::new("lt, rho E cos / pi with leaning normals", |stages| {
    let (tilt, slant) = (0.3f64, 0.5f64);
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.5));
    let mut plane = quad(dvec3(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::NEG_Z * 2.0);
    plane.normals = vec![dvec3(tilt.sin(), tilt.cos(), 0.0); 4];
    scene.mesh(floor, plane);
    scene.directional_light(dvec3(-slant.sin(), -slant.cos(), 0.0), [2.0; 3]);
    let scene = seen(scene, from_above(2.0, 0.8));
    constant(stages, small(&scene, 2), ("lt", 512), 0.5 / PI * 2.0 * (slant - tilt).cos())
});

/// A mirror that shows a panel above a floor.
pub static MIRROR: Check = Check::new("pt and nee, mirror", |stages| {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.5));
    let mirror = scene.material(Material::metal("mirror", [0.9, 0.8, 0.7], 0.0));
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    scene.floor(floor, 0.0, 4.0);
    scene.quad(mirror, dvec3(-1.0, 0.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0);
    scene.ceiling(light, 1.5, 1.0);
    let camera = Camera { eye: dvec3(0.0, 0.8, 3.0), target: dvec3(0.0, 0.8, 0.0), yfov: 40.0, aspect: 1.0 };
    same(stages, small(&seen(scene, camera), 2), [("pt", 128), ("nee", 128)])
});

/// A floor beside a mirror, which throws the light of a panel on it.
pub static CAUSTIC_FROM_BOTH_SIDES: Check = Check::new("sbdpt and pt, caustic of a mirror", |stages| {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.6));
    let mirror = scene.material(Material::metal("mirror", [0.9, 0.8, 0.7], 0.0));
    let light = scene.material(Material::emitter("light", [3.0; 3]));
    scene.floor(floor, 0.0, 2.0);
    scene.quad(mirror, dvec3(-0.3, 0.0, 0.5), DVec3::NEG_Z, DVec3::Y);
    scene.ceiling(light, 1.0, 1.0);
    same(stages, small(&seen(scene, from_above(0.9, 0.25)), 3), [("sbdpt", 512), ("pt", 1024)])
});

/// The sharp disk of a spot light on a floor, seen from above.
fn disk_of_light(stages: Stages, camera: impl Fn(Job) -> Job) -> Verdict {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.5));
    scene.floor(floor, 0.0, 20.0);
    scene.spot_light(dvec3(0.1, 1.0, -0.05), DVec3::NEG_Y, [1.0; 3], 0.29, 0.3);
    let scene = seen(scene, from_above(4.0, 0.8));
    same_blocks(stages, camera(small(&scene, 2)), [("lt", 512), ("pt", 512)], 1)
}

pub static DISK_OF_LIGHT: Check = Check::new("lt and pt, disk of light", |stages| disk_of_light(stages, |job| job));
pub static THROUGH_A_LENS: Check =
    Check::new("lt and pt, disk of light through a lens", |stages| disk_of_light(stages, |job| job.lens(0.3, 1.6)));

pub static BELOW_A_POINT: Check = Check::new("nee, rho I / (pi h^2) below a point light", |stages| {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.5));
    scene.floor(floor, 0.0, 20.0);
    scene.point_light(DVec3::Y * 2.0, [1.0; 3]);
    let scene = seen(scene, narrow(DVec3::Y * 3.0, DVec3::ZERO));
    constant(stages, small(&scene, 2), ("nee", 64), 0.5 / PI / 4.0)
});

pub static FURNACE_FROM_THE_CAMERA: Check =
    Check::new("pt, furnace", |stages| constant(stages, small(&furnace(0.8), 4), ("pt", 512), 2.952));
pub static FURNACE_FROM_THE_LIGHTS: Check =
    Check::new("lt, furnace", |stages| constant(stages, small(&furnace(0.8), 4), ("lt", 512), 2.952));
/// Eye walks that meet light and light walks that are joined to the camera, weighted against each other over whole paths.
pub static FURNACE_BY_WHOLE_WALKS: Check = Check::new("sbdpt without joined walks, furnace", |stages| {
    let scene = furnace(0.8);
    let job = small(&scene, 4).set("use_explicit", false).set("use_connection", false);
    constant(stages, job, ("sbdpt", 256), 2.952)
});

pub static FURNACE_BY_FEW_WALKS: Check = Check::new("sbdpt with a share of its eye walks, furnace", |stages| {
    constant(stages, small(&furnace(0.8), 4).set("walk_share", 0.3), ("sbdpt", 256), 2.952)
});

pub static FURNACE_BY_MORTAL_WALKS: Check =
    Check::new("sbdpt with walks that end by a chance that weights know of, furnace", |stages| {
        let scene = furnace(0.8);
        let job = small(&scene, 4).set("eye_survival", 0.4).set("light_survival", 0.6);
        constant(stages, job, ("sbdpt", 256), 2.952)
    });

pub static FURNACE_BY_PAIRS: Check = Check::new("sbdpt_pairs, furnace", |stages| {
    constant(stages, small(&furnace(0.8), 5), ("sbdpt_pairs", 192), 3.3616)
});

pub static WHITE_METAL: Check = Check::new("pt, white metal reflects no more than it gets", |stages| {
    let scene = ball_in_a_constant_sky(Material::metal("metal", [1.0; 3], 0.7), 22.0);
    Verdict::at_most(&stages.render(small(&scene, 2).pipeline("pt").samples(256)), 1.0, BLOCK)
});

pub static EMITTER_INSIDE_GLASS: Check =
    Check::new("pt, emitter inside glass that absorbs half: .96/2.25/2", |stages| {
        let mut scene = SceneBuilder::new();
        let half = Some(([0.5; 3], 1.0));
        let glass = scene.material(Material { attenuation: half, ..Material::glass("glass", 1.5, 0.0) });
        let light = scene.material(Material::emitter("light", [1.0; 3]));
        scene.floor(glass, 0.0, 400.0);
        scene.floor(light, -1.0, 400.0);
        let scene = seen(scene, narrow(DVec3::Y, DVec3::ZERO));
        constant(stages, small(&scene, 4), ("pt", 256), 0.213_333_3)
    });

pub static FLOOR_INSIDE_GLASS: Check = Check::new("lt, floor inside glass: .9082220 rho", |stages| {
    let scene = BuiltScene::new(&floor_below_glass(0.0), Some(&sky_above()));
    constant(stages, small(&scene, 3), ("lt", 2048), 0.5 * 0.908_222_0)
});
pub static FLOOR_INSIDE_ROUGH_GLASS: Check = Check::new("lt and pt, floor inside rough glass", |stages| {
    let scene = BuiltScene::new(&floor_below_glass(0.5), Some(&sky_above()));
    same(stages, small(&scene, 3), [("lt", 2048), ("pt", 512)])
});

/// A floor and a panel inside a body of coloured glass, seen through its upper face.
pub static INSIDE_COLOURED_GLASS: Check = Check::new("pt and nee, inside coloured glass", |stages| {
    let mut scene = SceneBuilder::new();
    let colour = Some(([0.4, 0.6, 0.8], 0.5));
    let glass = scene.material(Material { attenuation: colour, ..Material::glass("glass", 1.5, 0.0) });
    let floor = scene.material(grey(0.6));
    let light = scene.material(Material::emitter("light", [5.0; 3]));
    scene.floor(glass, 1.0, 8.0);
    scene.floor(floor, 0.0, 8.0);
    scene.quad(light, dvec3(0.7, 0.1, 0.4), DVec3::Y * 0.6, DVec3::NEG_Z * 0.8);
    same(stages, small(&seen(scene, from_above(3.0, 0.6)), 4), [("pt", 512), ("nee", 256)])
});
