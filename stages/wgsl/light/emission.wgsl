//! Where light walks start, by kind of light.

import package::real::vec4r;
import package::features::{HAS_AREA_LIGHT, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::surface::surface::Surface;
import package::light::table::{LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SKY, LIGHT_SPOT, LIGHT_TRIANGLE, light_kind, pick_light};
import package::light::light_vertex::{Emission, LightEnd, LightVertex};
import package::light::triangle_light::{emit_triangle_light, triangle_light_end, triangle_light_vertex};
import package::light::point_light::{emit_point_light, point_light_end, point_light_vertex};
import package::light::directional_light::{directional_light_end, directional_light_vertex, emit_directional_light};
import package::light::sky::{emit_sky, sky_end, sky_vertex};

/// A light and a point on it. `random`: xy place on the light (for the sky: within its texel), zw choice of the light; `extra`:
/// further numbers (the sky's texel: xyz).
fn sample_light_vertex(random: vec4r, extra: vec4r) -> LightVertex {
    let light = pick_light(random.zw);
    let kind = light_kind(light);
    if HAS_AREA_LIGHT && kind == LIGHT_TRIANGLE {
        return triangle_light_vertex(light, random.xy);
    }
    if (HAS_POINT_LIGHT || HAS_SPOT_LIGHT) && (kind == LIGHT_POINT || kind == LIGHT_SPOT) {
        return point_light_vertex(light);
    }
    if HAS_DIRECTIONAL_LIGHT && kind == LIGHT_DIRECTIONAL {
        return directional_light_vertex(light);
    }
    if HAS_SKY && kind == LIGHT_SKY {
        return sky_vertex(light, random.xy, extra);
    }
    var nothing: LightVertex;
    return nothing;
}

/// A ray that leaves the light's vertex. `random`: xy direction (for lights at infinity: place on the disk), z side.
fn emit_light_ray(vertex: LightVertex, random: vec4r) -> Emission {
    let kind = light_kind(vertex.light);
    if HAS_AREA_LIGHT && kind == LIGHT_TRIANGLE {
        return emit_triangle_light(vertex, random);
    }
    if (HAS_POINT_LIGHT || HAS_SPOT_LIGHT) && (kind == LIGHT_POINT || kind == LIGHT_SPOT) {
        return emit_point_light(vertex, random.xy);
    }
    if HAS_DIRECTIONAL_LIGHT && kind == LIGHT_DIRECTIONAL {
        return emit_directional_light(vertex, random.xy);
    }
    if HAS_SKY && kind == LIGHT_SKY {
        return emit_sky(vertex, random.xy);
    }
    var nothing: Emission;
    return nothing;
}

/// The light's vertex as a receiver sees it.
fn light_end(vertex: LightVertex, receiver: Surface) -> LightEnd {
    let kind = light_kind(vertex.light);
    if HAS_AREA_LIGHT && kind == LIGHT_TRIANGLE {
        return triangle_light_end(vertex, receiver);
    }
    if (HAS_POINT_LIGHT || HAS_SPOT_LIGHT) && (kind == LIGHT_POINT || kind == LIGHT_SPOT) {
        return point_light_end(vertex, receiver);
    }
    if HAS_DIRECTIONAL_LIGHT && kind == LIGHT_DIRECTIONAL {
        return directional_light_end(vertex, receiver);
    }
    if HAS_SKY && kind == LIGHT_SKY {
        return sky_end(vertex, receiver);
    }
    var nothing: LightEnd;
    return nothing;
}
