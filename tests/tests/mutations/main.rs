//! Deliberate errors in the stages, one by one, and for each the comparison that has to notice it.

mod checks;

use checks::{
    BELOW_A_POINT, CAUSTIC_FROM_BOTH_SIDES, CEILING_FROM_BOTH_SIDES, COARSE_BALL, CORNELL_BOX, DISK_OF_LIGHT,
    EMITTER_INSIDE_GLASS, FLOOR_INSIDE_GLASS, FLOOR_INSIDE_ROUGH_GLASS, FURNACE_BY_FEW_WALKS, FURNACE_BY_MORTAL_WALKS,
    FURNACE_BY_PAIRS, FURNACE_BY_WHOLE_WALKS, FURNACE_FROM_THE_CAMERA, FURNACE_FROM_THE_LIGHTS, INSIDE_COLOURED_GLASS,
    LAMPS_FROM_THE_LIGHTS, LEANING_NORMALS, MIRROR, NEAR_PANELS_FROM_BOTH_SIDES, NEAR_PANELS_FROM_THE_CAMERA,
    NEAR_PANELS_FROM_THE_LIGHTS, PANELS_OVER_METAL, SKY_AND_HIDDEN_LAMP, SUN_AND_SKY_FROM_BOTH_SIDES,
    SUN_AND_SKY_FROM_THE_CAMERA, SUN_AND_SKY_FROM_THE_LIGHTS, THROUGH_A_LENS, WHITE_METAL,
};
use tests::mutation::{Mutation, assert_noticed};

#[test]
fn errors_of_the_camera() {
    assert_noticed(&[
        Mutation {
            name: "splats lie half a pixel beside their place",
            module: "camera/camera",
            old: "* (0.5 * size);",
            new: "* (0.5 * size) + vec2r(0.5);",
            check: &DISK_OF_LIGHT,
        },
        Mutation {
            name: "a cosine is missing in the density of camera rays",
            module: "camera/camera",
            old: "cosine * cosine * cosine",
            new: "cosine * cosine",
            check: &LEANING_NORMALS,
        },
        Mutation {
            name: "light meets the middle of the lens alone",
            module: "camera/camera",
            old: "        offset = lens_point(random);\n        connection",
            new: "        offset = vec3r(0.0);\n        connection",
            check: &THROUGH_A_LENS,
        },
        Mutation {
            name: "connections do not know the plane in focus",
            module: "camera/camera",
            old: "plane += offset.xy / real(scene.camera_forward.w);",
            new: "plane += offset.xy;",
            check: &THROUGH_A_LENS,
        },
    ]);
}

