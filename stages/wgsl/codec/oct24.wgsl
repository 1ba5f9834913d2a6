//! Unit vectors in 24 bits.

import package::real::vec3r;
import package::codec::octahedral::{from_octahedral, grid_point, octahedral, point_of_grid};

/// Two numbers of 12 bits.
fn encode_oct24(v: vec3r) -> u32 {
    let grid = grid_point(octahedral(v), 2047.0);
    return grid.x | (grid.y << 12u);
}

/// The unit vector nearly as it was.
fn decode_oct24(bits: u32) -> vec3r {
    return from_octahedral(point_of_grid(vec2u(bits & 0xfffu, bits >> 12u), 2047.0));
}
