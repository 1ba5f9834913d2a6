//! What lives from one kernel to the next, backwards over the graph of stages.

use super::{Leaf, StageFacts};
use crate::source::Span;
use indexmap::IndexMap;
use std::collections::{BTreeMap, BTreeSet};

/// Stages and the ways between them.
#[derive(Clone, Debug)]
pub struct Flow {
    /// Stages by name.
    pub stages: IndexMap<String, FlowStage>,
    /// The stages of each kernel, by the one that it begins with. A way from one of them to another stays inside.
    pub kernels: IndexMap<String, BTreeSet<String>>,
}

/// A stage of a flow.
#[derive(Clone, Debug)]
pub struct FlowStage {
    /// What it does.
    pub facts: StageFacts,
    /// Leaves that the key of the paths which wait for it depends on, with one place where: a kernel before its own reads them.
    pub key: BTreeMap<Leaf, Span>,
    /// The stages its returned outcomes lead to, `end` left out, and what it has surely written when it leads there.
    pub next: IndexMap<String, BTreeSet<Leaf>>,
    /// Whether it traces the rays of walks.
    pub traces: bool,
}

/// What has to be kept between kernels.
#[derive(Clone, Debug, Default)]
pub struct Liveness {
    /// Traffic of every kernel, by the stage that it begins with.
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
    /// Leaves it loads: those that one of its stages may read before another surely wrote them, and those that it stores without
    /// having surely written them.
    pub loads: BTreeSet<Leaf>,
    /// Leaves it stores: written, surely or perhaps, and live out.
    pub stores: BTreeSet<Leaf>,
    /// Leaves whose value on entry may be used, here or later. In the start stage: used without ever having been written.
    pub live_in: BTreeSet<Leaf>,
    /// Leaves whose value on exit may be used later.
    pub live_out: BTreeSet<Leaf>,
    /// Where it is the kernel of one stage: stored leaves that are copies (see `StageFacts::copies`), and of what.
    pub copies: BTreeMap<Leaf, Leaf>,
    /// Where it is the kernel of one stage: leaves that are needed for copies alone (see `StageFacts::only_copied`).
    pub only_copied: BTreeSet<Leaf>,
}

/// Leaves by stage.
type ByStage<'a> = BTreeMap<&'a str, BTreeSet<Leaf>>;

/// What lives around kernels. Which stages share a kernel does not change what lives before a stage, only what has to be in memory.
pub fn liveness(flow: &Flow) -> Liveness {
    let live = live_before(flow);
    let traffic = |(entry, stages): (&String, &BTreeSet<String>)| {
        let kernel = KernelFlow { flow, entry, stages };
        (entry.clone(), kernel.traffic(&live))
    };
    let kernels: IndexMap<String, KernelTraffic> = flow.kernels.iter().map(traffic).collect();
    let stored: BTreeSet<Leaf> =
        kernels.values().flat_map(|traffic| traffic.loads.iter().chain(&traffic.stores)).cloned().collect();
    let dead = dead(flow, &live);
    let in_flight = stored.iter().filter(|leaf| is_in_flight(flow, &live, leaf)).cloned().collect();
    Liveness { kernels, stored, dead, in_flight }
}

/// Whether every way on which the leaf lives leads into or out of a stage that traces and uses it.
fn is_in_flight(flow: &Flow, live: &ByStage<'_>, leaf: &Leaf) -> bool {
    let lives = |next: &str| live.get(next).is_some_and(|live| live.contains(leaf));
    let traces = |stage: &str| flow.stages.get(stage).is_some_and(|stage| stage.traces && uses(stage, leaf));
    let ways = flow.stages.iter().flat_map(|(name, stage)| stage.next.keys().map(move |next| (name, next)));
    ways.filter(|(_, next)| lives(next)).all(|(name, next)| traces(name) || traces(next))
}

fn uses(stage: &FlowStage, leaf: &Leaf) -> bool {
    stage.facts.reads.contains_key(leaf)
        || stage.key.contains_key(leaf)
        || written(stage).any(|written| written == leaf)
}

