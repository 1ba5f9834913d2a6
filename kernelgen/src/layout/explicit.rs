//! Placement by rows: the user says which field fills which word, and every word is accounted for.

use super::{Assigned, Bits, Slot, StateLeaf, Table};
use crate::analyze::Leaf;
use crate::config::model::{Layout, Placed, PlacedField, PlacedRow};
use crate::config::nearest;
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::collections::BTreeMap;

/// Reads the rows. `all` are the leaves that may be named, `needed` those that must be.
pub(super) fn assign(
    tables: Vec<Table>,
    layout: &Layout,
    all: &[StateLeaf],
    needed: &[StateLeaf],
) -> Result<Assigned, Vec<Diagnostic>> {
    let mut rows =
        Rows { all, lane: layout.lane, tables, slots: BTreeMap::new(), places: BTreeMap::new(), findings: Vec::new() };
    let mut table = 0;
    for row in &layout.place {
        table = rows.table_of(row).unwrap_or(table);
        rows.read(row, table);
    }
    rows.check_missing(layout, needed);
    if rows.findings.is_empty() { Ok((rows.tables, rows.slots)) } else { Err(rows.findings) }
}

struct Rows<'a> {
    all: &'a [StateLeaf],
    lane: u32,
    tables: Vec<Table>,
    slots: BTreeMap<Leaf, Slot>,
    places: BTreeMap<Leaf, Span>,
    findings: Vec<Diagnostic>,
}

