//! The sky: an equirectangular image of radiance, and the distribution its directions are drawn from.

use super::alias;
use crate::error::{Error, Result};
use exr::prelude::{ReadChannels as _, ReadLayers as _};
use std::f64::consts::PI;
use std::path::Path;

/// Most texels of a sky: their table of 2 GiB is what the largest devices bind at once.
const MOST_TEXELS: usize = 1 << 27;

/// A sky ready to be packed.
pub struct Sky {
    /// Texels in a row.
    pub width: u32,
    /// Rows, zenith first.
    pub height: u32,
    /// Radiance, scaled; linear RGB.
    pub radiance: Vec<[f32; 3]>,
    /// Probability of each texel.
    pub probabilities: Vec<f64>,
    /// Rotation about +Y, radians.
    pub rotation: f64,
    /// Integral of the luminance over the sphere, W/m2 on a surface that all of it meets perpendicularly.
    pub integral: f64,
}

/// Reads a sky; `None` when every texel is black.
///
/// # Errors
/// A file that cannot be read or has no colour channels, a scale or rotation that is not finite.
pub fn read(path: &Path, scale: f64, rotate_deg: f64, warnings: &mut Vec<String>) -> Result<Option<Sky>> {
    if !(scale.is_finite() && scale >= 0.0 && rotate_deg.is_finite()) {
        return Err(Error::input(format!("scale {scale}, rotation {rotate_deg} degrees"))
            .in_file(path)
            .help("a finite scale of 0 or more"));
    }
    let (size, mut radiance) = pixels(path).map_err(|error| error.in_file(path))?;
    repair(&mut radiance, scale, path, warnings);
    let sky = build(size, radiance, rotate_deg.to_radians());
    if sky.is_none() {
        warnings.push(format!("the sky {} is black", path.display()));
    }
    Ok(sky)
}

type Pixels = ((u32, u32), Vec<[f32; 3]>);

fn pixels(path: &Path) -> Result<Pixels> {
    let bytes = std::fs::read(path).map_err(|error| Error::input(format!("cannot read the sky: {error}")))?;
    let (size, radiance) = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        exr_pixels(&bytes)?
    } else if bytes.starts_with(b"#?") {
        // Not strict: the program that writes a file signs it `#?RGBE` as often as `#?RADIANCE`.
        let unreadable = |error: image::ImageError| Error::input(format!("cannot read the Radiance HDR file: {error}"));
        let decoder = image::codecs::hdr::HdrDecoder::new_nonstrict(bytes.as_slice()).map_err(unreadable)?;
        check_size(decoder.metadata().width as usize, decoder.metadata().height as usize)?;
        let image = image::DynamicImage::from_decoder(decoder).map_err(unreadable)?.into_rgb32f();
        (image.dimensions(), image.pixels().map(|pixel| pixel.0).collect())
    } else {
        return Err(
            Error::input("the sky is neither OpenEXR nor Radiance HDR").help("an .exr or .hdr file, equirectangular")
        );
    };
    Ok((size, radiance))
}

/// Before anything of that size is allocated.
fn check_size(width: usize, height: usize) -> Result<()> {
    match width.checked_mul(height) {
        Some(1..=MOST_TEXELS) => Ok(()),
        _ => Err(Error::input(format!("the sky is {width}x{height}"))
            .help(format!("1x1 to {MOST_TEXELS} texels, such as 16384x8192"))),
    }
}

fn exr_pixels(bytes: &[u8]) -> Result<Pixels> {
    let unreadable = |error: exr::error::Error| Error::input(format!("cannot read the OpenEXR file: {error}"));
    let described = exr::meta::MetaData::read_from_buffered(bytes, false).map_err(unreadable)?;
    for header in &described.headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .map_err(unreadable)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let names: Vec<String> = layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    let find = |wanted: &str| {
        let matches = |name: &String| name.rsplit('.').next().is_some_and(|last| last.eq_ignore_ascii_case(wanted));
        names
            .iter()
            .position(matches)
            .map(|index| layer.channel_data.list[index].sample_data.values_as_f32().collect::<Vec<f32>>())
    };
    let channels = match (find("R"), find("G"), find("B")) {
        (Some(r), Some(g), Some(b)) => [r, g, b],
        _ => match find("Y") {
            Some(y) => [y.clone(), y.clone(), y],
            None => return Err(Error::input(format!("its channels are {}", names.join(", "))).help("R, G and B, or Y")),
        },
    };
    let count = width * height;
    if channels.iter().any(|channel| channel.len() != count) {
        return Err(Error::input("its colour channels are subsampled").help("full resolution"));
    }
    let radiance = (0..count).map(|i| std::array::from_fn(|c| channels[c][i])).collect();
    Ok(((width as u32, height as u32), radiance))
}

