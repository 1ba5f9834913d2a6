import package::state::{Path, Walk};
import package::outcome::{ABSORBED, SCATTERED};
import package::params::max_edges;
import package::random::{DIMENSION_CHOICE, DIMENSION_SCATTER, WALK_LIGHT, random4};
import package::surface::material::material_at;
import package::surface::spawn::segment_to_point;
import package::bsdf::bsdf::{IMPORTANCE, bsdf_at, eval_bsdf, is_connectable, sample_bsdf};
import package::camera::camera::connect_camera;
import package::transport::direct::offer_particle;
import package::transport::termination::survives;
import package::transport::walk::{arrive, depart, is_absorbed};

/// Vertex y_t, t = `path.length`, of a light walk: joins it to the camera (path of t edges), whatever pixel that is, and
/// scatters.
fn shade_light(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.length += 1u;
    let surface = arrive(walk);
    let outgoing = -walk.direction;
    let bsdf = bsdf_at(surface, material_at(surface), outgoing);
    if is_connectable(bsdf) {
        let camera = connect_camera(surface.position, random4(WALK_LIGHT, path.length, DIMENSION_CHOICE).xy);
        if camera.valid {
            let scattered = eval_bsdf(bsdf, outgoing, camera.direction, IMPORTANCE);
            let contribution = walk.throughput * scattered.value * camera.importance;
            offer_particle(walk, surface, segment_to_point(surface, camera.position), contribution, camera.pixel);
        }
    }
    if path.length >= max_edges {
        return ABSORBED;
    }
    let random = random4(WALK_LIGHT, path.length, DIMENSION_SCATTER);
    var sample = sample_bsdf(bsdf, outgoing, random.xyz, IMPORTANCE);
    if is_absorbed(sample) || !survives(walk, &sample, bsdf, path.length, random.w, IMPORTANCE) {
        return ABSORBED;
    }
    depart(walk, surface, sample);
    return SCATTERED;
}
