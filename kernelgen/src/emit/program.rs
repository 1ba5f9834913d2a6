//! From kernel texts to the plan: linking, validation, buffers, the order of steps.

use super::chain;
use super::control;
use super::fusion::Chain;
use super::housekeeping::{self, Entries, Prepared};
use super::kernel::{self, Frame, Source};
use super::memory::{self, Access, Carries};
use super::queue::{self, Queues};
use super::room;
use super::rounds::{InnerLoop, Rounds};
use super::sort;
use super::stream;
use super::tally;
use super::wiring::{WiredKey, Wiring};
use crate::analyze::{self, KernelTraffic, Leaf, Liveness};
use crate::config::model::{Accumulate, LoadAt, QueueKind, RayKind, Variant};
use crate::diagnostic::Diagnostic;
use crate::layout::{InPlace, Placement, Table};
use crate::link::{self, Constants, LinkedBinding, Modules, Root};
use crate::plan::{self, Binding, Buffer, Kernel, Layers, Needs, Plan, Role, SLOT_GRAIN, Size, Step, Tally};
use crate::source::{FileKind, Sources};
use indexmap::IndexMap;
use std::collections::{BTreeMap, BTreeSet};

/// What the program is built from.
pub(super) struct Program<'a> {
    pub variant: &'a Variant,
    pub wiring: &'a Wiring,
    pub liveness: &'a Liveness,
    pub placement: &'a Placement,
    pub queues: &'a Queues,
    pub constants: &'a Constants,
    pub rounds: &'a Rounds,
    pub tallies: &'a [Tally],
    pub layers: &'a [Layers],
}

/// A plan, the effects that its kernels ask for, and what these are spared, by kernel.
pub(super) struct Built {
    pub plan: Plan,
    pub in_place: BTreeMap<String, InPlace>,
    pub effects_seen: BTreeSet<String>,
}

/// Generates all kernels and the plan.
///
/// # Errors
/// Whatever the linker and naga find in a kernel; K0214 two kernels of one name.
pub(super) fn build(
    sources: &mut Sources,
    modules: &mut Modules,
    program: &Program<'_>,
) -> Result<Built, Vec<Diagnostic>> {
    let mut builder = Builder {
        sources,
        modules,
        program,
        kernels: Vec::new(),
        effects_seen: BTreeSet::new(),
        findings: Vec::new(),
        in_place: BTreeMap::new(),
        sum_keys: None,
    };
    let steps = builder.steps();
    if builder.findings.is_empty() { Ok(builder.finish(steps)) } else { Err(builder.findings) }
}

struct Builder<'a> {
    sources: &'a mut Sources,
    modules: &'a mut Modules,
    program: &'a Program<'a>,
    kernels: Vec<(Kernel, Vec<LinkedBinding>)>,
    effects_seen: BTreeSet<String>,
    findings: Vec<Diagnostic>,
    in_place: BTreeMap<String, InPlace>,
    /// The kernel that all sorted queues share.
    sum_keys: Option<usize>,
}

/// A kernel before it is linked.
#[derive(Default)]
struct Draft {
    name: String,
    text: String,
    workgroup: u32,
    stages: Vec<String>,
    load_bytes: u32,
    store_bytes: u32,
    moved_bytes: u32,
    entry_bytes: u32,
    rays: Option<RayKind>,
}

