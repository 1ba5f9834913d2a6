//! Triangle meshes of simple shapes: what the scene builder places.

use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// An indexed triangle mesh; counter-clockwise faces are seen from the front.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices, metres.
    pub positions: Vec<DVec3>,
    /// Unit shading normals, one a vertex; empty for flat faces.
    pub normals: Vec<DVec3>,
    /// Three indices a triangle.
    pub indices: Vec<u32>,
}

impl Mesh {
    /// Adds another mesh. Both must have normals, or neither.
    pub fn append(&mut self, other: &Mesh) {
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.indices.extend(other.indices.iter().map(|index| base + index));
    }

    /// The same surface seen from the other side.
    pub fn inverted(mut self) -> Mesh {
        for triangle in self.indices.chunks_exact_mut(3) {
            triangle.swap(1, 2);
        }
        for normal in &mut self.normals {
            *normal = -*normal;
        }
        self
    }

    /// Without shading normals: flat faces.
    pub fn flat(mut self) -> Mesh {
        self.normals.clear();
        self
    }
}

/// A parallelogram with a corner and two edges; its front is the side that `edge_u x edge_v` points to.
pub fn quad(corner: DVec3, edge_u: DVec3, edge_v: DVec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v],
        normals: Vec::new(),
        indices: vec![0, 1, 2, 0, 2, 3],
    }
}

/// A box along the axes, seen from outside.
pub fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let size = high - low;
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    let faces = [
        quad(low, y, x),
        quad(low + z, x, y),
        quad(low, z, y),
        quad(low + x, y, z),
        quad(low, x, z),
        quad(low + y, z, x),
    ];
    let mut mesh = Mesh::default();
    for face in &faces {
        mesh.append(face);
    }
    mesh
}

/// A box along the axes turned about the vertical through its centre, in radians.
pub fn turned_cuboid(low: DVec3, high: DVec3, angle: f64) -> Mesh {
    let centre = (low + high) / 2.0;
    let turn = glam::DQuat::from_rotation_y(angle);
    let mut mesh = cuboid(low, high);
    for position in &mut mesh.positions {
        *position = centre + turn * (*position - centre);
    }
    mesh
}

/// A disk as a fan of `segments` triangles whose rim vertices lie at a radius that keeps the area: a polygon of area `pi radius^2`.
pub fn disk(centre: DVec3, normal: DVec3, radius: f64, segments: u32) -> Mesh {
    let (right, up) = perpendiculars(normal);
    let slice = TAU / f64::from(segments);
    let rim = radius * (slice / slice.sin()).sqrt();
    let mut positions = vec![centre];
    positions.extend((0..segments).map(|i| {
        let (sin, cos) = (f64::from(i) * slice).sin_cos();
        centre + (right * cos + up * sin) * rim
    }));
    let indices = (0..segments).flat_map(|i| [0, 1 + i, 1 + (i + 1) % segments]).collect();
    Mesh { positions, normals: Vec::new(), indices }
}

/// A sphere of `rings` rings and twice as many segments, with smooth normals.
pub fn sphere(centre: DVec3, radius: f64, rings: u32) -> Mesh {
    let profile: Vec<(f64, f64)> = (0..=rings)
        .map(|i| {
            let angle = PI * f64::from(i) / f64::from(rings);
            let on_axis = i == 0 || i == rings;
            (if on_axis { 0.0 } else { radius * angle.sin() }, -radius * angle.cos())
        })
        .collect();
    let mut mesh = lathe(&profile, 2 * rings);
    mesh.normals = mesh.positions.iter().map(|position| position.normalize()).collect();
    for position in &mut mesh.positions {
        *position += centre;
    }
    mesh
}

/// The surface that a profile of (radius, height) points sweeps about the Y axis, with smooth normals.
///
/// A profile that goes up on the outside is seen from outside. Points on the axis (radius 0) make a single fan.
pub fn lathe(profile: &[(f64, f64)], segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut rows = Vec::new();
    for (i, &(radius, height)) in profile.iter().enumerate() {
        let start = mesh.positions.len() as u32;
        let count = if radius == 0.0 { 1 } else { segments };
        let (outward, rise) = profile_normal(profile, i);
        for k in 0..count {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(segments)).sin_cos();
            mesh.positions.push(DVec3::new(radius * cos, height, -radius * sin));
            mesh.normals.push(lathe_normal(radius, outward, rise, sin, cos));
        }
        rows.push((start, count));
    }
    for pair in rows.windows(2) {
        join_rows(&mut mesh.indices, pair[0], pair[1], segments);
    }
    mesh
}

fn lathe_normal(radius: f64, outward: f64, rise: f64, sin: f64, cos: f64) -> DVec3 {
    if radius == 0.0 {
        return DVec3::Y * rise.signum();
    }
    DVec3::new(outward * cos, rise, -outward * sin).normalize()
}

/// The normal of a profile at a point, as (outward, up): the mean of the normals of the segments that meet there.
fn profile_normal(profile: &[(f64, f64)], i: usize) -> (f64, f64) {
    let mut sum = (0.0, 0.0);
    for (from, to) in [(i.wrapping_sub(1), i), (i, i + 1)] {
        if let (Some(a), Some(b)) = (profile.get(from), profile.get(to)) {
            let (dr, dh) = (b.0 - a.0, b.1 - a.1);
            let length = dr.hypot(dh);
            sum = (sum.0 + dh / length, sum.1 - dr / length);
        }
    }
    sum
}

fn join_rows(indices: &mut Vec<u32>, low: (u32, u32), high: (u32, u32), segments: u32) {
    for k in 0..segments {
        let at = |row: (u32, u32), k: u32| row.0 + k % row.1;
        let (a, b, c, d) = (at(low, k), at(low, k + 1), at(high, k + 1), at(high, k));
        if low.1 > 1 {
            indices.extend([a, b, if high.1 > 1 { c } else { d }]);
        }
        if high.1 > 1 {
            indices.extend([a, c, d]);
        }
    }
}

/// Two unit vectors that make a right-handed frame (right, up, normal) with a unit normal.
pub fn perpendiculars(normal: DVec3) -> (DVec3, DVec3) {
    let helper = if normal.y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
    let right = helper.cross(normal).normalize();
    (right, normal.cross(right))
}
