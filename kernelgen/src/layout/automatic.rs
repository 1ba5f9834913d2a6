//! Packing without a plan of the user's: as few lanes as possible, vectors whole where that costs no lane, and together what the
//! same kernels read and write. Where the layout shares, bits go to several leaves that never live together, and copies to the place
//! of their source, unless that takes more lanes.

use super::copies::{self, Class};
use super::interference::interfere;
use super::{Assigned, Bits, Slot, StateLeaf, Table};
use crate::analyze::{Leaf, Liveness};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Packs the leaves of each table; leaves of instances without a table are left out.
pub(super) fn assign(mut tables: Vec<Table>, leaves: &[StateLeaf], liveness: &Liveness, share: bool) -> Assigned {
    let rays_apart = tables.iter().any(|table| table.rays);
    let mut slots = BTreeMap::new();
    for (index, table) in tables.iter_mut().enumerate() {
        let is_own = |leaf: &&StateLeaf| {
            let apart = rays_apart && liveness.in_flight.contains(&leaf.leaf);
            apart == table.rays && table.instances.contains(&leaf.leaf.instance)
        };
        let own: Vec<&StateLeaf> = leaves.iter().filter(is_own).collect();
        let groupings = groupings(&own, liveness, share);
        let packers = groupings.iter().map(|classes| Packer::new(classes, table.lane, liveness, share));
        let packed = packers.map(|packer| (packer.pack(), packer));
        if let Some((lanes, packer)) = packed.min_by_key(|(lanes, _)| lanes.len()) {
            table.lanes = lanes.len() as u32;
            slots.extend(packer.slots(index, &lanes));
        }
    }
    (tables, slots)
}

/// The ways to group leaves into classes of one place, the best first if it takes no more lanes.
fn groupings<'a>(leaves: &[&'a StateLeaf], liveness: &Liveness, share: bool) -> Vec<Vec<Class<'a>>> {
    let coalesced = share.then(|| copies::coalesced(leaves, liveness));
    let mut groupings: Vec<_> = coalesced.into_iter().chain([copies::alone(leaves)]).collect();
    groupings.dedup();
    groupings
}

/// Which kernels load and store something: one entry a kernel and direction.
type Access = Vec<bool>;

/// Parts of a leaf that go side by side into one lane: whole words, or one part below a word.
#[derive(Clone, Copy)]
struct Piece {
    leaf: usize,
    /// The first of them.
    part: usize,
    words: u32,
    /// Of a word; 32 for whole words.
    bits: u32,
}

/// What a word holds of a piece.
#[derive(Clone, Copy)]
struct Held {
    leaf: usize,
    part: usize,
    shift: u32,
    bits: u32,
}

/// A lane while it is filled.
#[derive(Clone)]
struct Lane {
    words: Vec<Vec<Held>>,
    access: Access,
}

/// Where a piece may go.
struct Candidate {
    lane: usize,
    word: usize,
    shift: u32,
}

struct Packer<'a> {
    /// Leaves that have one place.
    classes: &'a [Class<'a>],
    /// The first of each class: it stands for all of them.
    leaves: Vec<&'a StateLeaf>,
    lane: u32,
    share: bool,
    accesses: Vec<Access>,
    /// For every two leaves: whether they cannot have a bit in common.
    conflicts: Vec<Vec<bool>>,
}

