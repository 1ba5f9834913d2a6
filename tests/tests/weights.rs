//! Weights of bidirectional paths: a partition of unity for every path, the right number of implicit samples, the rays that this takes,
//! and lengths, distances and densities at the limits of f32.

use glam::{DVec3, dvec3};
use kernelgen::source::FileKind;
use runtime::configs::Library;
use std::fmt::Write;
use std::ops::Range;
use std::sync::LazyLock;
use tests::closed_form::{assert_mean, furnace, grey};
use tests::material::Material;
use tests::probe::ONE;
use tests::rendering::{BuiltScene, Job, Rendering};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::shape::{cuboid, sphere, turned_cuboid};
use tests::sky::Sky;
use tests::statistics::{Comparison, Estimate};

/// A job with the acceleration structure whose kernels are compiled fastest: compiling is most of what these tests do.
fn job(scene: &BuiltScene) -> Job {
    scene.job().set("accelerator", "bvh2")
}

/// A change of a module: key, text, and what it becomes.
type Edit = (&'static str, &'static str, &'static str);

fn edited(job: Job, edits: &[Edit]) -> Job {
    edits.iter().fold(job, |job, (key, old, new)| job.edited(key, old, new))
}

/// Columns of the probe's table: two a decade, the first below 10^-7.5.
const COLUMNS: usize = 16;
/// The first column of sums that are off by 1e-5 or more.
const FIRST_WRONG: usize = 6;
/// Rows of the probe's table. It begins with eight for each kind of light, by edges; for the rest see the probe.
const ROW_COUNTING: usize = 40;
const ROW_EARLY_END: usize = 49;
const ROW_SUBSET: usize = 51;
const ROW_NOTHING: usize = 54;
const ROW_LOST: usize = 55;
const ROW_DELTAS: usize = 56;
const ROW_SAMPLES: usize = 62;
const ROW_MATERIAL: usize = 64;
const ROW_EMITTER: usize = 76;
const ROW_COINCIDENT: usize = 88;
const ROW_SHARE: usize = 91;
const ROW_SURVIVAL: usize = 95;
/// Materials in `all_materials`, and which of them are lights.
const MATERIALS: usize = 12;
const EMITTERS: [usize; 2] = [10, 11];

/// The stages follow a given path, and report weights where they would add light.
const FOLLOWS: &[Edit] = &[
    (
        "stage/start_light",
        "import package::light::emission::sample_light_vertex;",
        "import package::probe::forced_path::forced_light;",
    ),
    ("stage/start_light", "sample_light_vertex(random, random_extra(WALK_LIGHT, 1u))", "forced_light"),
    (
        "stage/extend_light",
        "import package::light::emission::emit_light_ray;",
        "import package::probe::forced_path::{light_emission, light_event};",
    ),
    (
        "stage/extend_light",
        "emit_light_ray(stored_light_vertex(light), random4(WALK_LIGHT, 1u, DIMENSION_DIRECTION))",
        "light_emission()",
    ),
    ("stage/extend_light", "sample_bsdf(bsdf, outgoing, random.xyz, IMPORTANCE)", "light_event(bsdf, outgoing, t)"),
    (
        "stage/shade_light_mis",
        "import package::transport::direct::offer_particle_strategy;",
        "import package::probe::forced_path::report_join;",
    ),
    (
        "stage/shade_light_mis",
        "random::{DIMENSION_CHOICE, WALK_LIGHT, random4}",
        "random::{DIMENSION_CHOICE, DIMENSION_EMIT, WALK_EYE, WALK_LIGHT, random4}",
    ),
    (
        "stage/shade_light_mis",
        "random4(WALK_LIGHT, t, DIMENSION_CHOICE).xy",
        "random4(WALK_EYE, 0u, DIMENSION_EMIT).zw",
    ),
    (
        "stage/shade_light_mis",
        "offer_particle_strategy(light, surface, segment, unweighted * weight, unweighted, t, camera.pixel)",
        "report_join(unweighted * weight, weight)",
    ),
    (
        "transport/connect",
        "import package::transport::direct::offer_strategy;",
        "import package::probe::forced_path::report_join;",
    ),
    (
        "transport/connect",
        "offer_strategy(eye, surface, end.segment, transported * weight, unweighted, s, t)",
        "report_join(transported * weight, weight * own)",
    ),
    (
        "stage/shade_eye",
        "import package::transport::implicit::add_implicit;",
        "import package::transport::implicit::add_implicit;\nimport package::probe::forced_path::eye_event;",
    ),
    ("stage/shade_eye", "sample_bsdf(bsdf, outgoing, random.xyz, RADIANCE)", "eye_event(bsdf, outgoing, s)"),
    ("transport/survival", "if random >= probability {", "if false {"),
    ("transport/survival", "random / probability", "0.0"),
    (
        "transport/implicit",
        "import package::film::{splat, splat_implicit};",
        "import package::film::splat_implicit;\nimport package::probe::forced_path::reported_hit;",
    ),
    (
        "transport/implicit",
        "splat(path_pixel(), contribution)",
        "reported_hit = samples * weight_over(samples, rivals)",
    ),
];

/// Parameters become variables.
const VARIES: &[Edit] = &[
    (
        "transport/recursive_mis",
        "import package::params::{mis, ",
        "import package::probe::weight_settings::mis;\nimport package::params::{",
    ),
    (
        "transport/strategy",
        "import package::params::{counting, counting_first, counting_measured, early_end, max_edges};",
        "import package::params::{counting_first, counting_measured, max_edges};\n\
         import package::probe::weight_settings::{counting, early_end};",
    ),
    (
        "transport/strategy",
        "import package::params::{only_edges, ",
        "import package::probe::weight_settings::{only_edges, ",
    ),
    (
        "stage/shade_light_mis",
        "import package::params::{eye_survival, walk_share};",
        "import package::probe::weight_settings::{eye_survival, walk_share};",
    ),
    (
        "stage/shade_eye",
        "import package::params::light_survival;",
        "import package::probe::weight_settings::light_survival;",
    ),
    (
        "stage/extend_light",
        "import package::params::{eye_survival, ",
        "import package::probe::weight_settings::eye_survival;\nimport package::params::{",
    ),
    (
        "transport/connect",
        "import package::params::{eye_survival, light_survival};",
        "import package::probe::weight_settings::{eye_survival, light_survival};",
    ),
    (
        "transport/survival",
        "import package::params::{eye_survival, light_survival};",
        "import package::probe::weight_settings::{eye_survival, light_survival};",
    ),
    ("transport/strategy", "import package::tallies::", "import package::probe::weight_settings::"),
];

/// The shipped library with `sbdpt` made one stage that tests weights.
fn probe_library() -> Library {
    let mut library = Library::default();
    for (key, text) in [
        ("stage/probe_weights", include_str!("../src/wgsl/probe_weights.wgsl")),
        ("probe/forced_path", include_str!("../src/wgsl/forced_path.wgsl")),
        ("probe/weight_settings", include_str!("../src/wgsl/weight_settings.wgsl")),
    ] {
        library.sources.add(FileKind::Module, key, format!("{key}.wgsl"), text);
    }
    let file = library.sources.find(FileKind::Config, "pipelines/sbdpt.toml").expect("the pipeline is shipped");
    let mut pipeline: toml::Table = library.sources.file(file).text.parse().expect("the pipeline is TOML");
    let changes: toml::Table = "start = \"probe\"\nrounds = \"1\"\n\
                                [stages]\nprobe = { entry = \"probe_weights\", on.done = \"end\" }"
        .parse()
        .expect("the changes are TOML");
    pipeline.remove("inner");
    pipeline.extend(changes);
    library.sources.add(FileKind::Config, "pipelines/probe.toml", "probe.toml", pipeline.to_string());
    library
}

/// Every kind of scattering and of light, close together and open to a sky.
fn all_materials() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let materials: [Material; MATERIALS] = [
        Material::lambert("clay", [0.7, 0.6, 0.5]),
        Material::metal("metal", [0.9, 0.8, 0.5], 0.5),
        Material::glossy("glaze", [0.3, 0.5, 0.7], 0.4),
        Material::metal("mirror", [0.9; 3], 0.0),
        Material::glass("glass", 1.5, 0.0),
        Material::glass("frosted glass", 1.5, 0.5),
        Material::thin_glass("pane", 1.5),
        Material { roughness: 0.5, ..Material::thin_glass("frosted pane", 1.5) },
        Material::glossy("varnish", [0.6, 0.4, 0.2], 0.0),
        Material { transmission: 0.5, ..Material::glass("milk", 1.5, 0.0) },
        Material { emission: [2.0; 3], ..Material::lambert("lamp", [0.5; 3]) },
        Material { emission: [2.0; 3], ..Material::lambert("panel", [0.5; 3]) }.two_sided(),
    ];
    let ids = materials.map(|material| scene.material(material));
    scene.floor(ids[0], 0.0, 4.0);
    scene.quad(ids[1], dvec3(-2.0, 0.0, -2.0), DVec3::X * 4.0, DVec3::Y * 2.0);
    scene.quad(ids[2], dvec3(-2.0, 0.0, 2.0), DVec3::NEG_Z * 4.0, DVec3::Y * 2.0);
    scene.quad(ids[3], dvec3(2.0, 0.0, -2.0), DVec3::Z * 4.0, DVec3::Y * 2.0);
    scene.mesh(ids[4], sphere(dvec3(-1.0, 0.5, 0.5), 0.45, 8));
    scene.mesh(ids[5], cuboid(dvec3(-0.3, 0.05, 0.2), dvec3(0.3, 0.7, 0.8)));
    scene.quad(ids[6], dvec3(-1.5, 0.1, 1.3), DVec3::X, DVec3::Y);
    scene.quad(ids[7], dvec3(-0.3, 0.1, 1.3), DVec3::X, DVec3::Y);
    scene.mesh(ids[8], sphere(dvec3(1.0, 0.5, 0.5), 0.45, 8));
    scene.mesh(ids[9], sphere(dvec3(0.0, 0.6, -1.0), 0.55, 8));
    scene.mesh(ids[10], cuboid(dvec3(-0.1, 0.5, -1.1), dvec3(0.1, 0.7, -0.9)));
    scene.ceiling(ids[10], 2.0, 1.5);
    scene.quad(ids[11], dvec3(0.8, 1.0, -1.4), dvec3(0.5, 0.0, 0.5), DVec3::Y * 0.5);
    scene.point_light(dvec3(-1.2, 1.4, -0.8), [2.0, 4.0, 0.8]);
    scene.spot_light(dvec3(1.2, 1.6, 1.2), dvec3(-0.5, -1.0, -0.4), [9.0, 6.0, 18.0], 0.3, 0.9);
    scene.directional_light(dvec3(0.3, -1.0, -0.3), [1.0, 0.9, 0.8]);
    scene.camera("main", Camera { eye: dvec3(0.1, 1.2, 3.4), target: dvec3(0.0, 0.6, 0.0), yfov: 50.0, aspect: 1.5 });
    let sky = |towards: DVec3| [0.1 + 0.3 * towards.x.max(0.0), 0.2, 0.2 + 0.2 * towards.y.max(0.0)];
    BuiltScene::new(&scene, Some(&Sky::from_directions(16, 8, sky)))
}

