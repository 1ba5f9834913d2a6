//! Ray data for tests against axis-aligned boxes.

/// Rounding bound of a slab distance, relative to its larger term: 2^-21.
const SLAB_TOLERANCE: f32 = 4.76837158203125e-7;
/// Smallest magnitude of a direction component in slab tests, 2^-80: its reciprocal times any coordinate below 2^40 stays finite.
const SMALLEST_DIRECTION: f32 = 8.271806125530277e-25;

/// A ray made ready for slab tests.
struct SlabRay {
    origin: vec3f,
    /// Reciprocal direction, finite.
    inverse: vec3f,
    negative: vec3<bool>,
    /// Octant as a visiting order of child slots, in each of four bytes.
    order: u32,
}

/// Reciprocal of a direction; components too small to divide by keep their sign and get the magnitude SMALLEST_DIRECTION, so that
/// no product with a coordinate is infinite or not a number.
fn finite_reciprocal(direction: vec3f) -> vec3f {
    let smallest = select(vec3f(SMALLEST_DIRECTION), vec3f(-SMALLEST_DIRECTION), direction < vec3f(0.0));
    return 1.0 / select(direction, smallest, abs(direction) < vec3f(SMALLEST_DIRECTION));
}

/// Ray data that stay the same during one traversal.
fn slab_ray(origin: vec3f, direction: vec3f) -> SlabRay {
    var ray: SlabRay;
    ray.origin = origin;
    ray.inverse = finite_reciprocal(direction);
    ray.negative = direction < vec3f(0.0);
    ray.order = select(0x04040404u, 0u, ray.negative.x) | select(0x02020202u, 0u, ray.negative.y) | select(0x01010101u, 0u, ray.negative.z);
    return ray;
}
