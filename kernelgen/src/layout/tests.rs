//! No two leaves overlap and no two paths either, whatever the records and the layout.

use super::{Assigned, Bits, InPlace, Placement, Slot, StateLeaf, Table, automatic, explicit};
use crate::analyze::{KernelTraffic, Leaf, Liveness};
use crate::config::model::{Codec, Layout, Order, Placed, PlacedField, PlacedRow};
use crate::config::quantity::LeafType;
use crate::source::{FileId, Span};
use indexmap::IndexMap;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

const NOWHERE: Span = Span { file: FileId(0), start: 0, end: 0 };

fn leaf(index: usize, ty: LeafType, bits: u32) -> StateLeaf {
    let leaf = Leaf { instance: "eye".into(), field: format!("f{index}"), member: None };
    StateLeaf { leaf, ty, bits, quantity: "", codec: None }
}

/// A leaf that a codec keeps in parts of these widths.
fn coded(index: usize, parts: Vec<u32>) -> StateLeaf {
    let codec = Codec {
        name: "c".into(),
        quantities: Vec::new(),
        parts,
        errors: IndexMap::new(),
        range: [0.0, 1.0],
        doc: String::new(),
        span: NOWHERE,
    };
    StateLeaf { codec: Some(codec), ..leaf(index, LeafType::Vec3, 96) }
}

fn leaves() -> impl Strategy<Value = Vec<StateLeaf>> {
    let plain = prop_oneof![
        (1..=32u32).prop_map(|bits| (LeafType::U32, bits)),
        Just((LeafType::Real, 32)),
        Just((LeafType::Vec2, 64)),
        Just((LeafType::Vec3, 96)),
    ];
    let plain = plain.prop_map(|(ty, bits)| leaf(0, ty, bits));
    let coded = prop::collection::vec(1..=32u32, 1..4).prop_map(|parts| coded(0, parts));
    let named = |leaves: Vec<StateLeaf>| {
        let rename = |(index, leaf): (usize, StateLeaf)| StateLeaf {
            leaf: Leaf { field: format!("f{index}"), ..leaf.leaf.clone() },
            ..leaf
        };
        leaves.into_iter().enumerate().map(rename).collect()
    };
    prop::collection::vec(prop_oneof![plain, coded], 0..24).prop_map(named)
}

/// What is alive behind each of some kernels: a set of indices of leaves for each.
fn lives() -> impl Strategy<Value = Vec<Vec<usize>>> {
    prop::collection::vec(prop::collection::vec(0..24usize, 0..16), 1..6)
}

fn liveness(leaves: &[StateLeaf], lives: &[Vec<usize>]) -> Liveness {
    let kernel = |(index, alive): (usize, &Vec<usize>)| {
        let alive: BTreeSet<Leaf> = alive.iter().filter_map(|&index| Some(leaves.get(index)?.leaf.clone())).collect();
        let traffic = KernelTraffic { stores: alive.clone(), live_out: alive, ..KernelTraffic::default() };
        (format!("k{index}"), traffic)
    };
    Liveness { kernels: lives.iter().enumerate().map(kernel).collect(), ..Liveness::default() }
}

/// Kernels of which each copies some leaves to others, as far as it stores them.
fn with_copies(mut liveness: Liveness, leaves: &[StateLeaf], copies: &[(usize, usize)]) -> Liveness {
    for (traffic, of_kernel) in liveness.kernels.values_mut().zip(copies.chunks(COPIES)) {
        let pairs = of_kernel.iter().filter_map(|(copy, source)| Some((leaves.get(*copy)?, leaves.get(*source)?)));
        let stored = pairs.filter(|(copy, _)| traffic.stores.contains(&copy.leaf));
        traffic.copies = stored.map(|(copy, source)| (copy.leaf.clone(), source.leaf.clone())).collect();
    }
    liveness
}

/// Most copies of a kernel.
const COPIES: usize = 12;

