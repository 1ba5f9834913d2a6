import package::real::{real, vec3r, vec4r};
import package::state::{FLAGS_PARALLEL, Path, Walk};
import package::outcome::{ABSORBED, SCATTERED};
import package::params::{eye_survival, max_edges, regularise, regularise_none};
import package::features::{HAS_AREA_LIGHT, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::random::{DIMENSION_SCATTER, WALK_LIGHT, random4};
import package::surface::surface::surface_on;
import package::surface::material::material_at;
import package::bsdf::bsdf::{IMPORTANCE, bsdf_at, sample_bsdf};
import package::light::emission::emit_light_ray;
import package::transport::advance::{advance, light_sums, set_sums};
import package::transport::connect::stored_light_vertex;
import package::transport::dimension::DIMENSION_DIRECTION;
import package::transport::recursive_mis::{MisPartial, scaled, source};
import package::transport::strategy::light_joins;
import package::transport::survival::goes_on;
import package::transport::walk::is_absorbed;

/// Sends the light walk on from y_t, t = `path.light_length`, when the eye walk that belongs to it is over.
fn extend_light(light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    let t = path.light_length;
    // Written on every way, so that none of it has to be kept while eye walks run.
    light.position = vec3r(0.0);
    if regularise == regularise_none {
        light.flags = 0u;
    } else {
        light.flags &= ~FLAGS_PARALLEL;
    }
    if t >= max_edges {
        return ABSORBED;
    }
    if t == 1u {
        return leave_emitter(light);
    }
    let surface = surface_on(light.hit.prim, light.hit.uv, -light.direction);
    let outgoing = -light.direction;
    let bsdf = bsdf_at(surface, material_at(surface), outgoing);
    let random = random4(WALK_LIGHT, t, DIMENSION_SCATTER);
    var sample = sample_bsdf(bsdf, outgoing, random.xyz, IMPORTANCE);
    if is_absorbed(sample) || !goes_on(light, &sample, bsdf, t, random.w, IMPORTANCE) {
        return ABSORBED;
    }
    advance(light, surface, bsdf, sample, light_sums(light), light_joins(t - 1u), eye_survival);
    return SCATTERED;
}

/// The first ray of the light walk.
fn leave_emitter(light: ptr<function, Walk>) -> u32 {
    if HAS_AREA_LIGHT || HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        let emission = emit_light_ray(stored_light_vertex(light), random4(WALK_LIGHT, 1u, DIMENSION_DIRECTION));
        light.throughput *= emission.weight;
        if any(light.throughput > vec3r(0.0)) && emission.pdf > 0.0 {
            var sums: MisPartial;
            sums.a = source(1.0 / emission.pdf);
            sums.c = scaled(emission.cosine / emission.pdf, light.mis_c);
            set_sums(light, sums);
            light.position = emission.origin;
            light.direction = emission.direction;
            if HAS_DIRECTIONAL_LIGHT || HAS_SKY {
                light.flags |= select(0u, FLAGS_PARALLEL, emission.parallel);
            }
            return SCATTERED;
        }
    }
    return ABSORBED;
}
