//! Conventions of the other renderer that stages decide.

/// A change of a module: `old`, which stands in it once, becomes `new`.
#[derive(Clone, Copy, Debug)]
pub struct Edit {
    /// Why, and where the convention comes from.
    pub why: &'static str,
    /// Key of the module.
    pub module: &'static str,
    /// What this renderer does.
    pub old: &'static str,
    /// What the other one does.
    pub new: &'static str,
}

/// All of them, taken over at once.
pub const EDITS: &[Edit] = &[
    SPOT_FALLOFF,
    SKY_ROWS,
    SEPARABLE_MASKING,
    COAT_SHARE_FIELD,
    COAT_SHARE,
    COAT_FRESNEL,
    BURLEY_LOBE,
    BURLEY_CALL,
    SIDE_OF_SCATTERING,
    NO_OPPOSED_NORMALS,
    SIDE_OF_SURFACE_LATER,
    SIDE_OF_SURFACE,
    SIDE_OF_LAMP,
    COSINE_OF_LAMP,
    COSINE_OF_MET_LAMP,
];

/// KHR_lights_punctual squares a ramp that is linear in the cosine.
const SPOT_FALLOFF: Edit = Edit {
    why: "spot.cpp, falloff_curve: linear in the angle between beam width and cutoff. The script keeps the beam width below 0.999 of \
          the cutoff.",
    module: "light/point_light",
    old: "    let ramp = clamp((cosine - cosine_outer) / max(cosine_inner - cosine_outer, 1e-6), 0.0, 1.0);
    return ramp * ramp;
",
    new: "    let angle = atan2(sqrt(max(1.0 - cosine * cosine, 0.0)), cosine);
    let cutoff = atan2(sqrt(max(1.0 - cosine_outer * cosine_outer, 0.0)), cosine_outer);
    let beam = atan2(sqrt(max(1.0 - cosine_inner * cosine_inner, 0.0)), cosine_inner);
    return clamp((cutoff - angle) / max(cutoff - beam, 0.001 * cutoff), 0.0, 1.0);
",
};

/// Here the first and the last row lie half a texel from the poles, as pixels of a picture do. Columns agree: half a texel from the
/// edge in both. Directions are drawn by the texels of this renderer's rows, which changes the noise alone.
const SKY_ROWS: Edit = Edit {
    why: "envmap.cpp, eval: rows are interpolated at v (height - 1), so that the first and the last lie on the poles.",
    module: "light/sky",
    old: "    let place = uv * vec2r(size) - vec2r(0.5);\n",
    new: "    let place = vec2r(uv.x * real(size.x) - 0.5, uv.y * real(size.y - 1));\n",
};

/// Here reflection has the height-correlated G2 (docs/conventions.md).
const SEPARABLE_MASKING: Edit = Edit {
    why: "microfacet.h, G: the product of the two Smith terms, in all rough materials.",
    module: "bsdf/ggx",
    old: "    let shadowing = outgoing.z * smith_length(incoming, alpha) + incoming.z * smith_length(outgoing, alpha);
    return ggx_distribution(half_vector, alpha) / (2.0 * shadowing);
",
    new: "    let masking = smith_masking_over_cosine(outgoing, alpha) * smith_masking_over_cosine(incoming, alpha);
    return 0.25 * masking * ggx_distribution(half_vector, alpha);
",
};

const COAT_SHARE_FIELD: Edit = Edit {
    why: "A place for the coat's share, see COAT_FRESNEL.",
    module: "bsdf/bsdf",
    old: "    coat_f0: real,\n    coat_f90: real,\n",
    new: "    coat_f0: real,\n    coat_f90: real,\n    coat_share: real,\n",
};

const COAT_SHARE: Edit = Edit {
    why: "The coat's share of the material, see COAT_FRESNEL.",
    module: "bsdf/bsdf",
    old: "        bsdf.coat_f90 = material.specular;\n",
    new: "        bsdf.coat_f90 = material.specular;\n        bsdf.coat_share = share;\n",
};

