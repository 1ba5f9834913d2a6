//! Telling numbers from what is none, by their bits: compilers may assume that there is no NaN.

import package::real::{real, vec3r};

/// Not infinite and a number.
fn is_finite(value: real) -> bool {
    return (bitcast<u32>(f32(value)) & 0x7fffffffu) < 0x7f800000u;
}

/// All of them are finite.
fn all_finite(value: vec3r) -> bool {
    return all((bitcast<vec3u>(vec3f(value)) & vec3u(0x7fffffffu)) < vec3u(0x7f800000u));
}
