//! Packing without a plan of the user's: as few lanes as possible, vectors whole where that costs no lane, and together what the
//! same kernels read and write.

use super::{Placement, Slot, StateLeaf, Table};
use crate::analyze::{Leaf, Liveness};
use std::collections::BTreeMap;

/// A part of the record that needs consecutive words in one lane.
struct Piece {
    words: u32,
    /// The leaf and the component its first word holds; leaves below a word share pieces of one word.
    holds: Vec<Held>,
}

struct Held {
    leaf: usize,
    component: usize,
    shift: u32,
}

/// Which kernels load and store something: one entry a kernel and direction.
type Access = Vec<bool>;

/// Packs the leaves of each table; leaves of instances without a table are left out.
pub(super) fn assign(mut tables: Vec<Table>, leaves: &[StateLeaf], liveness: &Liveness) -> Placement {
    let mut slots = BTreeMap::new();
    for (index, table) in tables.iter_mut().enumerate() {
        let own: Vec<&StateLeaf> = leaves.iter().filter(|leaf| table.instances.contains(&leaf.leaf.instance)).collect();
        let (lanes, packed) = pack(&own, table.lane, liveness);
        table.lanes = lanes;
        slots.extend(packed.into_iter().map(|(leaf, slot)| (leaf, Slot { table: index, ..slot })));
    }
    Placement { tables, slots }
}

/// Packs into as few lanes as the words need; the last vectors are split when keeping them whole would cost a lane.
fn pack(leaves: &[&StateLeaf], lane: u32, liveness: &Liveness) -> (u32, Vec<(Leaf, Slot)>) {
    let accesses: Vec<Access> = leaves.iter().map(|leaf| access(&leaf.leaf, liveness)).collect();
    let vectors = leaves.iter().filter(|leaf| leaf.ty.words() > 1).count();
    let words: u32 = pieces(leaves, lane, 0).iter().map(|piece| piece.words).sum();
    let fewest = words.div_ceil(lane);
    let mut kept = vectors;
    loop {
        let pieces = pieces(leaves, lane, kept);
        let (lanes, starts) = fit(&pieces, &accesses, lane);
        if lanes == fewest || kept == 0 {
            return (lanes, slots(leaves, &pieces, &starts));
        }
        kept -= 1;
    }
}

/// Cuts leaves into pieces, in order of declaration: the first `kept` vectors as large as a lane allows, the others word by word.
fn pieces(leaves: &[&StateLeaf], lane: u32, kept: usize) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut shared: Vec<(usize, u32)> = Vec::new();
    let mut vectors = 0;
    for (index, leaf) in leaves.iter().enumerate() {
        if leaf.bits < 32 {
            hold_bits(&mut pieces, &mut shared, index, leaf.bits);
            continue;
        }
        let words = leaf.ty.words();
        vectors += usize::from(words > 1);
        let largest = if words > 1 && vectors <= kept { lane } else { 1 };
        let mut component = 0;
        while component < words {
            let size = largest.min(words - component);
            let held = Held { leaf: index, component: component as usize, shift: 0 };
            pieces.push(Piece { words: size, holds: vec![held] });
            component += size;
        }
    }
    pieces
}

/// Puts a leaf below a word into the first shared word with room, or opens one.
fn hold_bits(pieces: &mut Vec<Piece>, shared: &mut Vec<(usize, u32)>, leaf: usize, bits: u32) {
    if let Some((piece, used)) = shared.iter_mut().find(|(_, used)| used.saturating_add(bits) <= 32) {
        pieces[*piece].holds.push(Held { leaf, component: 0, shift: *used });
        *used += bits;
    } else {
        shared.push((pieces.len(), bits));
        pieces.push(Piece { words: 1, holds: vec![Held { leaf, component: 0, shift: 0 }] });
    }
}

fn access(leaf: &Leaf, liveness: &Liveness) -> Access {
    let kernels = liveness.kernels.values();
    kernels.flat_map(|kernel| [kernel.loads.contains(leaf), kernel.stores.contains(leaf)]).collect()
}

/// A lane while it is filled.
struct Lane {
    used: u32,
    access: Access,
}

impl Lane {
    /// Loads and stores of this lane that a piece would add.
    fn added(&self, piece: &Access) -> usize {
        piece.iter().zip(&self.access).filter(|(piece, lane)| **piece && !**lane).count()
    }
}

/// First word of every piece: large pieces first, each into the lane with room whose kernels access it anyway.
fn fit(pieces: &[Piece], accesses: &[Access], lane: u32) -> (u32, Vec<u32>) {
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by_key(|&piece| std::cmp::Reverse(pieces[piece].words));
    let mut lanes: Vec<Lane> = Vec::new();
    let mut starts = vec![0; pieces.len()];
    for piece in order {
        let words = pieces[piece].words;
        let mut own = vec![false; accesses.first().map_or(0, Vec::len)];
        for held in &pieces[piece].holds {
            merge(&mut own, &accesses[held.leaf]);
        }
        let roomy = (0..lanes.len()).filter(|&index| lanes[index].used + words <= lane);
        let found = roomy.min_by_key(|&index| lanes[index].added(&own)).unwrap_or_else(|| {
            lanes.push(Lane { used: 0, access: vec![false; own.len()] });
            lanes.len() - 1
        });
        starts[piece] = found as u32 * lane + lanes[found].used;
        lanes[found].used += words;
        merge(&mut lanes[found].access, &own);
    }
    (lanes.len() as u32, starts)
}

fn merge(access: &mut Access, other: &Access) {
    for (mine, theirs) in access.iter_mut().zip(other) {
        *mine |= theirs;
    }
}

fn slots(leaves: &[&StateLeaf], pieces: &[Piece], starts: &[u32]) -> Vec<(Leaf, Slot)> {
    let empty = |leaf: &&StateLeaf| Slot {
        table: 0,
        words: vec![0; leaf.ty.words() as usize],
        shift: 0,
        bits: leaf.bits.min(32),
    };
    let mut slots: Vec<Slot> = leaves.iter().map(empty).collect();
    for (piece, start) in pieces.iter().zip(starts) {
        for held in &piece.holds {
            let slot = &mut slots[held.leaf];
            slot.shift = held.shift;
            for word in 0..piece.words {
                slot.words[held.component + word as usize] = start + word;
            }
        }
    }
    leaves.iter().map(|leaf| leaf.leaf.clone()).zip(slots).collect()
}
