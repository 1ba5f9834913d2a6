import package::outcome::EMITTED;
import package::pass::path_sample;
import package::real::vec3r;
import package::state::{Path, Walk};

/// Starts a path.
fn emit(path: ptr<function, Path>, eye: ptr<function, Walk>) -> u32 {
    path.sample = path_sample();
    path.length = 0u;
    path.flags = 0u;
    eye.position = vec3r(0.0);
    eye.direction = vec3r(0.0, 0.0, 1.0);
    eye.throughput = vec3r(1.0);
    eye.pdf_w = 1.0;
    return EMITTED;
}
