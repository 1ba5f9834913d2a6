//! Probes of the lights: how they are picked, and whether sampling and hitting them agree on densities.

import package::real::{real, vec2r, vec3r};
import package::features::{HAS_AREA_LIGHT, HAS_SKY};
import package::outcome::DONE;
import package::film::splat;
import package::pass::path_pixel;
import package::random::{DIMENSION_CHOICE, DIMENSION_EMIT, DIMENSION_LIGHT, WALK_EYE, random4};
import package::scene::scene;
import package::camera::camera::camera_ray;
import package::surface::surface::{NO_LIGHT, surface_at};
import package::trace::accelerator::{trace_any, trace_closest};
import package::trace::triangle::{NO_PRIM, RAY_INFINITY};
import package::light::light::{emitter_pdf_w, sample_light};
import package::light::light_sample::light_sample_pdf_w;
import package::light::sky::sky_pdf_w;
import package::light::table::{pick_light, pick_probability};
import package::transport::dimension::random_extra;

/// A pixel for each light: its probability (red, in every sample), and how often it was picked (green).
fn pick_lights() -> u32 {
    let pixel = path_pixel();
    if pixel < scene.counts.z {
        splat(pixel, vec3r(pick_probability(pixel), 0.0, 0.0));
    }
    splat(pick_light(random4(WALK_EYE, 0u, DIMENSION_LIGHT).xy), vec3r(0.0, 1.0, 0.0));
    return DONE;
}

/// Counts the relative difference of two densities in one of nine pixels: the first below 1e-7, then one a decade.
fn count_difference(first: u32, a: real, b: real) {
    let decade = floor(log2(f32(max(abs(a - b) / max(a, b), 1e-12))) * 0.30102999566) + 8.0;
    splat(first + u32(clamp(decade, 0.0, 8.0)), vec3r(1.0));
}

/// Samples a light from what the camera sees, and follows the direction: the density of hitting the same place must be that of sampling
/// it. Pixels 0 to 8 triangles, 16 to 24 the sky; 32 lights that are not where they were said to be.
fn follow_light() -> u32 {
    let random = random4(WALK_EYE, 0u, DIMENSION_EMIT);
    let pixel = path_pixel();
    let raster = vec2r(vec2u(pixel % scene.counts.x, pixel / scene.counts.x)) + random.xy;
    let ray = camera_ray(raster, random.zw);
    let seen = trace_closest(ray.origin, ray.direction, real(RAY_INFINITY), 0u);
    if seen.prim == NO_PRIM {
        return DONE;
    }
    let light = sample_light(surface_at(seen, ray.direction), random4(WALK_EYE, 1u, DIMENSION_LIGHT), random_extra(WALK_EYE, 1u));
    let pdf = light_sample_pdf_w(light);
    if pdf <= 0.0 || light.cosine < 0.01 || trace_any(light.segment.origin, light.segment.direction, light.segment.distance, 0u) {
        return DONE;
    }
    let met = trace_closest(light.segment.origin, light.segment.direction, real(RAY_INFINITY), 0u);
    if HAS_SKY && met.prim == NO_PRIM {
        count_difference(16u, pdf, sky_pdf_w(light.segment.direction));
        return DONE;
    }
    let emitter = surface_at(met, light.segment.direction);
    if met.prim == NO_PRIM || emitter.light == NO_LIGHT {
        splat(32u, vec3r(1.0));
        return DONE;
    }
    count_difference(0u, pdf, emitter_pdf_w(emitter, light.segment.direction, met.t));
    return DONE;
}
