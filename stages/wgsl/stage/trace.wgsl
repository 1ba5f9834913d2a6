//! The stage that finds where a walk arrives next.

import package::real::real;
import package::state::Walk;
import package::outcome::{HIT, MISS};
import package::trace::accelerator::trace_closest;
import package::trace::opacity::opacity_key;
import package::trace::triangle::{NO_PRIM, RAY_INFINITY};

/// Traces the walk's ray to the nearest surface and stores the hit. `position` is the ray's origin, already taken off its surface.
fn trace(walk: ptr<function, Walk>) -> u32 {
    let key = opacity_key(walk.position, walk.direction);
    walk.hit = trace_closest(walk.position, walk.direction, real(RAY_INFINITY), key);
    if walk.hit.prim == NO_PRIM {
        return MISS;
    }
    return HIT;
}
