//! Steps that eye and light walks share.

import package::real::{real, vec2r, vec3r};
import package::state::Walk;
import package::features::HAS_ATTENUATION;
import package::camera::camera::camera_ray;
import package::pass::path_pixel;
import package::random::{DIMENSION_EMIT, WALK_EYE, random4};
import package::scene::scene;
import package::surface::surface::{Surface, surface_at};
import package::surface::spawn::spawn_origin;
import package::bsdf::bsdf::BsdfSample;
import package::transport::medium::{NO_MEDIUM, medium_after, medium_at, transmittance};

/// Sends a walk from the camera through a point of the path's pixel, uniform over the pixel (box filter). `vertex` keys its random
/// numbers. Returns the cosine of the direction to the camera's axis.
fn begin_eye(walk: ptr<function, Walk>, vertex: u32) -> real {
    let pixel = path_pixel();
    let width = scene.counts.x;
    let random = random4(WALK_EYE, vertex, DIMENSION_EMIT);
    let ray = camera_ray(vec2r(vec2u(pixel % width, pixel / width)) + random.xy, random.zw);
    walk.position = ray.origin;
    walk.direction = ray.direction;
    walk.throughput = vec3r(1.0);
    walk.flags = 0u;
    if HAS_ATTENUATION {
        walk.medium = NO_MEDIUM;
    }
    return dot(ray.direction, vec3r(scene.camera_forward.xyz));
}

/// The surface the walk has hit; absorbs along the way there.
fn arrive(walk: ptr<function, Walk>) -> Surface {
    let surface = surface_at(walk.hit, walk.direction);
    if HAS_ATTENUATION {
        walk.medium = medium_at(surface, walk.medium);
        walk.throughput *= transmittance(walk.medium, walk.hit.t);
    }
    return surface;
}

/// Sends the walk off from the surface along a sampled direction.
fn depart(walk: ptr<function, Walk>, surface: Surface, sample: BsdfSample) {
    walk.position = spawn_origin(surface, sample.direction);
    walk.direction = sample.direction;
    walk.throughput *= sample.weight;
    if HAS_ATTENUATION {
        walk.medium = medium_after(surface, walk.medium, sample.transmitted);
    }
}

/// The sample leads nowhere: nothing scatters, or only black.
fn is_absorbed(sample: BsdfSample) -> bool {
    return !(sample.pdf > 0.0) || all(sample.weight == vec3r(0.0));
}
