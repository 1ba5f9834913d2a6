//! What a surface is made of at a point: factors times textures times vertex colours (glTF 2.0 and its KHR_materials extensions).

import package::real::{real, vec3r};
import package::features::{HAS_METAL, HAS_SOLID_GLASS, HAS_SPECULAR, HAS_TEXTURE_BASE_COLOR};
import package::features::{HAS_TEXTURE_EMISSIVE, HAS_TEXTURE_METALLIC_ROUGHNESS, HAS_TEXTURE_SPECULAR, HAS_TEXTURE_TRANSMISSION};
import package::features::{HAS_TRANSMISSION, HAS_TWO_SIDED_EMISSION, HAS_VERTEX_COLORS};
import package::surface::material_table::{MATERIAL_DOUBLE_SIDED, MATERIAL_SOLID, MATERIAL_VERTEX_COLORS, material_flags, material_row};
import package::surface::surface::Surface;
import package::surface::texture::{ROLE_BASE_COLOR, ROLE_EMISSIVE, ROLE_METALLIC_ROUGHNESS, ROLE_SPECULAR, ROLE_SPECULAR_COLOR, ROLE_TRANSMISSION};
import package::surface::texture::{has_texture, sample_texture};

/// Material parameters at a point; all in [0, 1] unless said otherwise.
struct Material {
    base_color: vec3r,
    metallic: real,
    /// Perceptual roughness; GGX alpha is its square.
    roughness: real,
    /// Refractive index, at least 1.
    ior: real,
    transmission: real,
    specular_color: vec3r,
    specular: real,
    /// Bounds a volume; otherwise one thin sheet.
    solid: bool,
    double_sided: bool,
}

/// Material at a surface point.
fn material_at(surface: Surface) -> Material {
    let flags = material_flags(surface.material);
    let shape = material_row(surface.material, 1u);
    var material: Material;
    material.double_sided = (flags & MATERIAL_DOUBLE_SIDED) != 0u;
    material.base_color = base_color_at(surface, flags);
    if HAS_METAL {
        material.metallic = real(shape.x);
    }
    if HAS_SPECULAR || HAS_TRANSMISSION {
        material.roughness = real(shape.y);
        material.ior = real(shape.z);
        let tint = material_row(surface.material, 3u);
        material.specular_color = vec3r(tint.xyz);
        material.specular = real(tint.w);
    }
    if HAS_TRANSMISSION {
        material.transmission = real(shape.w);
        if HAS_SOLID_GLASS {
            material.solid = (flags & MATERIAL_SOLID) != 0u;
        }
    }
    if HAS_TEXTURE_METALLIC_ROUGHNESS || HAS_TEXTURE_TRANSMISSION || HAS_TEXTURE_SPECULAR {
        material = textured_material(material, surface, flags);
    }
    return material;
}

/// Linear base colour in [0, 1].
fn base_color_at(surface: Surface, flags: u32) -> vec3r {
    var color = vec3r(material_row(surface.material, 0u).xyz);
    if HAS_TEXTURE_BASE_COLOR {
        if has_texture(flags, ROLE_BASE_COLOR) {
            color *= sample_texture(surface.material, ROLE_BASE_COLOR, surface.uv0, surface.uv1).xyz;
        }
    }
    if HAS_VERTEX_COLORS {
        if (flags & MATERIAL_VERTEX_COLORS) != 0u {
            color *= surface.color.xyz;
        }
    }
    return color;
}

/// `factors` times the textures of their roles: G roughness, B metallic; R transmission; A specular; RGB specular colour.
fn textured_material(factors: Material, surface: Surface, flags: u32) -> Material {
    var material = factors;
    if HAS_TEXTURE_METALLIC_ROUGHNESS {
        if has_texture(flags, ROLE_METALLIC_ROUGHNESS) {
            let texel = sample_texture(surface.material, ROLE_METALLIC_ROUGHNESS, surface.uv0, surface.uv1);
            if HAS_SPECULAR || HAS_TRANSMISSION {
                material.roughness *= texel.y;
            }
            if HAS_METAL {
                material.metallic *= texel.z;
            }
        }
    }
    if HAS_TRANSMISSION && HAS_TEXTURE_TRANSMISSION {
        if has_texture(flags, ROLE_TRANSMISSION) {
            material.transmission *= sample_texture(surface.material, ROLE_TRANSMISSION, surface.uv0, surface.uv1).x;
        }
    }
    if (HAS_SPECULAR || HAS_TRANSMISSION) && HAS_TEXTURE_SPECULAR {
        if has_texture(flags, ROLE_SPECULAR) {
            material.specular *= sample_texture(surface.material, ROLE_SPECULAR, surface.uv0, surface.uv1).w;
        }
        if has_texture(flags, ROLE_SPECULAR_COLOR) {
            material.specular_color *= sample_texture(surface.material, ROLE_SPECULAR_COLOR, surface.uv0, surface.uv1).xyz;
        }
    }
    return material;
}

/// Whether the surface emits towards the observer: an emissive material, seen from the front or emitting on both sides.
fn is_emissive(surface: Surface) -> bool {
    let row = material_row(surface.material, 2u);
    var faces = surface.front;
    if HAS_TWO_SIDED_EMISSION {
        faces = faces || (bitcast<u32>(row.w) & MATERIAL_DOUBLE_SIDED) != 0u;
    }
    return faces && max(row.x, max(row.y, row.z)) > 0.0;
}

/// Radiance that leaves the surface on the observer's side, W sr^-1 m^-2.
fn emission_at(surface: Surface) -> vec3r {
    if !is_emissive(surface) {
        return vec3r(0.0);
    }
    var radiance = vec3r(material_row(surface.material, 2u).xyz);
    if HAS_TEXTURE_EMISSIVE {
        if has_texture(material_flags(surface.material), ROLE_EMISSIVE) {
            radiance *= sample_texture(surface.material, ROLE_EMISSIVE, surface.uv0, surface.uv1).xyz;
        }
    }
    return radiance;
}
