//! Emissive triangles.

import package::real::{real, vec2r, vec3r, vec4r};
import package::features::{HAS_ALPHA, HAS_TWO_SIDED_EMISSION};
import package::math::constants::{INVERSE_PI, PI};
import package::stored::stored_importance_direction;
import package::math::frame::{frame_of, to_world};
import package::sample::hemisphere::sample_cosine_hemisphere;
import package::sample::triangle::sample_triangle;
import package::surface::geometry::load_triangle;
import package::surface::surface::{Surface, surface_on};
import package::trace::opacity::opacity_at;
import package::trace::triangle::TRIANGLE_ALPHA_TESTED;
import package::surface::material::{emission_at, is_emissive};
import package::surface::spawn::{SHORTEST_LENGTH, segment_between, spawn_origin};
import package::light::table::{light_row, pick_probability};
import package::light::light_sample::LightSample;
import package::light::light_vertex::{Emission, LightEnd, LightVertex};

/// Density of the points of an emissive triangle in both kinds of sampling, per m2: pick probability / area.
fn triangle_light_pdf_area(light: u32) -> real {
    return pick_probability(light) / real(light_row(light, 1u).w);
}

/// A point of the light, uniform in area. The side it is seen from is still open.
fn triangle_light_point(light: u32, random: vec2r) -> Surface {
    return surface_on(triangle_of(light), sample_triangle(random), vec3r(0.0));
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
    sample.direction = span / max(sqrt(distance_squared), SHORTEST_LENGTH);
    sample.radiance = triangle_light_radiance(point);
    sample.density = triangle_light_pdf_area(light) * distance_squared;
    sample.cosine = abs(dot(point.geometric_normal, sample.direction));
    sample.segment = segment_between(receiver, point);
    return sample;
}

/// A point of the light, uniform in area.
fn triangle_light_vertex(light: u32, random: vec2r) -> LightVertex {
    var vertex: LightVertex;
    vertex.light = light;
    vertex.place = sample_triangle(random);
    vertex.pdf = triangle_light_pdf_area(light);
    var point = surface_on(triangle_of(light), vertex.place, vec3r(0.0));
    point.front = true;
    vertex.throughput = triangle_light_radiance(point) / vertex.pdf;
    return vertex;
}

/// A ray of light that leaves the triangle with density cos/pi per sr, on either side with equal probability if both emit.
fn emit_triangle_light(vertex: LightVertex, random: vec4r) -> Emission {
    let point = surface_on(triangle_of(vertex.light), vertex.place, vec3r(0.0));
    let sides = emitting_sides(point);
    let normal = select(point.geometric_normal, -point.geometric_normal, sides > 1.0 && random.z < 0.5);
    var emission: Emission;
    emission.direction = stored_importance_direction(to_world(frame_of(normal), sample_cosine_hemisphere(random.xy)));
    emission.origin = spawn_origin(point, emission.direction);
    emission.cosine = abs(dot(point.geometric_normal, emission.direction));
    emission.pdf = emission_pdf_w(point, emission.cosine);
    emission.weight = vec3r(sides * PI);
    return emission;
}

/// The point as a receiver sees it.
fn triangle_light_end(vertex: LightVertex, receiver: Surface) -> LightEnd {
    var point = surface_on(triangle_of(vertex.light), vertex.place, vec3r(0.0));
    let span = point.position - receiver.position;
    point.front = dot(point.geometric_normal, span) < 0.0;
    var end: LightEnd;
    end.distance_squared = dot(span, span);
    end.direction = span / max(sqrt(end.distance_squared), SHORTEST_LENGTH);
    end.cosine = abs(dot(point.geometric_normal, end.direction));
    end.value = vec3r(select(0.0, end.cosine, is_emissive(point)));
    end.pdf = emission_pdf_w(point, end.cosine);
    end.segment = segment_between(receiver, point);
    return end;
}

/// The triangle that a light is.
fn triangle_of(light: u32) -> u32 {
    return bitcast<u32>(light_row(light, 0u).z);
}

/// Sides of an emissive surface that emit: 1 or 2.
fn emitting_sides(surface: Surface) -> real {
    if HAS_TWO_SIDED_EMISSION {
        var back = surface;
        back.front = false;
        return select(1.0, 2.0, is_emissive(back));
    }
    return 1.0;
}

/// Density, per sr, with which emission from a point of an emissive triangle takes a direction of this |cosine| on a side that emits.
fn emission_pdf_w(surface: Surface, cosine: real) -> real {
    return cosine * INVERSE_PI / emitting_sides(surface);
}
