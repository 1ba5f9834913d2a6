//! The path whose weights are added up: what the stages are handed where they would draw, and what they report where they would add light.

import package::real::{real, vec2r, vec3r};
import package::state::Walk;
import package::bsdf::bsdf::{Bsdf, BsdfSample, RADIANCE, eval_bsdf};
import package::light::emission::light_end;
import package::light::light_vertex::{Emission, LightVertex};
import package::light::table::{LIGHT_DIRECTIONAL, LIGHT_SKY, light_kind};
import package::surface::spawn::SHORTEST_LENGTH;
import package::surface::surface::Surface;

/// Vertices of a path at most, the camera's included.
const MOST_VERTICES: u32 = 8u;

/// A vertex z_i of the path, counted from the camera's z_0 to the light's z_k.
struct ForcedVertex {
    prim: u32,
    uv: vec2r,
    position: vec3r,
    /// A delta lobe scatters here.
    delta: bool,
    /// There are other lobes beside it: strategies that join this vertex make other paths.
    mixed: bool,
    /// Probabilities of selecting the delta lobe, for walks from the camera and from the light.
    eye_pdf: real,
    light_pdf: real,
}

var<private> forced: array<ForcedVertex, MOST_VERTICES>;
/// k
var<private> forced_edges: u32;
/// z_k as y_1
var<private> forced_light: LightVertex;

/// What the stages report: weight times number of samples, of the strategy that joins two vertices and of the one that hits the light.
var<private> reported_join: real;
var<private> reported_hit: real;

/// z_k is a direction.
fn ends_at_infinity() -> bool {
    let kind = light_kind(forced_light.light);
    return kind == LIGHT_DIRECTIONAL || kind == LIGHT_SKY;
}

/// Unit direction of the edge from z_from to z_to.
fn forced_direction(from_vertex: u32, to_vertex: u32) -> vec3r {
    if to_vertex == forced_edges && ends_at_infinity() {
        return -forced_light.direction;
    }
    if from_vertex == forced_edges && ends_at_infinity() {
        return forced_light.direction;
    }
    let span = forced[to_vertex].position - forced[from_vertex].position;
    return span / max(sqrt(dot(span, span)), SHORTEST_LENGTH);
}

/// The walk has traced the edge from z_from to z_to.
fn force_hit(walk: ptr<function, Walk>, from_vertex: u32, to_vertex: u32) {
    let span = forced[to_vertex].position - forced[from_vertex].position;
    walk.direction = forced_direction(from_vertex, to_vertex);
    walk.hit.prim = forced[to_vertex].prim;
    walk.hit.uv = forced[to_vertex].uv;
    walk.hit.t = sqrt(dot(span, span));
}

/// Scattering at z_at towards z_next, in place of a drawn sample.
fn forced_event(bsdf: Bsdf, outgoing: vec3r, at: u32, next: u32, delta_pdf: real) -> BsdfSample {
    var event: BsdfSample;
    event.direction = forced_direction(at, next);
    event.weight = vec3r(1.0);
    event.delta = forced[at].delta;
    event.transmitted = dot(event.direction, bsdf.frame.normal) < 0.0;
    event.pdf = delta_pdf;
    if !event.delta {
        event.pdf = eval_bsdf(bsdf, outgoing, event.direction, RADIANCE).pdf;
    }
    return event;
}

/// Scattering of the eye walk at x_s; absorbed at the end of the path.
fn eye_event(bsdf: Bsdf, outgoing: vec3r, s: u32) -> BsdfSample {
    if s >= forced_edges {
        var absorbed: BsdfSample;
        return absorbed;
    }
    return forced_event(bsdf, outgoing, s, s + 1u, forced[s].eye_pdf);
}

/// Scattering of the light walk at y_t.
fn light_event(bsdf: Bsdf, outgoing: vec3r, t: u32) -> BsdfSample {
    let at = forced_edges + 1u - t;
    return forced_event(bsdf, outgoing, at, at - 1u, forced[at].light_pdf);
}

/// The ray from the light's vertex to y_2.
fn light_emission() -> Emission {
    var receiver: Surface;
    receiver.position = forced[forced_edges - 1u].position;
    let end = light_end(forced_light, receiver);
    var emission: Emission;
    emission.direction = forced_direction(forced_edges, forced_edges - 1u);
    emission.weight = vec3r(1.0);
    emission.pdf = end.pdf;
    emission.cosine = end.cosine;
    emission.parallel = ends_at_infinity();
    return emission;
}

/// In place of a contribution of two joined vertices. One that is no number is not black.
fn report_join(contribution: vec3r, weight: real) {
    if !all(contribution == vec3r(0.0)) {
        reported_join = weight;
    }
}
