//! What a partly transparent triangle does to a ray. Walks and shadow rays use the same rule, so both see the same mean transmittance.

import package::real::{vec2r, vec3r};
import package::features::{HAS_ALPHA, HAS_TEXTURE_BASE_COLOR, HAS_VERTEX_COLORS};
import package::pass::pass_seed;
import package::random::{hash4, hash_opacity};
import package::surface::attributes::{color_at, uv0_at, uv1_at};
import package::surface::material_table::{MATERIAL_ALPHA_MASK, MATERIAL_VERTEX_COLORS, material_flags, material_row};
import package::surface::texture::{ROLE_BASE_COLOR, has_texture, sample_texture};

/// Key of a ray for the choices of partly transparent triangles: the same ray meets the same choices, whoever traces it.
fn opacity_key(origin: vec3r, direction: vec3r) -> u32 {
    if HAS_ALPHA {
        let from_origin = hash4(vec4u(bitcast<vec3u>(vec3f(origin)), pass_seed()));
        return hash4(vec4u(bitcast<vec3u>(vec3f(direction)), from_origin.x)).x;
    }
    return 0u;
}

/// Opacity of a point of a triangle, in [0, 1]: factor times texture times vertex colour. Under MASK it is 0 or 1.
fn opacity_at(prim: u32, material: u32, barycentric: vec2f) -> f32 {
    let flags = material_flags(material);
    var opacity = material_row(material, 0u).w;
    if HAS_TEXTURE_BASE_COLOR {
        if has_texture(flags, ROLE_BASE_COLOR) {
            let weights = vec2r(barycentric);
            opacity *= f32(sample_texture(material, ROLE_BASE_COLOR, uv0_at(prim, weights), uv1_at(prim, weights)).w);
        }
    }
    if HAS_VERTEX_COLORS {
        if (flags & MATERIAL_VERTEX_COLORS) != 0u {
            opacity *= f32(color_at(prim, vec2r(barycentric)).w);
        }
    }
    if (flags & MATERIAL_ALPHA_MASK) != 0u {
        return select(0.0, 1.0, opacity >= material_row(material, 4u).y);
    }
    return opacity;
}

/// Whether the ray with this key ends at a partly transparent triangle: with a probability equal to the opacity.
fn stops_ray(prim: u32, material: u32, barycentric: vec2f, key: u32) -> bool {
    return hash_opacity(key, prim) < opacity_at(prim, material, barycentric);
}
