//! Images of an independent renderer, where a folder `shared` with scenes and references lies beside the repository.
//!
//! Without that folder these tests say so and pass: they check nothing then.

use serde::Deserialize;
use std::path::{Path, PathBuf};
use tests::rendering::{Job, Rendering, read_reference};
use tests::statistics::{Estimate, Pixels, spread, z_scores};

const BLOCK: usize = 8;
const ROUNDING: f64 = 1e-3;

#[derive(Deserialize)]
struct References {
    reference: Vec<Reference>,
}

#[derive(Clone, Deserialize)]
struct Reference {
    name: String,
    scene: String,
    camera: u32,
    size: [u32; 2],
    max_edges: u32,
    spp: u32,
}

/// The folder of scenes and references, or `None`, with a message that no test runner hides in its summary.
fn shared() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if folder.join("references/references.toml").is_file() {
        return Some(folder);
    }
    eprintln!("SKIPPED: {} has no references; nothing is checked", folder.display());
    None
}

fn reference(shared: &Path, name: &str) -> Reference {
    let text = std::fs::read_to_string(shared.join("references/references.toml")).expect("references.toml can be read");
    let all: References = toml::from_str(&text).expect("references.toml is a list of references");
    all.reference
        .into_iter()
        .find(|reference| reference.name == name)
        .unwrap_or_else(|| panic!("no reference `{name}`"))
}

fn scene(shared: &Path, name: &str) -> PathBuf {
    shared.join(format!("scenes/{name}/{name}.glb"))
}

fn job(shared: &Path, reference: &Reference, shrink: u32) -> Job {
    Job::of_file(scene(shared, &reference.scene))
        .camera(&reference.camera.to_string())
        .edges(reference.max_edges)
        .size(reference.size[0] / shrink, reference.size[1] / shrink)
}

/// Block means within the combined standard errors: none beyond 6, at most one in 10,000 beyond 4; the whole image within 0.5 % or its noise.
#[track_caller]
fn assert_converges_to(name: &str, pipeline: &str, shrink: u32, samples: u32) {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, name);
    let expected = read_reference(&shared.join(format!("references/{name}.exr"))).shrunk(shrink as usize);
    let mut rendering = job(&shared, &reference, shrink).pipeline(pipeline).samples(samples).render();
    assert_eq!(rendering.rejected, 0, "{name}: rejected contributions");
    expect_errors(&mut rendering.pixels, &expected, reference.spp * shrink * shrink / samples);
    assert_agrees(&rendering, &expected, &format!("{pipeline} on {name}"));
}

/// Raises standard errors to those that the reference foretells for so many times fewer samples. Where few paths find light, the
/// error that few samples see of themselves is far too small when they have missed it; the reference has not.
fn expect_errors(pixels: &mut Pixels, reference: &Pixels, times_fewer: u32) {
    let growth = (times_fewer as f32).sqrt();
    for (found, known) in pixels.errors.iter_mut().zip(&reference.errors) {
        *found = std::array::from_fn(|channel| found[channel].max(growth * known[channel]));
    }
}

#[track_caller]
fn assert_agrees(rendering: &Rendering, expected: &Pixels, name: &str) {
    let scores = z_scores(&rendering.pixels.block_estimates(BLOCK), &expected.block_estimates(BLOCK), ROUNDING);
    let spread = spread(&scores);
    assert!(spread.agrees(), "{name}: blocks {spread:?}");
    let (found, wanted) = (rendering.pixels.mean_estimate(), expected.mean_estimate());
    let noise = 4.0 * (found.error.powi(2) + wanted.error.powi(2)).sqrt();
    let off = (found.mean - wanted.mean).abs();
    assert!(off < noise.max(0.005 * wanted.mean), "{name}: mean {found:?}, reference {wanted:?}");
}

#[test]
fn cornell_box() {
    assert_converges_to("cornell_box", "pt", 4, 512);
    assert_converges_to("cornell_box", "sbdpt", 4, 64);
}

