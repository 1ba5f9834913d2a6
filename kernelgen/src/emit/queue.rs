//! Queues: the module `queue`.

use super::dense::Dense;
use super::text::{stage_constant, stream_constant};
use crate::config::model::QueueKind;
use std::fmt::Write;

/// Slots that an invocation looks at to put paths in order.
const ORDER_TURNS: u32 = 8;

/// Slots that a workgroup of so many threads puts in order.
pub(super) fn order_block(workgroup: u32) -> u32 {
    ORDER_TURNS * workgroup
}

/// Every queue of the program: one a kernel of the loop, one a batched stream.
#[derive(Clone, Debug)]
pub(super) struct Queues {
    /// Stages that kernels of the loop begin with, in the order in which a round runs them.
    pub stages: Vec<String>,
    /// Those of them that take their paths in the order of slots.
    pub ordered: Vec<String>,
    /// The one of them whose kernel gives its paths slots side by side.
    pub packed: Option<String>,
    /// The loop whose paths stand side by side.
    pub dense: Option<Dense>,
    /// Batched streams.
    pub streams: Vec<String>,
    /// How a path finds its place; with `None`, paths are marked instead.
    pub kind: QueueKind,
    /// Whether a slot whose path is over takes the next.
    pub regenerates: bool,
    /// Threads in a workgroup of the kernels that take from them.
    pub workgroup: u32,
}

impl Queues {
    /// No queue.
    pub(super) fn none(workgroup: u32) -> Queues {
        let (stages, ordered, streams) = (Vec::new(), Vec::new(), Vec::new());
        Queues {
            stages,
            ordered,
            packed: None,
            dense: None,
            streams,
            kind: QueueKind::None,
            regenerates: false,
            workgroup,
        }
    }

    /// Queues in all.
    pub(super) fn count(&self) -> u32 {
        (self.stages.len() + self.streams.len()) as u32
    }

    /// The number of a stage's queue, also its slot in the arguments buffer.
    pub(super) fn of_stage(&self, stage: &str) -> Option<u32> {
        self.stages.iter().position(|name| name == stage).map(|index| index as u32)
    }

    /// The number of a stream's queue.
    pub(super) fn of_stream(&self, stream: &str) -> Option<u32> {
        let index = self.streams.iter().position(|name| name == stream)?;
        Some((self.stages.len() + index) as u32)
    }

    /// Whether a stage takes its paths in the order of slots.
    pub(super) fn is_ordered(&self, stage: &str) -> bool {
        self.ordered.iter().any(|name| name == stage)
    }

    /// Whether the paths of a stage's kernel move into slots side by side.
    pub(super) fn is_packed(&self, stage: &str) -> bool {
        self.packed.as_deref() == Some(stage)
    }

    /// Whether a stage takes paths that stand side by side.
    pub(super) fn is_dense(&self, stage: &str) -> bool {
        self.dense.as_ref().is_some_and(|dense| dense.inside.contains(stage))
    }

    /// Whether a loop whose paths stand side by side begins with this stage.
    pub(super) fn is_first_of_dense(&self, stage: &str) -> bool {
        self.dense.as_ref().is_some_and(|dense| dense.first == stage)
    }

    /// Words that the kernel of a queue moves to find a path: its entry, its slot where it stands in a place, its number where it gets
    /// another slot.
    pub(super) fn entry_words(&self, stage: &str) -> u32 {
        let entry = u32::from(!self.is_first_of_dense(stage));
        entry + u32::from(self.is_packed(stage)) + u32::from(self.is_dense(stage))
    }

    /// Whether slots know the numbers of their paths, which do not follow from theirs.
    pub(super) fn numbers_paths(&self) -> bool {
        self.regenerates || self.packed.is_some()
    }

    /// Whether paths wait for a stage in their slots, not in its queue.
    pub(super) fn is_waited_for_in_slots(&self, stage: &str) -> bool {
        self.kind == QueueKind::None || self.is_ordered(stage)
    }

    /// Whether paths wait in their slots for any stage.
    fn waits_in_slots(&self) -> bool {
        self.kind == QueueKind::None || !self.ordered.is_empty()
    }

    /// Whether paths find their place in a stage's queue by those of their workgroup.
    pub(super) fn stands_in(&self, stage: &str) -> bool {
        self.kind == QueueKind::Workgroup && !self.is_ordered(stage)
    }

    /// Whether the records that a workgroup pushes to a stream are counted together.
    pub(super) fn gathers(&self) -> bool {
        matches!(self.kind, QueueKind::Workgroup | QueueKind::None)
    }
}

