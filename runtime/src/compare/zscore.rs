//! Whether two images differ by more than their own noise: z-scores of block means.

use super::{Image, blocks};

/// Relative rounding that a converged f32 image may have, about 2^-20; keeps noiseless blocks from infinite scores.
const ROUNDING: f64 = 1e-6;

/// One channel of one block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockZ {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// Difference of the block means over its standard error.
    pub z: f64,
}

/// The z-scores of all blocks of `block` x `block` pixels, smaller at the right and lower edge, three channels each. The error is the
/// combined one of both images; `None` when neither has standard errors. The images must have one size.
///
/// For equal expectations the scores are close to standard normal (wider where the errors come from few batches).
pub fn block_z(a: &Image, b: &Image, block: u32) -> Option<Vec<BlockZ>> {
    if a.standard_error.is_none() && b.standard_error.is_none() {
        return None;
    }
    let of_block = |(corner, end): ([u32; 2], [u32; 2])| {
        [0, 1, 2].map(|channel| BlockZ { x: corner[0], y: corner[1], channel, z: score(a, b, corner, end, channel) })
    };
    Some(blocks(a.size, block).flat_map(of_block).collect())
}

/// The largest absolute score.
pub fn largest(scores: &[BlockZ]) -> f64 {
    scores.iter().map(|score| score.z.abs()).fold(0.0, f64::max)
}

fn score(a: &Image, b: &Image, corner: [u32; 2], end: [u32; 2], channel: usize) -> f64 {
    let (mut difference, mut variance) = (0.0, 0.0);
    for y in corner[1]..end[1] {
        for x in corner[0]..end[0] {
            let at = (y as usize * a.size[0] as usize + x as usize) * 3 + channel;
            let (first, second) = (f64::from(a.radiance[at]), f64::from(b.radiance[at]));
            difference += first - second;
            variance +=
                error(a, at).powi(2) + error(b, at).powi(2) + (ROUNDING * first.abs().max(second.abs())).powi(2);
        }
    }
    if difference == 0.0 { 0.0 } else { difference / variance.sqrt() }
}

fn error(image: &Image, at: usize) -> f64 {
    image.standard_error.as_ref().map_or(0.0, |errors| f64::from(errors[at]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: f32, error: Option<f32>) -> Image {
        let count = 10 * 9 * 3;
        Image {
            size: [10, 9],
            radiance: vec![value; count],
            standard_error: error.map(|error| vec![error; count]),
            fixed: None,
            settings: None,
        }
    }

    #[test]
    fn without_errors_there_are_no_scores() {
        assert!(block_z(&image(1.0, None), &image(1.0, None), 8).is_none());
    }

    #[test]
    fn blocks_cover_the_edges() {
        let scores = block_z(&image(1.0, Some(0.1)), &image(1.0, None), 8);
        assert_eq!(scores.map(|scores| scores.len()), Some(2 * 2 * 3));
    }

    #[test]
    fn errors_combine_and_average_out() {
        let scores = block_z(&image(1.1, Some(0.03)), &image(1.0, Some(0.04)), 8).unwrap_or_default();
        let expected = 0.1 / (0.05 / 8.0);
        assert!((scores[0].z - expected).abs() < 1e-3, "{} against {expected}", scores[0].z);
    }
}
