//! Scenes whose radiance is known in closed form, rendered by every pipeline that can. The numbers are those of algorithm.md section 9.

use glam::{DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, PI};
use tests::material::Material;
use tests::rendering::{BuiltScene, Job, Rendering};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::{disk, sphere};
use tests::sky::Sky;
use tests::statistics::{Estimate, spread, z_scores};

/// Pipelines that start at the camera.
const EYE_PIPELINES: [&str; 2] = ["nee", "pt"];
/// All pipelines.
const PIPELINES: [&str; 3] = ["nee", "pt", "lt"];
/// Rounding of f32 radiance and of tessellated shapes, as a share of the value.
const FLOOR: f64 = 3e-4;

fn grey(value: f64) -> Material {
    Material::lambert("grey", [value; 3])
}

/// The mean of the image is `expected`: within 4.5 standard errors, which must be below 0.5 % for the test to mean anything.
#[track_caller]
fn assert_mean(rendering: &Rendering, expected: f64, what: &str) {
    let estimate = rendering.pixels.mean_estimate();
    assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
    assert_estimate(estimate, expected, what);
}

#[track_caller]
fn assert_estimate(estimate: Estimate, expected: f64, what: &str) {
    let z = estimate.z(&Estimate::exact(expected), FLOOR * expected);
    assert!(estimate.error <= 0.005 * expected, "{what}: {estimate:?} is too noisy to test {expected}");
    assert!(z.abs() < 4.5, "{what}: {estimate:?}, expected {expected}, z = {z:.2}");
}

/// Looks at a point through a field of view so narrow that radiance is constant over the image.
fn narrow(eye: DVec3, target: DVec3) -> Camera {
    Camera { eye, target, yfov: 0.1, aspect: 1.0 }
}

/// A grey floor seen in its centre from the side, below a height of 0.6 m.
fn floor_seen_in_its_centre(albedo: f64) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(albedo));
    scene.floor(floor, 0.0, 20.0);
    scene.camera("main", narrow(dvec3(0.0, 0.5, 2.0), DVec3::ZERO));
    scene
}

fn render_small(job: Job, pipeline: &str, edges: u32, samples: u32) -> Rendering {
    job.pipeline(pipeline).edges(edges).size(16, 16).samples(samples).render()
}

/// Check 2: a convex Lambert object in a constant sky of radiance 1 has radiance rho; with rho = 1 it cannot be seen.
#[test]
fn convex_lambert_object_in_a_constant_sky() {
    for (albedo, pipeline) in [(0.5, "nee"), (0.5, "pt"), (1.0, "pt")] {
        let mut scene = SceneBuilder::new();
        let material = scene.material(grey(albedo));
        scene.mesh(material, sphere(DVec3::ZERO, 1.0, 16).flat());
        scene.camera("main", Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, yfov: 15.0, aspect: 1.0 });
        let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
        let rendering = render_small(scene.job(), pipeline, 4, 512);
        assert_mean(&rendering, albedo, &format!("{pipeline}, albedo {albedo}"));
    }
}

