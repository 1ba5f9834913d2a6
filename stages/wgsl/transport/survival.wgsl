//! Ending walks with a probability that their densities know of (Veach 1997, chapter 10): it is a factor of the density with which a walk
//! scatters, forwards and in reverse, so that strategies count as often as they are tried.

import package::real::real;
import package::params::{eye_survival, light_survival};
import package::state::Walk;
import package::features::HAS_DELTA;
import package::bsdf::bsdf::{Bsdf, BsdfSample, RADIANCE};
import package::transport::termination::survives;

/// Whether the walk goes on with a sample drawn at its vertex number `vertex`: by the constant probability of its kind of walk, which
/// delta lobes are spared, and by what else ends walks. `random` in [0, 1) decides both.
fn goes_on(walk: ptr<function, Walk>, sample: ptr<function, BsdfSample>, bsdf: Bsdf, vertex: u32, random: real, mode: u32) -> bool {
    var probability = select(light_survival, eye_survival, mode == RADIANCE);
    if HAS_DELTA && sample.delta {
        probability = 1.0;
    }
    if random >= probability {
        return false;
    }
    sample.weight /= probability;
    sample.pdf *= probability;
    return survives(walk, sample, bsdf, vertex, random / probability, mode);
}
