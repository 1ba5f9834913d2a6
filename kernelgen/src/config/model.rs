//! A variant: one choice from each axis, parsed and checked, with the place where everything was written.

use super::quantity::Quantity;
use crate::source::{Span, Spanned};
use indexmap::IndexMap;
use serde::Serialize;
use std::collections::BTreeMap;

/// Which file of each axis to combine, and what to override.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Config key of the pipeline, `pipelines/pt.toml`.
    pub pipeline: String,
    /// Config key of the layout, `layouts/soa.toml`.
    pub layout: String,
    /// Config key of the schedule, `schedules/wavefront.toml`.
    pub schedule: String,
    /// Config key of the precision, `precisions/f32.toml`.
    pub precision: String,
    /// `--set KEY=VALUE`, in order; later wins. KEY is a parameter, a dotted key of an axis (`schedule.workgroup`) or its unambiguous short name (`workgroup`).
    pub set: Vec<(String, String)>,
    /// The effects of the scene.
    pub effects: Effects,
}

/// The effects that a scene may call for: name (`sky`) to presence and the reason.
pub type Effects = BTreeMap<String, Effect>;

/// Whether a scene calls for an effect, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Effect {
    /// Whether the scene has it.
    pub present: bool,
    /// What in the scene decides it: `material "bottle" transmits`.
    pub reason: String,
}

/// One choice from each axis.
#[derive(Clone, Debug)]
pub struct Variant {
    /// What is computed.
    pub pipeline: Pipeline,
    /// Where fields live.
    pub layout: Layout,
    /// How stages become kernels.
    pub schedule: Schedule,
    /// In what arithmetic.
    pub precision: Precision,
    /// Which effects exist, pins (`[features]` in a config, `--set features.sky=true`) applied.
    pub effects: Effects,
    /// Codecs by name.
    pub codecs: IndexMap<String, Codec>,
}

/// What is computed: records, state, streams, parameters, stages and their wiring.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// The pipeline's name.
    pub name: String,
    /// One line about it.
    pub doc: String,
    /// The stage every path slot begins with.
    pub start: Spanned<String>,
    /// Upper bound of the rounds after which no path is alive: an arithmetic expression over integers and u32 parameters.
    pub rounds: Spanned<String>,
    /// A loop inside the rounds.
    pub inner: Option<Inner>,
    /// Keys that a schedule may sort by also where no stage declares them.
    pub keys: Vec<Spanned<String>>,
    /// Parameters by name.
    pub params: IndexMap<String, Param>,
    /// Records by name.
    pub records: IndexMap<String, Record>,
    /// Instances: name to record name; one of each for every path slot.
    pub state: IndexMap<String, Spanned<String>>,
    /// Streams by name.
    pub streams: IndexMap<String, Stream>,
    /// Tallies by name.
    pub tallies: IndexMap<String, Tally>,
    /// Groups of layers by name.
    pub layers: IndexMap<String, Layers>,
    /// Name to field: a value that stages must evaluate as it will come back from that field (`stored_NAME(value)`). Fields that the
    /// state does not have keep every bit.
    pub stored: IndexMap<String, Spanned<String>>,
    /// Stages by name, in the order in which a round runs them.
    pub stages: IndexMap<String, Stage>,
}

/// A loop inside the rounds: a stage to which a later one leads back, several times a round.
#[derive(Clone, Debug)]
pub struct Inner {
    /// The first stage of the loop.
    pub stage: Spanned<String>,
    /// Upper bound of its turns in a round: an expression as `rounds`, which may name the `round`, counted from 0.
    pub turns: Spanned<String>,
    /// Upper bound of the rounds that remain.
    pub rounds: Spanned<String>,
}

/// A parameter: a constant in every kernel, set with `--set`.
#[derive(Clone, Debug)]
pub struct Param {
    /// Where its table or value stands.
    pub span: Span,
    /// Its value, with its type.
    pub value: ParamValue,
    /// What it means.
    pub doc: String,
}

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamValue {
    /// `type = "u32"`.
    U32(u32),
    /// `type = "real"`.
    Real(f64),
    /// `type = "bool"`.
    Bool(bool),
    /// `type = "choice", of = [..]`: an index into the names.
    Choice {
        /// Legal words.
        of: Vec<String>,
        /// The chosen one.
        index: u32,
    },
}

/// A record: fields by name.
#[derive(Clone, Debug)]
pub struct Record {
    /// Where the record's table starts.
    pub span: Span,
    /// Fields by name, in order.
    pub fields: IndexMap<String, Field>,
}

/// A field of a record.
#[derive(Clone, Debug)]
pub struct Field {
    /// Where its line stands.
    pub span: Span,
    /// What it is.
    pub quantity: Quantity,
}

