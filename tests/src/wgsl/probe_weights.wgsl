//! Draws paths and adds up the weights that the stages give all strategies for each: a partition of unity.
//!
//! The film is a table, a row every 16 pixels: how many values are how far off, two pixels a decade from 1e-8.

import package::real::{real, vec3r};
import package::state::{Path, Walk};
import package::features::HAS_SKY;
import package::film::splat;
// Those of the stages that are called need values too.
import package::outcome::{ABSORBED, DONE, EMITTED, ENDED, SCATTERED, UNJOINED};
import package::params::{counting_first, max_edges};
import package::random::{DIMENSION_LIGHT, DIMENSION_SCATTER, WALK_EYE, random4};
import package::math::vector::max_component;
import package::bsdf::bsdf::{Bsdf, BsdfSample, RADIANCE, bsdf_at, eval_bsdf, is_connectable, sample_bsdf};
import package::light::emission::{light_end, sample_light_vertex};
import package::light::light_vertex::LightVertex;
import package::light::sky::{sky_frame, sky_pdf_w};
import package::light::table::{LIGHT_POINT, LIGHT_SKY, LIGHT_SPOT, LIGHT_TRIANGLE, light_kind, light_row};
import package::light::triangle_light::{triangle_light_pdf_area, triangle_of};
import package::surface::material::{is_emissive, material_at};
import package::surface::spawn::spawn_origin;
import package::surface::geometry::load_triangle;
import package::surface::surface::{NO_LIGHT, Surface, surface_at, surface_on};
import package::trace::accelerator::{trace_any, trace_closest};
import package::trace::triangle::{NO_PRIM, RAY_INFINITY};
import package::transport::dimension::random_extra;
import package::transport::strategy::{implicit_samples, is_used, join_samples};
import package::transport::walk::is_absorbed;
import package::stage::start_eye::start_eye;
import package::stage::start_light::start_light;
import package::stage::extend_light::extend_light;
import package::stage::shade_light_mis::shade_light_mis;
import package::stage::shade_eye::shade_eye;
import package::stage::escape_eye::escape_eye;
import package::probe::forced_path::{MOST_VERTICES, ends_at_infinity, force_hit, forced, forced_direction, forced_edges, forced_light, reported_hit, reported_join};
import package::probe::weight_settings::{counting, draw_settings, early_end, light_vertices_rate, mis, mortal, subset, walk_share, walk_vertices};

const COLUMNS: u32 = 16u;
/// Eight rows for each kind of light, by edges.
const ROW_LIGHT: u32 = 0u;
/// Three rows for each way of counting, by the weights.
const ROW_COUNTING: u32 = 40u;
const ROW_EARLY_END: u32 = 49u;
/// By the kind of subset.
const ROW_SUBSET: u32 = 51u;
/// Paths that no strategy of the subset makes.
const ROW_NOTHING: u32 = 54u;
/// In the first column: paths whose delta lobe was not found from the light's side.
const ROW_LOST: u32 = 55u;
/// By the number of deltas.
const ROW_DELTAS: u32 = 56u;
/// Samples of the implicit strategy.
const ROW_SAMPLES: u32 = 62u;
/// By the material of any vertex that scatters.
const ROW_MATERIAL: u32 = 64u;
/// By the material of a triangle light.
const ROW_EMITTER: u32 = 76u;
/// Vertices that are joined to one at the same place, by the weights.
const ROW_COINCIDENT: u32 = 88u;
/// By the share of light vertices that have eye walks: none, some, all.
const ROW_SHARE: u32 = 91u;
/// Two light vertices share an eye walk.
const ROW_PAIRS: u32 = 94u;
/// Walks go on as long as they can; they may end by chance.
const ROW_SURVIVAL: u32 = 95u;

/// Tries for finding a delta lobe from the other side.
const TRIES: u32 = 64u;

/// What is done at a vertex of the eye walk: it is joined to the rest of the light walk; it is joined to a vertex at the same place,
/// which must add nothing; and it goes on as the walk of y_1, the only one that goes all the way.
const TURN_JOIN: u32 = 0u;
const TURN_COINCIDE: u32 = 1u;
const TURN_GO_ON: u32 = 2u;

