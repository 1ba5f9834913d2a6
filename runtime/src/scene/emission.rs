//! How much light an emissive triangle gives, textured or not.

use super::material::{Material, Role};
use super::sky::luminance;
use super::texture::{Image, Slot, Wrap};
use super::triangle::Triangle;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Subdivisions of an edge for sampling a texture over a triangle: this squared is the number of samples.
const SUBDIVISIONS: u32 = 4;
/// Least share of the mean over the enclosing texels that counts, so that samples that miss a bright spot do not hide it.
const LEAST_SHARE: f64 = 0.05;

/// Estimates the power of triangles.
pub struct Emission<'a> {
    materials: &'a [Material],
    images: &'a [Image],
    /// By material.
    maps: BTreeMap<usize, Map<'a>>,
}

impl<'a> Emission<'a> {
    /// Prepares the emissive textures of the materials.
    pub fn new(materials: &'a [Material], images: &'a [Image]) -> Self {
        let textured = |(index, material): (usize, &'a Material)| {
            let slot = material.slot(Role::Emissive).filter(|_| material.emits())?;
            Some((index, Map::new(slot, &images[slot.image], material.emission)))
        };
        Self { materials, images, maps: materials.iter().enumerate().filter_map(textured).collect() }
    }

    /// Power of a triangle, W of luminance: pi x area x mean radiance, twice for two sides.
    /// Zero exactly where no point of it can emit.
    pub fn power(&self, triangle: &Triangle) -> f64 {
        let index = triangle.material as usize;
        let material = &self.materials[index];
        if !material.emits() {
            return 0.0;
        }
        let radiance = match (self.maps.get(&index), material.slot(Role::Emissive)) {
            (Some(map), Some(slot)) => map.mean(&triangle.uvs[slot.set], &self.images[slot.image]),
            _ => luminance(material.emission),
        };
        let sides = if material.double_sided { 2.0 } else { 1.0 };
        PI * triangle.area() * radiance * sides
    }
}

/// An emissive texture with sums over rectangles of texels.
struct Map<'a> {
    slot: &'a Slot,
    /// Luminance of each texel times the emission factor.
    values: Vec<f64>,
    /// Sum over all texels above and left of a corner, (width + 1) x (height + 1), in units of `unit`: integers, so that black is exactly zero.
    sums: Vec<u64>,
    unit: f64,
}

impl<'a> Map<'a> {
    fn new(slot: &'a Slot, image: &Image, factor: [f32; 3]) -> Self {
        let decode: Vec<f32> = (0..=255u8).map(|value| slot.decoded(value, 0)).collect();
        let value = |texel: &u32| {
            let bytes = texel.to_le_bytes();
            luminance(std::array::from_fn(|c| decode[bytes[c] as usize] * factor[c]))
        };
        let values: Vec<f64> = image.texels.iter().map(value).collect();
        let unit = values.iter().copied().fold(0.0, f64::max) / f64::from(1u32 << 24);
        let (width, height) = (image.width as usize, image.height as usize);
        let mut sums = vec![0u64; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                let value = values[y * width + x];
                row += if value > 0.0 { ((value / unit) as u64).max(1) } else { 0 };
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
            }
        }
        Self { slot, values, sums, unit }
    }

    /// Mean luminance over a triangle given by its texture coordinates.
    fn mean(&self, uvs: &[[f32; 2]; 3], image: &Image) -> f64 {
        let corners = uvs.map(|uv| self.slot.transformed(uv));
        let enclosing = self.enclosing_mean(&corners, image);
        if enclosing == 0.0 { 0.0 } else { self.sampled_mean(&corners, image).max(LEAST_SHARE * enclosing) }
    }

    /// Mean over all texels that a bilinear lookup in the triangle can touch.
    fn enclosing_mean(&self, corners: &[[f64; 2]; 3], image: &Image) -> f64 {
        let spans = [(0, image.width), (1, image.height)].map(|(axis, count)| {
            let values = corners.map(|corner| corner[axis] * f64::from(count));
            let low = values.into_iter().fold(f64::INFINITY, f64::min) - 1.0;
            let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max) + 1.0;
            texel_ranges(low, high, count, self.slot.wrap[axis])
        });
        let (mut total, mut texels) = (0u64, 0usize);
        for &(y0, y1) in &spans[1] {
            for &(x0, x1) in &spans[0] {
                let stride = image.width as usize + 1;
                let sum = |x: usize, y: usize| self.sums[y * stride + x];
                total += (sum(x1, y1) + sum(x0, y0)) - (sum(x0, y1) + sum(x1, y0));
                texels += (x1 - x0) * (y1 - y0);
            }
        }
        total as f64 * self.unit / texels.max(1) as f64
    }

    fn sampled_mean(&self, corners: &[[f64; 2]; 3], image: &Image) -> f64 {
        let at = |b1: f64, b2: f64| {
            let coordinate = |axis: usize| {
                corners[0][axis]
                    + b1 * (corners[1][axis] - corners[0][axis])
                    + b2 * (corners[2][axis] - corners[0][axis])
            };
            let texel = |axis: usize, count: u32| {
                self.slot.wrap[axis].texel((coordinate(axis) * f64::from(count)).floor() as i64, count)
            };
            self.values[texel(1, image.height) * image.width as usize + texel(0, image.width)]
        };
        let n = f64::from(SUBDIVISIONS);
        let mut total = 0.0;
        for i in 0..SUBDIVISIONS {
            for j in 0..SUBDIVISIONS - i {
                let (x, y) = (f64::from(i), f64::from(j));
                total += at((x + 1.0 / 3.0) / n, (y + 1.0 / 3.0) / n);
                if i + j + 1 < SUBDIVISIONS {
                    total += at((x + 2.0 / 3.0) / n, (y + 2.0 / 3.0) / n);
                }
            }
        }
        total / (n * n)
    }
}

