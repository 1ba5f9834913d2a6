//! The stage that starts eye walks.

import package::state::{Path, Walk};
import package::outcome::EMITTED;
import package::transport::walk::begin_eye;

/// Sends a walk from the camera through a point of the path's pixel.
fn emit_eye(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    begin_eye(walk, 0u);
    path.length = 0u;
    return EMITTED;
}
