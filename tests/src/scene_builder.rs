//! Builds small glTF scenes: materials, shapes, lights and cameras, written as one `.glb`.

use crate::glb::Buffer;
use crate::material::{Material, largest};
use crate::shape::{self, Mesh};
use glam::{DMat3, DMat4, DVec3};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// A scene under construction. World space is glTF's: right-handed, +Y up, metres.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    materials: Vec<Material>,
    meshes: Vec<(usize, Mesh)>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    nodes: Vec<Value>,
}

/// A material of a [`SceneBuilder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaterialId(usize);

/// A perspective camera.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Where it is.
    pub eye: DVec3,
    /// What it looks at.
    pub target: DVec3,
    /// Vertical field of view in degrees.
    pub yfov: f64,
    /// Width over height.
    pub aspect: f64,
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new() -> SceneBuilder {
        SceneBuilder::default()
    }

    /// Adds a material.
    pub fn material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId(self.materials.len() - 1)
    }

    /// Adds a mesh of a material, in world space.
    pub fn mesh(&mut self, material: MaterialId, mesh: Mesh) {
        self.meshes.push((material.0, mesh));
    }

    /// Adds a parallelogram seen from the side that `edge_u x edge_v` points to.
    pub fn quad(&mut self, material: MaterialId, corner: DVec3, edge_u: DVec3, edge_v: DVec3) {
        self.mesh(material, shape::quad(corner, edge_u, edge_v));
    }

    /// Adds a horizontal square of a given edge, facing up, with its centre at a height above the origin.
    pub fn floor(&mut self, material: MaterialId, height: f64, edge: f64) {
        let half = edge / 2.0;
        self.quad(material, DVec3::new(-half, height, half), DVec3::X * edge, DVec3::NEG_Z * edge);
    }

    /// Adds a horizontal square of a given edge, facing down, with its centre at a height above the origin.
    pub fn ceiling(&mut self, material: MaterialId, height: f64, edge: f64) {
        let half = edge / 2.0;
        self.quad(material, DVec3::new(-half, height, -half), DVec3::X * edge, DVec3::Z * edge);
    }

    /// Adds a room: a box along the axes, seen from inside.
    pub fn room(&mut self, material: MaterialId, low: DVec3, high: DVec3) {
        self.mesh(material, shape::cuboid(low, high).inverted());
    }

    /// Adds a point light; intensity in W/sr.
    pub fn point_light(&mut self, position: DVec3, intensity: [f64; 3]) {
        self.light("point", DMat4::from_translation(position), intensity, Map::new());
    }

    /// Adds a spot light; intensity in W/sr inside the inner cone, half angles in radians.
    pub fn spot_light(&mut self, position: DVec3, direction: DVec3, intensity: [f64; 3], inner: f64, outer: f64) {
        let mut cones = Map::new();
        cones.insert("spot".into(), json!({ "innerConeAngle": inner, "outerConeAngle": outer }));
        self.light("spot", frame(position, direction), intensity, cones);
    }

    /// Adds a directional light that shines along a direction; irradiance perpendicular to it in W/m2.
    pub fn directional_light(&mut self, direction: DVec3, irradiance: [f64; 3]) {
        self.light("directional", frame(DVec3::ZERO, direction), irradiance, Map::new());
    }

    fn light(&mut self, kind: &str, place: DMat4, strength: [f64; 3], more: Map<String, Value>) {
        let scale = largest(strength);
        let mut light = json!({ "type": kind, "color": strength.map(|channel| channel / scale), "intensity": scale });
        for (key, value) in more {
            light[key] = value;
        }
        let extension = json!({ "KHR_lights_punctual": { "light": self.lights.len() } });
        self.lights.push(light);
        self.nodes.push(json!({ "name": kind, "matrix": matrix(place), "extensions": extension }));
    }

    /// Adds a camera; the first is the one that is used by default.
    pub fn camera(&mut self, name: &str, camera: Camera) {
        let place = frame(camera.eye, camera.target - camera.eye);
        self.nodes.push(json!({ "name": name, "matrix": matrix(place), "camera": self.cameras.len() }));
        self.cameras.push(json!({
            "name": name,
            "type": "perspective",
            "perspective": { "yfov": camera.yfov.to_radians(), "aspectRatio": camera.aspect, "znear": 0.01 },
        }));
    }

    /// The scene as a `.glb` file. Equal scenes give equal bytes.
    pub fn to_glb(&self) -> Vec<u8> {
        let mut buffer = Buffer::default();
        let mut nodes = self.nodes.clone();
        let mut meshes = Vec::new();
        for (material, mesh) in self.merged() {
            nodes.push(json!({ "name": self.materials[material].name, "mesh": meshes.len() }));
            meshes.push(json!({ "primitives": [primitive(&mut buffer, material, &mesh)] }));
        }
        let all: Vec<usize> = (0..nodes.len()).collect();
        let mut document = json!({
            "asset": { "version": "2.0", "generator": "Pathloom make_scenes" },
            "scene": 0,
            "scenes": [{ "nodes": all }],
            "nodes": nodes,
        });
        let materials: Vec<Value> = self.materials.iter().map(Material::to_json).collect();
        put_list(&mut document, "meshes", meshes);
        put_list(&mut document, "cameras", self.cameras.clone());
        let used = extensions_used(&materials, !self.lights.is_empty());
        put_list(&mut document, "materials", materials);
        if !self.lights.is_empty() {
            document["extensions"] = json!({ "KHR_lights_punctual": { "lights": self.lights } });
        }
        put_list(&mut document, "extensionsUsed", used);
        buffer.finish(document)
    }

    /// One mesh for each material and kind of normals, in order of first use.
    fn merged(&self) -> Vec<(usize, Mesh)> {
        let mut merged: Vec<(usize, Mesh)> = Vec::new();
        for (material, mesh) in &self.meshes {
            let same = |(other, kept): &&mut (usize, Mesh)| {
                other == material && kept.normals.is_empty() == mesh.normals.is_empty()
            };
            match merged.iter_mut().find(same) {
                Some((_, kept)) => kept.append(mesh),
                None => merged.push((*material, mesh.clone())),
            }
        }
        merged
    }
}

