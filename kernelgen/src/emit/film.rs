//! `package::film`: adding to the picture.

use crate::config::model::Accumulate;

/// The module: `splat` with the accumulation of the schedule.
pub(super) fn module(accumulate: Accumulate) -> String {
    let (word, add) = match accumulate {
        Accumulate::AtomicF32 => ("atomic<f32>", ATOMIC_F32),
        Accumulate::FixedI64 => ("atomic<i64>", FIXED_I64),
        Accumulate::Racy => ("f32", RACY),
    };
    format!(
        "import package::real::{{real, vec3r}};\n\
         import package::control::{{control, CONTROL_REJECTED}};\n\n\
         /// Three channels a pixel, interleaved.\n\
         var<storage, read_write> film: array<{word}>;\n{SPLAT}{add}"
    )
}

const SPLAT: &str = r"
/// Adds to a pixel. Values that are negative, infinite or not a number are counted and left out: a correct pipeline has none.
fn splat(pixel: u32, value: vec3r) {
    // On the bits, since a compiler may assume that NaN and infinity do not occur. The sign bit alone is the legal -0.
    let bits = bitcast<vec3u>(value);
    if any((bits >= vec3u(0x7f800000u)) & (bits != vec3u(0x80000000u))) {
        atomicAdd(&control[CONTROL_REJECTED], 1u);
        return;
    }
    film_add(3u * pixel, value.x);
    film_add(3u * pixel + 1u, value.y);
    film_add(3u * pixel + 2u, value.z);
}
";

const ATOMIC_F32: &str = r"
fn film_add(channel: u32, value: real) {
    if value != 0.0 {
        atomicAdd(&film[channel], value);
    }
}
";

const FIXED_I64: &str = r"
/// In units of 2^-24: integer sums do not depend on their order.
fn film_add(channel: u32, value: real) {
    if value != 0.0 {
        atomicAdd(&film[channel], i64(round(value * 16777216.0)));
    }
}
";

const RACY: &str = r"
/// Without atomics: of two paths that add to a pixel at once, one is lost.
fn film_add(channel: u32, value: real) {
    if value != 0.0 {
        film[channel] = film[channel] + value;
    }
}
";
