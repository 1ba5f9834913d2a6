//! World-space triangles: every instance of every primitive, flattened.

use super::material::Material;
use super::mesh::Primitive;
use super::node::Instance;
use super::texture::Image;
use crate::error::{Error, Result};
use glam::{DMat3, DMat4, DVec3, Vec3};
use std::collections::BTreeMap;

/// Most triangles of a scene; their tables must stay addressable with 32-bit words.
const MOST_TRIANGLES: usize = 1 << 27;
/// A scene further from the origin than this many of its diagonals is moved there.
const FAR: f64 = 4.0;
/// Below this sine of the angle between two edges a cross product in f32 is rounding noise: the triangle has no normal.
const LEAST_SINE: f64 = 1.0 / (1 << 22) as f64;
/// A vertex normal closer to the face normal than this cosine tells counts as the face normal (1 mrad).
const FLAT_COSINE: f64 = 1.0 - 5e-7;

/// A triangle in the world with everything that is interpolated over it.
#[derive(Clone)]
pub struct Triangle {
    /// World positions, front face anticlockwise.
    pub positions: [Vec3; 3],
    /// Unit shading normals on the front side.
    pub normals: [Vec3; 3],
    /// Both texture coordinate sets of the material.
    pub uvs: [[[f32; 2]; 3]; 2],
    /// Unit tangents with the sign of the bitangent.
    pub tangents: [[f32; 4]; 3],
    /// Linear RGBA.
    pub colors: [[f32; 4]; 3],
    /// Index into the materials.
    pub material: u32,
    /// Coverage must be looked up at every hit.
    pub alpha_tested: bool,
    /// All shading normals are the face normal.
    pub flat: bool,
}

impl Triangle {
    /// Edges from the first vertex, rounded as the kernels see them.
    pub fn edges(&self) -> (Vec3, Vec3) {
        (self.positions[1] - self.positions[0], self.positions[2] - self.positions[0])
    }

    /// Area, m2.
    pub fn area(&self) -> f64 {
        let (e1, e2) = self.edges();
        e1.as_dvec3().cross(e2.as_dvec3()).length() / 2.0
    }
}

/// The geometry of a scene.
pub struct Geometry {
    /// All triangles that have a normal.
    pub triangles: Vec<Triangle>,
    /// Triangles without area, or thinner than f32 resolves.
    pub dropped: usize,
    /// What was subtracted from all coordinates.
    pub moved_by: DVec3,
}

/// Primitives of each mesh that is placed somewhere.
pub type Meshes = BTreeMap<usize, Vec<Primitive>>;

/// Places all primitives. A scene far from the origin is moved to it, so that f32 keeps its detail.
///
/// # Errors
/// Coordinates that overflow f32, more than 2^27 triangles.
pub fn flatten(instances: &[Instance], meshes: &Meshes, materials: &[Material], images: &[Image]) -> Result<Geometry> {
    let primitives = |instance: &Instance| meshes.get(&instance.mesh).map_or(&[][..], Vec::as_slice);
    let total: usize = instances.iter().flat_map(primitives).map(|primitive| primitive.triangles.len()).sum();
    if total > MOST_TRIANGLES {
        return Err(Error::input(format!("the scene has {total} triangles")).help(format!("at most {MOST_TRIANGLES}")));
    }
    let moved_by =
        displacement(instances.iter().flat_map(|instance| primitives(instance).iter().map(move |p| (instance, p))));
    let mut triangles = Vec::with_capacity(total);
    for instance in instances {
        for primitive in primitives(instance) {
            let least_alpha = primitive.colors.iter().flatten().map(|color| color[3]).fold(1.0f32, f32::min);
            let alpha_tested = materials[primitive.material].alpha_tested(images, least_alpha);
            let placer = Placer::new(primitive, DMat4::from_translation(-moved_by) * instance.matrix, alpha_tested);
            let outside = || {
                Error::input("a vertex lies beyond the range of 32-bit floats").at(format!("node `{}`", instance.name))
            };
            let positions = placer.positions().ok_or_else(outside)?;
            triangles.extend((0..primitive.triangles.len()).filter_map(|i| placer.triangle(i, &positions)));
        }
    }
    Ok(Geometry { dropped: total - triangles.len(), triangles, moved_by })
}

