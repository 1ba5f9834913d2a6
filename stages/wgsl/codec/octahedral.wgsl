//! Unit vectors as points of a square: the octahedron |x| + |y| + |z| = 1, its lower half folded outwards (Meyer et al. 2010, "On
//! Floating-Point Normal Vectors"). Grids have their middle on 0, so that the axes are kept exactly.

import package::real::{real, vec2r, vec3r};

/// Point of the square [-1,1]^2 for a unit vector.
fn octahedral(v: vec3r) -> vec2r {
    let projected = v.xy / max(abs(v.x) + abs(v.y) + abs(v.z), 1.0e-30);
    if v.z >= 0.0 {
        return projected;
    }
    return folded(projected);
}

/// The unit vector of a point of the square.
fn from_octahedral(point: vec2r) -> vec3r {
    let z = 1.0 - abs(point.x) - abs(point.y);
    return normalize(vec3r(select(point, folded(point), z < 0.0), z));
}

/// Mirrors a point at the edge |x| + |y| = 1.
fn folded(point: vec2r) -> vec2r {
    return (1.0 - abs(point.yx)) * select(vec2r(-1.0), vec2r(1.0), point >= vec2r(0.0));
}

/// Whole numbers from 0 to 2 * `half` for the point; `half` is the middle.
fn grid_point(point: vec2r, half: real) -> vec2u {
    return vec2u(clamp(round((point + 1.0) * half), vec2r(0.0), vec2r(2.0 * half)));
}

/// The point of whole numbers.
fn point_of_grid(grid: vec2u, half: real) -> vec2r {
    return vec2r(grid) / half - 1.0;
}
