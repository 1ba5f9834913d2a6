//! Reflectance of interfaces.

import package::real::{real, vec3r};

/// Reflectance of a smooth dielectric interface for unpolarised light (Fresnel's equations), dimensionless in [0,1].
/// `cosine` >= 0 is taken on the incident side; `eta` = index of the transmitted side / index of the incident side.
/// 1 beyond the critical angle.
fn fresnel_dielectric(cosine: real, eta: real) -> real {
    let transmitted = transmitted_cosine(cosine, eta);
    if transmitted <= 0.0 {
        return 1.0;
    }
    let perpendicular = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    let parallel = (eta * cosine - transmitted) / (eta * cosine + transmitted);
    return 0.5 * (perpendicular * perpendicular + parallel * parallel);
}

/// Cosine of the angle of refraction by Snell's law, 0 beyond the critical angle. Arguments as `fresnel_dielectric`.
fn transmitted_cosine(cosine: real, eta: real) -> real {
    let sine_squared = max(1.0 - cosine * cosine, 0.0) / (eta * eta);
    return sqrt(max(1.0 - sine_squared, 0.0));
}

/// Schlick's approximation between `f0` (normal incidence) and `f90` (grazing), per channel (Schlick 1994;
/// glTF 2.0 appendix B.3.4, KHR_materials_specular). `cosine` in [0,1].
fn fresnel_schlick(f0: vec3r, f90: real, cosine: real) -> vec3r {
    return f0 + (vec3r(f90) - f0) * schlick_weight(cosine);
}

/// (1 - cosine)^5, the share of `f90` in Schlick's approximation.
fn schlick_weight(cosine: real) -> real {
    let rest = clamp(1.0 - cosine, 0.0, 1.0);
    let square = rest * rest;
    return square * square * rest;
}
