//! Counter-based random numbers: each is a hash of where it is used, so every schedule draws the same ones and no state is kept.

import package::real::vec4r;
import package::pass::{pass_seed, path_pixel, path_sample};

const WALK_EYE: u32 = 0u;
const WALK_LIGHT: u32 = 1u;

const DIMENSION_SCATTER: u32 = 0u;
const DIMENSION_LIGHT: u32 = 1u;
const DIMENSION_EMIT: u32 = 2u;
const DIMENSION_CHOICE: u32 = 3u;

/// Hash of four words to four words (pcg4d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", JCGT 9(3)).
fn hash4(key: vec4u) -> vec4u {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

/// Numbers in [0, 1) from the top 24 bits of each word.
fn unit_interval4(bits: vec4u) -> vec4r {
    return vec4r(vec4f(bits >> vec4u(8u)) * 5.9604644775390625e-8);
}

/// Four independent numbers in [0, 1) for one use: `walk` is WALK_EYE or WALK_LIGHT, `vertex` (< 2^20) counts along the walk,
/// `dimension` (< 2^8) names the use at that vertex. The same arguments give the same numbers.
fn random4(walk: u32, vertex: u32, dimension: u32) -> vec4r {
    let place = (vertex << 12u) | (walk << 8u) | dimension;
    return unit_interval4(hash4(vec4u(path_pixel(), path_sample(), place, pass_seed())));
}

/// Number in [0, 1) that decides whether a partly transparent triangle stops a ray; `key` stands for the ray.
fn hash_opacity(key: u32, prim: u32) -> f32 {
    return f32(hash4(vec4u(key, prim, 0x9e3779b9u, 0x85ebca6bu)).x >> 8u) * 5.9604644775390625e-8;
}
