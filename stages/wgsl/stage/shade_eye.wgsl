import package::real::{real, vec3r};
import package::state::{Path, Walk};
import package::outcome::{ENDED, SCATTERED};
import package::features::HAS_AREA_LIGHT;
import package::params::light_survival;
import package::random::{DIMENSION_SCATTER, WALK_EYE, random4};
import package::surface::surface::{NO_LIGHT, Surface};
import package::surface::material::{emission_at, is_emissive, material_at};
import package::bsdf::bsdf::{Bsdf, RADIANCE, bsdf_at, is_connectable, sample_bsdf};
import package::light::triangle_light::{emission_pdf_w, triangle_light_pdf_area};
import package::transport::advance::{advance, eye_sums, meet, surface_cosine};
import package::transport::connect::connect;
import package::transport::dimension::eye_vertex;
import package::transport::implicit::add_implicit;
import package::transport::recursive_mis::{MisPartial, join, scaled};
import package::transport::strategy::{eye_joins, eye_limit, implicit_counts, is_joined, is_used};
import package::transport::survival::goes_on;
import package::transport::walk::{arrive, is_absorbed};

/// Vertex x_s of the eye walk that belongs to light vertex y_t: adds emission that it met (path of s edges), joins x_s to y_t
/// (s + t edges) and scatters.
fn shade_eye(eye: ptr<function, Walk>, light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    eye.length += 1u;
    let s = eye.length;
    let t = path.light_length;
    let surface = arrive(eye);
    let sums = meet_light(eye, surface, s, t);
    let joins = is_joined(s, t);
    if s >= eye_limit(t) && !joins {
        return ENDED;
    }
    let bsdf = bsdf_at(surface, material_at(surface), -eye.direction);
    if joins && is_connectable(bsdf) {
        connect(eye, light, surface, bsdf, sums, s, t);
    }
    return scatter_eye(eye, surface, bsdf, sums, s, t);
}

/// The sums at x_s, where the eye walk has met `surface`; adds its emission, if that counts in the walk that begins with y_t.
fn meet_light(eye: ptr<function, Walk>, surface: Surface, s: u32, t: u32) -> MisPartial {
    let sums = meet(eye, eye_sums(eye), surface, false);
    if HAS_AREA_LIGHT {
        if is_emissive(surface) && implicit_counts(s, t) {
            add_met_emission(eye, surface, sums, s);
        }
    }
    return sums;
}

/// Adds the emission of an emitter that the eye walk has run into: the implicit strategy, weighted against sampling the emitter.
fn add_met_emission(eye: ptr<function, Walk>, surface: Surface, sums: MisPartial, s: u32) {
    var rivals = real(0.0);
    if s > 1u && surface.light != NO_LIGHT {
        let pdf_area = triangle_light_pdf_area(surface.light);
        let pdf_w = emission_pdf_w(surface, surface_cosine(surface, eye.direction));
        let sampled = select(0.0, pdf_area, is_used(s - 1u, 1u));
        rivals = join(scaled(sampled, sums.a), scaled(pdf_area * pdf_w, sums.b));
    }
    add_implicit(s, eye.throughput * emission_at(surface), rivals);
}

/// Sends the eye walk that begins with y_t on from x_s, if it may go on.
fn scatter_eye(eye: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, sums: MisPartial, s: u32, t: u32) -> u32 {
    // Written on every way, so that it has not to be kept while the ray is traced.
    eye.position = vec3r(0.0);
    if s >= eye_limit(t) {
        return ENDED;
    }
    let outgoing = -eye.direction;
    let random = random4(WALK_EYE, eye_vertex(s, t), DIMENSION_SCATTER);
    var sample = sample_bsdf(bsdf, outgoing, random.xyz, RADIANCE);
    if is_absorbed(sample) || !goes_on(eye, &sample, bsdf, s, random.w, RADIANCE) {
        return ENDED;
    }
    advance(eye, surface, bsdf, sample, sums, eye_joins(s - 1u), light_survival);
    return SCATTERED;
}