/// Check 2: glass loses nothing, so that a glass sphere in a constant sky of radiance 1 cannot be seen.
#[test]
fn glass_sphere_in_a_constant_sky() {
    let mut scene = SceneBuilder::new();
    let glass = scene.material(Material::glass("glass", 1.5, 0.0));
    scene.mesh(glass, sphere(DVec3::ZERO, 1.0, 16).flat());
    scene.camera("main", Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, yfov: 30.0, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
    let rendering = render_small(scene.job(), "pt", 64, 256);
    assert_mean(&rendering, 1.0, "glass sphere");
}

/// Checks 4 and 13: a point light over a plane, L = rho/pi I h/(h^2+r^2)^{3/2} at every pixel, from the camera and from the light.
#[test]
fn point_light_over_a_plane() {
    let mut scene = floor_seen_from_above(0.5);
    scene.point_light(DVec3::Y, [1.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in PIPELINES {
        let rendering = floor_job(&scene, pipeline).render();
        assert_pixels(&rendering, |r2| lambert_under_point(0.5, 1.0, r2), pipeline);
    }
}

/// Check 7: inside its inner cone a spot light is a point light; outside its outer cone there is nothing at all.
#[test]
fn spot_light_over_a_plane() {
    let (inner, outer) = (0.30, 0.45);
    let mut scene = floor_seen_from_above(0.5);
    scene.spot_light(DVec3::Y, DVec3::NEG_Y, [1.0; 3], inner, outer);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in PIPELINES {
        let rendering = floor_job(&scene, pipeline).render();
        for (index, estimate) in rendering.pixels.estimates().iter().enumerate().step_by(3) {
            let (nearest, farthest) = floor_distances(index / 3);
            if farthest < inner.tan() {
                let expected = pixel_mean(index / 3, |r2| lambert_under_point(0.5, 1.0, r2));
                let z = estimate.z(&Estimate::exact(expected), 1e-3 * expected);
                assert!(z.abs() < 6.0, "{pipeline}, pixel {}: {estimate:?}, expected {expected}", index / 3);
            } else if nearest > outer.tan() {
                assert_eq!(estimate.mean, 0.0, "{pipeline}, pixel {}: light outside the cone", index / 3);
            }
        }
    }
}

/// Check 13: the centroid of a small lit spot is where the camera projects it, to a hundredth of a pixel.
#[test]
fn splats_land_where_the_camera_projects() {
    let (x, z) = (0.3137, -0.2219);
    let mut scene = floor_seen_from_above(0.5);
    scene.spot_light(dvec3(x, 1.0, z), DVec3::NEG_Y, [1.0; 3], 0.25, 0.32);
    let scene = BuiltScene::new(&scene, None);
    let rendering = floor_job(&scene, "lt").samples(4096).render();
    let mut sums = [0.0; 3];
    for (index, pixel) in rendering.pixels.rgb.iter().enumerate() {
        let weight = f64::from(pixel[0]);
        sums[0] += weight;
        sums[1] += weight * ((index as u32 % FLOOR_PIXELS) as f64 + 0.5);
        sums[2] += weight * ((index as u32 / FLOOR_PIXELS) as f64 + 0.5);
    }
    let scale = f64::from(FLOOR_PIXELS) / (2.0 * FLOOR_HALF);
    // The camera looks straight down: its right is +Z, its up is +X.
    let expected = [(z + FLOOR_HALF) * scale, (FLOOR_HALF - x) * scale];
    for axis in 0..2 {
        let found = sums[1 + axis] / sums[0];
        assert!(
            (found - expected[axis]).abs() < 0.01,
            "axis {axis}: centroid at {found}, projected to {}",
            expected[axis]
        );
    }
}

/// Check 14: an out-of-focus plane looks the same through a thin lens from the camera and from the light.
#[test]
fn thin_lens_over_a_lit_plane() {
    let mut scene = floor_seen_from_above(0.5);
    scene.spot_light(DVec3::Y, DVec3::NEG_Y, [1.0; 3], 0.2, 0.3);
    let scene = BuiltScene::new(&scene, None);
    let blurred = |pipeline: &str| floor_job(&scene, pipeline).lens(0.4, 2.0).render();
    let (from_camera, from_light) = (blurred("nee"), blurred("lt"));
    let scores = z_scores(&from_camera.pixels.block_estimates(4), &from_light.pixels.block_estimates(4), 1e-3);
    let spread = spread(&scores);
    assert!(spread.agrees(), "{spread:?}");
    let sharp = floor_job(&scene, "nee").render();
    let centre = |rendering: &Rendering| rendering.pixels.block_estimates(4)[3 * (4 * 8 + 4)].mean;
    assert!(centre(&from_camera) < 0.9 * centre(&sharp), "the lens does not blur");
}

/// Check 7: L = rho/pi E cos for a directional light.
#[test]
fn directional_light_on_a_plane() {
    let cosine: f64 = 0.6;
    let mut scene = floor_seen_in_its_centre(0.5);
    scene.directional_light(dvec3((1.0 - cosine * cosine).sqrt(), -cosine, 0.0), [2.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 16);
        assert_mean(&rendering, 0.5 / PI * 2.0 * cosine, pipeline);
    }
}

/// Check 5: a parallel unit square at unit height has the form factor .2394565.
#[test]
fn square_light_over_a_plane() {
    let mut scene = floor_seen_in_its_centre(0.5);
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    scene.ceiling(light, 1.0, 1.0);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 1024);
        assert_mean(&rendering, 0.5 * 0.239_456_5, pipeline);
    }
}

/// Check 6: E = pi Le a^2/(a^2+h^2) under a coaxial disk; a = h gives pi/2.
#[test]
fn disk_light_over_a_plane() {
    let mut scene = floor_seen_in_its_centre(0.5);
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    scene.mesh(light, disk(DVec3::Y, DVec3::NEG_Y, 1.0, 128));
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 1024);
        assert_mean(&rendering, 0.5 / PI * FRAC_PI_2, pipeline);
    }
}

