//! Scenes whose radiance is known in closed form, and how renderings are held against it. The numbers are those of algorithm.md section 9.

use crate::material::Material;
use crate::rendering::{BuiltScene, Job, Rendering};
use crate::scene_builder::{Camera, MaterialId, SceneBuilder};
use crate::shape::{disk, sphere};
use crate::sky::Sky;
use crate::statistics::{Estimate, spread};
use glam::{DVec2, DVec3, dvec3};
use std::f64::consts::{PI, TAU};

/// Rounding of f32 radiance and of tessellated shapes, as a share of the value.
pub const FLOOR: f64 = 3e-4;

/// Edge of what stands for an infinite plane, metres.
pub const WIDE: f64 = 400.0;

/// A Lambert reflector without colour.
pub fn grey(value: f64) -> Material {
    Material::lambert("grey", [value; 3])
}

/// The mean of the image is `expected`: within 4.5 standard errors, which must be below 0.5 % for the test to mean anything.
///
/// # Panics
/// When it is not, or when the film refused contributions.
#[track_caller]
pub fn assert_mean(rendering: &Rendering, expected: f64, what: &str) {
    let estimate = rendering.pixels.mean_estimate();
    assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
    assert_estimate(estimate, expected, what);
}

/// As `assert_mean`, of a mean.
///
/// # Panics
/// When it is not as expected, or too noisy to tell.
#[track_caller]
pub fn assert_estimate(estimate: Estimate, expected: f64, what: &str) {
    let z = estimate.z(&Estimate::exact(expected), FLOOR * expected);
    assert!(estimate.error <= 0.005 * expected, "{what}: {estimate:?} is too noisy to test {expected}");
    assert!(z.abs() < 4.5, "{what}: {estimate:?}, expected {expected}, z = {z:.2}");
}

/// Looks at a point through a field of view so narrow that radiance is constant over the image.
pub fn narrow(eye: DVec3, target: DVec3) -> Camera {
    Camera { eye, target, yfov: 0.1, aspect: 1.0 }
}

/// A room whose walls emit 1 and reflect an albedo: radiance is the sum of albedo^i below the number of edges.
pub fn furnace(albedo: f64) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let walls = scene.material(Material { emission: [1.0; 3], ..grey(albedo) });
    scene.room(walls, DVec3::splat(-1.0), DVec3::splat(1.0));
    scene.camera("main", Camera { eye: dvec3(0.1, 0.2, 0.3), target: DVec3::Z * -1.0, yfov: 60.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

/// A ball of radius 1 with flat faces in a constant sky of radiance 1, seen from 5 m. Its rim is at 11.5 degrees.
pub fn ball_in_a_constant_sky(material: Material, yfov: f64) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let material = scene.material(material);
    scene.mesh(material, sphere(DVec3::ZERO, 1.0, 16).flat());
    scene.camera("main", Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, yfov, aspect: 1.0 });
    BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])))
}

/// The upper face of a body of glass at height 0, and a floor inside the glass.
pub fn glass_over_a_floor(floor: Material, height: f64, camera: Camera) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let glass = scene.material(Material::glass("glass", 1.5, 0.0));
    let floor = scene.material(floor);
    scene.floor(glass, 0.0, WIDE);
    scene.floor(floor, height, WIDE);
    scene.camera("main", camera);
    scene
}

/// A sky of radiance 1, seen straight up from 1 m inside glass.
pub fn sky_from_inside_glass() -> BuiltScene {
    let camera = narrow(dvec3(0.0, -1.0, 0.0), DVec3::ZERO);
    let scene = glass_over_a_floor(Material::lambert("black", [0.0; 3]), -2.0, camera);
    BuiltScene::new(&scene, Some(&Sky::constant([1.0; 3])))
}

/// An emitter of radiance 1 inside glass, seen straight down from outside.
pub fn emitter_inside_glass() -> BuiltScene {
    let scene = glass_over_a_floor(Material::emitter("light", [1.0; 3]), -1.0, narrow(DVec3::Y, DVec3::ZERO));
    BuiltScene::new(&scene, None)
}

/// A sky of radiance 1 above the horizon. The row of texels that is blurred into the black below it brings 1e-4 of the light.
pub fn sky_above() -> Sky {
    Sky::from_directions(8, 128, |towards| [if towards.y > 0.0 { 1.0 } else { 0.0 }; 3])
}

/// A floor between black walls under a lid of glass at height 1, above the camera.
pub fn floor_below_glass(roughness: f64) -> SceneBuilder {
    let mut scene = FROM_BELOW_THE_LIGHT.floor(0.5, 3.0);
    let glass = scene.material(Material::glass("glass", 1.5, roughness));
    let black = scene.material(grey(0.0).two_sided());
    scene.floor(glass, 1.0, 3.0);
    for (corner, edge) in [
        (dvec3(-1.5, 0.0, -1.5), DVec3::X),
        (dvec3(-1.5, 0.0, 1.5), DVec3::X),
        (dvec3(-1.5, 0.0, -1.5), DVec3::Z),
        (dvec3(1.5, 0.0, -1.5), DVec3::Z),
    ] {
        scene.quad(black, corner, edge * 3.0, DVec3::Y);
    }
    scene
}

