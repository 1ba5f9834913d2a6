import package::outcome::{HIT, MISS};
import package::real::real;
import package::sphere::nearest_sphere;
import package::state::Walk;

/// Traces a ray.
fn trace_walk(walk: ptr<function, Walk>) -> u32 {
    let t = nearest_sphere(walk.position, walk.direction);
    walk.hit.prim = 0u;
    walk.hit.t = t;
    walk.hit.uv = vec2f(0.0);
    if t < real(0.0) {
        return MISS;
    }
    return HIT;
}