/// A vertex of the drawn path.
struct Drawn {
    /// There is none: the way ends in the sky.
    at_infinity: bool,
    surface: Surface,
    bsdf: Bsdf,
    /// Unit, towards the vertex before.
    outgoing: vec3r,
}

/// Draws an eye walk and tests the paths that end where it meets light or is joined to light.
fn probe_weights() -> u32 {
    var eye: Walk;
    var path: Path;
    path.light_length = 1u;
    start_eye(&eye, &path);
    forced[0].position = eye.position;
    for (var s = 1u; s <= max_edges; s += 1u) {
        let drawn = draw_vertex(&eye, s);
        if drawn.at_infinity && !HAS_SKY {
            return DONE;
        }
        for (var turn = 0u; turn < 2u; turn += 1u) {
            var ends = false;
            if turn == 0u {
                ends = meets_light(drawn, s);
            } else if !drawn.at_infinity && s < max_edges {
                ends = joins_light(drawn, s);
            }
            if ends {
                test_path();
            }
        }
        if drawn.at_infinity {
            return DONE;
        }
        let sample = scatter(drawn, s);
        if is_absorbed(sample) {
            return DONE;
        }
        eye.position = spawn_origin(drawn.surface, sample.direction);
        eye.direction = sample.direction;
    }
    return DONE;
}

/// Traces the walk to z_s.
fn draw_vertex(eye: ptr<function, Walk>, s: u32) -> Drawn {
    let hit = trace_closest(eye.position, eye.direction, real(RAY_INFINITY), 0u);
    forced[s].delta = false;
    forced[s].mixed = false;
    var drawn: Drawn;
    drawn.outgoing = -eye.direction;
    drawn.at_infinity = hit.prim == NO_PRIM;
    if !drawn.at_infinity {
        drawn.surface = surface_at(hit, eye.direction);
        forced[s].prim = hit.prim;
        forced[s].uv = hit.uv;
        forced[s].position = drawn.surface.position;
        let span = forced[s - 1u].position - forced[s].position;
        drawn.outgoing = span / length(span);
        drawn.bsdf = bsdf_at(drawn.surface, material_at(drawn.surface), drawn.outgoing);
    }
    return drawn;
}

/// Scatters the walk at z_s. Of a delta lobe it also finds with what probability a walk from the light selects it: the one that turns
/// the sampled direction into the outgoing one. Where two reflect alike, the same one is the one with the same probability.
fn scatter(drawn: Drawn, s: u32) -> BsdfSample {
    var scattered: BsdfSample;
    var came_from = drawn.outgoing;
    var random = random4(WALK_EYE, s, DIMENSION_SCATTER).xyz;
    var closest = real(2.0);
    for (var n = 0u; n <= TRIES; n += 1u) {
        let bsdf = bsdf_at(drawn.surface, material_at(drawn.surface), came_from);
        let sample = sample_bsdf(bsdf, came_from, random, RADIANCE);
        if n == 0u {
            scattered = sample;
            came_from = sample.direction;
            forced[s].delta = sample.delta;
            forced[s].mixed = sample.delta && is_connectable(bsdf);
            forced[s].eye_pdf = sample.pdf;
            if !sample.delta {
                return scattered;
            }
        } else if sample.delta && dot(sample.direction, drawn.outgoing) > 0.9999 && abs(sample.pdf - scattered.pdf) < closest {
            closest = abs(sample.pdf - scattered.pdf);
            forced[s].light_pdf = sample.pdf;
        }
        random = vec3r(0.5, 0.5, (real(n) + 0.5) / real(TRIES));
    }
    if closest > 1.0 {
        splat(ROW_LOST * COLUMNS, vec3r(1.0));
        scattered.pdf = 0.0;
    }
    return scattered;
}

/// The walk has met light that can be sampled: completes the path of s edges.
fn meets_light(drawn: Drawn, s: u32) -> bool {
    forced_edges = s;
    forced_light = LightVertex();
    forced_light.throughput = vec3r(1.0);
    if drawn.at_infinity {
        forced_light.light = sky_frame.size.w;
        forced_light.direction = drawn.outgoing;
        forced_light.pdf = sky_pdf_w(-drawn.outgoing);
    } else if is_emissive(drawn.surface) && drawn.surface.light != NO_LIGHT {
        forced_light.light = drawn.surface.light;
        forced_light.place = forced[s].uv;
        forced_light.pdf = triangle_light_pdf_area(drawn.surface.light);
    }
    return forced_light.pdf > 0.0;
}

