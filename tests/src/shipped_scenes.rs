//! The scenes of `configs/scenes`, as code: `make_scenes` writes them, a test checks that the files are what this code says.

use crate::material::Material;
use crate::scene_builder::{Camera, SceneBuilder};
use crate::shape::{self, disk, lathe, quad, sphere, turned_cuboid};
use crate::sky::{self, Sky};
use glam::{DVec3, dvec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// A scene with its files.
pub struct ShippedScene {
    /// Its folder below `configs/scenes`.
    pub name: &'static str,
    /// One line about it, written to its `scene.toml`.
    pub title: &'static str,
    /// Geometry, materials, lights, cameras.
    pub scene: SceneBuilder,
    /// Its sky, if it has one.
    pub sky: Option<Sky>,
}

/// A file to write: path below `configs/scenes`, with `/`, and contents.
pub type File = (String, Vec<u8>);

/// All shipped scenes.
pub fn all() -> Vec<ShippedScene> {
    vec![cornell_box(), bottle(), slit_room(), outdoor(), light_kinds()]
}

impl ShippedScene {
    /// The files of the scene: `NAME/NAME.glb`, `NAME/scene.toml` and, with a sky, `NAME/sky.exr`.
    ///
    /// # Errors
    /// What the EXR writer refuses.
    pub fn files(&self) -> Result<Vec<File>, exr::error::Error> {
        let name = self.name;
        let mut toml = format!("name = \"{name}\"\ntitle = \"{}\"\nfile = \"{name}.glb\"\n", self.title);
        let mut files = vec![(format!("{name}/{name}.glb"), self.scene.to_glb())];
        if let Some(sky) = &self.sky {
            toml += "env = { file = \"sky.exr\", scale = 1.0, rotate_y_deg = 0.0 }\n";
            files.push((format!("{name}/sky.exr"), sky.to_exr()?));
        }
        files.push((format!("{name}/scene.toml"), toml.into_bytes()));
        Ok(files)
    }
}

/// A box open to the front, diffuse throughout, under one area light.
fn cornell_box() -> ShippedScene {
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::lambert("white", [0.74, 0.73, 0.70]));
    let left = scene.material(Material::lambert("terracotta", [0.61, 0.13, 0.07]));
    let right = scene.material(Material::lambert("leaf", [0.13, 0.41, 0.16]));
    let light = scene.material(Material::emitter("light", [16.0, 13.0, 8.5]));
    let (half, height, depth) = (1.2, 2.2, 1.3);
    scene.floor(white, 0.0, 2.0 * half);
    let wide = DVec3::X * 2.0 * half;
    scene.quad(white, dvec3(-half, height, -half), wide, DVec3::Z * 2.0 * half);
    scene.quad(white, dvec3(-half, 0.0, -half), wide, DVec3::Y * height);
    scene.quad(left, dvec3(-half, 0.0, half), DVec3::NEG_Z * 2.0 * half, DVec3::Y * height);
    scene.quad(right, dvec3(half, 0.0, -half), DVec3::Z * 2.0 * half, DVec3::Y * height);
    scene.mesh(white, turned_cuboid(dvec3(-0.82, 0.0, -0.75), dvec3(-0.12, 1.25, -0.10), 0.33));
    scene.mesh(white, turned_cuboid(dvec3(0.10, 0.0, 0.00), dvec3(0.75, 0.62, 0.65), -0.29));
    scene.quad(light, dvec3(-0.35, height - 0.001, -0.30), DVec3::X * 0.7, DVec3::Z * 0.6);
    let target = dvec3(0.0, height / 2.0, 0.0);
    scene.camera("main", Camera { eye: target + DVec3::Z * (depth + 3.5), target, yfov: 36.0, aspect: 1.0 });
    ShippedScene {
        name: "cornell_box",
        title: "Cornell box: Lambert walls and boxes, one area light",
        scene,
        sky: None,
    }
}