/// `package::queue`: how paths wait for stages.
pub(super) fn queue_module(queues: &Queues) -> String {
    let kind = queues.kind;
    let mut text = String::from(
        "import package::control::{control, waiting, waiting_word};\n\
         import package::pass::{path_count, path_id, pass_info};\n\n",
    );
    for (stage, number) in queues.stages.iter().zip(0..) {
        let _ = writeln!(text, "const {}: u32 = {number}u;", stage_constant(stage));
    }
    for (stream, number) in queues.streams.iter().zip(queues.stages.len()..) {
        let _ = writeln!(text, "const {}: u32 = {number}u;", stream_constant(stream));
    }
    let (count, parts) = (queues.count(), queues.workgroup.div_ceil(32));
    let _ = write!(
        text,
        "\n/// Queues in all.\n\
         const QUEUES: u32 = {count}u;\n\n\
         /// Those of stages, the first ones.\n\
         const STAGE_QUEUES: u32 = {stages}u;\n\n\
         /// Threads of the workgroups that take from queues.\n\
         const WORKGROUP_THREADS: u32 = {}u;\n\n\
         /// Parts of 32 invocations that a workgroup has.\n\
         const WORKGROUP_PARTS: u32 = {parts}u;\n\n\
         /// One a queue and part of a workgroup.\n\
         const SHARES: u32 = {}u;\n",
        queues.workgroup,
        count * parts,
        stages = queues.stages.len(),
    );
    text.push_str(QUEUE);
    text.push_str(PLACES);
    if kind != QueueKind::None {
        text.push_str(STAND);
    }
    if queues.waits_in_slots() {
        text.push_str(WAIT);
    }
    match kind {
        QueueKind::Atomic => text.push_str(ENQUEUE_ATOMIC),
        QueueKind::Subgroup => text.push_str(ENQUEUE_SUBGROUP),
        QueueKind::Workgroup => {}
        QueueKind::None => text.push_str(TAKES),
    }
    if !queues.ordered.is_empty() {
        let _ = write!(
            text,
            "\n/// Slots that an invocation looks at to put paths in order.\nconst ORDER_TURNS: u32 = {ORDER_TURNS}u;\n"
        );
        text.push_str(ORDER);
    }
    if queues.packed.is_some() {
        text.push_str(PACK);
    }
    if queues.dense.is_some() {
        text = format!("import package::control::CONTROL_WALKS;\n{text}{WALK_PLACES}");
    }
    text.push_str(APPEND);
    if queues.regenerates {
        text =
            format!("import package::control::CONTROL_TAKEN;\nimport package::pass::path_numbers;\n{text}{TAKE_NEXT}");
    }
    let threads = match kind {
        QueueKind::None => {
            format!("select(entries, pass_info.slots, entries > 0u && number < {}u)", queues.stages.len())
        }
        _ => "entries".to_owned(),
    };
    let _ = write!(
        text,
        "{START_QUEUE}    let groups = ({threads} + {}u) / {}u;{SIZE_DISPATCH_END}",
        queues.workgroup - 1,
        queues.workgroup
    );
    text
}

const QUEUE: &str = r"
/// Path slots that wait, `path_count` places a queue.
var<storage, read_write> queue: array<u32>;

/// Workgroups of the indirect dispatches, three words a queue.
var<storage, read_write> arguments: array<u32>;
";

const ENQUEUE_ATOMIC: &str = r"
/// Appends this path to a queue where `wanted`.
fn enqueue(number: u32, wanted: bool, path: u32, lane: u32) {
    if wanted {
        let place = atomicAdd(&control[waiting_word(number)], 1u);
        queue[number * path_count + place] = path;
    }
}
";

const ENQUEUE_SUBGROUP: &str = r"
/// Appends this path to a queue where `wanted`, with one atomic a subgroup. To be called by all invocations of a workgroup.
fn enqueue(number: u32, wanted: bool, path: u32, lane: u32) {
    let ballot = countOneBits(subgroupBallot(wanted));
    let survivors = ballot.x + ballot.y + ballot.z + ballot.w;
    let rank = subgroupExclusiveAdd(select(0u, 1u, wanted));
    var base = 0u;
    if subgroupExclusiveAdd(1u) == 0u && survivors > 0u {
        base = atomicAdd(&control[waiting_word(number)], survivors);
    }
    base = subgroupBroadcastFirst(base);
    if wanted {
        queue[number * path_count + base + rank] = path;
    }
}
";

/// All invocations of a device on one word would wait for one another: a workgroup counts on its own, and takes places in all queues
/// at once.
const PLACES: &str = r"
/// What comes from each part of this workgroup to each queue; then where its places begin.
var<workgroup> shares: array<atomic<u32>, SHARES>;