impl<'a> Packer<'a> {
    fn new(classes: &'a [Class<'a>], lane: u32, liveness: &Liveness, share: bool) -> Self {
        let meet =
            |a: &Class<'_>, b: &Class<'_>| a.iter().any(|a| b.iter().any(|b| interfere(&a.leaf, &b.leaf, liveness)));
        let conflict = |a: &Class<'_>, b: &Class<'_>| !share || a == b || meet(a, b);
        let conflicts = classes.iter().map(|a| classes.iter().map(|b| conflict(a, b)).collect()).collect();
        Packer {
            classes,
            leaves: classes.iter().map(|class| class[0]).collect(),
            lane,
            share,
            accesses: classes.iter().map(|class| access(class, liveness)).collect(),
            conflicts,
        }
    }

    /// The fewest lanes that any way of packing found; among equals the one that splits the fewest vectors.
    fn pack(&self) -> Vec<Lane> {
        let vectors = self.leaves.iter().filter(|leaf| is_vector(leaf)).count();
        let mut best: Option<Vec<Lane>> = None;
        for kept in (0..=vectors).rev() {
            for order in self.orders(&self.pieces(kept)) {
                let lanes = self.fit(&order);
                if best.as_ref().is_none_or(|best| lanes.len() < best.len()) {
                    best = Some(lanes);
                }
            }
        }
        best.unwrap_or_default()
    }

    /// Cuts leaves into pieces, in order of declaration: the first `kept` vectors as large as a lane allows, the others word by word.
    fn pieces(&self, kept: usize) -> Vec<Piece> {
        let mut pieces = Vec::new();
        let mut vectors = 0;
        for (index, leaf) in self.leaves.iter().enumerate() {
            vectors += usize::from(is_vector(leaf));
            let largest = if is_vector(leaf) && vectors <= kept { self.lane } else { 1 };
            let parts = leaf.parts();
            let mut part = 0;
            while part < parts.len() {
                let whole = parts[part..].iter().take_while(|&&bits| bits == 32).count() as u32;
                let words = largest.min(whole).max(1);
                pieces.push(Piece { leaf: index, part, words, bits: parts[part] });
                part += words as usize;
            }
        }
        pieces
    }

    /// Orders in which to place the pieces, large ones first. What many others conflict with finds room most easily at the start.
    fn orders(&self, pieces: &[Piece]) -> Vec<Vec<Piece>> {
        let mut by_size = pieces.to_vec();
        by_size.sort_by_key(|piece| Reverse(piece.words));
        if !self.share {
            return vec![by_size];
        }
        let crowd = |piece: &Piece| self.conflicts[piece.leaf].iter().filter(|conflict| **conflict).count();
        let mut by_crowd = pieces.to_vec();
        by_crowd.sort_by_key(|piece| Reverse((piece.words, piece.bits, crowd(piece))));
        let mut crowd_first = pieces.to_vec();
        crowd_first.sort_by_key(|piece| (piece.bits < 32, Reverse(crowd(piece)), Reverse((piece.words, piece.bits))));
        vec![by_size, by_crowd, crowd_first]
    }

    /// Places the pieces in turn, each where it takes the fewest new words, and there where its kernels access the lane anyway.
    fn fit(&self, pieces: &[Piece]) -> Vec<Lane> {
        let mut lanes: Vec<Lane> = Vec::new();
        for piece in pieces {
            let candidates = lanes.iter().enumerate().flat_map(|(index, lane)| self.candidates(index, lane, piece));
            let cost = |candidate: &Candidate| {
                let lane = &lanes[candidate.lane];
                let words = &lane.words[candidate.word..candidate.word + piece.words as usize];
                let new = words.iter().filter(|held| held.is_empty()).count();
                (new, added(&self.accesses[piece.leaf], &lane.access))
            };
            let found = candidates.min_by_key(cost).unwrap_or_else(|| {
                let access = vec![false; self.accesses[piece.leaf].len()];
                lanes.push(Lane { words: vec![Vec::new(); self.lane as usize], access });
                Candidate { lane: lanes.len() - 1, word: 0, shift: 0 }
            });
            let lane = &mut lanes[found.lane];
            for word in 0..piece.words as usize {
                let held = Held { leaf: piece.leaf, part: piece.part + word, shift: found.shift, bits: piece.bits };
                lane.words[found.word + word].push(held);
            }
            merge(&mut lane.access, &self.accesses[piece.leaf]);
        }
        lanes
    }

    /// The places in a lane that have room for a piece: the first shift of each word.
    fn candidates(&self, index: usize, lane: &Lane, piece: &Piece) -> Vec<Candidate> {
        let last = (self.lane - piece.words) as usize;
        let room = |word: usize| {
            let words = &lane.words[word..word + piece.words as usize];
            let mut shifts: Vec<u32> = words[0].iter().map(|held| held.shift + held.bits).collect();
            shifts.push(0);
            shifts.sort_unstable();
            let shift = shifts
                .into_iter()
                .find(|&shift| shift + piece.bits <= 32 && words.iter().all(|word| self.fits(word, piece, shift)))?;
            Some(Candidate { lane: index, word, shift })
        };
        (0..=last).filter_map(room).collect()
    }

    fn fits(&self, word: &[Held], piece: &Piece, shift: u32) -> bool {
        let overlaps = |held: &&Held| held.shift < shift + piece.bits && shift < held.shift + held.bits;
        !word.iter().filter(overlaps).any(|held| self.conflicts[piece.leaf][held.leaf])
    }

    fn slots(&self, table: usize, lanes: &[Lane]) -> BTreeMap<Leaf, Slot> {
        let nowhere = Bits { word: 0, shift: 0, bits: 0 };
        let mut parts: Vec<Vec<Bits>> = self.leaves.iter().map(|leaf| vec![nowhere; leaf.parts().len()]).collect();
        for (held, word) in lanes.iter().flat_map(|lane| &lane.words).zip(0..) {
            for held in held {
                parts[held.leaf][held.part] = Bits { word, shift: held.shift, bits: held.bits };
            }
        }
        let placed = self.classes.iter().zip(parts).flat_map(|(class, parts)| {
            class.iter().map(move |leaf| (leaf.leaf.clone(), Slot { table, parts: parts.clone() }))
        });
        placed.collect()
    }
}

/// Whether it is stored in several whole words.
fn is_vector(leaf: &StateLeaf) -> bool {
    let parts = leaf.parts();
    parts.len() > 1 && parts.iter().all(|&bits| bits == 32)
}

fn access(class: &Class<'_>, liveness: &Liveness) -> Access {
    let any = |moved: &BTreeSet<Leaf>| class.iter().any(|leaf| moved.contains(&leaf.leaf));
    liveness.kernels.values().flat_map(|kernel| [any(&kernel.loads), any(&kernel.stores)]).collect()
}

/// Loads and stores of a lane that a piece would add.
fn added(piece: &Access, lane: &Access) -> usize {
    piece.iter().zip(lane).filter(|(piece, lane)| **piece && !**lane).count()
}

fn merge(access: &mut Access, other: &Access) {
    for (mine, theirs) in access.iter_mut().zip(other) {
        *mine |= theirs;
    }
}