/// The only light is inside a bottle of thick glass: every path from it passes two smooth refractions.
fn bottle() -> ShippedScene {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(Material::lambert("plaster", [0.70, 0.68, 0.63]));
    let table = scene.material(Material::lambert("wood", [0.46, 0.29, 0.15]));
    let tinted =
        Material { attenuation: Some(([0.55, 0.86, 0.62], 0.08)), ..Material::glass("bottle glass", 1.5, 0.0) };
    let glass = scene.material(tinted);
    let lamp = scene.material(Material::emitter("lamp", [420.0, 300.0, 160.0]));
    let (low, high) = (dvec3(-1.5, 0.0, -1.5), dvec3(1.5, 2.2, 3.0));
    scene.room(wall, low, high);
    scene.floor(table, 0.001, 1.6);
    let mut bottle = lathe(&bottle_profile(), 72);
    for position in &mut bottle.positions {
        position.y += 0.003;
    }
    scene.mesh(glass, bottle);
    scene.mesh(lamp, sphere(dvec3(0.0, 0.24, 0.0), 0.03, 12));
    scene
        .camera("main", Camera { eye: dvec3(0.35, 0.75, 2.3), target: dvec3(0.0, 0.48, 0.0), yfov: 36.0, aspect: 1.0 });
    ShippedScene { name: "bottle", title: "Glass bottle with the light inside, in a diffuse room", scene, sky: None }
}

/// The glass of the bottle as (radius, height): up the outside from the axis, over the rim, down the inside.
///
/// The shoulder and the neck's curve are arcs that touch where their normals are `SLOPE` above the horizontal.
fn bottle_profile() -> Vec<(f64, f64)> {
    const SLOPE: f64 = 1.1;
    let shoulder = (0.09, 0.42);
    let curve = (shoulder.0 + 0.25 * SLOPE.cos(), shoulder.1 + 0.25 * SLOPE.sin());
    let rim = (curve.0 - 0.16, 0.86);
    let mut profile = vec![(0.0, 0.0)];
    profile.extend(arc((0.16, 0.03), 0.03, -FRAC_PI_2, 0.0, 6));
    profile.extend(arc(shoulder, 0.10, 0.0, SLOPE, 8));
    profile.extend(arc(curve, 0.15, PI + SLOPE, PI, 8).into_iter().skip(1));
    profile.extend(arc(rim, 0.01, 0.0, PI, 8));
    profile.extend(arc(curve, 0.17, PI, PI + SLOPE, 8));
    profile.extend(arc(shoulder, 0.08, SLOPE, 0.0, 8).into_iter().skip(1));
    profile.extend(arc((0.15, 0.05), 0.02, 0.0, -FRAC_PI_2, 6));
    profile.push((0.0, 0.03));
    profile
}

/// Points on a circle of (radius, height) centre between two angles from the outward direction, both ends included.
fn arc(centre: (f64, f64), radius: f64, from: f64, to: f64, steps: u32) -> Vec<(f64, f64)> {
    (0..=steps)
        .map(|i| {
            let (sin, cos) = (from + (to - from) * f64::from(i) / f64::from(steps)).sin_cos();
            (centre.0 + radius * cos, centre.1 + radius * sin)
        })
        .collect()
}

/// A room that gets its light through a slit from a bright chamber beside it.
fn slit_room() -> ShippedScene {
    let mut scene = SceneBuilder::new();
    let wall = scene.material(Material::lambert("plaster", [0.72, 0.71, 0.68]));
    let red = scene.material(Material::lambert("red", [0.55, 0.11, 0.08]));
    let blue = scene.material(Material::lambert("blue", [0.12, 0.22, 0.50]));
    let lamp = scene.material(Material::emitter("lamp", [60.0, 52.0, 40.0]));
    scene.room(wall, dvec3(-3.2, 0.0, -2.0), dvec3(2.0, 2.4, 2.5));
    let divider_left = -1.6;
    let divider_right = -1.5;
    let slit = 0.06;
    scene.mesh(wall, shape::cuboid(dvec3(divider_left, 0.0, -2.0), dvec3(divider_right, 2.4, -slit / 2.0)));
    scene.mesh(wall, shape::cuboid(dvec3(divider_left, 0.0, slit / 2.0), dvec3(divider_right, 2.4, 2.5)));
    scene.mesh(lamp, quad(dvec3(-3.199, 0.4, 0.9), DVec3::NEG_Z * 1.8, DVec3::Y * 1.6));
    scene.mesh(red, turned_cuboid(dvec3(0.2, 0.0, -1.5), dvec3(1.0, 0.9, -0.7), 0.5));
    scene.mesh(blue, sphere(dvec3(1.0, 0.45, 0.35), 0.45, 24));
    scene
        .camera("main", Camera { eye: dvec3(0.4, 1.3, 2.4), target: dvec3(0.15, 0.95, -1.0), yfov: 58.0, aspect: 1.0 });
    ShippedScene { name: "slit_room", title: "Room lit through a slit from the next chamber", scene, sky: None }
}

