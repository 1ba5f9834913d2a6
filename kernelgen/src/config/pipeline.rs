//! The pipeline axis: records, instances, streams, tallies, layers, stages.

use super::merge::AxisFile;
use super::model::{Field, Inner, Layers, Param, Pipeline, RayKind, Record, Stage, Stream, Tally};
use super::quantity::Quantity;
use super::section::{Findings, Item, Section};
use super::{expression, name, param, suggest};
use crate::diagnostic::Diagnostic;
use crate::source::{Span, Spanned};
use indexmap::IndexMap;

/// Parameters by name.
type Params = IndexMap<String, Param>;

/// The pipeline as far as it can be read; what is refused is in `findings`, and something stands in for it.
pub fn read(file: &AxisFile, top: &Section<'_>, findings: &mut Findings) -> Pipeline {
    let start_help = "name the stage that every path begins with: `start = \"emit_eye\"`; a file of shared parts, \
                      as `base.toml`, can be extended but not chosen";
    let rounds_help = "bound the rounds: `rounds = \"max_edges\"`";
    let params = param::read(top, findings);
    Pipeline {
        name: file.name.clone(),
        doc: file.doc.clone(),
        start: required_text(top, "start", start_help, findings),
        rounds: required_text(top, "rounds", rounds_help, findings),
        inner: inner(top, findings),
        records: records(top, &params, findings),
        keys: top.get("keys").and_then(|keys| keys.texts(findings)).unwrap_or_default(),
        params,
        state: state(top, findings),
        streams: streams(top, findings),
        tallies: tallies(top, findings),
        layers: layers(top, findings),
        stored: stored(top, findings),
        stages: stages(top, findings),
    }
}

/// A string; when it is missing or none, an empty one at an empty place.
fn required_text(section: &Section<'_>, key: &str, help: &str, findings: &mut Findings) -> Spanned<String> {
    let item = section.require(key, help, findings);
    let nowhere = Span { end: section.span.start, ..section.span };
    item.and_then(|item| item.text(findings)).unwrap_or(Spanned { value: String::new(), span: nowhere })
}

/// The loop inside the rounds; nothing when a part is missing or refused.
fn inner(top: &Section<'_>, findings: &mut Findings) -> Option<Inner> {
    let section = top.get("inner")?.section(findings)?;
    section.allow(&["stage", "turns", "rounds"], findings);
    let mut text = |key: &str, help: &str| section.require(key, help, findings)?.text(findings);
    Some(Inner {
        stage: text("stage", "name the stage that it begins with: `stage = \"trace_eye\"`")?,
        turns: text("turns", "bound its turns in a round: `turns = \"max_edges - round\"`")?,
        rounds: text("rounds", "bound the rounds that remain: `rounds = \"max_edges\"`")?,
    })
}

