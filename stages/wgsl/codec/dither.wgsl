//! Random numbers for rounding up or down with the right probability, so that what is kept is right on average.

import package::real::vec3r;
import package::pass::{pass_seed, path_number, path_sample};
import package::random::{hash4, unit_interval4};

/// Three numbers in [0, 1): a hash of the value, of the path and of its sample. They need no count of their uses, so every schedule
/// rounds alike.
fn dither3(value: vec3r) -> vec3r {
    let key = vec4u(bitcast<vec3u>(vec3f(value)), pass_seed());
    return unit_interval4(hash4(key ^ vec4u(path_number(), path_sample(), 0u, 0u))).xyz;
}
