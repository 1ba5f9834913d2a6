import package::real::real;
import package::state::{Path, Vertex, Walk};
import package::outcome::SCATTERED;
import package::params::{frozen_reverse_pdfs, max_edges, weigh_direct_particle};
import package::features::HAS_AREA_LIGHT;
import package::film::splat;
import package::pass::path_pixel;
import package::random::{DIMENSION_SCATTER, WALK_EYE, random4};
import package::surface::surface::{NO_LIGHT, Surface};
import package::surface::material::{emission_at, is_emissive, material_at};
import package::bsdf::bsdf::{RADIANCE, bsdf_at, is_connectable, reverse_pdf_of_sample, sample_bsdf};
import package::light::triangle_light::{emission_pdf_w, triangle_light_pdf_area};
import package::stage::seed_connect::next_light_vertex;
import package::transport::advance::surface_cosine;
import package::transport::dimension::eye_vertex;
import package::transport::seed_join::{join_light, light_side};
import package::transport::seed_mis::{PartialSum, assumed_reverse_pdf, closed, closed_by_event, met_sum};
import package::transport::seed_mis::{eye_rays, implicit_counts, implicit_samples, limited};
import package::transport::seed_walk::{is_lost, seed_arrive, seed_depart};
import package::transport::termination::survives;

/// Vertex x_s of the eye walk that belongs to light vertex y_t: adds emission that it met (path of s edges), joins x_s to y_t
/// (s + t edges) and sends the next ray.
fn seed_extend_eye(eye: ptr<function, Walk>, light: ptr<function, Walk>, vertex: ptr<function, Vertex>, path: ptr<function, Path>) -> u32 {
    path.eye_length += 1u;
    let s = path.eye_length;
    let t = path.light_length;
    let surface = seed_arrive(eye);
    let sum = met_sum(eye, surface, eye.mis, false);
    eye.pdf_w = 0.0;
    if HAS_AREA_LIGHT {
        if is_emissive(surface) && implicit_counts(t) {
            add_emission(eye, surface, sum, s);
        }
    }
    if s + t > max_edges {
        return next_light_vertex(light);
    }
    let outgoing = -eye.direction;
    let bsdf = bsdf_at(surface, material_at(surface), outgoing);
    let side = light_side(light, vertex, surface, t);
    // For the connection itself the assumed partner is the true one.
    eye.mis = closed(sum, assumed_reverse_pdf(bsdf, outgoing, side.end.direction));
    if is_connectable(bsdf) {
        join_light(eye, light, surface, bsdf, side, eye.mis);
    }
    if s >= eye_rays(t) {
        return next_light_vertex(light);
    }
    let random = random4(WALK_EYE, eye_vertex(s, t), DIMENSION_SCATTER);
    var sample = sample_bsdf(bsdf, outgoing, random.xyz, RADIANCE);
    if is_lost(sample) || !survives(eye, &sample, bsdf, s, random.w, RADIANCE) {
        return next_light_vertex(light);
    }
    if !frozen_reverse_pdfs {
        eye.mis = closed_by_event(sum, reverse_pdf_of_sample(bsdf, outgoing, sample), sample);
    }
    seed_depart(eye, surface, sample);
    return SCATTERED;
}

/// Adds the emission of an emitter that the eye walk has run into: strategy (s, 0), weighted against those that start on the emitter.
fn add_emission(eye: ptr<function, Walk>, surface: Surface, sum: PartialSum, s: u32) {
    var rivals = real(0.0);
    if surface.light != NO_LIGHT && (s > 1u || weigh_direct_particle) {
        let pdf_w = emission_pdf_w(surface, surface_cosine(surface, eye.direction));
        rivals = triangle_light_pdf_area(surface.light) * closed(sum, pdf_w);
    }
    splat(path_pixel(), limited(eye.throughput * emission_at(surface) / (implicit_samples() + rivals)));
}