/// Draws a light that shines on z_s: completes the path of s + 1 edges.
fn joins_light(drawn: Drawn, s: u32) -> bool {
    forced_edges = s + 1u;
    forced_light = sample_light_vertex(random4(WALK_EYE, s, DIMENSION_LIGHT), random_extra(WALK_EYE, s));
    forced_light.throughput = vec3r(1.0);
    forced[s + 1u].delta = false;
    forced[s + 1u].mixed = false;
    let kind = light_kind(forced_light.light);
    if kind == LIGHT_TRIANGLE {
        forced[s + 1u].prim = triangle_of(forced_light.light);
        forced[s + 1u].uv = forced_light.place;
        forced[s + 1u].position = surface_on(forced[s + 1u].prim, forced_light.place, vec3r(0.0)).position;
    } else if kind == LIGHT_POINT || kind == LIGHT_SPOT {
        forced[s + 1u].position = vec3r(light_row(forced_light.light, 1u).xyz);
    } else if kind == LIGHT_SKY {
        forced_light.pdf = sky_pdf_w(-forced_light.direction);
    }
    let end = light_end(forced_light, drawn.surface);
    let scattered = eval_bsdf(drawn.bsdf, drawn.outgoing, end.direction, RADIANCE);
    return is_connectable(drawn.bsdf) && scattered.pdf > 0.0 && max_component(scattered.value * end.value) > 0.0
        && !trace_any(end.segment.origin, end.segment.direction, end.segment.distance, 0u);
}

/// Adds up the weights of the path and counts how far they are from what they must be.
fn test_path() {
    let k = forced_edges;
    let key = 32u * k;
    draw_settings(k, random4(WALK_EYE, key, 16u), random4(WALK_EYE, key, 17u), random4(WALK_EYE, key, 18u), random4(WALK_EYE, key, 19u));
    var makers = 0u;
    for (var s = 0u; s <= k; s += 1u) {
        makers += select(0u, 1u, makes_path(s, k - s));
    }
    let off = abs(sum_of_weights() - select(real(0.0), real(1.0), makers > 0u));
    count(ROW_LIGHT + 8u * light_kind(forced_light.light) + k, off);
    count(ROW_COUNTING + 3u * counting + mis, off);
    count(ROW_EARLY_END + select(0u, 1u, early_end), off);
    count(ROW_SHARE + select(1u, select(0u, 2u, walk_share == 1.0), walk_share == 0.0 || walk_share == 1.0), off);
    if walk_vertices == 2u {
        count(ROW_PAIRS, off);
    }
    count(ROW_SURVIVAL + select(0u, 1u, mortal), off);
    count(ROW_SUBSET + subset, off);
    if makers == 0u {
        count(ROW_NOTHING, off);
    }
    count_materials(off);
    count(ROW_SAMPLES, abs(implicit_samples(k) - samples_at_rate_one(k)));
}

/// Counts the path by what scatters on it and what emits.
fn count_materials(off: real) {
    var deltas = 0u;
    for (var i = 1u; i < forced_edges; i += 1u) {
        deltas += select(0u, 1u, forced[i].delta);
        count(ROW_MATERIAL + surface_on(forced[i].prim, forced[i].uv, vec3r(0.0)).material, off);
    }
    count(ROW_DELTAS + deltas, off);
    if light_kind(forced_light.light) == LIGHT_TRIANGLE {
        count(ROW_EMITTER + surface_on(triangle_of(forced_light.light), forced_light.place, vec3r(0.0)).material, off);
    }
}

/// Counts a value that is `off` by so much in a row.
fn count(row: u32, off: real) {
    var column = COLUMNS - 1u;
    if off < 1.0 {
        column = u32(clamp(2.0 * log2(f32(max(off, 1e-12)) * 1e8) * 0.30102999566, 0.0, 15.0));
    }
    splat(row * COLUMNS + column, vec3r(1.0));
}

