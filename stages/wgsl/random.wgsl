//! Random numbers that depend on where they are used and on nothing else, so every schedule draws the same ones and no state is kept.
//! The parameter `sampler` says how they are spread over a pixel's samples and over the picture.

import package::real::vec4r;
import package::params::{sampler, sampler_independent, sampler_sobol};
import package::pass::{pass_seed, path_pixel, path_sample};
import package::sequence::blue_noise::blue_noise4;
import package::sequence::sobol::scrambled_sobol4;

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

/// Four numbers in [0, 1) for one use, independent of those of other uses: `walk` is WALK_EYE or WALK_LIGHT, `vertex` (< 2^20) is a key
/// of the place on the walk, `dimension` (< 2^8) names the use there. The same arguments give the same numbers.
fn random4(walk: u32, vertex: u32, dimension: u32) -> vec4r {
    let place = (vertex << 12u) | (walk << 8u) | dimension;
    if sampler == sampler_independent {
        return unit_interval4(hash4(vec4u(path_pixel(), path_sample(), place, pass_seed())));
    } else if sampler == sampler_sobol {
        return unit_interval4(sequence4(path_pixel(), place));
    } else {
        return unit_interval4(dithered4(walk, place));
    }
}

/// In the place of a sample's number in a key of `hash4`: no sample has them.
const KEY_SCRAMBLE: u32 = 0xffffffffu;
const KEY_DITHER: u32 = 0xfffffffeu;
/// In the place of a pixel: what all pixels share.
const EVERY_PIXEL: u32 = 0xffffffffu;

/// The path's sample of the sequence that a use has in a pixel, as fractions of 2^32. Each use shuffles and scrambles its own
/// ("padding", Burley 2020), so two uses never come in the same order.
fn sequence4(pixel: u32, place: u32) -> vec4u {
    let seeds = hash4(vec4u(pixel, KEY_SCRAMBLE, place, pass_seed()));
    return scrambled_sobol4(path_sample(), hash4(seeds).x, seeds);
}

/// On eye walks one sequence for all pixels, rotated in each by blue noise (Georgiev and Fajardo 2016, "Blue-noise Dithered Sampling"):
/// neighbours err differently. A light walk lights any pixel, so nothing is gained by spreading it over its own: it has a sequence a pixel.
fn dithered4(walk: u32, place: u32) -> vec4u {
    if walk != WALK_EYE {
        return sequence4(path_pixel(), place);
    }
    let offsets = hash4(vec4u(EVERY_PIXEL, KEY_DITHER, place, pass_seed()));
    return sequence4(EVERY_PIXEL, place) + blue_noise4(path_pixel(), offsets);
}

/// Number in [0, 1) that decides whether a partly transparent triangle stops a ray; `key` stands for the ray.
fn hash_opacity(key: u32, prim: u32) -> f32 {
    return f32(hash4(vec4u(key, prim, 0x9e3779b9u, 0x85ebca6bu)).x >> 8u) * 5.9604644775390625e-8;
}
