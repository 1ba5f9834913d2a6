//! Parses and validates linked text; errors point into the author's files.

use super::place_of;
use crate::diagnostic::Diagnostic;
use crate::link::Linked;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::error::Error;

/// A place in linked text and what naga says about it.
type NagaLabel = (naga::Span, String);

/// How naga begins its message about a name that nothing declares.
const UNKNOWN_NAME: &str = "no definition in scope for identifier: ";

/// Parses a linked text.
///
/// # Errors
/// K0304 for a name that is neither declared, imported nor built in; K0310 for anything else that is no WGSL.
pub fn parse(linked: &Linked) -> Result<naga::Module, Vec<Diagnostic>> {
    naga::front::wgsl::parse_str(&linked.text).map_err(|error| vec![syntax_error(&error, linked)])
}

fn syntax_error(error: &naga::front::wgsl::ParseError, linked: &Linked) -> Diagnostic {
    let mut diagnostic = match error.message().strip_prefix(UNKNOWN_NAME) {
        Some(name) => Diagnostic::error("K0304", format!("{name} is neither declared nor imported"))
            .help("import it at the top of the module: import package::module::item;"),
        None => Diagnostic::error("K0310", error.message()),
    };
    for (index, (span, message)) in error.labels().enumerate() {
        let place = place_of(span, linked);
        diagnostic = if index == 0 { diagnostic.at(place, message) } else { diagnostic.also(place, message) };
    }
    error.notes().fold(diagnostic, |diagnostic, note| diagnostic.help(note))
}

/// Checks a parsed text as naga does before it compiles it, with all capabilities.
///
/// # Errors
/// K0311 with what naga found.
pub fn validate(module: &naga::Module, linked: &Linked) -> Result<naga::valid::ModuleInfo, Vec<Diagnostic>> {
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    validator.validate(module).map_err(|error| {
        let diagnostic = Diagnostic::error("K0311", without_numbers(&chain(error.as_inner())));
        let labels = innermost(error.spans().collect());
        vec![labels.into_iter().fold(diagnostic, |diagnostic, (span, label)| {
            diagnostic.at(place_of(*span, linked), without_numbers(label))
        })]
    })
}

/// The labels that have no other label inside: the function around an error says nothing more.
fn innermost(labels: Vec<&NagaLabel>) -> Vec<&NagaLabel> {
    let contains = |outer: &naga::Span, inner: &naga::Span| match (outer.to_range(), inner.to_range()) {
        (Some(outer), Some(inner)) => outer != inner && outer.start <= inner.start && inner.end <= outer.end,
        _ => false,
    };
    let is_outer = |(outer, _): &NagaLabel| labels.iter().any(|(inner, _)| contains(outer, inner));
    labels.iter().copied().filter(|label| !is_outer(label)).collect()
}

/// naga's text without the numbers it gives things: `naga::ir::Expression [5]` says nothing to an author. A number that stands for a
/// noun, as in `the type of [5]`, becomes one.
fn without_numbers(text: &str) -> String {
    const BEFORE_NOUNS: [&str; 5] = [" of", " in", " to", " with", " for"];
    let mut parts = text.split(" [");
    let mut out = parts.next().unwrap_or_default().replace("naga::ir::", "");
    for part in parts {
        match part.split_once(']') {
            Some((number, rest)) if number.bytes().all(|byte| byte.is_ascii_digit()) => {
                if BEFORE_NOUNS.iter().any(|word| out.ends_with(word)) {
                    out.push_str(" a value");
                }
                out.push_str(rest);
            }
            _ => {
                out.push_str(" [");
                out.push_str(part);
            }
        }
    }
    out
}

/// An error and what caused it, in one line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}
