//! Rays that start or end on surfaces. They are taken off the surface by bounds on rounding, never by a fixed length, so scenes of any scale work.

import package::real::{real, vec3r};
import package::surface::surface::Surface;

/// Bound on the error of a plane's distance seen from far, relative to that distance: 2^-21.
const DISTANCE_ROUNDING = 4.76837158203125e-7;
/// Stands in for a length of zero in a division, m.
const SHORTEST_LENGTH = 1.0e-30;

/// A ray with an end: what a visibility test asks about.
struct Segment {
    origin: vec3r,
    /// Unit.
    direction: vec3r,
    /// m
    distance: real,
}

/// The point of the surface moved off it, to the side that `direction` points to, by the error bound plus `more` metres.
fn moved_off(surface: Surface, direction: vec3r, more: real) -> vec3r {
    let normal = surface.geometric_normal;
    let height = dot(abs(normal), surface.error) + more;
    return surface.position + normal * select(-height, height, dot(normal, direction) >= 0.0);
}

/// Origin of a ray that leaves the surface along `direction` and does not meet it again by rounding.
fn spawn_origin(surface: Surface, direction: vec3r) -> vec3r {
    return moved_off(surface, direction, 0.0);
}

/// The segment from `origin` to `target_point`.
fn segment_of(origin: vec3r, target_point: vec3r) -> Segment {
    let span = target_point - origin;
    var segment: Segment;
    segment.origin = origin;
    segment.distance = length(span);
    segment.direction = span / max(segment.distance, SHORTEST_LENGTH);
    return segment;
}

/// The segment between two surface points; both ends are taken off their surfaces, so neither blocks it.
fn segment_between(from_surface: Surface, to_surface: Surface) -> Segment {
    let span = to_surface.position - from_surface.position;
    let start = spawn_origin(from_surface, span);
    // The side is judged from the start, which is clear of its surface: near a shared edge the span itself may lie in both planes.
    let end = moved_off(to_surface, start - to_surface.position, DISTANCE_ROUNDING * length(span));
    return segment_of(start, end);
}

/// The segment from a surface to a point that is on no surface: a point light or a camera.
fn segment_to_point(from_surface: Surface, point: vec3r) -> Segment {
    return segment_of(spawn_origin(from_surface, point - from_surface.position), point);
}
