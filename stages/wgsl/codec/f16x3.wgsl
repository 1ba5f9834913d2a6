//! Spectra in three halves.

import package::real::vec3r;
import package::codec::finite::all_finite;

/// Largest finite half.
const LARGEST_HALF: f32 = 65504.0;

/// A half in the low bits of each word; what is too large stays at the largest, no number stays none.
fn encode_f16x3(value: vec3r) -> vec3u {
    let held = select(vec3f(value), min(vec3f(value), vec3f(LARGEST_HALF)), all_finite(value));
    let both = pack2x16float(held.xy);
    return vec3u(both & 0xffffu, both >> 16u, pack2x16float(vec2f(held.z, 0.0)));
}

/// The spectrum nearly as it was.
fn decode_f16x3(bits: vec3u) -> vec3r {
    return vec3r(vec3f(unpack2x16float(bits.x | (bits.y << 16u)), unpack2x16float(bits.z).x));
}
