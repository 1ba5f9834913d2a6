//! Queues and counters: the modules `control` and `queue`, and the kernels that run between the stages.

use super::text::Imports;
use crate::config::model::{QueueKind, RayKind};
use std::fmt::Write;

/// Words of the control buffer before those of the queues, by name; all but the last are counters that the host reads.
const WORDS: [&str; 8] =
    ["rays_primary", "rays_secondary", "rays_deep", "rays_visibility", "rejected", "overflow", "unfinished", "round"];

/// The counters that the host reads, with their words.
pub(super) fn counters() -> impl Iterator<Item = (&'static str, u32)> {
    WORDS.iter().copied().zip(0..).take(WORDS.len() - 1)
}

/// Every queue of the program: one a stage of the loop, one a batched stream.
#[derive(Clone, Debug, Default)]
pub(super) struct Queues {
    /// Stages, in the order in which a round runs them.
    pub stages: Vec<String>,
    /// Batched streams.
    pub streams: Vec<String>,
    /// Threads in a workgroup of the kernels that take from them.
    pub workgroup: u32,
}

impl Queues {
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

    /// Words of the control buffer.
    pub(super) fn control_words(&self) -> u32 {
        WORDS.len() as u32 + 2 * self.count()
    }
}

/// The WGSL constant of a stage's queue.
pub(super) fn stage_constant(stage: &str) -> String {
    format!("QUEUE_{}", stage.to_uppercase())
}

/// The WGSL constant of a stream's queue.
pub(super) fn stream_constant(stream: &str) -> String {
    format!("STREAM_{}", stream.to_uppercase())
}

/// `package::control`: counters that kernels and host share.
pub(super) fn control_module(queues: &Queues) -> String {
    let mut text = String::new();
    for (name, word) in WORDS.iter().zip(0..) {
        let _ = writeln!(text, "const CONTROL_{}: u32 = {word}u;", name.to_uppercase());
    }
    let _ = write!(
        text,
        "/// Words in all.\n\
         const CONTROL_WORDS: u32 = {}u;\n\n\
         /// Counters of a pass, then two words a queue: how many wait in it, how many its running kernel takes.\n\
         var<storage, read_write> control: array<atomic<u32>>;\n\n\
         /// The word that counts what waits in a queue.\n\
         fn waiting_word(number: u32) -> u32 {{\n    return {}u + 2u * number;\n}}\n\n\
         /// How many entries the kernel of a queue takes.\n\
         fn running(number: u32) -> u32 {{\n    return atomicLoad(&control[{}u + 2u * number]);\n}}\n",
        queues.control_words(),
        WORDS.len(),
        WORDS.len() + 1,
    );
    text.push_str(COUNT_WALK_RAYS);
    text.push_str(COUNT_RAY);
    text
}

const COUNT_WALK_RAYS: &str = r"
/// The counter of this round's walk rays; `CONTROL_ROUND` holds the rounds begun.
fn walk_rays_word() -> u32 {
    let round = atomicLoad(&control[CONTROL_ROUND]);
    if round <= 1u {
        return CONTROL_RAYS_PRIMARY;
    }
    return select(CONTROL_RAYS_DEEP, CONTROL_RAYS_SECONDARY, round == 2u);
}
";

const COUNT_RAY: &str = r"
/// Counts one ray of this invocation.
fn count_ray(word: u32) {
    atomicAdd(&control[word], 1u);
}
";