/// Samples of the implicit strategy if light walks never end: the first eye walk, and its share of the others. Where they do, what
/// `implicit_samples` says.
fn samples_at_rate_one(edges: u32) -> real {
    if counting == counting_first || edges == 1u {
        return 1.0;
    }
    if light_vertices_rate(2u) < 1.0 {
        return implicit_samples(edges);
    }
    let last = max(max_edges - edges + select(1u, 0u, early_end), 1u);
    var others = 0u;
    for (var t = 2u; t <= last; t += 1u) {
        others += select(0u, 1u, walk_vertices == 1u || t % 2u == 1u);
    }
    return 1.0 + walk_share * real(others);
}

/// Whether strategy (s, t) takes part and can make the path.
fn makes_path(s: u32, t: u32) -> bool {
    if !is_used(s, t) {
        return false;
    }
    if t == 0u {
        return forced_light.pdf > 0.0;
    }
    if join_samples(s, t) == 0.0 {
        return false;
    }
    return !(s > 0u && forced[s].delta) && !(t > 1u && forced[s + 1u].delta);
}

/// Sends both walks along the path and adds weight times number of samples of all strategies.
fn sum_of_weights() -> real {
    let k = forced_edges;
    var light_walks: array<Walk, MOST_VERTICES>;
    var light: Walk;
    var path: Path;
    start_light(&light, &path);
    light_walks[1] = light;
    reported_join = 0.0;
    for (var t = 1u; t < k; t += 1u) {
        path.light_length = t;
        if extend_light(&light, &path) != SCATTERED {
            break;
        }
        force_hit(&light, k + 1u - t, k - t);
        reported_join = 0.0;
        shade_light_mis(&light, &path);
        light_walks[t + 1u] = light;
    }
    // The last report is that of y_k.
    let particle = select(reported_join, 0.0, forced[1].mixed);
    return particle + sum_of_eye_walk(&light_walks);
}

/// The part of the strategies with vertices of an eye walk.
fn sum_of_eye_walk(light_walks: ptr<function, array<Walk, MOST_VERTICES>>) -> real {
    let k = forced_edges;
    var sum = real(0.0);
    var eye: Walk;
    var path: Path;
    path.light_length = 1u;
    start_eye(&eye, &path);
    for (var s = 1u; s <= k; s += 1u) {
        reported_hit = 0.0;
        if s == k && forced_light.pdf == 0.0 {
            break;
        }
        if s == k && ends_at_infinity() {
            eye.direction = forced_direction(s - 1u, s);
            eye.length = s - 1u;
            escape_eye(&eye, &path);
            break;
        }
        force_hit(&eye, s - 1u, s);
        sum += shade_vertex(&eye, light_walks, s);
    }
    return sum + reported_hit;
}

/// Takes all turns at x_s, at the end of the path the last one alone. Returns what the strategy that joins x_s to the rest adds.
fn shade_vertex(eye: ptr<function, Walk>, light_walks: ptr<function, array<Walk, MOST_VERTICES>>, s: u32) -> real {
    var joined = real(0.0);
    var path: Path;
    for (var turn = select(TURN_JOIN, TURN_GO_ON, s == forced_edges); turn <= TURN_GO_ON; turn += 1u) {
        var walk = *eye;
        walk.length = s - 1u;
        path.light_length = select(1u, forced_edges - s, turn == TURN_JOIN);
        var light = light_walks[path.light_length];
        if turn == TURN_COINCIDE {
            path.light_length = put_at(&light, s);
            light.direction = walk.direction;
        }
        reported_join = 0.0;
        shade_eye(&walk, &light, &path);
        if turn == TURN_GO_ON {
            *eye = walk;
        } else if turn == TURN_COINCIDE {
            count(ROW_COINCIDENT + mis, abs(reported_join));
        } else if !forced[s].mixed && !forced[s + 1u].mixed {
            joined = reported_join;
        }
    }
    return joined;
}

/// Puts the vertex of a light walk where z_s is, on the light if z_s is on one. Returns its number t on the walk.
fn put_at(light: ptr<function, Walk>, s: u32) -> u32 {
    let emitter = load_triangle(forced[s].prim).light;
    let scatters = emitter == NO_LIGHT;
    light.hit.prim = select(emitter, forced[s].prim, scatters);
    light.hit.uv = forced[s].uv;
    return select(1u, 2u, scatters);
}