/// Half-open ranges of texels that an interval of unwrapped texel coordinates falls on.
fn texel_ranges(low: f64, high: f64, count: u32, wrap: Wrap) -> Vec<(usize, usize)> {
    let n = count as usize;
    let (first, last) = (low.floor() as i64, high.floor() as i64);
    let inside = first >= 0 && last < i64::from(count);
    match wrap {
        _ if inside => vec![(first as usize, last as usize + 1)],
        Wrap::Clamp => vec![(wrap.texel(first, count), wrap.texel(last, count) + 1)],
        Wrap::Repeat if last.saturating_sub(first) < i64::from(count) - 1 => {
            let (a, b) = (wrap.texel(first, count), wrap.texel(last, count));
            if a <= b { vec![(a, b + 1)] } else { vec![(0, b + 1), (a, n)] }
        }
        Wrap::Repeat | Wrap::Mirror => vec![(0, n)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4x4 texels, black but for one white texel in the last row.
    fn image() -> Image {
        let mut texels = vec![0xff00_0000; 16];
        texels[14] = 0xffff_ffff;
        Image { width: 4, height: 4, texels, ranges: [(0, 255); 4] }
    }

    fn slot(wrap: Wrap) -> Slot {
        Slot {
            image: 0,
            matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            wrap: [wrap; 2],
            nearest: false,
            srgb: true,
            set: 0,
        }
    }

    #[test]
    fn black_regions_emit_nothing_and_bright_texels_are_never_missed() {
        let (image, slot) = (image(), slot(Wrap::Clamp));
        let map = Map::new(&slot, &image, [2.0; 3]);
        assert_eq!(map.mean(&[[0.05, 0.05], [0.2, 0.05], [0.05, 0.2]], &image), 0.0);
        let whole = map.mean(&[[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]], &image);
        assert!(whole > 0.0 && whole <= 2.0);
        let tiny = map.mean(&[[0.624, 0.874], [0.626, 0.874], [0.624, 0.876]], &image);
        assert!((tiny - 2.0).abs() < 1e-5, "{tiny}");
    }

    #[test]
    fn ranges_wrap() {
        assert_eq!(texel_ranges(-1.5, 0.5, 8, Wrap::Repeat), [(0, 1), (6, 8)]);
        assert_eq!(texel_ranges(9.0, 10.5, 8, Wrap::Repeat), [(1, 3)]);
        assert_eq!(texel_ranges(-1.5, 0.5, 8, Wrap::Clamp), [(0, 1)]);
        assert_eq!(texel_ranges(-1.5, 0.5, 8, Wrap::Mirror), [(0, 8)]);
        assert_eq!(texel_ranges(-100.0, 100.0, 8, Wrap::Repeat), [(0, 8)]);
        assert_eq!(texel_ranges(f64::NEG_INFINITY, f64::INFINITY, 8, Wrap::Repeat), [(0, 8)]);
    }
}
