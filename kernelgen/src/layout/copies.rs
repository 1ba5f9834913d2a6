//! Copies that need not be made: the leaf that a stage copies to lies where the one lay that it copies from.

use super::interference::interfere;
use super::{Placement, StateLeaf};
use crate::analyze::{KernelTraffic, Leaf, Liveness};
use std::collections::{BTreeMap, BTreeSet};

/// Leaves that have one place: most are alone.
pub(super) type Class<'a> = Vec<&'a StateLeaf>;

/// Every leaf for itself.
pub(super) fn alone<'a>(leaves: &[&'a StateLeaf]) -> Vec<Class<'a>> {
    leaves.iter().map(|leaf| vec![*leaf]).collect()
}

/// Copies together with their sources, where these never live together.
pub(super) fn coalesced<'a>(leaves: &[&'a StateLeaf], liveness: &Liveness) -> Vec<Class<'a>> {
    let mut classes = alone(leaves);
    for (copy, source) in liveness.kernels.values().flat_map(|traffic| &traffic.copies) {
        let class = |leaf: &Leaf| classes.iter().position(|class| class.iter().any(|member| member.leaf == *leaf));
        let (Some(copy), Some(source)) = (class(copy), class(source)) else { continue };
        if copy != source && may_join(&classes[copy], &classes[source], liveness) {
            let later = classes.remove(copy.max(source));
            classes[copy.min(source)].extend(later);
        }
    }
    classes
}

fn may_join(left: &Class<'_>, right: &Class<'_>, liveness: &Liveness) -> bool {
    let fit = |a: &StateLeaf, b: &StateLeaf| have_one_form(a, b) && !interfere(&a.leaf, &b.leaf, liveness);
    left.iter().all(|a| right.iter().all(|b| fit(a, b)))
}

/// Whether the same bits mean the same value.
fn have_one_form(a: &StateLeaf, b: &StateLeaf) -> bool {
    (a.ty, a.bits, &a.codec) == (b.ty, b.bits, &b.codec)
}

/// What a kernel is spared because copies lie where their sources lay.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InPlace {
    /// Leaves that it need not store, and what they are copies of.
    pub copies: BTreeMap<Leaf, Leaf>,
    /// Leaves that it need not load.
    pub sources: BTreeSet<Leaf>,
}

impl Placement {
    /// The copies of a kernel that are in place.
    pub fn in_place(&self, traffic: &KernelTraffic) -> InPlace {
        let copies: BTreeMap<Leaf, Leaf> = traffic
            .copies
            .iter()
            .filter(|(copy, source)| self.have_one_place(copy, source))
            .map(|(copy, source)| (copy.clone(), source.clone()))
            .collect();
        let needed =
            |source: &Leaf| traffic.copies.iter().any(|(copy, from)| from == source && !copies.contains_key(copy));
        let sources = copies.values().filter(|source| traffic.only_copied.contains(*source) && !needed(source));
        InPlace { sources: sources.cloned().collect(), copies }
    }

    fn have_one_place(&self, a: &Leaf, b: &Leaf) -> bool {
        let one_form = self.leaves.get(a).zip(self.leaves.get(b)).is_some_and(|(a, b)| have_one_form(a, b));
        one_form && self.slots.get(a).is_some_and(|slot| self.slots.get(b) == Some(slot))
    }
}

impl InPlace {
    /// What is left to move.
    pub fn spare(&self, traffic: &KernelTraffic) -> KernelTraffic {
        KernelTraffic {
            loads: traffic.loads.difference(&self.sources).cloned().collect(),
            stores: traffic.stores.iter().filter(|leaf| !self.copies.contains_key(*leaf)).cloned().collect(),
            ..traffic.clone()
        }
    }
}
