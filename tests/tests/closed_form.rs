//! Scenes whose radiance is known in closed form, rendered by every pipeline that can. The numbers are those of algorithm.md section 9.

use glam::{DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, PI};
use tests::closed_form::{DISK_LIGHT, FloorLight, SPHERE_LIGHT, SQUARE_LIGHT};
use tests::closed_form::{FLOOR, FROM_ABOVE, FROM_BELOW_THE_LIGHT, WIDE, assert_mean, ball_in_a_constant_sky};
use tests::closed_form::{emitter_inside_glass, floor_below_glass, furnace as furnace_room, glass_over_a_floor};
use tests::closed_form::{grey, lambert_under_point, narrow, sky_above, sky_from_inside_glass};
use tests::material::Material;
use tests::rendering::{BuiltScene, Job, Rendering};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::quad;
use tests::sky::Sky;
use tests::statistics::{Estimate, spread, z_scores};

/// Pipelines that start at the camera.
const EYE_PIPELINES: [&str; 2] = ["nee", "pt"];
/// All pipelines.
const PIPELINES: [&str; 3] = ["nee", "pt", "lt"];

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

/// Check 2: a convex Lambert object in a constant sky of radiance 1 has radiance rho.
#[test]
fn convex_lambert_object_in_a_constant_sky() {
    let scene = ball_in_a_constant_sky(grey(0.5), 15.0);
    for (pipeline, samples) in [("nee", 512), ("pt", 512), ("lt", 2048)] {
        let rendering = render_small(scene.job(), pipeline, 4, samples);
        assert_mean(&rendering, 0.5, pipeline);
    }
}

/// Check 2: with rho = 1 the object cannot be told from the sky behind it, at its rim neither.
#[test]
fn white_object_in_a_constant_sky_cannot_be_seen() {
    let scene = ball_in_a_constant_sky(grey(1.0), 30.0);
    for (pipeline, samples) in [("nee", 256), ("pt", 256), ("lt", 2048)] {
        let rendering = render_small(scene.job(), pipeline, 4, samples);
        assert_mean(&rendering, 1.0, pipeline);
        let exact = Estimate::exact(1.0);
        let scores: Vec<f64> =
            rendering.pixels.estimates().iter().step_by(3).map(|pixel| pixel.z(&exact, FLOOR)).collect();
        let spread = spread(&scores);
        assert!(spread.agrees(), "{pipeline}: {spread:?}");
    }
}

/// Check 2: glass loses nothing, so that a glass sphere in a constant sky of radiance 1 cannot be seen.
#[test]
fn glass_sphere_in_a_constant_sky() {
    let scene = ball_in_a_constant_sky(Material::glass("glass", 1.5, 0.0), 30.0);
    // The flat faces keep some walks inside for long: after 64 edges 0.3 % of the light of the image is still in there.
    let rendering = render_small(scene.job(), "pt", 250, 256);
    assert_mean(&rendering, 1.0, "glass sphere");
}

