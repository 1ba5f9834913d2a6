//! How far two images are apart: error measures, and z-scores of block means.

pub mod bias;
pub mod metrics;
pub mod zscore;

pub use crate::image_file::Image;
pub use metrics::{Metrics, metrics};
pub use zscore::{BlockZ, block_z};

use crate::error::Error;

/// Refuses images that cannot be compared.
///
/// # Errors
/// User input, when their sizes differ; failed, when a pixel is not finite.
pub fn check(first: (&str, &Image), second: (&str, &Image)) -> Result<(), Error> {
    let ((name_a, a), (name_b, b)) = (first, second);
    if a.size != b.size {
        let shown = |size: [u32; 2]| format!("{}x{}", size[0], size[1]);
        return Err(Error::input(format!(
            "`{name_a}` is {} pixels, but `{name_b}` is {}: only images of one size can be compared",
            shown(a.size),
            shown(b.size)
        )));
    }
    finite(name_a, a)?;
    finite(name_b, b)
}

/// First corner and end (beyond the last column and row) of all blocks of `side` x `side` pixels; those at the right and lower edge are smaller.
fn blocks(size: [u32; 2], side: u32) -> impl Iterator<Item = ([u32; 2], [u32; 2])> {
    let [width, height] = size;
    let side = side.max(1);
    (0..height).step_by(side as usize).flat_map(move |y| {
        (0..width).step_by(side as usize).map(move |x| {
            let end = [x.saturating_add(side).min(width), y.saturating_add(side).min(height)];
            ([x, y], end)
        })
    })
}

fn finite(name: &str, image: &Image) -> Result<(), Error> {
    let bad = |value: &f32| !value.is_finite();
    let Some(first) = image.radiance.iter().position(bad) else { return Ok(()) };
    let count = image.radiance.iter().filter(|value| bad(value)).count();
    let pixel = first / 3;
    let (x, y) = (pixel % image.size[0] as usize, pixel / image.size[0] as usize);
    Err(Error::failed(format!("`{name}` has {count} values that are not finite, the first at pixel {x},{y}")))
}