impl Builder<'_> {
    fn steps(&mut self) -> Vec<Step> {
        let program = self.program;
        let fusion = &program.wiring.fusion;
        let start_rays = self.rays(&fusion.start);
        let begin = self.housekeeping("begin", housekeeping::begin_kernel(start_rays, program.queues.regenerates), 64);
        let first = self.stages(&fusion.start, Source::Slots);
        let consumers = self.consumers();
        let body = self.round(&consumers);
        let left: Vec<Prepared> =
            consumers.keys().map(|stream| self.prepared_stream(stream, Entries::Stream(stream.clone()))).collect();
        let mut steps =
            vec![Step::Single { kernel: begin }, Step::Dispatch { kernel: first, slots: program.queues.workgroup }];
        if !body.is_empty() {
            let rounds = if fusion.is_repeated() { program.rounds.outer } else { 1 };
            steps.push(Step::Loop { turns: vec![rounds], body });
        }
        if program.queues.count() > 0 {
            let finish = self.housekeeping("finish", housekeeping::finish_kernel(program.queues, &left), 1);
            steps.push(Step::Single { kernel: finish });
        }
        steps.extend(consumers.into_values());
        steps
    }

    /// The dispatch of each batched stream's consumer.
    fn consumers(&mut self) -> IndexMap<String, Step> {
        let queues = self.program.queues;
        let mut consumers = IndexMap::new();
        for stream in &queues.streams {
            let kernel = self.consumer(stream);
            let slot = queues.of_stream(stream).unwrap_or_default();
            consumers.insert(stream.clone(), Step::Indirect { kernel, slot });
        }
        consumers
    }

    /// The steps of a round.
    fn round(&mut self, consumers: &IndexMap<String, Step>) -> Vec<Step> {
        let stages = self.program.queues.stages.as_slice();
        let Some(InnerLoop { kernels, turns }) = &self.program.rounds.inner else {
            return self.turn(stages, true, consumers);
        };
        let mut body = self.turn(&stages[..kernels.start], false, consumers);
        let inner = self.turn(&stages[kernels.clone()], true, consumers);
        body.push(Step::Loop { turns: turns.clone(), body: inner });
        body.extend(self.turn(&stages[kernels.end..], false, consumers));
        body
    }

    /// The steps of a loop's turn: stages in groups behind one prepare kernel each, which also empties the streams that this group may
    /// push to, if need be. The first may count the turn as one of the rounds by which rays are told apart.
    fn turn(&mut self, stages: &[String], counts: bool, consumers: &IndexMap<String, Step>) -> Vec<Step> {
        let queues = self.program.queues;
        let mut body = Vec::new();
        for group in self.groups(stages) {
            let streams: Vec<&String> = queues.streams.iter().filter(|stream| self.pushes(&group, stream)).collect();
            let mut prepared: Vec<Prepared> = streams.iter().map(|stream| self.prepared_full(stream, &group)).collect();
            prepared.extend(group.iter().map(|stage| self.prepared_stage(stage)));
            let name = format!("prepare_{}", group[0]);
            self.prepare(&name, &prepared, counts && body.is_empty(), &mut body);
            body.extend(streams.into_iter().filter_map(|stream| consumers.get(stream)).cloned());
            for stage in group {
                body.extend(self.put_in_order(&stage));
                let kernel = self.stages(&self.program.wiring.fusion.queued[&stage], Source::Queue);
                body.push(Step::Indirect { kernel, slot: queues.of_stage(&stage).unwrap_or_default() });
            }
        }
        body
    }

    /// Whether this group may push to the stream.
    fn pushes(&self, group: &[String], stream: &str) -> bool {
        let pushes = &self.program.wiring.streams[stream].pushes;
        group.iter().any(|stage| pushes.contains_key(stage))
    }

    /// Consecutive kernels, by entry, of which none feeds a later one: their queues are complete when the first of them runs.
    fn groups(&self, stages: &[String]) -> Vec<Vec<String>> {
        let feeds = |from: &String, to: &String| self.program.wiring.fusion.queued[from].feeds.contains(to);
        let mut groups: Vec<Vec<String>> = Vec::new();
        for stage in stages {
            match groups.last_mut() {
                Some(group) if !group.iter().any(|earlier| feeds(earlier, stage)) => {
                    group.push(stage.clone());
                }
                _ => groups.push(vec![stage.clone()]),
            }
        }
        groups
    }

    fn prepared_stage(&self, stage: &str) -> Prepared {
        let rays = self.rays(&self.program.wiring.fusion.queued[stage]);
        let queues = self.program.queues;
        let (ordered, packed) = (queues.is_ordered(stage), queues.is_packed(stage));
        let turns = queues.is_first_of_dense(stage);
        Prepared { entries: Entries::Stage { stage: stage.to_owned(), ordered, packed, turns }, rays }
    }

    /// What all rays of a kernel are counted as, whoever counts by how many paths it takes; several stages count by themselves.
    fn rays(&self, chain: &Chain) -> Option<RayKind> {
        let stage = self.program.wiring.stages.get(&chain.entry)?;
        if chain.is_fused() { None } else { stage.rays }
    }

    fn prepared_stream(&self, name: &str, entries: Entries) -> Prepared {
        Prepared { entries, rays: self.program.wiring.streams[name].rays }
    }

    /// Empties a stream before a group of stages if this group might overfill it.
    fn prepared_full(&self, name: &str, group: &[String]) -> Prepared {
        let pushes = &self.program.wiring.streams[name].pushes;
        let ahead = group.iter().filter_map(|stage| Some((stage.clone(), *pushes.get(stage)?))).collect();
        self.prepared_stream(name, Entries::FullStream { stream: name.to_owned(), ahead })
    }

    /// Adds a prepare kernel, which may count the round.
    fn prepare(&mut self, name: &str, prepared: &[Prepared], counts: bool, body: &mut Vec<Step>) {
        let text = housekeeping::prepare_kernel(name, counts, prepared);
        let kernel = self.housekeeping(name, text, 1);
        body.push(Step::Single { kernel });
    }

    /// The steps that put the paths which wait for a stage in order, if the schedule asks for one.
    fn put_in_order(&mut self, stage: &str) -> Vec<Step> {
        let Program { wiring, queues, .. } = self.program;
        match &wiring.stages[stage].key {
            Some(key) => self.sort(stage, key),
            None if queues.is_ordered(stage) => vec![self.order(stage)],
            None => Vec::new(),
        }
    }

    /// Sorts the paths that wait for a stage by its key, by counting.
    fn sort(&mut self, stage: &str, key: &WiredKey) -> Vec<Step> {
        let slot = self.program.queues.of_stage(stage).unwrap_or_default();
        let count = self.count_keys(stage, key);
        let sum = self.sum_keys();
        let name = format!("sort_{stage}");
        let workgroup = self.program.queues.workgroup;
        let sort = self.housekeeping(&name, sort::sort_kernel(&name, stage, workgroup), workgroup);
        vec![
            Step::Indirect { kernel: count, slot },
            Step::Single { kernel: sum },
            Step::Indirect { kernel: sort, slot },
        ]
    }

    /// The kernel that computes keys loads what they depend on, and nothing else.
    fn count_keys(&mut self, stage: &str, key: &WiredKey) -> usize {
        let queues = self.program.queues;
        let name = format!("count_keys_{stage}");
        let traffic = KernelTraffic { loads: key.reads.keys().cloned().collect(), ..KernelTraffic::default() };
        let access = self.access(&traffic, &BTreeMap::new(), Carries::Nothing);
        let (kernel, source) = (name.as_str(), Source::Queue);
        let (packs, next, gathered) = (false, None, [].as_slice());
        let frame = Frame { kernel, entry: stage, source, queues, access: &access, packs, next, gathered };
        let text = sort::count_kernel(frame, key);
        let (workgroup, load_bytes) = (queues.workgroup, access.load_bytes);
        self.compile(Draft { name, text, workgroup, load_bytes, ..Draft::default() })
    }

    fn sum_keys(&mut self) -> usize {
        if let Some(kernel) = self.sum_keys {
            return kernel;
        }
        let kernel = self.housekeeping("sum_keys", sort::sum_kernel("sum_keys"), sort::BINS);
        self.sum_keys = Some(kernel);
        kernel
    }

    /// Puts the paths that wait for a stage in the order of their slots.
    fn order(&mut self, stage: &str) -> Step {
        let name = format!("order_{stage}");
        let workgroup = self.program.queues.workgroup;
        let kernel = self.housekeeping(&name, housekeeping::order_kernel(&name, stage, workgroup), workgroup);
        Step::Dispatch { kernel, slots: queue::order_block(workgroup) }
    }

    fn housekeeping(&mut self, name: &str, text: String, workgroup: u32) -> usize {
        self.compile(Draft { name: name.to_owned(), text, workgroup, ..Draft::default() })
    }

    /// The kernel of a stage, or of several.
    fn stages(&mut self, chain: &Chain, source: Source) -> usize {
        let Program { wiring, queues, liveness, .. } = *self.program;
        let entry = chain.entry.as_str();
        let packs = source == Source::Queue && queues.is_packed(entry);
        let starts_again = source == Source::Slots && wiring.fusion.queued.contains_key(entry);
        let kernel = if starts_again { format!("{entry}_first") } else { entry.to_owned() };
        let moves = match &queues.dense {
            Some(dense) if chain.feeds.contains(&dense.first) => Some(&dense.tables),
            _ => None,
        };
        let carries = match moves {
            Some(tables) => Carries::Tables(tables),
            None if packs => Carries::All,
            None => Carries::Nothing,
        };
        let stays = matches!(carries, Carries::Nothing);
        let access = match liveness.kernels.get(entry) {
            Some(traffic) => {
                let late = match self.program.variant.schedule.load {
                    LoadAt::Use => chain::late_leaves(wiring, chain, traffic),
                    LoadAt::Entry => BTreeMap::new(),
                };
                // A path that moves takes along also what is a copy.
                let in_place = if stays { self.program.placement.in_place(traffic) } else { InPlace::default() };
                let moved = in_place.spare(traffic);
                self.in_place.insert(kernel.clone(), in_place);
                self.access(&moved, &late, carries)
            }
            None => Access::default(),
        };
        let next = (queues.regenerates && chain.ends).then_some(wiring.fusion.start.entry.as_str());
        let gathered = &self.gathered(entry);
        let frame = Frame { kernel: &kernel, entry, source, queues, access: &access, packs, next, gathered };
        let text = match wiring.stages.get(entry) {
            Some(stage) if !chain.is_fused() => kernel::stage_kernel(frame, stage),
            _ => chain::chain_kernel(frame, wiring, chain),
        };
        let others = chain.stages.iter().filter(|name| *name != entry);
        self.compile(Draft {
            text,
            name: kernel,
            workgroup: queues.workgroup,
            stages: std::iter::once(entry).chain(others.map(String::as_str)).map(str::to_owned).collect(),
            load_bytes: access.load_bytes,
            store_bytes: access.store_bytes,
            moved_bytes: access.moved_bytes,
            entry_bytes: if source == Source::Queue { 4 * queues.entry_words(entry) } else { 0 },
            rays: self.rays(chain),
        })
    }

    fn access(
        &self,
        traffic: &KernelTraffic,
        late: &BTreeMap<BTreeSet<String>, BTreeSet<Leaf>>,
        carries: Carries<'_>,
    ) -> Access {
        let Program { placement, queues, .. } = *self.program;
        let access = memory::access(placement, traffic, late, carries);
        let used = |table: usize| {
            let address = format!("{}_address(", memory::buffer_name(&placement.tables[table]));
            access.all_loads().chain(&access.stores).any(|statement| statement.contains(&address))
        };
        let mut moving = queues.dense.iter().flat_map(|dense| &dense.tables);
        let by_slot = moving.any(|(table, by_slot)| *by_slot && used(*table));
        Access { by_slot, ..access }
    }

    /// The streams that a kernel may push to, if workgroups gather their records.
    fn gathered(&self, entry: &str) -> Vec<String> {
        let Program { wiring, queues, .. } = self.program;
        let pushes = |name: &&String| queues.gathers() && wiring.streams[*name].pushes.contains_key(entry);
        queues.streams.iter().filter(pushes).cloned().collect()
    }

    fn consumer(&mut self, name: &str) -> usize {
        let stream = &self.program.wiring.streams[name];
        let kernel = format!("{}_{name}", stream.entry.name);
        let workgroup = self.program.variant.schedule.workgroup.value;
        self.compile(Draft {
            text: kernel::consumer_kernel(&kernel, name, stream, workgroup),
            name: kernel,
            workgroup,
            entry_bytes: 4 * stream::record_words(stream),
            rays: stream.rays,
            ..Draft::default()
        })
    }

    /// Links and validates a kernel and returns its index.
    fn compile(&mut self, draft: Draft) -> usize {
        match self.link(&draft) {
            Ok(linked) => self.kernels.push(linked),
            Err(findings) => {
                let new: Vec<Diagnostic> =
                    findings.into_iter().filter(|finding| !self.findings.contains(finding)).collect();
                self.findings.extend(new);
            }
        }
        self.kernels.len().saturating_sub(1)
    }

    fn link(&mut self, draft: &Draft) -> Result<(Kernel, Vec<LinkedBinding>), Vec<Diagnostic>> {
        let name = &draft.name;
        if self.kernels.iter().any(|(kernel, _)| kernel.name == *name) {
            let message = format!("two kernels would be named `{name}`");
            let pipeline = &self.program.variant.pipeline;
            let place = pipeline.stages.get(name).map_or(pipeline.start.span, |stage| stage.span);
            return Err(vec![
                Diagnostic::error("K0214", message)
                    .at(place, "in this pipeline")
                    .help(format!("rename the stage; `{name}` is a generated kernel")),
            ]);
        }
        let module = format!("kernel::{name}");
        let entry = format!("{name}_main");
        let file = self.sources.add(
            FileKind::Module,
            format!("kernel/{name}"),
            format!("<generated>/kernel/{name}.wgsl"),
            draft.text.as_str(),
        );
        self.modules.insert(module.clone(), file);
        let root = Root { module: &module, item: &entry };
        let linked = link::link(self.sources, self.modules, self.program.constants, root)?;
        let parsed = analyze::parse(&linked)?;
        analyze::validate(&parsed, &linked)?;
        self.effects_seen.extend(linked.constants_seen);
        let declares = |name: &&str| linked.items.iter().any(|(_, item)| item == *name);
        let overrides = plan::OVERRIDES.iter().filter(|name| declares(name)).map(|name| (*name).to_owned()).collect();
        let numbered = !draft.stages.is_empty() && linked.bindings.iter().any(|binding| binding.name == "path_numbers");
        let kernel = Kernel {
            name: name.clone(),
            entry,
            module: linked.text,
            overrides,
            bindings: Vec::new(),
            workgroup: draft.workgroup,
            stages: draft.stages.clone(),
            load_bytes: draft.load_bytes,
            store_bytes: draft.store_bytes,
            moved_bytes: draft.moved_bytes,
            entry_bytes: draft.entry_bytes + if numbered { 4 } else { 0 },
            rays: draft.rays,
        };
        Ok((kernel, linked.bindings))
    }

    fn finish(self, program: Vec<Step>) -> Built {
        let buffers = self.buffers();
        let needs = self.needs();
        let tallies = self.tallies(&buffers);
        let placement = self.program.placement;
        let (dense, pushed_bytes) = (self.dense(), self.pushed_bytes());
        let kernels = self.kernels.into_iter().map(|(kernel, bindings)| {
            let binding = |binding: LinkedBinding| {
                let buffer = buffers.get_index_of(&binding.name)?;
                Some(Binding { binding: binding.binding, buffer, access: binding.access })
            };
            Kernel { bindings: bindings.into_iter().filter_map(binding).collect(), ..kernel }
        });
        let plan = Plan {
            kernels: kernels.collect(),
            program,
            counters: control::counters().collect(),
            entries: control::entry_words(),
            pushed_bytes,
            dense,
            tallies,
            layers: self.program.layers.to_vec(),
            film: self.program.variant.schedule.accumulate,
            bytes_per_path: placement.bytes_per_path(),
            ray_bytes_per_path: placement.ray_bytes_per_path(),
            slots_per_grain: room::slots(self.program.wiring, &self.program.variant.schedule),
            paths_per_slot: self.program.rounds.paths_per_slot,
            needs,
            buffers: buffers.into_values().collect(),
        };
        Built { plan, in_place: self.in_place, effects_seen: self.effects_seen }
    }

    /// The queue of the stage that a loop begins with whose paths stand side by side.
    fn dense(&self) -> Option<u32> {
        let queues = self.program.queues;
        queues.of_stage(&queues.dense.as_ref()?.first)
    }

    /// Bytes that joining each queue takes: a word for a path, or a record.
    fn pushed_bytes(&self) -> Vec<u32> {
        let Program { queues, wiring, .. } = *self.program;
        let records = queues.streams.iter().map(|stream| 4 * stream::record_words(&wiring.streams[stream]));
        queues.stages.iter().map(|_| 4).chain(records).collect()
    }

    /// Generated buffers that a kernel uses (film, pass and control always), then scene resources in order of first use.
    fn buffers(&self) -> IndexMap<String, Buffer> {
        let used: Vec<&str> =
            self.kernels.iter().flat_map(|(_, bindings)| bindings).map(|binding| binding.name.as_str()).collect();
        let always = [Role::Film, Role::Pass, Role::Control];
        let mut buffers: IndexMap<String, Buffer> = self
            .generated_buffers()
            .into_iter()
            .filter(|buffer| always.contains(&buffer.role) || used.contains(&buffer.name.as_str()))
            .map(|buffer| (buffer.name.clone(), buffer))
            .collect();
        for name in used {
            let resource = || Buffer { name: name.to_owned(), role: Role::Resource, size: Size::default() };
            buffers.entry(name.to_owned()).or_insert_with(resource);
        }
        buffers
    }

    /// The tallies, if a kernel counts or reads one, or layers are corrected by one.
    fn tallies(&self, buffers: &IndexMap<String, Buffer>) -> Vec<Tally> {
        let used = buffers.contains_key(tally::COUNTS) || buffers.contains_key(tally::RATES);
        let corrects = self.program.layers.iter().any(|group| group.correct.is_some());
        if used || corrects { self.program.tallies.to_vec() } else { Vec::new() }
    }

    fn generated_buffers(&self) -> Vec<Buffer> {
        let program = self.program;
        let buffer = |name: &str, role, size| Buffer { name: name.to_owned(), role, size };
        let per_path = |bytes: u32| Size { per_path: u64::from(bytes), ..Size::default() };
        let fixed = |bytes: u32| Size { fixed: u64::from(bytes), ..Size::default() };
        let tables = program.placement.tables.iter();
        let places = |index| program.queues.dense.as_ref().map_or(1, |dense| dense.places(index));
        let state = |(index, table): (usize, &Table)| {
            buffer(&memory::buffer_name(table), Role::State, per_path(places(index) * table.bytes_per_path()))
        };
        let mut buffers: Vec<Buffer> = tables.enumerate().map(state).collect();
        let channel = if program.variant.schedule.accumulate == Accumulate::FixedI64 { 8 } else { 4 };
        let film = Size { per_pixel: 3 * channel * u64::from(plan::planes(program.layers)), ..Size::default() };
        buffers.extend([
            buffer("queue", Role::Queue, per_path(4 * program.queues.stages.len() as u32)),
            buffer("waits_for", Role::Queue, per_path(4)),
            buffer("path_numbers", Role::Queue, per_path(4)),
            buffer("walk_slots", Role::Queue, per_path(8)),
            buffer("keyed_paths", Role::Queue, per_path(8)),
            buffer("key_bins", Role::Queue, fixed(2 * 4 * sort::BINS)),
            buffer("control", Role::Control, fixed(4 * program.queues.control_words())),
            buffer("arguments", Role::Arguments, fixed(12 * program.queues.count().max(1))),
        ]);
        let streams = program.wiring.streams.iter().filter(|(_, stream)| stream.batched);
        buffers.extend(streams.map(|(name, stream)| {
            let bytes = 4 * stream::record_words(stream) * room::records(&program.variant.schedule);
            buffer(&stream::buffer_name(name), Role::Stream, per_path(bytes.div_ceil(SLOT_GRAIN)))
        }));
        let tallied = Size { fixed: 4 * tally::words(program.tallies), ..Size::default() };
        buffers.extend([
            buffer(tally::COUNTS, Role::TallyCounts, tallied),
            buffer(tally::RATES, Role::TallyRates, Size { fixed: 2 * tallied.fixed, ..tallied }),
        ]);
        buffers.extend([buffer("film", Role::Film, film), buffer("pass_info", Role::Pass, fixed(32))]);
        buffers
    }

    fn needs(&self) -> Needs {
        let schedule = &self.program.variant.schedule;
        let mut bindings = self.kernels.iter().flat_map(|(_, bindings)| bindings);
        let film = bindings.any(|binding| binding.name == "film");
        Needs {
            subgroup: schedule.queue == QueueKind::Subgroup,
            int64_atomics: film && schedule.accumulate == Accumulate::FixedI64,
            float32_atomics: film && schedule.accumulate == Accumulate::AtomicF32,
        }
    }
}
