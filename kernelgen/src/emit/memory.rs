//! State tables in WGSL: their variables and addresses, and the loads and stores of a kernel.

use super::dense::Dense;
use super::text::COMPONENTS;
use crate::analyze::{KernelTraffic, Leaf};
use crate::config::model::Order;
use crate::config::quantity::LeafType;
use crate::layout::{Bits, Placement, Slot, Table};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// The WGSL name of a table's buffer.
pub(super) fn buffer_name(table: &Table) -> String {
    if table.name == "state" { "state".to_owned() } else { format!("{}_state", table.name) }
}

/// `package::tables`: the buffers of the path state and where in them a path's record is.
pub(super) fn module(placement: &Placement, dense: Option<&Dense>) -> String {
    let mut text = String::from("import package::pass::{path_count, path_id, walk_place};\n");
    for (index, table) in placement.tables.iter().enumerate().filter(|(_, table)| table.lanes > 0) {
        let name = buffer_name(table);
        let words = table.lanes * table.lane;
        let (place, places) = match dense.map_or(1, |dense| dense.places(index)) {
            1 => ("path_id", "path_count".to_owned()),
            places => ("walk_place", format!("{places}u * path_count")),
        };
        let _ = write!(
            text,
            "\n/// {} {}: {words} words a path, {}.\n\
             var<storage, read_write> {name}: array<{}>;\n\n\
             /// Where a lane of this path's record is.\n\
             fn {name}_address(lane: u32) -> u32 {{\n    return {};\n}}\n",
            if table.rays { "Rays in flight of" } else { "State of" },
            table.instances.join(", "),
            describe(table.order),
            lane_type(table.lane),
            address(table, place, &places),
        );
    }
    text
}

fn describe(order: Order) -> String {
    match order {
        Order::Aos => "one record after the other".to_owned(),
        Order::Soa => "a plane a lane".to_owned(),
        Order::Aosoa(block) => format!("a plane a lane in blocks of {block} paths"),
    }
}

fn lane_type(lane: u32) -> String {
    if lane == 1 { "u32".to_owned() } else { format!("vec{lane}<u32>") }
}

/// The text of `Table::address`, of a record's place among so many.
fn address(table: &Table, place: &str, places: &str) -> String {
    match table.order {
        Order::Aos => format!("{place} * {}u + lane", table.lanes),
        Order::Soa => format!("lane * {places} + {place}"),
        Order::Aosoa(block) => {
            format!("{place} / {block}u * {}u + lane * {block}u + {place} % {block}u", table.lanes * block)
        }
    }
}

/// The loads and stores of one kernel.
#[derive(Clone, Debug, Default)]
pub(super) struct Access {
    /// Variables of a kernel whose paths change their slots: words that it loads before and stores after.
    pub locals: Vec<String>,
    /// Statements that fill the instances.
    pub loads: Vec<String>,
    /// Statements that write them back.
    pub stores: Vec<String>,
    /// Those that write what moves on to where it then stands.
    pub moved_stores: Vec<String>,
    /// Bytes that the loads move, late ones included.
    pub load_bytes: u32,
    /// Bytes that the stores move.
    pub store_bytes: u32,
    /// Bytes that those of `moved_stores` move.
    pub moved_bytes: u32,
    /// Whether tables are loaded or stored by slot whose records move in a loop.
    pub by_slot: bool,
    /// Buffers used: names of tables' variables.
    pub buffers: BTreeSet<String>,
    /// Functions of codecs used: the codec's name, and the function's.
    pub codecs: BTreeSet<(String, String)>,
    /// Loads that wait until a stage needs them.
    pub late: Vec<Late>,
}

/// Fields that a kernel of several stages loads when the first stage runs that uses them.
#[derive(Clone, Debug, Default)]
pub(super) struct Late {
    /// The stages that use them.
    pub stages: BTreeSet<String>,
    /// Statements that fill the instances.
    pub loads: Vec<String>,
}

impl Access {
    /// All statements that fill instances.
    pub(super) fn all_loads(&self) -> impl Iterator<Item = &String> {
        self.loads.iter().chain(self.late.iter().flat_map(|late| &late.loads))
    }
}

