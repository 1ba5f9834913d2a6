//! Spectra in 48 bits, of any magnitude: 13 bits a component, 9 for the exponent.

import package::real::vec3r;
import package::codec::shared_exponent::{NO_SPECTRUM, join_exponent, no_spectrum, split_exponent};

const RGB13E9_WIDTH: u32 = 13u;
const RGB13E9_BIAS: i32 = 255;

/// A word of the exponent and of what of the mantissas fits, and their other 16 bits.
fn encode_rgb13e9(value: vec3r) -> vec2u {
    let split = split_exponent(value, RGB13E9_WIDTH, -100, 128);
    let exponent = u32(split.exponent + RGB13E9_BIAS);
    let bits = vec2u(
        exponent | (split.mantissa.x << 9u) | (split.mantissa.y << 22u),
        (split.mantissa.y >> 10u) | (split.mantissa.z << 3u),
    );
    return select(vec2u(NO_SPECTRUM, 0xffffu), bits, split.valid);
}

/// The spectrum, right on average.
fn decode_rgb13e9(bits: vec2u) -> vec3r {
    if bits.x == NO_SPECTRUM && bits.y == 0xffffu {
        return no_spectrum();
    }
    let mantissa = vec3u(bits.x >> 9u, (bits.x >> 22u) | (bits.y << 10u), bits.y >> 3u) & vec3u(0x1fffu);
    return join_exponent(mantissa, RGB13E9_WIDTH, i32(bits.x & 0x1ffu) - RGB13E9_BIAS);
}
