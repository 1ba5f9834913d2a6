//! Bidirectional path tracing: known answers, by all strategies together and by every strategy alone. The numbers are those of algorithm.md section 9.

use glam::{DVec3, dvec3};
use std::f64::consts::PI;
use std::sync::LazyLock;
use tests::agreement::{BLOCK, assert_differ, assert_same};
use tests::closed_form::{DISK_LIGHT, FROM_ABOVE, FROM_BELOW_THE_LIGHT, FloorLight, SPHERE_LIGHT, SQUARE_LIGHT};
use tests::closed_form::{assert_mean, ball_in_a_constant_sky, emitter_inside_glass, floor_below_glass};
use tests::closed_form::{furnace as furnace_room, grey, lambert_under_point, sky_above, sky_from_inside_glass};
use tests::material::Material;
use tests::rendering::{BuiltScene, Job, Rendering};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::{Mesh, sphere};
use tests::sky::Sky;
use tests::statistics::{Estimate, Pixels};

fn sbdpt(job: &Job, edges: u32, samples: u32) -> Job {
    job.clone().pipeline("sbdpt").edges(edges).samples(samples)
}

/// Light vertices joined to the camera, and nothing else.
fn particles(job: Job) -> Job {
    job.set("use_implicit", false).set("use_explicit", false).set("use_connection", false)
}

/// Paths of so many edges by the strategy with `eye_vertices` vertices from the camera, counted in full. At the greatest length all
/// counts of implicit samples are one.
fn alone(job: &Job, edges: u32, eye_vertices: u32, samples: u32) -> Job {
    let job = sbdpt(job, edges, samples).set("mis", "none").set("counting", "first");
    job.set("only_edges", edges).set("only_eye_vertices", 1u32 << eye_vertices)
}

/// Check 1: walls that emit 1 and reflect .8 give the sum of .8^i below the number of edges, whatever the weights.
#[test]
fn furnace() {
    let scene = furnace_room(0.8);
    let job = scene.job().size(20, 20);
    for (edges, sum, mis, counting) in [
        (1, 1.0, "balance", "measured"),
        (2, 1.8, "balance", "measured"),
        (5, 3.3616, "balance", "measured"),
        (10, 4.463_13, "balance", "first"),
        (3, 2.44, "power", "first"),
        (3, 2.44, "average", "realised"),
    ] {
        let rendering = sbdpt(&job, edges, 64).set("mis", mis).set("counting", counting).render();
        assert_mean(&rendering, sum, &format!("{edges} edges, {mis}, {counting}"));
    }
}

/// Check 2: a convex Lambert object in a constant sky of radiance 1 has radiance rho.
#[test]
fn convex_lambert_object_in_a_constant_sky() {
    let scene = ball_in_a_constant_sky(grey(0.5), 15.0);
    assert_mean(&sbdpt(&scene.job().size(48, 48), 4, 32).render(), 0.5, "grey ball");
}

/// Check 2: with rho = 1 the object cannot be told from the sky behind it, at its rim neither.
#[test]
fn white_object_in_a_constant_sky_cannot_be_seen() {
    let scene = ball_in_a_constant_sky(grey(1.0), 30.0);
    let rendering = sbdpt(&scene.job().size(48, 48), 4, 32).render();
    assert_mean(&rendering, 1.0, "white ball");
    assert_same(&rendering.pixels, &Pixels::exact(48, 48, vec![[1.0; 3]; 48 * 48]), 6, 0.005, "white ball");
}

/// Check 2: glass loses nothing. Within 4 degrees of the centre of a ball all light that it reflects inside gets out in few bounces.
#[test]
fn glass_ball_in_a_constant_sky() {
    let scene = ball_in_a_constant_sky(Material::glass("glass", 1.5, 0.0), 8.0);
    assert_mean(&sbdpt(&scene.job().size(32, 32), 8, 32).render(), 1.0, "glass ball");
}

/// Check 3: a point light in the middle of a sphere. Every strategy that can see it gives rho^(k-1) I / (pi R^2) alone.
#[test]
fn every_strategy_alone_in_the_integrating_sphere() {
    let scene = inside_a_sphere(grey(0.5), Some([1.0; 3]));
    for (edges, radiance) in [(2, 0.159_154_9), (3, 0.079_577_5), (4, 0.039_788_7), (5, 0.019_894_4)] {
        for eye_vertices in 0..edges {
            assert_alone(&scene, edges, eye_vertices, radiance);
        }
    }
}