/// Asks for a place in a queue where `wanted`; returns the rank of this invocation, `lane` of its workgroup, among 32 neighbours.
fn ask_place(number: u32, wanted: bool, lane: u32) -> u32 {
    if !wanted {
        return 0u;
    }
    return atomicAdd(&shares[number * WORKGROUP_PARTS + lane / 32u], 1u);
}

/// Takes places for all that have asked, with one atomic a queue. Neighbours get places side by side. `lane` numbers the invocations,
/// which must all call it, once.
fn take_places(lane: u32) {
    workgroupBarrier();
    for (var number = lane; number < QUEUES; number += WORKGROUP_THREADS) {
        let first = number * WORKGROUP_PARTS;
        var count = 0u;
        for (var part = 0u; part < WORKGROUP_PARTS; part += 1u) {
            count += atomicLoad(&shares[first + part]);
        }
        if count > 0u {
            var place = atomicAdd(&control[waiting_word(number)], count);
            for (var part = 0u; part < WORKGROUP_PARTS; part += 1u) {
                place += atomicExchange(&shares[first + part], place);
            }
        }
    }
    workgroupBarrier();
}

/// The place that was taken for this invocation.
fn place_of(number: u32, rank: u32, lane: u32) -> u32 {
    return atomicLoad(&shares[number * WORKGROUP_PARTS + lane / 32u]) + rank;
}
";

/// Paths stand in queues.
const STAND: &str = r"
/// Puts this path into its place of a queue where `wanted`.
fn stand(number: u32, wanted: bool, path: u32, rank: u32, lane: u32) {
    if wanted {
        queue[number * path_count + place_of(number, rank, lane)] = path;
    }
}
";

/// Paths wait in their slots.
const WAIT: &str = r"
/// The stage that a path waits for in its slot, its number plus one; 0: none.
var<storage, read_write> waits_for: array<u32>;

/// Lets this path wait for a stage where `wanted`.
fn wait_for(number: u32, wanted: bool, path: u32) {
    if wanted {
        waits_for[path] = number + 1u;
    }
}
";

/// Dispatches of stages have an invocation for every slot then, or none where no path waits.
const TAKES: &str = r"
/// Whether the path of a slot waits for a stage, which takes it then.
fn takes(number: u32, path: u32) -> bool {
    if path >= pass_info.slots || waits_for[path] != number + 1u {
        return false;
    }
    waits_for[path] = 0u;
    return true;
}
";

const ORDER: &str = r"
/// Slots side by side that a workgroup looks at.
const ORDER_BLOCK: u32 = ORDER_TURNS * WORKGROUP_THREADS;

/// Words of a bit each.
const ORDER_WORDS: u32 = ORDER_BLOCK / 32u;

/// The slots of the block whose paths wait.
var<workgroup> waiting_slots: array<atomic<u32>, ORDER_WORDS>;
/// How many of them stand before each word.
var<workgroup> waiting_before: array<u32, ORDER_WORDS>;
/// The place of the first.
var<workgroup> waiting_place: u32;

/// Takes the paths of a block of slots that wait for a queue into it, in the order of their slots and in places side by side. To be
/// called by all invocations of a workgroup.
fn take_in_order(number: u32, block: u32, lane: u32) {
    for (var turn = 0u; turn < ORDER_TURNS; turn += 1u) {
        let slot = turn * WORKGROUP_THREADS + lane;
        let path = block * ORDER_BLOCK + slot;
        if path < pass_info.slots && waits_for[path] == number + 1u {
            waits_for[path] = 0u;
            atomicOr(&waiting_slots[slot / 32u], 1u << (slot % 32u));
        }
    }
    workgroupBarrier();
    if lane < ORDER_WORDS {
        var before = 0u;
        for (var word = 0u; word < lane; word += 1u) {
            before += countOneBits(atomicLoad(&waiting_slots[word]));
        }
        waiting_before[lane] = before;
        let count = before + countOneBits(atomicLoad(&waiting_slots[lane]));
        if lane == ORDER_WORDS - 1u && count > 0u {
            waiting_place = atomicAdd(&control[waiting_word(number) + 1u], count);
        }
    }
    workgroupBarrier();
    for (var turn = 0u; turn < ORDER_TURNS; turn += 1u) {
        let slot = turn * WORKGROUP_THREADS + lane;
        let word = atomicLoad(&waiting_slots[slot / 32u]);
        let bit = 1u << (slot % 32u);
        if (word & bit) != 0u {
            let place = waiting_place + waiting_before[slot / 32u] + countOneBits(word & (bit - 1u));
            queue[number * path_count + place] = block * ORDER_BLOCK + slot;
        }
    }
}