/// A camera that looks straight down on a floor: its right is +Z, its up is +X.
#[derive(Clone, Copy)]
pub struct View {
    /// Of the camera above the floor, metres.
    pub height: f64,
    /// Half of the edge of the square that it sees, metres.
    pub half: f64,
    /// Along an edge of the image.
    pub pixels: u32,
}

/// From above the lights at height 1.
pub const FROM_ABOVE: View = View { height: 4.0, half: 0.8, pixels: 32 };
/// From below them, so that lights with an area are not in the way.
pub const FROM_BELOW_THE_LIGHT: View = View { height: 0.8, half: 0.4, pixels: 16 };

impl View {
    /// A grey floor of a given edge under the camera.
    pub fn floor(self, albedo: f64, edge: f64) -> SceneBuilder {
        let mut scene = SceneBuilder::new();
        let floor = scene.material(grey(albedo));
        scene.floor(floor, 0.0, edge);
        let yfov = 2.0 * (self.half / self.height).atan().to_degrees();
        scene.camera("main", Camera { eye: DVec3::Y * self.height, target: DVec3::ZERO, yfov, aspect: 1.0 });
        scene
    }

    /// A render of the floor by light that scatters once.
    pub fn job(self, scene: &BuiltScene, pipeline: &str) -> Job {
        scene.job().pipeline(pipeline).edges(2).size(self.pixels, self.pixels).samples(1024)
    }

    /// The mean over a pixel of a function of the place on the floor, by 8 x 8 midpoints.
    pub fn pixel_mean(self, pixel: usize, value: impl Fn(DVec2) -> f64) -> f64 {
        let points = self.points(pixel, 8);
        points.iter().map(|point| value(*point)).sum::<f64>() / points.len() as f64
    }

    /// Midpoints (z, -x) of `steps` x `steps` parts of a pixel.
    fn points(self, pixel: usize, steps: u32) -> Vec<DVec2> {
        let side = 2.0 * self.half / f64::from(self.pixels);
        let corner = DVec2::new((pixel as u32 % self.pixels).into(), (pixel as u32 / self.pixels).into());
        let part = |i: u32| DVec2::new((i % steps).into(), (i / steps).into()) + 0.5;
        (0..steps * steps).map(|i| (corner + part(i) / f64::from(steps)) * side - self.half).collect()
    }

    /// Bounds on the distance from the origin over a pixel, a little wide.
    pub fn distances(self, pixel: usize) -> (f64, f64) {
        let side = 2.0 * self.half / f64::from(self.pixels);
        let centre = self.points(pixel, 1)[0].length();
        (centre - side, centre + side)
    }

    /// Every pixel is as expected: the rule for z-scores, with 1e-3 for rounding and tessellation.
    ///
    /// # Panics
    /// When it is not.
    #[track_caller]
    pub fn assert_pixels(self, rendering: &Rendering, value: impl Fn(DVec2) -> f64, what: &str) {
        assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
        let expected: Vec<f64> = (0..rendering.pixels.rgb.len()).map(|pixel| self.pixel_mean(pixel, &value)).collect();
        // The image is grey: its channels are one number, not three.
        let estimates = rendering.pixels.estimates();
        let of_pixel =
            |(estimate, expected): (&Estimate, &f64)| estimate.z(&Estimate::exact(*expected), 1e-3 * expected);
        let scores: Vec<f64> = estimates.iter().step_by(3).zip(&expected).map(of_pixel).collect();
        let spread = spread(&scores);
        assert!(spread.agrees(), "{what}: {spread:?}");
        assert_estimate(
            rendering.pixels.mean_estimate(),
            expected.iter().sum::<f64>() / expected.len() as f64,
            &format!("{what}, whole image"),
        );
    }

    /// The floor under a spot light of 1 W/sr at height 1 above the origin: inside the inner cone that of a point light, outside the
    /// outer cone nothing at all.
    ///
    /// # Panics
    /// When it is not.
    #[track_caller]
    pub fn assert_below_a_spot(self, rendering: &Rendering, albedo: f64, [inner, outer]: [f64; 2], what: &str) {
        assert_eq!(rendering.rejected, 0, "{what}: rejected contributions");
        for (pixel, estimate) in rendering.pixels.estimates().iter().step_by(3).enumerate() {
            let (nearest, farthest) = self.distances(pixel);
            if farthest < inner.tan() {
                let expected = self.pixel_mean(pixel, |place| lambert_under_point(albedo, 1.0, place));
                let z = estimate.z(&Estimate::exact(expected), 1e-3 * expected);
                assert!(z.abs() < 6.0, "{what}, pixel {pixel}: {estimate:?}, expected {expected}");
            } else if nearest > outer.tan() {
                assert_eq!(estimate.mean, 0.0, "{what}, pixel {pixel}: light outside the cone");
            }
        }
    }

