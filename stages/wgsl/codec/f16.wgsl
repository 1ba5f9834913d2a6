//! Numbers >= 0 as halves, scaled by 2^4: densities of some sr^-1 in the middle of the range.

import package::real::real;
import package::codec::finite::is_finite;

/// Largest finite half, and the scale.
const LARGEST_F16: f32 = 65504.0;
const F16_SCALE: f32 = 0.0625;

/// A half; what is too large stays at the largest, no number stays none.
fn encode_f16(value: real) -> u32 {
    let scaled = f32(value) * F16_SCALE;
    return pack2x16float(vec2f(select(scaled, min(scaled, LARGEST_F16), is_finite(value)), 0.0));
}

/// The number nearly as it was.
fn decode_f16(bits: u32) -> real {
    return real(unpack2x16float(bits).x / F16_SCALE);
}
