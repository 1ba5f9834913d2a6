//! One axis file and the files it extends, as one table.

use super::section::Findings;
use super::suggest;
use super::tree::{self, Data, Entry, Table};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, FileKind, Sources, Span, Spanned};

/// An axis: a folder of configs.
pub struct Axis {
    /// What one of its files is: `pipeline`.
    noun: &'static str,
    /// Where they lie: `pipelines`.
    folder: &'static str,
    /// The keys that only its files have.
    keys: &'static [&'static str],
}

/// What is computed.
pub const PIPELINE: Axis = Axis {
    noun: "pipeline",
    folder: "pipelines",
    keys: &[
        "start", "rounds", "inner", "keys", "params", "records", "state", "streams", "tallies", "layers", "stored",
        "stages",
    ],
};
/// Where fields live.
pub const LAYOUT: Axis = Axis { noun: "layout", folder: "layouts", keys: &["layout"] };
/// How stages become kernels.
pub const SCHEDULE: Axis = Axis { noun: "schedule", folder: "schedules", keys: &["schedule"] };
/// In what arithmetic.
pub const PRECISION: Axis = Axis { noun: "precision", folder: "precisions", keys: &["precision"] };

const AXES: [&Axis; 4] = [&PIPELINE, &LAYOUT, &SCHEDULE, &PRECISION];
const SHARED_KEYS: [&str; 4] = ["extends", "name", "doc", "features"];

/// The chosen file of an axis with everything that it extends merged in.
pub struct AxisFile {
    /// `name`, or the name of the file; never inherited.
    pub name: String,
    /// `doc`; never inherited.
    pub doc: String,
    /// The start of the chosen file, for errors about what is missing from it.
    pub origin: Span,
    /// Everything else.
    pub table: Table,
}

/// Reads a file and all that it extends.
///
/// Every file counts once, after the files it extends: of two files that extend the same one, neither takes back what
/// the other overrides. `None` when a file is missing or does not parse.
pub fn read(sources: &mut Sources, axis: &Axis, key: &str, findings: &mut Findings) -> Option<AxisFile> {
    let Some(file) = sources.find(FileKind::Config, key) else {
        findings.push(missing_choice(sources, axis, key));
        return None;
    };
    let mut chain =
        Chain { sources, axis, findings, open: Vec::new(), seen: Vec::new(), layers: Vec::new(), broken: false };
    chain.visit(key, file);
    let Chain { layers, broken, .. } = chain;
    if broken {
        return None;
    }
    let (mut name, mut doc, mut table) = (None, None, Table::new());
    for mut layer in layers {
        (name, doc) = (layer.shift_remove("name"), layer.shift_remove("doc"));
        overlay(&mut table, layer);
    }
    let mut text_of = |key: &str, entry: Option<Entry>| text_entry(key, entry?, findings);
    Some(AxisFile {
        name: text_of("name", name).unwrap_or_else(|| stem(key).to_owned()),
        doc: text_of("doc", doc).unwrap_or_default(),
        origin: Span { file, start: 0, end: 0 },
        table,
    })
}

/// Puts a table over another: tables merge by key, everything else is replaced.
pub fn overlay(base: &mut Table, over: Table) {
    for (key, entry) in over {
        match base.get_mut(&key) {
            Some(Entry { node: below, .. }) => match (&mut below.data, entry.node.data) {
                (Data::Table(below), Data::Table(above)) => overlay(below, above),
                (_, data) => {
                    let node = tree::Node { span: entry.node.span, data };
                    base.insert(key, Entry { key: entry.key, node });
                }
            },
            None => {
                base.insert(key, entry);
            }
        }
    }
}

/// The table under a key, if there is one.
pub fn subtable<'a>(table: &'a Table, key: &str) -> Option<&'a Table> {
    match &table.get(key)?.node.data {
        Data::Table(table) => Some(table),
        _ => None,
    }
}

