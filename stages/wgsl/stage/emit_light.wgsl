import package::real::vec3r;
import package::state::{Path, Walk};
import package::outcome::{ABSORBED, EMITTED};
import package::params::max_edges;
import package::features::{HAS_AREA_LIGHT, HAS_ATTENUATION, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::random::{DIMENSION_EMIT, WALK_LIGHT, random4};
import package::light::emission::{emit_light_ray, sample_light_vertex};
import package::transport::dimension::{DIMENSION_DIRECTION, random_extra};
import package::transport::medium::NO_MEDIUM;

/// Starts a light walk at y_1, a point on a light. Its next vertex y_2 makes paths of two edges.
fn emit_light(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.length = 1u;
    if HAS_AREA_LIGHT || HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        let random = random4(WALK_LIGHT, 1u, DIMENSION_EMIT);
        let direction = random4(WALK_LIGHT, 1u, DIMENSION_DIRECTION);
        let vertex = sample_light_vertex(random, random_extra(WALK_LIGHT, 1u));
        let emission = emit_light_ray(vertex, direction);
        walk.position = emission.origin;
        walk.direction = emission.direction;
        walk.throughput = vertex.throughput * emission.weight;
        walk.flags = 0u;
        if HAS_ATTENUATION {
            walk.medium = NO_MEDIUM;
        }
        if max_edges > 1u && any(walk.throughput > vec3r(0.0)) {
            return EMITTED;
        }
    }
    return ABSORBED;
}
