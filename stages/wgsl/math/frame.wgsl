//! Orthonormal bases about a unit vector.

import package::real::{real, vec3r};

/// Right-handed orthonormal basis: tangent x bitangent = normal.
struct Frame {
    tangent: vec3r,
    bitangent: vec3r,
    normal: vec3r,
}

/// A basis whose third axis is the unit vector `normal` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
fn frame_of(normal: vec3r) -> Frame {
    let side = select(real(-1.0), real(1.0), normal.z >= 0.0);
    let a = -1.0 / (side + normal.z);
    let b = normal.x * normal.y * a;
    var frame: Frame;
    frame.tangent = vec3r(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x);
    frame.bitangent = vec3r(b, side + normal.y * normal.y * a, -normal.y);
    frame.normal = normal;
    return frame;
}

/// World vector in the coordinates of `frame`.
fn to_local(frame: Frame, v: vec3r) -> vec3r {
    return vec3r(dot(v, frame.tangent), dot(v, frame.bitangent), dot(v, frame.normal));
}

/// Vector in the coordinates of `frame` as a world vector.
fn to_world(frame: Frame, v: vec3r) -> vec3r {
    return v.x * frame.tangent + v.y * frame.bitangent + v.z * frame.normal;
}
