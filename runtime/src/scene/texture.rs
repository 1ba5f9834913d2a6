//! Images as 8-bit texels, and how a material looks into them.

use super::accessor;
use super::document::Document;
use super::uri;
use crate::error::{Error, Result};
use gltf::texture::{MagFilter, WrappingMode};
use rayon::prelude::*;
use std::collections::HashMap;

/// A decoded image.
pub struct Image {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA8, red in the lowest byte, first row on top.
    pub texels: Vec<u32>,
    /// Smallest and largest value of each channel, 0..255.
    pub ranges: [(u8, u8); 4],
}

/// What happens outside 0..1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeats.
    Repeat,
    /// The edge goes on.
    Clamp,
    /// The image repeats, mirrored every other time.
    Mirror,
}

/// How one role of a material reads an image.
#[derive(Clone, Debug)]
pub struct Slot {
    /// Index among the images of the scene.
    pub image: usize,
    /// KHR_texture_transform: rows of the 2x3 matrix from mesh to texture coordinates.
    pub matrix: [[f32; 3]; 2],
    /// Along u and v.
    pub wrap: [Wrap; 2],
    /// No filtering.
    pub nearest: bool,
    /// Red, green and blue are sRGB encoded.
    pub srgb: bool,
    /// Which of the material's two texture coordinate sets.
    pub set: usize,
}

/// A texture reference of the file, whichever object it stands in.
pub struct Reference<'a> {
    /// The texture.
    pub texture: gltf::Texture<'a>,
    /// TEXCOORD_n.
    pub tex_coord: u32,
    /// Rows of the 2x3 matrix.
    pub matrix: [[f32; 3]; 2],
}

impl<'a> Reference<'a> {
    /// From a plain texture reference.
    pub fn new(info: &gltf::texture::Info<'a>) -> Self {
        let transform = info.texture_transform();
        let matrix = transform.as_ref().map_or(IDENTITY, |t| transform_matrix(t.offset(), t.rotation(), t.scale()));
        let tex_coord = transform.and_then(|t| t.tex_coord()).unwrap_or(info.tex_coord());
        Self { texture: info.texture(), tex_coord, matrix }
    }

    /// From the reference of a normal map, whose transform the library leaves as JSON.
    pub fn of_normal_map(info: &gltf::material::NormalTexture<'a>) -> Self {
        let Some(json) = info.extension_value("KHR_texture_transform") else {
            return Self { texture: info.texture(), tex_coord: info.tex_coord(), matrix: IDENTITY };
        };
        let number = |value: Option<&serde_json::Value>, default: f32| {
            value.and_then(serde_json::Value::as_f64).map_or(default, |v| v as f32)
        };
        let pair =
            |key: &str, default: f32| [0, 1].map(|i| number(json.get(key).and_then(|value| value.get(i)), default));
        let matrix = transform_matrix(pair("offset", 0.0), number(json.get("rotation"), 0.0), pair("scale", 1.0));
        let tex_coord =
            json.get("texCoord").and_then(serde_json::Value::as_u64).map_or(info.tex_coord(), |set| set as u32);
        Self { texture: info.texture(), tex_coord, matrix }
    }
}

const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Offset after rotation after scale. The rotation is anticlockwise as seen in the image, whose v grows downwards.
fn transform_matrix(offset: [f32; 2], rotation: f32, scale: [f32; 2]) -> [[f32; 3]; 2] {
    let (sin, cos) = f64::from(rotation).sin_cos();
    let scaled = |factor: f64, axis: usize| (factor * f64::from(scale[axis])) as f32;
    [[scaled(cos, 0), scaled(sin, 1), offset[0]], [scaled(-sin, 0), scaled(cos, 1), offset[1]]]
}

/// Collects the images that materials use, each once.
#[derive(Default)]
pub struct Collector {
    /// Index in the file to index in the scene.
    known: HashMap<usize, usize>,
    /// Index in the file, by index in the scene.
    used: Vec<usize>,
}

impl Collector {
    /// The slot that reads a texture; `set` is the place of its coordinates among the material's sets.
    pub fn slot(&mut self, reference: &Reference<'_>, srgb: bool, set: usize) -> Slot {
        let source = reference.texture.source().index();
        let image = *self.known.entry(source).or_insert_with(|| {
            self.used.push(source);
            self.used.len() - 1
        });
        let sampler = reference.texture.sampler();
        Slot {
            image,
            matrix: reference.matrix,
            wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
            nearest: sampler.mag_filter() == Some(MagFilter::Nearest),
            srgb,
            set,
        }
    }

