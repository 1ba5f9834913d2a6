//! The plan: what the runtime allocates and runs, as data. The runtime interprets it and knows no stage and no field by name.

use crate::config::model::{Accumulate, RayKind};
use serde::Serialize;

/// `path_count` is a multiple of this: so many slots fill whole workgroups and whole blocks of every layout, and a stream may have room
/// for a fraction of a record per slot.
pub const SLOT_GRAIN: u32 = 1024;

/// Buffers, kernels and the program of one pass.
///
/// A pass takes `active` path slots (at most `slots_per_grain` of every `SLOT_GRAIN` that there are) through the program once, with as
/// many paths, or up to `paths_per_slot` times as many. The runtime writes the `pass_info` uniform (see `Role::Pass`) before it.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// What the runtime allocates or provides; kernels name them by index.
    pub buffers: Vec<Buffer>,
    /// The kernels; every text is a whole WGSL module, validated.
    pub kernels: Vec<Kernel>,
    /// The steps of one pass, in order.
    pub program: Vec<Step>,
    /// Words of the control buffer that the host reads after a pass; all are zeroed by the program's first step and count one pass.
    pub counters: Vec<Counter>,
    /// Where the control buffer says how many entries the kernel of each queue takes.
    pub entries: EntryWords,
    /// Bytes that joining a queue takes, an entry or a record, one for each triple of the arguments buffer.
    pub pushed_bytes: Vec<u32>,
    /// The triple of the stage that a loop begins with whose paths stand side by side, if there is one: what joins it has moved the
    /// kernel's `moved_bytes`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dense: Option<u32>,
    /// Tallies, where kernels use one: each has its own part of the buffers of `Role::TallyCounts` and `Role::TallyRates`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tallies: Vec<Tally>,
    /// Groups of film planes behind the picture, where kernels add to them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<Layers>,
    /// How film words are to be read.
    pub film: Accumulate,
    /// Bytes of state a path slot takes, rays in flight left out where the layout keeps them apart.
    pub bytes_per_path: u32,
    /// Bytes of its rays in flight, where the layout keeps them apart.
    pub ray_bytes_per_path: u32,
    /// Slots that a pass may use of every `SLOT_GRAIN`: all, unless a stream has less room than all could fill in one round.
    pub slots_per_grain: u32,
    /// Paths that a pass may have for each slot that it uses: where it has more paths than slots, a slot whose path is over takes the
    /// next.
    pub paths_per_slot: u32,
    /// Whether kernels use subgroup operations, f16, f64, 64-bit atomics or float atomics: features to ask of the adapter.
    pub needs: Needs,
}

/// Device features that the kernels use.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Needs {
    /// Subgroup operations.
    pub subgroup: bool,
    /// `atomic<i64>`.
    pub int64_atomics: bool,
    /// `atomic<f32>`.
    pub float32_atomics: bool,
}

/// Words of the control buffer, one for each triple of the arguments buffer: from when the kernels before an indirect dispatch are done
/// until it is, the word holds how many paths, or records of a stream, it takes. The word before it holds how many wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct EntryWords {
    /// That of triple 0.
    pub first: u32,
    /// From one to the next.
    pub stride: u32,
}

impl EntryWords {
    /// The word of a triple.
    pub fn of_slot(self, slot: u32) -> u32 {
        self.first + self.stride * slot
    }

    /// The word that says how many wait for a triple's dispatch.
    pub fn waiting(self, slot: u32) -> u32 {
        self.of_slot(slot) - 1
    }
}

/// A tally's part of the counts and rates.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Its name.
    pub name: String,
    /// Its first word.
    pub first: u32,
    /// How many words it has.
    pub size: u32,
}

/// A group of planes of the film.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Layers {
    /// Its name.
    pub name: String,
    /// Its first plane; plane 0 is the picture.
    pub first: u32,
    /// How many planes it has.
    pub size: u32,
    /// The first word of the tally that corrects it: plane i goes into the picture divided by what paths counted at index i on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correct: Option<u32>,
}

impl Plan {
    /// Planes of the film: the picture and all layers.
    pub fn planes(&self) -> u32 {
        planes(&self.layers)
    }
}

/// Planes of a film with these layers.
pub(crate) fn planes(layers: &[Layers]) -> u32 {
    layers.iter().fold(1, |planes, group| group.size.saturating_add(planes))
}

/// A buffer.
#[derive(Clone, Debug, Serialize)]
pub struct Buffer {
    /// Its WGSL name.
    pub name: String,
    /// What it is for.
    pub role: Role,
    /// Its size; zero for those that the runtime provides.
    pub size: Size,
}

