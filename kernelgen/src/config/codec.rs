//! `codecs.toml`: ways to keep a value in fewer bits than it is computed in.

use super::model::Codec;
use super::quantity::Quantity;
use super::section::{Findings, Item, Section};
use super::suggest;
use super::tree::{self, Table};
use crate::diagnostic::Diagnostic;
use crate::source::{FileKind, Sources, Span};
use indexmap::IndexMap;

/// The config key of the file.
const KEY: &str = "codecs.toml";
/// A value has three components at most.
const MOST_PARTS: usize = 3;

/// All codecs by name; none where there is no such file.
pub fn read(sources: &Sources, findings: &mut Findings) -> IndexMap<String, Codec> {
    let Some(file) = sources.find(FileKind::Config, KEY) else { return IndexMap::new() };
    let table = match tree::parse_file(sources, file) {
        Ok(table) => table,
        Err(diagnostic) => {
            findings.push(diagnostic);
            Table::new()
        }
    };
    let section = Section { path: String::new(), span: Span { file, start: 0, end: 0 }, table: &table };
    let mut codecs = IndexMap::new();
    for item in section.items() {
        let Some(section) = item.section(findings) else { continue };
        if let Some(codec) = codec(item.name, &section, findings) {
            codecs.insert(item.name.to_owned(), codec);
        }
    }
    codecs
}

fn codec(name: &str, section: &Section<'_>, findings: &mut Findings) -> Option<Codec> {
    section.allow(&["quantity", "bits", "error", "range", "doc"], findings);
    let quantities = section.require("quantity", "name what it can keep: `quantity = [\"spectrum\"]`", findings);
    let quantities = quantities.and_then(|item| item.texts(findings))?;
    for quantity in &quantities {
        if !Quantity::CODED.contains(&quantity.value.as_str()) {
            let unknown = Diagnostic::error("K0107", format!("no codec keeps a `{}`", quantity.value))
                .at(quantity.span, "not a quantity that can be coded")
                .help(suggest::help(&quantity.value, "quantities with codecs", Quantity::CODED));
            findings.push(unknown);
        }
    }
    let bits = section.require("bits", "give the width of every part: `bits = [16, 16]`", findings)?;
    let parts: Vec<u32> = bits.list(findings)?.iter().filter_map(|part| part.integer(1..=32, findings)).collect();
    if parts.is_empty() || parts.len() > MOST_PARTS {
        let count = Diagnostic::error("K0107", format!("`{}` has {} parts", bits.path, parts.len()))
            .at(bits.span(), "a `u32` for each")
            .help(format!("write 1 to {MOST_PARTS} widths"));
        findings.push(count);
    }
    let error = section.require("error", "declare what is lost: `error = { relative = 1e-3 }`", findings)?;
    let mut errors = IndexMap::new();
    let error = error.section(findings)?;
    error.allow(&["angle", "relative", "of_largest", "absolute"], findings);
    for item in error.items() {
        errors.insert(item.name.to_owned(), item.real(findings)?);
    }
    let range =
        section.require("range", "say what it can keep: `range = [6e-5, 65504]`, of magnitudes but zero", findings)?;
    let range = self::range(&range, findings)?;
    let doc = section.get("doc").and_then(|doc| doc.text(findings)).map(|doc| doc.value).unwrap_or_default();
    let quantities = quantities.into_iter().map(|quantity| quantity.value).collect();
    Some(Codec { name: name.to_owned(), quantities, parts, errors, range, doc, span: section.span })
}

/// Least and greatest magnitude.
fn range(item: &Item<'_>, findings: &mut Findings) -> Option<[f64; 2]> {
    let ends: Vec<f64> = item.list(findings)?.iter().filter_map(|end| end.real(findings)).collect();
    if let [least, greatest] = ends[..]
        && 0.0 <= least
        && least < greatest
    {
        return Some([least, greatest]);
    }
    let refused = Diagnostic::error("K0107", format!("`{}` is no range", item.path))
        .at(item.span(), "not two numbers, the smaller one first")
        .help("write, for example, `range = [6e-5, 65504]`");
    findings.push(refused);
    None
}
