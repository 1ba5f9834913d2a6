//! Parallel light from infinity, and what all lights at infinity share.

import package::real::{real, vec2r, vec3r};
import package::math::constants::PI;
import package::math::frame::{frame_of, to_world};
import package::sample::disk::sample_disk;
import package::scene::scene;
import package::surface::surface::Surface;
import package::surface::spawn::{Segment, spawn_origin};
import package::trace::triangle::RAY_INFINITY;
import package::light::table::{light_row, pick_probability};
import package::light::light_sample::LightSample;
import package::light::light_vertex::{Emission, LightEnd, LightVertex};

/// The disk of the light lies this many radii before the centre of the scene, so that rounding puts nothing behind it.
const DISK_DISTANCE: real = 1.001;

/// Light along the beam; its `radiance` is the irradiance across it.
fn sample_directional_light(light: u32, receiver: Surface) -> LightSample {
    var sample: LightSample;
    sample.direction = -vec3r(light_row(light, 2u).xyz);
    sample.radiance = vec3r(light_row(light, 3u).xyz);
    sample.density = pick_probability(light);
    sample.cosine = 1.0;
    sample.delta = true;
    sample.segment = segment_to_infinity(receiver, sample.direction);
    return sample;
}

/// The light's direction.
fn directional_light_vertex(light: u32) -> LightVertex {
    var vertex: LightVertex;
    vertex.light = light;
    vertex.direction = vec3r(light_row(light, 2u).xyz);
    vertex.throughput = vec3r(light_row(light, 3u).xyz) / pick_probability(light);
    return vertex;
}

/// A ray of the beam.
fn emit_directional_light(vertex: LightVertex, random: vec2r) -> Emission {
    return emission_from_infinity(vertex.direction, random);
}

/// The light as a receiver sees it.
fn directional_light_end(vertex: LightVertex, receiver: Surface) -> LightEnd {
    return end_at_infinity(vertex.direction, receiver);
}

/// A ray along `direction` that starts on the disk before the scene.
fn emission_from_infinity(direction: vec3r, random: vec2r) -> Emission {
    var emission: Emission;
    emission.direction = direction;
    emission.origin = origin_at_infinity(direction, random);
    emission.cosine = 1.0;
    emission.pdf = pdf_disk();
    emission.weight = vec3r(1.0 / emission.pdf);
    emission.parallel = true;
    return emission;
}

/// A light at infinity that shines along `direction`, as a receiver sees it.
fn end_at_infinity(direction: vec3r, receiver: Surface) -> LightEnd {
    var end: LightEnd;
    end.direction = -direction;
    end.value = vec3r(1.0);
    end.distance_squared = 1.0;
    end.cosine = 1.0;
    end.pdf = pdf_disk();
    end.segment = segment_to_infinity(receiver, end.direction);
    return end;
}

/// The ray from a surface out of the scene.
fn segment_to_infinity(receiver: Surface, direction: vec3r) -> Segment {
    var segment: Segment;
    segment.origin = spawn_origin(receiver, direction);
    segment.direction = direction;
    segment.distance = real(RAY_INFINITY);
    return segment;
}

/// Origin, uniform over the disk across `direction` that covers the scene's bounding sphere.
fn origin_at_infinity(direction: vec3r, random: vec2r) -> vec3r {
    let point = to_world(frame_of(direction), vec3r(sample_disk(random), -DISK_DISTANCE));
    return vec3r(scene.bounds.xyz) + real(scene.bounds.w) * point;
}

/// Density of `origin_at_infinity` on the disk, per m2.
fn pdf_disk() -> real {
    let radius = real(scene.bounds.w);
    return 1.0 / (PI * radius * radius);
}
