//! Skies: images of radiance over the sphere of directions, written as EXR.

use exr::prelude::{
    Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2, WritableImage, f16,
};
use glam::DVec3;
use std::f64::consts::{PI, TAU};
use std::io::Cursor;

/// A latitude-longitude image: row 0 is the zenith; the left edge looks to -Z, a quarter to the right to +X.
#[derive(Clone, Debug)]
pub struct Sky {
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear radiance, row by row.
    pub texels: Vec<[f32; 3]>,
}

impl Sky {
    /// The same radiance from everywhere.
    pub fn constant(radiance: [f32; 3]) -> Sky {
        Sky { width: 4, height: 2, texels: vec![radiance; 8] }
    }

    /// Radiance given for the direction of each texel's centre.
    pub fn from_directions(width: usize, height: usize, radiance: impl Fn(DVec3) -> [f64; 3]) -> Sky {
        let texels = (0..width * height)
            .map(|i| {
                let u = ((i % width) as f64 + 0.5) / width as f64;
                let v = ((i / width) as f64 + 0.5) / height as f64;
                radiance(direction(u, v)).map(|channel| channel as f32)
            })
            .collect();
        Sky { width, height, texels }
    }

    /// The image as an EXR file of half floats. Equal skies give equal bytes.
    ///
    /// # Errors
    /// What the EXR writer refuses: an image without texels.
    pub fn to_exr(&self) -> Result<Vec<u8>, exr::error::Error> {
        let texel = |at: Vec2<usize>| {
            let [r, g, b] = self.texels[at.1 * self.width + at.0];
            (f16::from_f32(r), f16::from_f32(g), f16::from_f32(b))
        };
        let layer = Layer::new(
            (self.width, self.height),
            LayerAttributes::default(),
            Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing },
            SpecificChannels::rgb(texel),
        );
        let mut file = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut file)?;
        Ok(file.into_inner())
    }
}

/// The direction of a point of the image, from `u` (left to right) and `v` (zenith to nadir) in 0..1.
pub fn direction(u: f64, v: f64) -> DVec3 {
    let (sin_polar, cos_polar) = (PI * v).sin_cos();
    let (sin, cos) = (TAU * u).sin_cos();
    DVec3::new(sin_polar * sin, cos_polar, -sin_polar * cos)
}

/// A clear day: bright at the horizon, deep blue above, dull ground below, and a sun of a few texels.
///
/// `sun` is a unit vector, `irradiance` what the sun alone gives on a surface that faces it (W/m2).
pub fn clear_day(width: usize, height: usize, sun: DVec3, irradiance: [f64; 3]) -> Sky {
    let mut sky = Sky::from_directions(width, height, |towards| daylight(towards, sun));
    add_sun(&mut sky, sun, irradiance);
    sky
}

fn daylight(towards: DVec3, sun: DVec3) -> [f64; 3] {
    const ZENITH: [f64; 3] = [0.14, 0.30, 0.72];
    const HORIZON: [f64; 3] = [0.78, 0.86, 0.95];
    const GROUND: [f64; 3] = [0.16, 0.14, 0.11];
    if towards.y < 0.0 {
        return GROUND;
    }
    let height = towards.y.sqrt();
    let glow = 0.6 * towards.dot(sun).max(0.0).powi(24);
    std::array::from_fn(|i| HORIZON[i] + (ZENITH[i] - HORIZON[i]) * height + glow)
}

/// Spreads the sun over the texels whose centres are within two texels of it, each with the same radiance.
fn add_sun(sky: &mut Sky, sun: DVec3, irradiance: [f64; 3]) {
    let reach = 2.0 * PI / sky.height as f64;
    let mut covered = Vec::new();
    let mut seen = 0.0;
    for i in 0..sky.texels.len() {
        let v = ((i / sky.width) as f64 + 0.5) / sky.height as f64;
        let towards = direction(((i % sky.width) as f64 + 0.5) / sky.width as f64, v);
        let cosine = towards.dot(sun);
        if cosine > reach.cos() {
            covered.push(i);
            seen += cosine * texel_solid_angle(sky, v);
        }
    }
    for i in covered {
        for (channel, power) in sky.texels[i].iter_mut().zip(irradiance) {
            *channel += (power / seen) as f32;
        }
    }
}

fn texel_solid_angle(sky: &Sky, v: f64) -> f64 {
    (TAU / sky.width as f64) * (PI / sky.height as f64) * (PI * v).sin()
}