impl Rows<'_> {
    /// The table of a row's fields; a row of unused words belongs to the table before it.
    fn table_of(&mut self, row: &PlacedRow) -> Option<usize> {
        let mut first: Option<(usize, &PlacedField)> = None;
        for field in fields(row) {
            let Some(table) = self.table_of_field(field) else { continue };
            match first {
                Some((other, before)) if other != table => {
                    let tables = &self.tables;
                    let message =
                        format!("a row cannot mix the tables `{}` and `{}`", tables[other].name, tables[table].name);
                    self.findings.push(
                        Diagnostic::error("K0408", message)
                            .at(field.span, format!("stored in table `{}`", tables[table].name))
                            .also(before.span, format!("stored in table `{}`", tables[other].name))
                            .help("make two rows of it, each filled with `_`"),
                    );
                    return Some(other);
                }
                Some(_) => {}
                None => first = Some((table, field)),
            }
        }
        first.map(|(table, _)| table)
    }

    fn table_of_field(&self, field: &PlacedField) -> Option<usize> {
        let instance = field.field.as_ref()?.split('.').next()?;
        let tables = &self.tables;
        tables.iter().position(|table| table.instances.iter().any(|name| name == instance))
    }

    fn read(&mut self, row: &PlacedRow, table: usize) {
        let first = self.tables[table].lanes * self.lane;
        let mut word = first;
        for part in &row.parts {
            word += match part {
                Placed::Words(field) => self.place_words(field, table, word),
                Placed::Bits(fields) => self.place_bits(row, fields, table, word),
            };
        }
        self.tables[table].lanes += 1;
        self.check_width(row, word - first);
    }

    fn check_width(&mut self, row: &PlacedRow, words: u32) {
        if words == self.lane {
            return;
        }
        let message = format!("this row takes {words} words, but a lane has {}", self.lane);
        let help = if words < self.lane {
            let holes = vec!["\"_\""; (self.lane - words) as usize].join(", ");
            format!("fill it with {holes} or a field of at most {} words", self.lane - words)
        } else {
            format!("move {} words of it to another row", words - self.lane)
        };
        let finding = Diagnostic::error("K0403", message).at(row.span, "this row").help(help);
        self.findings.push(finding);
    }

    /// Places whole words and returns how many.
    fn place_words(&mut self, field: &PlacedField, table: usize, first: u32) -> u32 {
        let Some(name) = &field.field else { return 1 };
        let leaves = self.named(name);
        if leaves.is_empty() {
            self.unknown(field, name);
            return 1;
        }
        let words: u32 = leaves.iter().map(|leaf| leaf.ty.words()).sum();
        if let [leaf] = leaves.as_slice()
            && leaf.bits < 32
            && field.bits != Some(32)
        {
            let finding = Diagnostic::error("K0407", format!("`{name}` is {} bits wide, not a word", leaf.bits))
                .at(field.span, "a whole word in this row")
                .help(format!("write [\"{name}:{}\", \"_:{}\"]", leaf.bits, 32 - leaf.bits));
            self.findings.push(finding);
        } else if field.bits.is_some_and(|bits| bits != 32 * words) {
            let finding = Diagnostic::error("K0407", format!("`{name}` is {words} words wide"))
                .at(field.span, "other bits given here")
                .help(format!("write \"{name}\", without bits"));
            self.findings.push(finding);
        }
        let mut word = first;
        for leaf in leaves {
            let next = word + leaf.ty.words();
            let parts = (word..next).map(|word| Bits { word, shift: 0, bits: 32 });
            let slot = Slot { table, parts: parts.collect() };
            self.put(leaf.leaf, slot, field.span);
            word = next;
        }
        words
    }

    /// Places the fields of one shared word and returns 1.
    fn place_bits(&mut self, row: &PlacedRow, fields: &[PlacedField], table: usize, word: u32) -> u32 {
        let mut shift = 0;
        for field in fields {
            let width = match &field.field {
                Some(name) => self.place_field_bits(field, name, table, word, shift),
                None => field.bits.unwrap_or(0),
            };
            shift += width;
        }
        if shift != 32 {
            let help = if shift < 32 {
                format!("fill the word with \"_:{}\"", 32 - shift)
            } else {
                format!("move {} bits to another word", shift - 32)
            };
            let span = fields.first().map_or(row.span, |field| field.span);
            let message = format!("the fields of this word take {shift} bits, not 32");
            self.findings.push(
                Diagnostic::error("K0407", message)
                    .at(span, "in the word that begins here")
                    .also(row.span, "in this row")
                    .help(help),
            );
        }
        1
    }

    /// Places one field below a word and returns its width.
    fn place_field_bits(&mut self, field: &PlacedField, name: &str, table: usize, word: u32, shift: u32) -> u32 {
        let leaves = self.named(name);
        let [leaf] = leaves.as_slice() else {
            if leaves.is_empty() {
                self.unknown(field, name);
            } else {
                self.whole_words_only(field, name);
            }
            return field.bits.unwrap_or(0);
        };
        if leaf.bits > 32 {
            self.whole_words_only(field, name);
            return field.bits.unwrap_or(0);
        }
        let width = field.bits.unwrap_or(leaf.bits);
        if width < leaf.bits || width > 32 {
            let message = format!("`{name}` needs {} bits, {width} are given", leaf.bits);
            let finding = Diagnostic::error("K0407", message)
                .at(field.span, "this width")
                .help(format!("write \"{name}:{}\"", leaf.bits));
            self.findings.push(finding);
        }
        let slot = Slot { table, parts: vec![Bits { word, shift, bits: width.min(32) }] };
        self.put(leaf.leaf.clone(), slot, field.span);
        width
    }

    fn whole_words_only(&mut self, field: &PlacedField, name: &str) {
        let finding = Diagnostic::error("K0407", format!("`{name}` does not fit into a shared word"))
            .at(field.span, "takes whole words")
            .help(format!("place \"{name}\" outside of the inner list"));
        self.findings.push(finding);
    }

    fn put(&mut self, leaf: Leaf, slot: Slot, span: Span) {
        if let Some(first) = self.places.insert(leaf.clone(), span) {
            let finding = Diagnostic::error("K0405", format!("`{leaf}` is placed twice"))
                .at(span, "placed again here")
                .also(first, "first placed here")
                .help("put \"_\" in place of one of them");
            self.findings.push(finding);
        }
        self.slots.insert(leaf, slot);
    }

    /// The leaves that `instance.field` or `instance.field.member` stands for.
    fn named(&self, name: &str) -> Vec<StateLeaf> {
        let stands_for = |leaf: &&StateLeaf| {
            let field = format!("{}.{}", leaf.leaf.instance, leaf.leaf.field);
            field == name || leaf.leaf.to_string() == name
        };
        self.all.iter().filter(stands_for).cloned().collect()
    }

    fn unknown(&mut self, field: &PlacedField, name: &str) {
        let names: Vec<String> =
            self.all.iter().map(|leaf| format!("{}.{}", leaf.leaf.instance, leaf.leaf.field)).collect();
        let help = match nearest(name, names.iter().map(String::as_str)) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "write \"instance.field\", or \"_\" for an unused word".to_owned(),
        };
        let finding = Diagnostic::error("K0404", format!("there is no field `{name}`"))
            .at(field.span, "no such field in the state of this pipeline")
            .help(help);
        self.findings.push(finding);
    }

    fn check_missing(&mut self, layout: &Layout, needed: &[StateLeaf]) {
        let missing: Vec<&StateLeaf> = needed.iter().filter(|leaf| !self.places.contains_key(&leaf.leaf)).collect();
        for leaf in missing {
            let size = if leaf.bits < 32 {
                format!("[\"{}:{}\", \"_:{}\"]", leaf.leaf, leaf.bits, 32 - leaf.bits)
            } else {
                format!("\"{}\", {} words of a row", leaf.leaf, leaf.ty.words())
            };
            let finding = Diagnostic::error("K0406", format!("`{}` must be stored but is placed nowhere", leaf.leaf))
                .at(layout.span, "not in `place` of this layout")
                .help(format!("add {size}"));
            self.findings.push(finding);
        }
    }
}

fn fields(row: &PlacedRow) -> impl Iterator<Item = &PlacedField> {
    row.parts.iter().flat_map(|part| match part {
        Placed::Words(field) => std::slice::from_ref(field),
        Placed::Bits(fields) => fields.as_slice(),
    })
}
