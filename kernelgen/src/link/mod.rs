//! Joins WGSL modules: declarations reached from a root are copied verbatim, code of absent effects is cut, and every byte keeps its origin.

mod condition;
mod module;
mod prune;
mod scope;
mod source_map;
#[cfg(test)]
mod tests;
mod token;
mod tree;

pub use source_map::SourceMap;

use crate::diagnostic::Diagnostic;
use crate::plan::Access;
use crate::source::{FileId, Sources, Span};
use std::collections::{BTreeMap, BTreeSet};

/// Module path without `package::`, segments joined by `::`, to its text: `bsdf::lambert`.
pub type Modules = BTreeMap<String, FileId>;

/// Constants known when text is linked: (module, item) to value, `("features", "HAS_SKY")`.
pub type Constants = BTreeMap<(String, String), Constant>;

/// The value of a known constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constant {
    /// `bool`.
    Bool(bool),
    /// `u32`.
    U32(u32),
    /// `real`.
    Real(f64),
}

/// A declaration to start from.
#[derive(Clone, Copy, Debug)]
pub struct Root<'a> {
    /// Module path, `stage::trace`.
    pub module: &'a str,
    /// Name of the declaration.
    pub item: &'a str,
}

/// A resource variable that the linked text declares.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkedBinding {
    /// Its WGSL name.
    pub name: String,
    /// The number the linker gave it, in order of first use.
    pub binding: u32,
    /// From its address space and access mode.
    pub access: Access,
    /// Where it is declared.
    pub span: Span,
}

/// One WGSL text, complete and self-contained.
#[derive(Clone, Debug)]
pub struct Linked {
    /// The text.
    pub text: String,
    /// Where every byte of it comes from.
    pub map: SourceMap,
    /// Its resource variables.
    pub bindings: Vec<LinkedBinding>,
    /// Reached declarations: (module path, item), in order of first use.
    pub items: Vec<(String, String)>,
    /// Constants of `features` that decided a cut or are still mentioned, by item name.
    pub constants_seen: Vec<String>,
    /// Imports that the reached declarations mention, be it in branches that are cut: (module path, item).
    pub mentioned: BTreeSet<(String, String)>,
}

/// Links everything that `root` reaches.
///
/// Branches that known constants rule out are cut, and what only they reach is not copied. If the root is an entry point, struct members
/// that nothing mentions are cut too, unless the struct is in a buffer, built by its constructor or has attributes.
///
/// # Errors
/// K0301 lexical error or unbalanced brackets, K0302 two declarations of one name, K0303 import of a missing module or item
/// (with the nearest name) that kept text uses, K0305 a resource with numbers of its own, K0306 a path inside
/// a declaration. Names that are neither declared nor imported are left to
/// [`crate::analyze::parse`], which knows the built-in ones.
pub fn link(
    sources: &Sources,
    modules: &Modules,
    constants: &Constants,
    root: Root<'_>,
) -> Result<Linked, Vec<Diagnostic>> {
    tree::Linker::new(sources, modules, constants).link(root)
}
