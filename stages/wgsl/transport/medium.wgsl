//! The absorbing medium a walk is in: the inside of a solid (KHR_materials_volume).

import package::real::{real, vec3r};
import package::features::HAS_SOLID_GLASS;
import package::math::elementary::exponential3;
import package::surface::surface::Surface;
import package::surface::material_table::{MATERIAL_SOLID, material_flags, material_row};

/// Absorption of each medium, 1/m; the first, 0, absorbs nothing.
var<storage, read> media: array<vec4f>;

/// The medium outside of all solids, and inside of clear ones.
const NO_MEDIUM: u32 = 0u;

/// The surface bounds a volume.
fn bounds_volume(surface: Surface) -> bool {
    return HAS_SOLID_GLASS && (material_flags(surface.material) & MATERIAL_SOLID) != 0u;
}

/// The medium inside of what the surface bounds.
fn medium_of(surface: Surface) -> u32 {
    return bitcast<u32>(material_row(surface.material, 4u).z);
}

/// The medium on the observer's side of a surface: behind the back of a solid its own inside, which is right even where
/// the camera or a light is in it; else the one tracked so far.
fn medium_at(surface: Surface, tracked: u32) -> u32 {
    if surface.front || !bounds_volume(surface) {
        return tracked;
    }
    return medium_of(surface);
}

/// The medium a walk is in after scattering at the surface, given the one it came through.
fn medium_after(surface: Surface, medium: u32, transmitted: bool) -> u32 {
    if !transmitted || !bounds_volume(surface) {
        return medium;
    }
    return select(NO_MEDIUM, medium_of(surface), surface.front);
}

/// Beer-Lambert: the share of light that `distance` m of the medium let through.
fn transmittance(medium: u32, distance: real) -> vec3r {
    if medium == NO_MEDIUM {
        return vec3r(1.0);
    }
    return exponential3(-vec3r(media[medium].xyz) * distance);
}
