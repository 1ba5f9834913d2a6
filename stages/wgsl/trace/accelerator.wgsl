//! The acceleration structure that the pipeline chose.

import package::real::{real, vec3r};
import package::state::Hit;
import package::params::{accelerator, accelerator_cwbvh};
import package::trace::bvh2::{any_hit_bvh2, closest_hit_bvh2};
import package::trace::cwbvh::{any_hit, closest_hit};

/// Nearest hit with 0 < t < t_max, t in metres along the unit vector `direction`; prim is NO_PRIM if there is none.
/// `key` (`opacity_key`) decides what partly transparent triangles do.
fn trace_closest(origin: vec3r, direction: vec3r, t_max: real, key: u32) -> Hit {
    if accelerator == accelerator_cwbvh {
        return closest_hit(origin, direction, t_max, key);
    } else {
        return closest_hit_bvh2(origin, direction, t_max, key);
    }
}

/// Whether anything is hit with 0 < t < t_max. Arguments as for `trace_closest`.
fn trace_any(origin: vec3r, direction: vec3r, t_max: real, key: u32) -> bool {
    if accelerator == accelerator_cwbvh {
        return any_hit(origin, direction, t_max, key);
    } else {
        return any_hit_bvh2(origin, direction, t_max, key);
    }
}