/// Check 3: the sum over lengths.
#[test]
fn integrating_sphere() {
    let scene = inside_a_sphere(grey(0.5), Some([1.0; 3]));
    assert_mean(
        &sbdpt(&scene.job().size(32, 32), 5, 32).set("counting", "first").render(),
        0.298_415_5,
        "integrating sphere",
    );
}

/// Checks 1 and 3: in a sphere that emits 1 and reflects .5 every strategy alone gives .5^(k-1), those that meet light included.
#[test]
fn every_strategy_alone_in_a_glowing_sphere() {
    let scene = inside_a_sphere(Material { emission: [1.0; 3], ..grey(0.5) }, None);
    for edges in 1..=3 {
        for eye_vertices in u32::from(edges == 1)..=edges {
            assert_alone(&scene, edges, eye_vertices, 0.5f64.powi(edges as i32 - 1));
        }
    }
}

/// A strategy alone shows the same radiance in every block, known to 1.5 % in the mean. In a sphere almost nothing but the places
/// of splats is left to chance.
#[track_caller]
fn assert_alone(scene: &BuiltScene, edges: u32, eye_vertices: u32, radiance: f64) {
    let size = if eye_vertices == 0 { 36 } else { 16 };
    let rendering = alone(&scene.job().size(size, size), edges, eye_vertices, 32).render();
    let what = format!("({eye_vertices}, {})", edges - eye_vertices);
    let pixels = vec![[radiance as f32; 3]; rendering.pixels.rgb.len()];
    let expected = Pixels::exact(size as usize, size as usize, pixels);
    assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
    assert_same(&rendering.pixels, &expected, BLOCK, 0.015, &what);
}

