//! Triangles as stored for tracing.

import package::real::vec3r;
import package::math::vector::{accurate_cross, safe_normalize, unit_scale};
import package::trace::triangle::bvh_triangles;

/// A triangle in world space, m. The front is the side from which v0, v0 + e1, v0 + e2 turn counter-clockwise.
struct Triangle {
    v0: vec3r,
    e1: vec3r,
    e2: vec3r,
    flags: u32,
    material: u32,
    /// Index of the light this triangle is, or 0xffffffff.
    light: u32,
}

/// Triangle `prim`.
fn load_triangle(prim: u32) -> Triangle {
    let first = bvh_triangles[3u * prim];
    let second = bvh_triangles[3u * prim + 1u];
    let third = bvh_triangles[3u * prim + 2u];
    var triangle: Triangle;
    triangle.v0 = vec3r(first.xyz);
    triangle.e1 = vec3r(second.xyz);
    triangle.e2 = vec3r(third.xyz);
    triangle.flags = bitcast<u32>(first.w);
    triangle.material = bitcast<u32>(second.w);
    triangle.light = bitcast<u32>(third.w);
    return triangle;
}

/// Unit normal on the front side, whatever the size of the triangle.
fn triangle_normal(e1: vec3r, e2: vec3r) -> vec3r {
    return safe_normalize(accurate_cross(unit_scale(e1), unit_scale(e2)), vec3r(0.0, 0.0, 1.0));
}