/// The probe's counts, row by row.
#[track_caller]
fn table(rendering: &Rendering) -> Vec<[u64; COLUMNS]> {
    assert_eq!(rendering.rejected, 0, "a probe gave a value that is no number");
    let counts: Vec<u64> = rendering.sums.chunks_exact(3).map(|sums| (sums[0] / ONE) as u64).collect();
    counts.as_chunks().0.to_vec()
}

/// What the probe counts along random paths. Settings and subsets are drawn anew for each path.
static TABLE: LazyLock<Vec<[u64; COLUMNS]>> = LazyLock::new(|| {
    let scene = all_materials();
    let job = job(&scene).library(probe_library()).pipeline("probe").fixed_point();
    let job = edited(edited(job, FOLLOWS), VARIES).lens(0.05, 3.0).edges(6).size(64, 28).samples(16);
    table(&job.render())
});

/// Check 8: along paths of one to six edges, through every kind of scattering to every kind of light, the weights of all strategies of a
/// subset add up to one, times the samples that each takes; for any weights, any way of counting, any share of light vertices that
/// have eye walks, eye walks that two of them share, and walks that end by a chance that weights know of. A path that no strategy of the
/// subset makes has none.
#[test]
fn weights_of_a_path_sum_to_one() {
    assert_none_is_off(0..ROW_COINCIDENT);
    assert_none_is_off(ROW_SHARE..ROW_SURVIVAL + 2);
    let lights = [0, 8, 16, 24, 32].into_iter().zip([1, 2, 2, 2, 1]);
    assert_tested(lights.flat_map(|(row, shortest)| row + shortest..=row + 6));
    assert_tested(ROW_COUNTING..ROW_COUNTING + 9);
    assert_tested(ROW_EARLY_END..ROW_EARLY_END + 2);
    assert_tested(ROW_SHARE..ROW_SURVIVAL + 2);
    assert_tested(ROW_SUBSET..=ROW_NOTHING);
    assert_tested(ROW_DELTAS..ROW_DELTAS + 5);
    assert_tested(ROW_MATERIAL..ROW_MATERIAL + MATERIALS);
    assert_tested(EMITTERS.map(|material| ROW_EMITTER + material));
    let (all, lost) = (in_row(ROW_SAMPLES), in_row(ROW_LOST));
    assert!(all > 20_000 && lost < all / 10_000, "{all} paths, {lost} deltas were lost");
}