/// The inside of a sphere of facets with the area of the unit sphere, about a point light if that has an intensity.
fn inside_a_sphere(material: Material, intensity: Option<[f64; 3]>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let material = scene.material(material);
    let mut mesh = sphere(DVec3::ZERO, 1.0, 24).inverted().flat();
    let scale = (4.0 * PI / area(&mesh)).sqrt();
    mesh.positions.iter_mut().for_each(|position| *position *= scale);
    scene.mesh(material, mesh);
    if let Some(intensity) = intensity {
        scene.point_light(DVec3::ZERO, intensity);
    }
    scene.camera("main", Camera { eye: dvec3(0.3, 0.2, 0.1), target: DVec3::NEG_Z, yfov: 90.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

fn area(mesh: &Mesh) -> f64 {
    let corner = |index: u32| mesh.positions[index as usize];
    let of_triangle = |i: &[u32]| (corner(i[1]) - corner(i[0])).cross(corner(i[2]) - corner(i[0])).length() / 2.0;
    mesh.indices.chunks_exact(3).map(of_triangle).sum()
}

/// Checks 4 and 13: a point light over a plane, L = rho/pi I h/(h^2+r^2)^{3/2} at every pixel, by all strategies and by splats alone.
#[test]
fn point_light_over_a_plane() {
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.point_light(DVec3::Y, [1.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    let job = FROM_ABOVE.job(&scene, "sbdpt").samples(192);
    FROM_ABOVE.assert_pixels(&job.render(), |place| lambert_under_point(0.5, 1.0, place), "all strategies");
    let splats = particles(job.samples(384)).render();
    FROM_ABOVE.assert_pixels(&splats, |place| lambert_under_point(0.5, 1.0, place), "particles alone");
}

/// Check 5: the form factor of a parallel unit square at unit height.
#[test]
fn square_light_over_a_plane() {
    assert_lit_by(SQUARE_LIGHT);
}

/// Check 6: the form factor of a parallel disk.
#[test]
fn disk_light_over_a_plane() {
    assert_lit_by(DISK_LIGHT);
}

/// Check 6: the form factor of a sphere.
#[test]
fn sphere_light_over_a_plane() {
    assert_lit_by(SPHERE_LIGHT);
}

#[track_caller]
fn assert_lit_by(light: FloorLight) {
    let scene = light.over_a_floor();
    light.assert_pixels(&FROM_BELOW_THE_LIGHT.job(&scene, "sbdpt").samples(512).render(), "sbdpt");
}

/// Check 7: L = rho/pi E cos for a directional light.
#[test]
fn directional_light_on_a_plane() {
    let cosine: f64 = 0.6;
    let mut scene = FROM_ABOVE.floor(0.5, 2.0);
    scene.directional_light(dvec3((1.0 - cosine * cosine).sqrt(), -cosine, 0.0), [2.0; 3]);
    let scene = BuiltScene::new(&scene, None);
    let rendering = FROM_ABOVE.job(&scene, "sbdpt").samples(256).render();
    FROM_ABOVE.assert_pixels(&rendering, |_| 0.5 / PI * 2.0 * cosine, "sbdpt");
}

/// Check 7: inside its inner cone a spot light is a point light, outside its outer cone there is nothing at all: in all, and for every
/// strategy alone.
#[test]
fn every_strategy_alone_under_a_spot_light() {
    let (inner, outer) = (0.30, 0.45);
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.spot_light(DVec3::Y, DVec3::NEG_Y, [1.0; 3], inner, outer);
    let scene = BuiltScene::new(&scene, None);
    let job = scene.job().size(FROM_ABOVE.pixels, FROM_ABOVE.pixels);
    FROM_ABOVE.assert_below_a_spot(&sbdpt(&job, 3, 64).render(), 0.5, [inner, outer], "all strategies");
    for eye_vertices in [0, 1] {
        let rendering = alone(&job, 2, eye_vertices, 128).render();
        let what = format!("({eye_vertices}, {})", 2 - eye_vertices);
        FROM_ABOVE.assert_below_a_spot(&rendering, 0.5, [inner, outer], &what);
    }
}

/// Check 13: the centroid of a small lit spot is where the camera projects it, to a hundredth of a pixel.
#[test]
fn splats_land_where_the_camera_projects() {
    let [x, z] = [0.3137, -0.2219];
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.spot_light(dvec3(x, 1.0, z), DVec3::NEG_Y, [1.0; 3], 0.15, 0.2);
    let scene = BuiltScene::new(&scene, None);
    let rendering = particles(FROM_ABOVE.job(&scene, "sbdpt")).samples(512).render();
    FROM_ABOVE.assert_centroid(&rendering, [x, z]);
}

/// Check 14: an out-of-focus plane looks the same through a thin lens from the camera and from the light.
#[test]
fn thin_lens_over_a_lit_plane() {
    let mut scene = FROM_ABOVE.floor(0.5, 20.0);
    scene.spot_light(DVec3::Y, DVec3::NEG_Y, [1.0; 3], 0.2, 0.3);
    let scene = BuiltScene::new(&scene, None);
    // Not focused halfway, where a lens seen from the wrong end makes the same blur.
    let job = FROM_ABOVE.job(&scene, "sbdpt").lens(0.3, 1.6).samples(384);
    let from_camera = job.clone().set("use_particle", false).render();
    let from_light = particles(job).render();
    assert_same(&from_camera.pixels, &from_light.pixels, 4, 0.01, "lens");
}

/// Check 9: between diffuse plates every strategy alone gives the image of `pt` of its length.
#[test]
fn every_strategy_alone_gives_the_image_of_pt() {
    let scene = between_plates();
    let up_to = |edges: u32| plates_job(&scene, "pt", edges, 128).seed(edges).render();
    let all = [up_to(1), up_to(2), up_to(3)];
    for edges in 2..=4 {
        let longest = if edges < 4 { &all[edges as usize - 1] } else { &*PLATES };
        let expected = difference(&longest.pixels, &all[edges as usize - 2].pixels);
        for eye_vertices in 0..=edges {
            let samples = if [0, edges].contains(&eye_vertices) { 96 } else { 32 };
            let rendering = alone(&plates_job(&scene, "sbdpt", edges, 0), edges, eye_vertices, samples).render();
            let what = format!("({eye_vertices}, {})", edges - eye_vertices);
            assert_same(&rendering.pixels, &expected, BLOCK, 0.03, &what);
        }
    }
}

/// Check 9, by the pictures of strategies that one render keeps: each, unweighted, is the image of `pt` of its length, also where only
/// a share of the light vertices has an eye walk, or two share one; weighted they add up to the picture.
#[test]
fn pictures_of_strategies_are_those_of_pt_and_add_up() {
    let scene = between_plates();
    let up_to = |edges: u32| plates_job(&scene, "pt", edges, 128).seed(edges).render();
    let (shorter, longest) = (up_to(3), &*PLATES);
    let expected = difference(&longest.pixels, &shorter.pixels);
    for (pipeline, share) in [("sbdpt", 1.0), ("sbdpt", 0.5), ("sbdpt_pairs", 1.0)] {
        let job = plates_job(&scene, pipeline, 4, 192).set("counting", "first").set("walk_share", share);
        let rendering = job.set("record_strategies", true).render();
        let of_length_four = rendering.strategies.iter().filter(|strategy| strategy.s + strategy.t == 4);
        let alone: Vec<_> = of_length_four.map(|strategy| (strategy.s, &strategy.unweighted)).collect();
        assert_eq!(alone.iter().map(|(s, _)| *s).collect::<Vec<_>>(), [4, 3, 2, 1, 0]);
        for (s, picture) in alone {
            assert_same(picture, &expected, BLOCK, 0.03, &format!("({s}, {}), {pipeline}, share {share}", 4 - s));
        }
        assert_add_up(&rendering);
    }
}

/// The weighted pictures of the strategies are the picture, to what f32 sums lose.
#[track_caller]
fn assert_add_up(rendering: &Rendering) {
    let mut sums = vec![[0.0; 3]; rendering.pixels.rgb.len()];
    for strategy in &rendering.strategies {
        for (sum, part) in sums.iter_mut().flatten().zip(strategy.weighted.rgb.iter().flatten()) {
            *sum += f64::from(*part);
        }
    }
    for (sum, whole) in sums.iter().flatten().zip(rendering.pixels.rgb.iter().flatten()) {
        let whole = f64::from(*whole);
        assert!((sum - whole).abs() <= 1e-4 * whole + 1e-6, "the strategies add up to {sum}, not to {whole}");
    }
}

/// A floor and a ceiling that do not touch, in the light of a panel between them and out of the picture, which reflects.
fn between_plates() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.9, 0.7, 0.8]));
    let ceiling = scene.material(Material::lambert("ceiling", [0.8, 0.9, 0.7]));
    let light = scene.material(Material { emission: [4.0, 3.0, 2.0], ..grey(0.5) });
    scene.floor(floor, 0.0, 2.4);
    scene.ceiling(ceiling, 0.8, 2.4);
    scene.quad(light, dvec3(-1.3, 0.1, -1.2), DVec3::Y * 0.6, DVec3::Z * 2.4);
    scene.camera("main", Camera { eye: dvec3(0.0, 0.4, 3.0), target: dvec3(0.0, 0.4, 0.0), yfov: 16.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

fn plates_job(scene: &BuiltScene, pipeline: &str, edges: u32, samples: u32) -> Job {
    scene.job().pipeline(pipeline).size(40, 40).edges(edges).samples(samples)
}

/// The plates by `pt`, paths of up to four edges.
static PLATES: LazyLock<Rendering> = LazyLock::new(|| plates_job(&between_plates(), "pt", 4, 256).seed(4).render());

/// One image less another that is independent of it.
fn difference(a: &Pixels, b: &Pixels) -> Pixels {
    let join = |a: &[[f32; 3]], b: &[[f32; 3]], with: fn(f32, f32) -> f32| -> Vec<[f32; 3]> {
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|i| with(a[i], b[i]))).collect()
    };
    Pixels { rgb: join(&a.rgb, &b.rgb, |a, b| a - b), errors: join(&a.errors, &b.errors, f32::hypot), ..*a }
}

/// Check 12, the toy: a floor, a wall and a small bright panel, seen by a camera of 1.5 by 1 at unit distance.
fn toy(sky: Option<&Sky>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.7; 3]));
    let wall = scene.material(Material::lambert("wall", [0.6; 3]));
    let light = scene.material(Material::emitter("light", [12.0; 3]));
    scene.floor(floor, 0.0, 4.0);
    scene.quad(wall, dvec3(-2.0, 0.0, -1.2), DVec3::X * 4.0, DVec3::Y * 1.5);
    scene.ceiling(light, 1.95, 0.7);
    let (eye, yfov) = (dvec3(0.0, 1.0, 3.6), 2.0 * 0.5f64.atan().to_degrees());
    scene.camera("main", Camera { eye, target: eye + dvec3(0.0, -0.12, -1.0), yfov, aspect: 1.5 });
    BuiltScene::new(&scene, sky)
}