/// Check 6: E = pi Le (R/D)^2 under a sphere: R = .5, D = 2 gives .1963495.
#[test]
fn sphere_light_over_a_plane() {
    const RINGS: u32 = 48;
    let slice = PI / f64::from(RINGS);
    let same_area_seen_from_below = 0.5 * (slice / slice.sin()).sqrt();
    let mut scene = floor_seen_in_its_centre(0.5);
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    scene.mesh(light, sphere(DVec3::Y * 2.0, same_area_seen_from_below, RINGS));
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 4096);
        let estimate = rendering.pixels.mean_estimate();
        let expected = 0.5 / PI * 0.196_349_5;
        let z = estimate.z(&Estimate::exact(expected), 1e-3 * expected);
        assert!(z.abs() < 4.5, "{pipeline}: {estimate:?}, expected {expected}");
    }
}

/// Check 1: walls that emit 1 and reflect rho give the sum of rho^i below the number of edges.
#[test]
fn furnace() {
    for pipeline in ["pt", "lt"] {
        let mut scene = SceneBuilder::new();
        let walls = scene.material(Material { emission: [1.0; 3], ..grey(0.8) });
        scene.room(walls, DVec3::splat(-1.0), DVec3::splat(1.0));
        scene.camera("main", Camera { eye: dvec3(0.1, 0.2, 0.3), target: DVec3::Z * -1.0, yfov: 60.0, aspect: 1.0 });
        let scene = BuiltScene::new(&scene, None);
        let rendering = render_small(scene.job(), pipeline, 5, 4096);
        assert_mean(&rendering, 3.3616, pipeline);
    }
}

/// Check 15: out of glass at normal incidence radiance grows by eta^2 and loses 4 %: 2.25 x .96 = 2.16.
#[test]
fn radiance_of_the_sky_seen_from_inside_glass() {
    let scene =
        glass_over_a_floor(Material::lambert("black", [0.0; 3]), -2.0, narrow(dvec3(0.0, -1.0, 0.0), DVec3::ZERO));
    let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
    assert_mean(&render_small(scene.job(), "pt", 4, 1024), 2.16, "sky seen from inside glass");
}

/// Check 15: an emitter inside glass seen from outside at normal incidence: .96/2.25 = .4266667.
#[test]
fn radiance_of_an_emitter_inside_glass() {
    let scene = glass_over_a_floor(Material::emitter("light", [1.0; 3]), -1.0, narrow(DVec3::Y, DVec3::ZERO));
    let scene = BuiltScene::new(&scene, None);
    assert_mean(&render_small(scene.job(), "pt", 4, 1024), 0.426_666_7, "emitter inside glass");
}

/// Check 15: total reflection begins at 41.8103 degrees inside glass of index 1.5.
#[test]
fn total_reflection_inside_glass() {
    for (degrees, reflectance) in
        [(41.0f64, fresnel_inside(41.0, 1.5)), (41.8, fresnel_inside(41.8, 1.5)), (41.82, 1.0), (60.0, 1.0)]
    {
        let (sin, cos) = degrees.to_radians().sin_cos();
        // The difference of a hundredth of a degree must show.
        let camera = Camera { yfov: 0.001, ..narrow(dvec3(-sin, -cos, 0.0) * 0.5, DVec3::ZERO) };
        let scene = BuiltScene::new(&glass_over_a_floor(Material::emitter("light", [1.0; 3]), -1.0, camera), None);
        let rendering = scene.job().pipeline("pt").edges(4).size(1, 1).samples(65_536).render();
        let estimate = rendering.pixels.mean_estimate();
        let z = estimate.z(&Estimate::exact(reflectance), 0.02);
        assert!(z.abs() < 4.5, "{degrees} degrees: {estimate:?}, expected {reflectance}");
    }
}

/// Check 15: a slab of glass at normal incidence lets 1 - 2F/(1+F) = .9230769 through; the factor eta^2 cancels.
#[test]
fn slab_of_glass_over_an_emitter() {
    let mut scene = glass_over_a_floor(Material::emitter("light", [1.0; 3]), -1.0, narrow(DVec3::Y, DVec3::ZERO));
    let glass = scene.material(Material::glass("underside", 1.5, 0.0));
    scene.ceiling(glass, -0.5, WIDE);
    let scene = BuiltScene::new(&scene, None);
    assert_mean(&render_small(scene.job(), "pt", 32, 1024), 0.923_076_9, "slab");
}

