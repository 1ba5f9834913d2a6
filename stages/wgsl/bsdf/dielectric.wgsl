//! The interface of a solid dielectric (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces").

import package::real::{real, vec2r, vec3r};
import package::bsdf::fresnel::{fresnel_dielectric, transmitted_cosine};
import package::bsdf::ggx::{ggx_distribution, ggx_reflection, pdf_ggx_reflection, sample_visible_normal, smith_masking_over_cosine};

// The interface of a solid dielectric. Directions are local, z on the side of the outgoing direction;
// eta = index of the far side / index of the outgoing side.

/// A lobe's value without tint: `f` in 1/sr (radiance: includes 1/eta^2 for transmission) and `pdf` in 1/sr.
struct GlassLobe {
    f: real,
    pdf: real,
}

/// Microfacet normal, on the outgoing side, that joins the two directions by reflection or refraction
/// (Walter et al. 2007, eqs. 13 and 16).
fn dielectric_half_vector(outgoing: vec3r, incoming: vec3r, eta: real) -> vec3r {
    var sum = outgoing + incoming;
    if incoming.z < 0.0 {
        sum = outgoing + eta * incoming;
    }
    return normalize(select(sum, -sum, sum.z < 0.0));
}

/// Rough dielectric interface: Walter et al. 2007, eqs. 20 and 21 (for radiance), reflection with the height-correlated
/// Smith G2, transmission with the separable one (eq. 23). The pdf is that of `sample_rough_dielectric`.
fn rough_dielectric(outgoing: vec3r, incoming: vec3r, alpha: real, eta: real) -> GlassLobe {
    let half_vector = dielectric_half_vector(outgoing, incoming, eta);
    let outgoing_dot = dot(outgoing, half_vector);
    let incoming_dot = dot(incoming, half_vector);
    // Back-facing microfacets are not visible (Walter et al. 2007, eq. 23).
    if outgoing_dot <= 0.0 || incoming_dot * incoming.z <= 0.0 {
        return GlassLobe(0.0, 0.0);
    }
    let reflectance = fresnel_dielectric(outgoing_dot, eta);
    if incoming.z > 0.0 {
        return GlassLobe(
            reflectance * ggx_reflection(outgoing, incoming, half_vector, alpha),
            reflectance * pdf_ggx_reflection(outgoing, half_vector, alpha),
        );
    }
    let denominator = outgoing_dot + eta * incoming_dot;
    let outgoing_masking = smith_masking_over_cosine(outgoing, alpha);
    let common_factor = (1.0 - reflectance) * ggx_distribution(half_vector, alpha) * outgoing_masking
        * outgoing_dot * -incoming_dot / (denominator * denominator);
    return GlassLobe(
        common_factor * smith_masking_over_cosine(incoming, alpha),
        common_factor * eta * eta,
    );
}

/// Samples a direction at a rough dielectric: a visible microfacet, then reflection with probability F and
/// refraction with 1 - F (`choice` in [0,1)). The result lies on the wrong side when the microfacet sends it there.
fn sample_rough_dielectric(outgoing: vec3r, alpha: real, eta: real, random: vec2r, choice: real) -> vec3r {
    let half_vector = sample_visible_normal(outgoing, alpha, random);
    let outgoing_dot = dot(outgoing, half_vector);
    if choice < fresnel_dielectric(outgoing_dot, eta) {
        let reflected = 2.0 * outgoing_dot * half_vector - outgoing;
        return select(vec3r(0.0), reflected, reflected.z > 0.0);
    }
    let refracted = (outgoing_dot / eta - transmitted_cosine(outgoing_dot, eta)) * half_vector - outgoing / eta;
    return select(vec3r(0.0), refracted, refracted.z < 0.0);
}

/// Direction of the ray refracted by a smooth interface (Snell's law). Only below the critical angle.
fn refract_smooth(outgoing: vec3r, eta: real) -> vec3r {
    return vec3r(outgoing.xy * (-1.0 / eta), -transmitted_cosine(outgoing.z, eta));
}
