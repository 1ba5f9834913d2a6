import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::stage::emit_eye::emit_eye;

/// Starts an eye walk that carries the density of its direction; 0: what it meets was not sampled as a light.
fn emit_eye_mis(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    walk.pdf_w = 0.0;
    emit_eye(walk, path);
    return EMITTED;
}
