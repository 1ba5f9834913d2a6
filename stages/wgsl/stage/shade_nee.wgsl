import package::state::{FLAGS_SPECULAR, Path, Walk};
import package::outcome::{ABSORBED, SCATTERED};
import package::params::max_edges;
import package::features::{HAS_AREA_LIGHT, HAS_DELTA, HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SKY, HAS_SPOT_LIGHT};
import package::film::splat;
import package::pass::path_pixel;
import package::random::{DIMENSION_SCATTER, WALK_EYE, random4};
import package::surface::material::{emission_at, is_emissive, material_at};
import package::bsdf::bsdf::{RADIANCE, bsdf_at, eval_bsdf, is_connectable, sample_bsdf};
import package::transport::direct::{direct_light, offer_direct_light};
import package::transport::mis::inverse_light_pdf;
import package::transport::reference::counts_met_light;
import package::transport::termination::survives;
import package::transport::walk::{arrive, depart, is_absorbed};

/// Vertex s = `path.length` of the reference's eye walk: adds emission nobody could have sampled (path of s edges),
/// samples a light (s + 1 edges) and scatters. A walk goes on only while its next vertex can still contribute.
fn shade_nee(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.length += 1u;
    let surface = arrive(walk);
    if HAS_AREA_LIGHT {
        if is_emissive(surface) && counts_met_light(walk, path.length) {
            splat(path_pixel(), walk.throughput * emission_at(surface));
        }
    }
    if path.length >= max_edges {
        return ABSORBED;
    }
    let outgoing = -walk.direction;
    let bsdf = bsdf_at(surface, material_at(surface), outgoing);
    if HAS_AREA_LIGHT || HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT || HAS_SKY {
        if is_connectable(bsdf) {
            let light = direct_light(surface, path.length);
            let scattered = eval_bsdf(bsdf, outgoing, light.direction, RADIANCE);
            offer_direct_light(walk, surface, light, scattered.value, inverse_light_pdf(light));
        }
    }
    let random = random4(WALK_EYE, path.length, DIMENSION_SCATTER);
    var sample = sample_bsdf(bsdf, outgoing, random.xyz, RADIANCE);
    var useful = path.length + 1u < max_edges;
    if HAS_DELTA {
        useful = useful || sample.delta;
        walk.flags = select(walk.flags & ~FLAGS_SPECULAR, walk.flags | FLAGS_SPECULAR, sample.delta);
    }
    if !useful || is_absorbed(sample) || !survives(walk, &sample, bsdf, path.length, random.w, RADIANCE) {
        return ABSORBED;
    }
    depart(walk, surface, sample);
    return SCATTERED;
}