/// What a buffer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A table of path state.
    State,
    /// Queues of path slots.
    Queue,
    /// Counters that kernels and host share (storage, copy source).
    Control,
    /// Arguments of indirect dispatches, three words a slot (storage and indirect; never bound in a kernel that is dispatched indirectly).
    Arguments,
    /// Records of a stream.
    Stream,
    /// The film: plane by plane, three channels a pixel, interleaved, one f32 or i64 each. The runtime zeroes it at the start and reads it.
    Film,
    /// What stages count, a u32 an index of a tally. The runtime zeroes it at the start, reads it and zeroes it when it likes.
    TallyCounts,
    /// Counts of earlier samples for each path, an f32 an index of a tally; written by the runtime.
    TallyRates,
    /// Uniform, 32 bytes, written by the runtime before each pass: u32 first_pixel, first_sample, active, seed, paths, and three zeros.
    /// Path i of the pass, which slot i takes if there are so many, works on linear = first_pixel + i;
    /// sample = first_sample + linear / (width*height); pixel = tile order of linear % (width*height).
    Pass,
    /// A scene resource that the runtime provides under this name.
    Resource,
}

/// A size in bytes: fixed + per_path * path_count.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Size {
    /// Bytes whatever the number of paths.
    pub fixed: u64,
    /// Bytes a path slot.
    pub per_path: u64,
    /// Bytes a pixel.
    pub per_pixel: u64,
}

/// What the runtime says when it compiles a kernel: path slots, columns and rows of the picture. Divisions by constants are cheap.
pub const OVERRIDES: [&str; 3] = ["path_count", "picture_width", "picture_height"];

/// A kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Kernel {
    /// Its name, also of its file and entry point (`trace_eye_main` has name `trace_eye`).
    pub name: String,
    /// The entry point.
    pub entry: String,
    /// The WGSL text.
    pub module: String,
    /// Those of `OVERRIDES` that the text declares, each a `u32`.
    pub overrides: Vec<String>,
    /// Bindings of group 0.
    pub bindings: Vec<Binding>,
    /// Threads in a workgroup.
    pub workgroup: u32,
    /// Stages inside, the one that it begins with first; empty for the generated housekeeping kernels.
    pub stages: Vec<String>,
    /// Bytes of path state that a path loads.
    pub load_bytes: u32,
    /// Bytes of path state that a path stores.
    pub store_bytes: u32,
    /// Bytes of state that it stores of a path which goes on with the first stage of a loop whose paths stand side by side: see
    /// `Plan::dense`.
    pub moved_bytes: u32,
    /// Bytes that it moves to find a path: the entry of its queue, the path's slot and number; of a stream's consumer, the record.
    pub entry_bytes: u32,
    /// What its rays are counted as; none where it has several stages, which count by themselves.
    pub rays: Option<RayKind>,
}

/// A binding of a kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Binding {
    /// Binding number in group 0.
    pub binding: u32,
    /// Index into `Plan::buffers`.
    pub buffer: usize,
    /// How the kernel uses it.
    pub access: Access,
}

/// How a kernel uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Access {
    /// `var<uniform>`.
    Uniform,
    /// `var<storage, read>`.
    Read,
    /// `var<storage, read_write>`.
    ReadWrite,
}

/// A step of the program.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case", tag = "step")]
pub enum Step {
    /// Enough workgroups for the slots in use, folded to two dimensions: x = min(groups, 65535), y = ceil(groups / 65535).
    Dispatch {
        /// Index into `Plan::kernels`.
        kernel: usize,
        /// Path slots that a workgroup takes.
        slots: u32,
    },
    /// A single workgroup.
    Single {
        /// Index into `Plan::kernels`.
        kernel: usize,
    },
    /// As many workgroups as the three words at `slot` of the arguments buffer say.
    Indirect {
        /// Index into `Plan::kernels`.
        kernel: usize,
        /// Which triple of the arguments buffer.
        slot: u32,
    },
    /// The body again and again; empty queues make its dispatches empty.
    Loop {
        /// How often: in the first, second, ... turn of the loop around it; the last number holds for all further ones.
        turns: Vec<u32>,
        /// What.
        body: Vec<Step>,
    },
}

/// A word of the control buffer.
#[derive(Clone, Debug, Serialize)]
pub struct Counter {
    /// `rays_primary`, `rays_secondary`, `rays_deep`, `rays_visibility`, `rejected`, `overflow`, `unfinished`.
    pub name: String,
    /// Word index in the control buffer.
    pub word: u32,
    /// The word counts multiples of two to this power; words of one name add up.
    pub shift: u32,
}
