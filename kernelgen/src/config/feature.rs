//! Effects pinned on or off: `[features]` in any axis file, or `--set features.sky=true`.

use super::merge;
use super::model::{Effect, Effects};
use super::section::{Findings, Item, Section};
use super::suggest;
use super::tree::{Data, Entry, Table};
use crate::diagnostic::Diagnostic;
use crate::source::Sources;

/// The effects with the pins applied.
pub fn read(sources: &Sources, effects: &Effects, top: &Section<'_>, findings: &mut Findings) -> Effects {
    let mut pinned = effects.clone();
    for item in top.entries("features", findings) {
        match pinned.get_mut(item.name) {
            Some(effect) => pin(sources, effect, &item, findings),
            None => findings.push(unknown(effects, &item)),
        }
    }
    pinned
}

/// K0118 for effects that two axes pin differently: neither axis stands above the other.
pub fn contradictions(root: &Table, axis: &Table, findings: &mut Findings) {
    let (Some(before), Some(now)) = (merge::subtable(root, "features"), merge::subtable(axis, "features")) else {
        return;
    };
    for (name, entry) in now {
        if let Some(other) = before.get(name).filter(|other| truth(other) != truth(entry)) {
            let diagnostic = Diagnostic::error("K0118", format!("`{name}` is pinned both on and off"))
                .at(entry.key, "pinned here")
                .also(other.key, "and the other way here")
                .help("keep one of the two");
            findings.push(diagnostic);
        }
    }
}

fn truth(entry: &Entry) -> Option<bool> {
    match entry.node.data {
        Data::Bool(truth) => Some(truth),
        _ => None,
    }
}

fn pin(sources: &Sources, effect: &mut Effect, item: &Item<'_>, findings: &mut Findings) {
    match item.boolean(findings) {
        Some(true) if !effect.present => {
            effect.present = true;
            effect.reason = format!("pinned on in {}", sources.file(item.key.file).name);
        }
        Some(false) if effect.present => findings.push(denied(effect, item)),
        _ => {}
    }
}

fn denied(effect: &Effect, item: &Item<'_>) -> Diagnostic {
    Diagnostic::error("K0108", format!("`{}` is pinned off, but the scene has it", item.name))
        .at(item.span(), format!("the scene has it: {}", effect.reason))
        .help(format!("take `{}` out of `[features]`, or choose a scene without it", item.name))
}

fn unknown(effects: &Effects, item: &Item<'_>) -> Diagnostic {
    Diagnostic::error("K0109", format!("there is no effect `{}`", item.name))
        .at(item.key, "unknown effect")
        .help(suggest::help(item.name, "effects", effects.keys().map(String::as_str)))
}