    /// The centroid of the light on the floor is where the camera sees the place (x, z), to a hundredth of a pixel.
    ///
    /// # Panics
    /// When it is not.
    #[track_caller]
    pub fn assert_centroid(self, rendering: &Rendering, [x, z]: [f64; 2]) {
        let mut sums = [0.0; 3];
        for (index, pixel) in rendering.pixels.rgb.iter().enumerate() {
            let weight = f64::from(pixel[0]);
            sums[0] += weight;
            sums[1] += weight * (f64::from(index as u32 % self.pixels) + 0.5);
            sums[2] += weight * (f64::from(index as u32 / self.pixels) + 0.5);
        }
        let scale = f64::from(self.pixels) / (2.0 * self.half);
        for (axis, expected) in [(z + self.half) * scale, (self.half - x) * scale].into_iter().enumerate() {
            let found = sums[1 + axis] / sums[0];
            assert!((found - expected).abs() < 0.01, "axis {axis}: centroid at {found}, projected to {expected}");
        }
    }
}

/// Radiance of a Lambert floor at a place under a point light of 1 W/sr above the origin.
pub fn lambert_under_point(albedo: f64, height: f64, place: DVec2) -> f64 {
    albedo / PI * height / (height * height + place.length_squared()).powf(1.5)
}

/// A light of radiance 1 over a floor.
#[derive(Clone, Copy)]
pub struct FloorLight {
    /// Adds it, of this material, to a scene.
    pub add: fn(&mut SceneBuilder, MaterialId),
    /// Its form factor from a place on the floor.
    factor: fn(DVec2) -> f64,
}

/// A parallel unit square at unit height.
pub const SQUARE_LIGHT: FloorLight =
    FloorLight { add: |scene, light| scene.ceiling(light, 1.0, 1.0), factor: factor_of_unit_square };
/// A parallel disk of radius 1 at unit height: E = pi Le a^2/(a^2+h^2) below its centre.
pub const DISK_LIGHT: FloorLight = FloorLight {
    add: |scene, light| scene.mesh(light, disk(DVec3::Y, DVec3::NEG_Y, 1.0, 128)),
    factor: factor_of_unit_disk,
};
/// A sphere of radius .5 at height 2: E = pi Le (R/D)^2 cos.
pub const SPHERE_LIGHT: FloorLight = FloorLight { add: add_sphere, factor: factor_of_sphere };

impl FloorLight {
    /// The light over a floor of albedo .5 that is seen from below the light.
    pub fn over_a_floor(self) -> BuiltScene {
        let mut scene = FROM_BELOW_THE_LIGHT.floor(0.5, 20.0);
        let light = scene.material(Material::emitter("light", [1.0; 3]));
        (self.add)(&mut scene, light);
        BuiltScene::new(&scene, None)
    }

    /// Every pixel of that floor is as expected.
    ///
    /// # Panics
    /// When one is not.
    #[track_caller]
    pub fn assert_pixels(self, rendering: &Rendering, what: &str) {
        FROM_BELOW_THE_LIGHT.assert_pixels(rendering, |place| 0.5 * (self.factor)(place), what);
    }
}

/// Of facets, with the area of the ball as it is seen from below.
fn add_sphere(scene: &mut SceneBuilder, light: MaterialId) {
    const RINGS: u32 = 48;
    let slice = PI / f64::from(RINGS);
    scene.mesh(light, sphere(DVec3::Y * 2.0, 0.5 * (slice / slice.sin()).sqrt(), RINGS));
}

fn factor_of_sphere(place: DVec2) -> f64 {
    let distance = place.length().hypot(2.0);
    (0.5 / distance).powi(2) * 2.0 / distance
}

/// Form factor from a place on the floor to a parallel unit square at unit height above the origin: four rectangles with a corner
/// above the place.
fn factor_of_unit_square(place: DVec2) -> f64 {
    let corner = |a: f64, b: f64| {
        let (root_a, root_b) = (a.hypot(1.0), b.hypot(1.0));
        (a / root_a * (b / root_a).atan() + b / root_b * (a / root_b).atan()) / TAU
    };
    let sides = |x: f64| [0.5 - x, 0.5 + x];
    sides(place.x).iter().flat_map(|&a| sides(place.y).map(|b| corner(a, b))).sum()
}

/// Form factor to a parallel disk of radius 1 at unit height above the origin.
fn factor_of_unit_disk(place: DVec2) -> f64 {
    let d2 = place.length_squared();
    (1.0 - d2 / ((d2 + 2.0).powi(2) - 4.0 * d2).sqrt()) / 2.0
}
