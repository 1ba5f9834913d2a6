//! The stage that starts eye walks.

import package::real::{vec2r, vec3r};
import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::features::HAS_ATTENUATION;
import package::camera::camera::camera_ray;
import package::pass::path_pixel;
import package::random::{DIMENSION_EMIT, WALK_EYE, random4};
import package::scene::scene;
import package::transport::medium::NO_MEDIUM;

/// Sends a walk from the camera through a point of the path's pixel, uniform over the pixel (box filter).
fn emit_eye(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    let pixel = path_pixel();
    let width = scene.counts.x;
    let random = random4(WALK_EYE, 0u, DIMENSION_EMIT);
    let ray = camera_ray(vec2r(vec2u(pixel % width, pixel / width)) + random.xy, random.zw);
    walk.position = ray.origin;
    walk.direction = ray.direction;
    walk.throughput = vec3r(1.0);
    if HAS_ATTENUATION {
        walk.medium = NO_MEDIUM;
    }
    path.length = 0u;
    return EMITTED;
}