fn displacement<'a>(placed: impl Iterator<Item = (&'a Instance, &'a Primitive)>) -> DVec3 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (instance, primitive) in placed {
        for &vertex in primitive.triangles.as_flattened() {
            let p = instance.matrix.transform_point3(DVec3::from(primitive.positions[vertex as usize].map(f64::from)));
            (low, high) = (low.min(p), high.max(p));
        }
    }
    let (centre, diagonal) = ((low + high) / 2.0, (high - low).length());
    if centre.is_finite() && centre.length() > FAR * diagonal { centre } else { DVec3::ZERO }
}

/// Puts one primitive into the world.
struct Placer<'a> {
    primitive: &'a Primitive,
    matrix: DMat4,
    /// det(A) A^-T: moves normals, and stays defined when A flattens space.
    cofactors: DMat3,
    mirrored: bool,
    alpha_tested: bool,
}

impl<'a> Placer<'a> {
    fn new(primitive: &'a Primitive, matrix: DMat4, alpha_tested: bool) -> Self {
        let linear = DMat3::from_mat4(matrix);
        let mirrored = linear.determinant() < 0.0;
        let sign = if mirrored { -1.0 } else { 1.0 };
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = linear;
        let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign;
        Self { primitive, matrix, cofactors, mirrored, alpha_tested }
    }

    fn positions(&self) -> Option<Vec<Vec3>> {
        let place = |p: &[f32; 3]| self.matrix.transform_point3(DVec3::from(p.map(f64::from))).as_vec3();
        let positions: Vec<Vec3> = self.primitive.positions.iter().map(place).collect();
        positions.iter().all(|p| p.is_finite() && p.abs().max_element() < f32::MAX / 8.0).then_some(positions)
    }

    fn triangle(&self, index: usize, positions: &[Vec3]) -> Option<Triangle> {
        // A mirrored primitive is turned round, so that its outside stays outside.
        let places = if self.mirrored { [0, 2, 1] } else { [0, 1, 2] };
        let corners = places.map(|place| self.primitive.triangles[index][place] as usize);
        let positions = corners.map(|vertex| positions[vertex]);
        let face = face_normal(positions)?;
        let mut normals = corners.map(|vertex| self.normal(vertex).unwrap_or(face));
        let inverted = normals.iter().all(|normal| normal.dot(face) < 0.0);
        if inverted {
            normals = normals.map(|normal| -normal);
        }
        let flat = normals.iter().all(|normal| normal.dot(face) > FLAT_COSINE);
        if flat {
            normals = [face; 3];
        }
        let primitive = self.primitive;
        let tangent =
            |i: usize| self.tangent(primitive.tangents.as_ref().map(|t| t[index][places[i]]), normals[i], inverted);
        Some(Triangle {
            positions,
            uvs: [0, 1].map(|set: usize| {
                corners.map(|vertex| primitive.uvs[set].as_ref().map_or([0.0; 2], |uvs| uvs[vertex]))
            }),
            tangents: [tangent(0), tangent(1), tangent(2)],
            colors: corners.map(|vertex| primitive.colors.as_ref().map_or([1.0; 4], |colors| colors[vertex])),
            normals: normals.map(|normal| normal.as_vec3()),
            material: primitive.material as u32,
            alpha_tested: self.alpha_tested,
            flat,
        })
    }

    fn normal(&self, vertex: usize) -> Option<DVec3> {
        let normals = self.primitive.normals.as_ref()?;
        (self.cofactors * DVec3::from(normals[vertex].map(f64::from))).try_normalize()
    }

