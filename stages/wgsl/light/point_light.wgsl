//! Point and spot lights (KHR_lights_punctual).

import package::real::{real, vec2r, vec3r};
import package::features::HAS_SPOT_LIGHT;
import package::math::constants::PI;
import package::math::frame::{frame_of, to_world};
import package::sample::sphere::{pdf_cone, sample_cone, sample_sphere};
import package::surface::surface::Surface;
import package::surface::spawn::segment_to_point;
import package::light::table::{LIGHT_SPOT, light_row, pick_probability};
import package::light::light_sample::LightSample;
import package::light::emission_sample::Emission;

/// Intensity of a spot light relative to its axis: 1 within the inner cone, 0 outside the outer one, between them
/// squared and linear in the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles"; a difference of cosines below
/// 1e-6 counts as 1e-6, so that narrow cones keep their intensity).
fn spot_falloff(cosine: real, cosine_inner: real, cosine_outer: real) -> real {
    let ramp = clamp((cosine - cosine_outer) / max(cosine_inner - cosine_outer, 1e-6), 0.0, 1.0);
    return ramp * ramp;
}

/// Intensity of the light in a unit direction of flight, W/sr.
fn point_light_intensity(light: u32, direction: vec3r) -> vec3r {
    let intensity = light_row(light, 3u);
    var value = vec3r(intensity.xyz);
    if HAS_SPOT_LIGHT {
        let axis = light_row(light, 2u);
        let falloff = spot_falloff(dot(vec3r(axis.xyz), direction), real(intensity.w), real(axis.w));
        value *= select(real(1.0), falloff, bitcast<u32>(light_row(light, 0u).x) == LIGHT_SPOT);
    }
    return value;
}

/// Light from the point itself.
fn sample_point_light(light: u32, receiver: Surface) -> LightSample {
    let position = vec3r(light_row(light, 1u).xyz);
    let span = position - receiver.position;
    let distance_squared = dot(span, span);
    var sample: LightSample;
    sample.direction = span / max(sqrt(distance_squared), 1e-30);
    sample.radiance = point_light_intensity(light, -sample.direction);
    sample.density = pick_probability(light) * distance_squared;
    sample.cosine = 1.0;
    sample.delta = true;
    sample.segment = segment_to_point(receiver, position);
    return sample;
}

/// A ray of light, uniform over the sphere (point) or the outer cone (spot): throughput = I / (p_pick p_w).
fn emit_point_light(light: u32, random: vec2r) -> Emission {
    var emission: Emission;
    emission.origin = vec3r(light_row(light, 1u).xyz);
    var inverse_pdf = real(4.0 * PI);
    emission.direction = sample_sphere(random);
    if HAS_SPOT_LIGHT {
        let axis = light_row(light, 2u);
        if bitcast<u32>(light_row(light, 0u).x) == LIGHT_SPOT {
            emission.direction = to_world(frame_of(vec3r(axis.xyz)), sample_cone(random, real(axis.w)));
            inverse_pdf = 1.0 / pdf_cone(real(axis.w));
        }
    }
    emission.throughput = point_light_intensity(light, emission.direction) * (inverse_pdf / pick_probability(light));
    return emission;
}
