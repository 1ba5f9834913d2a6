//! Uniform points on a triangle.

import package::real::vec2r;

/// Barycentric coordinates (weights of the second and third vertex) of a point uniform in area (Heitz 2019, "A Low-Distortion Map").
fn sample_triangle(random: vec2r) -> vec2r {
    if random.y > random.x {
        let first = 0.5 * random.x;
        return vec2r(first, random.y - first);
    }
    let second = 0.5 * random.y;
    return vec2r(random.x - second, second);
}
