//! What a kernel knows of the scene as a whole. The runtime packs the same words.

/// Camera, bounds and sizes of the scene. Lengths in metres, angles as cosines, directions unit vectors in world space (right-handed, +Y up).
struct Scene {
    /// xyz: pinhole or lens centre; w: lens radius (0: pinhole)
    camera_origin: vec4f,
    /// xyz: unit vector; w: half width of the image plane at unit distance
    camera_right: vec4f,
    /// xyz: unit vector; w: half height of the image plane at unit distance
    camera_up: vec4f,
    /// xyz: unit vector; w: focus distance (1 without a lens)
    camera_forward: vec4f,
    /// bounding sphere: xyz centre, w radius
    bounds: vec4f,
    /// image width, image height, number of lights, number of triangles
    counts: vec4u,
}

var<uniform> scene: Scene;