#[test]
fn cornell_box_direct() {
    assert_converges_to("cornell_box_direct", "pt", 4, 512);
    assert_converges_to("cornell_box_direct", "sbdpt", 4, 64);
}

#[test]
fn cornell_box_corner() {
    assert_converges_to("cornell_box_corner", "pt", 1, 32);
    assert_converges_to("cornell_box_corner", "sbdpt", 1, 4);
}

#[test]
fn cornell_box_panorama() {
    assert_converges_to("cornell_box_panorama", "pt", 4, 256);
    assert_converges_to("cornell_box_panorama", "sbdpt", 4, 32);
}

#[test]
fn cbox_hole() {
    assert_converges_to("cbox_hole", "pt", 4, 512);
    assert_converges_to("cbox_hole", "sbdpt", 4, 64);
}

#[test]
fn atrium() {
    assert_converges_to("atrium", "pt", 4, 64);
    assert_converges_to("atrium", "sbdpt", 4, 16);
}

/// `bottle_light` is exact but for its chrome ball; a caustic of smooth glass that one lucky path in a thousand finds has block errors
/// that few samples cannot estimate, so that the mean of the image alone is compared here.
#[test]
fn bottle_light_has_the_mean_of_the_reference() {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, "bottle_light");
    let wanted = read_reference(&shared.join("references/bottle_light.exr")).mean_estimate();
    for (pipeline, samples) in [("pt", 256), ("sbdpt", 64)] {
        let rendering = job(&shared, &reference, 4).pipeline(pipeline).samples(samples).render();
        let found = rendering.pixels.mean_estimate();
        assert_eq!(rendering.rejected, 0);
        assert!(found.z(&wanted, 0.01 * wanted.mean).abs() < 5.0, "{pipeline}: {found:?}, reference {wanted:?}");
    }
}

/// Scale 1e6 and 1e-5: the image of `cornell_box`, block means within 1 % at the same random numbers.
#[test]
fn scaled_cornell_boxes_give_its_image() {
    let Some(shared) = shared() else { return };
    let render = |name: &str| {
        let rendering = Job::of_file(scene(&shared, name)).pipeline("pt").edges(8).size(64, 64).samples(64).render();
        assert_eq!(rendering.rejected, 0, "{name}: rejected contributions");
        rendering.pixels.block_estimates(16)
    };
    let expected = render("cornell_box");
    for name in ["odd_huge_1e6", "odd_tiny_1e-5"] {
        assert_blocks_within(&render(name), &expected, 0.01, name);
    }
}

/// 4e4 from the origin f32 vertices stand on a grid of 4 mm, so that walls of the 2 m box lie up to 2 mm off: 2 % a block.
#[test]
fn far_origin_gives_the_image_of_the_cornell_box() {
    let Some(shared) = shared() else { return };
    let blocks = |name: &str| {
        let job = Job::of_file(scene(&shared, name)).pipeline("pt").edges(8).size(64, 64);
        job.samples(128).render().pixels.block_estimates(16)
    };
    assert_blocks_within(&blocks("odd_far_origin"), &blocks("cornell_box"), 0.02, "odd_far_origin");
}

#[track_caller]
fn assert_blocks_within(found: &[Estimate], expected: &[Estimate], share: f64, name: &str) {
    for (index, (a, b)) in found.iter().zip(expected).enumerate() {
        let off = (a.mean - b.mean).abs();
        assert!(off <= share * b.mean.max(1e-3), "{name}: block {} is {} instead of {}", index / 3, a.mean, b.mean);
    }
}

#[test]
fn degenerate_geometry_is_rendered_without_rejections() {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, "odd_degenerate");
    let rendering = job(&shared, &reference, 4).pipeline("pt").samples(64).render();
    assert_eq!(rendering.rejected, 0);
    let (found, wanted) = (
        rendering.pixels.mean_estimate(),
        read_reference(&shared.join("references/odd_degenerate.exr")).mean_estimate(),
    );
    assert!(found.z(&wanted, 0.01 * wanted.mean).abs() < 4.0, "{found:?}, reference {wanted:?}");
}