/// The short form of a parameter, `max_edges = 8`, as the table that it stands for.
pub fn parameter_value(entry: Entry) -> Entry {
    if matches!(entry.node.data, Data::Table(_)) {
        return entry;
    }
    let Entry { key, node } = entry;
    let span = node.span;
    let table = Table::from([("value".to_owned(), Entry { key, node })]);
    Entry { key, node: tree::Node { span, data: Data::Table(table) } }
}

/// The walk over `extends`.
struct Chain<'a> {
    sources: &'a Sources,
    axis: &'a Axis,
    findings: &'a mut Findings,
    /// The files being read, outermost first, each with the place where it extends the next.
    open: Vec<(String, Option<Span>)>,
    /// The files read or being read.
    seen: Vec<FileId>,
    /// What they say, each after those that it extends.
    layers: Vec<Table>,
    broken: bool,
}

impl Chain<'_> {
    fn visit(&mut self, key: &str, file: FileId) {
        let mut table = match tree::parse_file(self.sources, file) {
            Ok(table) => table,
            Err(diagnostic) => return self.break_off(diagnostic),
        };
        self.seen.push(file);
        self.open.push((key.to_owned(), None));
        for base in self.extends(&mut table) {
            self.visit_base(key, &base);
        }
        self.open.pop();
        check_keys(self.axis, &mut table, self.findings);
        expand_parameters(&mut table);
        self.layers.push(table);
    }

    fn visit_base(&mut self, key: &str, base: &Spanned<String>) {
        let base_key = resolve(key, &base.value);
        if let Some(open) = self.open.last_mut() {
            open.1 = Some(base.span);
        }
        if let Some(first) = self.open.iter().position(|(open, _)| *open == base_key) {
            return self.break_off(cycle(&self.open[first..], base));
        }
        match self.sources.find(FileKind::Config, &base_key) {
            None => self.break_off(missing_base(self.sources, &base_key, base)),
            Some(file) if self.seen.contains(&file) => {}
            Some(file) => self.visit(&base_key, file),
        }
    }

    fn break_off(&mut self, diagnostic: Diagnostic) {
        self.findings.push(diagnostic);
        self.broken = true;
    }

    /// Takes `extends` out of a file: a string or a list of strings.
    fn extends(&mut self, table: &mut Table) -> Vec<Spanned<String>> {
        let Some(entry) = table.shift_remove("extends") else {
            return Vec::new();
        };
        let nodes = match entry.node.data {
            Data::List(nodes) => nodes,
            _ => vec![entry.node],
        };
        let mut names = Vec::new();
        for node in nodes {
            match node.data {
                Data::Text(value) => names.push(Spanned { value, span: node.span }),
                other => self.break_off(
                    Diagnostic::error("K0106", "`extends` must be a file or a list of files")
                        .at(node.span, format!("this is {}", other.describe()))
                        .help("write `extends = \"base.toml\"` or `extends = [\"base.toml\", \"more.toml\"]`"),
                ),
            }
        }
        names
    }
}

/// K0102 for the keys that files of this axis do not have; they are taken out.
fn check_keys(axis: &Axis, table: &mut Table, findings: &mut Findings) {
    table.retain(|key, entry| {
        let known = axis.keys.contains(&key.as_str()) || SHARED_KEYS.contains(&key.as_str());
        if !known {
            findings.push(unknown_key(axis, key, entry));
        }
        known
    });
}

fn unknown_key(axis: &Axis, key: &str, entry: &Entry) -> Diagnostic {
    let unknown =
        Diagnostic::error("K0102", format!("unknown key `{key}` in a {} file", axis.noun)).at(entry.key, "unknown key");
    match AXES.iter().find(|other| other.keys.contains(&key)) {
        Some(other) => unknown.help(format!("`{key}` belongs in a {} file, under `{}/`", other.noun, other.folder)),
        None => unknown.help(suggest::help(key, "keys here", axis.keys.iter().copied().chain(SHARED_KEYS))),
    }
}

