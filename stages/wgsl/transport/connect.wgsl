//! Joining an eye walk to the vertex of a light walk that it belongs to.

import package::real::{real, vec3r};
import package::state::{Path, Walk};
import package::params::{eye_survival, light_survival};
import package::features::{HAS_AREA_LIGHT, HAS_SKY};
import package::surface::surface::{Surface, surface_on};
import package::surface::material::material_at;
import package::surface::spawn::{SHORTEST_LENGTH, segment_between};
import package::bsdf::bsdf::{Bsdf, IMPORTANCE, RADIANCE, bsdf_at, eval_bsdf, is_connectable, reverse_pdf_bsdf};
import package::light::emission::light_end;
import package::light::light_vertex::{LightEnd, LightVertex};
import package::transport::advance::{light_sums, surface_cosine};
import package::transport::direct::offer_strategy;
import package::transport::recursive_mis::{MisPartial, SMALLEST_SUM, closed_sum, join, scaled, weight_over};
import package::transport::strategy::{eye_joins, implicit_term, join_samples, light_joins};

/// The vertex of a light walk that an eye walk is joined to.
struct LightSide {
    end: LightEnd,
    /// Sum of the strategies with fewer light vertices.
    sum: real,
}

/// y_1 as it was stored when it was sampled.
fn stored_light_vertex(light: ptr<function, Walk>) -> LightVertex {
    var vertex: LightVertex;
    vertex.light = light.hit.prim;
    vertex.place = light.hit.uv;
    vertex.direction = light.direction;
    vertex.throughput = light.throughput;
    return vertex;
}

/// Joins x_s, of which `sums` are known, to the light walk's vertex y_t, and offers what light comes that way.
fn connect(eye: ptr<function, Walk>, light: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, sums: MisPartial, s: u32, t: u32) {
    var side: LightSide;
    if t == 1u {
        side = emitter_side(light, surface, s + 1u);
    } else {
        side = scattering_side(light, surface, s, t);
    }
    let end = side.end;
    let outgoing = -eye.direction;
    let scattered = eval_bsdf(bsdf, outgoing, end.direction, RADIANCE);
    let reverse_pdf = light_survival * reverse_pdf_bsdf(bsdf, outgoing, end.direction);
    let eye_sum = closed_sum(sums, reverse_pdf, eye_joins(s - 1u), 0.0);
    let eye_side = scaled(end.pdf * surface_cosine(surface, end.direction), eye_sum);
    let light_side = scaled(eye_survival * scattered.pdf * end.cosine, side.sum);
    let transported = eye.throughput * scattered.value * light.throughput * end.value;
    let own = join_samples(s, t) * end.distance_squared;
    let weight = weight_over(own, join(eye_side, light_side));
    let unweighted = transported / max(own, SMALLEST_SUM);
    offer_strategy(eye, surface, end.segment, transported * weight, unweighted, s, t);
}

/// y_1; the strategy with fewer light vertices is the eye walk that hits the light.
fn emitter_side(light: ptr<function, Walk>, surface: Surface, edges: u32) -> LightSide {
    var side: LightSide;
    side.end = light_end(stored_light_vertex(light), surface);
    if HAS_AREA_LIGHT || HAS_SKY {
        side.sum = scaled(implicit_term(edges), light.mis_c);
    }
    return side;
}

/// y_t, t >= 2, a surface that scatters towards x_s.
fn scattering_side(light: ptr<function, Walk>, surface: Surface, s: u32, t: u32) -> LightSide {
    let vertex = surface_on(light.hit.prim, light.hit.uv, -light.direction);
    let outgoing = -light.direction;
    let bsdf = bsdf_at(vertex, material_at(vertex), outgoing);
    let span = vertex.position - surface.position;
    var side: LightSide;
    side.end.distance_squared = dot(span, span);
    side.end.direction = span / max(sqrt(side.end.distance_squared), SHORTEST_LENGTH);
    side.end.cosine = surface_cosine(vertex, side.end.direction);
    if is_connectable(bsdf) {
        let scattered = eval_bsdf(bsdf, outgoing, -side.end.direction, IMPORTANCE);
        side.end.value = scattered.value;
        side.end.pdf = light_survival * scattered.pdf;
        side.end.segment = segment_between(surface, vertex);
        let reverse_pdf = eye_survival * reverse_pdf_bsdf(bsdf, outgoing, -side.end.direction);
        side.sum = closed_sum(light_sums(light), reverse_pdf, light_joins(t - 1u), implicit_term(s + t));
    }
    return side;
}