#[test]
fn errors_of_emitters() {
    assert_noticed(&[
        Mutation {
            name: "the cosine at the light is missing in connections",
            module: "light/triangle_light",
            old: "sample.cosine = abs(dot(point.geometric_normal, sample.direction));",
            new: "sample.cosine = 1.0;",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
        Mutation {
            name: "the cosine of emission counts twice",
            module: "light/triangle_light",
            old: "emission.weight = vec3r(sides * PI);",
            new: "emission.weight = vec3r(sides * PI * emission.cosine);",
            check: &NEAR_PANELS_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "the choice of a side is missing in emission",
            module: "light/triangle_light",
            old: "emission.weight = vec3r(sides * PI);",
            new: "emission.weight = vec3r(PI);",
            check: &LAMPS_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "every light emits from its back as well",
            module: "surface/material",
            old: "return faces && ",
            new: "return ",
            check: &NEAR_PANELS_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "points on triangles crowd at an edge",
            module: "sample/triangle",
            old: "if random.y > random.x {\n        let first = 0.5 * random.x;\n        return vec2r(first, random.y - first);",
            new: "if random.y >= 0.0 {\n        return vec2r(random.x, random.y * (1.0 - random.x));",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
        Mutation {
            name: "the squared distance to a point light is missing",
            module: "light/point_light",
            old: "sample.density = pick_probability(light) * distance_squared;",
            new: "sample.density = pick_probability(light);",
            check: &BELOW_A_POINT,
        },
        Mutation {
            name: "spot lights emit without their falloff",
            module: "light/point_light",
            old: "vec3r(point_light_falloff(vertex.light, emission.direction) / emission.pdf)",
            new: "vec3r(1.0 / emission.pdf)",
            check: &LAMPS_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "the disk of lights at infinity has half its radius in the density",
            module: "light/directional_light",
            old: "let radius = real(scene.bounds.w);",
            new: "let radius = 0.5 * real(scene.bounds.w);",
            check: &SUN_AND_SKY_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "the sine of the polar angle is missing in the sky's density",
            module: "light/sky",
            old: "real(sky_texels[sky_texel(point.uv)].w) / point.sine_polar",
            new: "real(sky_texels[sky_texel(point.uv)].w)",
            check: &SKY_AND_HIDDEN_LAMP,
        },
        Mutation {
            name: "the sine of the polar angle is missing in emission from the sky",
            module: "light/sky",
            old: "drawn.density / drawn.point.sine_polar;",
            new: "drawn.density;",
            check: &SUN_AND_SKY_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "slot and alias are swapped when a light is picked",
            module: "light/table",
            old: "select(entry.y, slot,",
            new: "select(slot, entry.y,",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
    ]);
}

#[test]
fn errors_of_weights() {
    assert_noticed(&[
        Mutation {
            name: "light that is met counts in full beside light that is sampled",
            module: "stage/shade_mis",
            old: "emission_at(surface) * weight",
            new: "emission_at(surface)",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
        Mutation {
            name: "the sky that is met counts in full beside the sky that is sampled",
            module: "stage/escape_mis",
            old: "sky_radiance(walk.direction) * weight",
            new: "sky_radiance(walk.direction)",
            check: &SUN_AND_SKY_FROM_THE_CAMERA,
        },
        Mutation {
            name: "the pick probability is missing in the density of hitting the sky",
            module: "light/sky",
            old: "return real(sky_frame.turn.z) * real(",
            new: "return real(",
            check: &SKY_AND_HIDDEN_LAMP,
        },
        Mutation {
            name: "a wrong pick probability in the density of hitting a light",
            module: "light/light",
            old: "return triangle_light_pdf_area(emitter.light) *",
            new: "return 0.5 * triangle_light_pdf_area(emitter.light) *",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
        Mutation {
            name: "connections are weighted with the density of the wrong direction",
            module: "stage/shade_mis",
            old: "weighted_inverse_light_pdf(light, scattered.pdf)",
            new: "weighted_inverse_light_pdf(light, eval_bsdf(bsdf, light.direction, outgoing, RADIANCE).pdf)",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
        Mutation {
            name: "one strategy uses the power heuristic, the other the balance heuristic",
            module: "transport/mis",
            old: "let ratio = light_pdf / scatter_pdf;\n    if heuristic == heuristic_power {",
            new: "let ratio = light_pdf / scatter_pdf;\n    if heuristic != heuristic_power {",
            check: &NEAR_PANELS_FROM_THE_CAMERA,
        },
        Mutation {
            name: "a mirror counts as a strategy that could have sampled the light",
            module: "stage/shade_mis",
            old: "select(sample.pdf, 0.0, sample.delta)",
            new: "sample.pdf",
            check: &MIRROR,
        },
        Mutation {
            name: "the reference forgets light behind mirrors",
            module: "transport/reference",
            old: "counts = counts || (walk.flags & FLAGS_SPECULAR) != 0u;",
            new: "counts = counts || false;",
            check: &MIRROR,
        },
    ]);
}

#[test]
fn errors_of_scattering() {
    assert_noticed(&[
        Mutation {
            name: "the cosine of scattering is missing",
            module: "bsdf/bsdf",
            old: "result.value = lobes.f * scattering_cosine(bsdf, outgoing, incoming, mode);",
            new: "result.value = lobes.f;",
            check: &LEANING_NORMALS,
        },
        Mutation {
            name: "pi is missing in Lambert's law",
            module: "bsdf/lambert",
            old: "return albedo * INVERSE_PI;",
            new: "return albedo;",
            check: &BELOW_A_POINT,
        },
        Mutation {
            name: "microfacets do not mask each other",
            module: "bsdf/ggx",
            old: "return ggx_distribution(half_vector, alpha) / (2.0 * shadowing);",
            new: "return ggx_distribution(half_vector, alpha) / (4.0 * outgoing.z * incoming.z);",
            check: &WHITE_METAL,
        },
        Mutation {
            name: "the density of microfacets is that of all, not of visible ones",
            module: "bsdf/ggx",
            old: "return 0.25 * smith_masking_over_cosine(outgoing, alpha) * ggx_distribution(half_vector, alpha);",
            new: "return 0.25 * ggx_distribution(half_vector, alpha) * half_vector.z / dot(outgoing, half_vector);",
            check: &PANELS_OVER_METAL,
        },
        Mutation {
            name: "eta^2 scales radiance on the wrong side",
            module: "bsdf/bsdf",
            old: "weight /= bsdf.eta * bsdf.eta;",
            new: "weight *= bsdf.eta * bsdf.eta;",
            check: &EMITTER_INSIDE_GLASS,
        },
        Mutation {
            name: "eta^2 scales importance as well",
            module: "bsdf/bsdf",
            old: "if mode == RADIANCE || !refraction_adjoint {",
            new: "if mode == RADIANCE || mode == IMPORTANCE || !refraction_adjoint {",
            check: &FLOOR_INSIDE_GLASS,
        },
        Mutation {
            name: "rough glass scatters importance as radiance",
            module: "bsdf/bsdf",
            old: "result.value *= bsdf.eta * bsdf.eta;",
            new: "result.value *= 1.0;",
            check: &FLOOR_INSIDE_ROUGH_GLASS,
        },
        Mutation {
            name: "eta^2 is missing in the density of refraction",
            module: "bsdf/dielectric",
            old: "common_factor * eta * eta,",
            new: "common_factor,",
            check: &FLOOR_INSIDE_ROUGH_GLASS,
        },
        Mutation {
            name: "inside and outside of glass are swapped",
            module: "bsdf/bsdf",
            old: "select(1.0 / bsdf.ior, bsdf.ior, side > 0.0)",
            new: "select(bsdf.ior, 1.0 / bsdf.ior, side > 0.0)",
            check: &EMITTER_INSIDE_GLASS,
        },
        Mutation {
            name: "importance is not corrected for shading normals",
            module: "bsdf/bsdf",
            old: "return abs(dot(incoming, bsdf.facing_normal))\n            * dot(outgoing, bsdf.frame.normal) / dot(outgoing, bsdf.facing_normal);",
            new: "return abs(dot(incoming, bsdf.frame.normal));",
            check: &COARSE_BALL,
        },
        Mutation {
            name: "the correction for shading normals is upside down",
            module: "bsdf/bsdf",
            old: "* dot(outgoing, bsdf.frame.normal) / dot(outgoing, bsdf.facing_normal);",
            new: "* dot(outgoing, bsdf.facing_normal) / dot(outgoing, bsdf.frame.normal);",
            check: &LEANING_NORMALS,
        },
    ]);
}

#[test]
fn errors_of_walks() {
    assert_noticed(&[
        Mutation {
            name: "shadow rays are not absorbed",
            module: "transport/direct",
            old: "connection.contribution *= transmittance(medium, segment.distance);",
            new: "connection.contribution *= transmittance(medium, 0.0);",
            check: &INSIDE_COLOURED_GLASS,
        },
        Mutation {
            name: "walks enter a solid when they leave it",
            module: "transport/medium",
            old: "return select(NO_MEDIUM, medium_of(surface), surface.front);",
            new: "return select(medium_of(surface), NO_MEDIUM, surface.front);",
            check: &EMITTER_INSIDE_GLASS,
        },
        Mutation {
            name: "shadow rays reach beyond their end",
            module: "stage/resolve",
            old: "connection.distance, key",
            new: "2.0 * connection.distance, key",
            check: &CORNELL_BOX,
        },
        Mutation {
            name: "light walks have one edge too many",
            module: "stage/shade_light",
            old: "if path.length >= max_edges {",
            new: "if path.length > max_edges {",
            check: &FURNACE_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "every bounce draws the same numbers",
            module: "stage/shade_mis",
            old: "random4(WALK_EYE, path.length, DIMENSION_SCATTER)",
            new: "random4(WALK_EYE, 1u, DIMENSION_SCATTER)",
            check: &CORNELL_BOX,
        },
        Mutation {
            name: "connections to the camera carry the density of scattering, not its value",
            module: "stage/shade_light",
            old: "walk.throughput * scattered.value * camera.importance;",
            new: "walk.throughput * scattered.pdf * camera.importance;",
            check: &FURNACE_FROM_THE_LIGHTS,
        },
        Mutation {
            name: "walks go on without the weight of scattering",
            module: "transport/walk",
            old: "walk.throughput *= sample.weight;",
            new: "walk.throughput *= 1.0;",
            check: &FURNACE_FROM_THE_CAMERA,
        },
    ]);
}

#[test]
fn errors_of_bidirectional_weights() {
    assert_noticed(&[
        Mutation {
            name: "the implicit strategy counts as twice as many samples",
            module: "transport/strategy",
            old: "return samples;",
            new: "return 2.0 * samples;",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the density forwards stands for the density in reverse",
            module: "transport/recursive_mis",
            old: "next.b = scaled(cosine / pdf, join(scaled(ended, sums.a), scaled(reverse_pdf, sums.b)));",
            new: "next.b = scaled(cosine / pdf, join(scaled(ended, sums.a), scaled(pdf, sums.b)));",
            check: &FURNACE_BY_WHOLE_WALKS,
        },
        Mutation {
            name: "the sums a and b are swapped at connections",
            module: "transport/recursive_mis",
            old: "let walked = join(scaled(ended, sums.a), scaled(reverse_pdf, sums.b));",
            new: "let walked = join(scaled(ended, sums.b), scaled(reverse_pdf, sums.a));",
            check: &CEILING_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the sum c of the strategy that hits the light is dropped",
            module: "transport/recursive_mis",
            old: "return join(walked, scaled(hits * reverse_pdf, sums.c));",
            new: "return walked;",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the cosine of the arriving direction stands for that of the leaving one",
            module: "transport/advance",
            old: "let cosine = surface_cosine(surface, sample.direction);",
            new: "let cosine = surface_cosine(surface, walk.direction);",
            check: &FURNACE_BY_WHOLE_WALKS,
        },
        Mutation {
            name: "the squared distance is missing in a",
            module: "transport/recursive_mis",
            old: "sums.a * (distance_squared * inverse_cosine)",
            new: "sums.a * inverse_cosine",
            check: &CEILING_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the density of the emitted direction is missing for light that is met",
            module: "stage/shade_eye",
            old: "scaled(pdf_area * pdf_w, sums.b)",
            new: "scaled(pdf_area, sums.b)",
            check: &FURNACE_BY_WHOLE_WALKS,
        },
        Mutation {
            name: "a delta lobe can be joined in the sums",
            module: "transport/advance",
            old: "if HAS_DELTA && sample.delta {",
            new: "if HAS_DELTA && sample.pdf < 0.0 {",
            check: &CAUSTIC_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the light vertex of a connection scatters radiance",
            module: "transport/connect",
            old: "eval_bsdf(bsdf, outgoing, -side.end.direction, IMPORTANCE)",
            new: "eval_bsdf(bsdf, outgoing, -side.end.direction, RADIANCE)",
            check: &CEILING_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the eye's side is missing in the weight of connections",
            module: "transport/connect",
            old: "join(eye_side, light_side)",
            new: "light_side",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the light's side is missing in the weight of connections",
            module: "transport/connect",
            old: "join(eye_side, light_side)",
            new: "eye_side",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the explicit strategy counts twice",
            module: "transport/connect",
            old: "transported * weight,",
            new: "transported * (weight * select(1.0, 2.0, t == 1u)),",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "connections that few eye walks make weigh as if all did",
            module: "transport/connect",
            old: "join_samples(s, t) * end.distance_squared",
            new: "1.0 * end.distance_squared",
            check: &FURNACE_BY_FEW_WALKS,
        },
        Mutation {
            name: "walks that go on by chance do not carry the light of those that end",
            module: "transport/survival",
            old: "sample.weight /= probability;\n",
            new: "",
            check: &FURNACE_BY_MORTAL_WALKS,
        },
        Mutation {
            name: "densities in reverse do not know that walks may end",
            module: "transport/advance",
            old: "reverse_survival * reverse_pdf",
            new: "reverse_pdf",
            check: &FURNACE_BY_MORTAL_WALKS,
        },
        Mutation {
            name: "connections are weighted as if eye walks always went on",
            module: "transport/connect",
            old: "eye_survival * scattered.pdf",
            new: "scattered.pdf",
            check: &FURNACE_BY_MORTAL_WALKS,
        },
        Mutation {
            name: "splats are weighted as if eye walks always went on",
            module: "stage/shade_light_mis",
            old: "eye_survival * reverse_pdf_bsdf",
            new: "1.0 * reverse_pdf_bsdf",
            check: &FURNACE_BY_MORTAL_WALKS,
        },
        Mutation {
            name: "eye walks that two light vertices share are counted for both",
            module: "stage/shade_light_mis",
            old: "if first_joined(t) == t {\n",
            new: "if t > 0u {\n",
            check: &FURNACE_BY_PAIRS,
        },
        Mutation {
            name: "an eye walk is joined to the first light vertex of its pair twice",
            module: "stage/shade_eye_pair",
            old: "connect(eye, light, surface, bsdf, sums, s, last)",
            new: "connect(eye, first, surface, bsdf, sums, s, t)",
            check: &FURNACE_BY_PAIRS,
        },
        Mutation {
            name: "the cosine at the surface is missing in the weight of splats",
            module: "stage/shade_light_mis",
            old: "camera.importance * surface_cosine(surface, camera.direction)",
            new: "camera.importance",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the camera's density is missing in the sums",
            module: "stage/start_eye",
            old: "source(1.0 / camera_pdf_w(cosine))",
            new: "source(1.0)",
            check: &NEAR_PANELS_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "light from infinity is weighted as if it came from where the ray began",
            module: "transport/advance",
            old: "select(walk.hit.t, 1.0, parallel)",
            new: "walk.hit.t",
            check: &SUN_AND_SKY_FROM_BOTH_SIDES,
        },
        Mutation {
            name: "the density on the disk is missing for the sky that is met",
            module: "stage/escape_eye",
            old: "pdf_sky * pdf_disk()",
            new: "pdf_sky",
            check: &SUN_AND_SKY_FROM_BOTH_SIDES,
        },
    ]);
}