fn expand_parameters(table: &mut Table) {
    let Some(Entry { node: tree::Node { data: Data::Table(params), .. }, .. }) = table.get_mut("params") else {
        return;
    };
    *params = std::mem::take(params).into_iter().map(|(name, entry)| (name, parameter_value(entry))).collect();
}

fn text_entry(key: &str, entry: Entry, findings: &mut Findings) -> Option<String> {
    match entry.node.data {
        Data::Text(text) => Some(text),
        other => {
            let mismatch = Diagnostic::error("K0106", format!("`{key}` must be a string"))
                .at(entry.node.span, format!("this is {}", other.describe()))
                .help("write a string here");
            findings.push(mismatch);
            None
        }
    }
}

fn cycle(open: &[(String, Option<Span>)], base: &Spanned<String>) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("K0105", "these files extend each other in a circle")
        .at(base.span, "leads back to where it began");
    let earlier = open.split_last().map_or(open, |(_, earlier)| earlier);
    for (key, span) in earlier {
        if let Some(span) = span {
            diagnostic = diagnostic.also(*span, format!("`{key}` extends this"));
        }
    }
    diagnostic.help("take one of these `extends` away")
}

fn missing_base(sources: &Sources, key: &str, base: &Spanned<String>) -> Diagnostic {
    let folder = key.rsplit_once('/').map_or("", |(folder, _)| folder);
    let available = available(sources, folder);
    Diagnostic::error("K0104", format!("`extends` names `{}`, which does not exist", base.value))
        .at(base.span, format!("there is no `{key}`"))
        .help(suggest::help(stem_with_extension(key), "files there", available.iter().map(String::as_str)))
}

/// The choice becomes a text of its own, so that this diagnostic has a place like every other.
fn missing_choice(sources: &mut Sources, axis: &Axis, key: &str) -> Diagnostic {
    let available = available(sources, axis.folder);
    let name = format!("<{}>", axis.noun);
    let file = sources.add(FileKind::Config, name.clone(), name, key);
    let span = Span { file, start: 0, end: key.len() as u32 };
    let (message, label) = if key.is_empty() {
        (format!("no {} was chosen", axis.noun), "nothing here".to_owned())
    } else {
        (format!("there is no {} `{key}`", axis.noun), "no such file".to_owned())
    };
    let names: Vec<&str> = available.iter().map(String::as_str).collect();
    let diagnostic = Diagnostic::error("K0103", message).at(span, label);
    let diagnostic = match suggest::nearest(stem_with_extension(key), names.iter().copied()) {
        Some(near) => diagnostic.help(format!("did you mean `{}/{near}`?", axis.folder)),
        None => diagnostic,
    };
    diagnostic.help(format!("the files under `{}/` are {}", axis.folder, suggest::quoted(names)))
}

/// The files of a folder, sorted, without the folder.
fn available(sources: &Sources, folder: &str) -> Vec<String> {
    let prefix = format!("{folder}/");
    let files = sources.of_kind(FileKind::Config);
    let mut names: Vec<String> =
        files.filter_map(|(_, file)| file.key.strip_prefix(&prefix).map(str::to_owned)).collect();
    names.sort();
    names
}

/// The key of `path` as seen from the file `from`: `base.toml` in `pipelines/nee.toml` is `pipelines/base.toml`.
fn resolve(from: &str, path: &str) -> String {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}

fn stem_with_extension(key: &str) -> &str {
    key.rsplit_once('/').map_or(key, |(_, name)| name)
}

fn stem(key: &str) -> &str {
    let name = stem_with_extension(key);
    name.strip_suffix(".toml").unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::resolve;

    #[test]
    fn paths_are_relative_to_the_extending_file() {
        assert_eq!(resolve("pipelines/nee.toml", "base.toml"), "pipelines/base.toml");
        assert_eq!(resolve("pipelines/nee.toml", "./base.toml"), "pipelines/base.toml");
        assert_eq!(resolve("pipelines/deep/x.toml", "../base.toml"), "pipelines/base.toml");
        assert_eq!(resolve("top.toml", "base.toml"), "base.toml");
    }
}
