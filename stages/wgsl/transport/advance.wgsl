//! Steps of a walk that carries sums for multiple importance sampling; eye and light walks share them.

import package::real::{real, vec3r};
import package::state::Walk;
import package::surface::surface::Surface;
import package::bsdf::bsdf::{Bsdf, BsdfSample, reverse_pdf_of_sample};
import package::features::HAS_DELTA;
import package::transport::walk::depart;
import package::transport::recursive_mis::{MisPartial, arrived_sums, scattered_sums, specular_sums};

/// The sums that a light walk carries.
fn light_sums(light: ptr<function, Walk>) -> MisPartial {
    return MisPartial(light.mis_a, light.mis_b, light.mis_c);
}

/// The sums that an eye walk carries: what stands for hitting the light is on the other side.
fn eye_sums(eye: ptr<function, Walk>) -> MisPartial {
    return MisPartial(eye.mis_a, eye.mis_b, 0.0);
}

/// Stores the sums in the walk.
fn set_sums(walk: ptr<function, Walk>, sums: MisPartial) {
    walk.mis_a = sums.a;
    walk.mis_b = sums.b;
    walk.mis_c = sums.c;
}

/// |cosine| of a direction at a surface, by the geometric normal: that of the measure in which the sums count.
fn surface_cosine(surface: Surface, direction: vec3r) -> real {
    return abs(dot(surface.geometric_normal, direction));
}

/// The sums, before `sums`, after the walk's ray has met `surface`; `parallel`: it came from infinity.
fn meet(walk: ptr<function, Walk>, sums: MisPartial, surface: Surface, parallel: bool) -> MisPartial {
    let distance = select(walk.hit.t, 1.0, parallel);
    return arrived_sums(sums, distance * distance, surface_cosine(surface, walk.direction));
}

/// Sends the walk on along a sampled direction. `sums` are those at the surface, `ended` as in `scattered_sums`,
/// `reverse_survival` the probability with which the other kind of walk goes on.
fn advance(walk: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, sample: BsdfSample, sums: MisPartial, ended: real, reverse_survival: real) {
    let reverse_pdf = reverse_pdf_of_sample(bsdf, -walk.direction, sample);
    let cosine = surface_cosine(surface, sample.direction);
    var next: MisPartial;
    if HAS_DELTA && sample.delta {
        next = specular_sums(sums, sample.pdf, reverse_pdf, cosine);
    } else {
        next = scattered_sums(sums, sample.pdf, reverse_survival * reverse_pdf, cosine, ended);
    }
    set_sums(walk, next);
    depart(walk, surface, sample);
}
