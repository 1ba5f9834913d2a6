//! `--set KEY=VALUE`: one value anywhere in the merged configs.

use super::model::Selection;
use super::section::Findings;
use super::tree::{self, Data, Entry, Node, Table};
use super::{layout, merge, schedule, suggest};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, FileKind, Sources, Span};

/// Tables of the root: a key that begins with one of them is complete.
const ROOTS: [&str; 11] = [
    "params",
    "features",
    "layout",
    "schedule",
    "precision",
    "records",
    "state",
    "streams",
    "tallies",
    "layers",
    "stages",
];

/// Overrides the merged tree with every `--set`, in order. Each becomes a text named `--set` in `sources`.
pub fn apply(sources: &mut Sources, root: &mut Table, selection: &Selection, findings: &mut Findings) {
    for (index, (key, value)) in selection.set.iter().enumerate() {
        let text = format!("{key}={value}");
        let file = sources.add(FileKind::Config, format!("--set {index}"), "--set", text);
        let setting = Setting { key, value, file };
        if let Err(diagnostic) = setting.apply(root, selection) {
            findings.push(diagnostic);
        }
    }
}

/// One `--set`.
struct Setting<'a> {
    key: &'a str,
    value: &'a str,
    file: FileId,
}

impl Setting<'_> {
    fn apply(&self, root: &mut Table, selection: &Selection) -> Result<(), Diagnostic> {
        let path = self.path(root, selection)?;
        let node = self.node()?;
        self.insert(root, &path, node)
    }

    /// The full path of the key: itself when complete, else the only path that ends with it.
    fn path(&self, root: &Table, selection: &Selection) -> Result<Vec<String>, Diagnostic> {
        let wanted: Vec<&str> = self.key.split('.').collect();
        if wanted.len() > 1 && ROOTS.contains(&wanted[0]) && wanted.iter().all(|part| !part.is_empty()) {
            return Ok(wanted.into_iter().map(str::to_owned).collect());
        }
        let settings = settings(root, selection);
        let details = details(root);
        for paths in [&settings, &details] {
            let matching: Vec<&Vec<String>> = paths.iter().filter(|path| ends_with(path, &wanted)).collect();
            match matching.as_slice() {
                [] => {}
                [only] => return Ok((*only).clone()),
                several => return Err(self.ambiguous(several)),
            }
        }
        Err(self.unknown(&settings, &details))
    }

    fn ambiguous(&self, paths: &[&Vec<String>]) -> Diagnostic {
        let names: Vec<String> = paths.iter().map(|path| path.join(".")).collect();
        Diagnostic::error("K0111", format!("`{}` could be any of {} keys", self.key, names.len()))
            .at(self.key_span(), "ambiguous")
            .help(format!("write one of {}", suggest::quoted(names.iter().map(String::as_str))))
    }

    fn unknown(&self, settings: &[Vec<String>], details: &[Vec<String>]) -> Diagnostic {
        let full: Vec<String> = settings.iter().chain(details).map(|path| path.join(".")).collect();
        let short = settings.iter().chain(details).filter_map(|path| path.last());
        let candidates: Vec<&str> = short.chain(&full).map(String::as_str).collect();
        let unknown = Diagnostic::error("K0110", format!("there is nothing named `{}` to set", self.key))
            .at(self.key_span(), "neither a parameter nor a key of an axis");
        match suggest::nearest(self.key, candidates) {
            Some(near) => unknown.help(format!("did you mean `{near}`?")),
            None => {
                let names: Vec<String> = settings.iter().map(|path| path.join(".")).collect();
                let names = suggest::quoted(names.iter().map(String::as_str));
                unknown.help(format!("what can be set: {names}, and every key of the pipeline by its dotted name"))
            }
        }
    }

    /// The value: TOML where it is TOML, else the words as they stand.
    fn node(&self) -> Result<Node, Diagnostic> {
        let offset = self.key.len() + 1;
        let trimmed = self.value.trim_start();
        if trimmed.is_empty() {
            return Err(Diagnostic::error("K0106", format!("`{}` is set to nothing", self.key))
                .at(self.key_span(), "no value follows")
                .help(format!("write `--set {}=VALUE`", self.key)));
        }
        match tree::parse_value(self.value, self.file, offset) {
            Ok(node) if !matches!(node.data, Data::Date) => Ok(node),
            Err(error) if trimmed.starts_with(['[', '{', '"', '\'']) => {
                Err(error
                    .help("a list is `[\"a\", \"b\"]`, a table `{ a = 1 }`; quote the whole argument in the shell"))
            }
            _ => Ok(Node { span: self.span(offset, self.value.len()), data: Data::Text(self.value.to_owned()) }),
        }
    }

    fn insert(&self, root: &mut Table, path: &[String], node: Node) -> Result<(), Diagnostic> {
        let mut tree = self.entry(0, path, node);
        if path[0] == "params" && path.len() == 2 {
            expand(&mut tree);
        }
        self.check_inside(root, path)?;
        merge::overlay(root, Table::from([(path[0].clone(), tree)]));
        Ok(())
    }

    /// Nested tables from part `depth` of the path down to the value.
    fn entry(&self, depth: usize, path: &[String], node: Node) -> Entry {
        let key = self.part_span(depth, path);
        if depth + 1 == path.len() {
            return Entry { key, node };
        }
        let inner = Table::from([(path[depth + 1].clone(), self.entry(depth + 1, path, node))]);
        Entry { key, node: Node { span: key, data: Data::Table(inner) } }
    }

    /// K0110 when the path goes on below a value that is no table.
    fn check_inside(&self, root: &Table, path: &[String]) -> Result<(), Diagnostic> {
        let mut table = root;
        for (depth, part) in path.iter().enumerate().take(path.len() - 1) {
            let Some(entry) = table.get(part) else { return Ok(()) };
            let Data::Table(inner) = &entry.node.data else {
                let below = path[..=depth].join(".");
                return Err(Diagnostic::error("K0110", format!("`{below}` has no keys inside"))
                    .at(self.key_span(), "goes on below it")
                    .also(entry.node.span, format!("this is {}", entry.node.data.describe()))
                    .help(format!("set `{below}` itself")));
            };
            table = inner;
        }
        Ok(())
    }

    /// Where part `depth` of the path was written; the whole key when the path is longer than what was written.
    fn part_span(&self, depth: usize, path: &[String]) -> Span {
        let written: Vec<&str> = self.key.split('.').collect();
        let Some(index) = (depth + written.len()).checked_sub(path.len()) else {
            return self.key_span();
        };
        let start = written[..index].iter().map(|part| part.len() + 1).sum();
        self.span(start, written[index].len())
    }

    fn key_span(&self) -> Span {
        self.span(0, self.key.len())
    }

    fn span(&self, start: usize, length: usize) -> Span {
        Span { file: self.file, start: start as u32, end: (start + length) as u32 }
    }
}

