//! A picture of each strategy of its own, weighted and unweighted.

import package::real::vec3r;
import package::params::max_edges;
import package::film::splat_strategies;

/// Number of the strategy (s, t), ordered by edges and then by s.
fn strategy_index(s: u32, t: u32) -> u32 {
    let edges = s + t;
    return edges * (edges + 1u) / 2u + s;
}

/// Adds to the layers of a strategy: `weighted` is what the picture gets, `unweighted` what it would get from this strategy alone.
fn record_strategy(s: u32, t: u32, pixel: u32, weighted: vec3r, unweighted: vec3r) {
    record_strategy_at(strategy_index(s, t), pixel, weighted, unweighted);
}

/// `record_strategy` by number. The unweighted layers follow all weighted ones.
fn record_strategy_at(index: u32, pixel: u32, weighted: vec3r, unweighted: vec3r) {
    splat_strategies(index, pixel, weighted);
    splat_strategies((max_edges + 1u) * (max_edges + 2u) / 2u + index, pixel, unweighted);
}