/// Check 15: Lambert under a smooth coat of index 1.5 in a sky of 1, seen at normal incidence:
/// .96 (1-F_ext) rho/(2.25 (1 - rho F_int)), plus .04 of the sky that the coat reflects.
#[test]
fn lambert_under_a_smooth_coat() {
    for (albedo, under_the_coat) in [(0.5, 0.276_070_9), (0.8, 0.592_833_4), (1.0, 0.96)] {
        let scene = glass_over_a_floor(grey(albedo), -0.002, narrow(DVec3::Y, DVec3::ZERO));
        let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
        assert_mean(&render_small(scene.job(), "pt", 64, 2048), under_the_coat + 0.04, &format!("albedo {albedo}"));
    }
}

/// Edge of what stands for an infinite plane, metres.
const WIDE: f64 = 400.0;

/// The upper face of a body of glass at height 0, and a floor inside the glass.
fn glass_over_a_floor(floor: Material, height: f64, camera: Camera) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let glass = scene.material(Material::glass("glass", 1.5, 0.0));
    let floor = scene.material(floor);
    scene.floor(glass, 0.0, WIDE);
    scene.floor(floor, height, WIDE);
    scene.camera("main", camera);
    scene
}

/// Fresnel reflectance for unpolarised light that meets a surface from inside glass, below the critical angle.
fn fresnel_inside(degrees: f64, eta: f64) -> f64 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let cos_out = (1.0 - (eta * sin).powi(2)).sqrt();
    let perpendicular = (eta * cos - cos_out) / (eta * cos + cos_out);
    let parallel = (cos - eta * cos_out) / (cos + eta * cos_out);
    (perpendicular.powi(2) + parallel.powi(2)) / 2.0
}

/// Pixels along an edge of the image of the floor.
const FLOOR_PIXELS: u32 = 32;
/// Half of the floor that the camera above it sees, metres.
const FLOOR_HALF: f64 = 0.8;

fn floor_seen_from_above(albedo: f64) -> SceneBuilder {
    let height = 4.0;
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(albedo));
    scene.floor(floor, 0.0, 20.0);
    let yfov = 2.0 * (FLOOR_HALF / height).atan().to_degrees();
    scene.camera("main", Camera { eye: DVec3::Y * height, target: DVec3::ZERO, yfov, aspect: 1.0 });
    scene
}

fn floor_job(scene: &BuiltScene, pipeline: &str) -> Job {
    scene.job().pipeline(pipeline).edges(2).size(FLOOR_PIXELS, FLOOR_PIXELS).samples(1024)
}

fn lambert_under_point(albedo: f64, height: f64, r2: f64) -> f64 {
    albedo / PI * height / (height * height + r2).powf(1.5)
}

/// The mean over a pixel of a function of the squared distance from the origin, by 8 x 8 midpoints.
fn pixel_mean(pixel: usize, value: impl Fn(f64) -> f64) -> f64 {
    let points = pixel_points(pixel, 8);
    points.iter().map(|r2| value(*r2)).sum::<f64>() / points.len() as f64
}

/// Squared distances from the origin of midpoints of `steps` x `steps` parts of a pixel of the floor.
fn pixel_points(pixel: usize, steps: u32) -> Vec<f64> {
    let side = 2.0 * FLOOR_HALF / f64::from(FLOOR_PIXELS);
    let (column, row) = (pixel as u32 % FLOOR_PIXELS, pixel as u32 / FLOOR_PIXELS);
    let at =
        |index: u32, step: u32| (f64::from(index) + (f64::from(step) + 0.5) / f64::from(steps)) * side - FLOOR_HALF;
    (0..steps * steps).map(|i| at(column, i % steps).powi(2) + at(row, i / steps).powi(2)).collect()
}

/// Bounds on the distance from the origin over a pixel, a little wide.
fn floor_distances(pixel: usize) -> (f64, f64) {
    let side = 2.0 * FLOOR_HALF / f64::from(FLOOR_PIXELS);
    let centre = pixel_points(pixel, 1)[0].sqrt();
    (centre - side, centre + side)
}

/// Every pixel of the floor is as expected: the rule for z-scores, with 1e-3 for rounding.
#[track_caller]
fn assert_pixels(rendering: &Rendering, value: impl Fn(f64) -> f64, what: &str) {
    assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
    // The image is grey: its channels are one number, not three.
    let scores: Vec<f64> = rendering
        .pixels
        .estimates()
        .iter()
        .step_by(3)
        .enumerate()
        .map(|(pixel, estimate)| {
            let expected = pixel_mean(pixel, &value);
            estimate.z(&Estimate::exact(expected), 1e-3 * expected)
        })
        .collect();
    let spread = spread(&scores);
    assert!(spread.agrees(), "{what}: {spread:?}");
    let mean = rendering.pixels.mean_estimate();
    assert!(mean.error < 0.005 * mean.mean, "{what}: {mean:?} is too noisy to test anything");
}
