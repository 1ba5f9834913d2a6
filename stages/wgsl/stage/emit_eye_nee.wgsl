import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::features::HAS_DELTA;
import package::stage::emit_eye::emit_eye;

/// Starts an eye walk that remembers whether its last bounce was specular.
fn emit_eye_nee(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    if HAS_DELTA {
        walk.flags = 0u;
    }
    emit_eye(walk, path);
    return EMITTED;
}