/// Check 19: two vertices at the same place, or a vertex on a light at the place that was drawn, have no light to exchange: what is
/// added is zero and a number.
#[test]
fn joining_coincident_vertices_adds_nothing() {
    assert_none_is_off(ROW_COINCIDENT..ROW_COINCIDENT + 3);
    assert_tested(ROW_COINCIDENT..ROW_COINCIDENT + 3);
}

fn in_row(row: usize) -> u64 {
    TABLE[row].iter().sum()
}

/// No row counts anything from 1e-5 on.
#[track_caller]
fn assert_none_is_off(rows: Range<usize>) {
    let mut report = String::new();
    for (row, counts) in TABLE.iter().enumerate().take(rows.end).skip(rows.start) {
        if counts[FIRST_WRONG..].iter().any(|&count| count > 0) {
            writeln!(report, "row {row}: {counts:?}").expect("strings can be written to");
        }
    }
    assert!(report.is_empty(), "off by 1e-5 or more (two columns a decade from 1e-8):\n{report}");
}

/// Every row counts some.
#[track_caller]
fn assert_tested(rows: impl IntoIterator<Item = usize>) {
    for row in rows {
        assert!(in_row(row) >= 20, "only {} paths in row {row}", in_row(row));
    }
}

/// Samples of the implicit strategy, twice as many as there are.
const DOUBLED: Edit = ("transport/strategy", "return samples;", "return 2.0 * samples;");

