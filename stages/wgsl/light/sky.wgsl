//! The environment: radiance from infinity, in a latitude-longitude table.

import package::real::{real, vec2r, vec3r, vec4r};
import package::math::constants::{INVERSE_PI, INVERSE_TWO_PI, PI, TWO_PI};
import package::math::elementary::{arc_tangent2, cosine, sine};
import package::surface::surface::Surface;
import package::light::table::pick_probability;
import package::light::light_sample::LightSample;
import package::light::light_vertex::{Emission, LightEnd, LightVertex};
import package::light::directional_light::{emission_from_infinity, end_at_infinity, segment_to_infinity};

/// How the table lies in the world.
struct SkyFrame {
    /// Width and height of the table, 0, index of the sky among the lights.
    size: vec4u,
    /// Cosine and sine of the table's turn about +Y, pick probability of the sky as a light, 0.
    turn: vec4f,
}

var<uniform> sky_frame: SkyFrame;
/// Radiance in W/(m2 sr), and the density of sampled directions times sin(theta), per sr.
var<storage, read> sky_texels: array<vec4f>;
/// Per texel: bits of the alias threshold, alias.
var<storage, read> sky_alias: array<vec2u>;

/// A direction into the sky and the place of it in the table.
struct SkyPoint {
    /// Unit, world, away from the scene.
    direction: vec3r,
    /// In [0,1]: azimuth and polar angle, row 0 at the zenith.
    uv: vec2r,
    /// sin(theta).
    sine_polar: real,
}

/// Table coordinates of a unit direction. The polar angle comes from both coordinates, exact near the poles.
fn sky_point(direction: vec3r) -> SkyPoint {
    let turn = vec2r(sky_frame.turn.xy);
    let x = direction.x * turn.x - direction.z * turn.y;
    let z = direction.x * turn.y + direction.z * turn.x;
    var point: SkyPoint;
    point.direction = direction;
    point.sine_polar = length(vec2r(x, z));
    let azimuth = arc_tangent2(x, -z) * INVERSE_TWO_PI;
    point.uv = vec2r(azimuth - floor(azimuth), arc_tangent2(point.sine_polar, direction.y) * INVERSE_PI);
    return point;
}

/// The direction that table coordinates stand for: the inverse of `sky_point`.
fn sky_point_at(uv: vec2r) -> SkyPoint {
    let turn = vec2r(sky_frame.turn.xy);
    var point: SkyPoint;
    point.uv = uv;
    point.sine_polar = sine(PI * uv.y);
    let x = point.sine_polar * sine(TWO_PI * uv.x);
    let z = -point.sine_polar * cosine(TWO_PI * uv.x);
    point.direction = vec3r(x * turn.x + z * turn.y, cosine(PI * uv.y), z * turn.x - x * turn.y);
    return point;
}

/// Texel of the table that holds the coordinates.
fn sky_texel(uv: vec2r) -> u32 {
    let size = sky_frame.size.xy;
    let texel = min(vec2u(uv * vec2r(size)), size - vec2u(1u));
    return texel.y * size.x + texel.x;
}

/// Radiance of the sky, bilinear between texel centres, periodic in azimuth.
fn sky_radiance_at(uv: vec2r) -> vec3r {
    let size = vec2i(sky_frame.size.xy);
    let place = uv * vec2r(size) - vec2r(0.5);
    let base = floor(place);
    let blend = place - base;
    let corner = vec2i(base);
    let column = vec2i((corner.x + size.x) % size.x, (corner.x + 1) % size.x);
    let row = clamp(vec2i(corner.y, corner.y + 1) , vec2i(0), vec2i(size.y - 1)) * size.x;
    let upper = mix(vec3r(sky_texels[row.x + column.x].xyz), vec3r(sky_texels[row.x + column.y].xyz), blend.x);
    let lower = mix(vec3r(sky_texels[row.y + column.x].xyz), vec3r(sky_texels[row.y + column.y].xyz), blend.x);
    return mix(upper, lower, blend.y);
}

/// Radiance that arrives from a unit direction, W/(m2 sr).
fn sky_radiance(direction: vec3r) -> vec3r {
    return sky_radiance_at(sky_point(direction).uv);
}

/// Density with which `sample_light` draws this direction as one of the sky, pick probability included, per sr.
fn sky_pdf_w(direction: vec3r) -> real {
    let point = sky_point(direction);
    return real(sky_frame.turn.z) * real(sky_texels[sky_texel(point.uv)].w) / point.sine_polar;
}

/// A drawn direction into the sky.
struct SkySample {
    point: SkyPoint,
    /// Density times sin(theta), per sr, of the texel that was picked: the coordinates may be rounded into its neighbour, which may be black.
    density: real,
}

/// A direction in proportion to radiance: `random` places it in a texel, `texel` picks that (row, column, threshold).
fn sample_sky_direction(random: vec2r, texel: vec4r) -> SkySample {
    let size = sky_frame.size.xy;
    let slot = min(vec2u(texel.yx * vec2r(size)), size - vec2u(1u));
    let index = slot.y * size.x + slot.x;
    let entry = sky_alias[index];
    let picked = select(entry.y, index, texel.z < real(bitcast<f32>(entry.x)));
    var sample: SkySample;
    sample.point = sky_point_at((vec2r(vec2u(picked % size.x, picked / size.x)) + random) / vec2r(size));
    sample.density = real(sky_texels[picked].w);
    return sample;
}

/// Light from a direction of the sky.
fn sample_sky(light: u32, receiver: Surface, random: vec2r, texel: vec4r) -> LightSample {
    let drawn = sample_sky_direction(random, texel);
    var sample: LightSample;
    sample.direction = drawn.point.direction;
    sample.radiance = sky_radiance_at(drawn.point.uv);
    sample.density = pick_probability(light) * drawn.density;
    sample.cosine = drawn.point.sine_polar;
    sample.segment = segment_to_infinity(receiver, sample.direction);
    return sample;
}

/// A direction of the sky.
fn sky_vertex(light: u32, random: vec2r, texel: vec4r) -> LightVertex {
    let drawn = sample_sky_direction(random, texel);
    var vertex: LightVertex;
    vertex.light = light;
    vertex.direction = -drawn.point.direction;
    vertex.pdf = pick_probability(light) * drawn.density / drawn.point.sine_polar;
    vertex.throughput = sky_radiance_at(drawn.point.uv) / vertex.pdf;
    return vertex;
}

/// A ray of light out of the sky.
fn emit_sky(vertex: LightVertex, random: vec2r) -> Emission {
    return emission_from_infinity(vertex.direction, random);
}

/// The direction as a receiver sees it.
fn sky_end(vertex: LightVertex, receiver: Surface) -> LightEnd {
    return end_at_infinity(vertex.direction, receiver);
}
