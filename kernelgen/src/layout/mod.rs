//! Where every leaf of the state lives: tables, lanes, words and bits.
//!
//! A path's record in a table is a row of 32-bit words, cut into lanes of 1, 2 or 4 words; a lane is what one access reads or writes.

mod automatic;
mod codec;
mod copies;
mod explicit;
mod interference;
#[cfg(test)]
mod tests;

pub use copies::InPlace;

use crate::analyze::{Leaf, Liveness};
use crate::config::model::{Codec, Layout, OPTIONAL, Order, Pipeline, Variant};
use crate::config::nearest;
use crate::config::quantity::{LeafShape, LeafType};
use crate::diagnostic::Diagnostic;
use crate::source::Spanned;
use indexmap::IndexMap;
use std::collections::{BTreeMap, BTreeSet};

/// The place of every stored leaf.
#[derive(Clone, Debug, Default)]
pub struct Placement {
    /// Tables, in the order of the layout.
    pub tables: Vec<Table>,
    /// Leaf to place.
    pub slots: BTreeMap<Leaf, Slot>,
    /// All leaves of the state, stored or not, with their codecs.
    pub leaves: BTreeMap<Leaf, StateLeaf>,
}

/// A table of path state: one buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Its name in the layout.
    pub name: String,
    /// The instances whose leaves it holds.
    pub instances: Vec<String>,
    /// How the records of different paths are interleaved.
    pub order: Order,
    /// 32-bit words in a lane: 1, 2 or 4.
    pub lane: u32,
    /// Lanes a path.
    pub lanes: u32,
    /// Whether it holds the leaves in flight (see `Liveness::in_flight`), of all instances, and nothing else.
    pub rays: bool,
}

/// The place of a leaf in its table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Index into `Placement::tables`.
    pub table: usize,
    /// The place of each of its parts, see `StateLeaf::parts`.
    pub parts: Vec<Bits>,
}

/// Neighbouring bits of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Bits {
    /// Word of the path's record.
    pub word: u32,
    /// Lowest bit in it; 0 for whole words.
    pub shift: u32,
    /// How many; 32 for whole words.
    pub bits: u32,
}

/// A leaf of the pipeline's state with its type.
#[derive(Clone, Debug, PartialEq)]
pub struct StateLeaf {
    /// Instance, field, member.
    pub leaf: Leaf,
    /// Its WGSL type.
    pub ty: LeafType,
    /// Its width in bits as it is computed; below 32 it may share a word.
    pub bits: u32,
    /// The word for what it is: `spectrum`.
    pub quantity: &'static str,
    /// How it is kept; `None`: as it is computed.
    pub codec: Option<Codec>,
}

impl StateLeaf {
    /// A part of a field of an instance, kept as it is computed.
    pub fn new(instance: &str, field: &str, shape: &LeafShape) -> Self {
        let leaf =
            Leaf { instance: instance.to_owned(), field: field.to_owned(), member: shape.member.map(str::to_owned) };
        StateLeaf { leaf, ty: shape.ty, bits: shape.bits, quantity: shape.quantity, codec: None }
    }

    /// Widths in bits of the parts that it is stored in, each within a word: those of its codec, or its components.
    pub fn parts(&self) -> Vec<u32> {
        match &self.codec {
            Some(codec) => codec.parts.clone(),
            None => vec![self.bits.min(32); self.ty.words() as usize],
        }
    }
}

impl Slot {
    /// Whether some bit belongs to both.
    pub fn overlaps(&self, other: &Slot) -> bool {
        self.table == other.table && self.parts.iter().any(|part| other.parts.iter().any(|bits| part.overlaps(bits)))
    }
}

impl Bits {
    /// Whether some bit belongs to both.
    pub fn overlaps(&self, other: &Bits) -> bool {
        self.word == other.word && self.shift < other.shift + other.bits && other.shift < self.shift + self.bits
    }
}

impl Placement {
    /// Bytes of state a path takes, the table of rays in flight left out.
    pub fn bytes_per_path(&self) -> u32 {
        self.tables.iter().filter(|table| !table.rays).map(Table::bytes_per_path).sum()
    }

    /// Bytes a path takes in the table of rays in flight.
    pub fn ray_bytes_per_path(&self) -> u32 {
        self.tables.iter().filter(|table| table.rays).map(Table::bytes_per_path).sum()
    }

    /// Stored leaves that have bits in common with this one.
    pub fn shares(&self, leaf: &Leaf) -> Vec<&Leaf> {
        let Some(own) = self.slots.get(leaf) else { return Vec::new() };
        let others = self.slots.iter().filter(|(other, slot)| *other != leaf && slot.overlaps(own));
        others.map(|(other, _)| other).collect()
    }
}

impl Table {
    /// Bytes a path takes in this table.
    pub fn bytes_per_path(&self) -> u32 {
        self.lanes * self.lane * 4
    }

    /// Index of a lane of a path in the table's array of lanes.
    ///
    /// `path_count` is what the array was allocated for; with `Order::Aosoa(n)` it must be a multiple of `n`.
    pub fn address(&self, lane_index: u32, path: u64, path_count: u64) -> u64 {
        let (lane_index, lanes) = (u64::from(lane_index), u64::from(self.lanes));
        match self.order {
            Order::Aos => path * lanes + lane_index,
            Order::Soa => lane_index * path_count + path,
            Order::Aosoa(block) => {
                let block = u64::from(block);
                path / block * (lanes * block) + lane_index * block + path % block
            }
        }
    }
}

