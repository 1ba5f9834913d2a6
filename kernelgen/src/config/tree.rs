//! A TOML text as an owned tree in which every key and value knows where it was written.

use crate::diagnostic::Diagnostic;
use crate::source::{FileId, Sources, Span};
use indexmap::IndexMap;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Entries by key, in the order of the text.
pub type Table = IndexMap<String, Entry>;

/// A key and its value.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Where the key stands.
    pub key: Span,
    /// The value.
    pub node: Node,
}

/// A value and its place.
#[derive(Clone, Debug)]
pub struct Node {
    /// Where it stands.
    pub span: Span,
    /// What it is.
    pub data: Data,
}

/// A TOML value.
#[derive(Clone, Debug)]
pub enum Data {
    /// A string.
    Text(String),
    /// An integer; one that does not fit is the largest.
    Integer(i128),
    /// A floating-point number.
    Float(f64),
    /// `true` or `false`.
    Bool(bool),
    /// A date or a time: no config has one.
    Date,
    /// An array.
    List(Vec<Node>),
    /// A table, in any of TOML's notations.
    Table(Table),
}

impl Data {
    /// What it is, for messages.
    pub fn describe(&self) -> &'static str {
        match self {
            Data::Text(_) => "a string",
            Data::Integer(_) => "an integer",
            Data::Float(number) if !number.is_finite() => "no finite number",
            Data::Float(_) => "a number",
            Data::Bool(_) => "a truth value",
            Data::Date => "a date",
            Data::List(_) => "a list",
            Data::Table(_) => "a table",
        }
    }
}

/// Parses a whole TOML text.
///
/// # Errors
/// K0101 with the place of the first syntax error.
pub fn parse_file(sources: &Sources, file: FileId) -> Result<Table, Diagnostic> {
    let text = &sources.file(file).text;
    let place = Place { file, offset: 0 };
    match DeTable::parse(text) {
        Ok(table) => Ok(place.table(table.get_ref())),
        Err(error) => Err(place.syntax_error(&error, text).help(grammar_help(&error))),
    }
}

/// Parses a single TOML value that starts at byte `offset` of a text.
///
/// # Errors
/// K0101 with the place of the first syntax error.
pub fn parse_value(text: &str, file: FileId, offset: usize) -> Result<Node, Diagnostic> {
    let place = Place { file, offset };
    match DeValue::parse(text) {
        Ok(value) => Ok(place.node(value.get_ref(), value.span())),
        Err(error) => Err(place.syntax_error(&error, text)),
    }
}

/// Where a parsed text begins.
struct Place {
    file: FileId,
    offset: usize,
}

impl Place {
    fn span(&self, range: Range<usize>) -> Span {
        Span { file: self.file, start: (range.start + self.offset) as u32, end: (range.end + self.offset) as u32 }
    }

    fn table(&self, table: &DeTable<'_>) -> Table {
        let entry = |(key, value): (&toml::Spanned<toml::de::DeString<'_>>, &toml::Spanned<DeValue<'_>>)| {
            let entry = Entry { key: self.span(key.span()), node: self.node(value.get_ref(), value.span()) };
            (key.get_ref().to_string(), entry)
        };
        table.iter().map(entry).collect()
    }

    fn node(&self, value: &DeValue<'_>, range: Range<usize>) -> Node {
        let data = match value {
            DeValue::String(text) => Data::Text(text.to_string()),
            DeValue::Integer(number) => {
                Data::Integer(i128::from_str_radix(number.as_str(), number.radix()).unwrap_or(i128::MAX))
            }
            DeValue::Float(number) => Data::Float(number.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(truth) => Data::Bool(*truth),
            DeValue::Datetime(_) => Data::Date,
            DeValue::Array(items) => {
                Data::List(items.iter().map(|item| self.node(item.get_ref(), item.span())).collect())
            }
            DeValue::Table(table) => Data::Table(self.table(table)),
        };
        Node { span: self.span(range), data }
    }

    fn syntax_error(&self, error: &toml::de::Error, text: &str) -> Diagnostic {
        let range = error.span().unwrap_or(text.len()..text.len());
        let is_nothing = text.get(range.clone()).is_some_and(|part| part.trim().is_empty());
        // The parser takes the end of the line for a word that lacks its quotes.
        let label = if is_nothing && error.message().starts_with("string values must be quoted") {
            "a value is missing here"
        } else {
            error.message()
        };
        Diagnostic::error("K0101", "this is not valid TOML").at(self.span(range), label)
    }
}

fn grammar_help(error: &toml::de::Error) -> &'static str {
    if error.message().starts_with("duplicate key") {
        "a table has every key once: take one of the two away"
    } else {
        "a line is `key = value`, `[table]` or a `# comment`; strings stand in double quotes"
    }
}
