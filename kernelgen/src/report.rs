//! What lives where, who reads and writes it, what is dead and why: as JSON keys and as tables for people.

use crate::analyze::{Leaf, Liveness, StageFacts};
use crate::config::model::{Order, Variant};
use crate::config::quantity::LeafType;
use crate::layout::{self, InPlace, Placement, StateLeaf};
use crate::plan::Plan;
use crate::source::{Sources, Span};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// The report on a variant.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Names of the pipeline, layout, schedule and precision.
    pub variant: [String; 4],
    /// Bytes of state a path takes, rays in flight left out where the layout keeps them apart.
    pub bytes_per_path: u32,
    /// Bytes of its rays in flight, where the layout keeps them apart.
    pub ray_bytes_per_path: u32,
    /// Tables of state.
    pub tables: Vec<TableReport>,
    /// Kernels, in the order of the plan.
    pub kernels: Vec<KernelReport>,
    /// Fields that are stored nowhere.
    pub dead: Vec<Reason>,
    /// Effects of the scene.
    pub effects: EffectsReport,
    #[serde(skip)]
    fields: Vec<FieldUse>,
}

/// A table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TableReport {
    /// Its name.
    pub name: String,
    /// Bytes a path.
    pub bytes: u32,
    /// How records are interleaved: `aos`, `soa`, `aosoa32`.
    pub order: String,
    /// Words in a lane.
    pub lane: u32,
    /// Stored fields, in the order of their words.
    pub fields: Vec<FieldReport>,
}

/// A stored leaf.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldReport {
    /// `eye.hit.prim`.
    pub name: String,
    /// `f32`, `u32`, `bits` or the name of a codec.
    pub codec: String,
    /// Bits it takes.
    pub bits: u32,
    /// Its first word in the path's record.
    pub word: u32,
    /// All its words.
    pub words: Vec<u32>,
    /// Its lowest bit in the first word.
    pub shift: u32,
    /// The bits of each of its parts.
    pub places: Vec<Place>,
    /// Fields that live in the same bits at other times.
    pub shares: Vec<String>,
}

/// Bits of a word of the path's record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// The word.
    pub word: u32,
    /// Lowest bit.
    pub shift: u32,
    /// How many.
    pub bits: u32,
}

/// A kernel.
#[derive(Clone, Debug, Serialize)]
pub struct KernelReport {
    /// Its name.
    pub name: String,
    /// Its stages, the one that it begins with first; none for housekeeping and for stream consumers.
    pub stages: Vec<String>,
    /// Bytes of state that a path loads.
    pub load_bytes: u32,
    /// Bytes of state that a path stores.
    pub store_bytes: u32,
    /// Bytes of state that it stores of a path which goes on in a loop whose paths stand side by side.
    pub moved_bytes: u32,
    /// Leaves it loads.
    pub loads: Vec<String>,
    /// Leaves it stores.
    pub stores: Vec<String>,
}

/// A name and why it is there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reason {
    /// The name.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// Effects of the scene, and whether a kernel asks for them.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EffectsReport {
    /// Effects that the scene calls for.
    pub kept: Vec<Reason>,
    /// Effects that it does not: their code is not generated.
    pub dropped: Vec<Reason>,
    /// Effects of either kind that no stage of this pipeline asks for.
    pub unused: Vec<String>,
}

/// Where a leaf is used, for `explain VARIANT FIELD`.
#[derive(Clone, Debug)]
struct FieldUse {
    leaf: String,
    field: String,
    quantity: &'static str,
    words: u32,
    written: Vec<String>,
    read: Vec<String>,
    live_out: Vec<String>,
    stored: Option<String>,
    shares: Vec<String>,
    /// Copies that no kernel has to make: `light.hit.t in seed`.
    in_place: Vec<String>,
    dead: Option<String>,
    /// Whether kernels use it without any storage.
    transient: bool,
}

/// What a report is made of.
pub(crate) struct Findings<'a> {
    pub sources: &'a Sources,
    pub variant: &'a Variant,
    pub plan: &'a Plan,
    pub placement: &'a Placement,
    /// What kernels are spared because copies lie where their sources lay, by kernel.
    pub in_place: &'a BTreeMap<String, InPlace>,
    pub liveness: &'a Liveness,
    pub stages: Vec<(&'a str, &'a StageFacts)>,
    /// Leaves that the keys of queues depend on, by stage.
    pub keys: Vec<(&'a str, &'a BTreeMap<Leaf, Span>)>,
    pub effects_seen: &'a BTreeSet<String>,
}

