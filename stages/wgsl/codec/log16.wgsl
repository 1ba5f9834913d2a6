//! Numbers >= 0 by their binary logarithm in 16 bits, 7 before the point and 9 behind it: the same relative error from 2^-63 to 2^63.

import package::real::real;
import package::codec::finite::is_finite;

/// Codes below and above the logarithms: zero, and what is no number or infinite.
const LOG16_ZERO: u32 = 0u;
const LOG16_NONE: u32 = 0xffffu;
/// The code of 1, and codes for a factor of 2.
const LOG16_ONE: real = 32768.0;
const LOG16_STEPS: real = 512.0;

/// The nearest code; what is outside of the range stays at its end.
fn encode_log16(value: real) -> u32 {
    if value == 0.0 {
        return LOG16_ZERO;
    }
    if !is_finite(value) {
        return LOG16_NONE;
    }
    return u32(clamp(round(log2(value) * LOG16_STEPS + LOG16_ONE), 1.0, 65534.0));
}

/// The number nearly as it was.
fn decode_log16(bits: u32) -> real {
    if bits == LOG16_ZERO {
        return 0.0;
    }
    if bits == LOG16_NONE {
        return bitcast<f32>(0x7fc00000u);
    }
    return exp2((real(bits) - LOG16_ONE) / LOG16_STEPS);
}
