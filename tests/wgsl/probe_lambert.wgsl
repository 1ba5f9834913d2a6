//! A probe of what the camera sees: surfaces of Lambertian materials, and the rest.

import package::real::{real, vec2r, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::path_pixel;
import package::random::{DIMENSION_EMIT, WALK_EYE, random4};
import package::scene::scene;
import package::camera::camera::camera_ray;
import package::surface::geometry::load_triangle;
import package::surface::material_table::{MATERIAL_DOUBLE_SIDED, material_flags, material_row};
import package::surface::texture::{ROLE_METALLIC_ROUGHNESS, ROLE_NORMAL, has_texture};
import package::trace::accelerator::trace_closest;
import package::trace::triangle::{NO_PRIM, RAY_INFINITY, TRIANGLE_ALPHA_TESTED};

/// No metal, roughness 1, neither coat nor glass, no texture of them, no normal map. What emits on both sides does so in no other
/// renderer's triangle lights.
fn is_lambert(material: u32) -> bool {
    let flags = material_flags(material);
    let shape = material_row(material, 1u);
    let plain = shape.x == 0.0 && shape.y == 1.0 && shape.w == 0.0 && material_row(material, 3u).w == 0.0
        && !has_texture(flags, ROLE_METALLIC_ROUGHNESS) && !has_texture(flags, ROLE_NORMAL);
    let emits = any(material_row(material, 2u).xyz > vec3f(0.0));
    return plain && !(emits && (flags & MATERIAL_DOUBLE_SIDED) != 0u);
}

/// Adds 1 to the pixel if the ray meets an opaque Lambertian surface.
fn see_lambert() -> u32 {
    let random = random4(WALK_EYE, 0u, DIMENSION_EMIT);
    let pixel = path_pixel();
    let raster = vec2r(vec2u(pixel % scene.counts.x, pixel / scene.counts.x)) + random.xy;
    let ray = camera_ray(raster, random.zw);
    let hit = trace_closest(ray.origin, ray.direction, real(RAY_INFINITY), 0u);
    if hit.prim != NO_PRIM {
        let triangle = load_triangle(hit.prim);
        if (triangle.flags & TRIANGLE_ALPHA_TESTED) == 0u && is_lambert(triangle.material) {
            splat(pixel, vec3r(1.0));
        }
    }
    return DONE;
}
