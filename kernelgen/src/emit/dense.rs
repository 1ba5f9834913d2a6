//! Paths that stand side by side while they go round in a loop.
//!
//! Of the paths that a loop begins with, fewer are left in every turn. Where they keep their slots, kernels find the state of the few in
//! sectors of memory that they share with slots of paths that are over. So what leads to the first stage of the loop stores the state
//! that lives in the loop where the path stands in that stage's queue, at a *place*, which needs no entry then. Tables whose records
//! move so have places for two turns: one is read while the next is written. Each place knows the slot of its path, where all other
//! tables have its state. Kernels outside of the loop may use the same tables by slot, and find them as they left them.

use super::fusion::{Chain, Fusion};
use super::queue::Queues;
use super::rounds::Rounds;
use crate::analyze::{KernelTraffic, Leaf, Liveness};
use crate::layout::Placement;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The loop whose paths stand side by side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Dense {
    /// The stage that a turn begins with: its paths stand where its queue would have them.
    pub first: String,
    /// The kernels of a turn, by entry.
    pub inside: BTreeSet<String>,
    /// The tables whose records move, indices into `Placement::tables`, and whether kernels outside use them by slot.
    pub tables: BTreeMap<usize, bool>,
}

impl Dense {
    /// The inner loop, or where there is none what is run from the first stage that paths come back to, if none comes back to another
    /// and some table can move.
    pub(super) fn new(
        fusion: &Fusion,
        rounds: &Rounds,
        queues: &Queues,
        placement: &Placement,
        liveness: &Liveness,
    ) -> Option<Dense> {
        let all = || fusion.first_led_back_to()..fusion.queued.len();
        let inside = rounds.inner.as_ref().map_or_else(all, |inner| inner.kernels.clone());
        let (first, _) = fusion.queued.get_index(inside.start)?;
        let around = Around { fusion, liveness, inside, first };
        if !around.is_in_step(queues) {
            return None;
        }
        let tables = (0..placement.tables.len()).filter(|&table| placement.tables[table].lanes > 0);
        let leaves =
            |table| placement.slots.iter().filter(move |(_, slot)| slot.table == table).map(|(leaf, _)| leaf).collect();
        let tables = tables.map(|table| (table, leaves(table)));
        let tables: BTreeMap<usize, bool> = tables
            .filter(|(_, leaves)| around.may_move(leaves))
            .map(|(table, leaves)| (table, around.is_used_by_slot(&leaves)))
            .collect();
        let inside = around.inside().map(|(_, chain)| chain.entry.clone()).collect();
        (!tables.is_empty()).then(|| Dense { first: first.clone(), inside, tables })
    }

    /// How many places a table has for a slot: those of two turns, and by slot if it is used so.
    pub(super) fn places(&self, table: usize) -> u32 {
        self.tables.get(&table).map_or(1, |by_slot| 2 + u32::from(*by_slot))
    }
}

/// A loop and what runs around it.
struct Around<'a> {
    fusion: &'a Fusion,
    liveness: &'a Liveness,
    /// Its kernels among those that take paths from queues.
    inside: Range<usize>,
    /// The first of them.
    first: &'a String,
}

impl<'a> Around<'a> {
    /// The kernels of the loop, with their places in the program.
    fn inside(&self) -> impl Iterator<Item = (usize, &'a Chain)> + use<'a> {
        let inside = self.inside.clone();
        self.fusion.queued.values().enumerate().filter(move |(place, _)| inside.contains(place))
    }

    /// The kernels around it.
    fn outside(&self) -> impl Iterator<Item = &'a Chain> + use<'a> {
        let inside = self.inside.clone();
        let queued = self.fusion.queued.values().enumerate().filter(move |(place, _)| !inside.contains(place));
        queued.map(|(_, chain)| chain).chain([&self.fusion.start])
    }

    /// The kernels of the loop that a kernel leads to.
    fn led_to_inside(&self, chain: &'a Chain) -> impl Iterator<Item = usize> {
        let places = chain.feeds.iter().filter_map(|fed| self.fusion.queued.get_index_of(fed));
        places.filter(|place| self.inside.contains(place))
    }

    /// Whether all paths begin a turn together: what leads into the loop leads to its first kernel, kernels of the loop lead to later ones
    /// of the turn or to the first of the next, and no kernel puts its paths in order.
    fn is_in_step(&self, queues: &Queues) -> bool {
        let first = self.inside.start;
        let leads_on =
            |(at, chain): (usize, &'a Chain)| self.led_to_inside(chain).all(|place| place > at || place == first);
        let keeps_order = |(at, chain): (usize, &Chain)| at == first || !queues.is_ordered(&chain.entry);
        self.inside().all(leads_on)
            && self.inside().all(keeps_order)
            && self.outside().all(|chain| self.led_to_inside(chain).all(|place| place == first))
    }

    fn traffic(&self, entry: &str) -> Option<&'a KernelTraffic> {
        self.liveness.kernels.get(entry)
    }

    /// Whether records of these leaves may move: what leaves the loop, and what goes elsewhere from a kernel that leads to its first
    /// stage, does not need them.
    fn may_move(&self, leaves: &BTreeSet<&Leaf>) -> bool {
        let needs = |entry: &String| self.traffic(entry).is_some_and(|traffic| any(leaves, &traffic.live_in));
        let leaves_loop =
            |entry: &&String| !self.fusion.queued.get_index_of(*entry).is_some_and(|at| self.inside.contains(&at));
        let left_for = self.inside().flat_map(|(_, chain)| &chain.feeds).filter(leaves_loop);
        let chains = self.inside().map(|(_, chain)| chain).chain(self.outside());
        let moving = chains.filter(|chain| chain.feeds.contains(self.first));
        let else_for = moving.flat_map(|chain| &chain.feeds).filter(|fed| *fed != self.first);
        !left_for.chain(else_for).any(needs)
    }

    /// Whether kernels outside find these leaves by slot, and not only move them into the loop.
    fn is_used_by_slot(&self, leaves: &BTreeSet<&Leaf>) -> bool {
        let uses = |chain: &Chain| {
            let Some(traffic) = self.traffic(&chain.entry) else { return false };
            let moves = chain.feeds.contains(self.first);
            any(leaves, &traffic.loads) || any(leaves, if moves { &traffic.live_in } else { &traffic.stores })
        };
        self.outside().any(uses)
    }
}

/// Whether some of these leaves are in a set.
fn any(leaves: &BTreeSet<&Leaf>, set: &BTreeSet<Leaf>) -> bool {
    set.iter().any(|leaf| leaves.contains(leaf))
}
