//! Next-event estimation: light that reaches a surface straight from a light source.

import package::real::{real, vec3r, vec4r};
import package::features::{HAS_AREA_LIGHT, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::surface::surface::{NO_LIGHT, Surface};
import package::light::table::{LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SKY, LIGHT_SPOT, LIGHT_TRIANGLE, light_kind, pick_light};
import package::light::light_sample::LightSample;
import package::light::triangle_light::{sample_triangle_light, triangle_light_pdf_area};
import package::light::point_light::sample_point_light;
import package::light::directional_light::sample_directional_light;
import package::light::sky::sample_sky;

/// A light, and a point or direction of it, for a receiving surface. `random`: xy on the light, zw its choice;
/// `extra`: further numbers (the sky's texel: xyz).
fn sample_light(receiver: Surface, random: vec4r, extra: vec4r) -> LightSample {
    let light = pick_light(random.zw);
    let kind = light_kind(light);
    if HAS_AREA_LIGHT && kind == LIGHT_TRIANGLE {
        return sample_triangle_light(light, receiver, random.xy);
    }
    if (HAS_POINT_LIGHT || HAS_SPOT_LIGHT) && (kind == LIGHT_POINT || kind == LIGHT_SPOT) {
        return sample_point_light(light, receiver);
    }
    if HAS_DIRECTIONAL_LIGHT && kind == LIGHT_DIRECTIONAL {
        return sample_directional_light(light, receiver);
    }
    if HAS_SKY && kind == LIGHT_SKY {
        return sample_sky(light, receiver, random.xy, extra);
    }
    var nothing: LightSample;
    return nothing;
}

/// Density, per sr at the previous vertex, with which `sample_light` draws the point of an emitter that a ray along the
/// unit `direction` met after `distance` m. 0 if the emitter is not among the lights.
fn emitter_pdf_w(emitter: Surface, direction: vec3r, distance: real) -> real {
    if emitter.light == NO_LIGHT {
        return 0.0;
    }
    return triangle_light_pdf_area(emitter.light) * distance * distance / abs(dot(emitter.geometric_normal, direction));
}
