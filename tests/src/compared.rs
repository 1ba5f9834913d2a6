//! Scenes without a closed form, on which pipelines are compared.

use crate::material::Material;
use crate::rendering::BuiltScene;
use crate::scene_builder::{Camera, SceneBuilder};
use crate::shape::{Mesh, quad, sphere, turned_cuboid};
use crate::sky::Sky;
use glam::{DVec3, dvec3};

/// A panel that emits from both sides, a point light and a spot light above a floor and before a wall.
pub fn lamps() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.6, 0.5, 0.4]));
    let panel = scene.material(Material::emitter("panel", [4.0, 1.0, 2.0]).two_sided());
    scene.floor(floor, 0.0, 4.0);
    scene.quad(floor, dvec3(-2.0, 0.0, -2.0), DVec3::X * 4.0, DVec3::Y * 2.5);
    scene.quad(panel, dvec3(-1.2, 0.8, -0.4), DVec3::X * 0.5, DVec3::Y * 0.4);
    scene.point_light(dvec3(0.5, 1.2, 0.2), [0.5, 1.0, 0.2]);
    scene.spot_light(dvec3(1.2, 2.0, 0.8), dvec3(-0.5, -1.0, -0.4), [3.0, 2.0, 6.0], 0.3, 0.5);
    scene.camera("main", Camera { eye: dvec3(0.0, 1.4, 4.5), target: dvec3(0.0, 0.7, 0.0), yfov: 40.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

/// A block in the light of a sun, and of a sky that is bright on one side.
pub fn sun_and_sky() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.6, 0.5, 0.4]));
    let block = scene.material(Material::lambert("block", [0.3, 0.6, 0.7]));
    scene.floor(floor, 0.0, 3.0);
    scene.mesh(block, turned_cuboid(dvec3(-0.6, 0.0, -0.4), dvec3(0.1, 0.9, 0.3), 0.4));
    scene.directional_light(dvec3(0.5, -1.0, -0.3), [1.5, 1.2, 0.8]);
    scene.camera("main", Camera { eye: dvec3(0.3, 1.5, 4.0), target: dvec3(0.0, 0.3, 0.0), yfov: 38.0, aspect: 1.0 });
    let sky = Sky::from_directions(32, 16, |towards| [0.2 + 0.8 * towards.x.max(0.0), 0.3, 0.6 + 0.4 * towards.y]);
    BuiltScene::new(&scene, Some(&sky))
}

/// A ball of `rings` rings with smooth normals in the light of a panel, beside a wall that it colours.
pub fn ball_beside_a_wall(material: Material, rings: u32) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(Material::lambert("wall", [0.7; 3]));
    let ball = scene.material(material);
    let light = scene.material(Material::emitter("light", [6.0; 3]));
    scene.floor(wall, 0.0, 3.0);
    scene.quad(wall, dvec3(-0.9, 0.0, 1.0), DVec3::NEG_Z * 2.0, DVec3::Y * 1.6);
    scene.mesh(ball, sphere(dvec3(0.0, 0.6, 0.0), 0.5, rings));
    scene.quad(light, dvec3(0.7, 1.7, -0.5), DVec3::new(0.4, -0.5, 0.0), DVec3::Z);
    scene.camera("main", Camera { eye: dvec3(0.5, 1.0, 4.0), target: dvec3(-0.2, 0.5, 0.0), yfov: 32.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

/// A mirror whose normals are tilted towards the floor.
pub fn leaning_mirror() -> Mesh {
    let mut plate = quad(dvec3(-0.6, 0.0, 1.0), DVec3::NEG_Z * 2.0, DVec3::Y * 1.5);
    plate.normals = vec![dvec3(0.4f64.cos(), -0.4f64.sin(), 0.0); 4];
    plate
}

/// The floor beside or below a shape, in the light of a panel. The shape is out of the picture: walks from the light cannot be joined
/// to a camera through smooth glass.
pub fn beside_a_caustic(material: Material, shape: Mesh) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let floor = scene.material(Material::lambert("floor", [0.7; 3]));
    let material = scene.material(material);
    let light = scene.material(Material::emitter("light", [3.0; 3]));
    scene.floor(floor, 0.0, 4.0);
    scene.mesh(material, shape);
    scene.ceiling(light, 2.0, 1.6);
    scene.camera("main", Camera { eye: dvec3(0.0, 0.15, 3.0), target: dvec3(0.0, 0.0, 0.0), yfov: 6.0, aspect: 2.0 });
    BuiltScene::new(&scene, None)
}