/// Makes the kernel of a queue take what is then put into it, instead of what waits in it.
fn open_order(number: u32) {
    atomicStore(&control[waiting_word(number) + 1u], 0u);
}
";

/// Of the paths that a workgroup takes from a queue in order, those of one block of slots have all slots between the first and the last
/// of them to themselves, if no path waits elsewhere.
const PACK: &str = r"
/// Notes whether all paths alive wait for one queue.
fn note_whether_all_wait(number: u32) {
    var others = 0u;
    for (var other = 0u; other < STAGE_QUEUES; other += 1u) {
        if other != number {
            others += waiting(other);
        }
    }
    atomicStore(&control[waiting_word(number) + 2u], select(0u, 1u, others == 0u));
}

/// The slot in which this path goes on, at place `index` of a queue: behind those of its block before it, without a gap. `lane` is its
/// invocation's number in the workgroup. All of the workgroup must have read what they need of their old slots.
fn packed_slot(number: u32, index: u32, lane: u32) -> u32 {
    if atomicLoad(&control[waiting_word(number) + 2u]) == 0u {
        return path_id;
    }
    let first_place = number * path_count;
    let block = path_id / ORDER_BLOCK;
    var first = index - lane;
    var last = index;
    while first < last {
        let middle = (first + last) / 2u;
        if queue[first_place + middle] / ORDER_BLOCK == block {
            last = middle;
        } else {
            first = middle + 1u;
        }
    }
    return queue[first_place + first] + index - first;
}
";

/// Places of two turns: one is read, the other written.
const WALK_PLACES: &str = r"
/// The slots of the paths that stand side by side, by place.
var<storage, read_write> walk_slots: array<u32>;

/// Where the places of this turn begin.
fn walk_places() -> u32 {
    return atomicLoad(&control[CONTROL_WALKS]);
}

/// Where those of the next begin.
fn next_walk_places() -> u32 {
    return path_count - walk_places();
}

/// The paths of all slots in use stand in a queue, which is empty.
fn all_stand(number: u32, slot: u32) {
    if slot == 0u {
        atomicStore(&control[waiting_word(number)], pass_info.slots);
    }
}

/// Begins a turn.
fn turn_walk_places() {
    atomicStore(&control[CONTROL_WALKS], next_walk_places());
}
";

/// Stages push where they please, so neighbours need not be there together: no subgroup operation can be relied on.
const APPEND: &str = r"
/// Takes the next place of a stream.
fn append(number: u32) -> u32 {
    return atomicAdd(&control[waiting_word(number)], 1u);
}
";

const TAKE_NEXT: &str = r"
/// Paths of this workgroup that are over.
var<workgroup> endings: atomic<u32>;
/// The first path that their slots take.
var<workgroup> first_taken: u32;

/// Gives a slot whose path is over the next path of the pass, and says whether there was one. One atomic a workgroup; `lane` numbers
/// its invocations, which must all call it.
fn take_next_path(over: bool, path: u32, lane: u32) -> bool {
    if lane == 0u {
        atomicStore(&endings, 0u);
    }
    workgroupBarrier();
    var rank = 0u;
    if over {
        rank = atomicAdd(&endings, 1u);
    }
    workgroupBarrier();
    if lane == 0u && atomicLoad(&endings) > 0u {
        first_taken = atomicAdd(&control[CONTROL_TAKEN], atomicLoad(&endings));
    }
    workgroupBarrier();
    let number = first_taken + rank;
    if !over || number >= pass_info.paths {
        return false;
    }
    path_numbers[path] = number;
    return true;
}
";

const START_QUEUE: &str = r"
/// Hands what waits in a queue, at most `capacity`, to its kernel and says how many that is.
fn start_queue(number: u32, capacity: u32) -> u32 {
    return size_dispatch(number, min(atomicExchange(&control[waiting_word(number)], 0u), capacity));
}

/// As `start_queue` if `coming` further entries might find no room behind those that wait, else lets them wait.
fn start_full_queue(number: u32, capacity: u32, coming: u32) -> u32 {
    let room = capacity - min(waiting(number), capacity);
    if coming <= room {
        return size_dispatch(number, 0u);
    }
    return start_queue(number, capacity);
}

/// Makes the kernel of a queue take so many entries.
fn size_dispatch(number: u32, entries: u32) -> u32 {
    atomicStore(&control[waiting_word(number) + 1u], entries);
";

const SIZE_DISPATCH_END: &str = r"
    arguments[3u * number] = min(groups, 65535u);
    arguments[3u * number + 1u] = (groups + 65534u) / 65535u;
    arguments[3u * number + 2u] = 1u;
    return entries;
}
";
