//! Unit vectors in 32 bits.

import package::real::vec3r;
import package::codec::octahedral::{from_octahedral, grid_point, octahedral, point_of_grid};

/// Two numbers of 16 bits.
fn encode_oct32(v: vec3r) -> u32 {
    let grid = grid_point(octahedral(v), 32767.0);
    return grid.x | (grid.y << 16u);
}

/// The unit vector nearly as it was.
fn decode_oct32(bits: u32) -> vec3r {
    return from_octahedral(point_of_grid(vec2u(bits & 0xffffu, bits >> 16u), 32767.0));
}
