//! Directions on the hemisphere about +z.

import package::real::{real, vec2r, vec3r};
import package::math::constants::INVERSE_PI;
import package::sample::disk::sample_disk;

/// Unit vector about +z with density cos/pi per steradian (Malley's method).
fn sample_cosine_hemisphere(random: vec2r) -> vec3r {
    let point = sample_disk(random);
    return vec3r(point, sqrt(max(1.0 - dot(point, point), 0.0)));
}

/// Density of `sample_cosine_hemisphere`, sr^-1; `cosine` is that of the angle to +z.
fn pdf_cosine_hemisphere(cosine: real) -> real {
    return max(cosine, 0.0) * INVERSE_PI;
}
