//! What next-event estimation draws: a point or a direction from which a light shines on a surface.

import package::real::{real, vec3r};
import package::features::{HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SPOT_LIGHT};
import package::surface::spawn::Segment;

/// A sampled light direction. Its density per sr, pick probability included, is `density / cosine`: kept apart so that
/// contributions need no division by a squared distance or a small cosine.
struct LightSample {
    /// Unit, from the surface to the light.
    direction: vec3r,
    /// Radiance in W/(m2 sr) of triangles and sky, intensity in W/sr of point and spot lights, irradiance in W/m2
    /// across the beam of directional lights.
    radiance: vec3r,
    /// Triangle: pick/area * distance^2; point, spot: pick * distance^2; directional: pick; sky: density * sin(theta).
    density: real,
    /// Triangle: |cosine| at the light; sky: sin(theta) of the direction; else 1.
    cosine: real,
    /// The light has no extent: no other strategy can hit it.
    delta: bool,
    /// What has to be free for the light to be seen.
    segment: Segment,
}

/// Density of the direction per sr, 0 for lights without extent, which no density in solid angle describes.
fn light_sample_pdf_w(light: LightSample) -> real {
    if HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT {
        if light.delta {
            return 0.0;
        }
    }
    return light.density / light.cosine;
}