fn primitive(buffer: &mut Buffer, material: usize, mesh: &Mesh) -> Value {
    let position = buffer.vec3(mesh.positions.iter().map(|v| v.to_array()), true);
    let mut attributes = json!({ "POSITION": position });
    if !mesh.normals.is_empty() {
        attributes["NORMAL"] = json!(buffer.vec3(mesh.normals.iter().map(|v| v.to_array()), false));
    }
    let indices = buffer.indices(&mesh.indices);
    json!({ "attributes": attributes, "indices": indices, "material": material })
}

fn put_list(document: &mut Value, key: &str, list: Vec<Value>) {
    if !list.is_empty() {
        document[key] = Value::Array(list);
    }
}

fn extensions_used(materials: &[Value], lights: bool) -> Vec<Value> {
    let mut used: BTreeSet<String> = materials
        .iter()
        .filter_map(|material| material["extensions"].as_object())
        .flat_map(|object| object.keys().cloned())
        .collect();
    if lights {
        used.insert("KHR_lights_punctual".into());
    }
    used.into_iter().map(Value::String).collect()
}

/// The placement of a camera or light, which look along their -Z axis.
fn frame(position: DVec3, forward: DVec3) -> DMat4 {
    let back = -forward.normalize();
    let (right, up) = shape::perpendiculars(back);
    DMat4::from_mat3_translation(DMat3::from_cols(right, up, back), position)
}

fn matrix(place: DMat4) -> Vec<f32> {
    place.to_cols_array().iter().map(|&x| x as f32 + 0.0).collect()
}
