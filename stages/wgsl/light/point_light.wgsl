//! Point and spot lights (KHR_lights_punctual).

import package::real::{real, vec2r, vec3r};
import package::features::HAS_SPOT_LIGHT;
import package::math::constants::INVERSE_PI;
import package::stored::stored_importance_direction;
import package::math::frame::{frame_of, to_world};
import package::sample::sphere::{pdf_cone, sample_cone, sample_sphere};
import package::surface::surface::Surface;
import package::surface::spawn::{SHORTEST_LENGTH, segment_to_point};
import package::light::table::{LIGHT_SPOT, light_kind, light_row, pick_probability};
import package::light::light_sample::LightSample;
import package::light::light_vertex::{Emission, LightEnd, LightVertex};

/// Intensity of a spot light relative to its axis: 1 within the inner cone, 0 outside the outer one, between them
/// squared and linear in the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles"; a difference of cosines below
/// 1e-6 counts as 1e-6, so that narrow cones keep their intensity).
fn spot_falloff(cosine: real, cosine_inner: real, cosine_outer: real) -> real {
    let ramp = clamp((cosine - cosine_outer) / max(cosine_inner - cosine_outer, 1e-6), 0.0, 1.0);
    return ramp * ramp;
}

/// Intensity of the light in a unit direction of flight, relative to its greatest.
fn point_light_falloff(light: u32, direction: vec3r) -> real {
    if HAS_SPOT_LIGHT {
        if light_kind(light) == LIGHT_SPOT {
            let axis = light_row(light, 2u);
            return spot_falloff(dot(vec3r(axis.xyz), direction), real(light_row(light, 3u).w), real(axis.w));
        }
    }
    return 1.0;
}

/// Light from the point itself.
fn sample_point_light(light: u32, receiver: Surface) -> LightSample {
    let position = vec3r(light_row(light, 1u).xyz);
    let span = position - receiver.position;
    let distance_squared = dot(span, span);
    var sample: LightSample;
    sample.direction = span / max(sqrt(distance_squared), SHORTEST_LENGTH);
    sample.radiance = vec3r(light_row(light, 3u).xyz) * point_light_falloff(light, -sample.direction);
    sample.density = pick_probability(light) * distance_squared;
    sample.cosine = 1.0;
    sample.delta = true;
    sample.segment = segment_to_point(receiver, position);
    return sample;
}

/// The point of the light.
fn point_light_vertex(light: u32) -> LightVertex {
    var vertex: LightVertex;
    vertex.light = light;
    vertex.throughput = vec3r(light_row(light, 3u).xyz) / pick_probability(light);
    return vertex;
}

/// A ray of light, uniform over the sphere (point) or the outer cone (spot).
fn emit_point_light(vertex: LightVertex, random: vec2r) -> Emission {
    var emission: Emission;
    emission.origin = vec3r(light_row(vertex.light, 1u).xyz);
    emission.direction = sample_sphere(random);
    if HAS_SPOT_LIGHT {
        if light_kind(vertex.light) == LIGHT_SPOT {
            let axis = light_row(vertex.light, 2u);
            emission.direction = to_world(frame_of(vec3r(axis.xyz)), sample_cone(random, real(axis.w)));
        }
    }
    emission.direction = stored_importance_direction(emission.direction);
    emission.cosine = 1.0;
    emission.pdf = point_light_pdf_w(vertex.light);
    emission.weight = vec3r(point_light_falloff(vertex.light, emission.direction) / emission.pdf);
    return emission;
}

/// The light as a receiver sees it.
fn point_light_end(vertex: LightVertex, receiver: Surface) -> LightEnd {
    let position = vec3r(light_row(vertex.light, 1u).xyz);
    let span = position - receiver.position;
    var end: LightEnd;
    end.distance_squared = dot(span, span);
    end.direction = span / max(sqrt(end.distance_squared), SHORTEST_LENGTH);
    end.cosine = 1.0;
    end.value = vec3r(point_light_falloff(vertex.light, -end.direction));
    end.pdf = point_light_pdf_w(vertex.light);
    end.segment = segment_to_point(receiver, position);
    return end;
}

/// Density of emitted directions, per sr: uniform over the sphere, or over the outer cone.
fn point_light_pdf_w(light: u32) -> real {
    if HAS_SPOT_LIGHT {
        if light_kind(light) == LIGHT_SPOT {
            return pdf_cone(real(light_row(light, 2u).w));
        }
    }
    return 0.25 * INVERSE_PI;
}