/// A stream: records appended by stages, emptied by its consumer.
#[derive(Clone, Debug)]
pub struct Stream {
    /// Where its table stands.
    pub span: Span,
    /// The record's name.
    pub record: Spanned<String>,
    /// The consuming stage function.
    pub consumer: Spanned<String>,
    /// What its consumer's rays are counted as.
    pub rays: Option<RayKind>,
}

/// A tally: counters that stages increment, and whose rates among earlier samples they read.
#[derive(Clone, Debug)]
pub struct Tally {
    /// Where its table stands.
    pub span: Span,
    /// How many counters: an expression as `rounds`.
    pub size: Spanned<String>,
    /// What it counts.
    pub doc: String,
}

/// A group of layers: further planes of the film, which stages add to by index.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Where its table stands.
    pub span: Span,
    /// How many layers: an expression as `rounds`.
    pub size: Spanned<String>,
    /// The tally whose realised rates the layers are divided by where they go into the picture; without one they do not.
    pub correct: Option<Spanned<String>>,
    /// What is in them.
    pub doc: String,
}

/// A stage: a WGSL function and where each of its outcomes leads.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Where its table or line stands.
    pub span: Span,
    /// The WGSL function; the stage's own name when not given.
    pub entry: Spanned<String>,
    /// Parameter to instance, where they differ, of the function and of keys: `with.walk = "eye"`.
    pub with: IndexMap<String, Spanned<String>>,
    /// Outcome (lower case) to stage, or to `end`.
    pub on: IndexMap<String, Spanned<String>>,
    /// What rays of this stage are counted as.
    pub rays: Option<RayKind>,
    /// Keys by which a schedule may sort the paths that wait for it, and their WGSL functions: `sort.material = "material_key"`.
    pub sort: IndexMap<String, Spanned<String>>,
    /// The stage that it runs before in a round, where it is not listed so.
    pub before: Option<Spanned<String>>,
}

/// Kinds of traced ray. Walk rays are reported as primary, secondary and deep by the round in which they are traced, or by the turn of
/// an inner loop. Where a kernel goes round inside, a turn counts as a round from that on in which it took the path: of a megakernel
/// the kinds are those of single stages in flat rounds, of several kernels in a row only the sum is. Where slots take several paths,
/// rounds are those of the pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RayKind {
    /// `rays = "walk"`.
    Walk,
    /// `rays = "visibility"`.
    Visibility,
}

/// Where fields live.
#[derive(Clone, Debug)]
pub struct Layout {
    /// The layout's name.
    pub name: String,
    /// One line about it.
    pub doc: String,
    /// How the records of different paths are interleaved.
    pub order: Order,
    /// 32-bit words per access: 1, 2 or 4.
    pub lane: u32,
    /// Whether fields that no kernel boundary carries are dropped.
    pub drop_dead: bool,
    /// Whether fields that never live together may have the same bits.
    pub share: bool,
    /// Whether rays in flight have a table of their own: what lives only on the way into and out of the kernels that trace it.
    pub rays_apart: bool,
    /// 32-bit words per access of that table.
    pub ray_lane: u32,
    /// Codec by quantity (`spectrum`), field (`light.throughput`) or member of a hit (`light.hit.uv`); the closer name wins.
    pub encode: IndexMap<String, Encode>,
    /// Table name to instances; empty means one table named `state`. One that a pipeline may lack ends in `?`.
    pub tables: IndexMap<String, Vec<Spanned<String>>>,
    /// Explicit placement; empty means automatic. One row is one lane.
    pub place: Vec<PlacedRow>,
    /// Where the layout's table stands, for errors about it as a whole.
    pub span: Span,
}

/// Ends the name of an instance in a table that not every pipeline has to have.
pub const OPTIONAL: char = '?';

/// The codecs that keep every bit: a value as it is computed.
pub const IDENTITY_CODECS: [&str; 2] = ["f32", "u32"];

/// An entry of `[layout.encode]`.
#[derive(Clone, Debug)]
pub struct Encode {
    /// Where the name of what is encoded stands.
    pub key: Span,
    /// The codec's name; `f32` and `u32` keep every bit.
    pub codec: Spanned<String>,
}

/// A pair of WGSL functions that keep a value in fewer bits: `encode_NAME` and `decode_NAME` in the module `codec::NAME`.
#[derive(Clone, Debug, PartialEq)]
pub struct Codec {
    /// Its name.
    pub name: String,
    /// The quantities that it can keep.
    pub quantities: Vec<String>,
    /// Width in bits of every part. One part is a `u32`, more are a `vec2u` or `vec3u`, each in the lowest bits.
    pub parts: Vec<u32>,
    /// What is lost at most, by kind: `angle` in radians, `relative`, `of_largest` component, `absolute`.
    pub errors: IndexMap<String, f64>,
    /// Least and greatest magnitude for which that holds; smaller ones may become zero, greater ones the greatest. Zero is kept.
    pub range: [f64; 2],
    /// One line about it.
    pub doc: String,
    /// Where its table stands.
    pub span: Span,
}

