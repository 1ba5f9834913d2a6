//! Collects what a stage does: the diagnosis around the walk over its IR.

use super::constant::{Scalar, Values};
use super::place::Leaves;
use super::walk::{Argument, Exit, Walk};
use super::{Leaf, StageFacts, place_of};
use crate::diagnostic::Diagnostic;
use crate::link::Linked;
use crate::source::Span;
use naga::{AddressSpace, Function, Handle, Module, Type, TypeInner};
use std::collections::{BTreeMap, BTreeSet};

/// What the stage function of this name does.
///
/// `bind` says which instance a parameter stands for; `outcomes` names the values that may be returned (zero is `end`);
/// without it the function is free in what it returns.
///
/// # Errors
/// K0208 when there is no such function, K0320 for a returned value that is no named outcome, K0322 for a parameter that is no pointer
/// to a record or stands for no instance.
pub fn stage_facts(
    module: &Module,
    linked: &Linked,
    function: &str,
    bind: &dyn Fn(&str) -> Option<String>,
    outcomes: Option<&BTreeMap<u32, String>>,
) -> Result<StageFacts, Vec<Diagnostic>> {
    let found = module.functions.iter().find(|(_, candidate)| candidate.name.as_deref() == Some(function));
    let Some((handle, stage)) = found else {
        return Err(vec![Diagnostic::error("K0208", format!("there is no stage function `{function}`"))]);
    };
    let place = place_of(module.functions.get_span(handle), linked);
    let (leaves, params) = records(module, stage, function, place, bind)?;
    let mut walk = Walk::new(module, linked, leaves);
    let arguments = (0..stage.arguments.len()).map(Argument::record).collect();
    let end = walk.stage(handle, arguments);
    let (returned, written_by_outcome) = match (&stage.result, outcomes) {
        (Some(_), Some(outcomes)) => (
            named_outcomes(&end.exits, linked, function, outcomes)?,
            written_by_outcome(&end.exits, &walk.leaves, outcomes),
        ),
        _ => Default::default(),
    };
    let copies = end.copies.iter().map(|(to, from)| (walk.leaves.get(*to).clone(), walk.leaves.get(*from).clone()));
    let only_copied = only_copied(&walk, &end.copies);
    let leaf = |(index, span): (&usize, &Span)| (walk.leaves.get(*index).clone(), *span);
    let written: BTreeMap<Leaf, Span> = walk.stored.iter().map(leaf).collect();
    let is_sure = |leaf: &Leaf| end.written.iter().any(|index| walk.leaves.get(*index) == leaf);
    let (writes, maybe) = written.into_iter().partition(|(leaf, _)| is_sure(leaf));
    Ok(StageFacts {
        reads: walk.read.iter().map(leaf).collect(),
        writes,
        maybe,
        copies: copies.collect(),
        only_copied,
        outcomes: returned,
        written_by_outcome,
        pushes: end.pushes,
        params,
        globals: walk.globals,
    })
}

/// The leaves of a stage's parameters, and their names with the records'.
type Records = (Leaves, Vec<(String, String)>);

fn records(
    module: &Module,
    stage: &Function,
    function: &str,
    place: Span,
    bind: &dyn Fn(&str) -> Option<String>,
) -> Result<Records, Vec<Diagnostic>> {
    let mut leaves = Leaves::default();
    let mut params = Vec::new();
    let mut diagnostics = Vec::new();
    for argument in &stage.arguments {
        let name = argument.name.clone().unwrap_or_default();
        match (record_of(module, argument.ty), bind(&name)) {
            (None, _) => diagnostics.push(
                Diagnostic::error(
                    "K0322",
                    format!("parameter `{name}` of stage `{function}` is no pointer to a record"),
                )
                .at(place, "this stage")
                .help(format!("write `{name}: ptr<function, Record>`")),
            ),
            (_, None) => diagnostics.push(
                Diagnostic::error("K0322", format!("parameter `{name}` of stage `{function}` stands for no instance"))
                    .at(place, "this stage")
                    .help(format!(
                        "name an instance `{name}` in [state], or say which one is meant: with.{name} = \"instance\""
                    )),
            ),
            (Some(record), Some(instance)) => {
                leaves.add_record(module, record, &instance);
                params.push((name, module.types[record].name.clone().unwrap_or_default()));
            }
        }
    }
    if diagnostics.is_empty() { Ok((leaves, params)) } else { Err(diagnostics) }
}

fn record_of(module: &Module, ty: Handle<Type>) -> Option<Handle<Type>> {
    match module.types[ty].inner {
        TypeInner::Pointer { base, space: AddressSpace::Function } => {
            matches!(module.types[base].inner, TypeInner::Struct { .. }).then_some(base)
        }
        _ => None,
    }
}

/// Sources of copies whose every load is stored to leaves that hold the copy at the end and that no load reads.
fn only_copied(walk: &Walk<'_>, copies: &BTreeMap<usize, usize>) -> BTreeSet<Leaf> {
    let is_read = |leaf: &usize| walk.used.contains(leaf) || walk.copied.iter().any(|(from, _)| from == leaf);
    let is_only_copied = |source: &&usize| {
        let mut copied = walk.copied.iter().filter(|(from, _)| from == *source);
        !walk.used.contains(*source) && copied.all(|(_, to)| copies.get(to) == Some(*source) && !is_read(to))
    };
    copies.values().filter(is_only_copied).map(|source| walk.leaves.get(*source).clone()).collect()
}

/// What is written at every return that may return an outcome.
fn written_by_outcome(
    exits: &[Exit],
    leaves: &Leaves,
    names: &BTreeMap<u32, String>,
) -> BTreeMap<String, BTreeSet<Leaf>> {
    let mut written: BTreeMap<String, BTreeSet<Leaf>> = BTreeMap::new();
    for exit in exits {
        let Values::Known(values) = &exit.values else { continue };
        let here: BTreeSet<Leaf> = exit.written.iter().map(|&index| leaves.get(index).clone()).collect();
        for name in values.iter().filter_map(|value| name_of(*value, names)) {
            written.entry(name).or_insert_with(|| here.clone()).retain(|leaf| here.contains(leaf));
        }
    }
    written
}

fn named_outcomes(
    exits: &[Exit],
    linked: &Linked,
    function: &str,
    names: &BTreeMap<u32, String>,
) -> Result<BTreeMap<String, Span>, Vec<Diagnostic>> {
    let mut outcomes = BTreeMap::new();
    let mut diagnostics = Vec::new();
    for Exit { span, values, .. } in exits {
        let place = place_of(*span, linked);
        let Values::Known(values) = values else {
            diagnostics.push(no_outcome(function, "something that is computed".into(), place));
            continue;
        };
        for value in values {
            match name_of(*value, names) {
                Some(name) => {
                    outcomes.entry(name).or_insert(place);
                }
                None => diagnostics.push(no_outcome(function, value.to_string(), place)),
            }
        }
    }
    if diagnostics.is_empty() { Ok(outcomes) } else { Err(diagnostics) }
}

fn name_of(value: Scalar, names: &BTreeMap<u32, String>) -> Option<String> {
    match value {
        Scalar::U32(value) if names.contains_key(&value) => names.get(&value).cloned(),
        Scalar::U32(0) => Some("end".to_string()),
        _ => None,
    }
}

fn no_outcome(function: &str, what: String, place: Span) -> Diagnostic {
    Diagnostic::error("K0320", format!("stage `{function}` returns {what}, not a named outcome"))
        .at(place, "returned here")
        .help("return constants imported from package::outcome, `select` of two, or a variable that only they are assigned to")
}
