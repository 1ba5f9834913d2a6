//! What light walks start with.

import package::real::{real, vec2r, vec3r};
import package::surface::spawn::Segment;

/// y_1, the first vertex of a light walk: a point on a light, or for lights at infinity a direction. What is stored between the
/// steps of a walk is `light`, `place`, `direction` and `throughput`.
struct LightVertex {
    light: u32,
    /// Weights of the second and third vertex of an emissive triangle.
    place: vec2r,
    /// Direction of flight of light from the sky, unit.
    direction: vec3r,
    /// Triangle: Le / p_A; point, spot: intensity on the axis / p_pick; directional: irradiance / p_pick; sky: L / p_env.
    throughput: vec3r,
    /// p_A of triangles (per m2), p_env of the sky (per sr), pick probability included; 0 for lights without extent, which no eye walk hits.
    pdf: real,
}

/// The first ray of a light walk.
struct Emission {
    /// On the light, off its surface; for lights at infinity outside the scene's bounds.
    origin: vec3r,
    /// Direction of flight, unit.
    direction: vec3r,
    /// Factor on the vertex's throughput: emission cosine or falloff over `pdf` (0: the walk ends).
    weight: vec3r,
    /// Density of the direction per sr; for lights at infinity that of the origin on the disk, per m2.
    pdf: real,
    /// |cosine| of the direction at the light; 1 for points and lights at infinity.
    cosine: real,
    /// The light is at infinity: the distance to the next vertex does not matter.
    parallel: bool,
}

/// The first vertex of a light walk, seen from a receiver.
struct LightEnd {
    /// Unit, from the receiver to the light.
    direction: vec3r,
    /// Factor on the vertex's throughput: |cosine| on an emitting side, falloff of a spot, else 1.
    value: vec3r,
    /// Squared distance, m2; 1 for lights at infinity.
    distance_squared: real,
    /// |cosine| at the light; 1 for points and lights at infinity.
    cosine: real,
    /// Density with which emission takes the way to the receiver, as `Emission::pdf`.
    pdf: real,
    /// What has to be free.
    segment: Segment,
}
