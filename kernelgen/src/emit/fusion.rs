//! Which stages share a kernel.
//!
//! The schedule divides the stages into groups. A kernel begins at one stage of a group, its entry, and also runs all stages of the
//! group that a path reaches from there without leaving it. A stage that other groups lead to is the entry of a kernel of its own,
//! with a queue of its own: where a path begins is known from the queue that it waited in. Ways inside a group need no queue.

use super::wiring::WiredStage;
use crate::config::model::{Fuse, RayKind, Schedule};
use indexmap::{IndexMap, IndexSet};
use std::collections::BTreeSet;
use std::ops::Range;

/// All kernels of stages.
#[derive(Clone, Debug, Default)]
pub(super) struct Fusion {
    /// The kernel that takes every slot in use, at the start of a pass.
    pub start: Chain,
    /// The kernels that take paths from queues, by entry, in the order of the pipeline: that in which a round runs them.
    pub queued: IndexMap<String, Chain>,
}

/// The stages of a kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Chain {
    /// The stage that it begins with.
    pub entry: String,
    /// All its stages in the order of the pipeline; a start stage that nothing leads to is the first.
    pub stages: IndexSet<String>,
    /// Stages of other groups that it leads to.
    pub exits: IndexSet<String>,
    /// Stages whose queues it fills: the exits, and the start where slots take new paths.
    pub feeds: IndexSet<String>,
    /// Whether a path may be over in it.
    pub ends: bool,
    /// Whether a way inside leads back: to an earlier stage of the order.
    pub loops: bool,
}

impl Chain {
    /// Whether it has more than one stage.
    pub(super) fn is_fused(&self) -> bool {
        self.stages.len() > 1
    }
}

impl Fusion {
    /// Divides these stages, all that the start reaches.
    pub(super) fn new(stages: &IndexMap<String, WiredStage>, start: &str, schedule: &Schedule) -> Fusion {
        let groups = Groups::new(stages, &schedule.fuse.value);
        let regenerates = schedule.regenerate.value > 1;
        let chain = |entry: &str| {
            let mut chain = groups.chain(stages, start, entry);
            if regenerates && chain.ends {
                chain.feeds.insert(start.to_owned());
            }
            chain
        };
        let fed = |name: &str| {
            let leads = |(from, stage): (&String, &WiredStage)| !groups.together(from, name) && stage.leads_to(name);
            stages.iter().any(leads)
        };
        let queued = stages.keys().filter(|name| fed(name) || (regenerates && *name == start));
        Fusion { start: chain(start), queued: queued.map(|name| (name.clone(), chain(name))).collect() }
    }

    /// How many of these kernels that take paths from queues lead to this one.
    pub(super) fn feeders(&self, entry: &str, among: Range<usize>) -> usize {
        let leads = |(place, chain): &(usize, &Chain)| among.contains(place) && chain.feeds.contains(entry);
        self.queued.values().enumerate().filter(leads).count()
    }

    /// Whether a path may need another round: a kernel of the loop leads to one that the round has run by then.
    pub(super) fn is_repeated(&self) -> bool {
        self.first_led_back_to() < self.queued.len()
    }

    /// The first of the kernels that others lead back to which the round has run by then; behind the last, if there is none.
    pub(super) fn first_led_back_to(&self) -> usize {
        let back = |(place, chain): (usize, &Chain)| {
            let places = chain.feeds.iter().filter_map(|fed| self.queued.get_index_of(fed));
            places.filter(|fed| *fed <= place).min()
        };
        self.queued.values().enumerate().filter_map(back).min().unwrap_or(self.queued.len())
    }

    /// The stages of each kernel, by entry, in the order of these names.
    pub(super) fn kernels<'a>(&self, order: impl Iterator<Item = &'a String>) -> IndexMap<String, BTreeSet<String>> {
        let chain = |name: &String| match self.queued.get(name) {
            None if self.start.entry != *name => None,
            queued => Some(queued.unwrap_or(&self.start)),
        };
        let kernels = order.filter_map(|name| Some((name.clone(), chain(name)?.stages.iter().cloned().collect())));
        kernels.collect()
    }
}

/// Groups of stages; a stage in none is a group of its own.
struct Groups(Vec<BTreeSet<String>>);

impl Groups {
    fn new(stages: &IndexMap<String, WiredStage>, fuse: &Fuse) -> Groups {
        match fuse {
            Fuse::All => Groups(vec![stages.keys().cloned().collect()]),
            Fuse::Groups(groups) => {
                let names = groups.iter().map(|group| group.iter().map(|name| name.value.clone()).collect());
                Groups(names.collect())
            }
            Fuse::Walks => {
                let mut groups = Groups(Vec::new());
                for (name, stage) in stages.iter().filter(|(_, stage)| stage.rays == Some(RayKind::Walk)) {
                    groups.join(stage.targets().chain([name.as_str()]).map(str::to_owned).collect());
                }
                groups
            }
        }
    }

    /// Adds a group; those that share a stage with it become one with it.
    fn join(&mut self, mut group: BTreeSet<String>) {
        let (meeting, apart) = self.0.drain(..).partition::<Vec<_>, _>(|other| !other.is_disjoint(&group));
        group.extend(meeting.into_iter().flatten());
        self.0 = apart;
        self.0.push(group);
    }

    fn together(&self, a: &str, b: &str) -> bool {
        a == b || self.0.iter().any(|group| group.contains(a) && group.contains(b))
    }

    fn chain(&self, stages: &IndexMap<String, WiredStage>, start: &str, entry: &str) -> Chain {
        let mut reached = IndexSet::from([entry]);
        let mut exits = IndexSet::new();
        let mut next = 0;
        while let Some(&name) = reached.get_index(next) {
            for target in stages.get(name).into_iter().flat_map(WiredStage::targets) {
                if self.together(entry, target) {
                    reached.insert(target);
                } else {
                    exits.insert(target.to_owned());
                }
            }
            next += 1;
        }
        let led_to = |name: &str| stages.values().any(|stage| stage.leads_to(name));
        let first = |name: &&str| *name == start && !led_to(start);
        reached.sort_by_key(|name| (!first(name), stages.get_index_of(*name)));
        let back = |(place, name): (usize, &&str)| {
            let mut targets = stages.get(*name).into_iter().flat_map(WiredStage::targets);
            targets.any(|target| reached.get_index_of(target).is_some_and(|to| to <= place))
        };
        Chain {
            entry: entry.to_owned(),
            loops: reached.iter().enumerate().any(back),
            ends: reached.iter().any(|name| stages.get(*name).is_some_and(WiredStage::may_end)),
            stages: reached.iter().map(|name| (*name).to_owned()).collect(),
            feeds: exits.clone(),
            exits,
        }
    }
}
