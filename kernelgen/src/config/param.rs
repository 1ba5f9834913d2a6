//! `[params]`: constants of every kernel.

use super::model::{Param, ParamValue};
use super::name;
use super::section::{Findings, Item, Section};
use super::suggest;
use crate::diagnostic::Diagnostic;
use indexmap::IndexMap;
use std::ops::RangeInclusive;

const TYPES: [&str; 4] = ["u32", "real", "bool", "choice"];

/// All parameters. One that is refused stands in as 1, so that its uses are not refused as well.
pub fn read(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Param> {
    let items = top.entries("params", findings);
    let declared: Vec<&str> = items.iter().filter(|item| is_declared(item)).map(|item| item.name).collect();
    let mut params = IndexMap::new();
    for item in &items {
        name::check("parameter", item, findings);
        let Some(section) = item.section(findings) else { continue };
        section.allow(&["type", "value", "of", "min", "max", "doc"], findings);
        let value = if is_declared(item) {
            value(item.name, &section, findings)
        } else {
            findings.push(undeclared(item, &declared));
            None
        };
        let doc = section.get("doc").and_then(|doc| doc.text(findings)).map(|doc| doc.value);
        let param = Param { span: item.key, value: value.unwrap_or(ParamValue::U32(1)), doc: doc.unwrap_or_default() };
        params.insert(item.name.to_owned(), param);
    }
    check_constants(&items, &params, findings);
    params
}

fn is_declared(item: &Item<'_>) -> bool {
    matches!(&item.node.data, super::tree::Data::Table(table) if table.contains_key("type"))
}

fn undeclared(item: &Item<'_>, declared: &[&str]) -> Diagnostic {
    let others = declared.iter().copied();
    Diagnostic::error("K0113", format!("there is no parameter `{}` to give a value to", item.name))
        .at(item.key, "no `type` here, nor in what this extends")
        .help(suggest::help(item.name, "parameters", others))
        .help(format!("a new parameter is `{} = {{ type = \"u32\", value = 5 }}`", item.name))
}

fn value<'a>(name: &'a str, section: &Section<'a>, findings: &mut Findings) -> Option<ParamValue> {
    let kind = section.get("type")?.word(&TYPES, findings);
    let item = section.require("value", "every parameter has a value: `value = ..`", findings);
    // To its readers the value is the parameter.
    let item = item.map(|item| Item { path: section.path.clone(), name, ..item });
    let kind = TYPES[kind?];
    refuse_stray(kind, section, findings);
    match kind {
        "u32" => {
            let range = integers(section, findings)?;
            Some(ParamValue::U32(item?.integer(range, findings)?))
        }
        "real" => {
            let range = numbers(section, findings)?;
            Some(ParamValue::Real(item?.real_within(range, findings)?))
        }
        "bool" => Some(ParamValue::Bool(item?.boolean(findings)?)),
        _ => choice(section, item?, findings),
    }
}

/// K0102 for keys that say nothing about parameters of this type.
fn refuse_stray(kind: &str, section: &Section<'_>, findings: &mut Findings) {
    let is_number = ["u32", "real"].contains(&kind);
    let choice = (kind == "choice", "only a choice has words to choose from", "`type = \"choice\"`");
    let number = (is_number, "only a number has a range", "`type = \"u32\"` or `type = \"real\"`");
    for (key, (fits, why, instead)) in [("of", choice), ("min", number), ("max", number)] {
        if let Some(stray) = section.get(key).filter(|_| !fits) {
            let unknown = Diagnostic::error("K0102", format!("unknown key `{}`", stray.path))
                .at(stray.key, why)
                .help(format!("take it away, or write {instead}"));
            findings.push(unknown);
        }
    }
}

/// What a whole number may be: from `min` to `max`.
fn integers(section: &Section<'_>, findings: &mut Findings) -> Option<RangeInclusive<u32>> {
    let mut end = |key, default| section.get(key).map_or(Some(default), |end| end.integer(0..=u32::MAX, findings));
    let range = end("min", 0)?..=end("max", u32::MAX)?;
    not_empty(range, section, findings)
}

/// What a real number may be: from `min` to `max`, and never beyond f32.
fn numbers(section: &Section<'_>, findings: &mut Findings) -> Option<RangeInclusive<f64>> {
    let all = f64::from(f32::MIN)..=f64::from(f32::MAX);
    let mut end = |key, default| section.get(key).map_or(Some(default), |end| end.real_within(all.clone(), findings));
    let range = end("min", *all.start())?..=end("max", *all.end())?;
    not_empty(range, section, findings)
}

/// The range, or K0107 where its ends are the wrong way round.
fn not_empty<T: PartialOrd>(
    range: RangeInclusive<T>,
    section: &Section<'_>,
    findings: &mut Findings,
) -> Option<RangeInclusive<T>> {
    if !range.is_empty() {
        return Some(range);
    }
    let min = section.get("min")?;
    let empty = Diagnostic::error("K0107", format!("`{}` is out of range", min.path))
        .at(min.node.span, "larger than `max`")
        .help("write the smaller end as `min`, the larger as `max`");
    findings.push(empty);
    None
}

fn choice(section: &Section<'_>, item: Item<'_>, findings: &mut Findings) -> Option<ParamValue> {
    let of = section.require("of", "the words to choose from: `of = [\"balance\", \"power\"]`", findings)?;
    let words = of.texts(findings)?;
    for word in &words {
        name::check_part("choice", &word.value, word.span, findings);
    }
    let of: Vec<String> = words.into_iter().map(|word| word.value).collect();
    let index = item.word(&of, findings)?;
    Some(ParamValue::Choice { of, index: index as u32 })
}

/// K0115 for a parameter that has the name of the constant of a choice: `heuristic_power`.
fn check_constants(items: &[Item<'_>], params: &IndexMap<String, Param>, findings: &mut Findings) {
    for (name, param) in params {
        let ParamValue::Choice { of, .. } = &param.value else { continue };
        for word in of {
            let constant = format!("{name}_{word}");
            if let Some(other) = items.iter().find(|item| item.name == constant) {
                let twice = Diagnostic::error("K0115", format!("`{constant}` would be declared twice"))
                    .at(other.key, "a parameter of this name")
                    .also(param.span, format!("declares `{constant}` for its choice `{word}`"))
                    .help("give one of them another name");
                findings.push(twice);
            }
        }
    }
}
