//! Where renderers break: no loss over many bounces, no light through closed walls, broken geometry, extreme scales.

use glam::{DVec3, dvec3};
use tests::material::Material;
use tests::rendering::{BuiltScene, Rendering};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::turned_cuboid;
use tests::sky::Sky;
use tests::statistics::Estimate;

/// Walls that emit 1 and reflect everything: after 64 edges the radiance is 64, and nothing is lost or rejected.
#[test]
fn albedo_1_in_a_closed_box_over_64_edges() {
    let mut scene = SceneBuilder::new();
    let walls = scene.material(Material { emission: [1.0; 3], ..Material::lambert("walls", [1.0; 3]) });
    scene.room(walls, dvec3(-1.0, -0.5, -2.0), dvec3(1.0, 0.5, 2.0));
    scene.camera("main", Camera { eye: dvec3(0.1, 0.2, 1.0), target: DVec3::NEG_Z, yfov: 60.0, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, None);
    let rendering = scene.job().pipeline("pt").edges(64).size(16, 16).samples(128).render();
    let estimate = rendering.pixels.mean_estimate();
    assert_eq!(rendering.rejected, 0);
    assert!(estimate.error < 0.01 * 64.0, "{estimate:?} is too noisy to test anything");
    assert!(estimate.z(&Estimate::exact(64.0), 1e-4 * 64.0).abs() < 4.5, "{estimate:?}, expected 64");
}

/// A closed box about the origin.
#[test]
fn no_light_leaks_into_a_closed_box() {
    assert_dark(DVec3::ZERO, 0.0);
}

/// A closed box, turned, whose vertices f32 rounds to a grid of some micrometres.
#[test]
fn no_light_leaks_into_a_turned_box_far_away() {
    assert_dark(dvec3(103.7, -41.3, 77.1), 0.37);
}

/// Nothing of a sun, a sky and a point light just above the lid gets into a closed box: 1e7 rays find nothing.
#[track_caller]
fn assert_dark(centre: DVec3, angle: f64) {
    let size = dvec3(1.3, 0.9, 1.7);
    let mut scene = SceneBuilder::new();
    let walls = scene.material(Material::lambert("walls", [0.9; 3]).two_sided());
    scene.mesh(walls, turned_cuboid(centre - size, centre + size, angle));
    scene.directional_light(dvec3(-0.3, -1.0, 0.2), [10.0; 3]);
    scene.point_light(centre + dvec3(0.0, 1.1, 0.0), [10.0; 3]);
    scene.camera(
        "main",
        Camera { eye: centre + dvec3(0.2, 0.1, 0.9), target: centre - DVec3::Z, yfov: 90.0, aspect: 1.0 },
    );
    let scene = BuiltScene::new(&scene, Some(&Sky::constant([10.0; 3])));
    let rendering = scene.job().pipeline("pt").edges(16).size(64, 64).samples(128).render();
    assert!(rendering.rays >= 10_000_000, "only {} rays were traced", rendering.rays);
    let lit = rendering.pixels.rgb.iter().filter(|pixel| **pixel != [0.0; 3]).count();
    assert_eq!(lit, 0, "light leaked into {lit} pixels");
}

/// The same picture at every size: nothing in the renderer has a length of its own. Powers of two keep every mantissa.
#[test]
fn scale_does_not_matter() {
    let expected = scaled_box(1.0);
    for exponent in [-17, -10, 10, 20] {
        let found = scaled_box(2.0f64.powi(exponent));
        assert_eq!(found.rejected, 0, "scale 2^{exponent}: rejected contributions");
        for (a, b) in found.pixels.block_estimates(8).iter().zip(expected.pixels.block_estimates(8)) {
            let off = (a.mean - b.mean).abs() / b.mean;
            assert!(off < 0.01, "scale 2^{exponent}: a block mean is {} instead of {}", a.mean, b.mean);
        }
    }
}

fn scaled_box(scale: f64) -> Rendering {
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::lambert("white", [0.7; 3]));
    let red = scene.material(Material::lambert("red", [0.6, 0.2, 0.2]));
    let light = scene.material(Material::emitter("light", [10.0; 3]));
    scene.room(white, DVec3::splat(-scale), DVec3::splat(scale));
    scene.mesh(red, turned_cuboid(dvec3(-0.5, -1.0, -0.5) * scale, dvec3(0.1, 0.2, 0.2) * scale, 0.3));
    scene.ceiling(light, 0.99 * scale, 0.6 * scale);
    scene.camera(
        "main",
        Camera { eye: dvec3(0.3, 0.1, 0.95) * scale, target: dvec3(0.0, -0.2, 0.0) * scale, yfov: 70.0, aspect: 1.0 },
    );
    BuiltScene::new(&scene, None).job().pipeline("pt").edges(5).size(32, 32).samples(64).render()
}

