//! Uniform directions on the sphere and in a cone.

import package::real::{real, vec2r, vec3r};
import package::math::constants::{INVERSE_TWO_PI, TWO_PI};
import package::math::elementary::{cosine, sine};

/// Unit vector with density 1/(4 pi) per steradian.
fn sample_sphere(random: vec2r) -> vec3r {
    return sample_cone(random, -1.0);
}

/// Unit vector within the cone about +z whose half angle has the cosine `cosine_min`, uniform in solid angle.
fn sample_cone(random: vec2r, cosine_min: real) -> vec3r {
    // height = 1 - z keeps full accuracy in narrow cones
    let height = random.x * (1.0 - cosine_min);
    let radius = sqrt(max(height * (2.0 - height), 0.0));
    let angle = TWO_PI * random.y;
    return vec3r(radius * cosine(angle), radius * sine(angle), 1.0 - height);
}

/// Density of `sample_cone`, sr^-1.
fn pdf_cone(cosine_min: real) -> real {
    return INVERSE_TWO_PI / (1.0 - cosine_min);
}
