//! Rows and flags of the material table.

/// Five vec4 per material: (base colour, alpha) (metallic, roughness, ior, transmission) (emitted radiance, flags)
/// (specular colour, specular) (normal scale, alpha cutoff, medium, 0). The medium is the number of what is inside of it.
var<storage, read> materials: array<vec4f>;

const MATERIAL_ROWS: u32 = 5u;
const MATERIAL_DOUBLE_SIDED: u32 = 1u;
const MATERIAL_SOLID: u32 = 2u;
const MATERIAL_ALPHA_MASK: u32 = 4u;
const MATERIAL_VERTEX_COLORS: u32 = 16u;

/// Row `row` (0 to 4) of a material.
fn material_row(material: u32, row: u32) -> vec4f {
    return materials[MATERIAL_ROWS * material + row];
}

/// Flags of a material: bits named above; from bit 8 on, one bit for each texture role that is present.
fn material_flags(material: u32) -> u32 {
    return bitcast<u32>(material_row(material, 2u).w);
}