/// What lives before each stage: solves live_in = reads ∪ ⋃ (live_in of what follows − what is written on the way there), by the least
/// fixpoint.
fn live_before(flow: &Flow) -> ByStage<'_> {
    backwards(flow, |_| true, |stage| stage.facts.reads.keys().chain(stage.key.keys()).collect())
}

/// As `live_before`, over those stages and ways that `inside` keeps: what is read there before it is surely written. `reads` says what
/// a stage reads.
fn backwards<'a>(
    flow: &'a Flow,
    inside: impl Fn(&str) -> bool,
    reads: impl Fn(&FlowStage) -> Vec<&Leaf>,
) -> ByStage<'a> {
    let mut live: ByStage<'a> = BTreeMap::new();
    let mut changed = true;
    while changed {
        changed = false;
        for (name, stage) in flow.stages.iter().rev().filter(|(name, _)| inside(name)) {
            let following = stage.next.iter().filter(|(next, _)| inside(next));
            let following = following.filter_map(|(next, written)| Some((live.get(next.as_str())?, written)));
            let passing = following.flat_map(|(live, written)| live.difference(written));
            let before: BTreeSet<Leaf> = reads(stage).into_iter().chain(passing).cloned().collect();
            changed |= live.get(name.as_str()) != Some(&before);
            live.insert(name, before);
        }
    }
    live
}

/// A kernel in a flow.
struct KernelFlow<'a> {
    flow: &'a Flow,
    entry: &'a str,
    stages: &'a BTreeSet<String>,
}

impl<'a> KernelFlow<'a> {
    fn inside(&self) -> impl Iterator<Item = (&'a str, &'a FlowStage)> + use<'a> {
        let (flow, stages) = (self.flow, self.stages);
        flow.stages.iter().filter(|(name, _)| stages.contains(*name)).map(|(name, stage)| (name.as_str(), stage))
    }

    fn traffic(&self, live: &ByStage<'_>) -> KernelTraffic {
        let written: BTreeSet<&Leaf> = self.inside().flat_map(|(_, stage)| written(stage)).collect();
        let sure = self.surely_written();
        let read = backwards(self.flow, |name| self.stages.contains(name), |stage| stage.facts.reads.keys().collect());
        let mut traffic = KernelTraffic {
            loads: read.get(self.entry).cloned().unwrap_or_default(),
            live_in: live.get(self.entry).cloned().unwrap_or_default(),
            ..KernelTraffic::default()
        };
        for (name, stage) in self.inside() {
            let before = sure.get(name);
            let is_sure = |leaf: &Leaf| before.is_some_and(|sure| sure.contains(leaf));
            for (next, on_the_way) in stage.next.iter().filter(|(next, _)| !self.stages.contains(*next)) {
                for leaf in live.get(next.as_str()).into_iter().flatten() {
                    if written.contains(leaf) {
                        traffic.stores.insert(leaf.clone());
                    }
                    if written.contains(leaf) && !is_sure(leaf) && !on_the_way.contains(leaf) {
                        traffic.loads.insert(leaf.clone());
                    }
                    traffic.live_out.insert(leaf.clone());
                }
            }
        }
        self.add_copies(&mut traffic);
        traffic
    }

    /// What several stages copy among each other is not followed: a way may leave some of them out.
    fn add_copies(&self, traffic: &mut KernelTraffic) {
        let inside: Vec<(&str, &FlowStage)> = self.inside().collect();
        let [(_, FlowStage { facts, .. })] = inside[..] else { return };
        let stored = facts.copies.iter().filter(|(copy, _)| traffic.stores.contains(*copy));
        traffic.copies = stored.map(|(copy, source)| (copy.clone(), source.clone())).collect();
        traffic.only_copied = facts.only_copied.clone();
    }

    /// What every way from the entry has surely written when a stage begins, by the greatest fixpoint: ways that meet, also those of
    /// a loop, keep what all of them wrote.
    fn surely_written(&self) -> ByStage<'a> {
        let mut before: ByStage<'a> = BTreeMap::from([(self.entry, BTreeSet::new())]);
        let mut changed = true;
        while changed {
            changed = false;
            for (name, stage) in self.inside() {
                let Some(sure) = before.get(name).cloned() else { continue };
                for (next, on_the_way) in stage.next.iter().filter(|(next, _)| self.stages.contains(*next)) {
                    let sure: BTreeSet<Leaf> = sure.union(on_the_way).cloned().collect();
                    let known = before.entry(next).or_insert_with(|| {
                        changed = true;
                        sure.clone()
                    });
                    let count = known.len();
                    known.retain(|leaf| sure.contains(leaf));
                    changed |= known.len() < count;
                }
            }
        }
        before
    }
}

