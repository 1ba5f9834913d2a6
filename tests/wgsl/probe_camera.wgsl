//! Probes of the camera: the density of its rays, and whether a point on a ray is projected back to the ray's pixel.

import package::real::{real, vec2r, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::path_pixel;
import package::random::{DIMENSION_CHOICE, DIMENSION_EMIT, WALK_EYE, random4};
import package::scene::scene;
import package::camera::camera::{camera_ray, camera_to_world, connect_camera, image_half_size};

/// Distance of a wall that is parallel to the image, m.
const WALL: real = 3.0;

/// Joins a point of the wall, drawn uniformly from more of it than is seen, to the camera. Adds the density of the camera's ray to the
/// pixel, as a share of its mean: 1 everywhere if the density is right and integrates to one.
fn project_wall() -> u32 {
    let random = random4(WALK_EYE, 0u, DIMENSION_EMIT);
    let half_size = 1.25 * WALL * image_half_size();
    let place = half_size * (2.0 * random.xy - 1.0);
    let point = vec3r(scene.camera_origin.xyz) + camera_to_world(vec3r(place, WALL));
    let connection = connect_camera(point, random.zw);
    if connection.valid {
        let distance = length(point - connection.position);
        splat(connection.pixel, vec3r(connection.importance * (WALL / distance) * 4.0 * half_size.x * half_size.y));
    }
    return DONE;
}

/// Counts rays (red), and those whose points lie in another pixel (green).
fn follow_rays() -> u32 {
    let random = random4(WALK_EYE, 0u, DIMENSION_EMIT);
    let lens = random4(WALK_EYE, 0u, DIMENSION_CHOICE);
    let pixel = path_pixel();
    let raster = vec2r(vec2u(pixel % scene.counts.x, pixel / scene.counts.x)) + random.xy;
    let ray = camera_ray(raster, lens.xy);
    let connection = connect_camera(ray.origin + (0.5 + 4.0 * random.z) * ray.direction, lens.xy);
    let lost = !connection.valid || connection.pixel != pixel;
    splat(pixel, vec3r(1.0, select(real(0.0), real(1.0), lost), 0.0));
    return DONE;
}
