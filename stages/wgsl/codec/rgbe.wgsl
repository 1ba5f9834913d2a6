//! Spectra in 32 bits, of any magnitude: 8 bits a component, 8 for the exponent.

import package::real::vec3r;
import package::codec::shared_exponent::{pack_exponent, unpack_exponent};

/// Rounded at random so that the mean is kept.
fn encode_rgbe(value: vec3r) -> u32 {
    return pack_exponent(value, 8u, 127, -100, 127);
}

/// The spectrum, right on average.
fn decode_rgbe(bits: u32) -> vec3r {
    return unpack_exponent(bits, 8u, 127);
}
