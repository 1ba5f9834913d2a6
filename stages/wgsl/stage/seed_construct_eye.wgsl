import package::real::vec3r;
import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::scene::scene;
import package::camera::camera::camera_pdf_w;
import package::transport::dimension::eye_vertex;
import package::transport::walk::begin_eye;

/// Starts the eye walk that belongs to light vertex y_t, t = `path.light_length`, with random numbers of its own.
fn seed_construct_eye(eye: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    path.eye_length = 0u;
    let cosine = begin_eye(eye, eye_vertex(0u, path.light_length));
    eye.beta = eye.throughput;
    eye.normal = vec3r(scene.camera_forward.xyz);
    eye.pdf_w = camera_pdf_w(cosine);
    eye.pdf_area = 0.0;
    // No strategy lies before the camera.
    eye.mis = 0.0;
    return EMITTED;
}
