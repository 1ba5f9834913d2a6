//! Probes of the sky, with a pixel for each texel.

import package::real::{real, vec2r, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::path_pixel;
import package::random::{DIMENSION_CHOICE, DIMENSION_LIGHT, WALK_EYE, random4};
import package::math::constants::PI;
import package::light::sky::{sample_sky, sky_frame, sky_pdf_w, sky_point, sky_point_at, sky_texel};
import package::surface::surface::Surface;

/// Integral of the density over the texel (red, mean over the samples), and how often its directions were drawn (green).
fn draw_sky() -> u32 {
    let size = sky_frame.size.xy;
    let pixel = path_pixel();
    let random = random4(WALK_EYE, 0u, DIMENSION_LIGHT);
    let point = sky_point_at((vec2r(vec2u(pixel % size.x, pixel / size.x)) + 0.998 * random.xy + 0.001) / vec2r(size));
    let solid_angle = 2.0 * PI * PI * point.sine_polar / (real(size.x) * real(size.y));
    splat(pixel, vec3r(sky_pdf_w(point.direction) / real(sky_frame.turn.z) * solid_angle, 0.0, 0.0));
    var receiver: Surface;
    receiver.geometric_normal = vec3r(0.0, 1.0, 0.0);
    let drawn = sample_sky(sky_frame.size.w, receiver, random.zw, random4(WALK_EYE, 0u, DIMENSION_CHOICE));
    splat(sky_texel(sky_point(drawn.direction).uv), vec3r(0.0, 1.0, 0.0));
    return DONE;
}

/// Draws at the far corner of every texel, where coordinates are rounded into the next one: no density may be zero.
fn draw_corners() -> u32 {
    let size = sky_frame.size.xy;
    let pixel = path_pixel();
    let slot = (vec2r(vec2u(pixel % size.x, pixel / size.x)) + 0.5) / vec2r(size);
    var receiver: Surface;
    receiver.geometric_normal = vec3r(0.0, 1.0, 0.0);
    let corner = vec2r(0.99999994);
    let threshold = random4(WALK_EYE, 0u, DIMENSION_CHOICE).x;
    let drawn = sample_sky(sky_frame.size.w, receiver, corner, vec4f(slot.y, slot.x, threshold, 0.0));
    splat(pixel, vec3r(1.0, select(real(1.0), real(0.0), drawn.density > 0.0), 0.0));
    return DONE;
}