/// `package::queue`: how paths wait for stages.
pub(super) fn queue_module(queues: &Queues, kind: QueueKind) -> String {
    let mut text = String::from(
        "import package::control::{control, waiting_word};\n\
         import package::pass::path_count;\n\n",
    );
    for (stage, number) in queues.stages.iter().zip(0..) {
        let _ = writeln!(text, "const {}: u32 = {number}u;", stage_constant(stage));
    }
    for (stream, number) in queues.streams.iter().zip(queues.stages.len()..) {
        let _ = writeln!(text, "const {}: u32 = {number}u;", stream_constant(stream));
    }
    text.push_str(QUEUE);
    text.push_str(match kind {
        QueueKind::Atomic => ENQUEUE_ATOMIC,
        QueueKind::Subgroup => ENQUEUE_SUBGROUP,
    });
    text.push_str(APPEND);
    let _ = write!(
        text,
        "{START_QUEUE}    let groups = (entries + {}u) / {}u;{START_QUEUE_END}",
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
fn enqueue(number: u32, wanted: bool, path: u32) {
    if wanted {
        let place = atomicAdd(&control[waiting_word(number)], 1u);
        queue[number * path_count + place] = path;
    }
}
";

const ENQUEUE_SUBGROUP: &str = r"
/// Appends this path to a queue where `wanted`, with one atomic a subgroup. To be called by all invocations of a workgroup.
fn enqueue(number: u32, wanted: bool, path: u32) {
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

/// Stages push where they please, so neighbours need not be there together: no subgroup operation can be relied on.
const APPEND: &str = r"
/// Takes the next place of a stream.
fn append(number: u32) -> u32 {
    return atomicAdd(&control[waiting_word(number)], 1u);
}
";

const START_QUEUE: &str = r"
/// Hands what waits in a queue, at most `capacity`, to its kernel and says how many that is.
fn start_queue(number: u32, capacity: u32) -> u32 {
    let word = waiting_word(number);
    let entries = min(atomicExchange(&control[word], 0u), capacity);
    atomicStore(&control[word + 1u], entries);
";

const START_QUEUE_END: &str = r"
    arguments[3u * number] = min(groups, 65535u);
    arguments[3u * number + 1u] = (groups + 65534u) / 65535u;
    arguments[3u * number + 2u] = 1u;
    return entries;
}
";

/// The kernel that zeroes the control buffer. Rays of the start stage, which takes every slot, are counted here.
pub(super) fn begin_kernel(start_rays: Option<RayKind>) -> String {
    let mut imports = Imports::default();
    imports.add("control", ["control", "CONTROL_WORDS"]);
    let first = match start_rays {
        None => "0u".to_owned(),
        Some(kind) => {
            let word = match kind {
                RayKind::Walk => "CONTROL_RAYS_PRIMARY",
                RayKind::Visibility => "CONTROL_RAYS_VISIBILITY",
            };
            imports.add("control", [word]);
            imports.add("pass", ["pass_info"]);
            format!("select(0u, pass_info.slots, word == {word})")
        }
    };
    format!(
        "{imports}\n\
         /// Clears the counters of the pass before.\n\
         @compute @workgroup_size(64)\n\
         fn begin_main(@builtin(local_invocation_index) lane: u32) {{\n    \
             for (var word = lane; word < CONTROL_WORDS; word += 64u) {{\n        \
                 atomicStore(&control[word], {first});\n    \
             }}\n\
         }}\n"
    )
}

/// A capacity as text.
pub(super) fn multiple_of_path_count(factor: u32) -> String {
    if factor == 1 { "path_count".to_owned() } else { format!("{factor}u * path_count") }
}

/// What a prepare kernel does for one queue.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    /// The WGSL constant of the queue.
    pub constant: String,
    /// Entries that it has room for, in units of `path_count`.
    pub capacity: u32,
    /// What its rays are counted as.
    pub rays: Option<RayKind>,
}

/// The kernel before the stages of some queues.
pub(super) fn prepare_kernel(name: &str, first_of_round: bool, queues: &[Prepared]) -> String {
    let mut imports = Imports::default();
    let mut body = String::new();
    imports.add("queue", ["start_queue"]);
    imports.add("pass", ["path_count"]);
    if first_of_round {
        imports.add("control", ["control", "CONTROL_ROUND"]);
        body.push_str("    atomicAdd(&control[CONTROL_ROUND], 1u);\n");
    }
    for prepared in queues {
        imports.add("queue", [prepared.constant.as_str()]);
        let capacity = multiple_of_path_count(prepared.capacity);
        let call = format!("start_queue({}, {capacity})", prepared.constant);
        let _ = match prepared.rays {
            None => writeln!(body, "    {call};"),
            Some(kind) => {
                let word = match kind {
                    RayKind::Walk => "walk_rays_word",
                    RayKind::Visibility => "CONTROL_RAYS_VISIBILITY",
                };
                imports.add("control", ["control", word]);
                let word = if kind == RayKind::Walk { "walk_rays_word()" } else { word };
                writeln!(body, "    atomicAdd(&control[{word}], {call});")
            }
        };
    }
    format!(
        "{imports}\n\
         /// Sizes the dispatches that follow by what waits for them.\n\
         @compute @workgroup_size(1)\n\
         fn {name}_main() {{\n{body}}}\n"
    )
}

/// The kernel after the loop: whatever still waits was cut off.
pub(super) fn finish_kernel(queues: &Queues) -> String {
    let mut imports = Imports::default();
    imports.add("control", ["control", "waiting_word", "CONTROL_UNFINISHED"]);
    format!(
        "{imports}\n\
         /// Counts what still waits: more than none means that the rounds did not suffice.\n\
         @compute @workgroup_size(1)\n\
         fn finish_main() {{\n    \
             var left = 0u;\n    \
             for (var number = 0u; number < {}u; number += 1u) {{\n        \
                 left += atomicLoad(&control[waiting_word(number)]);\n    \
             }}\n    \
             atomicStore(&control[CONTROL_UNFINISHED], left);\n\
         }}\n",
        queues.count()
    )
}
