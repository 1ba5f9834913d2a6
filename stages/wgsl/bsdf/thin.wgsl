//! Thin sheets of glass.

import package::real::{real, vec2r, vec3r};
import package::bsdf::fresnel::fresnel_dielectric;
import package::bsdf::ggx::{ggx_reflection, pdf_ggx_reflection, sample_visible_normal};
import package::bsdf::dielectric::GlassLobe;

// A thin sheet: two parallel interfaces without thickness. Light passes straight, the index is the same on both sides,
// so transmission carries no factor between radiance and importance.

/// Reflectance of the sheet with all its inner reflections, 2R / (1 + R) (Stokes 1862), R that of one interface.
fn thin_reflectance(cosine: real, ior: real) -> real {
    let once = fresnel_dielectric(cosine, ior);
    return 2.0 * once / (1.0 + once);
}

/// Rough sheet: a GGX reflection lobe and its mirror image below the surface, weighted by the sheet's reflectance
/// and transmittance at the microfacet (KHR_materials_transmission). Untinted; `pdf` is that of `sample_rough_thin`.
fn rough_thin(outgoing: vec3r, incoming: vec3r, alpha: real, ior: real) -> GlassLobe {
    let mirrored = vec3r(incoming.xy, abs(incoming.z));
    let half_vector = normalize(outgoing + mirrored);
    let reflectance = thin_reflectance(dot(outgoing, half_vector), ior);
    let share = select(1.0 - reflectance, reflectance, incoming.z > 0.0);
    return GlassLobe(
        share * ggx_reflection(outgoing, mirrored, half_vector, alpha),
        share * pdf_ggx_reflection(outgoing, half_vector, alpha),
    );
}

/// Samples a direction at a rough sheet: a visible microfacet, reflection with the sheet's reflectance as probability,
/// else the reflection's mirror image (`choice` in [0,1)). Zero when the microfacet sends it below the surface.
fn sample_rough_thin(outgoing: vec3r, alpha: real, ior: real, random: vec2r, choice: real) -> vec3r {
    let half_vector = sample_visible_normal(outgoing, alpha, random);
    let outgoing_dot = dot(outgoing, half_vector);
    let reflected = 2.0 * outgoing_dot * half_vector - outgoing;
    if reflected.z <= 0.0 {
        return vec3r(0.0);
    }
    let transmitted = vec3r(reflected.xy, -reflected.z);
    return select(transmitted, reflected, choice < thin_reflectance(outgoing_dot, ior));
}