/// Scales, and replaces what is no radiance: negative and NaN by 0, infinite by the largest finite value of the image.
fn repair(radiance: &mut [[f32; 3]], scale: f64, path: &Path, warnings: &mut Vec<String>) {
    let scaled = |value: f32| (f64::from(value) * scale).min(f64::from(f32::MAX)) as f32;
    let largest = radiance.as_flattened().iter().copied().filter(|value| value.is_finite()).fold(0.0f32, f32::max);
    let mut replaced = 0usize;
    for value in radiance.as_flattened_mut() {
        let valid = value.is_finite() && *value >= 0.0;
        replaced += usize::from(!valid);
        *value = if valid {
            scaled(*value)
        } else if *value == f32::INFINITY {
            scaled(largest)
        } else {
            0.0
        };
    }
    if replaced > 0 {
        warnings
            .push(format!("sky {}: {replaced} values are negative or not finite and were replaced", path.display()));
    }
}

/// Luminance of linear sRGB, ITU-R BT.709.
pub fn luminance(rgb: [f32; 3]) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

fn build((width, height): (u32, u32), radiance: Vec<[f32; 3]>, rotation: f64) -> Option<Sky> {
    let weights = weights(width as usize, height as usize, &radiance);
    let total = alias::sum(&weights);
    if total <= 0.0 {
        return None;
    }
    let texel_area = 2.0 * PI * PI / (f64::from(width) * f64::from(height));
    Some(Sky {
        width,
        height,
        probabilities: alias::probabilities(&weights),
        radiance,
        rotation,
        integral: total * texel_area,
    })
}

/// Mean over each texel of the bilinearly interpolated luminance, times the mean of sin(theta) over it.
///
/// The mean of a linear interpolant over the cell around a node is 1/8, 6/8, 1/8 of the node and its neighbours.
fn weights(width: usize, height: usize, radiance: &[[f32; 3]]) -> Vec<f64> {
    let values: Vec<f64> = radiance.iter().map(|&rgb| luminance(rgb)).collect();
    let along_u = |x: usize, y: usize| {
        let row = &values[y * width..(y + 1) * width];
        0.125 * (row[(x + width - 1) % width] + row[(x + 1) % width]) + 0.75 * row[x]
    };
    let row_sine = |y: usize| {
        let edge = |y: usize| (PI * y as f64 / height as f64).cos();
        (edge(y) - edge(y + 1)) * height as f64 / PI
    };
    let texel = |x: usize, y: usize| {
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        0.125 * (along_u(x, above) + along_u(x, below)) + 0.75 * along_u(x, y)
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y) * row_sine(y)).collect()
}

impl Sky {
    /// Radiance and p W H / (2 pi^2) of every texel: the density per solid angle is that over sin(theta).
    pub fn texels(&self) -> Vec<[f32; 4]> {
        let scale = f64::from(self.width) * f64::from(self.height) / (2.0 * PI * PI);
        let pack = |(rgb, p): (&[f32; 3], &f64)| [rgb[0], rgb[1], rgb[2], (p * scale) as f32];
        self.radiance.iter().zip(&self.probabilities).map(pack).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_integrates_to_one_and_a_constant_sky_to_four_pi() {
        let sky = build((16, 8), vec![[1.0; 3]; 128], 0.0).unwrap();
        assert!((alias::sum(&sky.probabilities) - 1.0).abs() < 1e-12);
        assert!((sky.integral - 4.0 * PI).abs() < 1e-6);
        let texel_area = 2.0 * PI * PI / 128.0;
        let integral: f64 = sky.texels().iter().map(|texel| f64::from(texel[3]) * texel_area).sum();
        assert!((integral - 1.0).abs() < 1e-6);
    }

    #[test]
    fn neighbours_of_a_bright_texel_can_be_drawn() {
        let mut radiance = vec![[0.0; 3]; 128];
        radiance[3 * 16] = [0.0, 0.0, 1e-3];
        let sky = build((16, 8), radiance, 0.0).unwrap();
        let drawn: Vec<usize> = (0..128).filter(|&i| sky.probabilities[i] > 0.0).collect();
        assert_eq!(drawn, [32, 33, 47, 48, 49, 63, 64, 65, 79]);
        assert!(build((16, 8), vec![[0.0; 3]; 128], 0.0).is_none());
    }
}
