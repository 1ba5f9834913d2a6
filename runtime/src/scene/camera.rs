//! The camera: chosen from the file, or placed in front of the scene when the file has none.

use super::node::Placed;
use crate::error::{Error, Result};
use glam::{DMat4, DVec3};
use gltf::camera::Projection;

/// Longer side of the image when no size is given, pixels.
const DEFAULT_SIDE: u32 = 512;
/// Vertical field of view and aspect of the camera that is made up for files without one.
const DEFAULT_YFOV: f64 = std::f64::consts::FRAC_PI_4;
const DEFAULT_ASPECT: f64 = 4.0 / 3.0;
/// Largest image side, pixels.
const MOST_PIXELS: u32 = 1 << 15;

/// A pinhole or thin-lens camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name of its node.
    pub name: String,
    /// Position, world.
    pub origin: DVec3,
    /// Orthonormal, right-handed: right, up, and the viewing direction.
    pub axes: [DVec3; 3],
    /// Vertical field of view, radians.
    pub yfov: f64,
    /// Image size, pixels.
    pub size: (u32, u32),
}

/// Picks a camera by name, else by index; the first when `wanted` is not given.
///
/// # Errors
/// An unknown name, an orthographic camera, a field of view outside (0, pi), a transform without directions.
pub fn choose(
    cameras: &[Placed<gltf::Camera<'_>>],
    wanted: Option<&str>,
    size: Option<(u32, u32)>,
    bounds: (DVec3, f64),
) -> Result<Camera> {
    check_size(size)?;
    let Some(wanted) = wanted else {
        return match cameras.first() {
            Some(first) => from_node(first, cameras, size),
            None => Ok(facing(bounds, size)),
        };
    };
    let by_name = cameras.iter().find(|camera| camera.name == wanted || camera.item.name() == Some(wanted));
    let by_index = || wanted.parse::<usize>().ok().and_then(|index| cameras.get(index));
    match by_name.or_else(by_index) {
        Some(camera) => from_node(camera, cameras, size),
        None => Err(Error::input(format!("there is no camera `{wanted}`")).help(listing(cameras))),
    }
}

fn check_size(size: Option<(u32, u32)>) -> Result<()> {
    match size {
        Some((w, h)) if w == 0 || h == 0 || w > MOST_PIXELS || h > MOST_PIXELS => {
            Err(Error::input(format!("image size {w}x{h}")).help(format!("1x1 to {MOST_PIXELS}x{MOST_PIXELS}")))
        }
        _ => Ok(()),
    }
}

fn listing(cameras: &[Placed<gltf::Camera<'_>>]) -> String {
    let perspective =
        |camera: &&Placed<gltf::Camera<'_>>| matches!(camera.item.projection(), Projection::Perspective(_));
    let names: Vec<String> = cameras.iter().filter(perspective).map(|camera| format!("`{}`", camera.name)).collect();
    if names.is_empty() {
        "the file has no perspective camera".into()
    } else {
        format!("perspective cameras: {}", names.join(", "))
    }
}

fn from_node(
    camera: &Placed<gltf::Camera<'_>>,
    all: &[Placed<gltf::Camera<'_>>],
    size: Option<(u32, u32)>,
) -> Result<Camera> {
    let at = |error: Error| error.at(format!("camera `{}`", camera.name));
    let Projection::Perspective(perspective) = camera.item.projection() else {
        return Err(at(Error::input("orthographic cameras are not supported").help(listing(all))));
    };
    let yfov = f64::from(perspective.yfov());
    if !(yfov > 0.0 && yfov < std::f64::consts::PI) {
        return Err(at(Error::input(format!("yfov is {yfov}")).help("more than 0 and less than pi")));
    }
    let aspect = perspective.aspect_ratio().map_or(1.0, f64::from);
    if !(aspect > 0.0 && aspect.is_finite()) {
        return Err(at(Error::input(format!("aspectRatio is {aspect}")).help("more than 0")));
    }
    let axes = axes(&camera.matrix).ok_or_else(|| at(Error::input("its transform leaves it no viewing direction")))?;
    Ok(Camera {
        name: camera.name.clone(),
        origin: camera.matrix.w_axis.truncate(),
        axes,
        yfov,
        size: size.unwrap_or_else(|| default_size(aspect)),
    })
}

/// Orthonormal axes of a node: the viewing direction is kept, then up; scale, shear and mirroring are ignored.
fn axes(matrix: &DMat4) -> Option<[DVec3; 3]> {
    let forward = (-matrix.z_axis.truncate()).try_normalize()?;
    let up = matrix.y_axis.truncate();
    let up = (up - forward * forward.dot(up)).try_normalize()?;
    Some([forward.cross(up), up, forward])
}

fn default_size(aspect: f64) -> (u32, u32) {
    let side = f64::from(DEFAULT_SIDE);
    let other = |length: f64| (length.round() as u32).clamp(1, DEFAULT_SIDE);
    if aspect >= 1.0 { (DEFAULT_SIDE, other(side / aspect)) } else { (other(side * aspect), DEFAULT_SIDE) }
}

/// The camera of a file without one: it looks at the centre of the bounds from +Z, a quarter above, and sees the whole bounding sphere.
fn facing((centre, radius): (DVec3, f64), size: Option<(u32, u32)>) -> Camera {
    let size = size.unwrap_or_else(|| default_size(DEFAULT_ASPECT));
    let narrower = (f64::from(size.0) / f64::from(size.1)).min(1.0);
    let half_angle = ((DEFAULT_YFOV / 2.0).tan() * narrower).atan();
    let back = DVec3::new(0.0, 0.25, 1.0).normalize();
    let right = DVec3::X;
    Camera {
        name: "default".into(),
        origin: centre + back * (radius / half_angle.sin()),
        axes: [right, back.cross(right), -back],
        yfov: DEFAULT_YFOV,
        size,
    }
}

impl Camera {
    /// Half width and half height of the image plane at unit distance; pixels are square.
    pub fn half_extent(&self) -> (f64, f64) {
        let half_height = (self.yfov / 2.0).tan();
        (half_height * f64::from(self.size.0) / f64::from(self.size.1), half_height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_camera_sees_the_bounding_sphere() {
        let camera = facing((DVec3::new(1.0, 2.0, 3.0), 2.0), Some((100, 400)));
        let [right, up, forward] = camera.axes;
        assert!((right.cross(up) + forward).length() < 1e-12);
        let (half_width, _) = camera.half_extent();
        let distance = camera.origin.distance(DVec3::new(1.0, 2.0, 3.0));
        assert!((distance * half_width.atan().sin() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn mirrored_and_scaled_nodes_keep_the_viewing_direction() {
        let matrix = DMat4::from_scale(DVec3::new(-2.0, 3.0, 0.5));
        assert_eq!(axes(&matrix), Some([DVec3::X, DVec3::Y, DVec3::NEG_Z]));
        assert_eq!(axes(&DMat4::from_scale(DVec3::ZERO)), None);
        assert_eq!(default_size(1.6), (512, 320));
    }
}