/// Turns the parameters of a tree that begins at `params` into their long form.
fn expand(tree: &mut Entry) {
    if let Data::Table(params) = &mut tree.node.data {
        *params =
            std::mem::take(params).into_iter().map(|(name, entry)| (name, merge::parameter_value(entry))).collect();
    }
}

/// What is meant to be set: parameters, effects, and the keys of layout, schedule and precision.
fn settings(root: &Table, selection: &Selection) -> Vec<Vec<String>> {
    let path = |table: &str, key: &str| vec![table.to_owned(), key.to_owned()];
    let params = merge::subtable(root, "params").into_iter().flat_map(Table::keys).map(|key| path("params", key));
    let effects = selection.effects.keys().map(|key| path("features", key));
    let layout = layout::KEYS.iter().map(|key| path("layout", key));
    let schedule = schedule::KEYS.iter().map(|key| path("schedule", key));
    let precision = schedule::PRECISION_KEYS.iter().map(|key| path("precision", key));
    let top = ["start", "rounds"].map(|key| vec![key.to_owned()]);
    params.chain(effects).chain(layout).chain(schedule).chain(precision).chain(top).collect()
}

/// Every value of the pipeline's tables: what has no short name of the first rank.
fn details(root: &Table) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    for name in ["records", "state", "streams", "stages"] {
        if let Some(table) = merge::subtable(root, name) {
            collect(table, &[name.to_owned()], &mut paths);
        }
    }
    paths
}

fn collect(table: &Table, above: &[String], paths: &mut Vec<Vec<String>>) {
    for (key, entry) in table {
        let path = [above, std::slice::from_ref(key)].concat();
        match &entry.node.data {
            Data::Table(inner) => collect(inner, &path, paths),
            _ => paths.push(path),
        }
    }
}

fn ends_with(path: &[String], wanted: &[&str]) -> bool {
    path.len() >= wanted.len() && path[path.len() - wanted.len()..].iter().zip(wanted).all(|(a, b)| a == b)
}
