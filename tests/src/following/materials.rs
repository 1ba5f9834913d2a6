//! What materials scatter.

use super::Edit;

/// All of this module.
pub const EDITS: &[Edit] = &[SEPARABLE_MASKING, COAT_SHARE_FIELD, COAT_SHARE, COAT_FRESNEL, BURLEY_LOBE, BURLEY_CALL];

/// microfacet.h, G: the product of the two Smith terms, in all rough materials. Here reflection has the height-correlated G2
/// (docs/conventions.md).
const SEPARABLE_MASKING: Edit = Edit {
    module: "bsdf/ggx",
    old: "    let shadowing = outgoing.z * smith_length(incoming, alpha) + incoming.z * smith_length(outgoing, alpha);
    return ggx_distribution(half_vector, alpha) / (2.0 * shadowing);
",
    new: "    let masking = smith_masking_over_cosine(outgoing, alpha) * smith_masking_over_cosine(incoming, alpha);
    return 0.25 * masking * ggx_distribution(half_vector, alpha);
",
};

/// A place for the coat's share, see COAT_FRESNEL.
const COAT_SHARE_FIELD: Edit = Edit {
    module: "bsdf/bsdf",
    old: "    coat_f0: real,\n    coat_f90: real,\n",
    new: "    coat_f0: real,\n    coat_f90: real,\n    coat_share: real,\n",
};

/// The coat's share of the material, see COAT_FRESNEL.
const COAT_SHARE: Edit = Edit {
    module: "bsdf/bsdf",
    old: "        bsdf.coat_f90 = material.specular;\n",
    new: "        bsdf.coat_f90 = material.specular;\n        bsdf.coat_share = share;\n",
};

/// principledhelpers.h, principled_fresnel: Fresnel's equations for the dielectric part, of the index that gives the reflectance at
/// normal incidence; Schlick's approximation for metals alone. Here coats have Schlick's approximation, as glTF 2.0 appendix B has.
const COAT_FRESNEL: Edit = Edit {
    module: "bsdf/bsdf",
    old: "        let fresnel = fresnel_schlick(bsdf.specular_f0, bsdf.specular_f90, dot(outgoing, half_vector));
        sum.f +=",
    new: "        let cosine = dot(outgoing, half_vector);
        let root = sqrt(bsdf.coat_f0);
        let approximate = fresnel_schlick(vec3r(bsdf.coat_f0), bsdf.coat_f90, cosine);
        let exact = vec3r(fresnel_dielectric(cosine, (1.0 + root) / (1.0 - root)));
        let fresnel = fresnel_schlick(bsdf.specular_f0, bsdf.specular_f90, cosine) + bsdf.coat_share * (exact - approximate);
        sum.f +=",
};

/// principled.cpp, eval: the diffuse and the retro-reflecting lobe of Burley 2015, section 4.2, unchanged by the coat. Here light
/// passes the coat twice (Shirley et al. 1997, docs/conventions.md).
const BURLEY_LOBE: Edit = Edit {
    module: "bsdf/lambert",
    old: "fn coated_diffuse(albedo: vec3r, coat_f0: real, coat_f90: real, outgoing_cosine: real, incoming_cosine: real) -> vec3r {
    let passed = coat_transmittance(coat_f0, coat_f90, outgoing_cosine) * coat_transmittance(coat_f0, coat_f90, incoming_cosine);
    let mean = 1.0 - (coat_f0 + (coat_f90 - coat_f0) / 21.0);
    return albedo * (INVERSE_PI * passed / max(mean, 1e-6));
",
    new: "fn coated_diffuse(albedo: vec3r, alpha: real, between: real, outgoing_cosine: real, incoming_cosine: real) -> vec3r {
    let outgoing = schlick_weight(outgoing_cosine);
    let incoming = schlick_weight(incoming_cosine);
    let retro = sqrt(alpha) * (1.0 + between);
    let diffuse = (1.0 - 0.5 * outgoing) * (1.0 - 0.5 * incoming);
    return albedo * (INVERSE_PI * (diffuse + retro * (outgoing + incoming + outgoing * incoming * (retro - 1.0))));
",
};

/// What BURLEY_LOBE needs; materials without a coat are `diffuse`.
const BURLEY_CALL: Edit = Edit {
    module: "bsdf/bsdf",
    old: "        if HAS_SPECULAR {
            sum.f = coated_diffuse(bsdf.diffuse, bsdf.coat_f0, bsdf.coat_f90, outgoing.z, incoming.z);
",
    new: "        if HAS_SPECULAR && bsdf.coat_f90 > 0.0 {
            sum.f = coated_diffuse(bsdf.diffuse, bsdf.alpha, dot(outgoing, incoming), outgoing.z, incoming.z);
",
};
