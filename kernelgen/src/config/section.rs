//! Typed access to the tree: every wrong type, word or key becomes a diagnostic and reading goes on.

use super::suggest;
use super::tree::{Data, Entry, Node, Table};
use crate::diagnostic::Diagnostic;
use crate::source::{Span, Spanned};
use std::ops::RangeInclusive;

/// What was found so far.
pub type Findings = Vec<Diagnostic>;

/// A table with its dotted name.
pub struct Section<'a> {
    /// `stages.shade`; empty for the root.
    pub path: String,
    /// Where its key stands.
    pub span: Span,
    /// Its entries.
    pub table: &'a Table,
}

/// An entry or a list element with its dotted name.
pub struct Item<'a> {
    /// `stages.shade.entry`.
    pub path: String,
    /// The last part of the path.
    pub name: &'a str,
    /// Where its key stands.
    pub key: Span,
    /// Its value.
    pub node: &'a Node,
}

impl<'a> Section<'a> {
    /// The entry of this key.
    pub fn get(&self, key: &str) -> Option<Item<'a>> {
        let (name, entry) = self.table.get_key_value(key)?;
        Some(self.item(name, entry))
    }

    /// The entry of this key; K0112 when it is missing. `help` says what to write.
    pub fn require(&self, key: &str, help: &str, findings: &mut Findings) -> Option<Item<'a>> {
        let item = self.get(key);
        if item.is_none() {
            let missing = Diagnostic::error("K0112", format!("`{}` is missing", join(&self.path, key)))
                .at(self.span, format!("no `{key}` here, nor in what this extends"))
                .help(help);
            findings.push(missing);
        }
        item
    }

    /// All entries in order.
    pub fn items(&self) -> impl Iterator<Item = Item<'a>> + '_ {
        self.table.iter().map(|(name, entry)| self.item(name, entry))
    }

    /// The entries of the table of this key; none when it is missing or not a table (K0106).
    pub fn entries(&self, key: &str, findings: &mut Findings) -> Vec<Item<'a>> {
        let section = self.get(key).and_then(|item| item.section(findings));
        section.map(|section| section.items().collect()).unwrap_or_default()
    }

    /// K0102 for every key that is not one of these.
    pub fn allow(&self, keys: &[&str], findings: &mut Findings) {
        for item in self.items().filter(|item| !keys.contains(&item.name)) {
            let place = if self.path.is_empty() { String::new() } else { format!(" in `{}`", self.path) };
            let unknown = Diagnostic::error("K0102", format!("unknown key `{}`{place}", item.name))
                .at(item.key, "unknown key")
                .help(suggest::help(item.name, "keys here", keys.iter().copied()));
            findings.push(unknown);
        }
    }

    fn item(&self, name: &'a str, entry: &'a Entry) -> Item<'a> {
        Item { path: join(&self.path, name), name, key: entry.key, node: &entry.node }
    }
}

impl<'a> Item<'a> {
    /// Where its value stands.
    pub fn span(&self) -> Span {
        self.node.span
    }

    /// Its value as a string.
    pub fn text(&self, findings: &mut Findings) -> Option<Spanned<String>> {
        match &self.node.data {
            Data::Text(text) => Some(Spanned { value: text.clone(), span: self.node.span }),
            _ => self.mismatch("a string", findings),
        }
    }

    /// Its value as a whole number in a range; K0107 outside of it.
    pub fn integer(&self, range: RangeInclusive<u32>, findings: &mut Findings) -> Option<u32> {
        let Data::Integer(number) = self.node.data else {
            return self.mismatch("an integer", findings);
        };
        let fitting = u32::try_from(number).ok().filter(|number| range.contains(number));
        if fitting.is_none() {
            let outside = Diagnostic::error("K0107", format!("`{}` is out of range", self.path))
                .at(self.node.span, "too small or too large")
                .help(format!("write an integer from {} to {}", range.start(), range.end()));
            findings.push(outside);
        }
        fitting
    }

