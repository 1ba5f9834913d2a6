//! The strategies (s, t) of a bidirectional path: s vertices from the eye walk, t from the light walk, s + t edges.
//! t = 0 implicit (the eye walk hits a light), t = 1 explicit, s = 0 particle (joined to the camera), else connection.

import package::real::real;
import package::params::{counting, counting_first, counting_measured, early_end, max_edges};
import package::params::{only_edges, only_eye_vertices, use_connection, use_explicit, use_implicit, use_particle, walk_share, walk_vertices};
import package::tallies::light_vertices_rate_sum;

/// Whether a strategy takes part. With `only_edges` the bits of `only_eye_vertices` say which s do.
fn is_used(s: u32, t: u32) -> bool {
    if only_edges > 0u && (s + t != only_edges || ((only_eye_vertices >> s) & 1u) == 0u) {
        return false;
    }
    if t == 0u {
        return use_implicit;
    }
    if s == 0u {
        return use_particle && t > 1u;
    }
    return select(use_connection, use_explicit, t == 1u);
}

/// Samples of strategy (s, t), t > 0, that are expected of each y_t: 1, `walk_share` where the eye walk itself is left to chance, 0 of
/// a strategy that is left out.
fn join_samples(s: u32, t: u32) -> real {
    return select(0.0, select(1.0, walk_share, s > 0u && t > 1u), is_used(s, t));
}

/// Samples of the strategies that join x_s of an eye walk to light vertices beyond the next. With `only_edges` s decides which that is.
fn eye_joins(s: u32) -> real {
    if only_edges > 0u {
        return select(0.0, join_samples(s, only_edges - s), s <= only_edges);
    }
    return join_samples(s, 2u);
}

/// Samples of the strategies that join y_t of a light walk to eye vertices.
fn light_joins(t: u32) -> real {
    if only_edges > 0u {
        return select(0.0, join_samples(only_edges - t, t), t <= only_edges);
    }
    return join_samples(1u, t);
}

/// Whether x_s is joined to y_t, t > 0, where the two meet.
fn is_joined(s: u32, t: u32) -> bool {
    return s + t <= max_edges && is_used(s, t);
}

/// The first of the light vertices, `walk_vertices` in a row, that the eye walk of y_t belongs to; it stands for the walk.
fn first_joined(t: u32) -> u32 {
    return t - (t - 1u) % walk_vertices;
}

/// Vertices of the eye walk that begins with light vertex `t` at most; its last ray only looks for light. 0: there is no such walk.
fn eye_limit(t: u32) -> u32 {
    if t == 1u {
        return max_edges;
    }
    if early_end || counting == counting_first || t == max_edges {
        return max_edges - t;
    }
    return max_edges - t + 1u;
}

/// Whether light that the walk to x_s belonging to light vertex `t` meets counts. Light that the camera sees counts once a sample: it
/// has no other strategy, and a random number of walks that see it would be nothing but noise.
fn implicit_counts(s: u32, t: u32) -> bool {
    return (t == 1u || (counting != counting_first && s > 1u)) && is_used(s, 0u);
}

/// Samples of the implicit strategy of `edges` edges for each light path: the eye walks that may reach so far. Measured: their
/// expected number; realised: as if no light path ended, a constant that the picture is corrected for at the end.
fn implicit_samples(edges: u32) -> real {
    var samples = real(1.0);
    if counting != counting_first && edges > 1u {
        let last = last_eye_walk(edges);
        samples = real((last + walk_vertices - 1u) / walk_vertices);
        if counting == counting_measured {
            // Light vertices are numbered from 1, and counted where an eye walk begins with them.
            samples = light_vertices_rate_sum(last);
        }
        if walk_share < 1.0 {
            samples = 1.0 + walk_share * (samples - 1.0);
        }
    }
    return samples;
}

/// The last light vertex whose eye walk may have so many edges, two at least: see `eye_limit`.
fn last_eye_walk(edges: u32) -> u32 {
    return max(max_edges - edges + select(1u, 0u, early_end), 1u);
}

/// `implicit_samples`, or 0 where that strategy is left out.
fn implicit_term(edges: u32) -> real {
    if !is_used(edges, 0u) {
        return 0.0;
    }
    return implicit_samples(edges);
}