/// Leaves that a stage writes, surely or perhaps.
fn written(stage: &FlowStage) -> impl Iterator<Item = &Leaf> {
    stage.facts.writes.keys().chain(stage.facts.maybe.keys())
}

/// What is written and lives nowhere: a leaf that lives before some stage is either stored or lives within one kernel.
fn dead(flow: &Flow, live: &ByStage<'_>) -> BTreeMap<Leaf, String> {
    let mut dead = BTreeMap::new();
    for (name, stage) in &flow.stages {
        for leaf in written(stage).filter(|leaf| !live.values().any(|live| live.contains(leaf))) {
            let reason = format!("written by `{name}`, read by no later stage before it is written again");
            dead.entry(leaf.clone()).or_insert(reason);
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
        let next = next.iter().map(|name| (name.to_string(), set(writes))).collect();
        FlowStage { facts, key: BTreeMap::new(), next, traces: false }
    }

    /// Every stage a kernel of its own.
    fn solve(stages: &[(&str, FlowStage)]) -> Liveness {
        let kernels: Vec<(&str, &[&str])> =
            stages.iter().map(|(name, _)| (*name, std::slice::from_ref(name))).collect();
        solve_fused(stages, &kernels)
    }

    fn solve_fused(stages: &[(&str, FlowStage)], kernels: &[(&str, &[&str])]) -> Liveness {
        let stages: IndexMap<String, FlowStage> =
            stages.iter().map(|(name, stage)| (name.to_string(), stage.clone())).collect();
        let names = |names: &[&str]| names.iter().map(|name| name.to_string()).collect();
        let kernels = kernels.iter().map(|(entry, stages)| (entry.to_string(), names(stages)));
        liveness(&Flow { kernels: kernels.collect(), stages })
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

    /// A walk: `trace` and `shade` follow each other, then `next` goes on.
    fn walk() -> [(&'static str, FlowStage); 4] {
        [
            ("start", stage("", "ray flux other", "", &["trace"])),
            ("trace", stage("ray", "hit", "", &["shade"])),
            ("shade", stage("hit ray flux", "ray", "flux", &["trace", "next"])),
            ("next", stage("flux other", "", "", &[])),
        ]
    }

    #[test]
    fn what_lives_within_a_kernel_is_not_stored() {
        let found = solve_fused(&walk(), &[("start", &["start"]), ("trace", &["trace", "shade"]), ("next", &["next"])]);
        let trace = &found.kernels["trace"];
        assert_eq!(trace.loads, set("ray flux"), "the hit is written before it is read");
        assert_eq!(trace.stores, set("flux"), "the ray is over when the walk is");
        assert_eq!(trace.live_in, set("ray flux other"));
        assert_eq!(trace.live_out, set("flux other"));
        assert_eq!(found.stored, set("ray flux other"));
        assert!(found.dead.is_empty(), "the hit is used: {:?}", found.dead);
        let all = solve_fused(&walk(), &[("start", &["start", "trace", "shade", "next"])]);
        assert_eq!((all.stored, all.kernels["start"].live_in.clone()), (set(""), set("")));
    }

    /// `shade` writes the ray where it sends it on, and elsewhere nobody needs it: it is not kept while the hit is.
    #[test]
    fn what_is_written_on_the_way_need_not_be_kept() {
        let mut stages = [
            ("start", stage("", "ray", "", &["trace"])),
            ("trace", stage("ray", "hit", "", &["shade"])),
            ("shade", stage("hit", "", "ray", &["trace", "last"])),
            ("last", stage("", "", "", &[])),
        ];
        stages[1].1.traces = true;
        let kept = &solve(&stages).kernels;
        assert_eq!((kept["shade"].loads.clone(), kept["trace"].live_out.clone()), (set("hit ray"), set("hit ray")));
        stages[2].1.next.insert("trace".into(), set("ray"));
        let found = solve(&stages);
        let shade = &found.kernels["shade"];
        assert_eq!((shade.loads.clone(), shade.stores.clone()), (set("hit"), set("ray")));
        assert_eq!(found.kernels["trace"].live_out, set("hit"));
        assert_eq!(found.in_flight, set("hit ray"));
    }

    /// `shade` is sorted by the hit, which it does not read itself: it is kept for the key, and not loaded again.
    #[test]
    fn what_a_key_reads_lives_until_then() {
        let mut stages = [
            ("start", stage("", "ray", "", &["trace"])),
            ("trace", stage("ray", "hit", "", &["shade"])),
            ("shade", stage("ray", "ray", "", &["trace"])),
        ];
        assert!(solve(&stages).dead.contains_key(&leaf("hit")));
        stages[2].1.key = [(leaf("hit"), Span { file: FileId(0), start: 0, end: 0 })].into();
        let found = solve(&stages);
        assert_eq!((found.kernels["trace"].stores.clone(), found.stored), (set("hit"), set("hit ray")));
        assert_eq!(found.kernels["shade"].loads, set("ray"));
        assert_eq!(found.kernels["shade"].live_in, set("hit ray"));
        assert!(found.dead.is_empty());
    }

    /// Only `shade` has written `flux` for sure, and only if the path went through it.
    #[test]
    fn a_write_on_some_ways_through_a_kernel_is_merged() {
        let stages = [
            ("start", stage("", "flux", "", &["trace"])),
            ("trace", stage("", "", "", &["shade", "last"])),
            ("shade", stage("", "flux", "", &["last"])),
            ("last", stage("flux", "", "", &[])),
        ];
        let found = solve_fused(&stages, &[("start", &["start"]), ("trace", &["trace", "shade"]), ("last", &["last"])]);
        assert_eq!(found.kernels["trace"].loads, set("flux"));
        assert_eq!(found.kernels["trace"].stores, set("flux"));
        let mut sure = stages;
        sure[1].1.next = [("shade".to_string(), set(""))].into();
        let found = solve_fused(&sure, &[("start", &["start"]), ("trace", &["trace", "shade"]), ("last", &["last"])]);
        assert_eq!(found.kernels["trace"].loads, set(""));
        assert_eq!(found.kernels["trace"].stores, set("flux"));
        assert_eq!(found.stored, set("flux"));
    }

    /// The second time round, `a` was written in the loop; the first time it was not.
    #[test]
    fn the_ways_round_a_loop_meet_its_beginning() {
        let stages = [
            ("start", stage("", "a b", "", &["head"])),
            ("head", stage("a", "", "b", &["tail"])),
            ("tail", stage("", "a", "", &["head", "last"])),
            ("last", stage("a b", "", "", &[])),
        ];
        let found = solve_fused(&stages, &[("start", &["start"]), ("head", &["head", "tail"]), ("last", &["last"])]);
        assert_eq!(found.kernels["head"].loads, set("a b"), "b is stored, though perhaps never written");
        assert_eq!(found.kernels["head"].stores, set("a b"));
        let from_tail = solve_fused(&stages, &[("tail", &["head", "tail"])]);
        assert_eq!(
            from_tail.kernels["tail"].loads,
            set("b"),
            "whoever begins behind `head` has written a when it comes there"
        );
    }
}
