//! The GGX microfacet distribution with Smith masking, and sampling its visible normals.

import package::real::{real, vec2r, vec3r};
import package::math::constants::{PI, TWO_PI};
import package::math::elementary::{sine, cosine};

// All directions are local: z along the shading normal, pointing to the side of the outgoing direction.

/// GGX (Trowbridge-Reitz) density of microfacet normals, per sr of the microfacet normal (Walter et al. 2007, eq. 33).
/// Written with the slopes of `half_vector`, so that no 1 - cos^2 cancels for small `alpha`.
fn ggx_distribution(half_vector: vec3r, alpha: real) -> real {
    let slope = half_vector.xy / alpha;
    let stretched = dot(slope, slope) + half_vector.z * half_vector.z;
    return 1.0 / (PI * alpha * alpha * stretched * stretched);
}

/// sqrt(alpha^2 sin^2 + cos^2) of a direction: |cos| (1 + 2 Lambda) in Smith's model (Heitz 2014, eq. 72).
fn smith_length(direction: vec3r, alpha: real) -> real {
    return length(vec3r(alpha * direction.xy, direction.z));
}

/// G1(w) / |cos w| = 2 / (|cos| + sqrt(alpha^2 sin^2 + cos^2)), Smith's masking without its vanishing denominator
/// (Heitz 2014, eq. 43). Finite at grazing angles.
fn smith_masking_over_cosine(direction: vec3r, alpha: real) -> real {
    return 2.0 / (abs(direction.z) + smith_length(direction, alpha));
}

/// D G2 / (4 cos_o cos_i), per sr: a GGX reflection lobe without its Fresnel term, height-correlated Smith G2
/// (Heitz 2014, eq. 99). Both directions above the surface; symmetric in them.
fn ggx_reflection(outgoing: vec3r, incoming: vec3r, half_vector: vec3r, alpha: real) -> real {
    let shadowing = outgoing.z * smith_length(incoming, alpha) + incoming.z * smith_length(outgoing, alpha);
    return ggx_distribution(half_vector, alpha) / (2.0 * shadowing);
}

/// Density, per sr of the reflected direction, of reflecting `outgoing` at a normal drawn by `sample_visible_normal`:
/// G1 D / (4 cos_o) (Heitz 2018, eq. 17).
fn pdf_ggx_reflection(outgoing: vec3r, half_vector: vec3r, alpha: real) -> real {
    return 0.25 * smith_masking_over_cosine(outgoing, alpha) * ggx_distribution(half_vector, alpha);
}

/// A microfacet normal as seen from `outgoing`, with density G1 D max(0, o.h) / cos_o per sr, by spherical caps
/// (Dupuy & Benyoub 2023, listing 3).
fn sample_visible_normal(outgoing: vec3r, alpha: real, random: vec2r) -> vec3r {
    let stretched = normalize(vec3r(alpha * outgoing.xy, outgoing.z));
    let lift = (1.0 - random.y) * (1.0 + stretched.z);
    let height = lift - stretched.z;
    let radius = sqrt(clamp(1.0 - height * height, 0.0, 1.0));
    let angle = TWO_PI * random.x;
    let cap = vec2r(radius * cosine(angle), radius * sine(angle));
    // The height of the half vector is `height + stretched.z`, which is `lift` without the cancellation.
    return normalize(vec3r(alpha * (cap + stretched.xy), lift));
}
