//! Lights without extent, and skies.

use super::Edit;

/// All of this module.
pub const EDITS: &[Edit] = &[SPOT_FALLOFF, SKY_ROWS];

/// spot.cpp, falloff_curve: linear in the angle between beam width and cutoff. The script keeps the beam width below 0.999 of the
/// cutoff. KHR_lights_punctual squares a ramp that is linear in the cosine.
const SPOT_FALLOFF: Edit = Edit {
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

/// envmap.cpp, eval: rows are interpolated at v (height - 1), so that the first and the last lie on the poles. Here the first and the
/// last row lie half a texel from the poles, as pixels of a picture do. Columns agree: half a texel from the edge in both. Directions
/// are drawn by the texels of this renderer's rows, which changes the noise alone.
const SKY_ROWS: Edit = Edit {
    module: "light/sky",
    old: "    let place = uv * vec2r(size) - vec2r(0.5);\n",
    new: "    let place = vec2r(uv.x * real(size.x) - 0.5, uv.y * real(size.y - 1));\n",
};
