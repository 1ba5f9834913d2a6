//! No two leaves overlap and no two paths either, whatever the records and the layout.

use super::{Placement, Slot, StateLeaf, Table, automatic, explicit};
use crate::analyze::{KernelTraffic, Leaf, Liveness};
use crate::config::model::{Layout, Order, Placed, PlacedField, PlacedRow};
use crate::config::quantity::LeafType;
use crate::source::{FileId, Span};
use indexmap::IndexMap;
use proptest::prelude::*;
use std::collections::BTreeSet;

const NOWHERE: Span = Span { file: FileId(0), start: 0, end: 0 };

fn leaf(index: usize, ty: LeafType, bits: u32) -> StateLeaf {
    let leaf = Leaf { instance: "eye".into(), field: format!("f{index}"), member: None };
    StateLeaf { leaf, ty, bits }
}

fn leaves() -> impl Strategy<Value = Vec<StateLeaf>> {
    let shape = prop_oneof![
        (1..=32u32).prop_map(|bits| (LeafType::U32, bits)),
        Just((LeafType::Real, 32)),
        Just((LeafType::Vec2, 64)),
        Just((LeafType::Vec3, 96)),
    ];
    prop::collection::vec(shape, 0..24)
        .prop_map(|shapes| shapes.into_iter().enumerate().map(|(index, (ty, bits))| leaf(index, ty, bits)).collect())
}

fn orders() -> impl Strategy<Value = Order> {
    let block = (1..=10u32).prop_map(|power| Order::Aosoa(1 << power));
    prop_oneof![Just(Order::Aos), Just(Order::Soa), block]
}

fn lanes() -> impl Strategy<Value = u32> {
    prop_oneof![Just(1), Just(2), Just(4)]
}

fn table(order: Order, lane: u32) -> Table {
    Table { name: "state".into(), instances: vec!["eye".into()], order, lane, lanes: 0 }
}

fn bits(slot: &Slot) -> impl Iterator<Item = (u32, u32)> + '_ {
    slot.words.iter().flat_map(|&word| (slot.shift..slot.shift + slot.bits).map(move |bit| (word, bit)))
}

fn words(leaves: &[StateLeaf]) -> u32 {
    leaves.iter().filter(|leaf| leaf.bits >= 32).map(|leaf| leaf.ty.words()).sum()
}

proptest! {
    #[test]
    fn no_two_leaves_overlap(leaves in leaves(), order in orders(), lane in lanes()) {
        let Placement { tables, slots } = automatic::assign(vec![table(order, lane)], &leaves, &Liveness::default());
        let mut taken = BTreeSet::new();
        for leaf in &leaves {
            let slot = &slots[&leaf.leaf];
            prop_assert_eq!(slot.words.len() as u32, leaf.ty.words());
            prop_assert_eq!(slot.bits, leaf.bits.min(32));
            for bit in bits(slot) {
                prop_assert!(bit.0 < tables[0].lanes * lane && bit.1 < 32);
                prop_assert!(taken.insert(bit), "{} overlaps", leaf.leaf);
            }
        }
    }

    #[test]
    fn lanes_are_as_few_as_the_words_need(leaves in leaves(), lane in lanes()) {
        let Placement { tables, slots } = automatic::assign(vec![table(Order::Aos, lane)], &leaves, &Liveness::default());
        let shared: BTreeSet<u32> =
            leaves.iter().filter(|leaf| leaf.bits < 32).map(|leaf| slots[&leaf.leaf].words[0]).collect();
        prop_assert_eq!(tables[0].lanes, (words(&leaves) + shared.len() as u32).div_ceil(lane));
    }

    #[test]
    fn addresses_are_distinct_and_in_bounds(order in orders(), lanes in 1..9u32, blocks in 1..3u64) {
        let table = Table { lanes, ..table(order, 1) };
        let paths = blocks * 1024;
        let mut taken = vec![false; (u64::from(lanes) * paths) as usize];
        for path in 0..paths {
            for lane in 0..lanes {
                let address = table.address(lane, path, paths) as usize;
                prop_assert!(address < taken.len());
                prop_assert!(!std::mem::replace(&mut taken[address], true));
            }
        }
    }
}

#[test]
fn a_vec3_and_a_word_share_a_lane_of_four() {
    let leaves = [
        leaf(0, LeafType::Vec3, 96),
        leaf(1, LeafType::Vec3, 96),
        leaf(2, LeafType::Real, 32),
        leaf(3, LeafType::U32, 5),
        leaf(4, LeafType::U32, 19),
    ];
    let placement = automatic::assign(vec![table(Order::Aos, 4)], &leaves, &Liveness::default());
    let words = |index: usize| placement.slots[&leaves[index].leaf].words.clone();
    assert_eq!(placement.tables[0].lanes, 2);
    assert_eq!(words(0), [0, 1, 2]);
    assert_eq!(words(1), [4, 5, 6]);
    assert_eq!(words(2), [3]);
    assert_eq!((words(3), placement.slots[&leaves[3].leaf].shift), (vec![7], 0));
    assert_eq!((words(4), placement.slots[&leaves[4].leaf].shift), (vec![7], 5));
}

