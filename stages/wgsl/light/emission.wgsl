//! Where light walks start.

import package::real::vec4r;
import package::features::{HAS_AREA_LIGHT, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::light::table::{LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SKY, LIGHT_SPOT, LIGHT_TRIANGLE, light_kind, pick_light};
import package::light::emission_sample::Emission;
import package::light::triangle_light::emit_triangle_light;
import package::light::point_light::emit_point_light;
import package::light::directional_light::emit_directional_light;
import package::light::sky::emit_sky;

/// A light, and a ray that leaves it. `random`: xy place on the light (for the sky: within its texel), zw choice of the
/// light; `direction`: xy direction (for lights at infinity: place on the disk), z side; `extra`: further numbers (the sky's texel: xyz).
fn sample_emission(random: vec4r, direction: vec4r, extra: vec4r) -> Emission {
    let light = pick_light(random.zw);
    let kind = light_kind(light);
    if HAS_AREA_LIGHT && kind == LIGHT_TRIANGLE {
        return emit_triangle_light(light, random.xy, direction);
    }
    if (HAS_POINT_LIGHT || HAS_SPOT_LIGHT) && (kind == LIGHT_POINT || kind == LIGHT_SPOT) {
        return emit_point_light(light, direction.xy);
    }
    if HAS_DIRECTIONAL_LIGHT && kind == LIGHT_DIRECTIONAL {
        return emit_directional_light(light, direction.xy);
    }
    if HAS_SKY && kind == LIGHT_SKY {
        return emit_sky(light, random.xy, direction, extra);
    }
    var nothing: Emission;
    return nothing;
}
