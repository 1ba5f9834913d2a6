//! Spectra in 32 bits below 65408: 9 bits a component, 5 for the exponent (EXT_texture_shared_exponent).

import package::real::vec3r;
import package::codec::shared_exponent::{pack_exponent, unpack_exponent};

/// Rounded at random so that the mean is kept.
fn encode_rgb9e5(value: vec3r) -> u32 {
    return pack_exponent(value, 9u, 15, -15, 16);
}

/// The spectrum, right on average.
fn decode_rgb9e5(bits: u32) -> vec3r {
    return unpack_exponent(bits, 9u, 15);
}
