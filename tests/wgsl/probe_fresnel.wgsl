//! A table of reflectances: pixel x is its place in the test's list.

import package::real::{real, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::{path_pixel, path_sample};
import package::random::{DIMENSION_SCATTER, WALK_EYE, random4};
import package::bsdf::fresnel::{fresnel_dielectric, fresnel_schlick};
import package::bsdf::thin::thin_reflectance;

/// Samples over which the hemispherical means are stratified.
const STRATA: u32 = 4096u;

/// Cosine of an angle of incidence in diffuse light.
fn diffuse_cosine() -> real {
    let place = (real(path_sample() % STRATA) + random4(WALK_EYE, 1u, DIMENSION_SCATTER).x) / real(STRATA);
    return sqrt(place);
}

fn tabulated(entry: u32) -> real {
    switch entry {
        case 0u: { return fresnel_dielectric(1.0, 1.5); }
        case 1u: { return fresnel_dielectric(1.0, 1.0 / 1.5); }
        case 2u: { return fresnel_dielectric(diffuse_cosine(), 1.5); }
        case 3u: { return fresnel_dielectric(diffuse_cosine(), 1.0 / 1.5); }
        case 4u: { return fresnel_dielectric(diffuse_cosine(), 1.33); }
        case 5u: { return fresnel_dielectric(diffuse_cosine(), 1.0 / 1.33); }
        // cosines of 41.8203 and 41.8003 degrees: on both sides of the critical angle 41.8103
        case 6u: { return fresnel_dielectric(0.7452396, 1.0 / 1.5); }
        case 7u: { return fresnel_dielectric(0.7454723, 1.0 / 1.5); }
        case 8u: { return fresnel_dielectric(0.0, 1.5); }
        case 9u: { return thin_reflectance(1.0, 1.5); }
        case 10u: { return fresnel_schlick(vec3r(0.04), 1.0, 1.0).y; }
        case 11u: { return fresnel_schlick(vec3r(0.04), 1.0, 0.0).y; }
        case 12u: { return fresnel_schlick(vec3r(0.04), 1.0, diffuse_cosine()).y; }
        // Brewster's angle, tan = 1.5: 0.5 ((1 - 1.5^2) / (1 + 1.5^2))^2
        case 13u: { return fresnel_dielectric(0.5547002, 1.5); }
        default: { return 0.0; }
    }
}

fn tabulate_fresnel() -> u32 {
    splat(path_pixel(), vec3r(tabulated(path_pixel())));
    return DONE;
}
