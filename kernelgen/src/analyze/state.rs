//! What holds at a point of a stage, and how it joins where ways meet.

use super::constant::Values;
use naga::{Handle, LocalVariable};
use std::collections::{BTreeMap, BTreeSet};

/// Pushes to each stream; `None` where a loop makes them uncountable.
pub(super) type Pushes = BTreeMap<String, Option<u32>>;

/// What holds at a point, whichever way led there.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct State {
    /// Leaves that were surely written.
    pub written: BTreeSet<usize>,
    /// What leaves hold that were written on some way: what that leaf held on entry to the stage, or something else. The others hold
    /// what they held on entry themselves.
    pub held: BTreeMap<usize, Option<usize>>,
    /// Local variables, by depth of calls, whose values are known.
    pub locals: BTreeMap<(usize, Handle<LocalVariable>), Values>,
    /// Most pushes so far.
    pub pushes: Pushes,
}

impl State {
    pub(super) fn join(mut self, other: State) -> State {
        self.written.retain(|leaf| other.written.contains(leaf));
        self.join_held(&other);
        let mut locals = BTreeMap::new();
        for (local, values) in self.locals {
            if let Some(others) = other.locals.get(&local)
                && let values @ Values::Known(_) = values.join(others.clone())
            {
                locals.insert(local, values);
            }
        }
        self.locals = locals;
        for (stream, count) in other.pushes {
            let known = self.pushes.entry(stream).or_insert(Some(0));
            *known = known.zip(count).map(|(left, right)| left.max(right));
        }
        self
    }

    /// Gives up on everything that still changes from one round of a loop to the next.
    pub(super) fn widen(mut self, next: &State) -> State {
        self.written.retain(|leaf| next.written.contains(leaf));
        self.join_held(next);
        self.locals.retain(|local, values| next.locals.get(local) == Some(values));
        for (stream, count) in &next.pushes {
            if self.pushes.get(stream) != Some(count) {
                self.pushes.insert(stream.clone(), None);
            }
        }
        self
    }

    /// The leaf whose value on entry a leaf holds for sure.
    pub(super) fn holds(&self, leaf: usize) -> Option<usize> {
        self.held.get(&leaf).copied().unwrap_or(Some(leaf))
    }

    /// Keeps what leaves hold on both ways.
    fn join_held(&mut self, other: &State) {
        let leaves: BTreeSet<usize> = self.held.keys().chain(other.held.keys()).copied().collect();
        let joined = |leaf| (leaf, self.holds(leaf).filter(|held| other.holds(leaf) == Some(*held)));
        self.held = leaves.into_iter().map(joined).collect();
    }

    /// Adds pushes that happen behind this point.
    pub(super) fn push(&mut self, pushes: &Pushes) {
        for (stream, count) in pushes {
            let known = self.pushes.entry(stream.clone()).or_insert(Some(0));
            *known = known.zip(*count).map(|(before, more)| before.saturating_add(more));
        }
    }
}

/// Joins ways of which either may not exist.
pub(super) fn join(left: Option<State>, right: Option<State>) -> Option<State> {
    match (left, right) {
        (Some(left), Some(right)) => Some(left.join(right)),
        (left, right) => left.or(right),
    }
}
