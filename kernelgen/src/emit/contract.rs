//! What functions have to look like that stages, keys and stream consumers name: parameters, results, and what they may do.

use super::entry::Entry;
use super::signature::Signature;
use super::wiring::{Analysed, Texts};
use crate::config::model::{Stage, Stream, Variant};
use crate::config::nearest;
use crate::diagnostic::Diagnostic;
use crate::source::{Span, Spanned};
use std::collections::{BTreeMap, BTreeSet};

/// Every parameter of a stage function, or of a key function of the stage, takes an instance of its own.
pub(super) fn check_parameters(
    variant: &Variant,
    name: &str,
    stage: &Stage,
    entry: &Entry,
    signature: &Signature,
) -> Vec<Diagnostic> {
    let pipeline = &variant.pipeline;
    let place = |param: &str| entry.params.get(param).copied().unwrap_or(entry.span);
    let mut findings = Vec::new();
    let mut taken: BTreeMap<String, String> = BTreeMap::new();
    for (param, record) in &signature.params {
        let bound = stage.with.get(param).map(|instance| instance.value.as_str()).unwrap_or(param);
        let Some(declared) = pipeline.state.get(bound) else {
            findings.push(no_instance(variant, name, stage, param, bound, place(param)));
            continue;
        };
        if record.as_ref() != Some(&declared.value) {
            let is = match record {
                Some(record) => format!("takes a `ptr<function, {record}>`"),
                None => "is no pointer to a record in function space".to_owned(),
            };
            let message =
                format!("parameter `{param}` of stage `{name}` {is}, but `{bound}` is a `{}`", declared.value);
            findings.push(
                Diagnostic::error("K0207", message)
                    .at(place(param), format!("should be `ptr<function, {}>`", declared.value))
                    .also(declared.span, format!("`{bound}` is declared here"))
                    .help(format!("give it an instance of its record: `with.{param} = ..`")),
            );
        }
        if let Some(other) = taken.insert(bound.to_owned(), param.clone()) {
            let message = format!("parameters `{other}` and `{param}` of stage `{name}` both stand for `{bound}`");
            findings.push(
                Diagnostic::error("K0219", message)
                    .at(stage.span, "wired here")
                    .also(place(param), "WGSL forbids two pointers to one variable")
                    .help(format!("give one of them another instance: `with.{param} = ..`")),
            );
        }
    }
    findings
}

/// Whatever `with` names is a parameter of the stage function or of a key function.
pub(super) fn check_with(
    name: &str,
    stage: &Stage,
    entry: &Entry,
    signature: &Signature,
    key_params: &BTreeSet<String>,
) -> Vec<Diagnostic> {
    let mut findings = Vec::new();
    for (param, instance) in stage.with.iter().filter(|(param, _)| !key_params.contains(*param)) {
        if !signature.params.iter().any(|(name, _)| name == param) {
            let names = signature.params.iter().map(|(name, _)| name.as_str());
            let help = match nearest(param, names.clone()) {
                Some(near) => format!("did you mean `with.{near}`?"),
                None => format!("its parameters are {}", names.collect::<Vec<_>>().join(", ")),
            };
            let message = format!("stage `{name}` has no parameter `{param}`");
            findings.push(
                Diagnostic::error("K0220", message)
                    .at(instance.span, "given here")
                    .also(entry.span, format!("`{}` does not have it", entry.name))
                    .help(help),
            );
        }
    }
    findings
}

pub(super) fn check_returns_outcome(entry: &Entry, signature: &Signature, texts: Texts<'_>) -> Vec<Diagnostic> {
    let mut findings = Vec::new();
    if !signature.returns_u32 {
        let outcomes: Vec<String> = texts.outcomes.iter().map(|name| name.to_uppercase()).collect();
        let message = format!("stage function `{}` must return an outcome, a `u32`", entry.name);
        findings.push(
            Diagnostic::error("K0215", message)
                .at(entry.span, "should end in `-> u32`")
                .help(format!("return one of {}", outcomes.join(", "))),
        );
    }
    findings
}