/// Only red light by strategies that join walks, only green light by the implicit one.
const COLOURED: &[Edit] = &[
    (
        "stage/resolve",
        "splat(connection.pixel, connection.contribution)",
        "splat(connection.pixel, vec3f(1.0, 0.0, 0.0) * connection.contribution)",
    ),
    (
        "transport/implicit",
        "splat(path_pixel(), contribution)",
        "splat(path_pixel(), vec3f(0.0, 1.0, 0.0) * contribution)",
    ),
];

/// A grey floor, a panel that faces the camera, a mirror that shows it, and a sky.
static GALLERY: LazyLock<BuiltScene> = LazyLock::new(|| {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(grey(0.6));
    let mirror = scene.material(Material::metal("mirror", [0.9; 3], 0.0));
    let panel = scene.material(Material::emitter("panel", [4.0; 3]));
    scene.floor(floor, 0.0, 5.0);
    scene.quad(mirror, dvec3(-1.2, 0.0, 2.2), DVec3::NEG_Z * 3.2, DVec3::Y * 2.0);
    scene.quad(panel, dvec3(-0.4, 0.3, -1.0), DVec3::X * 1.6, DVec3::Y * 1.2);
    scene.camera("main", Camera { eye: dvec3(0.3, 1.0, 4.0), target: dvec3(-0.4, 0.7, 0.0), yfov: 54.0, aspect: 1.0 });
    let sky = Sky::from_directions(16, 8, |towards| [0.3 + 0.4 * towards.x.max(0.0); 3]);
    BuiltScene::new(&scene, Some(&sky))
});

/// Pixels along an edge of a block of the gallery's picture.
const BLOCK: usize = 4;
/// f32 sums of radiance, as a share of the value.
const ROUNDING: f64 = 3e-4;

fn gallery(pipeline: &str, samples: u32) -> Job {
    job(&GALLERY).pipeline(pipeline).size(24, 24).edges(4).samples(samples)
}

static GALLERY_BY_PT: LazyLock<Rendering> = LazyLock::new(|| gallery("pt", 512).render());

