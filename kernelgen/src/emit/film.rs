//! `package::film`: adding to the picture and to layers behind it.

use crate::config::evaluate_size;
use crate::config::model::{Accumulate, Pipeline};
use crate::diagnostic::Diagnostic;
use crate::plan::{self, Layers, Tally};
use std::collections::BTreeSet;
use std::fmt::Write;

/// All groups of layers of a pipeline, one behind the other.
///
/// # Errors
/// K0116 a size that cannot be evaluated.
pub(super) fn layers(pipeline: &Pipeline, tallies: &[Tally]) -> Result<Vec<Layers>, Diagnostic> {
    let mut layers = Vec::new();
    for (name, declared) in &pipeline.layers {
        let size = evaluate_size(pipeline, &declared.size)?;
        let correct = declared.correct.as_ref();
        let tally = correct.and_then(|correct| tallies.iter().find(|tally| tally.name == correct.value));
        let correct = tally.map(|tally| tally.first);
        layers.push(Layers { name: name.clone(), first: plan::planes(&layers), size, correct });
    }
    Ok(layers)
}

/// The groups that are added to, moved together. `splats` are the functions of this module that are called.
pub(super) fn used(layers: Vec<Layers>, splats: &BTreeSet<String>) -> Vec<Layers> {
    let mut used = Vec::new();
    for group in layers.into_iter().filter(|group| splats.contains(&function(&group.name))) {
        used.push(Layers { first: plan::planes(&used), ..group });
    }
    used
}

fn function(layers: &str) -> String {
    format!("splat_{layers}")
}

/// The module: `splat` with the accumulation of the schedule, and a function a group of layers.
pub(super) fn module(accumulate: Accumulate, layers: &[Layers]) -> String {
    let (word, add) = match accumulate {
        Accumulate::AtomicF32 => ("atomic<f32>", ATOMIC_F32),
        Accumulate::FixedI64 => ("atomic<i64>", FIXED_I64),
        Accumulate::Racy => ("f32", RACY),
    };
    let pass = if layers.is_empty() { "" } else { "import package::pass::{picture_height, picture_width};\n" };
    let mut text = format!(
        "import package::real::{{real, vec3r}};\n\
         import package::control::{{control, CONTROL_REJECTED}};\n{pass}\n\
         /// Three channels a pixel, interleaved.\n\
         var<storage, read_write> film: array<{word}>;\n{SPLAT}{add}"
    );
    for group in layers {
        push_splat(&mut text, group);
    }
    text
}

/// The pixels of a plane follow those of the plane before.
fn push_splat(text: &mut String, group: &Layers) {
    let Layers { name, first, size, .. } = group;
    let _ = write!(
        text,
        "\n/// Adds to a pixel of a layer of `{name}`. An index beyond the last is taken as the last.\n\
         fn {}(index: u32, pixel: u32, value: vec3r) {{\n    \
             let plane = {first}u + min(index, {}u);\n    \
             splat(plane * picture_width * picture_height + pixel, value);\n\
         }}\n",
        function(name),
        size - 1
    );
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
