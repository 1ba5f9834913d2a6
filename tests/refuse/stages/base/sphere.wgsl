import package::real::{real, vec3r};

var<storage, read> spheres: array<vec4f>;

/// Distance to the first sphere, m.
fn nearest_sphere(origin: vec3r, direction: vec3r) -> real {
    let sphere = spheres[0];
    return dot(sphere.xyz - origin, direction);
}
