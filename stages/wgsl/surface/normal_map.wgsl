//! Normal maps.

import package::real::{real, vec2r, vec3r};
import package::math::vector::safe_normalize;
import package::surface::attributes::tangent_at;
import package::surface::material_table::{material_flags, material_row};
import package::surface::texture::{ROLE_NORMAL, has_texture, sample_texture};

/// Least cosine between a mapped and the geometric normal.
const SHALLOWEST_NORMAL = 0.01;

/// Unit shading normal after the material's normal map (glTF 2.0: tangent space, x and y times the normal scale). Normals that
/// would point below the triangle are lifted just above it.
fn mapped_normal(material: u32, prim: u32, barycentric: vec2r, uv0: vec2r, uv1: vec2r, normal: vec3r, geometric_normal: vec3r) -> vec3r {
    if !has_texture(material_flags(material), ROLE_NORMAL) {
        return normal;
    }
    let stored = tangent_at(prim, barycentric);
    let tangent = safe_normalize(stored.xyz - normal * dot(stored.xyz, normal), vec3r(0.0));
    let bitangent = stored.w * cross(normal, tangent);
    let scale = real(material_row(material, 4u).x);
    let local = 2.0 * sample_texture(material, ROLE_NORMAL, uv0, uv1).xyz - 1.0;
    let mapped = safe_normalize(scale * (local.x * tangent + local.y * bitangent) + local.z * normal, normal);
    let height = dot(mapped, geometric_normal);
    if height < SHALLOWEST_NORMAL {
        return safe_normalize(mapped + (SHALLOWEST_NORMAL - height) * geometric_normal, normal);
    }
    return mapped;
}
