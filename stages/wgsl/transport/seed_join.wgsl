//! Joining the vertices of the seed's eye walk to the light vertex that it belongs to.

import package::real::real;
import package::state::{Vertex, Walk};
import package::params::{connection_min_distance, frozen_reverse_pdfs};
import package::pass::path_pixel;
import package::surface::surface::{Surface, surface_on};
import package::surface::material::material_at;
import package::surface::spawn::{SHORTEST_LENGTH, segment_between};
import package::bsdf::bsdf::{Bsdf, IMPORTANCE, RADIANCE, bsdf_at, eval_bsdf, is_connectable, reverse_pdf_bsdf};
import package::light::emission::light_end;
import package::transport::advance::surface_cosine;
import package::transport::connect::LightSide;
import package::transport::direct::offer;
import package::transport::recursive_mis::SMALLEST_SUM;
import package::transport::seed_mis::{closed, limited};
import package::transport::seed_walk::{first_vertex, stored_sum};

/// y_t as the eye walk's newest vertex sees it.
fn light_side(light: ptr<function, Walk>, vertex: ptr<function, Vertex>, surface: Surface, t: u32) -> LightSide {
    if t == 1u {
        return LightSide(light_end(first_vertex(light, vertex), surface), light.mis);
    }
    let outgoing = -vertex.incoming;
    let seen = surface_on(vertex.hit.prim, vertex.hit.uv, outgoing);
    let bsdf = bsdf_at(seen, material_at(seen), outgoing);
    let span = seen.position - surface.position;
    let distance = length(span);
    var side: LightSide;
    side.end.distance_squared = dot(span, span);
    side.end.direction = span / max(distance, SHORTEST_LENGTH);
    side.end.cosine = surface_cosine(seen, side.end.direction);
    if is_connectable(bsdf) && distance >= connection_min_distance {
        let scattered = eval_bsdf(bsdf, outgoing, -side.end.direction, IMPORTANCE);
        side.end.value = scattered.value;
        side.end.pdf = scattered.pdf;
        side.end.segment = segment_between(surface, seen);
        side.sum = light.mis;
        if !frozen_reverse_pdfs {
            side.sum = closed(stored_sum(light), reverse_pdf_bsdf(bsdf, outgoing, -side.end.direction));
        }
    }
    return side;
}

/// Offers what comes from y_t by way of the eye walk's newest vertex, whose sum is `eye_sum`: strategies (s, t), s > 0, t > 0. The
/// squared distance is taken into the weight, so that none is too short.
fn join_light(eye: ptr<function, Walk>, light: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, side: LightSide, eye_sum: real) {
    let end = side.end;
    let scattered = eval_bsdf(bsdf, -eye.direction, end.direction, RADIANCE);
    let eye_side = end.pdf * surface_cosine(surface, end.direction) * eye_sum;
    let light_side = scattered.pdf * end.cosine * side.sum;
    let weight = 1.0 / max(end.distance_squared + eye_side + light_side, SMALLEST_SUM);
    let contribution = eye.throughput * scattered.value * light.throughput * end.value * weight;
    offer(eye, surface, end.segment, limited(contribution), path_pixel());
}
