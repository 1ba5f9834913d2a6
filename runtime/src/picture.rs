//! From linear radiance to a picture for the eye: exposure, sRGB, PNG.

use crate::error::Error;
use image::ImageEncoder;
use image::codecs::png::PngEncoder;
use std::path::Path;

/// How bright a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// The 95th percentile of the pixels' luminance becomes white.
    Percentile,
    /// Radiance is multiplied by 2^stops; 1 is white.
    Stops(f32),
}

impl Exposure {
    /// The factor for these pixels, three channels each.
    pub fn factor(self, pixels: &[f32]) -> f32 {
        match self {
            Exposure::Stops(stops) => stops.exp2(),
            Exposure::Percentile => {
                let white = percentile(pixels.chunks_exact(3).map(luminance).collect(), 0.95);
                if white > 0.0 { 1.0 / white } else { 1.0 }
            }
        }
    }
}

/// Luminance of linear sRGB (Rec. 709 weights).
pub fn luminance(rgb: &[f32]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// The value that this part of the others does not exceed; the largest when that is zero, as in a picture of one bright spot.
fn percentile(mut values: Vec<f32>, part: f64) -> f32 {
    values.retain(|value| value.is_finite());
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f32::total_cmp);
    let value = values[((values.len() - 1) as f64 * part) as usize];
    if value > 0.0 { value } else { values[values.len() - 1] }
}

/// sRGB-encoded bytes of linear radiance times `factor`.
pub fn to_srgb(pixels: &[f32], factor: f32) -> Vec<u8> {
    pixels.iter().map(|&value| (encode(value * factor) * 255.0 + 0.5) as u8).collect()
}

fn encode(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Writes 8-bit RGB as PNG, to another name first so that a picture is never half written.
///
/// # Errors
/// Failed, when the file cannot be written.
pub fn write_png(path: &Path, size: [u32; 2], rgb: &[u8]) -> Result<(), Error> {
    let bytes = png(size, rgb).map_err(|error| error.in_file(path))?;
    crate::image_file::replace(path, |temporary| std::fs::write(temporary, &bytes).map_err(|error| error.to_string()))
}

/// The bytes of a PNG file of 8-bit RGB.
///
/// # Errors
/// Failed, when the picture cannot be encoded.
pub fn png(size: [u32; 2], rgb: &[u8]) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(rgb, size[0], size[1], image::ExtendedColorType::Rgb8)
        .map_err(|error| Error::failed(format!("cannot encode the picture: {error}")))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_ends_and_middle() {
        assert_eq!(to_srgb(&[0.0, 1.0, 0.214_041_14, -1.0, 7.0, f32::NAN], 1.0), [0, 255, 128, 0, 255, 0]);
    }

    #[test]
    fn the_95th_percentile_is_white() {
        let mut pixels: Vec<f32> = (0..100).flat_map(|_| [0.5; 3]).collect();
        pixels[..12].fill(1000.0);
        assert!((Exposure::Percentile.factor(&pixels) - 2.0).abs() < 1e-5);
    }

    #[test]
    fn a_black_picture_keeps_its_exposure() {
        assert_eq!(Exposure::Percentile.factor(&[0.0; 12]), 1.0);
    }
}