/// The mean is a value that was itself estimated: within four standard errors of both, the rendering's being below 0.5 %.
#[track_caller]
fn assert_given(rendering: &Rendering, given: Estimate, what: &str) {
    let estimate = rendering.pixels.mean_estimate();
    assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
    assert!(estimate.error < 0.005 * given.mean, "{what}: {estimate:?} is too noisy to test {given:?}");
    assert!(estimate.z(&given, 0.0).abs() <= 4.0, "{what}: {estimate:?}, expected {given:?}");
}

/// Check 12: light of two edges and more, and how many light paths reach their second to fifth vertex. The panel, which is black, has
/// vertices as well; without them the numbers are .6690, .1379, .0417 and .0126.
#[test]
fn toy_without_emission_that_is_seen() {
    let scene = toy(None);
    let rendering = sbdpt(&scene.job().size(96, 64), 5, 64).set("use_implicit", false).render();
    assert_given(&rendering, Estimate { mean: 0.07352, error: 0.00001 }, "k >= 2");
    let paths = f64::from(96 * 64 * 64);
    for (t, given) in [(1, 1.0), (2, 0.66896), (3, 0.15253), (4, 0.04425), (5, 0.01345f64)] {
        let found = rendering.tallies[t];
        let error = (given * (1.0 - given) / paths).sqrt();
        assert!((found - given).abs() <= 4.0 * error.hypot(1e-4), "q_{t} = {found}, expected {given}");
    }
}

