//! Measures of the difference of two images.

use super::{Image, blocks};
use crate::picture::{Exposure, to_srgb};
use serde::Serialize;

/// Keeps the relative error of dark pixels finite.
const DARK: f64 = 0.01;

/// How far an image is from a reference.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Metrics {
    /// Mean squared difference over pixels and channels.
    pub mse: f64,
    /// Mean of (a - b)^2 / (b^2 + 0.01).
    pub relmse: f64,
    /// Mean FLIP error of the two pictures, shown with the exposure of the reference; 0 to 1.
    pub flip: f64,
    /// Mean of the image over mean of the reference, by channel; `None` where the reference is black.
    pub mean_ratio: [Option<f64>; 3],
}

/// Compares an image with a reference of the same size.
pub fn metrics(image: &Image, reference: &Image) -> Metrics {
    let pairs = || image.radiance.iter().zip(&reference.radiance).map(|(&a, &b)| (f64::from(a), f64::from(b)));
    let count = image.radiance.len().max(1) as f64;
    Metrics {
        mse: pairs().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / count,
        relmse: pairs().map(|(a, b)| (a - b).powi(2) / (b * b + DARK)).sum::<f64>() / count,
        flip: f64::from(nv_flip::FlipPool::from_image(&flip(image, reference)).mean()),
        mean_ratio: [0, 1, 2].map(|channel| mean_ratio(image, reference, channel)),
    }
}

/// Mean over the blocks of `side` x `side` pixels, and over channels, of the squared difference of the block's means: what is left
/// of the error when noise that pixels do not share averages out.
pub fn block_mse(image: &Image, reference: &Image, side: u32) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for (corner, end) in blocks(image.size, side) {
        for channel in 0..3 {
            sum += block_difference(image, reference, corner, end, channel).powi(2);
            count += 1.0;
        }
    }
    sum / count.max(1.0)
}

fn block_difference(image: &Image, reference: &Image, corner: [u32; 2], end: [u32; 2], channel: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for y in corner[1]..end[1] {
        for x in corner[0]..end[0] {
            let at = (y as usize * image.size[0] as usize + x as usize) * 3 + channel;
            sum += f64::from(image.radiance[at]) - f64::from(reference.radiance[at]);
            count += 1.0;
        }
    }
    sum / count
}

/// FLIP's picture of the difference: 8-bit RGB, dark where nothing differs.
pub fn difference_picture(image: &Image, reference: &Image) -> Vec<u8> {
    flip(image, reference).apply_color_lut(&nv_flip::magma_lut()).to_vec()
}

fn flip(image: &Image, reference: &Image) -> nv_flip::FlipImageFloat {
    let factor = Exposure::Percentile.factor(&reference.radiance);
    let shown = |image: &Image| {
        nv_flip::FlipImageRgb8::with_data(image.size[0], image.size[1], &to_srgb(&image.radiance, factor))
    };
    nv_flip::flip(shown(reference), shown(image), nv_flip::DEFAULT_PIXELS_PER_DEGREE)
}

fn mean_ratio(image: &Image, reference: &Image, channel: usize) -> Option<f64> {
    let sum =
        |image: &Image| image.radiance.iter().skip(channel).step_by(3).map(|&value| f64::from(value)).sum::<f64>();
    let below = sum(reference);
    (below > 0.0).then(|| sum(image) / below)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f32) -> Image {
        Image { size: [16, 16], radiance: vec![value; 16 * 16 * 3], standard_error: None, fixed: None, settings: None }
    }

    #[test]
    fn equal_images_do_not_differ() {
        let same = metrics(&flat(0.5), &flat(0.5));
        assert_eq!((same.mse, same.relmse, same.flip), (0.0, 0.0, 0.0));
        assert_eq!(same.mean_ratio, [Some(1.0); 3]);
    }

    #[test]
    fn noise_averages_out_in_blocks() {
        let mut noisy = flat(0.5);
        for pixel in noisy.radiance.chunks_exact_mut(6) {
            pixel.copy_from_slice(&[0.25, 0.25, 0.25, 0.75, 0.75, 0.75]);
        }
        assert_eq!((block_mse(&noisy, &flat(0.5), 8), block_mse(&noisy, &flat(0.5), 1)), (0.0, 0.0625));
        assert_eq!(block_mse(&flat(1.0), &flat(0.5), 7), 0.25);
    }

    #[test]
    fn a_uniform_difference_has_a_known_error() {
        let found = metrics(&flat(1.0), &flat(0.5));
        assert!((found.mse - 0.25).abs() < 1e-12);
        assert!((found.relmse - 0.25 / 0.26).abs() < 1e-12);
        assert_eq!(found.mean_ratio, [Some(2.0); 3]);
    }
}