/// Here coats have Schlick's approximation, as glTF 2.0 appendix B has.
const COAT_FRESNEL: Edit = Edit {
    why: "principledhelpers.h, principled_fresnel: Fresnel's equations for the dielectric part, of the index that gives the \
          reflectance at normal incidence; Schlick's approximation for metals alone.",
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

/// Here light passes the coat twice (Shirley et al. 1997, docs/conventions.md).
const BURLEY_LOBE: Edit = Edit {
    why: "principled.cpp, eval: the diffuse and the retro-reflecting lobe of Burley 2015, section 4.2, unchanged by the coat.",
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

const BURLEY_CALL: Edit = Edit {
    why: "What BURLEY_LOBE needs; materials without a coat are `diffuse`.",
    module: "bsdf/bsdf",
    old: "        if HAS_SPECULAR {
            sum.f = coated_diffuse(bsdf.diffuse, bsdf.coat_f0, bsdf.coat_f90, outgoing.z, incoming.z);
",
    new: "        if HAS_SPECULAR && bsdf.coat_f90 > 0.0 {
            sum.f = coated_diffuse(bsdf.diffuse, bsdf.alpha, dot(outgoing, incoming), outgoing.z, incoming.z);
",
};

/// Here the triangle decides, so that nothing shines through a closed surface (docs/conventions.md).
const SIDE_OF_SCATTERING: Edit = Edit {
    why: "All materials see directions in the shading frame alone (Frame3f::cos_theta).",
    module: "bsdf/bsdf",
    old: "dot(outgoing, surface.geometric_normal) >= 0.0);\n    var bsdf: Bsdf;",
    new: "dot(outgoing, surface.shading_normal) >= 0.0);\n    var bsdf: Bsdf;",
};

/// Here directions on which the two normals disagree scatter nothing.
const NO_OPPOSED_NORMALS: Edit = Edit {
    why: "As SIDE_OF_SCATTERING: no material asks for the geometric normal.",
    module: "bsdf/bsdf",
    old: "        let incoming_geometric = dot(incoming, bsdf.facing_normal);
        return dot(outgoing, bsdf.facing_normal) >= GRAZING_COSINE
            && abs(incoming_geometric) >= GRAZING_COSINE
            && incoming_geometric * incoming_cosine > 0.0;
",
    new: "        return true;\n",
};

const SIDE_OF_SURFACE_LATER: Edit = Edit {
    why: "Makes room for SIDE_OF_SURFACE.",
    module: "surface/surface",
    old: "    surface.front = dot(surface.geometric_normal, observer) >= 0.0;\n",
    new: "",
};

/// Here a triangle emits where its own front is seen.
const SIDE_OF_SURFACE: Edit = Edit {
    why: "area.cpp, eval: emission where the direction lies above the interpolated normal (before normal maps).",
    module: "surface/surface",
    old: "        surface.shading_normal = interpolated_normal(prim, barycentric, surface.geometric_normal);\n    }\n",
    new: "        surface.shading_normal = interpolated_normal(prim, barycentric, surface.geometric_normal);\n    }
    surface.front = dot(surface.shading_normal, observer) >= 0.0;\n",
};

const SIDE_OF_LAMP: Edit = Edit {
    why: "area.cpp, sample_direction: as SIDE_OF_SURFACE, for sampled points.",
    module: "light/triangle_light",
    old: "    let span = point.position - receiver.position;
    point.front = dot(point.geometric_normal, span) < 0.0;
    let distance_squared",
    new: "    let span = point.position - receiver.position;
    point.front = dot(point.shading_normal, span) < 0.0;
    let distance_squared",
};

const COSINE_OF_LAMP: Edit = Edit {
    why: "mesh.cpp, sample_position and shape.cpp, sample_direction: the cosine at a point of a lamp is that of the interpolated normal.",
    module: "light/triangle_light",
    old: "    sample.cosine = abs(dot(point.geometric_normal, sample.direction));\n",
    new: "    sample.cosine = abs(dot(point.shading_normal, sample.direction));\n",
};

const COSINE_OF_MET_LAMP: Edit = Edit {
    why: "shape.cpp, pdf_direction: as COSINE_OF_LAMP, for points that a ray has met.",
    module: "light/light",
    old: "distance * distance / abs(dot(emitter.geometric_normal, direction));",
    new: "distance * distance / max(abs(dot(emitter.shading_normal, direction)), 1e-20);",
};
