//! Spectra in 32 bits below 65408: 9 bits a component, 5 for the exponent (EXT_texture_shared_exponent).

import package::real::vec3r;
import package::codec::shared_exponent::{NO_SPECTRUM, join_exponent, no_spectrum, split_exponent};

const RGB9E5_WIDTH: u32 = 9u;
const RGB9E5_BIAS: i32 = 15;

/// Three mantissas and the exponent, rounded at random so that the mean is kept.
fn encode_rgb9e5(value: vec3r) -> u32 {
    let split = split_exponent(value, RGB9E5_WIDTH, -15, 16);
    let exponent = u32(split.exponent + RGB9E5_BIAS);
    let bits = split.mantissa.x | (split.mantissa.y << 9u) | (split.mantissa.z << 18u) | (exponent << 27u);
    return select(NO_SPECTRUM, bits, split.valid);
}

/// The spectrum, right on average.
fn decode_rgb9e5(bits: u32) -> vec3r {
    if bits == NO_SPECTRUM {
        return no_spectrum();
    }
    let mantissa = (vec3u(bits) >> vec3u(0u, 9u, 18u)) & vec3u(0x1ffu);
    return join_exponent(mantissa, RGB9E5_WIDTH, i32(bits >> 27u) - RGB9E5_BIAS);
}