/// Triangles without area, repeated indices and coincident faces neither stop a render nor reach the film.
#[test]
fn degenerate_triangles_are_harmless() {
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::lambert("white", [0.7; 3]));
    let light = scene.material(Material::emitter("light", [10.0; 3]));
    scene.floor(white, 0.0, 2.0);
    scene.floor(white, 0.0, 2.0);
    for material in [white, light] {
        scene.quad(material, dvec3(0.0, 0.5, 0.0), DVec3::X, DVec3::X);
        scene.quad(material, dvec3(0.0, 0.5, 0.0), DVec3::ZERO, DVec3::ZERO);
        scene.quad(material, dvec3(0.0, 0.5, 0.0), DVec3::X * 1e-20, DVec3::Y * 1e-20);
    }
    scene.ceiling(light, 1.0, 0.5);
    scene.camera("main", Camera { eye: dvec3(0.0, 0.8, 2.0), target: DVec3::ZERO, yfov: 40.0, aspect: 1.0 });
    let scene = BuiltScene::new(&scene, None);
    for pipeline in ["nee", "pt", "lt"] {
        let rendering = scene.job().pipeline(pipeline).edges(4).render();
        assert_eq!(rendering.rejected, 0, "{pipeline}: rejected contributions");
        assert!(
            rendering.pixels.rgb.iter().flatten().all(|value| value.is_finite()),
            "{pipeline}: a pixel is not finite"
        );
        assert!(rendering.pixels.mean_estimate().mean > 0.0, "{pipeline}: a black image proves nothing");
    }
}

/// A plate of 16 km is thinner than f32 resolves at the length of the rays that hit it: they meet the side that faces them, and light
/// that leaves there gets away. Below a sky of radiance 1 it has the radiance of its albedo, from wherever it is seen.
#[test]
fn plates_thinner_than_rounding_are_lit() {
    for height in [2.0, 3.3, 13.0] {
        let mut scene = SceneBuilder::new();
        let plate = scene.material(Material::lambert("plate", [0.5; 3]).two_sided());
        scene.floor(plate, 0.0, 16e3);
        scene.ceiling(plate, -6e-8, 16e3);
        let camera = Camera { eye: DVec3::Y * height, target: dvec3(0.3, 0.0, 0.2), yfov: 60.0, aspect: 1.0 };
        scene.camera("main", camera);
        let scene = BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])));
        let job = scene.job().pipeline("pt").edges(2).size(32, 32).samples(64);
        let lit = job.render().pixels.mean_estimate();
        assert!(lit.z(&Estimate::exact(0.5), 1e-4).abs() < 4.5, "{lit:?} from a height of {height}, expected 0.5");
        if height == 2.0 {
            let undecided = job.edited("trace/triangle", "(side + DISTANCE_TOLERANCE)", "side").render();
            let dark = undecided.pixels.mean_estimate();
            assert!(dark.mean < 0.45, "{dark:?}: the test would not see rounding decide");
        }
    }
}

/// A light of a micrometre, and one of a kilometre a hundred kilometres away, seen at a grazing angle: L = rho/pi Le edge^2/height^2.
#[test]
fn tiny_and_distant_lights() {
    for (edge, height) in [(1e-6, 1.0), (1e3, 1e5)] {
        let radiance = height * height / (edge * edge);
        let mut scene = SceneBuilder::new();
        let floor = scene.material(Material::lambert("floor", [0.5; 3]));
        let light = scene.material(Material::emitter("light", [radiance; 3]));
        scene.floor(floor, 0.0, 20.0);
        scene.ceiling(light, height, edge);
        // So narrow that the stretch of floor in view, 3.5 cm at this slope, is lit evenly.
        scene.camera("main", Camera { eye: dvec3(0.0, 0.02, 2.0), target: DVec3::ZERO, yfov: 0.01, aspect: 1.0 });
        let scene = BuiltScene::new(&scene, None);
        for pipeline in ["nee", "pt"] {
            let rendering = scene.job().pipeline(pipeline).edges(2).size(16, 16).samples(64).render();
            let estimate = rendering.pixels.mean_estimate();
            let expected = 0.5 / std::f64::consts::PI;
            assert_eq!(rendering.rejected, 0, "{pipeline}, edge {edge}: rejected contributions");
            let z = estimate.z(&Estimate::exact(expected), 1e-3 * expected);
            assert!(z.abs() < 4.5, "{pipeline}, edge {edge}: {estimate:?}, expected {expected}");
        }
    }
}
