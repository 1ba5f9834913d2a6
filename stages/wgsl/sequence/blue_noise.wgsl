//! A tile of blue noise, laid over the picture again and again.

import package::scene::scene;

/// Texels in a row of the tile, and rows; the runtime makes it of this size.
const BLUE_NOISE_SIDE: u32 = 128u;

/// Row by row; fractions of 2^32, in each of 128 x 128 equal parts of the unit interval one.
var<storage, read> blue_noise: array<u32>;

/// What the tile has for a pixel (y * width + x), as fractions of 2^32: in each dimension after moving it by an offset of its own, a random
/// word, which makes the dimensions as good as independent.
fn blue_noise4(pixel: u32, offsets: vec4u) -> vec4u {
    let place = vec2u(pixel % scene.counts.x, pixel / scene.counts.x);
    return vec4u(
        moved_blue_noise(place, offsets.x),
        moved_blue_noise(place, offsets.y),
        moved_blue_noise(place, offsets.z),
        moved_blue_noise(place, offsets.w),
    );
}

/// The texel at `place` of the tile moved by the upper 14 bits of `offset`, 7 for each axis.
fn moved_blue_noise(place: vec2u, offset: u32) -> u32 {
    let texel = (place + vec2u(offset >> 25u, offset >> 18u)) % BLUE_NOISE_SIDE;
    return blue_noise[texel.y * BLUE_NOISE_SIDE + texel.x];
}
