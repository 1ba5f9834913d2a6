import package::state::Walk;
import package::outcome::DONE;
import package::features::HAS_AREA_LIGHT;
import package::film::splat;
import package::pass::path_pixel;
import package::surface::material::{emission_at, is_emissive};
import package::transport::walk::arrive;

/// The light tracer's paths of one edge: emission that the camera sees directly. Emitters are not joined to the camera.
fn see_emitter(walk: ptr<function, Walk>) -> u32 {
    if HAS_AREA_LIGHT {
        let surface = arrive(walk);
        if is_emissive(surface) {
            splat(path_pixel(), walk.throughput * emission_at(surface));
        }
    }
    return DONE;
}
