//! The command `pathloom`, which lies beside the tests: `cargo test --workspace` builds it.

use std::path::{Path, PathBuf};

/// `pathloom` as cargo built it: `target/PROFILE/deps/TEST` runs `target/PROFILE/pathloom`.
///
/// # Panics
/// When it was not built.
pub fn program() -> PathBuf {
    let test = std::env::current_exe().expect("a test has a path");
    let folder = test.parent().and_then(Path::parent).expect("a test lies in `deps`");
    let program = folder.join(format!("pathloom{}", std::env::consts::EXE_SUFFIX));
    assert!(
        program.is_file(),
        "{} is not there: `cargo test --workspace` or `cargo build` builds it",
        program.display()
    );
    program
}
