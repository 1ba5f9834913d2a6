//! What lives from one kernel to the next, backwards over the graph of stages.

use super::{Leaf, StageFacts};
use indexmap::IndexMap;
use std::collections::{BTreeMap, BTreeSet};

/// Stages and the ways between them.
#[derive(Clone, Debug)]
pub struct Flow {
    /// Stages by name.
    pub stages: IndexMap<String, FlowStage>,
    /// The stage that a path slot begins with; its state is garbage then.
    pub start: String,
}

/// A stage of a flow.
#[derive(Clone, Debug)]
pub struct FlowStage {
    /// What it does.
    pub facts: StageFacts,
    /// The stages its returned outcomes lead to; `end` left out.
    pub next: Vec<String>,
    /// Whether it traces the rays of walks.
    pub traces: bool,
}

/// What has to be kept between kernels.
#[derive(Clone, Debug, Default)]
pub struct Liveness {
    /// Traffic of every stage, as a kernel of its own.
    pub kernels: IndexMap<String, KernelTraffic>,
    /// Leaves that some kernel loads or stores.
    pub stored: BTreeSet<Leaf>,
    /// Leaves that stages write but no kernel has to store, with the reason: one line.
    pub dead: BTreeMap<Leaf, String>,
    /// Stored leaves that are rays in flight: they live on the way into or out of kernels that trace and use them, and nowhere else.
    pub in_flight: BTreeSet<Leaf>,
}

/// What a kernel moves, and what lives around it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KernelTraffic {
    /// Leaves it loads: reads ∪ (maybe ∩ live_out).
    pub loads: BTreeSet<Leaf>,
    /// Leaves it stores: (writes ∪ maybe) ∩ live_out.
    pub stores: BTreeSet<Leaf>,
    /// Leaves whose value on entry may be used, here or later. In `start`: used without ever having been written.
    pub live_in: BTreeSet<Leaf>,
    /// Leaves whose value on exit may be used later.
    pub live_out: BTreeSet<Leaf>,
}

/// Solves live_in = reads ∪ (live_out − writes) and live_out = ⋃ live_in of what follows, by the least fixpoint.
pub fn liveness(flow: &Flow) -> Liveness {
    let mut kernels: IndexMap<String, KernelTraffic> =
        flow.stages.keys().map(|name| (name.clone(), KernelTraffic::default())).collect();
    let mut changed = true;
    while changed {
        changed = false;
        for (name, stage) in flow.stages.iter().rev() {
            let traffic = traffic(stage, &kernels);
            changed |= kernels.get(name) != Some(&traffic);
            kernels.insert(name.clone(), traffic);
        }
    }
    let stored: BTreeSet<Leaf> =
        kernels.values().flat_map(|traffic| traffic.loads.iter().chain(&traffic.stores)).cloned().collect();
    let dead = dead(flow, &stored);
    let in_flight = stored.iter().filter(|leaf| is_in_flight(flow, &kernels, leaf)).cloned().collect();
    Liveness { kernels, stored, dead, in_flight }
}

fn is_in_flight(flow: &Flow, kernels: &IndexMap<String, KernelTraffic>, leaf: &Leaf) -> bool {
    let traces = |name: &String| {
        let traffic = &kernels[name];
        flow.stages[name].traces && (traffic.loads.contains(leaf) || traffic.stores.contains(leaf))
    };
    let needs = |name: &&String| kernels.get(*name).is_some_and(|traffic| traffic.live_in.contains(leaf));
    let lives_on = kernels.iter().filter(|(_, traffic)| traffic.live_out.contains(leaf)).map(|(name, _)| name);
    lives_on.into_iter().all(|name| traces(name) || flow.stages[name].next.iter().filter(needs).all(traces))
}

fn traffic(stage: &FlowStage, kernels: &IndexMap<String, KernelTraffic>) -> KernelTraffic {
    let facts = &stage.facts;
    let following = stage.next.iter().filter_map(|next| kernels.get(next));
    let live_out: BTreeSet<Leaf> = following.flat_map(|kernel| kernel.live_in.iter().cloned()).collect();
    let passing = live_out.iter().filter(|leaf| !facts.writes.contains_key(leaf));
    let merged = facts.maybe.keys().filter(|leaf| live_out.contains(leaf));
    let written = facts.writes.keys().chain(facts.maybe.keys());
    KernelTraffic {
        loads: facts.reads.keys().chain(merged).cloned().collect(),
        stores: written.filter(|leaf| live_out.contains(leaf)).cloned().collect(),
        live_in: facts.reads.keys().chain(passing).cloned().collect(),
        live_out,
    }
}

fn dead(flow: &Flow, stored: &BTreeSet<Leaf>) -> BTreeMap<Leaf, String> {
    let mut dead = BTreeMap::new();
    for (name, stage) in &flow.stages {
        for leaf in stage.facts.writes.keys().chain(stage.facts.maybe.keys()) {
            if !stored.contains(leaf) {
                let reason = format!("written by `{name}`, read by no later stage before it is written again");
                dead.entry(leaf.clone()).or_insert(reason);
            }
        }
    }
    dead
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::{FileId, Span};

    fn leaf(name: &str) -> Leaf {
        Leaf { instance: "walk".into(), field: name.into(), member: None }
    }

    fn set(names: &str) -> BTreeSet<Leaf> {
        names.split_whitespace().map(leaf).collect()
    }

    fn stage(reads: &str, writes: &str, maybe: &str, next: &[&str]) -> FlowStage {
        let span = Span { file: FileId(0), start: 0, end: 0 };
        let map = |names: &str| set(names).into_iter().map(|leaf| (leaf, span)).collect();
        let facts = StageFacts { reads: map(reads), writes: map(writes), maybe: map(maybe), ..StageFacts::default() };
        FlowStage { facts, next: next.iter().map(|name| name.to_string()).collect(), traces: false }
    }

    fn solve(stages: &[(&str, FlowStage)]) -> Liveness {
        let stages: IndexMap<String, FlowStage> =
            stages.iter().map(|(name, stage)| (name.to_string(), stage.clone())).collect();
        liveness(&Flow { start: "start".into(), stages })
    }

    #[test]
    fn values_live_until_they_are_written_again() {
        let found = solve(&[
            ("start", stage("", "a b scratch", "", &["trace"])),
            ("trace", stage("a", "hit", "", &["shade"])),
            ("shade", stage("a b hit", "a", "b", &["trace"])),
        ]);
        let trace = &found.kernels["trace"];
        assert_eq!(trace.loads, set("a"));
        assert_eq!(trace.stores, set("hit"));
        assert_eq!(trace.live_in, set("a b"));
        assert_eq!(trace.live_out, set("a b hit"));
        assert_eq!(found.kernels["shade"].stores, set("a b"));
        assert_eq!(found.kernels["start"].live_in, set(""));
        assert_eq!(found.stored, set("a b hit"));
        assert_eq!(found.dead.keys().cloned().collect::<BTreeSet<_>>(), set("scratch"));
    }

    #[test]
    fn what_is_perhaps_written_is_loaded_to_be_kept() {
        let found = solve(&[("start", stage("", "", "a b", &["last"])), ("last", stage("a", "", "", &[]))]);
        assert_eq!(found.kernels["start"].loads, set("a"));
        assert_eq!(found.kernels["start"].stores, set("a"));
        assert_eq!(found.kernels["start"].live_in, set("a"), "read before it was ever written");
        assert_eq!(found.dead.keys().cloned().collect::<BTreeSet<_>>(), set("b"));
    }
}
