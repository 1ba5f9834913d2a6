//! What light walks start with.

import package::real::vec3r;

/// The first ray of a light walk.
struct Emission {
    /// On the light, off its surface; for lights at infinity outside the scene's bounds.
    origin: vec3r,
    /// Direction of flight, unit.
    direction: vec3r,
    /// Emitted power per density: Le cos / pdf, in W (0: the walk ends).
    throughput: vec3r,
}
