//! Names that become WGSL identifiers.

use super::section::{Findings, Item};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use naga::keywords::wgsl::{BUILTIN_IDENTIFIERS, RESERVED};

/// Names that the generated modules declare themselves.
const GENERATED: [&str; 20] = [
    "Hit",
    "Pass",
    "END",
    "real",
    "vec2r",
    "vec3r",
    "vec4r",
    "pass_info",
    "path_id",
    "path_pixel",
    "path_sample",
    "pass_seed",
    "path_count",
    "picture_width",
    "picture_height",
    "splat",
    "tally_counts",
    "tally_rates",
    "tally_share",
    "add_tallies",
];

/// Built-in names that a declaration may hide: no stage can use the type, since all resources are buffers.
const HIDEABLE: [&str; 1] = ["sampler"];

/// K0114 when the key cannot name a declaration of the generated WGSL.
pub fn check(what: &str, item: &Item<'_>, findings: &mut Findings) {
    let own = GENERATED.contains(&item.name).then_some("a name that the generator declares itself");
    let built_in = BUILTIN_IDENTIFIERS.contains(&item.name) && !HIDEABLE.contains(&item.name);
    let built_in = built_in.then_some("a built-in name of WGSL");
    refuse(what, item.name, item.key, own.or(built_in), findings);
}

/// K0114 when the word cannot be a part of a generated name, or a member of a struct.
pub fn check_part(what: &str, name: &str, span: Span, findings: &mut Findings) {
    refuse(what, name, span, None, findings);
}

fn refuse(what: &str, name: &str, span: Span, taken: Option<&'static str>, findings: &mut Findings) {
    let Some(reason) = malformed(name).or(taken) else {
        return;
    };
    let refused = Diagnostic::error("K0114", format!("`{name}` cannot be the name of a {what}"))
        .at(span, reason)
        .help("names go into the generated WGSL: letters, digits and `_`, first a letter, no word of the language");
    findings.push(refused);
}

fn malformed(name: &str) -> Option<&'static str> {
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !plain || !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        return Some("not an identifier");
    }
    RESERVED.contains(&name).then_some("a reserved word of WGSL")
}
