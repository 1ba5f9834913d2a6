//! Ending walks early: Russian roulette, and the seed's rule of two diffuse vertices (Lu 2020, "FLAGS").

import package::real::{real, vec3r};
import package::params::{regularise, regularise_cut, regularise_none, regularise_survival, roulette, roulette_start};
import package::state::{FLAGS_DIFFUSE, Walk};
import package::features::{HAS_SOLID_GLASS, HAS_TRANSMISSION};
import package::math::vector::max_component;
import package::bsdf::bsdf::{Bsdf, BsdfSample, RADIANCE};

/// Smallest probability of survival in Russian roulette, so that no weight is multiplied by more than 20.
const LEAST_SURVIVAL: real = 0.05;

/// Whether the walk goes on with a sample drawn at its vertex number `vertex`. `random` in [0, 1) decides; the weight of a survivor
/// is divided by its probability. Densities for multiple importance sampling leave it out.
fn survives(walk: ptr<function, Walk>, sample: ptr<function, BsdfSample>, bsdf: Bsdf, vertex: u32, random: real, mode: u32) -> bool {
    var probability = real(1.0);
    if roulette && vertex >= roulette_start {
        probability = clamp(max_component(flux_weight(bsdf, *sample, mode)), LEAST_SURVIVAL, 1.0);
    }
    if regularise != regularise_none {
        if sample.diffuse && (walk.flags & FLAGS_DIFFUSE) != 0u {
            probability *= select(regularise_survival, 0.0, regularise == regularise_cut);
        }
        walk.flags = select(walk.flags & ~FLAGS_DIFFUSE, walk.flags | FLAGS_DIFFUSE, sample.diffuse);
    }
    if random >= probability {
        return false;
    }
    sample.weight /= probability;
    return true;
}

/// The sample's weight without the factor by which refraction scales radiance: what it does to flux.
fn flux_weight(bsdf: Bsdf, sample: BsdfSample, mode: u32) -> vec3r {
    var weight = sample.weight;
    if HAS_TRANSMISSION && HAS_SOLID_GLASS {
        if mode == RADIANCE && sample.transmitted && bsdf.solid {
            weight *= bsdf.eta * bsdf.eta;
        }
    }
    return weight;
}
