//! The absorbing medium a walk is in: the inside of a solid, known by its material (KHR_materials_volume).

import package::real::{real, vec3r};
import package::features::HAS_SOLID_GLASS;
import package::math::elementary::exponential3;
import package::surface::surface::Surface;
import package::surface::material_table::{MATERIAL_SOLID, material_flags, material_row};

/// The medium outside of all solids.
const NO_MEDIUM: u32 = 0xffffffffu;

/// The surface bounds a volume.
fn bounds_volume(surface: Surface) -> bool {
    return HAS_SOLID_GLASS && (material_flags(surface.material) & MATERIAL_SOLID) != 0u;
}

/// The medium on the observer's side of a surface: behind the back of a solid its own inside, which is right even where
/// the camera or a light is in it; else the one tracked so far.
fn medium_at(surface: Surface, tracked: u32) -> u32 {
    return select(tracked, surface.material, !surface.front && bounds_volume(surface));
}

/// The medium a walk is in after scattering at the surface, given the one it came through.
fn medium_after(surface: Surface, medium: u32, transmitted: bool) -> u32 {
    if !transmitted || !bounds_volume(surface) {
        return medium;
    }
    return select(NO_MEDIUM, surface.material, surface.front);
}

/// Beer-Lambert: the share of light that `distance` m of the medium let through.
fn transmittance(medium: u32, distance: real) -> vec3r {
    if medium == NO_MEDIUM {
        return vec3r(1.0);
    }
    return exponential3(-vec3r(material_row(medium, 4u).xyz) * distance);
}
