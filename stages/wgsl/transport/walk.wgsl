//! Steps that eye and light walks share.

import package::real::vec3r;
import package::state::Walk;
import package::features::HAS_ATTENUATION;
import package::surface::surface::{Surface, surface_at};
import package::surface::spawn::spawn_origin;
import package::bsdf::bsdf::BsdfSample;
import package::transport::medium::{medium_after, medium_at, transmittance};

/// The surface the walk has hit; absorbs along the way there.
fn arrive(walk: ptr<function, Walk>) -> Surface {
    let surface = surface_at(walk.hit, walk.direction);
    if HAS_ATTENUATION {
        walk.medium = medium_at(surface, walk.medium);
        walk.throughput *= transmittance(walk.medium, walk.hit.t);
    }
    return surface;
}

/// Sends the walk off from the surface along a sampled direction.
fn depart(walk: ptr<function, Walk>, surface: Surface, sample: BsdfSample) {
    walk.position = spawn_origin(surface, sample.direction);
    walk.direction = sample.direction;
    walk.throughput *= sample.weight;
    if HAS_ATTENUATION {
        walk.medium = medium_after(surface, walk.medium, sample.transmitted);
    }
}

/// The sample leads nowhere: nothing scatters, or only black.
fn is_absorbed(sample: BsdfSample) -> bool {
    return !(sample.pdf > 0.0) || all(sample.weight == vec3r(0.0));
}
