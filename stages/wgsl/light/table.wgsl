//! The scene's lights as the runtime packs them, and picking one.

import package::real::{real, vec2r};
import package::scene::scene;

/// Four rows a light: (kind, pick probability, triangle, 0) (position, area) (direction of flight, cosine of the outer
/// cone) (intensity, cosine of the inner cone).
var<storage, read> lights: array<vec4f>;
/// Per light: bits of the alias threshold in [0,1], alias (Walker 1977).
var<storage, read> light_alias: array<vec2u>;

const LIGHT_ROWS: u32 = 4u;
const LIGHT_TRIANGLE: u32 = 0u;
const LIGHT_POINT: u32 = 1u;
const LIGHT_SPOT: u32 = 2u;
const LIGHT_DIRECTIONAL: u32 = 3u;
const LIGHT_SKY: u32 = 4u;

/// Row `row` (0 to 3) of a light.
fn light_row(light: u32, row: u32) -> vec4f {
    return lights[LIGHT_ROWS * light + row];
}

/// One of the LIGHT_ kinds.
fn light_kind(light: u32) -> u32 {
    return bitcast<u32>(light_row(light, 0u).x);
}

/// Probability with which `pick_light` returns the light.
fn pick_probability(light: u32) -> real {
    return real(light_row(light, 0u).y);
}

/// A light in proportion to its power, from two numbers in [0,1): one for the slot, one for the threshold, so that
/// neither runs out of bits when there are many lights.
fn pick_light(random: vec2r) -> u32 {
    let count = scene.counts.z;
    let slot = min(u32(random.x * real(count)), count - 1u);
    let entry = light_alias[slot];
    return select(entry.y, slot, random.y < real(bitcast<f32>(entry.x)));
}