#[test]
fn vectors_are_split_only_where_that_saves_a_lane() {
    let leaves: Vec<StateLeaf> = (0..4).map(|index| leaf(index, LeafType::Vec3, 96)).collect();
    let placement = automatic::assign(vec![table(Order::Aos, 4)], &leaves, &Liveness::default());
    assert_eq!(placement.tables[0].lanes, 3);
    assert_eq!(placement.slots[&leaves[0].leaf].words, [0, 1, 2]);
    assert_eq!(placement.slots[&leaves[3].leaf].words, [3, 7, 11]);
}

#[test]
fn what_the_same_kernels_access_shares_a_lane() {
    // Two vectors, and two words that only `trace` stores: they go beside the vector that it stores.
    let leaves = [
        leaf(0, LeafType::Vec3, 96),
        leaf(1, LeafType::Vec2, 64),
        leaf(2, LeafType::Real, 32),
        leaf(3, LeafType::Real, 32),
        leaf(4, LeafType::Real, 32),
    ];
    let set = |indices: &[usize]| indices.iter().map(|&index| leaves[index].leaf.clone()).collect();
    let shade = KernelTraffic { stores: set(&[0, 4]), ..KernelTraffic::default() };
    let trace = KernelTraffic { stores: set(&[1, 2, 3]), ..KernelTraffic::default() };
    let kernels = [("shade".to_owned(), shade), ("trace".to_owned(), trace)].into_iter().collect();
    let liveness = Liveness { kernels, ..Liveness::default() };
    let placement = automatic::assign(vec![table(Order::Aos, 4)], &leaves, &liveness);
    let words = |index: usize| placement.slots[&leaves[index].leaf].words.clone();
    assert_eq!((words(1), words(2), words(3), words(4)), (vec![4, 5], vec![6], vec![7], vec![3]));
}

fn placed(text: &str) -> PlacedField {
    let (field, bits) = match text.split_once(':') {
        Some((field, bits)) => (field, bits.parse().ok()),
        None => (text, None),
    };
    PlacedField { span: NOWHERE, field: (field != "_").then(|| field.to_owned()), bits }
}

/// Rows of words; a word with `+` in it is shared.
fn explicit(rows: &[&[&str]]) -> Result<Placement, Vec<&'static str>> {
    let all = [
        leaf(0, LeafType::Vec3, 96),
        leaf(1, LeafType::Real, 32),
        leaf(2, LeafType::U32, 5),
        leaf(3, LeafType::U32, 19),
        StateLeaf {
            leaf: Leaf { instance: "light".into(), field: "t".into(), member: None },
            ty: LeafType::Real,
            bits: 32,
        },
    ];
    let part = |text: &&str| match text.contains('+') {
        true => Placed::Bits(text.split('+').map(placed).collect()),
        false => Placed::Words(placed(text)),
    };
    let row = |parts: &&[&str]| PlacedRow { span: NOWHERE, parts: parts.iter().map(part).collect() };
    let layout = Layout {
        name: "l".into(),
        doc: String::new(),
        order: Order::Aos,
        lane: 4,
        drop_dead: true,
        tables: IndexMap::new(),
        place: rows.iter().map(row).collect(),
        span: NOWHERE,
    };
    let light = Table { name: "light".into(), instances: vec!["light".into()], ..table(Order::Aos, 4) };
    explicit::assign(vec![table(Order::Aos, 4), light], &layout, &all, &all[..4])
        .map_err(|findings| findings.iter().map(|finding| finding.code).collect())
}

#[test]
fn rows_are_followed() {
    let placement = explicit(&[&["eye.f0", "eye.f1"], &["_", "eye.f2:8+_:5+eye.f3:19", "_", "_"]]).unwrap();
    assert_eq!(placement.tables[0].lanes, 2);
    let slot = |index: usize| {
        let leaf = Leaf { instance: "eye".into(), field: format!("f{index}"), member: None };
        placement.slots[&leaf].clone()
    };
    assert_eq!(slot(1).words, [3]);
    assert_eq!(slot(2), Slot { table: 0, words: vec![5], shift: 0, bits: 8 });
    assert_eq!(slot(3), Slot { table: 0, words: vec![5], shift: 13, bits: 19 });
}

#[test]
fn wrong_rows_are_refused() {
    let first: &[&str] = &["eye.f0", "eye.f1"];
    let last: &[&str] = &["eye.f2:5+eye.f3:19+_:8", "_", "_", "_"];
    let codes = |rows: &[&[&str]]| explicit(rows).unwrap_err();
    assert_eq!(codes(&[first]), ["K0406", "K0406"]);
    assert_eq!(codes(&[first, last, &["eye.f1", "_", "_", "_"]]), ["K0405"]);
    assert_eq!(codes(&[first, last, &["_", "_", "_"]]), ["K0403"]);
    assert_eq!(codes(&[first, last, &["eye.f9", "_", "_", "_"]]), ["K0404"]);
    assert_eq!(codes(&[first, &["eye.f2:4+eye.f3:19+_:9", "_", "_", "_"]]), ["K0407"]);
    assert_eq!(codes(&[first, &["eye.f2:5+eye.f3:19", "_", "_", "_"]]), ["K0407"]);
    assert_eq!(codes(&[first, &["eye.f2", "eye.f3:19+_:13", "_", "_"]]), ["K0407"]);
    assert_eq!(codes(&[first, &["eye.f2:5+eye.f3:19+_:8", "light.t", "_", "_"]]), ["K0408"]);
}
