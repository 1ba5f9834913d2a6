//! The schedule axis and the precision axis.

use super::merge::AxisFile;
use super::model::{Accumulate, Batch, Fuse, LoadAt, Loops, PathOrder, Precision, QueueKind, Real, Schedule};
use super::section::{Findings, Item, Section};
use super::tree::Data;
use crate::diagnostic::Diagnostic;
use crate::source::Spanned;

/// Keys of `[schedule]`.
pub const KEYS: [&str; 12] = [
    "fuse",
    "queue",
    "order",
    "sort",
    "loops",
    "workgroup",
    "load",
    "until",
    "regenerate",
    "accumulate",
    "batch",
    "capacity",
];
/// Keys of `[precision]`.
pub const PRECISION_KEYS: [&str; 1] = ["real"];

/// More room than the longest pass could use; whatever the number of slots, 32 bits count so many records.
const MOST_CAPACITY: f64 = 1000.0;

/// Paths that a slot takes in a pass at most.
const MOST_REGENERATED: u32 = 16;

/// What `sort` says where no queue is sorted.
const UNSORTED: &str = "none";

const WORKGROUPS: [u32; 6] = [32, 64, 128, 256, 512, 1024];

/// The schedule; `None` when a required key is missing or refused.
pub fn read(file: &AxisFile, top: &Section<'_>, findings: &mut Findings) -> Option<Schedule> {
    let section = top.require("schedule", "write `[schedule]`", findings)?.section(findings)?;
    section.allow(&KEYS, findings);
    check_fixed(&section, findings);
    let fuse = match section.get("fuse") {
        Some(item) => fuse(&item, findings),
        None => Some(Spanned { value: Fuse::Groups(Vec::new()), span: section.span }),
    };
    let queue = word(&section, "queue", &["atomic", "subgroup", "workgroup", "none"], findings);
    let workgroup = section.require("workgroup", "threads in a workgroup: `workgroup = 64`", findings);
    let workgroup = workgroup.and_then(|item| workgroup_size(&item, findings));
    let accumulate = word(&section, "accumulate", &["atomic_f32", "fixed_i64", "racy"], findings);
    let load = section.get("load").and_then(|item| item.word(&["entry", "use"], findings));
    let order = section.get("order").and_then(|item| item.word(&["arrival", "slot", "packed", "dense"], findings));
    let loops = section.get("loops").and_then(|item| item.word(&["nested", "flat"], findings));
    let sort = section.get("sort").and_then(|item| keys(&item, findings));
    let regenerate = match section.get("regenerate") {
        Some(item) => {
            let value = item.integer(1..=MOST_REGENERATED, findings);
            value.map(|value| Spanned { value, span: item.span() })
        }
        None => Some(Spanned { value: 1, span: section.span }),
    };
    let batch = section.get("batch").and_then(|item| batch(&item, findings));
    let capacity = section.require("capacity", "records per path slot in a batched stream: `capacity = 4`", findings);
    let capacity = capacity.and_then(|item| room(&item, findings));
    Some(Schedule {
        name: file.name.clone(),
        doc: file.doc.clone(),
        fuse: fuse?,
        queue: [QueueKind::Atomic, QueueKind::Subgroup, QueueKind::Workgroup, QueueKind::None][queue?],
        order: [PathOrder::Arrival, PathOrder::Slot, PathOrder::Packed, PathOrder::Dense][order.unwrap_or_default()],
        sort: sort.unwrap_or_default(),
        loops: [Loops::Nested, Loops::Flat][loops.unwrap_or_default()],
        workgroup: workgroup?,
        load: [LoadAt::Entry, LoadAt::Use][load.unwrap_or_default()],
        regenerate: regenerate?,
        accumulate: [Accumulate::AtomicF32, Accumulate::FixedI64, Accumulate::Racy][accumulate?],
        batch: batch.unwrap_or(Batch::Streams(Vec::new())),
        capacity: capacity?,
    })
}

/// The precision; `None` when `real` is missing or refused.
pub fn read_precision(file: &AxisFile, top: &Section<'_>, findings: &mut Findings) -> Option<Precision> {
    let section = top.require("precision", "write `[precision]`", findings)?.section(findings)?;
    section.allow(&PRECISION_KEYS, findings);
    let real = word(&section, "real", &["f32"], findings)?;
    Some(Precision { name: file.name.clone(), doc: file.doc.clone(), real: [Real::F32][real] })
}

/// A required word, as an index.
fn word(section: &Section<'_>, key: &str, words: &[&str], findings: &mut Findings) -> Option<usize> {
    let help = format!("write `{key} = \"{}\"`", words.join("\"` or `\""));
    section.require(key, &help, findings)?.word(words, findings)
}

/// The keys that have only one value so far.
fn check_fixed(section: &Section<'_>, findings: &mut Findings) {
    if let Some(until) = section.get("until") {
        until.word(&["empty"], findings);
    }
}

/// A word, or groups of stages as lists of their names.
fn fuse(item: &Item<'_>, findings: &mut Findings) -> Option<Spanned<Fuse>> {
    let value = match item.node.data {
        Data::List(_) => Fuse::Groups(item.list(findings)?.iter().filter_map(|group| group.texts(findings)).collect()),
        _ => [Fuse::Walks, Fuse::All][item.word(&["walks", "all"], findings)?].clone(),
    };
    Some(Spanned { value, span: item.span() })
}

fn workgroup_size(item: &Item<'_>, findings: &mut Findings) -> Option<Spanned<u32>> {
    let Data::Integer(number) = item.node.data else {
        return item.integer(32..=1024, findings).map(|value| Spanned { value, span: item.span() });
    };
    let size = WORKGROUPS.into_iter().find(|size| i128::from(*size) == number);
    if size.is_none() {
        let sizes: Vec<String> = WORKGROUPS.iter().map(u32::to_string).collect();
        let refused = Diagnostic::error("K0107", format!("`{}` cannot be {number}", item.path))
            .at(item.span(), "not a power of two from 32 to 1024")
            .help(format!("`workgroup` is one of {}", sizes.join(", ")));
        findings.push(refused);
    }
    size.map(|value| Spanned { value, span: item.span() })
}

/// A positive number of records per path slot.
fn room(item: &Item<'_>, findings: &mut Findings) -> Option<Spanned<f64>> {
    let value = item.real(findings)?;
    if value > 0.0 && value <= MOST_CAPACITY {
        return Some(Spanned { value, span: item.span() });
    }
    let refused = Diagnostic::error("K0107", format!("`{}` is out of range", item.path))
        .at(item.span(), "too small or too large")
        .help(format!("write a number above 0, and at most {MOST_CAPACITY}: records per path slot"));
    findings.push(refused);
    None
}

/// Keys of stages, or the word for none.
fn keys(item: &Item<'_>, findings: &mut Findings) -> Option<Vec<Spanned<String>>> {
    match &item.node.data {
        Data::Text(text) if text == UNSORTED => Some(Vec::new()),
        _ => names(item, findings),
    }
}

/// Names of streams, or the word for as many as possible.
fn batch(item: &Item<'_>, findings: &mut Findings) -> Option<Batch> {
    match &item.node.data {
        Data::Text(text) if text == "bounded" => Some(Batch::Bounded),
        _ => names(item, findings).map(Batch::Streams),
    }
}

/// A list of names; one name alone is a list of one, which spares quotes in `--set batch=connection`.
fn names(item: &Item<'_>, findings: &mut Findings) -> Option<Vec<Spanned<String>>> {
    match item.node.data {
        Data::Text(_) => item.text(findings).map(|text| vec![text]),
        _ => item.texts(findings),
    }
}
