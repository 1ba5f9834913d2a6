//! Where every leaf of the state lives: tables, lanes, words and bits.
//!
//! A path's record in a table is a row of 32-bit words, cut into lanes of 1, 2 or 4 words; a lane is what one access reads or writes.

mod automatic;
mod explicit;
#[cfg(test)]
mod tests;

use crate::analyze::{Leaf, Liveness};
use crate::config::model::{Layout, Order, Pipeline, Variant};
use crate::config::nearest;
use crate::config::quantity::LeafType;
use crate::diagnostic::Diagnostic;
use indexmap::IndexMap;
use std::collections::{BTreeMap, BTreeSet};

/// The place of every stored leaf.
#[derive(Clone, Debug, Default)]
pub struct Placement {
    /// Tables, in the order of the layout.
    pub tables: Vec<Table>,
    /// Leaf to place.
    pub slots: BTreeMap<Leaf, Slot>,
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
}

/// The place of a leaf in its table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Index into `Placement::tables`.
    pub table: usize,
    /// Word of the path's record for each component.
    pub words: Vec<u32>,
    /// Lowest bit in the word; 0 for whole words.
    pub shift: u32,
    /// Bits of the word that belong to it; 32 for whole words.
    pub bits: u32,
}

/// A leaf of the pipeline's state with its type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StateLeaf {
    /// Instance, field, member.
    pub leaf: Leaf,
    /// Its WGSL type.
    pub ty: LeafType,
    /// Its width in bits; below 32 it may share a word.
    pub bits: u32,
}

impl Placement {
    /// Bytes of state a path takes, all tables.
    pub fn bytes_per_path(&self) -> u32 {
        self.tables.iter().map(Table::bytes_per_path).sum()
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
            leaves.extend(declared.quantity.leaves().into_iter().map(|shape| StateLeaf {
                leaf: Leaf {
                    instance: instance.clone(),
                    field: field.clone(),
                    member: shape.member.map(str::to_owned),
                },
                ty: shape.ty,
                bits: shape.bits,
            }));
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
    let all = state_leaves(pipeline);
    let needed: Vec<StateLeaf> =
        all.iter().filter(|leaf| !layout.drop_dead || liveness.stored.contains(&leaf.leaf)).cloned().collect();
    let tables = tables(pipeline, layout, &needed)?;
    if layout.place.is_empty() {
        Ok(automatic::assign(tables, &needed, liveness))
    } else {
        explicit::assign(tables, layout, &all, &needed)
    }
}

/// The tables without their lanes.
fn tables(pipeline: &Pipeline, layout: &Layout, needed: &[StateLeaf]) -> Result<Vec<Table>, Vec<Diagnostic>> {
    let listed: IndexMap<String, Vec<String>> = if layout.tables.is_empty() {
        IndexMap::from([("state".to_owned(), pipeline.state.keys().cloned().collect())])
    } else {
        check_instances(pipeline, layout, needed)?;
        let names = |(name, instances): (&String, &Vec<crate::source::Spanned<String>>)| {
            (name.clone(), instances.iter().map(|instance| instance.value.clone()).collect())
        };
        layout.tables.iter().map(names).collect()
    };
    let table = |(name, instances)| Table { name, instances, order: layout.order, lane: layout.lane, lanes: 0 };
    Ok(listed.into_iter().map(table).collect())
}

fn check_instances(pipeline: &Pipeline, layout: &Layout, needed: &[StateLeaf]) -> Result<(), Vec<Diagnostic>> {
    let mut findings = Vec::new();
    let mut seen = BTreeMap::new();
    for (table, instances) in &layout.tables {
        for instance in instances {
            let name = &instance.value;
            if !pipeline.state.contains_key(name) {
                findings.push(unknown_instance(pipeline, table, instance));
            } else if let Some(first) = seen.insert(name.clone(), instance.span) {
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

fn unknown_instance(pipeline: &Pipeline, table: &str, instance: &crate::source::Spanned<String>) -> Diagnostic {
    let names = || pipeline.state.keys().map(String::as_str);
    let message = format!("table `{table}` lists `{}`, which is no instance", instance.value);
    let help = match nearest(&instance.value, names()) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("the instances are {}", names().collect::<Vec<_>>().join(", ")),
    };
    Diagnostic::error("K0401", message).at(instance.span, "not in [state]").help(help)
}
