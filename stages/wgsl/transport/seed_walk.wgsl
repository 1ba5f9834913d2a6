//! Steps of the seed's walks, which keep the throughput on both sides of their newest vertex.

import package::real::real;
import package::state::{FLAGS_SPECULAR, Vertex, Walk};
import package::features::HAS_DELTA;
import package::params::pdf_min;
import package::surface::surface::{Surface, surface_on};
import package::surface::material::material_at;
import package::bsdf::bsdf::{BsdfSample, bsdf_at, reverse_pdf_of_sample};
import package::light::light_vertex::LightVertex;
import package::transport::seed_mis::{PartialSum, closed_by_event, inverse};
import package::transport::walk::{arrive, depart, is_absorbed};

/// The surface that the walk has hit; what scattered into its ray arrives.
fn seed_arrive(walk: ptr<function, Walk>) -> Surface {
    walk.throughput = walk.beta;
    return arrive(walk);
}

/// Sends the walk off along a sampled direction; `throughput` stays that at the surface.
fn seed_depart(walk: ptr<function, Walk>, surface: Surface, sample: BsdfSample) {
    let throughput = walk.throughput;
    depart(walk, surface, sample);
    walk.beta = walk.throughput;
    walk.throughput = throughput;
    walk.normal = surface.geometric_normal;
    walk.pdf_w = sample.pdf;
    if HAS_DELTA {
        walk.flags = select(walk.flags & ~FLAGS_SPECULAR, walk.flags | FLAGS_SPECULAR, sample.delta);
    }
}

/// The sample leads nowhere, or with a smaller density than is wanted. A delta lobe's density is infinite.
fn is_lost(sample: BsdfSample) -> bool {
    if HAS_DELTA {
        if sample.delta {
            return is_absorbed(sample);
        }
    }
    return is_absorbed(sample) || sample.pdf < pdf_min;
}

/// y_1 as it is stored.
fn first_vertex(light: ptr<function, Walk>, vertex: ptr<function, Vertex>) -> LightVertex {
    var first: LightVertex;
    first.light = vertex.hit.prim;
    first.place = vertex.hit.uv;
    first.direction = vertex.incoming;
    first.throughput = light.throughput;
    return first;
}

/// The sum at y_t, t >= 2, as it is stored where no partner is assumed.
fn stored_sum(light: ptr<function, Walk>) -> PartialSum {
    return PartialSum(inverse(light.pdf_area), light.mis);
}

/// d of y_t, t >= 2, for the ray that the light walk has sent from there: asks the material again.
fn sum_of_sent_ray(light: ptr<function, Walk>, vertex: ptr<function, Vertex>) -> real {
    let outgoing = -vertex.incoming;
    let surface = surface_on(vertex.hit.prim, vertex.hit.uv, outgoing);
    let bsdf = bsdf_at(surface, material_at(surface), outgoing);
    var event: BsdfSample;
    event.direction = light.direction;
    event.pdf = light.pdf_w;
    event.transmitted = dot(light.direction, bsdf.frame.normal) < 0.0;
    if HAS_DELTA {
        event.delta = (light.flags & FLAGS_SPECULAR) != 0u;
    }
    return closed_by_event(stored_sum(light), reverse_pdf_of_sample(bsdf, outgoing, event), event);
}