#[track_caller]
fn assert_agree(a: &Rendering, b: &Rendering, what: &str) {
    assert_eq!((a.rejected, b.rejected), (0, 0), "{what}: rejected contributions");
    let comparison = Comparison::of(&a.pixels, &b.pixels, BLOCK, ROUNDING);
    assert!(comparison.noise < 0.01, "{what}: too noisy to test anything, {comparison:?}");
    assert!(comparison.agrees(), "{what}: {comparison:?}");
}

/// Check 11: every way of counting implicit samples is right where nothing but them finds the light.
#[test]
fn every_way_of_counting_shows_the_same_gallery() {
    for counting in ["first", "measured", "realised"] {
        let rendering = gallery("sbdpt", 128).set("counting", counting).render();
        assert_agree(&rendering, &GALLERY_BY_PT, counting);
    }
}

/// Check 11: with twice the number of implicit samples the light of a path falls to 1 - w/2, w being the weight of the implicit
/// strategy: where there is no other by a half. So what the others add and twice what it adds make the true image.
#[test]
fn twice_the_implicit_samples_take_half_their_share_away() {
    let job = edited(edited(gallery("sbdpt", 128), &[DOUBLED]), COLOURED);
    let rendering = job.render();
    assert_eq!(rendering.rejected, 0);
    let found = rendering.pixels.block_estimates(BLOCK);
    let expected = GALLERY_BY_PT.pixels.block_estimates(BLOCK);
    let (mut alone, mut mixed) = (0, 0);
    for (found, expected) in found.chunks_exact(3).zip(expected.chunks_exact(3)) {
        let [others, implicit] = [found[0], found[1]];
        let whole = Estimate { mean: others.mean + 2.0 * implicit.mean, error: others.error + 2.0 * implicit.error };
        let z = whole.z(&expected[0], ROUNDING * expected[0].mean);
        assert!(z.abs() < 4.0, "{others:?} by others and {implicit:?}, doubled, for {:?}: z = {z}", expected[0]);
        alone += usize::from(others.mean == 0.0);
        mixed += usize::from(others.mean > 0.0 && implicit.mean > 10.0 * implicit.error.hypot(expected[0].error));
    }
    assert!(
        alone >= 4 && mixed >= 4,
        "{alone} blocks with implicit light alone, {mixed} with a share that can be told from noise"
    );
}

/// Edges of the longest path in the furnace.
const FURNACE_EDGES: u32 = 5;

/// Checks 1, 11 and 17: in a white furnace no walk ends before its time. Every light path has all vertices, the walks take the rays of
/// the formula, those that are joined no more than theirs, and the radiance is the number of edges.
#[test]
fn walks_in_a_white_furnace_take_the_rays_of_the_formula() {
    let scene = furnace(1.0);
    let k = u64::from(FURNACE_EDGES);
    let first = k + (k - 1) * (k - 2) / 2 + (k - 1);
    // The formula but for one: the walk of the last light vertex would see what the camera sees, which counts once.
    let all = k * (k + 1) / 2 + (k - 1) - 1;
    assert_eq!((first, all), (15, 18));
    // Only y_1 and y_3 have eye walks of their own, of k and of k - 3 vertices; a last ray looks for light where that counts.
    let [first_of_pairs, all_of_pairs] = [k + (k - 3) + (k - 1), k + (k - 2) + (k - 1)];
    let joins = k * (k - 1) / 2;
    for (pipeline, counting, particles, walk_rays, most) in [
        ("sbdpt", "first", false, first, joins),
        ("sbdpt", "measured", true, all, joins + (k - 1)),
        ("sbdpt_pairs", "first", false, first_of_pairs, joins),
        ("sbdpt_pairs", "measured", true, all_of_pairs, joins + (k - 1)),
    ] {
        let job = job(&scene).pipeline(pipeline).edges(FURNACE_EDGES).size(16, 16).samples(64);
        let rendering = job.set("counting", counting).set("use_particle", particles).render();
        assert_mean(&rendering, f64::from(FURNACE_EDGES), &format!("{pipeline}, {counting}"));
        let paths = 16 * 16 * 64;
        assert_eq!(rendering.rays - rendering.visibility, walk_rays * paths, "{pipeline}, {counting}: rays of walks");
        assert!(
            rendering.visibility <= most * paths,
            "{pipeline}, {counting}: {} joining rays of {paths} paths",
            rendering.visibility
        );
        assert!(
            2 * rendering.visibility > joins * paths,
            "{pipeline}, {counting}: only {} joining rays",
            rendering.visibility
        );
        let rates = &rendering.tallies[1..=FURNACE_EDGES as usize];
        let counted = if pipeline == "sbdpt" { [1.0; 5] } else { [1.0, 0.0, 1.0, 0.0, 1.0] };
        assert_eq!(rates, counted, "{pipeline}, {counting}: light paths end");
    }
}