    /// Its value as a finite number.
    pub fn real(&self, findings: &mut Findings) -> Option<f64> {
        match self.node.data {
            Data::Integer(number) => Some(number as f64),
            Data::Float(number) if number.is_finite() => Some(number),
            _ => self.mismatch("a finite number", findings),
        }
    }

    /// Its value as a number in a range; K0107 outside of it.
    pub fn real_within(&self, range: RangeInclusive<f64>, findings: &mut Findings) -> Option<f64> {
        let number = self.real(findings)?;
        if range.contains(&number) {
            return Some(number);
        }
        let outside = Diagnostic::error("K0107", format!("`{}` is out of range", self.path))
            .at(self.node.span, "too small or too large")
            .help(format!("write a number from {:?} to {:?}", range.start(), range.end()));
        findings.push(outside);
        None
    }

    /// Its value as a truth value.
    pub fn boolean(&self, findings: &mut Findings) -> Option<bool> {
        match self.node.data {
            Data::Bool(truth) => Some(truth),
            _ => self.mismatch("`true` or `false`", findings),
        }
    }

    /// Its value as one of these words, as an index; K0107 for another word.
    pub fn word<S: AsRef<str>>(&self, words: &[S], findings: &mut Findings) -> Option<usize> {
        let text = self.text(findings)?;
        let index = words.iter().position(|word| word.as_ref() == text.value);
        if index.is_none() {
            findings.push(self.unknown_word(&text, words.iter().map(AsRef::as_ref)));
        }
        index
    }

    /// K0107: a word that is not among the legal ones.
    pub fn unknown_word<'w>(&self, text: &Spanned<String>, words: impl IntoIterator<Item = &'w str>) -> Diagnostic {
        let words: Vec<&str> = words.into_iter().collect();
        let unknown = Diagnostic::error("K0107", format!("`{}` cannot be `{}`", self.path, text.value))
            .at(text.span, "not a legal value");
        let unknown = match suggest::nearest(&text.value, words.iter().copied()) {
            Some(near) => unknown.help(format!("did you mean `{near}`?")),
            None => unknown,
        };
        let can_be = if words.len() == 1 { "can only be" } else { "is one of" };
        unknown.help(format!("`{}` {can_be} {}", self.name, suggest::quoted(words)))
    }

    /// Its value as a table.
    pub fn section(&self, findings: &mut Findings) -> Option<Section<'a>> {
        match &self.node.data {
            Data::Table(table) => Some(Section { path: self.path.clone(), span: self.key, table }),
            _ => self.mismatch("a table", findings),
        }
    }

    /// Its value as a list.
    pub fn list(&self, findings: &mut Findings) -> Option<Vec<Item<'a>>> {
        let Data::List(nodes) = &self.node.data else {
            return self.mismatch("a list", findings);
        };
        let element = |(index, node): (usize, &'a Node)| Item {
            path: format!("{}[{index}]", self.path),
            name: self.name,
            key: node.span,
            node,
        };
        Some(nodes.iter().enumerate().map(element).collect())
    }

    /// Its value as a list of strings; elements of another type are left out with K0106.
    pub fn texts(&self, findings: &mut Findings) -> Option<Vec<Spanned<String>>> {
        let items = self.list(findings)?;
        Some(items.iter().filter_map(|item| item.text(findings)).collect())
    }

    fn mismatch<T>(&self, wanted: &str, findings: &mut Findings) -> Option<T> {
        let found = self.node.data.describe();
        let span = if matches!(self.node.data, Data::Table(_)) { self.key } else { self.node.span };
        let mismatch = Diagnostic::error("K0106", format!("`{}` must be {wanted}", self.path))
            .at(span, format!("this is {found}"))
            .help(format!("write {wanted} here"));
        findings.push(mismatch);
        None
    }
}

/// Adds a part to a dotted path.
pub fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}