    /// Decodes the collected images.
    ///
    /// # Errors
    /// Names an image that is missing, empty, or not a PNG or JPEG.
    pub fn decode(self, document: &Document) -> Result<Vec<Image>> {
        let sources: Vec<gltf::Image<'_>> = document.gltf.images().collect();
        self.used
            .par_iter()
            .map(|&index| decode(document, &sources[index]).map_err(|error| error.at(format!("image {index}"))))
            .collect()
    }
}

fn wrap(mode: WrappingMode) -> Wrap {
    match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    }
}

fn decode(document: &Document, image: &gltf::Image<'_>) -> Result<Image> {
    let bytes = match image.source() {
        gltf::image::Source::View { view, .. } => accessor::view_bytes(document, &view)?.to_vec(),
        gltf::image::Source::Uri { uri, .. } => uri::read(uri, &document.base)?,
    };
    let format = image::guess_format(&bytes)
        .ok()
        .filter(|format| matches!(format, image::ImageFormat::Png | image::ImageFormat::Jpeg));
    let format = format.ok_or_else(|| {
        Error::input(format!("unknown image format: it starts with {:02x?}", &bytes[..bytes.len().min(4)]))
            .help("PNG or JPEG")
    })?;
    let decoded = image::load_from_memory_with_format(&bytes, format)
        .map_err(|error| Error::input(format!("cannot decode the image: {error}")))?;
    from_rgba(&decoded.into_rgba8())
}

fn from_rgba(rgba: &image::RgbaImage) -> Result<Image> {
    let (width, height) = rgba.dimensions();
    if width == 0 || height == 0 || width > 0xffff || height > 0xffff {
        return Err(Error::input(format!("the image is {width}x{height}")).help("1x1 to 65535x65535"));
    }
    let mut ranges = [(255u8, 0u8); 4];
    for pixel in rgba.pixels() {
        for (range, value) in ranges.iter_mut().zip(pixel.0) {
            *range = (range.0.min(value), range.1.max(value));
        }
    }
    Ok(Image { width, height, texels: rgba.pixels().map(|pixel| u32::from_le_bytes(pixel.0)).collect(), ranges })
}

impl Slot {
    /// Texture coordinates after the transform.
    pub fn transformed(&self, uv: [f32; 2]) -> [f64; 2] {
        self.matrix
            .map(|row| f64::from(row[0]) * f64::from(uv[0]) + f64::from(row[1]) * f64::from(uv[1]) + f64::from(row[2]))
    }

    /// Range of one channel over the whole image, 0..1, decoded.
    pub fn range(&self, images: &[Image], channel: usize) -> (f32, f32) {
        let (low, high) = images[self.image].ranges[channel];
        (self.decoded(low, channel), self.decoded(high, channel))
    }

    /// Value of an 8-bit channel, 0..1, with sRGB decoded.
    pub fn decoded(&self, value: u8, channel: usize) -> f32 {
        let value = f32::from(value) / 255.0;
        if self.srgb && channel < 3 { srgb_to_linear(value) } else { value }
    }
}

impl Wrap {
    /// Index of the texel that an unwrapped index falls on, of `count`.
    pub fn texel(self, index: i64, count: u32) -> usize {
        let count = i64::from(count);
        let wrapped = match self {
            Wrap::Clamp => index.clamp(0, count - 1),
            Wrap::Repeat => index.rem_euclid(count),
            Wrap::Mirror => {
                let within = index.rem_euclid(2 * count);
                within.min(2 * count - 1 - within)
            }
        };
        wrapped as usize
    }
}

/// IEC 61966-2-1.
fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Node `Rotation` of the Khronos TextureTransformTest: the marker for a correct rotation lies on the arrow, whose axis is u = v.
    #[test]
    fn rotation_is_anticlockwise_in_the_image() {
        let matrix = transform_matrix([0.0; 2], std::f32::consts::FRAC_PI_8, [1.0; 2]);
        let [u, v] = matrix.map(|row| row[0] * 0.420_952 + row[1] * 1.016_267 + row[2]);
        assert!((u - v).abs() < 1e-3, "{u} {v}");
    }

    #[test]
    fn offset_is_applied_after_scale() {
        assert_eq!(transform_matrix([0.5, 0.25], 0.0, [2.0, 3.0]), [[2.0, 0.0, 0.5], [0.0, 3.0, 0.25]]);
    }

    #[test]
    fn wrapping() {
        let texels = |wrap: Wrap| [-3, -1, 0, 1, 2, 3, 4].map(|index| wrap.texel(index, 2));
        assert_eq!(texels(Wrap::Repeat), [1, 1, 0, 1, 0, 1, 0]);
        assert_eq!(texels(Wrap::Clamp), [0, 0, 0, 1, 1, 1, 1]);
        assert_eq!(texels(Wrap::Mirror), [1, 0, 0, 1, 1, 0, 0]);
    }
}
