//! Surface coordinates from 0 to 1 in 16 bits each.

import package::real::vec2r;

/// The nearest of 65536 steps, a coordinate a word.
fn encode_unorm16x2(value: vec2r) -> vec2u {
    return vec2u(round(clamp(value, vec2r(0.0), vec2r(1.0)) * 65535.0));
}

/// The coordinates nearly as they were.
fn decode_unorm16x2(bits: vec2u) -> vec2r {
    return vec2r(bits) / 65535.0;
}