/// Collects the report.
pub(crate) fn build(findings: &Findings<'_>) -> Report {
    let variant = findings.variant;
    let leaves = layout::state_leaves(&variant.pipeline);
    Report {
        ray_bytes_per_path: findings.plan.ray_bytes_per_path,
        variant: [
            variant.pipeline.name.clone(),
            variant.layout.name.clone(),
            variant.schedule.name.clone(),
            variant.precision.name.clone(),
        ],
        bytes_per_path: findings.plan.bytes_per_path,
        tables: tables(findings),
        kernels: kernels(findings),
        dead: leaves.iter().filter_map(|leaf| dead(findings, leaf)).collect(),
        effects: effects(findings),
        fields: leaves.iter().map(|leaf| field_use(findings, leaf)).collect(),
    }
}

fn tables(findings: &Findings<'_>) -> Vec<TableReport> {
    let placement = findings.placement;
    let table = |(index, table): (usize, &layout::Table)| {
        let own = placement.slots.iter().filter(|(_, slot)| slot.table == index);
        let mut fields: Vec<FieldReport> = own.map(|(leaf, slot)| field(placement, leaf, slot)).collect();
        fields.sort_by_key(|field| (field.word, field.shift));
        TableReport {
            name: table.name.clone(),
            bytes: table.bytes_per_path(),
            order: order(table.order),
            lane: table.lane,
            fields,
        }
    };
    placement.tables.iter().enumerate().map(table).collect()
}

fn order(order: Order) -> String {
    match order {
        Order::Aos => "aos".to_owned(),
        Order::Soa => "soa".to_owned(),
        Order::Aosoa(block) => format!("aosoa{block}"),
    }
}

fn field(placement: &Placement, leaf: &Leaf, slot: &layout::Slot) -> FieldReport {
    let place = |bits: &layout::Bits| Place { word: bits.word, shift: bits.shift, bits: bits.bits };
    let places: Vec<Place> = slot.parts.iter().map(place).collect();
    FieldReport {
        name: leaf.to_string(),
        codec: placement.leaves.get(leaf).map(codec).unwrap_or_default(),
        bits: places.iter().map(|place| place.bits).sum(),
        word: places.first().map_or(0, |place| place.word),
        words: words(&places),
        shift: places.first().map_or(0, |place| place.shift),
        shares: placement.shares(leaf).into_iter().map(Leaf::to_string).collect(),
        places,
    }
}

/// Different words, in the order of the parts.
fn words(places: &[Place]) -> Vec<u32> {
    let mut words: Vec<u32> = places.iter().map(|place| place.word).collect();
    words.dedup();
    words
}

fn codec(leaf: &StateLeaf) -> String {
    match (&leaf.codec, leaf.ty) {
        (Some(codec), _) => codec.name.clone(),
        (None, LeafType::U32) if leaf.bits < 32 => "bits".to_owned(),
        (None, LeafType::U32) => "u32".to_owned(),
        (None, _) => "f32".to_owned(),
    }
}

fn kernels(findings: &Findings<'_>) -> Vec<KernelReport> {
    let report = |kernel: &crate::plan::Kernel| {
        let needed = kernel.stages.first().and_then(|entry| findings.liveness.kernels.get(entry));
        let traffic = needed.zip(findings.in_place.get(&kernel.name)).map(|(needed, spared)| spared.spare(needed));
        let names = |leaves: &BTreeSet<Leaf>| leaves.iter().map(Leaf::to_string).collect::<Vec<_>>();
        KernelReport {
            name: kernel.name.clone(),
            stages: kernel.stages.clone(),
            load_bytes: kernel.load_bytes,
            store_bytes: kernel.store_bytes,
            moved_bytes: kernel.moved_bytes,
            loads: traffic.iter().flat_map(|traffic| names(&traffic.loads)).collect(),
            stores: traffic.iter().flat_map(|traffic| names(&traffic.stores)).collect(),
        }
    };
    findings.plan.kernels.iter().map(report).collect()
}

fn effects(findings: &Findings<'_>) -> EffectsReport {
    let mut report = EffectsReport::default();
    for (name, effect) in &findings.variant.effects {
        let reason = Reason { name: name.clone(), reason: effect.reason.clone() };
        if effect.present {
            report.kept.push(reason);
        } else {
            report.dropped.push(reason);
        }
        if !findings.effects_seen.contains(&format!("HAS_{}", name.to_uppercase())) {
            report.unused.push(name.clone());
        }
    }
    report
}

