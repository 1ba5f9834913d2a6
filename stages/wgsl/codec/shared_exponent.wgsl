//! Spectra as three mantissas with one exponent: the largest component decides, and the others lose what it does not (Ward 1991, "Real
//! Pixels").

import package::real::{real, vec3r};
import package::codec::dither::dither3;
import package::codec::finite::all_finite;
import package::math::vector::max_component;

/// Stands for a spectrum that is no number or infinite, so that it is found where it arrives: all bits.
const NO_SPECTRUM: u32 = 0xffffffffu;

/// Mantissas and exponent of a spectrum.
struct SharedExponent {
    mantissa: vec3u,
    /// The mantissas count in units of 2^(exponent - width).
    exponent: i32,
    /// Nothing but numbers.
    valid: bool,
}

/// Rounds at random to `width` bits. `least` and `greatest` bound the exponent: below, small components vanish at random; above, all
/// stay at the greatest.
fn split_exponent(value: vec3r, width: u32, least: i32, greatest: i32) -> SharedExponent {
    let most = real((1u << width) - 1u);
    let largest = max_component(value);
    var split: SharedExponent;
    split.valid = all_finite(value);
    // The largest component must not round up to 2^width; one that needs no rounding keeps its exponent.
    split.exponent = clamp(frexp(largest + largest / (most + 8.0)).exp, least, greatest);
    let scaled = min(ldexp(max(value, vec3r(0.0)), vec3i(i32(width) - split.exponent)), vec3r(most));
    // By comparison: adding the random number to the value would round, too.
    let down = floor(scaled);
    split.mantissa = vec3u(down + select(vec3r(0.0), vec3r(1.0), dither3(value) < scaled - down));
    return split;
}

/// The spectrum of mantissas of `width` bits and an exponent.
fn join_exponent(mantissa: vec3u, width: u32, exponent: i32) -> vec3r {
    return ldexp(vec3r(mantissa), vec3i(exponent - i32(width)));
}

/// A spectrum in one word: three mantissas of `width` bits, behind them the exponent plus `bias`.
fn pack_exponent(value: vec3r, width: u32, bias: i32, least: i32, greatest: i32) -> u32 {
    let split = split_exponent(value, width, least, greatest);
    let exponent = u32(split.exponent + bias) << (3u * width);
    let bits = split.mantissa.x | (split.mantissa.y << width) | (split.mantissa.z << (2u * width)) | exponent;
    // The brightest white must not look like what is no number.
    return select(NO_SPECTRUM, min(bits, NO_SPECTRUM - 1u), split.valid);
}

/// The spectrum of such a word.
fn unpack_exponent(bits: u32, width: u32, bias: i32) -> vec3r {
    if bits == NO_SPECTRUM {
        return no_spectrum();
    }
    let mantissa = (vec3u(bits) >> vec3u(0u, width, 2u * width)) & vec3u((1u << width) - 1u);
    return join_exponent(mantissa, width, i32(bits >> (3u * width)) - bias);
}

/// What `NO_SPECTRUM` stands for.
fn no_spectrum() -> vec3r {
    return bitcast<vec3f>(vec3u(0x7fc00000u));
}
