//! Renderings of one picture, held against each other.

use crate::rendering::Rendering;
use crate::statistics::{Pixels, Spread, spread, z_scores};

/// Pixels along an edge of a block whose mean is compared.
pub const BLOCK: usize = 8;
/// f32 sums of radiance, as a share of the value.
pub const ROUNDING: f64 = 3e-4;

/// Two renderings show the same image.
///
/// # Panics
/// When they do not, are too noisy to tell, or refused contributions.
#[track_caller]
pub fn assert_agree(a: &Rendering, b: &Rendering, what: &str) {
    assert_eq!((a.rejected, b.rejected), (0, 0), "{what}: rejected contributions");
    assert_same(&a.pixels, &b.pixels, BLOCK, 0.01, what);
}

/// Block means and the mean of two images agree; the standard errors of the latter, as a share, are below `noise`. The channels of a
/// block are no independent tests where light or surfaces are grey: the worst counts.
///
/// # Panics
/// When they do not agree, or are too noisy to tell.
#[track_caller]
pub fn assert_same(a: &Pixels, b: &Pixels, block: usize, noise: f64, what: &str) {
    let means = [a, b].map(Pixels::mean_estimate);
    for mean in means {
        assert!(mean.error <= noise * mean.mean, "{what}: {mean:?} is too noisy to test anything");
    }
    let blocks = worst_of_blocks(a, b, block);
    assert!(blocks.agrees(), "{what}: blocks {blocks:?}");
    let z = means[0].z(&means[1], ROUNDING * means[1].mean);
    assert!(z.abs() < 4.0, "{what}: {:?} against {:?}", means[0], means[1]);
}

/// z-scores of blocks, of each that of its worst channel.
pub fn worst_of_blocks(a: &Pixels, b: &Pixels, block: usize) -> Spread {
    let scores = z_scores(&a.block_estimates(block), &b.block_estimates(block), ROUNDING);
    let worst = |channels: &[f64]| channels.iter().fold(0.0, |worst: f64, score| worst.max(score.abs()));
    spread(&scores.chunks_exact(3).map(worst).collect::<Vec<f64>>())
}

/// Two renderings differ in the mean by far more than noise, and by a twentieth at least.
///
/// # Panics
/// When they do not.
#[track_caller]
pub fn assert_differ(a: &Rendering, b: &Rendering, what: &str) {
    let (a, b) = (a.pixels.mean_estimate(), b.pixels.mean_estimate());
    let apart = (a.mean - b.mean).abs();
    assert!(a.z(&b, 0.0).abs() > 10.0 && apart > 0.05 * b.mean, "{what}: {a:?} against {b:?}");
}
