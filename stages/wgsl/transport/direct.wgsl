//! Light straight from a light source to a vertex of an eye walk.

import package::real::{real, vec3r};
import package::state::{Connection, Walk};
import package::params::record_strategies;
import package::features::HAS_ATTENUATION;
import package::pass::path_pixel;
import package::random::{DIMENSION_LIGHT, WALK_EYE, random4};
import package::streams::{push_connection, push_particle};
import package::surface::surface::Surface;
import package::surface::spawn::Segment;
import package::light::light::sample_light;
import package::light::light_sample::LightSample;
import package::transport::dimension::random_extra;
import package::transport::record::strategy_index;
import package::transport::medium::{medium_after, transmittance};

/// Draws the light for next-event estimation at surface vertex `vertex` of the eye walk.
fn direct_light(surface: Surface, vertex: u32) -> LightSample {
    return sample_light(surface, random4(WALK_EYE, vertex, DIMENSION_LIGHT), random_extra(WALK_EYE, vertex));
}

/// Offers light to the walk's pixel, if the segment to the light turns out free. `scattered` = f |cos| of the vertex,
/// `inverse_pdf` = MIS weight / density of the light sample, sr.
fn offer_direct_light(walk: ptr<function, Walk>, surface: Surface, light: LightSample, scattered: vec3r, inverse_pdf: real) {
    let contribution = walk.throughput * scattered * light.radiance * inverse_pdf;
    offer(walk, surface, light.segment, contribution, path_pixel());
}

/// Pushes a contribution to the path's own pixel that holds if `segment`, which starts at the walk's newest vertex `surface`, is
/// free; absorbs along it. Black ones are not worth a ray.
fn offer(walk: ptr<function, Walk>, surface: Surface, segment: Segment, contribution: vec3r, pixel: u32) {
    if !all(contribution == vec3r(0.0)) {
        push_connection(connection_of(walk, surface, segment, contribution, pixel));
    }
}

/// As `offer`, to a pixel that need not be the path's own.
fn offer_particle(walk: ptr<function, Walk>, surface: Surface, segment: Segment, contribution: vec3r, pixel: u32) {
    if !all(contribution == vec3r(0.0)) {
        push_particle(connection_of(walk, surface, segment, contribution, pixel));
    }
}

/// As `offer`, for a strategy (s, t) of several; `unweighted` is what it would contribute alone.
fn offer_strategy(walk: ptr<function, Walk>, surface: Surface, segment: Segment, contribution: vec3r, unweighted: vec3r, s: u32, t: u32) {
    if !all(contribution == vec3r(0.0)) {
        var connection = connection_of(walk, surface, segment, contribution, path_pixel());
        if record_strategies {
            let attenuated = connection_of(walk, surface, segment, unweighted, path_pixel());
            connection.unweighted = attenuated.contribution;
            connection.strategy = strategy_index(s, t);
        }
        push_connection(connection);
    }
}

/// As `offer_particle`, for the strategy (0, t).
fn offer_particle_strategy(walk: ptr<function, Walk>, surface: Surface, segment: Segment, contribution: vec3r, unweighted: vec3r, t: u32, pixel: u32) {
    if !all(contribution == vec3r(0.0)) {
        var connection = connection_of(walk, surface, segment, contribution, pixel);
        if record_strategies {
            let attenuated = connection_of(walk, surface, segment, unweighted, pixel);
            connection.unweighted = attenuated.contribution;
            connection.strategy = strategy_index(0u, t);
        }
        push_particle(connection);
    }
}

/// The contribution that arrives if `segment` is free.
fn connection_of(walk: ptr<function, Walk>, surface: Surface, segment: Segment, contribution: vec3r, pixel: u32) -> Connection {
    var connection: Connection;
    connection.origin = segment.origin;
    connection.direction = segment.direction;
    connection.distance = segment.distance;
    connection.contribution = contribution;
    connection.pixel = pixel;
    if HAS_ATTENUATION {
        let transmitted = dot(segment.direction, surface.geometric_normal) < 0.0;
        let medium = medium_after(surface, walk.medium, transmitted == surface.front);
        connection.contribution *= transmittance(medium, segment.distance);
    }
    return connection;
}
