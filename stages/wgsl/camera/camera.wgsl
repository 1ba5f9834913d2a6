//! The perspective camera: pinhole or thin lens, box pixels, raster y downwards.

import package::real::{real, vec2r, vec3r};
import package::features::HAS_LENS;
import package::sample::disk::sample_disk;
import package::scene::scene;

/// A ray into the scene.
struct CameraRay {
    origin: vec3r,
    /// Unit.
    direction: vec3r,
}

/// A point of the scene joined to the camera.
struct CameraConnection {
    /// The point lies in the image; else the rest is undefined.
    valid: bool,
    /// y * width + x of the pixel that holds the projection.
    pixel: u32,
    /// Point on the lens.
    position: vec3r,
    /// Unit, from the scene's point to the lens.
    direction: vec3r,
    /// Density of the eye ray through that lens point, times 1/distance^2 (the cosine at the scene's point is left out).
    /// It is also the importance the pixel's mean radiance gives to light of that direction, at one light path a pixel.
    importance: real,
}

/// Vector in world space of camera coordinates (right, up, forward).
fn camera_to_world(v: vec3r) -> vec3r {
    return v.x * vec3r(scene.camera_right.xyz) + v.y * vec3r(scene.camera_up.xyz) + v.z * vec3r(scene.camera_forward.xyz);
}

/// Vector in camera coordinates (right, up, forward).
fn world_to_camera(v: vec3r) -> vec3r {
    return vec3r(dot(v, vec3r(scene.camera_right.xyz)), dot(v, vec3r(scene.camera_up.xyz)), dot(v, vec3r(scene.camera_forward.xyz)));
}

/// Half width and height of the image plane at unit distance.
fn image_half_size() -> vec2r {
    return vec2r(real(scene.camera_right.w), real(scene.camera_up.w));
}

/// Point of the lens in camera coordinates, m.
fn lens_point(random: vec2r) -> vec3r {
    return vec3r(real(scene.camera_origin.w) * sample_disk(random), 0.0);
}

/// Primary ray through `raster` (pixels, y downwards); `random`, in [0,1), places its origin.
fn camera_ray(raster: vec2r, random: vec2r) -> CameraRay {
    let size = vec2r(scene.counts.xy);
    let plane = image_half_size() * (2.0 * raster / size - 1.0) * vec2r(1.0, -1.0);
    var direction = vec3r(plane, 1.0);
    var ray: CameraRay;
    ray.origin = vec3r(scene.camera_origin.xyz);
    if HAS_LENS {
        let offset = lens_point(random);
        direction = direction * real(scene.camera_forward.w) - offset;
        ray.origin += camera_to_world(offset);
    }
    ray.direction = normalize(camera_to_world(direction));
    return ray;
}

/// Density of primary rays per sr, given the lens point: 1 / (A_image cos^3), A_image the image's area at unit distance.
/// `cosine` is that of the direction to the camera's axis.
fn camera_pdf_w(cosine: real) -> real {
    let half_size = image_half_size();
    return 1.0 / (4.0 * half_size.x * half_size.y * cosine * cosine * cosine);
}

/// Joins a point of the scene to a lens point drawn with `random`; the line's crossing of the focus plane gives the pixel.
fn connect_camera(point: vec3r, random: vec2r) -> CameraConnection {
    var connection: CameraConnection;
    connection.position = vec3r(scene.camera_origin.xyz);
    var offset = vec3r(0.0);
    if HAS_LENS {
        offset = lens_point(random);
        connection.position += camera_to_world(offset);
    }
    let span = point - connection.position;
    let local = world_to_camera(span);
    if local.z <= 0.0 {
        return connection;
    }
    var plane = local.xy / local.z;
    if HAS_LENS {
        plane += offset.xy / real(scene.camera_forward.w);
    }
    let size = vec2r(scene.counts.xy);
    let raster = (plane / image_half_size() * vec2r(1.0, -1.0) + 1.0) * (0.5 * size);
    if any(raster < vec2r(0.0)) || any(raster >= size) {
        return connection;
    }
    let distance = length(span);
    let cell = vec2u(raster);
    connection.valid = true;
    connection.pixel = cell.y * scene.counts.x + cell.x;
    connection.direction = -span / distance;
    connection.importance = camera_pdf_w(local.z / distance) / (distance * distance);
    return connection;
}