/// Spheres of four materials on the ground under a clear sky with a sun.
fn outdoor() -> ShippedScene {
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::lambert("ground", [0.34, 0.30, 0.24]));
    let clay = scene.material(Material::lambert("clay", [0.60, 0.27, 0.16]));
    let glaze = scene.material(Material::glossy("glaze", [0.08, 0.20, 0.42], 0.25));
    let brass = scene.material(Material::metal("brass", [0.90, 0.70, 0.34], 0.3));
    let glass = scene.material(Material::glass("glass", 1.5, 0.0));
    scene.floor(ground, 0.0, 40.0);
    for (material, x, z) in [(clay, -1.8, -0.9), (glaze, -0.6, 0.0), (glass, 0.6, 0.45), (brass, 1.8, -0.6)] {
        scene.mesh(material, sphere(dvec3(x, 0.5, z), 0.5, 24));
    }
    scene.camera("main", Camera { eye: dvec3(0.0, 1.5, 5.6), target: dvec3(0.0, 0.45, 0.0), yfov: 34.0, aspect: 1.6 });
    scene
        .camera("narrow", Camera { eye: dvec3(0.0, 1.5, 5.6), target: dvec3(0.6, 0.4, 0.45), yfov: 12.0, aspect: 1.0 });
    let sun = dvec3(-0.55, 0.62, 0.56).normalize();
    let sky = sky::clear_day(256, 128, sun, [3.0, 2.75, 2.3]);
    ShippedScene {
        name: "outdoor",
        title: "Diffuse, glazed, glass and brass spheres under a clear sky",
        scene,
        sky: Some(sky),
    }
}

/// One light of each kind: area, point, spot, directional, sky.
fn light_kinds() -> ShippedScene {
    let mut scene = SceneBuilder::new();
    let ground = scene.material(Material::lambert("ground", [0.60, 0.60, 0.60]));
    let block = scene.material(Material::lambert("block", [0.70, 0.66, 0.58]));
    let panel = scene.material(Material::emitter("panel", [9.0, 2.4, 1.2]).two_sided());
    scene.floor(ground, 0.0, 12.0);
    for x in [-2.7, -0.9, 0.9, 2.7] {
        scene.mesh(block, turned_cuboid(dvec3(x - 0.25, 0.0, -0.25), dvec3(x + 0.25, 0.9, 0.25), 0.5));
    }
    scene.mesh(panel, disk(dvec3(-2.7, 1.7, 0.5), dvec3(0.0, -1.0, -0.4).normalize(), 0.3, 32));
    scene.point_light(dvec3(-0.9, 1.6, 0.6), [1.0, 2.4, 1.2]);
    scene.spot_light(dvec3(0.9, 2.6, 1.2), dvec3(0.0, -2.2, -1.2), [5.0, 7.0, 18.0], 0.20, 0.34);
    scene.directional_light(dvec3(-0.35, -1.0, -0.45), [0.50, 0.47, 0.40]);
    scene.camera("main", Camera { eye: dvec3(0.0, 3.0, 7.2), target: dvec3(0.0, 0.55, 0.0), yfov: 34.0, aspect: 1.6 });
    let sky = Sky::constant([0.06, 0.08, 0.12]);
    ShippedScene {
        name: "light_kinds",
        title: "One light of each kind: area, point, spot, directional, sky",
        scene,
        sky: Some(sky),
    }
}