fn orders() -> impl Strategy<Value = Order> {
    let block = (1..=10u32).prop_map(|power| Order::Aosoa(1 << power));
    prop_oneof![Just(Order::Aos), Just(Order::Soa), block]
}

fn lanes() -> impl Strategy<Value = u32> {
    prop_oneof![Just(1), Just(2), Just(4)]
}

fn table(order: Order, lane: u32) -> Table {
    Table { name: "state".into(), instances: vec!["eye".into()], order, lane, lanes: 0, rays: false }
}

fn bits(slot: &Slot) -> impl Iterator<Item = (u32, u32)> + '_ {
    slot.parts.iter().flat_map(|part| (part.shift..part.shift + part.bits).map(|bit| (part.word, bit)))
}

/// Lanes of one table for leaves without codecs, and the slots.
fn plain(leaves: &[StateLeaf], lane: u32, liveness: &Liveness) -> Assigned {
    automatic::assign(vec![table(Order::Aos, lane)], leaves, liveness, false)
}

fn word_of(slots: &BTreeMap<Leaf, Slot>, leaf: &StateLeaf) -> Vec<u32> {
    slots[&leaf.leaf].parts.iter().map(|part| part.word).collect()
}

proptest! {
    #[test]
    fn no_two_leaves_overlap(leaves in leaves(), lane in lanes()) {
        let (tables, slots) = plain(&leaves, lane, &Liveness::default());
        let mut taken = BTreeSet::new();
        for leaf in &leaves {
            let slot = &slots[&leaf.leaf];
            let widths: Vec<u32> = slot.parts.iter().map(|part| part.bits).collect();
            prop_assert_eq!(widths, leaf.parts());
            for bit in bits(slot) {
                prop_assert!(bit.0 < tables[0].lanes * lane && bit.1 < 32);
                prop_assert!(taken.insert(bit), "{} overlaps", leaf.leaf);
            }
        }
    }

    /// Sharing: what is alive behind one kernel has bits of its own, whatever else has the same ones; and there are never more lanes
    /// than without.
    #[test]
    fn what_lives_together_does_not_overlap(
        leaves in leaves(),
        lives in lives(),
        copies in prop::collection::vec((0..24usize, 0..24usize), 0..6 * COPIES),
        lane in lanes(),
    ) {
        let liveness = with_copies(liveness(&leaves, &lives), &leaves, &copies);
        let (tables, slots) = automatic::assign(vec![table(Order::Soa, lane)], &leaves, &liveness, true);
        for kernel in liveness.kernels.values() {
            let mut taken = BTreeSet::new();
            for leaf in &kernel.live_out {
                for bit in bits(&slots[leaf]) {
                    prop_assert!(bit.0 < tables[0].lanes * lane && bit.1 < 32);
                    prop_assert!(taken.insert(bit), "{} overlaps", leaf);
                }
            }
        }
        let (apart, _) = plain(&leaves, lane, &liveness);
        prop_assert!(tables[0].lanes <= apart[0].lanes);
    }

    #[test]
    fn lanes_are_as_few_as_the_words_need(
        shapes in prop::collection::vec(prop_oneof![Just(LeafType::Real), Just(LeafType::Vec2), Just(LeafType::Vec3)], 0..24),
        lane in lanes(),
    ) {
        let leaves: Vec<StateLeaf> =
            shapes.iter().enumerate().map(|(index, &ty)| leaf(index, ty, 32 * ty.words())).collect();
        let (tables, _) = plain(&leaves, lane, &Liveness::default());
        let words: u32 = shapes.iter().map(|ty| ty.words()).sum();
        prop_assert_eq!(tables[0].lanes, words.div_ceil(lane));
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
    let (tables, slots) = plain(&leaves, 4, &Liveness::default());
    assert_eq!(tables[0].lanes, 2);
    assert_eq!(word_of(&slots, &leaves[0]), [0, 1, 2]);
    assert_eq!(word_of(&slots, &leaves[1]), [4, 5, 6]);
    assert_eq!(word_of(&slots, &leaves[2]), [3]);
    assert_eq!(slots[&leaves[3].leaf].parts, [Bits { word: 7, shift: 0, bits: 5 }]);
    assert_eq!(slots[&leaves[4].leaf].parts, [Bits { word: 7, shift: 5, bits: 19 }]);
}

#[test]
fn vectors_are_split_only_where_that_saves_a_lane() {
    let leaves: Vec<StateLeaf> = (0..4).map(|index| leaf(index, LeafType::Vec3, 96)).collect();
    let (tables, slots) = plain(&leaves, 4, &Liveness::default());
    assert_eq!(tables[0].lanes, 3);
    assert_eq!(word_of(&slots, &leaves[0]), [0, 1, 2]);
    assert_eq!(word_of(&slots, &leaves[3]), [3, 7, 11]);
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
    let (_, slots) = plain(&leaves, 4, &Liveness { kernels, ..Liveness::default() });
    let words: Vec<Vec<u32>> = leaves.iter().map(|leaf| word_of(&slots, leaf)).collect();
    assert_eq!(words[1..], [vec![4, 5], vec![6], vec![7], vec![3]]);
}

#[test]
fn a_ray_and_its_hit_share_words_in_the_table_of_rays() {
    // The origin is not needed once the ray has been traced, the direction is.
    let leaves = [
        leaf(0, LeafType::Vec3, 96),
        leaf(1, LeafType::Vec3, 96),
        leaf(2, LeafType::Vec2, 64),
        leaf(3, LeafType::Vec3, 96),
    ];
    let set =
        |indices: &[usize]| -> BTreeSet<Leaf> { indices.iter().map(|&index| leaves[index].leaf.clone()).collect() };
    let behind = |alive: &[usize]| KernelTraffic { live_out: set(alive), ..KernelTraffic::default() };
    let kernels = [("shade".to_owned(), behind(&[0, 1, 3])), ("trace".to_owned(), behind(&[1, 2, 3]))];
    let liveness =
        Liveness { kernels: kernels.into_iter().collect(), in_flight: set(&[0, 1, 2]), ..Liveness::default() };
    let rays = Table { name: "ray".into(), rays: true, ..table(Order::Soa, 1) };
    let (tables, slots) = automatic::assign(vec![table(Order::Soa, 1), rays], &leaves, &liveness, true);
    assert_eq!((tables[0].lanes, tables[1].lanes), (3, 6));
    assert!(slots[&leaves[0].leaf].overlaps(&slots[&leaves[2].leaf]));
    assert!(!slots[&leaves[1].leaf].overlaps(&slots[&leaves[2].leaf]));
    assert_eq!(slots[&leaves[3].leaf].table, 0);
}

/// The places of leaves, and those of what `copy` is spared: it copies some leaves to others, which live behind it as those did before.
fn copied(leaves: &[StateLeaf], copies: &[(usize, usize)], before: &[usize], behind: &[usize]) -> (Placement, InPlace) {
    let live_out = [before, behind].map(<[usize]>::to_vec);
    let mut liveness = with_copies(liveness(leaves, &live_out), leaves, &[]);
    let name = |index: usize| leaves[index].leaf.clone();
    let traffic = &mut liveness.kernels["k1"];
    traffic.loads = before.iter().map(|&index| name(index)).collect();
    traffic.copies = copies.iter().map(|&(copy, source)| (name(copy), name(source))).collect();
    traffic.only_copied = copies.iter().map(|&(_, source)| name(source)).collect();
    let (tables, slots) = automatic::assign(vec![table(Order::Soa, 1)], leaves, &liveness, true);
    let leaves = leaves.iter().map(|leaf| (leaf.leaf.clone(), leaf.clone())).collect();
    let placement = Placement { tables, slots, leaves };
    let in_place = placement.in_place(&liveness.kernels["k1"]);
    (placement, in_place)
}

#[test]
fn a_copy_lies_where_its_source_lay() {
    let leaves = [
        leaf(0, LeafType::Vec3, 96),
        leaf(1, LeafType::Vec3, 96),
        leaf(2, LeafType::Vec3, 96),
        leaf(3, LeafType::Vec3, 96),
    ];
    let slot = |placement: &Placement, index: usize| placement.slots[&leaves[index].leaf].clone();
    // Two sources and their copies, crosswise: without classes the first copy would go over the first source.
    let (placement, in_place) = copied(&leaves, &[(2, 1), (3, 0)], &[0, 1], &[2, 3]);
    assert_eq!(slot(&placement, 2), slot(&placement, 1));
    assert_eq!(slot(&placement, 3), slot(&placement, 0));
    assert_eq!((in_place.copies.len(), in_place.sources.len(), placement.tables[0].lanes), (2, 2, 6));
    // A source that lives on keeps its place, and the copy has one of its own.
    let (placement, in_place) = copied(&leaves, &[(2, 1)], &[0, 1], &[1, 2]);
    assert!(!slot(&placement, 2).overlaps(&slot(&placement, 1)));
    assert_eq!(in_place, InPlace::default());
    // Of two copies that live together one is in place; the other needs the source in registers.
    let (_, in_place) = copied(&leaves, &[(2, 1), (3, 1)], &[1], &[2, 3]);
    assert_eq!((in_place.copies.len(), in_place.sources.len()), (1, 0));
}

#[test]
fn copies_of_another_form_have_places_of_their_own() {
    let in_place = |leaves: [StateLeaf; 2]| copied(&leaves, &[(1, 0)], &[0], &[1]).1;
    let (wide, narrow) = (leaf(0, LeafType::U32, 32), leaf(1, LeafType::U32, 7));
    assert_eq!(in_place([wide, narrow]), InPlace::default());
    assert_eq!(in_place([leaf(0, LeafType::Vec3, 96), coded(1, vec![32, 32, 32])]), InPlace::default());
    assert_eq!(in_place([coded(0, vec![24, 8]), coded(1, vec![24, 8])]).copies.len(), 1);
}

fn placed(text: &str) -> PlacedField {
    let (field, bits) = match text.split_once(':') {
        Some((field, bits)) => (field, bits.parse().ok()),
        None => (text, None),
    };
    PlacedField { span: NOWHERE, field: (field != "_").then(|| field.to_owned()), bits }
}

/// Rows of words; a word with `+` in it is shared.
fn explicit(rows: &[&[&str]]) -> Result<Assigned, Vec<&'static str>> {
    let all = [
        leaf(0, LeafType::Vec3, 96),
        leaf(1, LeafType::Real, 32),
        leaf(2, LeafType::U32, 5),
        leaf(3, LeafType::U32, 19),
        StateLeaf {
            leaf: Leaf { instance: "light".into(), field: "t".into(), member: None },
            ty: LeafType::Real,
            bits: 32,
            quantity: "",
            codec: None,
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
        share: false,
        rays_apart: false,
        ray_lane: 4,
        encode: IndexMap::new(),
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
    let (tables, slots) = explicit(&[&["eye.f0", "eye.f1"], &["_", "eye.f2:8+_:5+eye.f3:19", "_", "_"]]).unwrap();
    assert_eq!(tables[0].lanes, 2);
    let parts = |index: usize| {
        let leaf = Leaf { instance: "eye".into(), field: format!("f{index}"), member: None };
        slots[&leaf].parts.clone()
    };
    assert_eq!(parts(1), [Bits { word: 3, shift: 0, bits: 32 }]);
    assert_eq!(parts(2), [Bits { word: 5, shift: 0, bits: 8 }]);
    assert_eq!(parts(3), [Bits { word: 5, shift: 13, bits: 19 }]);
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