/// Check 12: the panel alone.
#[test]
fn toy_with_nothing_but_emission_that_is_seen() {
    let scene = toy(None);
    let rendering = sbdpt(&scene.job().size(96, 64), 1, 256).render();
    assert_given(&rendering, Estimate { mean: 0.0911, error: 0.0007 }, "k = 1");
}

/// Check 12: with a sky of radiance 1.
#[test]
fn toy_under_a_sky() {
    let scene = toy(Some(&Sky::constant([1.0; 3])));
    let rendering = sbdpt(&scene.job().size(48, 32), 5, 64).render();
    assert_given(&rendering, Estimate { mean: 0.9560, error: 0.0006 }, "with sky");
}

/// Check 15: out of glass at normal incidence radiance grows by eta^2 and loses 4 %: 2.25 x .96 = 2.16.
#[test]
fn radiance_of_the_sky_seen_from_inside_glass() {
    let scene = sky_from_inside_glass();
    assert_mean(&sbdpt(&scene.job().size(16, 16), 4, 64).render(), 2.16, "sky seen from inside glass");
}

/// Check 15: an emitter inside glass seen from outside at normal incidence: .96/2.25 = .4266667.
#[test]
fn radiance_of_an_emitter_inside_glass() {
    let scene = emitter_inside_glass();
    assert_mean(&sbdpt(&scene.job().size(16, 16), 4, 64).render(), 0.426_666_7, "emitter inside glass");
}

/// Check 15: a floor inside glass gets 1 - F_ext = .9082220 of the light of a sky above. Importance carries no factor: with one, the
/// light that walks from the sky bring is too bright.
#[test]
fn floor_inside_glass_under_a_sky() {
    let scene = BuiltScene::new(&floor_below_glass(0.0), Some(&sky_above()));
    let job = FROM_BELOW_THE_LIGHT.job(&scene, "sbdpt").edges(3).samples(512);
    let right = job.render();
    FROM_BELOW_THE_LIGHT.assert_pixels(&right, |_| 0.5 * 0.908_222_0, "floor inside glass");
    let wrong = particles(job).set("refraction_adjoint", false).render();
    assert_differ(&wrong, &right, "as if importance were radiance, light outside");
}

/// Check 18: where faces are flat the correction changes nothing, to the bit.
#[test]
fn flat_faces_need_no_correction() {
    let scene = between_plates();
    let job = sbdpt(&scene.job().size(16, 16), 4, 16).set("counting", "first").fixed_point();
    let corrected = job.render();
    assert!(corrected.sums.iter().any(|&sum| sum != 0), "a black image proves nothing");
    assert!(
        corrected.sums == job.set("shading_normal_adjoint", false).render().sums,
        "the correction changes the image"
    );
}

/// Check 22: the error falls with the root of the number of samples.
#[test]
fn the_error_falls_with_the_root_of_samples() {
    let scene = between_plates();
    let error = |samples: u32| {
        let rendering = plates_job(&scene, "sbdpt", 4, samples).render();
        error_to(&rendering.pixels, &PLATES.pixels)
    };
    let errors = [4, 16, 64].map(error);
    let slope = (errors[2] / errors[0]).log(16.0);
    assert!((slope + 0.5).abs() < 0.05, "slope {slope}, root mean square errors {errors:?}");
}

/// Root mean square of the error of an image, that of the reference left out.
fn error_to(image: &Pixels, reference: &Pixels) -> f64 {
    let values = |rows: &[[f32; 3]]| -> Vec<f64> { rows.iter().flatten().map(|&value| f64::from(value)).collect() };
    let (found, expected, noise) = (values(&image.rgb), values(&reference.rgb), values(&reference.errors));
    let squares = found.iter().zip(&expected).map(|(a, b)| (a - b).powi(2));
    let known: f64 = noise.iter().map(|error| error.powi(2)).sum();
    ((squares.sum::<f64>() - known) / found.len() as f64).sqrt()
}
