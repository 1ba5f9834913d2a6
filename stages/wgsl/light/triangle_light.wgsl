//! Emissive triangles.

import package::real::{real, vec2r, vec3r, vec4r};
import package::features::{HAS_ALPHA, HAS_TWO_SIDED_EMISSION};
import package::math::constants::PI;
import package::math::frame::{frame_of, to_world};
import package::sample::hemisphere::sample_cosine_hemisphere;
import package::sample::triangle::sample_triangle;
import package::surface::geometry::load_triangle;
import package::surface::surface::{Surface, surface_on};
import package::trace::opacity::opacity_at;
import package::trace::triangle::TRIANGLE_ALPHA_TESTED;
import package::surface::material::{emission_at, is_emissive};
import package::surface::spawn::{segment_between, spawn_origin};
import package::light::table::{light_row, pick_probability};
import package::light::light_sample::LightSample;
import package::light::emission_sample::Emission;

/// Density of the points of an emissive triangle in both kinds of sampling, per m2: pick probability / area.
fn triangle_light_pdf_area(light: u32) -> real {
    return pick_probability(light) / real(light_row(light, 1u).w);
}

/// A point of the light, uniform in area. The side it is seen from is still open.
fn triangle_light_point(light: u32, random: vec2r) -> Surface {
    return surface_on(bitcast<u32>(light_row(light, 0u).z), sample_triangle(random), vec3r(0.0));
}

/// Mean radiance that rays which may pass through a partly transparent light see of it, W/(m2 sr).
fn triangle_light_radiance(point: Surface) -> vec3r {
    var radiance = emission_at(point);
    if HAS_ALPHA {
        if (load_triangle(point.prim).flags & TRIANGLE_ALPHA_TESTED) != 0u {
            radiance *= real(opacity_at(point.prim, point.material, vec2f(point.barycentric)));
        }
    }
    return radiance;
}

/// Light from a uniformly drawn point of the triangle.
fn sample_triangle_light(light: u32, receiver: Surface, random: vec2r) -> LightSample {
    var point = triangle_light_point(light, random);
    let span = point.position - receiver.position;
    point.front = dot(point.geometric_normal, span) < 0.0;
    let distance_squared = dot(span, span);
    var sample: LightSample;
    sample.direction = span / max(sqrt(distance_squared), 1e-30);
    sample.radiance = triangle_light_radiance(point);
    sample.density = triangle_light_pdf_area(light) * distance_squared;
    sample.cosine = abs(dot(point.geometric_normal, sample.direction));
    sample.segment = segment_between(receiver, point);
    return sample;
}

/// A ray of light that leaves the triangle with density cos/pi per sr, on either side with equal probability if both
/// emit: throughput = Le cos / (p_area p_w).
fn emit_triangle_light(light: u32, random: vec2r, direction: vec4r) -> Emission {
    var point = triangle_light_point(light, random);
    point.front = true;
    var sides = real(1.0);
    var normal = point.geometric_normal;
    if HAS_TWO_SIDED_EMISSION {
        var back = point;
        back.front = false;
        if is_emissive(back) {
            sides = 2.0;
            if direction.z < 0.5 {
                normal = -normal;
                point.front = false;
            }
        }
    }
    var emission: Emission;
    emission.direction = to_world(frame_of(normal), sample_cosine_hemisphere(direction.xy));
    emission.origin = spawn_origin(point, emission.direction);
    emission.throughput = triangle_light_radiance(point) * (sides * PI / triangle_light_pdf_area(light));
    return emission;
}
