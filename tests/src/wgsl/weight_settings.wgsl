//! Parameters of weighting as variables, so that one kernel goes through all of them.

import package::real::{real, vec4r};
import package::math::elementary::power;

var<private> mis: u32;
var<private> counting: u32;
var<private> early_end: bool;
var<private> walk_share: real;
var<private> walk_vertices: u32 = 1u;
var<private> eye_survival: real;
var<private> light_survival: real;
/// Whether walks may end by these two.
var<private> mortal: bool;
var<private> use_implicit: bool;
var<private> use_explicit: bool;
var<private> use_particle: bool;
var<private> use_connection: bool;
var<private> only_edges: u32;
var<private> only_eye_vertices: u32;
/// Share of light walks that an edge does not end.
var<private> survival: real;
/// Which subset of the strategies is on: 0 all, 1 by kind, 2 by the number of eye vertices.
var<private> subset: u32;

/// In place of what earlier samples counted: how many light walks reach vertex t.
fn light_vertices_rate(t: u32) -> real {
    return power(survival, real(t - 1u));
}

/// Their sum up to vertex t, where eye walks begin with these.
fn light_vertices_rate_sum(t: u32) -> real {
    var sum = real(0.0);
    for (var i = 1u; i <= t; i += walk_vertices) {
        sum += light_vertices_rate(i);
    }
    return sum;
}

/// Settings for a path of `edges` edges: of weights and counting, of the subset, and of the ends of walks.
fn draw_settings(edges: u32, a: vec4r, b: vec4r, c: vec4r, d: vec4r) {
    mis = u32(a.x * 3.0);
    counting = u32(a.y * 3.0);
    early_end = a.z < 0.5;
    // A tenth none, a third all.
    walk_share = select(min(1.5 * c.w, 1.0), 0.0, c.w < 0.1);
    walk_vertices = 1u;
    if c.w > 0.8 {
        // All have an eye walk, half of them that of the one before.
        walk_vertices = 2u;
    }
    survival = min(0.05 + 1.2 * a.w, 1.0);
    mortal = d.x < 0.5;
    eye_survival = select(1.0, 0.1 + 0.9 * d.y, mortal);
    light_survival = select(1.0, 0.1 + 0.9 * d.z, mortal);
    subset = u32(c.x * 3.0);
    let all = subset == 0u;
    use_implicit = all || b.x < 0.75;
    use_explicit = all || b.y < 0.75;
    use_particle = all || b.z < 0.75;
    use_connection = all || b.w < 0.75;
    only_edges = 0u;
    if subset == 2u {
        // Sometimes another length: then nothing may be found.
        only_edges = select(edges, edges % 6u + 1u, c.y < 0.1);
    }
    only_eye_vertices = u32(c.z * 256.0);
}
