//! Tangents for normal maps where the file gives none: gradients of the texture coordinates, averaged over the triangles
//! around a vertex with the same position, normal and texture coordinate, weighted by the angle at the vertex, after
//! Mikkelsen, *Simulation of Wrinkled Surfaces Revisited*, 2008. Mirrored and unmirrored neighbours are not mixed.

use super::mesh::Primitive;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// What makes two corners share a tangent: bits of position, normal and texture coordinate, and the handedness.
type Key = ([u32; 3], [u32; 3], [u32; 2], bool);

/// Tangent (unit) and bitangent sign of every corner; any direction in the surface where the texture coordinates have no gradient.
pub fn compute(primitive: &Primitive, uv_set: usize) -> Vec<[[f32; 4]; 3]> {
    let Some(uvs) = &primitive.uvs[uv_set] else {
        return primitive
            .triangles
            .iter()
            .map(|&corners| corners.map(|i| fallback(normal(primitive, corners, i))))
            .collect();
    };
    let mut sums: HashMap<Key, DVec3> = HashMap::new();
    for &corners in &primitive.triangles {
        let Some((gradient, mirrored)) = gradient(primitive, uvs, corners) else { continue };
        for (place, &vertex) in corners.iter().enumerate() {
            let normal = normal(primitive, corners, vertex);
            let projected = (gradient - normal * normal.dot(gradient)).normalize_or_zero();
            *sums.entry(key(primitive, uvs, corners, vertex, mirrored)).or_default() +=
                projected * angle(primitive, corners, place);
        }
    }
    let corner = |corners: [u32; 3], vertex: u32| {
        let mirrored = gradient(primitive, uvs, corners).is_some_and(|(_, mirrored)| mirrored);
        let sum = sums.get(&key(primitive, uvs, corners, vertex, mirrored)).copied().unwrap_or_default();
        match sum.try_normalize() {
            Some(t) => [t.x as f32, t.y as f32, t.z as f32, if mirrored { -1.0 } else { 1.0 }],
            None => fallback(normal(primitive, corners, vertex)),
        }
    };
    primitive.triangles.iter().map(|&corners| corners.map(|vertex| corner(corners, vertex))).collect()
}

fn key(primitive: &Primitive, uvs: &[[f32; 2]], corners: [u32; 3], vertex: u32, mirrored: bool) -> Key {
    let normal = normal(primitive, corners, vertex).as_vec3().to_array();
    let i = vertex as usize;
    (primitive.positions[i].map(f32::to_bits), normal.map(f32::to_bits), uvs[i].map(f32::to_bits), mirrored)
}

fn position(primitive: &Primitive, vertex: u32) -> DVec3 {
    DVec3::from(primitive.positions[vertex as usize].map(f64::from))
}

/// Unit normal of a vertex, that of the face where the vertex has none.
fn normal(primitive: &Primitive, corners: [u32; 3], vertex: u32) -> DVec3 {
    let given = primitive.normals.as_ref().map(|normals| DVec3::from(normals[vertex as usize].map(f64::from)));
    given.and_then(DVec3::try_normalize).unwrap_or_else(|| {
        let [a, b, c] = corners.map(|i| position(primitive, i));
        (b - a).cross(c - a).normalize_or_zero()
    })
}

/// Direction in which u grows, and whether the texture is mirrored on this triangle.
fn gradient(primitive: &Primitive, uvs: &[[f32; 2]], corners: [u32; 3]) -> Option<(DVec3, bool)> {
    let [a, b, c] = corners.map(|i| position(primitive, i));
    let [ta, tb, tc] = corners.map(|i| DVec2::from(uvs[i as usize].map(f64::from)));
    let (d1, d2) = (tb - ta, tc - ta);
    // glTF's v grows downwards in the image, the bitangent upwards.
    let area = d1.x * -d2.y + d2.x * d1.y;
    let direction = ((b - a) * -d2.y + (c - a) * d1.y) * area.signum();
    (area != 0.0).then(|| direction.try_normalize()).flatten().map(|direction| (direction, area < 0.0))
}

fn angle(primitive: &Primitive, corners: [u32; 3], place: usize) -> f64 {
    let [p, q, r] = [0, 1, 2].map(|i| position(primitive, corners[(place + i) % 3]));
    let (e, f) = ((q - p).normalize_or_zero(), (r - p).normalize_or_zero());
    e.dot(f).clamp(-1.0, 1.0).acos()
}

fn fallback(normal: DVec3) -> [f32; 4] {
    if normal == DVec3::ZERO {
        return [1.0, 0.0, 0.0, 1.0];
    }
    let t = normal.any_orthonormal_vector();
    [t.x as f32, t.y as f32, t.z as f32, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square in the plane z = 0 whose u runs along x, mirrored or not.
    fn square(uvs: Vec<[f32; 2]>) -> Primitive {
        Primitive {
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            uvs: [Some(uvs), None],
            ..Primitive::default()
        }
    }

    #[test]
    fn tangent_follows_u_and_the_bitangent_points_up_in_the_image() {
        let upright = square(vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(compute(&upright, 0)[1], [[1.0, 0.0, 0.0, 1.0]; 3]);
        let mirrored = square(vec![[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
        assert_eq!(compute(&mirrored, 0)[0], [[-1.0, 0.0, 0.0, -1.0]; 3]);
        let collapsed = square(vec![[0.5, 0.5]; 4]);
        let t = DVec3::from([0, 1, 2].map(|i| f64::from(compute(&collapsed, 0)[0][0][i])));
        assert!((t.length() - 1.0).abs() < 1e-6 && t.z == 0.0);
    }
}