/// What a kernel stores elsewhere than where it was loaded: of this, it takes along all that lives on, also what it does not touch.
#[derive(Clone, Copy, Debug)]
pub(super) enum Carries<'a> {
    /// Nothing.
    Nothing,
    /// Everything, at once.
    All,
    /// What is in these tables, when it is known where it goes.
    Tables(&'a BTreeMap<usize, bool>),
}

impl Carries<'_> {
    fn table(self, table: usize) -> bool {
        match self {
            Carries::Nothing => false,
            Carries::All => true,
            Carries::Tables(tables) => tables.contains_key(&table),
        }
    }
}

/// The statements that move a kernel's leaves between tables and instances; `late` are leaves to be loaded later, by the stages that
/// use them.
pub(super) fn access(
    placement: &Placement,
    traffic: &KernelTraffic,
    late: &BTreeMap<BTreeSet<String>, BTreeSet<Leaf>>,
    carries: Carries<'_>,
) -> Access {
    let is_late = |leaf: &Leaf| late.values().any(|leaves| leaves.contains(leaf));
    let first = traffic.loads.iter().filter(|leaf| !is_late(leaf)).cloned().collect();
    let traffic = KernelTraffic { loads: first, ..traffic.clone() };
    let memory = Memory { placement, traffic: &traffic, words: words(placement), carries };
    let mut access = Access::default();
    let loaded = memory.load_lanes(&mut access);
    memory.fill_leaves(&loaded, &mut access);
    memory.encode_leaves(&mut access);
    memory.store_lanes(&loaded, &mut access);
    for (stages, leaves) in late {
        push_late(placement, stages, leaves, &mut access);
    }
    access
}

/// Bytes that a kernel moves more if it takes along all that lives on.
pub(super) fn carried_bytes(placement: &Placement, traffic: &KernelTraffic) -> u32 {
    let bytes = |carries| {
        let access = access(placement, traffic, &BTreeMap::new(), carries);
        access.load_bytes + access.store_bytes
    };
    bytes(Carries::All) - bytes(Carries::Nothing)
}

fn push_late(placement: &Placement, stages: &BTreeSet<String>, leaves: &BTreeSet<Leaf>, access: &mut Access) {
    let traffic = KernelTraffic { loads: leaves.clone(), ..KernelTraffic::default() };
    let memory = Memory { placement, traffic: &traffic, words: words(placement), carries: Carries::Nothing };
    let mut own = Access::default();
    let loaded = memory.load_lanes(&mut own);
    memory.fill_leaves(&loaded, &mut own);
    access.load_bytes += own.load_bytes;
    access.buffers.extend(own.buffers);
    access.codecs.extend(own.codecs);
    access.late.push(Late { stages: stages.clone(), loads: own.loads });
}

/// A word of a record: index of the table, index of the word.
type Word = (usize, u32);
/// A lane of a record: index of the table, index of the lane.
type Lane = (usize, u32);

/// A leaf's part of a word.
struct Part<'a> {
    leaf: &'a Leaf,
    bits: Bits,
    /// Which of its parts.
    component: usize,
}

fn words(placement: &Placement) -> BTreeMap<Word, Vec<Part<'_>>> {
    let mut words: BTreeMap<Word, Vec<Part<'_>>> = BTreeMap::new();
    for (leaf, slot) in &placement.slots {
        for (component, &bits) in slot.parts.iter().enumerate() {
            words.entry((slot.table, bits.word)).or_default().push(Part { leaf, bits, component });
        }
    }
    for parts in words.values_mut() {
        parts.sort_by_key(|part| part.bits.shift);
    }
    words
}

struct Memory<'a> {
    placement: &'a Placement,
    traffic: &'a KernelTraffic,
    words: BTreeMap<Word, Vec<Part<'a>>>,
    carries: Carries<'a>,
}

/// Lanes read as a whole, and the names of words in registers.
#[derive(Default)]
struct Loaded {
    whole: BTreeMap<Lane, String>,
    words: BTreeMap<Word, String>,
}

/// What a kernel must do to a word.
enum WordStore {
    /// Nothing in it is live afterwards: any value will do.
    Free,
    /// It must stay as it is; its value where the kernel has loaded it.
    Keep(Option<String>),
    /// It gets this value.
    Value(String),
}

