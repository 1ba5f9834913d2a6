//! Vertex attributes at a point of a triangle. `weights` are those of the second and third vertex.

import package::real::{vec2r, vec3r, vec4r};
import package::features::HAS_SECOND_UV;
import package::scene::scene;

/// Three unit shading normals per triangle, nine numbers.
var<storage, read> triangle_normals: array<f32>;
/// Three texture coordinates per triangle; where a scene uses a second set, all of that follow all of the first.
var<storage, read> triangle_uvs: array<vec2f>;
/// Three tangents per triangle; w is the sign of the bitangent.
var<storage, read> triangle_tangents: array<vec4f>;
/// Three linear RGBA colours per triangle.
var<storage, read> triangle_colors: array<vec4f>;

/// Shading normal stored at corner 0, 1 or 2.
fn corner_normal(prim: u32, corner: u32) -> vec3r {
    let first = 9u * prim + 3u * corner;
    return vec3r(vec3f(triangle_normals[first], triangle_normals[first + 1u], triangle_normals[first + 2u]));
}

/// Interpolated shading normal, not of unit length.
fn normal_at(prim: u32, weights: vec2r) -> vec3r {
    return (1.0 - weights.x - weights.y) * corner_normal(prim, 0u) + weights.x * corner_normal(prim, 1u) + weights.y * corner_normal(prim, 2u);
}

/// Interpolated texture coordinates whose first corner is at `first`.
fn interpolated_uv(first: u32, weights: vec2r) -> vec2r {
    let uv = vec2r(triangle_uvs[first]);
    return uv + weights.x * (vec2r(triangle_uvs[first + 1u]) - uv) + weights.y * (vec2r(triangle_uvs[first + 2u]) - uv);
}

/// Texture coordinates, set 0.
fn uv0_at(prim: u32, weights: vec2r) -> vec2r {
    return interpolated_uv(3u * prim, weights);
}

/// Texture coordinates, set 1; zero where the scene has no second set.
fn uv1_at(prim: u32, weights: vec2r) -> vec2r {
    if HAS_SECOND_UV {
        return interpolated_uv(3u * (scene.counts.w + prim), weights);
    }
    return vec2r(0.0);
}

/// Interpolated tangent, not of unit length; w is the sign of the bitangent.
fn tangent_at(prim: u32, weights: vec2r) -> vec4r {
    let first = vec4r(triangle_tangents[3u * prim]);
    let tangent = (1.0 - weights.x - weights.y) * first.xyz
        + weights.x * vec3r(triangle_tangents[3u * prim + 1u].xyz)
        + weights.y * vec3r(triangle_tangents[3u * prim + 2u].xyz);
    return vec4r(tangent, first.w);
}

/// Interpolated linear RGBA colour.
fn color_at(prim: u32, weights: vec2r) -> vec4r {
    return (1.0 - weights.x - weights.y) * vec4r(triangle_colors[3u * prim])
        + weights.x * vec4r(triangle_colors[3u * prim + 1u])
        + weights.y * vec4r(triangle_colors[3u * prim + 2u]);
}
