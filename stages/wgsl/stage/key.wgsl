//! Keys by which a schedule may sort the paths that wait for a stage: `sort.material`, `sort.glass` and `sort.ray` in a pipeline. They
//! count modulo 256.

import package::features::HAS_SOLID_GLASS;
import package::real::{real, vec3r};
import package::state::Walk;
import package::scene::scene;
import package::surface::geometry::load_triangle;

/// The material that the walk has hit: those that shade alike come together (Laine et al. 2013).
fn material_key(walk: ptr<function, Walk>) -> u32 {
    return load_triangle(walk.hit.prim).material;
}

/// As `material_key` in scenes with solid glass, and the same for all paths in others. What leaves a solid together is traced together
/// where paths move with their state; elsewhere the order of arrival is worth more.
fn glass_key(walk: ptr<function, Walk>) -> u32 {
    if HAS_SOLID_GLASS {
        return material_key(walk);
    }
    return 0u;
}

/// Where the next ray goes and comes from: the octant of its direction, then five bits of its origin on a Morton curve through the cube
/// around the scene's bounds (Meister et al. 2020): an octant of the cube and, horizontally, a quarter of that.
fn ray_key(walk: ptr<function, Walk>) -> u32 {
    let corner = vec3r(scene.bounds.xyz) - real(scene.bounds.w);
    let quarters = (walk.position - corner) * (2.0 / real(scene.bounds.w));
    let cell = vec3u(clamp(quarters, vec3r(0.0), vec3r(3.0)));
    let coarse = cell >> vec3u(1u);
    let fine = cell & vec3u(1u);
    let origin = coarse.x << 4u | coarse.y << 3u | coarse.z << 2u | fine.x << 1u | fine.z;
    let positive = vec3u(walk.direction > vec3r(0.0));
    return (positive.x << 2u | positive.y << 1u | positive.z) << 5u | origin;
}
