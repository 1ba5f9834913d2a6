//! Which random numbers are for what: `random4(walk, vertex, dimension)`. Vertices count from the camera (0) on eye walks
//! and from the emitter (1) on light walks; the two walks never share a number. A vertex is a key below 2^20: a pipeline with several
//! walks of a kind for each path adds to it which of them it is.
//!
//! | walk, vertex           | dimension            | x, y                          | z, w                        |
//! |------------------------|----------------------|-------------------------------|-----------------------------|
//! | any, surface           | DIMENSION_SCATTER    | direction                     | lobe, survival              |
//! | eye, surface           | DIMENSION_LIGHT      | place on the light            | choice of the light         |
//! | eye, surface           | DIMENSION_SKY        | row, column of the sky's texel | threshold, -               |
//! | eye, camera            | DIMENSION_EMIT       | raster                        | lens                        |
//! | light, emitter         | DIMENSION_EMIT       | place on the light            | choice of the light         |
//! | light, emitter         | DIMENSION_DIRECTION  | direction, or place on the disk | side of a triangle, -     |
//! | light, emitter         | DIMENSION_SKY        | row, column of the sky's texel | threshold, -               |
//! | light, surface         | DIMENSION_CHOICE     | lens                          | eye walk or none, -         |

import package::real::vec4r;
import package::features::HAS_SKY;
import package::random::random4;

const DIMENSION_SKY: u32 = 4u;
const DIMENSION_DIRECTION: u32 = 5u;

/// Key of vertex x_s of the eye walk that belongs to light vertex y_t; of the first one it is s, as in pipelines with one eye walk.
fn eye_vertex(s: u32, t: u32) -> u32 {
    return s | ((t - 1u) << 8u);
}

/// Further numbers for lights that are tables and need more than four; zero, and not drawn, in scenes without a table.
fn random_extra(walk: u32, vertex: u32) -> vec4r {
    var extra = vec4r(0.0);
    if HAS_SKY {
        extra = random4(walk, vertex, DIMENSION_SKY);
    }
    return extra;
}
