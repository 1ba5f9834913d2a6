import package::real::vec3r;
import package::state::{FLAGS_PARALLEL, Path, Vertex, Walk};
import package::outcome::{ABSORBED, ENDED, SCATTERED};
import package::params::{frozen_reverse_pdfs, max_edges};
import package::features::{HAS_DIRECTIONAL_LIGHT, HAS_SKY};
import package::random::{DIMENSION_CHOICE, DIMENSION_SCATTER, WALK_LIGHT, random4};
import package::scene::scene;
import package::surface::surface::Surface;
import package::surface::material::material_at;
import package::surface::spawn::segment_to_point;
import package::bsdf::bsdf::{Bsdf, IMPORTANCE, bsdf_at, eval_bsdf, is_connectable, reverse_pdf_bsdf, sample_bsdf};
import package::camera::camera::connect_camera;
import package::transport::advance::surface_cosine;
import package::transport::direct::offer_particle;
import package::transport::seed_mis::{PartialSum, assumed_reverse_pdf, closed, eye_rays, limited, met_sum};
import package::transport::seed_walk::{is_lost, seed_arrive, seed_depart, sum_of_sent_ray};
import package::transport::termination::survives;

/// Takes up the stored hit as vertex y_t of the light walk, t >= 2: joins it to the camera (path of t edges), whatever pixel that is,
/// and draws the ray that leaves it.
fn seed_extend_light(light: ptr<function, Walk>, vertex: ptr<function, Vertex>, path: ptr<function, Path>) -> u32 {
    path.light_length += 1u;
    let t = path.light_length;
    var left = light.mis;
    if !frozen_reverse_pdfs {
        // d of y_1 does not depend on where the ray went.
        if t > 2u {
            left = sum_of_sent_ray(light, vertex);
        }
    }
    let surface = seed_arrive(light);
    let sum = met_sum(light, surface, left, arrives_parallel(light));
    light.flags &= ~FLAGS_PARALLEL;
    vertex.hit = light.hit;
    vertex.incoming = light.direction;
    let outgoing = -light.direction;
    let bsdf = bsdf_at(surface, material_at(surface), outgoing);
    light.mis = sum.farther;
    if frozen_reverse_pdfs {
        let camera = normalize(vec3r(scene.camera_origin.xyz) - surface.position);
        light.mis = closed(sum, assumed_reverse_pdf(bsdf, outgoing, camera));
    }
    if is_connectable(bsdf) {
        join_camera(light, surface, bsdf, sum, t);
    }
    return send_light_ray(light, surface, bsdf, t);
}

/// Whether the ray came from a light at infinity.
fn arrives_parallel(light: ptr<function, Walk>) -> bool {
    if HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        return (light.flags & FLAGS_PARALLEL) != 0u;
    }
    return false;
}

/// Offers the light that y_t sends to the camera: strategy (0, t).
fn join_camera(light: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, sum: PartialSum, t: u32) {
    let camera = connect_camera(surface.position, random4(WALK_LIGHT, t, DIMENSION_CHOICE).xy);
    if !camera.valid {
        return;
    }
    let outgoing = -light.direction;
    let scattered = eval_bsdf(bsdf, outgoing, camera.direction, IMPORTANCE);
    let light_sum = closed(sum, reverse_pdf_bsdf(bsdf, outgoing, camera.direction));
    let pdf_area = camera.importance * surface_cosine(surface, camera.direction);
    let contribution = light.throughput * scattered.value * (camera.importance / (1.0 + pdf_area * light_sum));
    offer_particle(light, surface, segment_to_point(surface, camera.position), limited(contribution), camera.pixel);
}

/// Draws the ray to y_(t+1), which waits for the eye walk of y_t.
fn send_light_ray(light: ptr<function, Walk>, surface: Surface, bsdf: Bsdf, t: u32) -> u32 {
    light.pdf_w = 0.0;
    if eye_rays(t) == 0u {
        return ENDED;
    }
    // The last light vertex sends no ray: nothing would read its hit.
    if t >= max_edges {
        return ABSORBED;
    }
    let random = random4(WALK_LIGHT, t, DIMENSION_SCATTER);
    var sample = sample_bsdf(bsdf, -light.direction, random.xyz, IMPORTANCE);
    if is_lost(sample) || !survives(light, &sample, bsdf, t, random.w, IMPORTANCE) {
        return ABSORBED;
    }
    seed_depart(light, surface, sample);
    return SCATTERED;
}
