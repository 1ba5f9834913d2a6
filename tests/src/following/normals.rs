//! Which side of a surface a direction is on, where interpolated normals leave the triangle's.

use super::Edit;

/// All of this module.
pub const EDITS: &[Edit] = &[
    SIDE_OF_SCATTERING,
    NO_OPPOSED_NORMALS,
    SIDE_OF_SURFACE_LATER,
    SIDE_OF_SURFACE,
    SIDE_OF_LAMP,
    COSINE_OF_LAMP,
    COSINE_OF_MET_LAMP,
];

/// All materials see directions in the shading frame alone (Frame3f::cos_theta). Here the triangle decides, so that nothing shines
/// through a closed surface (docs/conventions.md).
const SIDE_OF_SCATTERING: Edit = Edit {
    module: "bsdf/bsdf",
    old: "dot(outgoing, surface.geometric_normal) >= 0.0);\n    var bsdf: Bsdf;",
    new: "dot(outgoing, surface.shading_normal) >= 0.0);\n    var bsdf: Bsdf;",
};

/// As SIDE_OF_SCATTERING: no material asks for the geometric normal. Here directions on which the two normals disagree scatter
/// nothing.
const NO_OPPOSED_NORMALS: Edit = Edit {
    module: "bsdf/bsdf",
    old: "        let incoming_geometric = dot(incoming, bsdf.facing_normal);
        return dot(outgoing, bsdf.facing_normal) >= GRAZING_COSINE
            && abs(incoming_geometric) >= GRAZING_COSINE
            && incoming_geometric * incoming_cosine > 0.0;
",
    new: "        return true;\n",
};

/// Makes room for SIDE_OF_SURFACE.
const SIDE_OF_SURFACE_LATER: Edit = Edit {
    module: "surface/surface",
    old: "    surface.front = dot(surface.geometric_normal, observer) >= 0.0;\n",
    new: "",
};

/// area.cpp, eval: emission where the direction lies above the interpolated normal (before normal maps). Here a triangle emits where
/// its own front is seen.
const SIDE_OF_SURFACE: Edit = Edit {
    module: "surface/surface",
    old: "        surface.shading_normal = interpolated_normal(prim, barycentric, surface.geometric_normal);\n    }\n",
    new: "        surface.shading_normal = interpolated_normal(prim, barycentric, surface.geometric_normal);\n    }
    surface.front = dot(surface.shading_normal, observer) >= 0.0;\n",
};

/// area.cpp, sample_direction: as SIDE_OF_SURFACE, for sampled points.
const SIDE_OF_LAMP: Edit = Edit {
    module: "light/triangle_light",
    old: "    let span = point.position - receiver.position;
    point.front = dot(point.geometric_normal, span) < 0.0;
    let distance_squared",
    new: "    let span = point.position - receiver.position;
    point.front = dot(point.shading_normal, span) < 0.0;
    let distance_squared",
};

/// mesh.cpp, sample_position and shape.cpp, sample_direction: the cosine at a point of a lamp is that of the interpolated normal.
const COSINE_OF_LAMP: Edit = Edit {
    module: "light/triangle_light",
    old: "    sample.cosine = abs(dot(point.geometric_normal, sample.direction));\n",
    new: "    sample.cosine = abs(dot(point.shading_normal, sample.direction));\n",
};

/// shape.cpp, pdf_direction: as COSINE_OF_LAMP, for points that a ray has met.
const COSINE_OF_MET_LAMP: Edit = Edit {
    module: "light/light",
    old: "distance * distance / abs(dot(emitter.geometric_normal, direction));",
    new: "distance * distance / max(abs(dot(emitter.shading_normal, direction)), 1e-20);",
};
