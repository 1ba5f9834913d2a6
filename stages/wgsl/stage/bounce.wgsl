import package::real::{real, vec3r};
import package::state::{Path, Walk};
import package::outcome::{SCATTERED, ABSORBED};
import package::params::max_edges;
import package::math::frame::{frame_of, to_world};
import package::random::{random4, DIMENSION_SCATTER, WALK_EYE};
import package::sample::hemisphere::sample_cosine_hemisphere;
import package::surface::spawn::spawn_origin;
import package::surface::surface::surface_at;

/// Sends the walk on in a cosine-distributed direction on the side it came from, whatever the material: the incoherent rays of the
/// ray-rate measurement.
fn bounce(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.length += 1u;
    if path.length >= max_edges {
        return ABSORBED;
    }
    let surface = surface_at(walk.hit, walk.direction);
    let normal = select(-surface.geometric_normal, surface.geometric_normal, surface.front);
    let random = random4(WALK_EYE, path.length, DIMENSION_SCATTER);
    let direction = to_world(frame_of(normal), sample_cosine_hemisphere(random.xy));
    walk.position = spawn_origin(surface, direction);
    walk.direction = direction;
    return SCATTERED;
}
