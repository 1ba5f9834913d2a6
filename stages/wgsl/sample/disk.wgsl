//! Uniform points on the unit disk.

import package::real::vec2r;
import package::math::constants::{HALF_PI, QUARTER_PI};
import package::math::elementary::{cosine, sine};

/// Uniform point on the unit disk from two numbers in [0, 1); density 1/pi (Shirley and Chiu 1997: concentric, area preserving).
fn sample_disk(random: vec2r) -> vec2r {
    let square = 2.0 * random - 1.0;
    if square.x == 0.0 && square.y == 0.0 {
        return vec2r(0.0);
    }
    if abs(square.x) > abs(square.y) {
        let angle = QUARTER_PI * (square.y / square.x);
        return square.x * vec2r(cosine(angle), sine(angle));
    }
    let angle = HALF_PI - QUARTER_PI * (square.x / square.y);
    return square.y * vec2r(cosine(angle), sine(angle));
}
