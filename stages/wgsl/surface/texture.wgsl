//! Textures: glTF 2.0 samplers without mipmaps, KHR_texture_transform, sRGB decoded before filtering.

import package::real::{vec2r, vec4r};
import package::features::HAS_SECOND_UV;

/// Three vec4u per material and role: (first texel, width | height << 16, flags, 0) and two rows of the transform of uv.
var<storage, read> texture_slots: array<vec4u>;
/// RGBA, 8 bits each, red in the lowest byte; row 0 is at v = 0.
var<storage, read> texels: array<u32>;

const ROLE_BASE_COLOR: u32 = 0u;
const ROLE_METALLIC_ROUGHNESS: u32 = 1u;
const ROLE_EMISSIVE: u32 = 2u;
const ROLE_NORMAL: u32 = 3u;
const ROLE_TRANSMISSION: u32 = 4u;
const ROLE_SPECULAR: u32 = 5u;
const ROLE_SPECULAR_COLOR: u32 = 6u;
const ROLE_COUNT: u32 = 7u;

const WRAP_CLAMP: u32 = 1u;
const WRAP_MIRROR: u32 = 2u;
const TEXTURE_NEAREST: u32 = 16u;
const TEXTURE_SRGB: u32 = 32u;
const TEXTURE_SECOND_UV: u32 = 64u;

/// Whether a material with these flags has a texture in `role`.
fn has_texture(material_flags: u32, role: u32) -> bool {
    return ((material_flags >> (8u + role)) & 1u) != 0u;
}

/// Remainder of the floored division of `i` by `n` > 0: in [0, n) for negative `i` too.
fn floored_remainder(i: i32, n: i32) -> i32 {
    let remainder = i % n;
    return select(remainder, remainder + n, remainder < 0);
}

/// Texel index in [0, n) for any index `i` under a wrap mode (repeat 0, clamp 1, mirrored repeat 2).
fn wrapped(i: i32, n: i32, mode: u32) -> i32 {
    if mode == WRAP_CLAMP {
        return clamp(i, 0, n - 1);
    }
    if mode == WRAP_MIRROR {
        let place = floored_remainder(i, 2 * n);
        return min(place, 2 * n - 1 - place);
    }
    return floored_remainder(i, n);
}

/// Linear value of an sRGB-encoded colour (IEC 61966-2-1).
fn decoded_srgb(encoded: vec3f) -> vec3f {
    let low = encoded / 12.92;
    let high = pow((encoded + 0.055) / 1.055, vec3f(2.4));
    return select(high, low, encoded <= vec3f(0.04045));
}

/// Linear RGBA of the texel at column and row `place`, wrapped.
fn texel_at(slot: vec4u, place: vec2i) -> vec4f {
    let size = vec2i(vec2u(slot.y & 0xffffu, slot.y >> 16u));
    let column = wrapped(place.x, size.x, slot.z & 3u);
    let row = wrapped(place.y, size.y, (slot.z >> 2u) & 3u);
    let texel = unpack4x8unorm(texels[slot.x + u32(row * size.x + column)]);
    if (slot.z & TEXTURE_SRGB) != 0u {
        return vec4f(decoded_srgb(texel.xyz), texel.w);
    }
    return texel;
}

/// Texture coordinates after KHR_texture_transform, of the set that the slot names.
fn transformed_uv(index: u32, flags: u32, uv0: vec2r, uv1: vec2r) -> vec2f {
    var uv = vec3f(vec2f(uv0), 1.0);
    if HAS_SECOND_UV {
        if (flags & TEXTURE_SECOND_UV) != 0u {
            uv = vec3f(vec2f(uv1), 1.0);
        }
    }
    let row_u = bitcast<vec3f>(texture_slots[index + 1u].xyz);
    let row_v = bitcast<vec3f>(texture_slots[index + 2u].xyz);
    return vec2f(dot(row_u, uv), dot(row_v, uv));
}

/// Linear RGBA of a material's texture in `role`, bilinear between texel centres or nearest.
fn sample_texture(material: u32, role: u32, uv0: vec2r, uv1: vec2r) -> vec4r {
    let index = 3u * (material * ROLE_COUNT + role);
    let slot = texture_slots[index];
    let size = vec2f(vec2u(slot.y & 0xffffu, slot.y >> 16u));
    let place = transformed_uv(index, slot.z, uv0, uv1) * size;
    if (slot.z & TEXTURE_NEAREST) != 0u {
        return vec4r(texel_at(slot, vec2i(floor(place))));
    }
    let centred = place - 0.5;
    let corner = vec2i(floor(centred));
    let fraction = centred - floor(centred);
    let top = mix(texel_at(slot, corner), texel_at(slot, corner + vec2i(1, 0)), fraction.x);
    let bottom = mix(texel_at(slot, corner + vec2i(0, 1)), texel_at(slot, corner + vec2i(1, 1)), fraction.x);
    return vec4r(mix(top, bottom, fraction.y));
}
