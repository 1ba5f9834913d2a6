//! Images of an independent renderer, where a folder `shared` with scenes and references lies beside the repository.
//!
//! Without that folder these tests say so and pass: they check nothing then.

use tests::references::{Score, expect_errors, reference, scene, shared};
use tests::rendering::{Job, Rendering};
use tests::statistics::{Estimate, Pixels};

const ROUNDING: f64 = 1e-3;

/// Block means within the combined standard errors: none beyond 6, at most one in 10,000 beyond 4; the whole image within 0.5 % or its noise.
#[track_caller]
fn assert_converges_to(name: &str, pipeline: &str, shrink: u32, samples: u32) {
    let Some(shared) = shared() else { return };
    let reference = reference(&shared, name);
    let expected = reference.image(&shared).shrunk(shrink as usize);
    let mut rendering = reference.job(&shared, shrink).pipeline(pipeline).samples(samples).render();
    assert_eq!(rendering.rejected, 0, "{name}: rejected contributions");
    expect_errors(&mut rendering.pixels, &expected, reference.spp * shrink * shrink / samples);
    assert_agrees(&rendering, &expected, &format!("{pipeline} on {name}"));
}

#[track_caller]
fn assert_agrees(rendering: &Rendering, expected: &Pixels, name: &str) {
    let score = Score::of(&rendering.pixels, expected, None, ROUNDING);
    assert!(score.agrees(), "{name}: {score:?}");
}

#[test]
fn cornell_box() {
    assert_converges_to("cornell_box", "pt", 4, 256);
    assert_converges_to("cornell_box", "sbdpt", 4, 32);
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
    assert_converges_to("cbox_hole", "pt", 4, 256);
    assert_converges_to("cbox_hole", "sbdpt", 4, 32);
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
    let wanted = reference.image(&shared).mean_estimate();
    for (pipeline, samples) in [("pt", 96), ("sbdpt", 24)] {
        let rendering = reference.job(&shared, 4).pipeline(pipeline).samples(samples).render();
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
    let rendering = reference.job(&shared, 4).pipeline("pt").samples(64).render();
    assert_eq!(rendering.rejected, 0);
    let (found, wanted) = (rendering.pixels.mean_estimate(), reference.image(&shared).mean_estimate());
    assert!(found.z(&wanted, 0.01 * wanted.mean).abs() < 4.0, "{found:?}, reference {wanted:?}");
}
