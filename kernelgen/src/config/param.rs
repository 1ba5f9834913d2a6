//! `[params]`: constants of every kernel.

use super::model::{Param, ParamValue};
use super::name;
use super::section::{Findings, Item, Section};
use super::suggest;
use crate::diagnostic::Diagnostic;
use indexmap::IndexMap;

const TYPES: [&str; 4] = ["u32", "real", "bool", "choice"];

/// All parameters. One that is refused stands in as 1, so that its uses are not refused as well.
pub fn read(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Param> {
    let items = top.entries("params", findings);
    let declared: Vec<&str> = items.iter().filter(|item| is_declared(item)).map(|item| item.name).collect();
    let mut params = IndexMap::new();
    for item in &items {
        name::check("parameter", item, findings);
        let Some(section) = item.section(findings) else { continue };
        section.allow(&["type", "value", "of", "max", "doc"], findings);
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
    let is_choice = kind == Some(3);
    if let Some(of) = section.get("of").filter(|_| kind.is_some() && !is_choice) {
        let stray = Diagnostic::error("K0102", format!("unknown key `{}`", of.path))
            .at(of.key, "only a choice has words to choose from")
            .help("take it away, or write `type = \"choice\"`");
        findings.push(stray);
    }
    match TYPES[kind?] {
        "u32" => {
            let largest = section.get("max").and_then(|max| max.integer(0..=u32::MAX, findings));
            Some(ParamValue::U32(item?.integer(0..=largest.unwrap_or(u32::MAX), findings)?))
        }
        "real" => Some(ParamValue::Real(item?.real(findings)?)),
        "bool" => Some(ParamValue::Bool(item?.boolean(findings)?)),
        _ => choice(section, item?, findings),
    }
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