/// All leaves of all instances, in the order of declaration.
pub fn state_leaves(pipeline: &Pipeline) -> Vec<StateLeaf> {
    let mut leaves = Vec::new();
    for (instance, record) in &pipeline.state {
        let Some(record) = pipeline.records.get(&record.value) else { continue };
        for (field, declared) in &record.fields {
            leaves.extend(declared.quantity.leaves().iter().map(|shape| StateLeaf::new(instance, field, shape)));
        }
    }
    leaves
}

/// Gives every leaf that must be stored a place: live ones when the layout drops dead leaves, else all of them.
///
/// # Errors
/// K0401 a table lists an instance that does not exist, K0402 one that is listed twice, K0403 a row of `place` that does not fill a
/// lane, K0404 a row that names no field, K0405 a leaf placed twice, K0406 a leaf that is placed nowhere, K0407 bits that do not fit,
/// K0408 a row whose fields belong to different tables, K0409 an instance that no table lists.
pub fn assign(variant: &Variant, liveness: &Liveness) -> Result<Placement, Vec<Diagnostic>> {
    let (pipeline, layout) = (&variant.pipeline, &variant.layout);
    let mut all = state_leaves(pipeline);
    codec::choose(&mut all, layout, liveness, &variant.codecs);
    let needed: Vec<StateLeaf> =
        all.iter().filter(|leaf| !layout.drop_dead || liveness.stored.contains(&leaf.leaf)).cloned().collect();
    let tables = tables(pipeline, layout, &needed)?;
    let (tables, slots) = if layout.place.is_empty() {
        automatic::assign(tables, &needed, liveness, layout.share)
    } else {
        explicit::assign(tables, layout, &all, &needed)?
    };
    let leaves = all.into_iter().map(|leaf| (leaf.leaf.clone(), leaf)).collect();
    Ok(Placement { tables, slots, leaves })
}

/// Tables with their lanes, and where in them every leaf is.
type Assigned = (Vec<Table>, BTreeMap<Leaf, Slot>);

/// The name of the table of rays in flight.
const RAYS: &str = "ray";

/// The tables without their lanes.
fn tables(pipeline: &Pipeline, layout: &Layout, needed: &[StateLeaf]) -> Result<Vec<Table>, Vec<Diagnostic>> {
    let listed: IndexMap<String, Vec<String>> = if layout.tables.is_empty() {
        IndexMap::from([("state".to_owned(), pipeline.state.keys().cloned().collect())])
    } else {
        check_instances(pipeline, layout, needed)?;
        let names = |(name, instances): (&String, &Vec<Spanned<String>>)| {
            let present = instances.iter().map(|instance| instance.value.trim_end_matches(OPTIONAL));
            (name.clone(), present.filter(|name| pipeline.state.contains_key(*name)).map(str::to_owned).collect())
        };
        layout.tables.iter().map(names).collect()
    };
    let table = |name: String, instances, rays| Table {
        name,
        instances,
        order: layout.order,
        lane: if rays { layout.ray_lane } else { layout.lane },
        lanes: 0,
        rays,
    };
    let mut tables: Vec<Table> = listed.into_iter().map(|(name, instances)| table(name, instances, false)).collect();
    if layout.rays_apart {
        tables.push(table(RAYS.to_owned(), pipeline.state.keys().cloned().collect(), true));
    }
    Ok(tables)
}

fn check_instances(pipeline: &Pipeline, layout: &Layout, needed: &[StateLeaf]) -> Result<(), Vec<Diagnostic>> {
    let mut findings = Vec::new();
    let mut seen = BTreeMap::new();
    for (table, instances) in &layout.tables {
        for instance in instances {
            let name = instance.value.trim_end_matches(OPTIONAL);
            if !pipeline.state.contains_key(name) {
                if name.len() < instance.value.len() {
                    continue;
                }
                findings.push(unknown_instance(pipeline, table, instance));
            } else if let Some(first) = seen.insert(name.to_owned(), instance.span) {
                let message = format!("instance `{name}` is in two tables");
                findings.push(
                    Diagnostic::error("K0402", message)
                        .at(instance.span, "listed again here")
                        .also(first, "first listed here")
                        .help("leave it in one of the two"),
                );
            }
        }
    }
    let unlisted: BTreeSet<&String> =
        needed.iter().map(|leaf| &leaf.leaf.instance).filter(|instance| !seen.contains_key(*instance)).collect();
    findings.extend(unlisted.into_iter().map(|instance| {
        Diagnostic::error("K0409", format!("instance `{instance}` is in no table"))
            .at(layout.span, "none of this layout's tables lists it")
            .help(format!("add \"{instance}\" to one of `layout.tables`"))
    }));
    if findings.is_empty() { Ok(()) } else { Err(findings) }
}

fn unknown_instance(pipeline: &Pipeline, table: &str, instance: &Spanned<String>) -> Diagnostic {
    let names = || pipeline.state.keys().map(String::as_str);
    let message = format!("table `{table}` lists `{}`, which is no instance", instance.value);
    let help = match nearest(&instance.value, names()) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("the instances are {}", names().collect::<Vec<_>>().join(", ")),
    };
    Diagnostic::error("K0401", message).at(instance.span, "not in [state]").help(help)
}