fn stored(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Spanned<String>> {
    let mut stored = IndexMap::new();
    for item in top.entries("stored", findings) {
        name::check("stored value", &item, findings);
        if let Some(field) = item.text(findings) {
            stored.insert(item.name.to_owned(), field);
        }
    }
    stored
}

fn records(top: &Section<'_>, params: &Params, findings: &mut Findings) -> IndexMap<String, Record> {
    let mut records = IndexMap::new();
    for item in top.entries("records", findings) {
        name::check("record", &item, findings);
        let fields = item.section(findings).map(|section| fields(&section, params, findings)).unwrap_or_default();
        records.insert(item.name.to_owned(), Record { span: item.key, fields });
    }
    records
}

fn fields(section: &Section<'_>, params: &Params, findings: &mut Findings) -> IndexMap<String, Field> {
    let mut fields = IndexMap::new();
    for item in section.items() {
        name::check_part("field", item.name, item.key, findings);
        let quantity = quantity(&item, params, findings).unwrap_or(Quantity::Index);
        fields.insert(item.name.to_owned(), Field { span: item.key, quantity });
    }
    fields
}

/// `"position"`, `{ quantity = "counter", bits = 8 }`, or `max = "max_edges"` in the place of `bits`.
fn quantity(item: &Item<'_>, params: &Params, findings: &mut Findings) -> Option<Quantity> {
    if !matches!(item.node.data, super::tree::Data::Table(_)) {
        return plain_quantity(item, findings);
    }
    let section = item.section(findings)?;
    let word = section.require("quantity", "say what the field is: `quantity = \"counter\"`", findings)?;
    let word_text = word.text(findings)?;
    match word_text.value.as_str() {
        "counter" => {
            section.allow(&["quantity", "bits", "max"], findings);
            counter(&section, params, findings)
        }
        "flags" => {
            section.allow(&["quantity", "names"], findings);
            flags(&section, findings)
        }
        _ => {
            section.allow(&["quantity"], findings);
            plain_quantity(&word, findings)
        }
    }
}

/// A width in bits, or the largest number as an expression over parameters.
fn counter(section: &Section<'_>, params: &Params, findings: &mut Findings) -> Option<Quantity> {
    let Some(max) = section.get("max") else {
        let help = "give its width, `bits = 8`, or its largest number, `max = \"max_edges\"`";
        let bits = section.require("bits", help, findings)?.integer(1..=32, findings)?;
        return Some(Quantity::Counter { bits });
    };
    match expression::evaluate_max(params, &max.text(findings)?) {
        Ok(largest) => Some(Quantity::Counter { bits: u32::BITS - largest.leading_zeros() }),
        Err(diagnostic) => {
            findings.push(diagnostic);
            None
        }
    }
}

fn plain_quantity(item: &Item<'_>, findings: &mut Findings) -> Option<Quantity> {
    let text = item.text(findings)?;
    Some(match text.value.as_str() {
        "position" => Quantity::Position,
        "unit_vector" => Quantity::UnitVector,
        "spectrum" => Quantity::Spectrum,
        "pdf" => Quantity::Pdf,
        "mis_partial" => Quantity::MisPartial,
        "length" => Quantity::Length,
        "weight" => Quantity::Weight,
        "uv" => Quantity::Uv,
        "hit" => Quantity::Hit,
        "index" => Quantity::Index,
        "counter" => return incomplete(item, "{ quantity = \"counter\", bits = 8 }", findings),
        "flags" => return incomplete(item, "{ quantity = \"flags\", names = [\"specular\"] }", findings),
        _ => {
            findings.push(unknown_quantity(&text));
            return None;
        }
    })
}

fn unknown_quantity(text: &Spanned<String>) -> Diagnostic {
    let unknown =
        Diagnostic::error("K0107", format!("there is no quantity `{}`", text.value)).at(text.span, "no such quantity");
    let unknown = match suggest::nearest(&text.value, Quantity::NAMES) {
        Some(near) => unknown.help(format!("did you mean `{near}`?")),
        None => unknown,
    };
    unknown.help(format!("the quantities are {}", suggest::quoted(Quantity::NAMES)))
}

fn incomplete(item: &Item<'_>, form: &str, findings: &mut Findings) -> Option<Quantity> {
    let incomplete = Diagnostic::error("K0112", format!("`{}` needs a width", item.path))
        .at(item.span(), "says nothing about its bits")
        .help(format!("write `{} = {form}`", item.name));
    findings.push(incomplete);
    None
}

fn flags(section: &Section<'_>, findings: &mut Findings) -> Option<Quantity> {
    let item = section.require("names", "name the bits: `names = [\"specular\"]`", findings)?;
    let words = item.texts(findings)?;
    if words.is_empty() || words.len() > 32 {
        let count = Diagnostic::error("K0107", format!("`{}` has {} names", section.path, words.len()))
            .at(item.span(), "one bit each")
            .help("a field of flags has 1 to 32 names");
        findings.push(count);
    }
    for (index, word) in words.iter().enumerate() {
        name::check_part("flag", &word.value, word.span, findings);
        if let Some(first) = words[..index].iter().find(|other| other.value == word.value) {
            let twice = Diagnostic::error("K0115", format!("flag `{}` is named twice", word.value))
                .at(word.span, "again here")
                .also(first.span, "first here")
                .help("every flag has one bit: take one of them away");
            findings.push(twice);
        }
    }
    Some(Quantity::Flags { names: words.into_iter().map(|word| word.value).collect() })
}

fn state(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Spanned<String>> {
    let mut state = IndexMap::new();
    for item in top.entries("state", findings) {
        name::check("instance", &item, findings);
        if let Some(record) = item.text(findings) {
            state.insert(item.name.to_owned(), record);
        }
    }
    state
}

fn streams(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Stream> {
    let mut streams = IndexMap::new();
    for item in top.entries("streams", findings) {
        name::check("stream", &item, findings);
        let Some(section) = item.section(findings) else { continue };
        section.allow(&["record", "consumer", "rays"], findings);
        let record = required_text(&section, "record", "name what is pushed: `record = \"Connection\"`", findings);
        let consumer_help = "name the function that takes it: `consumer = \"resolve\"`";
        let consumer = required_text(&section, "consumer", consumer_help, findings);
        let stream = Stream { span: item.key, record, consumer, rays: rays(&section, findings) };
        streams.insert(item.name.to_owned(), stream);
    }
    streams
}

fn tallies(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Tally> {
    let mut tallies = IndexMap::new();
    for item in top.entries("tallies", findings) {
        name::check("tally", &item, findings);
        let Some(section) = item.section(findings) else { continue };
        section.allow(&["size", "doc"], findings);
        let size = required_text(&section, "size", SIZE_HELP, findings);
        tallies.insert(item.name.to_owned(), Tally { span: item.key, size, doc: doc(&section, findings) });
    }
    tallies
}

fn layers(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Layers> {
    let mut layers = IndexMap::new();
    for item in top.entries("layers", findings) {
        name::check("group of layers", &item, findings);
        let Some(section) = item.section(findings) else { continue };
        section.allow(&["size", "correct", "doc"], findings);
        let size = required_text(&section, "size", SIZE_HELP, findings);
        let correct = section.get("correct").and_then(|correct| correct.text(findings));
        layers.insert(item.name.to_owned(), Layers { span: item.key, size, correct, doc: doc(&section, findings) });
    }
    layers
}

const SIZE_HELP: &str = "say how many indices there are: `size = \"max_edges + 1\"`";

fn doc(section: &Section<'_>, findings: &mut Findings) -> String {
    let text = section.get("doc").and_then(|doc| doc.text(findings));
    text.map(|doc| doc.value).unwrap_or_default()
}

fn stages(top: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Stage> {
    let mut stages = IndexMap::new();
    for item in top.entries("stages", findings) {
        name::check("stage", &item, findings);
        let Some(section) = item.section(findings) else { continue };
        section.allow(&["entry", "with", "on", "rays", "sort", "before"], findings);
        let own_name = Spanned { value: item.name.to_owned(), span: item.key };
        let entry = section.get("entry").and_then(|entry| entry.text(findings));
        let stage = Stage {
            span: item.key,
            entry: entry.unwrap_or(own_name),
            with: names(&section, "with", "function parameter", findings),
            on: outcomes(&section, findings),
            rays: rays(&section, findings),
            sort: names(&section, "sort", "key", findings),
            before: section.get("before").and_then(|before| before.text(findings)),
        };
        stages.insert(item.name.to_owned(), stage);
    }
    in_order(stages)
}

/// The stages in the order in which they run: as they are listed, but those with `before` directly before the stage that it names. What
/// cannot be so stays where it is.
fn in_order(mut stages: IndexMap<String, Stage>) -> IndexMap<String, Stage> {
    let moved = stages.iter().filter_map(|(name, stage)| Some((name.clone(), stage.before.as_ref()?.value.clone())));
    let moved: Vec<(String, String)> = moved.collect();
    for (name, before) in moved {
        let (Some(from), Some(target)) = (stages.get_index_of(&name), stages.get_index_of(&before)) else { continue };
        stages.move_index(from, if from < target { target - 1 } else { target });
    }
    stages
}

fn outcomes(section: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Spanned<String>> {
    for item in section.entries("on", &mut Findings::new()) {
        let lower = item.name.to_lowercase();
        if item.name == "end" {
            let end = Diagnostic::error("K0216", format!("`{}` cannot lead anywhere", item.path))
                .at(item.key, "END is what a stage returns when the path is over")
                .help("take it away, or return another outcome from the stage");
            findings.push(end);
        } else if lower != item.name {
            let case = Diagnostic::error("K0114", format!("outcome `{}` is not in lower case", item.name))
                .at(item.key, "outcomes are upper case in WGSL alone")
                .help(format!("write `on.{lower}`"));
            findings.push(case);
        }
    }
    names(section, "on", "outcome", findings)
}

/// A table of names to names.
fn names(section: &Section<'_>, key: &str, what: &str, findings: &mut Findings) -> IndexMap<String, Spanned<String>> {
    let mut names = IndexMap::new();
    for item in section.entries(key, findings) {
        name::check_part(what, item.name, item.key, findings);
        if let Some(text) = item.text(findings) {
            names.insert(item.name.to_owned(), text);
        }
    }
    names
}

fn rays(section: &Section<'_>, findings: &mut Findings) -> Option<RayKind> {
    let index = section.get("rays")?.word(&["walk", "visibility"], findings)?;
    Some([RayKind::Walk, RayKind::Visibility][index])
}
