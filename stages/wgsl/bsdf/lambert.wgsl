//! Diffuse reflection, bare and under a coat.

import package::real::{real, vec3r};
import package::math::constants::INVERSE_PI;
import package::bsdf::fresnel::schlick_weight;

/// Reciprocal diffuse lobe under a reflecting coat, per sr: albedo / pi without a coat, else
/// albedo (1 - F(o)) (1 - F(i)) / (pi (1 - F_mean)), so that its directional albedo is albedo * (1 - F(o)) exactly
/// (Shirley et al. 1997, eq. 5; F_mean is the cosine-weighted mean of Schlick's F). The glTF layering
/// "base below a Fresnel-weighted layer", made energy conserving. `coat_f0`, `coat_f90` are scalars of the coat.
fn coated_diffuse(albedo: vec3r, coat_f0: real, coat_f90: real, outgoing_cosine: real, incoming_cosine: real) -> vec3r {
    let passed = coat_transmittance(coat_f0, coat_f90, outgoing_cosine) * coat_transmittance(coat_f0, coat_f90, incoming_cosine);
    let mean = 1.0 - (coat_f0 + (coat_f90 - coat_f0) / 21.0);
    return albedo * (INVERSE_PI * passed / max(mean, 1e-6));
}

/// 1 - F of the coat above the diffuse base at this cosine, by Schlick.
fn coat_transmittance(coat_f0: real, coat_f90: real, cosine: real) -> real {
    return 1.0 - (coat_f0 + (coat_f90 - coat_f0) * schlick_weight(cosine));
}

/// Lambert's law: albedo / pi, per sr.
fn lambert(albedo: vec3r) -> vec3r {
    return albedo * INVERSE_PI;
}
