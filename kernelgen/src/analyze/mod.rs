//! What a stage does, found from naga's IR of its linked text: which leaves it reads before it surely writes them, which it surely or
//! perhaps writes, which outcomes it returns, which streams it pushes to; and from that, what lives across kernel boundaries.

mod access;
mod constant;
mod liveness;
mod parse;
mod place;
mod state;
#[cfg(test)]
mod tests;
mod uses;
mod walk;

pub use access::stage_facts;
pub use liveness::{Flow, FlowStage, KernelTraffic, Liveness, liveness};
pub use parse::{parse, validate};

use crate::link::Linked;
use crate::source::Span;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// A part of the state that is read and written as one: instance, field, and the member of a hit.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Leaf {
    /// Instance, `eye`; in `StageFacts` the instance, not the parameter's name.
    pub instance: String,
    /// Field, `hit`.
    pub field: String,
    /// Member of a hit, `prim`.
    pub member: Option<String>,
}

impl fmt::Display for Leaf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.instance, self.field)?;
        match &self.member {
            Some(member) => write!(f, ".{member}"),
            None => Ok(()),
        }
    }
}

/// What a stage (or a stream's consumer) does to the leaves of its pointer parameters.
#[derive(Clone, Debug, Default)]
pub struct StageFacts {
    /// Read before surely written, with one place where.
    pub reads: BTreeMap<Leaf, Span>,
    /// Surely written on every return.
    pub writes: BTreeMap<Leaf, Span>,
    /// Written on some way only.
    pub maybe: BTreeMap<Leaf, Span>,
    /// Copies: leaves that on every return hold what another leaf held on entry, and that leaf.
    pub copies: BTreeMap<Leaf, Leaf>,
    /// Sources of copies that are read for nothing else, and whose copies are not read again.
    pub only_copied: BTreeSet<Leaf>,
    /// Outcome names (lower case) that reach a return, with the place of one such return.
    pub outcomes: BTreeMap<String, Span>,
    /// What is surely written where an outcome is returned: more than `writes` where other returns write less.
    pub written_by_outcome: BTreeMap<String, BTreeSet<Leaf>>,
    /// Most pushes of one invocation to each stream (calls of `push_<stream>`; in a loop: `None`).
    pub pushes: BTreeMap<String, Option<u32>>,
    /// Parameter names in order, with the record type's name.
    pub params: Vec<(String, String)>,
    /// Names of the globals (bindings) that live code uses.
    pub globals: BTreeSet<String>,
}

impl StageFacts {
    /// What is surely written when one of these outcomes has been returned.
    pub fn written_with(&self, outcomes: impl IntoIterator<Item = String>) -> BTreeSet<Leaf> {
        let written = outcomes.into_iter().filter_map(|outcome| self.written_by_outcome.get(&outcome).cloned());
        written.reduce(|left, right| left.intersection(&right).cloned().collect()).unwrap_or_default()
    }
}

/// The author's place of something in linked text.
fn place_of(span: naga::Span, linked: &Linked) -> Span {
    let range = span.to_range().unwrap_or(0..0);
    linked.map.span(range.start, range.end)
}
