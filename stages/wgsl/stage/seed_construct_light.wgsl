import package::real::vec3r;
import package::state::{FLAGS_PARALLEL, Hit, Path, Vertex, Walk};
import package::outcome::{ABSORBED, EMITTED};
import package::params::{max_edges, sky_strategy, sky_strategy_sampled};
import package::features::{HAS_AREA_LIGHT, HAS_ATTENUATION, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::random::{DIMENSION_EMIT, WALK_LIGHT, random4};
import package::surface::surface::surface_on;
import package::light::emission::{emit_light_ray, sample_light_vertex};
import package::light::light_vertex::{Emission, LightVertex};
import package::light::table::{LIGHT_SKY, LIGHT_TRIANGLE, light_kind};
import package::light::triangle_light::triangle_of;
import package::transport::dimension::{DIMENSION_DIRECTION, random_extra};
import package::transport::medium::NO_MEDIUM;
import package::transport::seed_mis::{implicit_samples, inverse};

/// Starts a sample: y_1 on a light, and at once the ray that leaves it.
fn seed_construct_light(light: ptr<function, Walk>, vertex: ptr<function, Vertex>, path: ptr<function, Path>) -> u32 {
    path.light_length = 1u;
    var nothing: Hit;
    light.hit = nothing;
    vertex.hit = nothing;
    vertex.incoming = vec3r(0.0);
    light.throughput = vec3r(0.0);
    light.beta = vec3r(0.0);
    light.position = vec3r(0.0);
    light.direction = vec3r(0.0);
    light.normal = vec3r(0.0);
    light.pdf_w = 0.0;
    light.pdf_area = 0.0;
    light.mis = 0.0;
    light.flags = 0u;
    if HAS_ATTENUATION {
        light.medium = NO_MEDIUM;
    }
    if HAS_AREA_LIGHT || HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        let first = sample_light_vertex(random4(WALK_LIGHT, 1u, DIMENSION_EMIT), random_extra(WALK_LIGHT, 1u));
        vertex.hit.prim = first.light;
        vertex.hit.uv = first.place;
        vertex.incoming = first.direction;
        if is_source(first) {
            light.throughput = first.throughput;
            light.pdf_area = first.pdf;
            // The eye walk that hits the light is the only other strategy; there is none for lights without extent.
            light.mis = implicit_samples() * inverse(first.pdf);
            if max_edges > 1u {
                return send_first_ray(light, first);
            }
        }
    }
    return ABSORBED;
}

/// Whether light walks start here; where the sky is no light, those that would start in it stay dark.
fn is_source(first: LightVertex) -> bool {
    if HAS_SKY && sky_strategy != sky_strategy_sampled {
        return light_kind(first.light) != LIGHT_SKY;
    }
    return true;
}

/// The ray that leaves y_1.
fn send_first_ray(light: ptr<function, Walk>, first: LightVertex) -> u32 {
    let emission = emit_light_ray(first, random4(WALK_LIGHT, 1u, DIMENSION_DIRECTION));
    light.beta = first.throughput * emission.weight;
    if !(emission.pdf > 0.0) || all(light.beta == vec3r(0.0)) {
        return ABSORBED;
    }
    light.position = emission.origin;
    light.direction = emission.direction;
    light.normal = emitting_normal(first, emission);
    light.pdf_w = emission.pdf;
    if HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        light.flags = select(0u, FLAGS_PARALLEL, emission.parallel);
    }
    return EMITTED;
}

/// Normal of the emitter; of lights that have none the direction itself, so that the cosine between both is 1.
fn emitting_normal(first: LightVertex, emission: Emission) -> vec3r {
    if HAS_AREA_LIGHT {
        if light_kind(first.light) == LIGHT_TRIANGLE {
            return surface_on(triangle_of(first.light), first.place, emission.direction).geometric_normal;
        }
    }
    return emission.direction;
}
