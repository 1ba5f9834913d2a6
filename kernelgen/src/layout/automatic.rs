//! Packing without a plan of the user's: first fit, vectors whole where that costs no lane.

use super::{Placement, Slot, StateLeaf, Table};
use crate::analyze::Leaf;
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

/// Packs the leaves of each table; leaves of instances without a table are left out.
pub(super) fn assign(mut tables: Vec<Table>, leaves: &[StateLeaf]) -> Placement {
    let mut slots = BTreeMap::new();
    for (index, table) in tables.iter_mut().enumerate() {
        let own: Vec<&StateLeaf> =
            leaves.iter().filter(|leaf| table.instances.contains(&leaf.leaf.instance)).collect();
        let (lanes, packed) = pack(&own, table.lane);
        table.lanes = lanes;
        slots.extend(packed.into_iter().map(|(leaf, slot)| (leaf, Slot { table: index, ..slot })));
    }
    Placement { tables, slots }
}

/// Packs into as few lanes as the words need; the last vectors are split when keeping them whole would cost a lane.
fn pack(leaves: &[&StateLeaf], lane: u32) -> (u32, Vec<(Leaf, Slot)>) {
    let vectors = leaves.iter().filter(|leaf| leaf.ty.words() > 1).count();
    let words: u32 = pieces(leaves, lane, 0).iter().map(|piece| piece.words).sum();
    let fewest = words.div_ceil(lane);
    let mut kept = vectors;
    loop {
        let pieces = pieces(leaves, lane, kept);
        let (lanes, starts) = first_fit(&pieces, lane);
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

/// First word of every piece: large pieces first, each into the first lane with room.
fn first_fit(pieces: &[Piece], lane: u32) -> (u32, Vec<u32>) {
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by_key(|&piece| std::cmp::Reverse(pieces[piece].words));
    let mut filled: Vec<u32> = Vec::new();
    let mut starts = vec![0; pieces.len()];
    for piece in order {
        let words = pieces[piece].words;
        let found = filled.iter().position(|used| used + words <= lane).unwrap_or_else(|| {
            filled.push(0);
            filled.len() - 1
        });
        starts[piece] = found as u32 * lane + filled[found];
        filled[found] += words;
    }
    (filled.len() as u32, starts)
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
