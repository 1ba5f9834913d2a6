//! The WGSL stage modules, embedded. Every file below `stages/wgsl` is one module; the linker joins those that a pipeline reaches.

/// One WGSL source file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Module {
    /// Module path below `package`, with `/` between names: `bsdf/lambert` is `package::bsdf::lambert`.
    pub path: &'static str,
    /// File name relative to the repository root, for messages: `stages/wgsl/bsdf/lambert.wgsl`.
    pub name: &'static str,
    /// The whole text of the file.
    pub text: &'static str,
}

/// The codecs among them: what each keeps, in how many bits, at what loss.
pub const CODECS: &str = include_str!("../codecs.toml");

/// All modules, sorted by path.
pub fn modules() -> &'static [Module] {
    include!(concat!(env!("OUT_DIR"), "/modules.rs"))
}

#[cfg(test)]
mod tests {
    use super::modules;

    #[test]
    fn paths_are_sorted_and_unique() {
        assert!(modules().windows(2).all(|pair| pair[0].path < pair[1].path));
    }

    #[test]
    fn names_repeat_paths() {
        for module in modules() {
            assert_eq!(module.name, format!("stages/wgsl/{}.wgsl", module.path));
        }
    }

    #[test]
    fn the_trace_stage_is_embedded() {
        assert!(modules().iter().any(|module| module.path == "stage/trace" && module.text.contains("fn trace(")));
    }
}