fn field_use(findings: &Findings<'_>, declared: &StateLeaf) -> FieldUse {
    let leaf = &declared.leaf;
    let pipeline = &findings.variant.pipeline;
    let record = pipeline.state.get(&leaf.instance).and_then(|record| pipeline.records.get(&record.value));
    let quantity = record.and_then(|record| record.fields.get(&leaf.field));
    let at = |stage: &str, span: &Span| format!("{stage} ({})", place(findings.sources, *span));
    let mut written = Vec::new();
    let mut read = Vec::new();
    for (stage, facts) in &findings.stages {
        written.extend(facts.writes.get(leaf).map(|span| at(stage, span)));
        written.extend(facts.maybe.get(leaf).map(|span| format!("{}, perhaps", at(stage, span))));
        read.extend(facts.reads.get(leaf).map(|span| at(stage, span)));
    }
    for (stage, reads) in &findings.keys {
        read.extend(reads.get(leaf).map(|span| format!("key of {}", at(stage, span))));
    }
    let in_place = findings.in_place.iter().filter_map(|(kernel, in_place)| {
        let source = in_place.copies.get(leaf)?;
        Some(format!("{source} in {kernel}"))
    });
    let live_out = findings.liveness.kernels.iter().filter(|(_, traffic)| traffic.live_out.contains(leaf));
    FieldUse {
        leaf: leaf.to_string(),
        field: format!("{}.{}", leaf.instance, leaf.field),
        quantity: quantity.map_or("", |field| field.quantity.name()),
        words: declared.ty.words(),
        written,
        read,
        live_out: live_out.map(|(stage, _)| stage.clone()).collect(),
        stored: findings.placement.slots.get(leaf).map(|slot| stored(findings.placement, slot)),
        shares: findings.placement.shares(leaf).into_iter().map(Leaf::to_string).collect(),
        in_place: in_place.collect(),
        dead: findings.liveness.dead.get(leaf).cloned(),
        transient: dead(findings, declared).is_some_and(|reason| reason.reason == TRANSIENT),
    }
}

/// Why a leaf that is read and written needs no storage.
const TRANSIENT: &str = "lives within one kernel";

/// Why a leaf that is stored nowhere needs no storage.
fn dead(findings: &Findings<'_>, declared: &StateLeaf) -> Option<Reason> {
    let leaf = &declared.leaf;
    if findings.placement.slots.contains_key(leaf) {
        return None;
    }
    let touches = |facts: &StageFacts| {
        facts.reads.contains_key(leaf) || facts.writes.contains_key(leaf) || facts.maybe.contains_key(leaf)
    };
    let reason = match findings.liveness.dead.get(leaf) {
        Some(reason) => reason.clone(),
        None if findings.stages.iter().any(|(_, facts)| touches(facts)) => TRANSIENT.to_owned(),
        None => "no stage reads or writes it".to_owned(),
    };
    Some(Reason { name: leaf.to_string(), reason })
}

fn stored(placement: &Placement, slot: &layout::Slot) -> String {
    let table = &placement.tables[slot.table].name;
    let places: Vec<String> = slot.parts.iter().map(place_text).collect();
    let noun = if places.len() == 1 { "word" } else { "words" };
    format!("{noun} {} of table {table}", places.join(", "))
}

/// `7`, or `7 (bits 8 to 15)`.
fn place_text(part: &layout::Bits) -> String {
    match part.bits {
        32 => part.word.to_string(),
        bits => format!("{} (bits {} to {})", part.word, part.shift, part.shift + bits - 1),
    }
}

/// `stages/trace.wgsl:40`.
fn place(sources: &Sources, span: Span) -> String {
    let Some(file) = sources.get(span.file) else { return String::new() };
    let before = file.text.get(..span.start as usize).unwrap_or("");
    format!("{}:{}", file.name, before.matches('\n').count() + 1)
}

impl Report {
    /// The report as aligned tables.
    pub fn text(&self) -> String {
        let [pipeline, layout, schedule, precision] = &self.variant;
        let mut text = format!("{pipeline} x {layout} x {schedule} x {precision}\n");
        let rays = match self.ray_bytes_per_path {
            0 => String::new(),
            bytes => format!(", and {bytes} of rays in flight"),
        };
        let _ = writeln!(text, "{} bytes of state a path{rays}\n", self.bytes_per_path);
        for table in &self.tables {
            let _ = writeln!(
                text,
                "table {}: {} bytes a path, {}, {} words a lane",
                table.name, table.bytes, table.order, table.lane
            );
            text.push_str(&columns(&table_rows(table)));
            text.push('\n');
        }
        text.push_str(&columns(&self.kernel_rows()));
        for (title, reasons) in
            [("dead", &self.dead), ("effects kept", &self.effects.kept), ("effects dropped", &self.effects.dropped)]
        {
            if reasons.is_empty() {
                continue;
            }
            let rows: Vec<Vec<String>> = reasons.iter().map(|row| vec![row.name.clone(), row.reason.clone()]).collect();
            let _ = write!(text, "\n{title}\n{}", columns(&rows));
        }
        if !self.effects.unused.is_empty() {
            let _ = writeln!(text, "\nno stage asks for {}", self.effects.unused.join(", "));
        }
        text
    }

