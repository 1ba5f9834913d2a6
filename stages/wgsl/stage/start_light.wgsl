import package::real::{vec2r, vec3r};
import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::features::{HAS_AREA_LIGHT, HAS_ATTENUATION, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::light::emission::sample_light_vertex;
import package::random::{DIMENSION_EMIT, WALK_LIGHT, random4};
import package::tallies::count_light_vertices;
import package::transport::advance::set_sums;
import package::transport::dimension::random_extra;
import package::transport::medium::NO_MEDIUM;
import package::transport::recursive_mis::{MisPartial, source};

/// Starts a sample with a vertex y_1 on a light. Its direction is drawn when the light walk goes on.
fn start_light(light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.light_length = 1u;
    count_light_vertices(1u);
    light.hit.prim = 0u;
    light.hit.uv = vec2r(0.0);
    light.direction = vec3r(0.0);
    light.throughput = vec3r(0.0);
    var sums: MisPartial;
    if HAS_AREA_LIGHT || HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        let random = random4(WALK_LIGHT, 1u, DIMENSION_EMIT);
        let vertex = sample_light_vertex(random, random_extra(WALK_LIGHT, 1u));
        light.hit.prim = vertex.light;
        light.hit.uv = vertex.place;
        light.direction = vertex.direction;
        light.throughput = vertex.throughput;
        if vertex.pdf > 0.0 {
            sums.c = source(1.0 / vertex.pdf);
        }
    }
    set_sums(light, sums);
    light.flags = 0u;
    if HAS_ATTENUATION {
        light.medium = NO_MEDIUM;
    }
    return EMITTED;
}