/// Interleaving.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// All words of a path side by side.
    Aos,
    /// One plane per lane.
    Soa,
    /// Blocks of this many paths, one plane per lane inside a block: `order = "aosoa32"`.
    Aosoa(u32),
}

/// One row of an explicit placement: `["light.throughput", "light.mis"]`.
#[derive(Clone, Debug)]
pub struct PlacedRow {
    /// Where it stands.
    pub span: Span,
    /// Its parts, in order of words.
    pub parts: Vec<Placed>,
}

/// A part of a row.
#[derive(Clone, Debug)]
pub enum Placed {
    /// Whole words of a field, `"light.throughput"`, or one unused word, `"_"`.
    Words(PlacedField),
    /// One word shared by several fields below a word, `["eye.flags:8", "_:24"]`, from the lowest bit up.
    Bits(Vec<PlacedField>),
}

/// A field in a placement.
#[derive(Clone, Debug)]
pub struct PlacedField {
    /// Where it stands.
    pub span: Span,
    /// `None` for `_`.
    pub field: Option<String>,
    /// Bits given after the colon.
    pub bits: Option<u32>,
}

/// How stages become kernels.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// The schedule's name.
    pub name: String,
    /// One line about it.
    pub doc: String,
    /// Which stages share a kernel.
    pub fuse: Spanned<Fuse>,
    /// How a survivor finds its place in the next queue.
    pub queue: QueueKind,
    /// In what order stages take their paths.
    pub order: PathOrder,
    /// How kernels are repeated.
    pub loops: Loops,
    /// Keys of stages by which paths are sorted before the stage takes them. Where a stage declares several, the first counts.
    pub sort: Vec<Spanned<String>>,
    /// Threads in a workgroup.
    pub workgroup: Spanned<u32>,
    /// When fields enter registers.
    pub load: LoadAt,
    /// How the film adds.
    pub accumulate: Accumulate,
    /// Paths of a pass for each slot: with more than one, a slot whose path is over takes the next.
    pub regenerate: Spanned<u32>,
    /// Streams resolved by a kernel of their own; the others inline.
    pub batch: Batch,
    /// Records that each batched stream has room for, per path slot.
    pub capacity: Spanned<f64>,
}

/// Which streams are resolved by a kernel of their own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Batch {
    /// These.
    Streams(Vec<Spanned<String>>),
    /// All whose kernels push a bounded number of records: `batch = "bounded"`.
    Bounded,
}

/// How kernels that lead back to earlier ones are repeated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Loops {
    /// The inner loop of a pipeline is over before a round goes on: all its walks end together.
    #[default]
    Nested,
    /// A round runs every kernel once.
    Flat,
}

/// Which stages share a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fuse {
    /// Those of each group; a stage in no group is a kernel of its own. `fuse = []`: all are.
    Groups(Vec<Vec<Spanned<String>>>),
    /// Each stage that traces walk rays and the stages that its outcomes lead to: `fuse = "walks"`.
    Walks,
    /// All: `fuse = "all"`, a megakernel.
    All,
}

/// How a survivor finds its place in a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum QueueKind {
    /// One atomic a path.
    Atomic,
    /// One atomic a subgroup.
    Subgroup,
    /// One atomic a workgroup; survivors keep their order in it.
    Workgroup,
    /// There are no queues: every kernel looks at every slot, and takes the paths that wait for it.
    None,
}

/// When the fields of a path enter registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LoadAt {
    /// When the kernel begins.
    #[default]
    Entry,
    /// When the first stage of the kernel runs that uses them: paths that take other ways do not load them.
    Use,
}

/// In what order stages take their paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PathOrder {
    /// As they came.
    Arrival,
    /// By slot, where several stages of a round feed one: their paths would come one stage after the other. A stage with one feeder
    /// finds its paths as that found them.
    Slot,
    /// As `Slot`, and where all paths meet behind an inner loop they move into slots side by side, with their state.
    Packed,
    /// As `Packed`, and in a loop paths move with their state to where they stand in the queue of its first stage.
    Dense,
}

/// How the film adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Accumulate {
    /// Float atomics: fast, sums in any order.
    AtomicF32,
    /// 64-bit fixed point, units of 2^-24: the same sum in any order.
    FixedI64,
    /// Plain read-add-write: loses splats.
    Racy,
}

/// In what arithmetic.
#[derive(Clone, Debug)]
pub struct Precision {
    /// The precision's name.
    pub name: String,
    /// One line about it.
    pub doc: String,
    /// What `real` means.
    pub real: Real,
}

/// What `real` means in every stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Real {
    /// 32-bit IEEE.
    F32,
}