    fn kernel_rows(&self) -> Vec<Vec<String>> {
        let moves = self.kernels.iter().any(|kernel| kernel.moved_bytes > 0);
        let columns = if moves { 4 } else { 3 };
        let row = |cells: [String; 4]| cells.into_iter().take(columns).collect::<Vec<String>>();
        let mut rows = vec![row(["kernel", "loads B", "stores B", "moves on B"].map(str::to_owned))];
        let stages = self.kernels.iter().filter(|kernel| !kernel.stages.is_empty());
        let name = |kernel: &KernelReport| match kernel.stages.get(1..) {
            Some(others @ [_, ..]) => format!("{} with {}", kernel.name, others.join(", ")),
            _ => kernel.name.clone(),
        };
        rows.extend(stages.map(|kernel| {
            let bytes = [kernel.load_bytes, kernel.store_bytes, kernel.moved_bytes].map(|bytes| bytes.to_string());
            let [loads, stores, moved] = bytes;
            row([name(kernel), loads, stores, moved])
        }));
        rows
    }

    /// Everything about a field or one of its leaves, `eye.hit` or `eye.hit.t`; `None` if there is no such field.
    pub fn field(&self, name: &str) -> Option<String> {
        let leaves: Vec<&FieldUse> =
            self.fields.iter().filter(|leaf| leaf.field == name || leaf.leaf == name).collect();
        let first = leaves.first()?;
        let words: u32 = leaves.iter().map(|leaf| leaf.words).sum();
        let mut text = format!("{name}   quantity {}, {words} {}\n", first.quantity, plural(words, "word"));
        for leaf in &leaves {
            let indent = if leaves.len() > 1 { "    " } else { "  " };
            if leaves.len() > 1 {
                let _ = writeln!(text, "  {}", leaf.leaf);
            }
            push_use(&mut text, indent, leaf);
        }
        Some(text)
    }

    /// Names of all fields, `eye.hit`, in the order of declaration.
    pub fn field_names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.fields.iter().map(|leaf| leaf.field.clone()).collect();
        names.dedup();
        names
    }
}

fn plural(count: u32, noun: &str) -> String {
    if count == 1 { noun.to_owned() } else { format!("{noun}s") }
}

fn push_use(text: &mut String, indent: &str, leaf: &FieldUse) {
    for (verb, stages) in [("written by", &leaf.written), ("read by", &leaf.read)] {
        let list = if stages.is_empty() { "no stage".to_owned() } else { stages.join(", ") };
        let _ = writeln!(text, "{indent}{verb} {list}");
    }
    if !leaf.live_out.is_empty() {
        let _ = writeln!(text, "{indent}live out of {}", leaf.live_out.join(", "));
    }
    if let Some(stored) = &leaf.stored {
        let _ = writeln!(text, "{indent}stored in {stored}");
    }
    if !leaf.shares.is_empty() {
        let _ = writeln!(text, "{indent}shares bits with {}", leaf.shares.join(", "));
    }
    if !leaf.in_place.is_empty() {
        let _ = writeln!(text, "{indent}copied in place from {}", leaf.in_place.join(", "));
    }
    if let Some(reason) = &leaf.dead {
        let _ = writeln!(text, "{indent}dead: {reason}");
    }
    if leaf.transient {
        let _ = writeln!(text, "{indent}not stored: {TRANSIENT}");
    }
}

fn table_rows(table: &TableReport) -> Vec<Vec<String>> {
    let shared = table.fields.iter().any(|field| !field.shares.is_empty());
    let heading = ["  field", "codec", "bits", "words", "shift"].into_iter().chain(shared.then_some("shares with"));
    let mut rows = vec![heading.map(str::to_owned).collect()];
    rows.extend(table.fields.iter().map(|field| {
        let words: Vec<String> = field.words.iter().map(u32::to_string).collect();
        vec![
            format!("  {}", field.name),
            field.codec.clone(),
            field.bits.to_string(),
            words.join(" "),
            field.shift.to_string(),
            field.shares.join(" "),
        ]
    }));
    rows
}

/// Rows with their cells aligned to the left, two blanks between.
fn columns(rows: &[Vec<String>]) -> String {
    let count = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..count).map(|column| width(column).unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            let _ = write!(line, "{cell:width$}  ");
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}