impl Memory<'_> {
    fn table(&self, table: usize) -> &Table {
        &self.placement.tables[table]
    }

    /// The lane of a word and its component there.
    fn lane_of(&self, (table, word): Word) -> (Lane, usize) {
        let lane = self.table(table).lane;
        ((table, word / lane), (word % lane) as usize)
    }

    /// Words that the kernel needs in registers: of loaded leaves, and those it stores a part of while the rest stays live; of all that
    /// stay live where it carries them.
    fn needed_words(&self) -> BTreeSet<Word> {
        let needs = |(word, parts): &(&Word, &Vec<Part<'_>>)| {
            let loaded = parts.iter().any(|part| self.traffic.loads.contains(part.leaf));
            loaded || ((self.carries.table(word.0) || self.stores_any(parts)) && self.keeps_any(parts))
        };
        self.words.iter().filter(needs).map(|(word, _)| *word).collect()
    }

    fn stores_any(&self, parts: &[Part<'_>]) -> bool {
        parts.iter().any(|part| self.traffic.stores.contains(part.leaf))
    }

    /// Whether a leaf that the kernel does not store lives on in this word.
    fn keeps_any(&self, parts: &[Part<'_>]) -> bool {
        let keeps = |leaf| self.traffic.live_out.contains(leaf) && !self.traffic.stores.contains(leaf);
        parts.iter().any(|part| keeps(part.leaf))
    }

    fn load_lanes(&self, access: &mut Access) -> Loaded {
        let mut lanes: BTreeMap<Lane, Vec<(Word, usize)>> = BTreeMap::new();
        for word in self.needed_words() {
            let (lane, component) = self.lane_of(word);
            lanes.entry(lane).or_default().push((word, component));
        }
        let mut loaded = Loaded::default();
        for (lane, needed) in lanes {
            let table = self.table(lane.0);
            let buffer = buffer_name(table);
            let source = format!("{buffer}[{buffer}_address({}u)]", lane.1);
            let local = format!("{buffer}_{}", lane.1);
            match needed.as_slice() {
                [(word, component)] if table.lane > 1 => {
                    let component = COMPONENTS[*component];
                    let ty = lane_type(1);
                    self.push_load(&format!("{local}_{component}"), &ty, &format!("{source}.{component}"), access);
                    access.load_bytes += 4;
                    loaded.words.insert(*word, format!("{local}_{component}"));
                }
                _ => {
                    self.push_load(&local, &lane_type(table.lane), &source, access);
                    access.load_bytes += 4 * table.lane;
                    for (word, component) in needed {
                        let name = match table.lane {
                            1 => local.clone(),
                            _ => format!("{local}.{}", COMPONENTS[component]),
                        };
                        loaded.words.insert(word, name);
                    }
                    loaded.whole.insert(lane, local);
                }
            }
            access.buffers.insert(buffer);
        }
        loaded
    }

    fn push_load(&self, local: &str, ty: &str, source: &str, access: &mut Access) {
        if !matches!(self.carries, Carries::Nothing) {
            access.locals.push(format!("var {local}: {ty};"));
            access.loads.push(format!("{local} = {source};"));
        } else {
            access.loads.push(format!("let {local} = {source};"));
        }
    }

    fn fill_leaves(&self, loaded: &Loaded, access: &mut Access) {
        let placed = self
            .traffic
            .loads
            .iter()
            .filter_map(|leaf| Some((leaf, self.placement.slots.get(leaf)?, self.placement.leaves.get(leaf)?)));
        let mut placed: Vec<_> = placed.collect();
        placed.sort_by(|(_, a, _), (_, b, _)| (a.table, &a.parts).cmp(&(b.table, &b.parts)));
        for (leaf, slot, declared) in placed {
            let bits = self.register(slot, loaded);
            let value = match (&declared.codec, declared.ty) {
                (Some(codec), _) => {
                    let decode = format!("decode_{}", codec.name);
                    access.codecs.insert((codec.name.clone(), decode.clone()));
                    format!("{decode}({bits})")
                }
                (None, LeafType::U32) => bits,
                (None, LeafType::Real) => format!("bitcast<real>({bits})"),
                (None, LeafType::Vec2) => format!("bitcast<vec2r>({bits})"),
                (None, LeafType::Vec3) => format!("bitcast<vec3r>({bits})"),
            };
            access.loads.push(format!("{leaf} = {value};"));
        }
    }

    /// The parts of a slot as one value: a swizzle where they are words side by side in one lane.
    fn register(&self, slot: &Slot, loaded: &Loaded) -> String {
        let lanes: Vec<(Lane, usize)> = slot.parts.iter().map(|part| self.lane_of((slot.table, part.word))).collect();
        let (lane, first) = lanes[0];
        let together = lanes.iter().enumerate().all(|(step, place)| *place == (lane, first + step));
        let whole = slot.parts.iter().all(|part| part.bits == 32);
        match loaded.whole.get(&lane) {
            Some(local) if together && whole && lanes.len() > 1 => {
                let all = lanes.len() as u32 == self.table(slot.table).lane;
                let swizzle = COMPONENTS[first..first + lanes.len()].concat();
                if all { local.clone() } else { format!("{local}.{swizzle}") }
            }
            _ => {
                let values: Vec<String> = slot.parts.iter().map(|part| part_value(slot.table, part, loaded)).collect();
                match values.as_slice() {
                    [value] => value.clone(),
                    _ => format!("vec{}u({})", values.len(), values.join(", ")),
                }
            }
        }
    }

    /// Locals for what codecs make of the leaves that are stored.
    fn encode_leaves(&self, access: &mut Access) {
        for leaf in self.traffic.stores.iter().filter(|leaf| self.placement.slots.contains_key(*leaf)) {
            let Some(codec) = self.placement.leaves.get(leaf).and_then(|declared| declared.codec.as_ref()) else {
                continue;
            };
            let encode = format!("encode_{}", codec.name);
            let store = format!("let {} = {encode}({leaf});", encoded(leaf));
            self.push_store(self.placement.slots[leaf].table, store, 0, access);
            access.codecs.insert((codec.name.clone(), encode));
        }
    }

    fn store_lanes(&self, loaded: &Loaded, access: &mut Access) {
        let lanes: BTreeSet<Lane> = self
            .words
            .iter()
            .filter(|(word, parts)| self.stores_any(parts) || (self.carries.table(word.0) && self.keeps_any(parts)))
            .map(|(word, _)| self.lane_of(*word).0)
            .collect();
        for lane in lanes {
            self.store_lane(lane, loaded, access);
        }
    }

    /// Stores a lane as a whole if at least half of it is new and what must stay is in registers, else word by word.
    fn store_lane(&self, lane: Lane, loaded: &Loaded, access: &mut Access) {
        let table = self.table(lane.0);
        let buffer = buffer_name(table);
        let target = format!("{buffer}[{buffer}_address({}u)]", lane.1);
        access.buffers.insert(buffer);
        let first = lane.1 * table.lane;
        let stores: Vec<WordStore> =
            (first..first + table.lane).map(|word| self.word_store((lane.0, word), loaded)).collect();
        let carries = self.carries.table(lane.0);
        let values = stores.iter().filter(|store| new_value(store, carries).is_some()).count();
        let lost = stores.iter().any(|store| matches!(store, WordStore::Keep(None)));
        if !lost && 2 * values >= stores.len() {
            let value = self.lane_value(lane, &stores);
            self.push_store(lane.0, format!("{target} = {value};"), 4 * table.lane, access);
            return;
        }
        for (store, component) in stores.iter().zip(COMPONENTS) {
            if let Some(value) = new_value(store, carries) {
                self.push_store(lane.0, format!("{target}.{component} = {value};"), 4, access);
            }
        }
    }

    fn push_store(&self, table: usize, store: String, bytes: u32, access: &mut Access) {
        let moved = matches!(self.carries, Carries::Tables(tables) if tables.contains_key(&table));
        let (stores, sum) = match moved {
            true => (&mut access.moved_stores, &mut access.moved_bytes),
            false => (&mut access.stores, &mut access.store_bytes),
        };
        stores.push(store);
        *sum += bytes;
    }

    fn word_store(&self, word: Word, loaded: &Loaded) -> WordStore {
        let Some(parts) = self.words.get(&word) else { return WordStore::Free };
        let keeps = self.keeps_any(parts);
        if !self.stores_any(parts) {
            let value = || loaded.words.get(&word).cloned();
            return if keeps { WordStore::Keep(value()) } else { WordStore::Free };
        }
        let old = if keeps { loaded.words.get(&word).map_or("0u", String::as_str) } else { "0u" };
        let mut value = old.to_owned();
        for part in parts.iter().filter(|part| self.traffic.stores.contains(part.leaf)) {
            let bits = self.bits_of(part);
            value = if part.bits.bits == 32 {
                bits
            } else {
                format!("insertBits({value}, {bits}, {}u, {}u)", part.bits.shift, part.bits.bits)
            };
        }
        WordStore::Value(value)
    }

    /// A part of a leaf as a word.
    fn bits_of(&self, part: &Part<'_>) -> String {
        let leaf = part.leaf;
        let Some(declared) = self.placement.leaves.get(leaf) else { return leaf.to_string() };
        if let Some(codec) = &declared.codec {
            return match codec.parts.len() {
                1 => encoded(leaf),
                _ => format!("{}.{}", encoded(leaf), COMPONENTS[part.component]),
            };
        }
        match declared.ty {
            LeafType::U32 => leaf.to_string(),
            LeafType::Real => format!("bitcast<u32>({leaf})"),
            LeafType::Vec2 | LeafType::Vec3 => format!("bitcast<u32>({leaf}.{})", COMPONENTS[part.component]),
        }
    }

    /// The words of a lane as one value; a vector that stands side by side is written as one.
    fn lane_value(&self, lane: Lane, stores: &[WordStore]) -> String {
        let first = lane.1 * stores.len() as u32;
        let mut values = Vec::new();
        let mut at = 0;
        while at < stores.len() {
            let word = (lane.0, first + at as u32);
            let (value, words) = match (self.whole_vector(word, stores.len() - at), &stores[at]) {
                (Some((leaf, words)), WordStore::Value(_)) => (format!("bitcast<vec{words}u>({leaf})"), words),
                (_, WordStore::Value(value) | WordStore::Keep(Some(value))) => (value.clone(), 1),
                _ => ("0u".to_owned(), 1),
            };
            values.push(value);
            at += words;
        }
        match values.as_slice() {
            [value] => value.clone(),
            _ => format!("vec{}u({})", stores.len(), values.join(", ")),
        }
    }

    /// The stored vector leaf whose words are this one and those right behind it, at most `room`.
    fn whole_vector(&self, word: Word, room: usize) -> Option<(&Leaf, usize)> {
        let parts = self.words.get(&word)?;
        let [part] = parts.iter().filter(|part| self.traffic.stores.contains(part.leaf)).collect::<Vec<_>>()[..] else {
            return None;
        };
        if self.placement.leaves.get(part.leaf)?.codec.is_some() {
            return None;
        }
        let words = &self.placement.slots.get(part.leaf)?.parts;
        let together = words.iter().zip(word.1..).all(|(own, expected)| own.word == expected);
        let fits = part.component == 0 && words.len() > 1 && words.len() <= room;
        (fits && together).then_some((part.leaf, words.len()))
    }
}

/// What has to be stored, if anything: what is new, and where words are carried also what stays.
fn new_value(store: &WordStore, carries: bool) -> Option<&str> {
    match store {
        WordStore::Value(value) => Some(value),
        WordStore::Keep(Some(value)) if carries => Some(value),
        _ => None,
    }
}

/// A part of a leaf, out of the word that holds it.
fn part_value(table: usize, part: &Bits, loaded: &Loaded) -> String {
    let word = loaded.words.get(&(table, part.word)).map_or("", String::as_str);
    if part.bits == 32 { word.to_owned() } else { format!("extractBits({word}, {}u, {}u)", part.shift, part.bits) }
}

/// The local that holds what a codec made of a leaf.
fn encoded(leaf: &Leaf) -> String {
    format!("{}_bits", leaf.to_string().replace('.', "_"))
}
