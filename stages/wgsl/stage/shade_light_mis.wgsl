import package::real::{real, vec3r};
import package::state::{FLAGS_PARALLEL, Path, Walk};
import package::outcome::{ENDED, SCATTERED, UNJOINED};
import package::params::{eye_survival, walk_share};
import package::features::{HAS_DIRECTIONAL_LIGHT, HAS_SKY};
import package::random::{DIMENSION_CHOICE, WALK_LIGHT, random4};
import package::surface::surface::Surface;
import package::surface::material::material_at;
import package::surface::spawn::segment_to_point;
import package::bsdf::bsdf::{Bsdf, IMPORTANCE, bsdf_at, eval_bsdf, is_connectable, reverse_pdf_bsdf};
import package::camera::camera::connect_camera;
import package::tallies::count_light_vertices;
import package::transport::advance::{light_sums, meet, set_sums, surface_cosine};
import package::transport::direct::offer_particle_strategy;
import package::transport::recursive_mis::{MisPartial, closed_sum, scaled, weight_over};
import package::transport::strategy::{eye_limit, first_joined, implicit_term, is_used, light_joins};
import package::transport::walk::arrive;

/// The light walk arrives at y_t, t >= 2: joins it to the camera (path of t edges), whatever pixel that is.
fn shade_light_mis(light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.light_length += 1u;
    let t = path.light_length;
    if first_joined(t) == t {
        count_light_vertices(t);
    }
    let surface = arrive(light);
    var parallel = false;
    if HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        parallel = (light.flags & FLAGS_PARALLEL) != 0u;
    }
    let sums = meet(light, light_sums(light), surface, parallel);
    set_sums(light, sums);
    if is_used(0u, t) {
        let bsdf = bsdf_at(surface, material_at(surface), -light.direction);
        if is_connectable(bsdf) {
            join_camera(light, surface, bsdf, sums, t);
        }
    }
    // The last vertex has an eye walk only where that may still meet light.
    if eye_limit(first_joined(t)) == 0u {
        return ENDED;
    }
    if walk_share < 1.0 && random4(WALK_LIGHT, t, DIMENSION_CHOICE).z >= walk_share {
        return UNJOINED;
    }
    return SCATTERED;
}

/// Offers the light that y_t sends to the camera: the particle strategy.
fn join_camera(light: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, sums: MisPartial, t: u32) {
    let camera = connect_camera(surface.position, random4(WALK_LIGHT, t, DIMENSION_CHOICE).xy);
    if !camera.valid {
        return;
    }
    let outgoing = -light.direction;
    let scattered = eval_bsdf(bsdf, outgoing, camera.direction, IMPORTANCE);
    let reverse_pdf = eye_survival * reverse_pdf_bsdf(bsdf, outgoing, camera.direction);
    let rivals = closed_sum(sums, reverse_pdf, light_joins(t - 1u), implicit_term(t));
    let pdf_area = camera.importance * surface_cosine(surface, camera.direction);
    let weight = weight_over(1.0, scaled(pdf_area, rivals));
    let unweighted = light.throughput * scattered.value * camera.importance;
    let segment = segment_to_point(surface, camera.position);
    offer_particle_strategy(light, surface, segment, unweighted * weight, unweighted, t, camera.pixel);
}
