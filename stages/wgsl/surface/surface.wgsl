//! A point on a triangle with what shading needs to know of it.

import package::real::{real, vec2r, vec3r, vec4r};
import package::state::Hit;
import package::features::{HAS_NORMAL_MAP, HAS_SECOND_UV, HAS_SHADING_NORMALS, HAS_TEXTURES, HAS_VERTEX_COLORS};
import package::math::vector::{max_component, safe_normalize};
import package::surface::attributes::{color_at, normal_at, uv0_at, uv1_at};
import package::surface::geometry::{Triangle, load_triangle, triangle_normal};
import package::surface::normal_map::mapped_normal;

const NO_LIGHT: u32 = 0xffffffffu;

/// Bound on the rounding of a point on a triangle and of the next intersection with the same triangle, relative to the sum of the
/// magnitudes of vertex and edges: ten operations of 2^-24. Tracing is f32, so this does not depend on `real`.
const POSITION_ROUNDING = 5.9604644775390625e-7;

/// A position is taken off the edges of its triangle by this many error bounds, but by no more than this share of the triangle.
const EDGE_INSET = 2.0;
const LARGEST_INSET = 0.125;

/// A point on a triangle, seen from one side.
struct Surface {
    /// m
    position: vec3r,
    /// Bound on the error of each component of `position`, m.
    error: vec3r,
    /// Unit, on the front side.
    geometric_normal: vec3r,
    /// Unit, on the front side, with normal map.
    shading_normal: vec3r,
    /// Whether the observer is on the front side.
    front: bool,
    prim: u32,
    material: u32,
    /// Index of the light this triangle is, or NO_LIGHT.
    light: u32,
    /// Weights of the second and third vertex.
    barycentric: vec2r,
    uv0: vec2r,
    uv1: vec2r,
    /// Linear RGBA vertex colour.
    color: vec4r,
}

/// The surface where a ray that flew along `direction` arrived.
fn surface_at(hit: Hit, direction: vec3r) -> Surface {
    return surface_on(hit.prim, hit.uv, -direction);
}

/// The point of triangle `prim` with the given weights of the second and third vertex, seen from the side to which `observer` points.
fn surface_on(prim: u32, barycentric: vec2r, observer: vec3r) -> Surface {
    let triangle = load_triangle(prim);
    var surface: Surface;
    // Whole edges count, not only the part up to the point: the next intersection sees the plane through all three vertices.
    surface.error = POSITION_ROUNDING * (abs(triangle.v0) + abs(triangle.e1) + abs(triangle.e2));
    let weights = off_edges(barycentric, triangle, max_component(surface.error));
    surface.position = fma(vec3r(weights.x), triangle.e1, fma(vec3r(weights.y), triangle.e2, triangle.v0));
    surface.geometric_normal = triangle_normal(triangle.e1, triangle.e2);
    surface.front = dot(surface.geometric_normal, observer) >= 0.0;
    surface.prim = prim;
    surface.material = triangle.material;
    surface.light = triangle.light;
    surface.barycentric = barycentric;
    if HAS_TEXTURES || HAS_NORMAL_MAP {
        surface.uv0 = uv0_at(prim, barycentric);
        if HAS_SECOND_UV {
            surface.uv1 = uv1_at(prim, barycentric);
        }
    }
    if HAS_VERTEX_COLORS {
        surface.color = color_at(prim, barycentric);
    }
    surface.shading_normal = surface.geometric_normal;
    if HAS_SHADING_NORMALS {
        surface.shading_normal = interpolated_normal(prim, barycentric, surface.geometric_normal);
    }
    if HAS_NORMAL_MAP {
        surface.shading_normal = mapped_normal(surface.material, prim, barycentric, surface.uv0, surface.uv1, surface.shading_normal, surface.geometric_normal);
    }
    return surface;
}

/// The weights, moved inside where they are within rounding, `error` metres, of an edge: a point rounded onto an edge would lie as
/// likely behind the wall that meets the triangle there.
fn off_edges(barycentric: vec2r, triangle: Triangle, error: real) -> vec2r {
    let size = max(max_component(abs(triangle.e1)), max_component(abs(triangle.e2)));
    let e1 = triangle.e1 / size;
    let e2 = triangle.e2 / size;
    // A weight times twice the area is the length of the opposite edge times the distance from it.
    let least = EDGE_INSET * error / size * vec3r(length(e2), length(e1), length(e2 - e1)) / length(cross(e1, e2));
    let inset = min(least, vec3r(LARGEST_INSET));
    let inner = max(barycentric, inset.xy);
    return inner * min((1.0 - inset.z) / (inner.x + inner.y), 1.0);
}

/// Unit interpolated normal on the side of the geometric one; the geometric one where the vertex normals cancel.
fn interpolated_normal(prim: u32, barycentric: vec2r, geometric_normal: vec3r) -> vec3r {
    let normal = safe_normalize(normal_at(prim, barycentric), geometric_normal);
    return select(-normal, normal, dot(normal, geometric_normal) >= 0.0);
}
