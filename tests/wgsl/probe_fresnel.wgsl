//! A table of reflectances: a column for each entry of the test's list, a row for each part of an integral.

import package::real::{real, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::{path_pixel, path_sample};
import package::bsdf::fresnel::{fresnel_dielectric, fresnel_schlick};
import package::bsdf::thin::thin_reflectance;

const COLUMNS: u32 = 16u;
const ROWS: u32 = 64u;
/// Cells of a row, one for each sample.
const CELLS: u32 = 256u;

/// Cosine in the middle of the sample's cell of the hemispherical means.
fn cell_cosine() -> real {
    let cell = path_pixel() / COLUMNS * CELLS + path_sample() % CELLS;
    return (real(cell) + 0.5) / real(ROWS * CELLS);
}

/// The sample's part of the mean reflectance in diffuse light, 2 cos F.
fn diffuse_part(eta: real) -> real {
    return 2.0 * cell_cosine() * fresnel_dielectric(cell_cosine(), eta);
}

fn tabulated(entry: u32) -> real {
    switch entry {
        case 0u: { return fresnel_dielectric(1.0, 1.5); }
        case 1u: { return fresnel_dielectric(1.0, 1.0 / 1.5); }
        case 2u: { return diffuse_part(1.5); }
        case 3u: { return diffuse_part(1.0 / 1.5); }
        case 4u: { return diffuse_part(1.33); }
        case 5u: { return diffuse_part(1.0 / 1.33); }
        // cosines of 41.8203 and 41.8003 degrees: on both sides of the critical angle 41.8103
        case 6u: { return fresnel_dielectric(0.7452396, 1.0 / 1.5); }
        case 7u: { return fresnel_dielectric(0.7454723, 1.0 / 1.5); }
        case 8u: { return fresnel_dielectric(0.0, 1.5); }
        case 9u: { return thin_reflectance(1.0, 1.5); }
        case 10u: { return fresnel_schlick(vec3r(0.04), 1.0, 1.0).y; }
        case 11u: { return fresnel_schlick(vec3r(0.04), 1.0, 0.0).y; }
        case 12u: { return 2.0 * cell_cosine() * fresnel_schlick(vec3r(0.04), 1.0, cell_cosine()).y; }
        // Brewster's angle, tan = 1.5: 0.5 ((1 - 1.5^2) / (1 + 1.5^2))^2
        case 13u: { return fresnel_dielectric(0.5547002, 1.5); }
        default: { return 0.0; }
    }
}

fn tabulate_fresnel() -> u32 {
    splat(path_pixel(), vec3r(tabulated(path_pixel() % COLUMNS)));
    return DONE;
}
