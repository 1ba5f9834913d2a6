//! Small pieces of WGSL text.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// The imports at the top of a generated module.
#[derive(Clone, Debug, Default)]
pub(super) struct Imports(BTreeMap<String, BTreeSet<String>>);

impl Imports {
    /// Imports items of a module.
    pub(super) fn add<'a>(&mut self, module: &str, items: impl IntoIterator<Item = &'a str>) {
        let known = self.0.entry(module.to_owned()).or_default();
        known.extend(items.into_iter().map(str::to_owned));
    }
}

impl fmt::Display for Imports {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (module, items) in &self.0 {
            let items: Vec<&str> = items.iter().map(String::as_str).collect();
            match items.as_slice() {
                [] => {}
                [item] => writeln!(f, "import package::{module}::{item};")?,
                _ => writeln!(f, "import package::{module}::{{{}}};", items.join(", "))?,
            }
        }
        Ok(())
    }
}

/// The components of a vector, by index.
pub(super) const COMPONENTS: [&str; 4] = ["x", "y", "z", "w"];

/// What every kernel over paths or records is told of its place.
pub(super) const PARAMETERS: &str = "(\n    \
    @builtin(workgroup_id) group: vec3u,\n    \
    @builtin(num_workgroups) groups: vec3u,\n    \
    @builtin(local_invocation_index) lane: u32,\n)";

/// The WGSL constant of a stage's queue.
pub(super) fn stage_constant(stage: &str) -> String {
    format!("QUEUE_{}", stage.to_uppercase())
}

/// The WGSL constant of a stream's queue.
pub(super) fn stream_constant(stream: &str) -> String {
    format!("STREAM_{}", stream.to_uppercase())
}

/// The WGSL constant of a stage that a path goes on with inside a kernel.
pub(super) fn next_constant(stage: &str) -> String {
    format!("NEXT_{}", stage.to_uppercase())
}