/// In a white furnace every eye walk takes all its rays. With a share of 0 those of y_2 and beyond are missing; with one between, about
/// that share of them is there.
#[test]
fn a_share_of_eye_walks_takes_its_share_of_rays() {
    let scene = furnace(1.0);
    let k = f64::from(FURNACE_EDGES);
    let (others, always) = ((k - 1.0) * (k - 2.0) / 2.0, 2.0 * k - 1.0);
    let paths = 16.0 * 16.0 * 64.0;
    for share in [0.0, 0.25] {
        let job = job(&scene).pipeline("sbdpt").edges(FURNACE_EDGES).size(16, 16).samples(64);
        let rendering = job.set("counting", "first").set("walk_share", share).render();
        assert_mean(&rendering, k, "walk_share");
        let rays = (rendering.rays - rendering.visibility) as f64 / paths;
        // Walks of 3, 2, 1 rays and none, each there or not.
        let error = ((9.0 + 4.0 + 1.0) * share * (1.0 - share) / paths).sqrt();
        assert!((rays - (always + share * others)).abs() <= 4.0 * error, "{share}: {rays} rays of walks a path");
    }
}

/// In a white furnace walks end by nothing but the chance that they are given: of eye walks that go on with probability e and light walks
/// with l the rays are sums of powers of both.
#[test]
fn mortal_walks_take_their_share_of_rays() {
    let scene = furnace(1.0);
    let k = FURNACE_EDGES as i32;
    let paths = 16.0 * 16.0 * 64.0;
    for (eye, light) in [(0.5, 1.0), (1.0, 0.5), (0.7, 0.6)] {
        let job = job(&scene).pipeline("sbdpt").edges(FURNACE_EDGES).size(16, 16).samples(64).set("counting", "first");
        let rendering = job.set("eye_survival", eye).set("light_survival", light).render();
        assert_mean(&rendering, f64::from(k), "survival");
        let reached = |t: i32| if t == 1 { 1.0 } else { f64::powi(light, t - 2) };
        let eye_rays = |t: i32| (0..if t == 1 { k } else { k - t }).map(|i| f64::powi(eye, i)).sum::<f64>();
        let expected: f64 = (1..=k).map(|t| reached(t) * (eye_rays(t) + f64::from(u8::from(t > 1)))).sum();
        let rays = (rendering.rays - rendering.visibility) as f64 / paths;
        // A path takes 6 to 15 rays, so that their deviation is 4.5 at most.
        let error = 4.5 / f64::sqrt(paths);
        assert!((rays - expected).abs() <= 4.0 * error, "{eye}, {light}: {rays} rays of walks a path, not {expected}");
    }
}

/// Invariant 11, without which "none was refused" says little: a contribution that is no number is refused, and counted.
#[test]
fn contributions_that_are_no_numbers_are_counted() {
    let scene = furnace(0.5);
    let job = job(&scene).pipeline("sbdpt").edges(2).size(16, 16).samples(8).set("counting", "first");
    let no_number = "let weight = (transported.x - transported.x) / (transported.y - transported.y) + weight_over(";
    let rendering = job.edited("transport/connect", "let weight = weight_over(", no_number).render();
    let joined = 16 * 16 * 8;
    assert!(2 * rendering.rejected > joined, "{} of {joined} were counted", rendering.rejected);
}

/// Edges of paths at the limits.
const MANY_EDGES: u32 = 20;

/// Few samples of long paths.
fn long(scene: &BuiltScene) -> Rendering {
    let job = job(scene).pipeline("sbdpt").edges(MANY_EDGES).size(16, 16).samples(8);
    job.set("counting", "first").render()
}

fn by_pt(scene: &BuiltScene) -> Rendering {
    job(scene).pipeline("pt").edges(MANY_EDGES).size(16, 16).samples(64).render()
}

