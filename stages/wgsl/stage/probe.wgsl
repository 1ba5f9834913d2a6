import package::real::{real, vec3r};
import package::state::Walk;
import package::outcome::{HIT, MISS};
import package::trace::accelerator::trace_any;
import package::trace::opacity::opacity_key;
import package::trace::triangle::RAY_INFINITY;

/// Asks of the walk's ray only whether it hits anything: the any-hit half of the ray-rate measurement.
fn probe(walk: ptr<function, Walk>) -> u32 {
    let blocked = trace_any(walk.position, walk.direction, RAY_INFINITY, opacity_key(walk.position, walk.direction));
    return select(MISS, HIT, blocked);
}