/// Checks 4 and 13: a point light over a plane, L = rho/pi I h/(h^2+r^2)^{3/2} at every pixel, from the camera and from the light.
#[test]
fn point_light_over_a_plane() {
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.point_light(DVec3::Y, [1.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in PIPELINES {
        let rendering = FROM_ABOVE.job(&scene, pipeline).render();
        FROM_ABOVE.assert_pixels(&rendering, |place| lambert_under_point(0.5, 1.0, place), pipeline);
    }
}

/// Check 7: inside its inner cone a spot light is a point light; outside its outer cone there is nothing at all.
#[test]
fn spot_light_over_a_plane() {
    let (inner, outer) = (0.30, 0.45);
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.spot_light(DVec3::Y, DVec3::NEG_Y, [1.0; 3], inner, outer);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in PIPELINES {
        let rendering = FROM_ABOVE.job(&scene, pipeline).render();
        FROM_ABOVE.assert_below_a_spot(&rendering, 0.5, [inner, outer], pipeline);
    }
}

/// Check 13: the centroid of a small lit spot is where the camera projects it, to a hundredth of a pixel.
#[test]
fn splats_land_where_the_camera_projects() {
    let (x, z) = (0.3137, -0.2219);
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.spot_light(dvec3(x, 1.0, z), DVec3::NEG_Y, [1.0; 3], 0.25, 0.32);
    let scene = BuiltScene::new(&scene, None);
    let rendering = FROM_ABOVE.job(&scene, "lt").samples(4096).render();
    FROM_ABOVE.assert_centroid(&rendering, [x, z]);
}

/// Check 14: an out-of-focus plane looks the same through a thin lens from the camera and from the light.
#[test]
fn thin_lens_over_a_lit_plane() {
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.spot_light(DVec3::Y, DVec3::NEG_Y, [1.0; 3], 0.2, 0.3);
    let scene = BuiltScene::new(&scene, None);
    // Not focused halfway, where a lens seen from the wrong end makes the same blur.
    let blurred = |pipeline: &str| FROM_ABOVE.job(&scene, pipeline).lens(0.3, 1.6).render();
    let (from_camera, from_light) = (blurred("pt"), blurred("lt"));
    let scores = z_scores(&from_camera.pixels.block_estimates(2), &from_light.pixels.block_estimates(2), 1e-3);
    let spread = spread(&scores);
    assert!(spread.agrees(), "{spread:?}");
    let (mean_a, mean_b) = (from_camera.pixels.mean_estimate(), from_light.pixels.mean_estimate());
    assert!(mean_a.z(&mean_b, FLOOR * mean_a.mean).abs() < 4.0, "whole image: {mean_a:?} against {mean_b:?}");
    let sharp = FROM_ABOVE.job(&scene, "pt").render();
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
        let rendering = render_small(scene.job(), pipeline, 2, 64);
        assert_mean(&rendering, 0.5 / PI * 2.0 * cosine, pipeline);
    }
    let mut scene = FROM_ABOVE.floor(0.5, 2.0);
    scene.directional_light(dvec3((1.0 - cosine * cosine).sqrt(), -cosine, 0.0), [2.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    let rendering = FROM_ABOVE.job(&scene, "lt").render();
    FROM_ABOVE.assert_pixels(&rendering, |_| 0.5 / PI * 2.0 * cosine, "lt");
}

/// Check 18: where the shading normal is tilted, light counts with the cosine to that normal, whichever end a walk began at.
#[test]
fn directional_light_on_a_plane_with_tilted_normals() {
    let (tilt, slant) = (0.6f64, 0.8f64);
    let mut scene = FROM_ABOVE.floor(0.0, 0.01);
    let material = scene.material(grey(0.5));
    let mut plane = quad(dvec3(-1.0, 0.001, 1.0), DVec3::X * 2.0, DVec3::NEG_Z * 2.0);
    plane.normals = vec![dvec3(tilt.sin(), tilt.cos(), 0.0); 4];
    scene.mesh(material, plane);
    scene.directional_light(dvec3(-slant.sin(), -slant.cos(), 0.0), [2.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    for (pipeline, samples) in [("nee", 64), ("pt", 64), ("lt", 1024)] {
        let rendering = FROM_ABOVE.job(&scene, pipeline).samples(samples).render();
        FROM_ABOVE.assert_pixels(&rendering, |_| 0.5 / PI * 2.0 * (slant - tilt).cos(), pipeline);
    }
}

/// Check 5: a parallel unit square at unit height has the form factor .2394565.
#[test]
fn square_light_over_a_plane() {
    let mut scene = floor_seen_in_its_centre(0.5);
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    (SQUARE_LIGHT.add)(&mut scene, light);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 1024);
        assert_mean(&rendering, 0.5 * 0.239_456_5, pipeline);
    }
    assert_lit_by(SQUARE_LIGHT);
}

/// Every pixel of a floor under a light, by all pipelines.
#[track_caller]
fn assert_lit_by(light: FloorLight) {
    let scene = light.over_a_floor();
    for (pipeline, samples) in [("nee", 1024), ("pt", 1024), ("lt", 16_384)] {
        let rendering = FROM_BELOW_THE_LIGHT.job(&scene, pipeline).samples(samples).render();
        light.assert_pixels(&rendering, pipeline);
    }
}

/// Check 6: E = pi Le a^2/(a^2+h^2) under a coaxial disk; a = h gives pi/2.
#[test]
fn disk_light_over_a_plane() {
    let mut scene = floor_seen_in_its_centre(0.5);
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    (DISK_LIGHT.add)(&mut scene, light);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 1024);
        assert_mean(&rendering, 0.5 / PI * FRAC_PI_2, pipeline);
    }
    assert_lit_by(DISK_LIGHT);
}

/// Check 6: E = pi Le (R/D)^2 under a sphere: R = .5, D = 2 gives .1963495.
#[test]
fn sphere_light_over_a_plane() {
    let mut scene = floor_seen_in_its_centre(0.5);
    let light = scene.material(Material::emitter("light", [1.0; 3]));
    (SPHERE_LIGHT.add)(&mut scene, light);
    let scene = BuiltScene::new(&scene, None);
    for pipeline in EYE_PIPELINES {
        let rendering = render_small(scene.job(), pipeline, 2, 4096);
        let estimate = rendering.pixels.mean_estimate();
        let expected = 0.5 / PI * 0.196_349_5;
        let z = estimate.z(&Estimate::exact(expected), 1e-3 * expected);
        assert!(z.abs() < 4.5, "{pipeline}: {estimate:?}, expected {expected}");
    }
    assert_lit_by(SPHERE_LIGHT);
}

/// Check 1: walls that emit 1 and reflect rho give the sum of rho^i below the number of edges.
#[test]
fn furnace() {
    for pipeline in ["pt", "lt"] {
        let rendering = render_small(furnace_room(0.8).job(), pipeline, 5, 1024);
        assert_mean(&rendering, 3.3616, pipeline);
    }
}

/// Check 15: out of glass at normal incidence radiance grows by eta^2 and loses 4 %: 2.25 x .96 = 2.16.
#[test]
fn radiance_of_the_sky_seen_from_inside_glass() {
    assert_mean(&render_small(sky_from_inside_glass().job(), "pt", 4, 1024), 2.16, "sky seen from inside glass");
}

/// Check 15: an emitter inside glass seen from outside at normal incidence: .96/2.25 = .4266667.
#[test]
fn radiance_of_an_emitter_inside_glass() {
    assert_mean(&render_small(emitter_inside_glass().job(), "pt", 4, 1024), 0.426_666_7, "emitter inside glass");
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

/// Check 15: a floor inside glass gets 1 - F_ext = .9082220 of the light of a sky above, however it bends on its way in: the factor
/// eta^2 of radiance meets the narrowed cone, importance carries no factor. Refracted light stays within 42 degrees of the vertical,
/// so that a lid of glass between black walls does for an infinite one.
#[test]
fn floor_inside_glass_under_a_sky() {
    let scene = BuiltScene::new(&floor_below_glass(0.0), Some(&sky_above()));
    for (pipeline, samples) in [("nee", 1024), ("pt", 1024), ("lt", 16_384)] {
        let rendering = FROM_BELOW_THE_LIGHT.job(&scene, pipeline).edges(3).samples(samples).render();
        FROM_BELOW_THE_LIGHT.assert_pixels(&rendering, |_| 0.5 * 0.908_222_0, pipeline);
    }
}

/// The same with rough glass, for which there is no closed form: walks from the camera and from the light agree.
#[test]
fn floor_inside_rough_glass_under_a_sky() {
    let scene = BuiltScene::new(&floor_below_glass(0.5), Some(&sky_above()));
    let [from_camera, from_light] = [("pt", 4096), ("lt", 16_384)].map(|(pipeline, samples)| {
        let rendering = FROM_BELOW_THE_LIGHT.job(&scene, pipeline).edges(3).samples(samples).render();
        assert_eq!(rendering.rejected, 0, "{pipeline}: rejected contributions");
        rendering.pixels.mean_estimate()
    });
    assert!(from_light.error < 0.005 * from_light.mean, "{from_light:?} is too noisy to test anything");
    let z = from_camera.z(&from_light, FLOOR * from_camera.mean);
    assert!(z.abs() < 4.5, "pt {from_camera:?}, lt {from_light:?}");
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

/// Fresnel reflectance for unpolarised light that meets a surface from inside glass, below the critical angle.
fn fresnel_inside(degrees: f64, eta: f64) -> f64 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let cos_out = (1.0 - (eta * sin).powi(2)).sqrt();
    let perpendicular = (eta * cos - cos_out) / (eta * cos + cos_out);
    let parallel = (cos - eta * cos_out) / (cos + eta * cos_out);
    (perpendicular.powi(2) + parallel.powi(2)) / 2.0
}