/// The mean of the picture is another's: within four standard errors, which are below 5 %. No contribution was refused.
#[track_caller]
fn assert_same_mean(rendering: &Rendering, expected: &Rendering, what: &str) {
    assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
    let finite = rendering.pixels.rgb.iter().flatten().all(|value| value.is_finite());
    assert!(finite, "{what}: a pixel is not finite");
    let (found, expected) = (rendering.pixels.mean_estimate(), expected.pixels.mean_estimate());
    for estimate in [found, expected] {
        assert!(estimate.error < 0.05 * estimate.mean, "{what}: {estimate:?} is too noisy to test anything");
    }
    let z = found.z(&expected, 1e-3 * expected.mean);
    assert!(z.abs() < 4.0, "{what}: {found:?}, expected {expected:?}, z = {z}");
}

/// Check 19: long paths in a room of millimetres and in one of a hundred kilometres, between metals that are all but mirrors.
#[test]
fn long_paths_at_any_scale() {
    let expected = by_pt(&polished_room(1.0));
    for scale in [1e-3, 1e5] {
        let found = long(&polished_room(scale));
        assert_same_mean(&found, &expected, &format!("scale {scale}"));
    }
}

/// A room with two blocks of metal.
fn polished_room(scale: f64) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(grey(0.5));
    let light = scene.material(Material::emitter("light", [5.0; 3]));
    scene.room(wall, DVec3::splat(-scale), DVec3::splat(scale));
    scene.ceiling(light, 0.98 * scale, 1.2 * scale);
    metal_blocks(&mut scene, DVec3::ZERO, scale);
    let (eye, target) = (dvec3(0.3, 0.1, 0.95) * scale, dvec3(0.0, -0.3, 0.0) * scale);
    scene.camera("main", Camera { eye, target, yfov: 80.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

/// Two blocks. The roughness of one makes alpha 1.1e-4, just above what counts as a delta; the other is one.
fn metal_blocks(scene: &mut SceneBuilder, place: DVec3, scale: f64) {
    for (roughness, x) in [(0.0105, -0.7), (1e-3, 0.1)] {
        let metal = scene.material(Material::metal(&format!("metal {roughness}"), [0.9; 3], roughness));
        let (low, high) = (place + dvec3(x, -0.9, -0.5), place + dvec3(x + 0.5, -0.2, 0.0));
        scene.mesh(metal, turned_cuboid(low * scale, high * scale, 0.4));
    }
}

/// Check 19: a light whose edge is a millionth of the scene, as bright as the other one: in the air, and on a table as small. That is
/// seen where the light stands on it: vertices that are joined lie down to nothing apart.
#[test]
fn long_paths_to_a_tiny_light() {
    let room = Camera { eye: dvec3(0.3, 0.1, 0.95), target: dvec3(0.0, -0.3, 0.0), yfov: 80.0, aspect: 1.0 };
    let yfov = 2.0 * 0.06f64.atan().to_degrees();
    let seam = Camera { eye: dvec3(0.0, 1e-5, 0.6e-6), target: dvec3(0.0, 0.0, 0.6e-6), yfov, aspect: 1.0 };
    for (height, camera) in [(0.3, room), (0.0, seam)] {
        let scene = room_with_a_tiny_light(height, camera);
        assert_same_mean(&long(&scene), &by_pt(&scene), &format!("{height} m above the table"));
    }
}

/// An upright panel of a micrometre at a height above a table of eight, in a room with a panel of half a metre under the ceiling. The
/// metal is outside, where it only makes the kernels those of `polished_room`, which need not be compiled again.
fn room_with_a_tiny_light(height: f64, camera: Camera) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(grey(0.5));
    let light = scene.material(Material::emitter("light", [5.0; 3]));
    let tiny = scene.material(Material::emitter("tiny", [1e12; 3]));
    scene.room(wall, DVec3::splat(-1.0), DVec3::splat(1.0));
    scene.ceiling(light, 0.98, 0.5);
    scene.quad(wall, dvec3(-2e-6, 0.0, 6e-6), DVec3::X * 8e-6, DVec3::NEG_Z * 8e-6);
    scene.quad(tiny, dvec3(-0.5e-6, height, 0.0), DVec3::X * 1e-6, DVec3::Y * 1e-6);
    metal_blocks(&mut scene, DVec3::X * 4.0, 1.0);
    scene.camera("main", camera);
    BuiltScene::new(&scene, None)
}
