//! Transcendental functions of `real`. They are evaluated as f32 whatever `real` is: there are no 64-bit forms of them in SPIR-V.

import package::real::{real, vec3r};

/// Sine of an angle in radians.
fn sine(angle: real) -> real {
    return real(sin(f32(angle)));
}

/// Cosine of an angle in radians.
fn cosine(angle: real) -> real {
    return real(cos(f32(angle)));
}

/// Angle in [0, pi] whose cosine is `x`; `x` is clamped to [-1, 1].
fn arc_cosine(x: real) -> real {
    return real(acos(clamp(f32(x), -1.0, 1.0)));
}

/// Angle in [-pi, pi] of the point (x, y).
fn arc_tangent2(y: real, x: real) -> real {
    return real(atan2(f32(y), f32(x)));
}

/// e to the power of `x`.
fn exponential(x: real) -> real {
    return real(exp(f32(x)));
}

/// e to the power of `x`, by component.
fn exponential3(x: vec3r) -> vec3r {
    return vec3r(exp(vec3f(x)));
}

/// `base` to the power of `exponent`; `base` must not be negative.
fn power(base: real, exponent: real) -> real {
    return real(pow(f32(base), f32(exponent)));
}
