//! Spectra in 32 bits, of any magnitude: 8 bits a component, 8 for the exponent.

import package::real::vec3r;
import package::codec::shared_exponent::{NO_SPECTRUM, join_exponent, no_spectrum, split_exponent};

const RGBE_WIDTH: u32 = 8u;
const RGBE_BIAS: i32 = 127;

/// Three mantissas and the exponent, rounded at random so that the mean is kept.
fn encode_rgbe(value: vec3r) -> u32 {
    let split = split_exponent(value, RGBE_WIDTH, -100, 127);
    let exponent = u32(split.exponent + RGBE_BIAS);
    let bits = split.mantissa.x | (split.mantissa.y << 8u) | (split.mantissa.z << 16u) | (exponent << 24u);
    return select(NO_SPECTRUM, bits, split.valid);
}

/// The spectrum, right on average.
fn decode_rgbe(bits: u32) -> vec3r {
    if bits == NO_SPECTRUM {
        return no_spectrum();
    }
    let mantissa = (vec3u(bits) >> vec3u(0u, 8u, 16u)) & vec3u(0xffu);
    return join_exponent(mantissa, RGBE_WIDTH, i32(bits >> 24u) - RGBE_BIAS);
}