    fn tangent(&self, given: Option<[f32; 4]>, normal: DVec3, inverted: bool) -> [f32; 4] {
        let Some([x, y, z, sign]) = given else { return [1.0, 0.0, 0.0, 1.0] };
        let moved = self.matrix.transform_vector3(DVec3::new(f64::from(x), f64::from(y), f64::from(z)));
        let t = moved.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector()).as_vec3();
        // The bitangent is moved like the tangent; the cross product that rebuilds it turns round under mirroring.
        let turned = self.mirrored != inverted;
        [t.x, t.y, t.z, if (sign < 0.0) != turned { -1.0 } else { 1.0 }]
    }
}

/// Unit normal of the face, `None` where the edges, rounded to f32, leave none.
fn face_normal(positions: [Vec3; 3]) -> Option<DVec3> {
    let e1 = (positions[1] - positions[0]).as_dvec3();
    let e2 = (positions[2] - positions[0]).as_dvec3();
    let cross = e1.cross(e2);
    let length = cross.length();
    // The kernels square this length in f32: below the smallest normal number nothing is left to divide by.
    let representable = length * length > f64::from(f32::MIN_POSITIVE);
    (length > LEAST_SINE * e1.length() * e2.length() && representable).then(|| cross / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn primitive() -> Primitive {
        Primitive {
            triangles: vec![[0, 1, 2]],
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: Some(vec![[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]]),
            tangents: Some(vec![[[1.0, 0.0, 0.0, 1.0]; 3]]),
            ..Primitive::default()
        }
    }

    fn placed(primitive: &Primitive, matrix: DMat4) -> Option<Triangle> {
        let placer = Placer::new(primitive, matrix, false);
        placer.triangle(0, &placer.positions()?)
    }

    #[test]
    fn negative_scale_turns_the_winding_and_keeps_the_outside() {
        let triangle = placed(&primitive(), DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))).unwrap();
        let (e1, e2) = triangle.edges();
        assert_eq!(e1.cross(e2), Vec3::Z);
        assert_eq!(triangle.positions[1], Vec3::Y);
        assert!((triangle.normals[2] - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-6);
        assert_eq!(triangle.tangents[0], [-1.0, 0.0, 0.0, -1.0]);
    }

    #[test]
    fn normals_move_by_the_inverse_transpose() {
        let shear = DMat4::from_cols_array_2d(&[
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.5, 0.0, 2.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]);
        let triangle = placed(&primitive(), shear).unwrap();
        assert!((triangle.normals[0] - Vec3::Z).length() < 1e-6);
        assert!(!triangle.flat);
    }

    #[test]
    fn triangles_without_area_are_dropped_and_slivers_stay() {
        assert!(placed(&primitive(), DMat4::from_scale(DVec3::ZERO)).is_none());
        assert!(placed(&primitive(), DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
        assert!(
            placed(&primitive(), DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0)))
                .is_some_and(|t| (t.normals[1] - Vec3::Z).length() < 1e-6)
        );
        assert!(placed(&primitive(), DMat4::from_scale(DVec3::new(1.0, 1e-5, 1.0))).is_some());
        assert!(placed(&primitive(), DMat4::from_scale(DVec3::splat(1e-5))).is_some());
    }

    #[test]
    fn inverted_normals_are_turned_to_the_front() {
        let mut inverted = primitive();
        inverted.normals = Some(vec![[0.0, 0.0, -1.0]; 3]);
        let triangle = placed(&inverted, DMat4::IDENTITY).unwrap();
        assert_eq!(triangle.normals, [Vec3::Z; 3]);
        assert!(triangle.flat);
        assert_eq!(triangle.tangents[0][3], -1.0);
    }

    #[test]
    fn only_scenes_far_from_the_origin_are_moved() {
        let primitive = primitive();
        let at = |x: f64| Instance {
            mesh: 0,
            matrix: DMat4::from_translation(DVec3::new(x, 0.0, 0.0)),
            name: String::new(),
        };
        assert_eq!(displacement([(&at(5.0), &primitive)].into_iter()), DVec3::ZERO);
        assert_eq!(displacement([(&at(1e4), &primitive)].into_iter()), DVec3::new(10000.5, 0.5, 0.0));
        assert_eq!(displacement(std::iter::empty()), DVec3::ZERO);
    }
}
