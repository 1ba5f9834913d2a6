//! The implicit strategy: an eye walk that meets light by itself.

import package::real::{real, vec3r};
import package::params::{counting, counting_realised, record_strategies};
import package::film::{splat, splat_implicit};
import package::pass::path_pixel;
import package::transport::recursive_mis::weight_over;
import package::transport::record::record_strategy;
import package::transport::strategy::implicit_samples;

/// Adds light that an eye walk met after `edges` edges: `light` is throughput times radiance, `rivals` the sum of the other
/// strategies' densities over that of this one's, for one sample. Realised counting divides by the walks that there were, at the end.
fn add_implicit(edges: u32, light: vec3r, rivals: real) {
    let samples = implicit_samples(edges);
    let contribution = light * weight_over(samples, rivals);
    if counting == counting_realised {
        splat_implicit(edges, path_pixel(), contribution * samples);
    } else {
        splat(path_pixel(), contribution);
    }
    if record_strategies {
        record_strategy(edges, 0u, path_pixel(), contribution, light / samples);
    }
}