pub(super) fn check_returns_key(
    function: &Spanned<String>,
    entry: &Entry,
    signature: &Signature,
) -> Option<Diagnostic> {
    let returned = Diagnostic::error("K0215", format!("key function `{}` must return a `u32`", entry.name))
        .at(entry.span, "should end in `-> u32`")
        .also(function.span, "wired here")
        .help("return the number of a bin: paths with equal numbers come together");
    (!signature.returns_u32).then_some(returned)
}

/// K0230: a key may be computed as often as the schedule likes, or never.
pub(super) fn check_key(function: &Spanned<String>, analysed: &Analysed) -> Result<(), Vec<Diagnostic>> {
    let facts = &analysed.facts;
    let written = facts.writes.iter().chain(&facts.maybe).next();
    let (place, what) = match written {
        Some((leaf, place)) => (*place, format!("writes `{leaf}`")),
        None if !facts.pushes.is_empty() => (analysed.entry.span, "pushes to a stream".to_owned()),
        None if analysed.counts => (analysed.entry.span, "counts in a tally".to_owned()),
        None if facts.globals.contains("film") => (analysed.entry.span, "adds to the film".to_owned()),
        None => return Ok(()),
    };
    Err(vec![
        Diagnostic::error("K0230", format!("key function `{}` does more than compute a key", analysed.entry.name))
            .at(place, what)
            .also(function.span, "wired here")
            .help("only read: whether a queue is sorted must not change the image"),
    ])
}

fn no_instance(variant: &Variant, name: &str, stage: &Stage, param: &str, bound: &str, place: Span) -> Diagnostic {
    let names = || variant.pipeline.state.keys().map(String::as_str);
    let help = match nearest(bound, names()) {
        Some(near) => format!("add `with.{param} = \"{near}\"`"),
        None => format!("add `with.{param} = ..` with one of {}", names().collect::<Vec<_>>().join(", ")),
    };
    Diagnostic::error("K0206", format!("parameter `{param}` of stage `{name}` is no instance"))
        .at(place, format!("`{bound}` is not in [state]"))
        .also(stage.span, "wired here")
        .help(help)
}

pub(super) fn check_consumer_signature(
    name: &str,
    stream: &Stream,
    entry: &Entry,
    signature: &Signature,
) -> Vec<Diagnostic> {
    let record = &stream.record.value;
    let mut findings = Vec::new();
    match signature.params.as_slice() {
        [(_, Some(taken))] if taken == record => {}
        [(_, Some(taken))] => {
            let message =
                format!("the consumer of stream `{name}` takes a `{taken}`, but the stream carries `{record}`");
            findings.push(
                Diagnostic::error("K0207", message)
                    .at(entry.span, format!("its parameter should be `ptr<function, {record}>`"))
                    .also(stream.record.span, "the stream's record"),
            );
        }
        _ => {
            let message = format!("the consumer of stream `{name}` must take one record");
            findings.push(
                Diagnostic::error("K0221", message)
                    .at(entry.span, format!("its parameter should be `ptr<function, {record}>`, its only one"))
                    .also(stream.consumer.span, "wired here"),
            );
        }
    }
    if !signature.returns_nothing {
        let message = format!("the consumer of stream `{name}` must return nothing");
        findings.push(
            Diagnostic::error("K0215", message)
                .at(entry.span, "nothing takes what it returns")
                .also(stream.consumer.span, "wired here"),
        );
    }
    findings
}

/// A consumer must do the same whether it runs on the spot or when its stream is emptied.
pub(super) fn check_consumer(name: &str, stream: &Stream, analysed: &Analysed) -> Result<(), Vec<Diagnostic>> {
    let mut findings = Vec::new();
    if analysed.facts.globals.contains("path_id") {
        findings.push(
            Diagnostic::error("K0211", format!("the consumer of stream `{name}` asks for its path"))
                .at(analysed.entry.span, "uses `path_id`, `path_pixel` or `path_sample`")
                .also(stream.span, "a batched stream has left its path behind")
                .help(format!("carry the value in a field of `{}`", stream.record.value)),
        );
    }
    if let Some(pushed) = analysed.facts.pushes.keys().next() {
        findings.push(
            Diagnostic::error("K0212", format!("the consumer of stream `{name}` pushes to `{pushed}`"))
                .at(analysed.entry.span, "a consumer cannot push")
                .help("push from a stage"),
        );
    }
    if findings.is_empty() { Ok(()) } else { Err(findings) }
}
