//! Counters of a pass: the module `control`.

use super::queue::Queues;
use crate::plan::{Counter, EntryWords};
use std::fmt::Write;

/// Words from one queue's counters to the next, a cache line of 128 bytes: a device adds to one line at a time.
const STRIDE: u32 = 32;

/// Words of the control buffer before those of the queues and of the carries, by name; all but the last are counters that the host reads.
const WORDS: [&str; 8] =
    ["rays_primary", "rays_secondary", "rays_deep", "rays_visibility", "rejected", "overflow", "unfinished", "round"];
/// Kinds of rays: the first words count them, and as many behind the last how often those ran over.
const RAY_KINDS: u32 = 4;

/// The counters that the host reads.
pub(super) fn counters() -> impl Iterator<Item = Counter> {
    let counted = WORDS.iter().zip(0..).take(WORDS.len() - 1);
    let words = counted.clone().map(|(name, word)| Counter { name: (*name).to_owned(), word, shift: 0 });
    let carry = |word| word + WORDS.len() as u32;
    let carried = counted.take(RAY_KINDS as usize);
    words.chain(carried.map(move |(name, word)| Counter { name: (*name).to_owned(), word: carry(word), shift: 32 }))
}

/// The words that say how many entries the kernel of a queue takes.
pub(super) fn entry_words() -> EntryWords {
    EntryWords { first: STRIDE + 1, stride: STRIDE }
}

impl Queues {
    /// Words of the control buffer.
    pub(super) fn control_words(&self) -> u32 {
        self.walks_word() + u32::from(self.dense.is_some())
    }

    /// The word that counts the paths which slots have taken, behind those of the queues.
    fn taken_word(&self) -> u32 {
        STRIDE * (1 + self.count())
    }

    /// The word that says where the places of a turn begin.
    fn walks_word(&self) -> u32 {
        self.taken_word() + u32::from(self.regenerates)
    }
}

/// `package::control`: counters that kernels and host share.
pub(super) fn module(queues: &Queues, rounds: u32) -> String {
    let mut text = String::new();
    for (name, word) in WORDS.iter().zip(0..) {
        let _ = writeln!(text, "const CONTROL_{}: u32 = {word}u;", name.to_uppercase());
    }
    let _ = write!(
        text,
        "/// Words in all.\n\
         const CONTROL_WORDS: u32 = {}u;\n\n\
         /// Rounds after which no path may be alive.\n\
         const ROUNDS: u32 = {rounds}u;\n\n\
         /// Counters of a pass, then words at the head of a line for each queue: how many wait in it, how many its running kernel takes, whether all paths alive waited in it.\n\
         var<storage, read_write> control: array<atomic<u32>>;\n\n\
         /// The word that counts what waits in a queue.\n\
         fn waiting_word(number: u32) -> u32 {{\n    return {STRIDE}u * (1u + number);\n}}\n\n\
         /// How many entries wait in a queue.\n\
         fn waiting(number: u32) -> u32 {{\n    return atomicLoad(&control[waiting_word(number)]);\n}}\n\n\
         /// How many entries the kernel of a queue takes.\n\
         fn running(number: u32) -> u32 {{\n    return atomicLoad(&control[waiting_word(number) + 1u]);\n}}\n",
        queues.control_words(),
    );
    if queues.regenerates {
        let word = queues.taken_word();
        let _ = write!(text, "\n/// Paths of the pass that slots have taken.\nconst CONTROL_TAKEN: u32 = {word}u;\n");
    }
    if queues.dense.is_some() {
        let word = queues.walks_word();
        let _ = write!(text, "\n/// Where the places of this turn begin.\nconst CONTROL_WALKS: u32 = {word}u;\n");
    }
    let _ = write!(
        text,
        "\n/// From the words that count rays to those that count their overflows.\nconst CARRY: u32 = {}u;\n",
        WORDS.len()
    );
    text.push_str(COUNT_RAYS);
    text.push_str(COUNT_WALK_RAYS);
    text.push_str(FUSED);
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

const COUNT_RAYS: &str = r"
/// Counts rays: of a pass, more than 32 bits hold.
fn count_rays(word: u32, rays: u32) {
    if atomicAdd(&control[word], rays) > 0xffffffffu - rays {
        atomicAdd(&control[word + CARRY], 1u);
    }
}

/// Counts one ray of this invocation.
fn count_ray(word: u32) {
    count_rays(word, 1u);
}
";

/// What kernels of several stages count by themselves: nobody else knows what happens in them.
const FUSED: &str = r"
/// How many rounds have begun.
fn rounds_begun() -> u32 {
    return atomicLoad(&control[CONTROL_ROUND]);
}

/// A walk ray of a round: primary, secondary, deep and visibility rays.
fn walk_ray(round: u32) -> vec4u {
    return vec4u(vec3<u32>(vec3<bool>(round <= 1u, round == 2u, round > 2u)), 0u);
}

/// Rays of this workgroup.
var<workgroup> rays_share: array<atomic<u32>, 4>;

/// Adds rays, with one atomic a workgroup; `lane` numbers its invocations, which must all call it.
fn add_rays(rays: vec4u, lane: u32) {
    for (var kind = 0u; kind < 4u; kind += 1u) {
        if rays[kind] > 0u {
            atomicAdd(&rays_share[kind], rays[kind]);
        }
    }
    workgroupBarrier();
    if lane < 4u {
        let counted = atomicLoad(&rays_share[lane]);
        if counted > 0u {
            count_rays(CONTROL_RAYS_PRIMARY + lane, counted);
        }
    }
}

/// Counts a path that is given up.
fn count_unfinished() {
    atomicAdd(&control[CONTROL_UNFINISHED], 1u);
}
";
