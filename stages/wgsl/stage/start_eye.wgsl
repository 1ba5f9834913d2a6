import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::params::{counting, counting_realised};
import package::camera::camera::camera_pdf_w;
import package::tallies::count_implicit_walks;
import package::transport::advance::set_sums;
import package::transport::dimension::eye_vertex;
import package::transport::recursive_mis::{MisPartial, source};
import package::transport::strategy::{eye_limit, first_joined};
import package::transport::walk::begin_eye;

/// Starts the eye walk that belongs to light vertex y_t, t = `path.light_length`, or to it and those before, with random numbers of
/// its own.
fn start_eye(eye: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    eye.length = 0u;
    let first = first_joined(path.light_length);
    if counting == counting_realised {
        for (var edges = select(2u, 1u, first == 1u); edges <= eye_limit(first); edges += 1u) {
            count_implicit_walks(edges);
        }
    }
    let cosine = begin_eye(eye, eye_vertex(0u, first));
    var sums: MisPartial;
    // There is one light path a pixel: the particle strategy takes as many samples as the others.
    sums.a = source(1.0 / camera_pdf_w(cosine));
    set_sums(eye, sums);
    return EMITTED;
}
