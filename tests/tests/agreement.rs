//! Pipelines that can sample the same light converge to the same image: block means agree within their standard errors.

use glam::dvec3;
use tests::compared::{ball_beside_a_wall, beside_a_caustic, lamps, leaning_mirror, sun_and_sky};
use tests::material::Material;
use tests::rendering::{Job, Rendering, shipped};
use tests::shape::{Mesh, sphere};
use tests::statistics::{spread, z_scores};

const BLOCK: usize = 8;
/// f32 sums of radiance, as a share of the value.
const ROUNDING: f64 = 1e-4;

#[track_caller]
fn assert_agree(a: &Rendering, b: &Rendering, what: &str) {
    assert_blocks_agree(a, b, BLOCK, what);
}

#[track_caller]
fn assert_blocks_agree(a: &Rendering, b: &Rendering, block: usize, what: &str) {
    assert_eq!((a.rejected, b.rejected), (0, 0), "{what}: rejected contributions");
    let spread = spread(&z_scores(&a.pixels.block_estimates(block), &b.pixels.block_estimates(block), ROUNDING));
    assert!(spread.agrees(), "{what}: blocks {spread:?}");
    let (mean_a, mean_b) = (a.pixels.mean_estimate(), b.pixels.mean_estimate());
    let z = mean_a.z(&mean_b, ROUNDING * mean_a.mean);
    assert!(z.abs() < 4.0, "{what}: whole image {mean_a:?} against {mean_b:?}");
    for mean in [mean_a, mean_b] {
        assert!(mean.error < 0.01 * mean.mean, "{what}: {mean:?} is too noisy to test anything");
    }
}

fn render_all(job: &Job, pipelines: &[(&str, u32)]) -> Vec<Rendering> {
    let with = |&(pipeline, samples): &(&str, u32)| job.clone().pipeline(pipeline).samples(samples).render();
    pipelines.iter().map(with).collect()
}

#[test]
fn nee_pt_and_lt_agree_on_the_cornell_box() {
    let job = Job::of_file(shipped("cornell_box")).size(48, 48).edges(4);
    let renders = render_all(&job, &[("nee", 256), ("pt", 256), ("lt", 512)]);
    assert_agree(&renders[0], &renders[1], "nee and pt");
    assert_agree(&renders[2], &renders[1], "lt and pt");
}

#[test]
fn balance_and_power_heuristic_agree() {
    let job = Job::of_file(shipped("cornell_box")).pipeline("pt").size(48, 48).edges(4).samples(128);
    let renders = ["balance", "power"].map(|heuristic| job.clone().set("heuristic", heuristic).render());
    assert_agree(&renders[0], &renders[1], "balance and power");
}

#[test]
fn nee_and_pt_agree_on_one_light_of_each_kind() {
    let job = Job::of_file(shipped("light_kinds")).size(64, 40).edges(4);
    let renders = render_all(&job, &[("nee", 512), ("pt", 512)]);
    assert_agree(&renders[0], &renders[1], "nee and pt");
}

#[test]
fn lt_agrees_where_no_light_is_at_infinity() {
    let scene = lamps();
    let job = scene.job().size(48, 48).edges(4);
    let renders = render_all(&job, &[("nee", 256), ("pt", 256), ("lt", 512)]);
    assert_agree(&renders[0], &renders[1], "nee and pt");
    assert_agree(&renders[2], &renders[1], "lt and pt");
}

/// Lights at infinity: a sun, and a sky that is bright on one side.
#[test]
fn nee_pt_and_lt_agree_under_sun_and_sky() {
    let scene = sun_and_sky();
    let job = scene.job().size(48, 48).edges(4);
    let renders = render_all(&job, &[("nee", 256), ("pt", 256), ("lt", 1024)]);
    assert_agree(&renders[0], &renders[1], "nee and pt");
    assert_agree(&renders[2], &renders[1], "lt and pt");
}

/// Check 18: interpolated normals far from those of the triangles. Walks from the light must weigh them differently (Veach 1997, 5.3).
#[test]
fn lt_and_pt_agree_on_a_coarse_sphere_with_smooth_normals() {
    let clay = Material::lambert("clay", [0.8, 0.5, 0.3]);
    let scene = ball_beside_a_wall(clay, 3);
    let renders = render_all(&scene.job().size(48, 48).edges(4), &[("nee", 512), ("pt", 512), ("lt", 4096)]);
    // Facets are brighter and darker side by side: larger blocks would take the mean over them.
    for block in [4, BLOCK] {
        assert_blocks_agree(&renders[0], &renders[1], block, "nee and pt");
        assert_blocks_agree(&renders[2], &renders[1], block, "lt and pt");
    }
}

/// Microfacets, reflecting and refracting, with interpolated normals.
#[test]
fn lt_and_pt_agree_on_rough_glass_and_metal() {
    let glass = Material::glass("glass", 1.5, 0.5);
    let metal = Material::metal("metal", [0.9, 0.7, 0.4], 0.5);
    let glaze = Material::glossy("glaze", [0.2, 0.4, 0.6], 0.5);
    for material in [glass, metal, glaze] {
        let name = material.name.clone();
        let scene = ball_beside_a_wall(material, 8);
        let renders = render_all(&scene.job().size(48, 48).edges(6), &[("pt", 256), ("lt", 512)]);
        assert_agree(&renders[1], &renders[0], &name);
    }
}

/// A caustic of a glass ball: walks from the camera find the light by chance, walks from the light find the floor.
#[test]
fn lt_and_pt_agree_on_a_caustic_of_glass() {
    let glass = Material::glass("glass", 1.5, 0.0);
    assert_caustics_agree(glass, sphere(dvec3(0.0, 0.6, 0.0), 0.4, 16).flat());
}

/// A caustic of a mirror whose normals are tilted towards the floor: deltas must weigh shading normals as other lobes do.
#[test]
fn lt_and_pt_agree_on_a_caustic_of_a_mirror() {
    assert_caustics_agree(Material::metal("mirror", [0.9, 0.8, 0.7], 0.0), leaning_mirror());
}

/// The floor beside or below a shape looks the same from the camera and from the light.
#[track_caller]
fn assert_caustics_agree(material: Material, shape: Mesh) {
    let scene = beside_a_caustic(material, shape);
    let job = scene.job().size(48, 24).edges(8);
    let renders = render_all(&job, &[("pt", 1024), ("lt", 2048)]);
    assert_agree(&renders[1], &renders[0], "lt and pt");
}
