//! Random numbers for rounding up or down with the right probability, so that what is kept is right on average.

import package::real::vec3r;
import package::pass::{pass_seed, path_number, path_sample};

/// Three numbers in [0, 1): a hash of the value, of the path and of its sample (pcg3d of Jarzynski and Olano 2020, "Hash Functions for
/// GPU Rendering", JCGT 9(3)). They need no count of their uses, so every schedule rounds alike.
fn dither3(value: vec3r) -> vec3r {
    var v = bitcast<vec3u>(vec3f(value)) ^ vec3u(path_number(), path_sample() * 2654435769u, pass_seed());
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3u(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return vec3r(vec3f(v >> vec3u(8u)) * 5.9604644775390625e-8);
}
