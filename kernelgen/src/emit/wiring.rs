//! Stages and stream consumers as they are wired: found, linked, analysed, and checked against what the pipeline says.

use super::contract::{
    check_consumer, check_consumer_signature, check_key, check_parameters, check_returns_key, check_returns_outcome,
    check_with,
};
use super::entry::{Entries, Entry};
use super::fusion::{Chain, Fusion};
use super::room;
use super::signature::{Signature, signature};
use crate::analyze::{self, Flow, FlowStage, Leaf, StageFacts};
use crate::config::model::{Batch, RayKind, Stage, Stream, Variant};
use crate::diagnostic::Diagnostic;
use crate::layout::StateLeaf;
use crate::link::{self, Constant, Constants, Modules, Root};
use crate::plan::SLOT_GRAIN;
use crate::source::{Sources, Span};
use indexmap::{IndexMap, IndexSet};
use std::collections::{BTreeMap, BTreeSet};

/// The texts to link, and what is known about them.
#[derive(Clone, Copy)]
pub(super) struct Texts<'a> {
    pub sources: &'a Sources,
    pub modules: &'a Modules,
    pub constants: &'a Constants,
    /// Outcome names in order of their values.
    pub outcomes: &'a IndexSet<String>,
}

/// Everything that the start stage can reach.
#[derive(Clone, Debug, Default)]
pub(super) struct Wiring {
    /// Stages, in the order of the pipeline.
    pub stages: IndexMap<String, WiredStage>,
    /// Which of them share a kernel.
    pub fusion: Fusion,
    /// Streams that one of them pushes to, in the order of the pipeline.
    pub streams: IndexMap<String, WiredStream>,
    /// Outcomes that never come, stages that nothing reaches.
    pub warnings: Vec<Diagnostic>,
    /// Effects that a stage asks for: `HAS_SKY`.
    pub effects_seen: BTreeSet<String>,
    /// Functions of the module `film` that a stage or a consumer calls.
    pub splats: BTreeSet<String>,
}

/// A stage.
#[derive(Clone, Debug)]
pub(super) struct WiredStage {
    pub entry: Entry,
    pub facts: StageFacts,
    /// The instance of each parameter, and its record.
    pub instances: Vec<(String, String)>,
    /// Returned outcomes (lower case) and the stages they lead to; those that end the path are left out.
    pub routes: Vec<(String, String)>,
    pub rays: Option<RayKind>,
    /// Whether it counts something in a tally.
    pub counts: bool,
    /// What the paths that wait for it are sorted by.
    pub key: Option<WiredKey>,
}

/// The key of the paths that wait for a stage.
#[derive(Clone, Debug)]
pub(super) struct WiredKey {
    pub entry: Entry,
    /// The instance of each parameter, and its record.
    pub instances: Vec<(String, String)>,
    /// Leaves it reads, with one place where.
    pub reads: BTreeMap<Leaf, Span>,
}

/// A stream with its consumer.
#[derive(Clone, Debug)]
pub(super) struct WiredStream {
    pub entry: Entry,
    pub batched: bool,
    /// Leaves of the record that the consumer reads, in the order of the record.
    pub leaves: Vec<StateLeaf>,
    /// Most records that one run of a kernel pushes, by its entry; of a batched stream only.
    pub pushes: IndexMap<String, u32>,
    /// Most records of a path between two moments at which a batched stream may be emptied.
    pub most: u32,
    pub rays: Option<RayKind>,
    /// Whether its consumer counts something in a tally.
    pub counts: bool,
}

impl Wiring {
    /// The graph for liveness.
    pub(super) fn flow(&self) -> Flow {
        let stage = |(name, stage): (&String, &WiredStage)| {
            let next = stage.outcomes_by_target().into_iter().map(|(target, outcomes)| {
                (target.to_owned(), stage.facts.written_with(outcomes.iter().map(|outcome| outcome.to_lowercase())))
            });
            let traces = stage.rays == Some(RayKind::Walk);
            let key = stage.key.iter().flat_map(|key| key.reads.clone()).collect();
            (name.clone(), FlowStage { facts: stage.facts.clone(), key, next: next.collect(), traces })
        };
        Flow { stages: self.stages.iter().map(stage).collect(), kernels: self.fusion.kernels(self.stages.keys()) }
    }
}

impl WiredStage {
    /// The stages that its outcomes lead to; one may come several times.
    pub(super) fn targets(&self) -> impl Iterator<Item = &str> {
        self.routes.iter().map(|(_, target)| target.as_str())
    }

    /// Whether an outcome leads there.
    pub(super) fn leads_to(&self, stage: &str) -> bool {
        self.targets().any(|target| target == stage)
    }

    /// Whether an outcome that comes ends the path.
    pub(super) fn may_end(&self) -> bool {
        self.facts.outcomes.keys().any(|outcome| !self.routes.iter().any(|(routed, _)| routed == outcome))
    }

    /// The constants of the outcomes that lead to each stage.
    pub(super) fn outcomes_by_target(&self) -> IndexMap<&str, Vec<String>> {
        let mut targets: IndexMap<&str, Vec<String>> = IndexMap::new();
        for (outcome, target) in &self.routes {
            targets.entry(target).or_default().push(outcome.to_uppercase());
        }
        targets
    }
}

/// Finds, links and checks all stages from the start on, then the consumers of the streams they push to.
///
/// # Errors
/// K0203 an outcome without a route, K0206 a parameter that is no instance, K0207 one of another record, K0208 a missing function,
/// K0209 a stage that routes to itself, K0211 a consumer that asks for its path, K0212 a consumer that pushes, K0215 a function that
/// is no stage, K0217 pushes to a batched stream in a loop, K0219 two parameters for one instance, K0220 an instance for a parameter
/// that is not there, K0221 a consumer that takes something else than one record, K0222 a batched
/// stream without room for a round, K0226 pushes to a batched stream in a loop of fused stages, K0227 slots that
/// would take new paths in the kernel that begins them, K0230 a key function that does more than compute a key; K03xx of the stage texts.
/// Warnings: K0204 an outcome that never comes, K0205 a stage that nothing reaches.
pub(super) fn wire(texts: Texts<'_>, variant: &Variant) -> Result<Wiring, Vec<Diagnostic>> {
    let mut wirer = Wirer {
        texts,
        variant,
        entries: Entries::scan(texts.sources, texts.modules),
        found: BTreeMap::new(),
        wiring: Wiring::default(),
        findings: Vec::new(),
    };
    let reached = wirer.reach();
    wirer.keep_reached(&reached);
    let start = &variant.pipeline.start.value;
    wirer.wiring.fusion = Fusion::new(&wirer.wiring.stages, start, &variant.schedule);
    wirer.drop_keys_without_queues();
    wirer.check_regeneration();
    wirer.wire_streams();
    if wirer.findings.is_empty() { Ok(wirer.wiring) } else { Err(distinct(wirer.findings)) }
}

/// One finding may come up in every stage that shares a helper.
fn distinct(findings: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let mut kept: Vec<Diagnostic> = Vec::new();
    for finding in findings {
        if !kept.contains(&finding) {
            kept.push(finding);
        }
    }
    kept
}

struct Wirer<'a> {
    texts: Texts<'a>,
    variant: &'a Variant,
    entries: Entries,
    found: BTreeMap<String, WiredStage>,
    wiring: Wiring,
    findings: Vec<Diagnostic>,
}

/// A linked and analysed function.
pub(super) struct Analysed {
    pub entry: Entry,
    pub signature: Signature,
    pub facts: StageFacts,
    /// Whether the text may have lost code to an absent effect.
    pub pruned: bool,
    /// Outcomes that the text names, in upper case, whether or not parameters let it return them.
    pub named: BTreeSet<String>,
    /// Whether it counts something in a tally.
    pub counts: bool,
}

impl Wirer<'_> {
    /// Wires stages from the start on, and says which were reached; a stage with errors reaches all that it routes to.
    fn reach(&mut self) -> BTreeSet<String> {
        let pipeline = &self.variant.pipeline;
        let mut open = vec![pipeline.start.value.clone()];
        let mut reached = BTreeSet::from([pipeline.start.value.clone()]);
        while let Some(name) = open.pop() {
            let Some(stage) = pipeline.stages.get(&name) else { continue };
            let targets: Vec<String> = match self.wire_stage(&name, stage) {
                Ok(wired) => {
                    let targets = wired.routes.iter().map(|(_, target)| target.clone()).collect();
                    self.found.insert(name, wired);
                    targets
                }
                Err(findings) => {
                    self.findings.extend(findings);
                    stage.on.values().map(|target| target.value.clone()).collect()
                }
            };
            open.extend(targets.into_iter().filter(|target| reached.insert(target.clone())));
        }
        reached
    }

    fn keep_reached(&mut self, reached: &BTreeSet<String>) {
        let pipeline = &self.variant.pipeline;
        // A stage that no route names at all was reported with the configs.
        let routed = |name: &String| {
            let routes = pipeline.stages.values().flat_map(|stage| stage.on.values());
            routes.into_iter().any(|target| target.value == *name)
        };
        for (name, stage) in &pipeline.stages {
            if let Some(wired) = self.found.remove(name) {
                self.wiring.stages.insert(name.clone(), wired);
            } else if !reached.contains(name) && routed(name) && !self.has_absent_effect() {
                let message = format!("no outcome that comes leads to stage `{name}`");
                self.wiring.warnings.push(
                    Diagnostic::warning("K0205", message)
                        .at(stage.span, "not generated")
                        .help("the outcomes that are routed to it never come"),
                );
            }
        }
    }

    /// K0227: a kernel that takes paths from a queue cannot fill that queue.
    fn check_regeneration(&mut self) {
        let schedule = &self.variant.schedule;
        let start = &self.variant.pipeline.start;
        let chain = self.wiring.fusion.queued.get(&start.value);
        if schedule.regenerate.value == 1 || !chain.is_some_and(|chain| chain.ends) {
            return;
        }
        let message = format!("paths may be over in the kernel `{}`, which begins them", start.value);
        self.findings.push(
            Diagnostic::error("K0227", message)
                .at(schedule.regenerate.span, "a slot whose path is over waits for that kernel")
                .also(schedule.fuse.span, "which stages share it")
                .also(start.span, "the start")
                .help("write `regenerate = 1`, or fuse the start with no stage that ends paths"),
        );
    }

    /// Whether stages ask for an effect that is absent: what it alone would return or reach is missing for a good reason.
    fn has_absent_effect(&self) -> bool {
        self.wiring.effects_seen.iter().any(|name| self.is_absent(name))
    }

    fn is_absent(&self, name: &str) -> bool {
        let key = ("features".to_owned(), name.to_owned());
        self.texts.constants.get(&key) == Some(&Constant::Bool(false))
    }

    fn wire_stage(&mut self, name: &str, stage: &Stage) -> Result<WiredStage, Vec<Diagnostic>> {
        let entry = self.entries.find(&stage.entry).map_err(|finding| vec![finding])?.clone();
        let key_params = self.key_params(stage)?;
        let (texts, variant) = (self.texts, self.variant);
        let outcomes = texts.outcomes.iter().zip(0..).map(|(name, value)| (value, name.clone())).collect();
        let analysed = self.analyse(
            entry,
            |entry, signature| {
                let mut findings = check_parameters(variant, name, stage, entry, signature);
                findings.extend(check_with(name, stage, entry, signature, &key_params));
                findings.extend(check_returns_outcome(entry, signature, texts));
                findings
            },
            &|param| instance_of(variant, stage, param),
            Some(&outcomes),
        )?;
        self.check_outcomes(name, stage, &analysed)?;
        let routes = analysed.facts.outcomes.keys().filter_map(|outcome| {
            let target = &stage.on.get(outcome)?.value;
            (target != "end").then(|| (outcome.clone(), target.clone()))
        });
        let order = |(outcome, _): &(String, String)| stage.on.get_index_of(outcome);
        let mut routes: Vec<(String, String)> = routes.collect();
        routes.sort_by_key(order);
        Ok(WiredStage {
            instances: instances(variant, stage, &analysed.signature),
            key: self.wire_key(name, stage)?,
            entry: analysed.entry,
            facts: analysed.facts,
            routes,
            rays: stage.rays,
            counts: analysed.counts,
        })
    }

    /// Parameters of all key functions of a stage, whether the schedule asks for these keys or not.
    fn key_params(&self, stage: &Stage) -> Result<BTreeSet<String>, Vec<Diagnostic>> {
        let mut params = BTreeSet::new();
        for function in stage.sort.values() {
            let entry = self.entries.find(function).map_err(|finding| vec![finding])?;
            params.extend(entry.params.keys().cloned());
        }
        Ok(params)
    }

    /// The first key of the schedule that the stage declares, unless it depends on nothing: in this scene it tells no paths apart then.
    fn wire_key(&mut self, name: &str, stage: &Stage) -> Result<Option<WiredKey>, Vec<Diagnostic>> {
        let variant = self.variant;
        let mut asked = variant.schedule.sort.iter().filter_map(|key| stage.sort.get(&key.value));
        let Some(function) = asked.next() else { return Ok(None) };
        let entry = self.entries.find(function).map_err(|finding| vec![finding])?.clone();
        let analysed = self.analyse(
            entry,
            |entry, signature| {
                let mut findings = check_parameters(variant, name, stage, entry, signature);
                findings.extend(check_returns_key(function, entry, signature));
                findings
            },
            &|param| instance_of(variant, stage, param),
            None,
        )?;
        check_key(function, &analysed)?;
        let Analysed { entry, signature, facts, .. } = analysed;
        let tells_apart = !facts.reads.is_empty() || !facts.globals.is_empty();
        let instances = instances(variant, stage, &signature);
        Ok(tells_apart.then_some(WiredKey { entry, instances, reads: facts.reads }))
    }

    /// A stage that paths only come to inside a kernel has nothing to sort.
    fn drop_keys_without_queues(&mut self) {
        let Wiring { stages, fusion, .. } = &mut self.wiring;
        for (_, stage) in stages.iter_mut().filter(|(name, _)| !fusion.queued.contains_key(*name)) {
            stage.key = None;
        }
    }

    /// Links and parses a function, checks its signature, then finds its facts.
    fn analyse(
        &mut self,
        entry: Entry,
        check: impl Fn(&Entry, &Signature) -> Vec<Diagnostic>,
        bind: &dyn Fn(&str) -> Option<String>,
        outcomes: Option<&BTreeMap<u32, String>>,
    ) -> Result<Analysed, Vec<Diagnostic>> {
        let texts = self.texts;
        let root = Root { module: &entry.module, item: &entry.name };
        let linked = link::link(texts.sources, texts.modules, texts.constants, root)?;
        let module = analyze::parse(&linked)?;
        let signature = signature(&module, &entry.name);
        let findings = check(&entry, &signature);
        if !findings.is_empty() {
            return Err(findings);
        }
        let facts = analyze::stage_facts(&module, &linked, &entry.name, bind, outcomes)?;
        let pruned = linked.constants_seen.iter().any(|name| self.is_absent(name));
        self.wiring.effects_seen.extend(linked.constants_seen);
        let counts = linked.items.iter().any(|(module, item)| module == "tallies" && item.starts_with("count_"));
        let named = linked.mentioned.into_iter().filter(|(module, _)| module == "outcome");
        let named = named.map(|(_, item)| item).collect();
        let of_film = linked.items.into_iter().filter(|(module, _)| module == "film");
        self.wiring.splats.extend(of_film.map(|(_, item)| item));
        Ok(Analysed { entry, signature, facts, pruned, named, counts })
    }

    fn check_outcomes(&mut self, name: &str, stage: &Stage, analysed: &Analysed) -> Result<(), Vec<Diagnostic>> {
        let mut findings = Vec::new();
        let returned = &analysed.facts.outcomes;
        for (outcome, place) in returned.iter().filter(|(outcome, _)| *outcome != "end") {
            match stage.on.get(outcome) {
                None => {
                    let message = format!("outcome `{outcome}` of stage `{name}` leads nowhere");
                    findings.push(
                        Diagnostic::error("K0203", message)
                            .at(*place, "returned here")
                            .also(stage.span, format!("no `on.{outcome}` in this table"))
                            .help(self.route_help(outcome, stage)),
                    );
                }
                Some(target) if target.value == name => {
                    let message = format!("stage `{name}` routes `{outcome}` to itself");
                    findings.push(
                        Diagnostic::error("K0209", message)
                            .at(target.span, "a queue cannot be filled while it is emptied")
                            .help(
                                "loop inside the stage function, or route through a second stage with the same `entry`",
                            ),
                    );
                }
                Some(_) => {}
            }
        }
        let never = stage.on.iter().filter(|(outcome, _)| !analysed.named.contains(&outcome.to_uppercase()));
        if !analysed.pruned {
            self.wiring.warnings.extend(never.map(|(outcome, target)| {
                let message = format!("stage `{name}` never returns outcome `{outcome}`");
                Diagnostic::warning("K0204", message)
                    .at(target.span, "this route is never taken")
                    .also(analysed.entry.span, format!("no `return {}`", outcome.to_uppercase()))
            }));
        }
        if findings.is_empty() { Ok(()) } else { Err(findings) }
    }

    fn route_help(&self, outcome: &str, stage: &Stage) -> String {
        let routed = stage.on.values().map(|target| target.value.as_str()).find(|target| *target != "end");
        let example = routed.or_else(|| self.variant.pipeline.stages.keys().map(String::as_str).next());
        match example {
            Some(target) => format!("add `on.{outcome} = \"{target}\"`, or `on.{outcome} = \"end\"`"),
            None => format!("add `on.{outcome} = \"end\"`"),
        }
    }

    fn wire_streams(&mut self) {
        let variant = self.variant;
        for (name, stream) in &variant.pipeline.streams {
            if !self.wiring.stages.values().any(|stage| stage.facts.pushes.contains_key(name)) {
                continue;
            }
            match self.wire_stream(name, stream) {
                Ok(wired) => {
                    self.pass_counting_on(name, &wired);
                    self.wiring.streams.insert(name.clone(), wired);
                }
                Err(findings) => self.findings.extend(findings),
            }
        }
    }

    /// A consumer that runs where records are pushed counts in the kernels that push.
    fn pass_counting_on(&mut self, name: &str, stream: &WiredStream) {
        let counts = stream.counts && !stream.batched;
        for stage in self.wiring.stages.values_mut().filter(|stage| stage.facts.pushes.contains_key(name)) {
            stage.counts |= counts;
        }
    }

    fn wire_stream(&mut self, name: &str, stream: &Stream) -> Result<WiredStream, Vec<Diagnostic>> {
        let variant = self.variant;
        let entry = self.entries.find(&stream.consumer).map_err(|finding| vec![finding])?.clone();
        let bind = |_: &str| Some(name.to_owned());
        let check = |entry: &Entry, signature: &Signature| check_consumer_signature(name, stream, entry, signature);
        let analysed = self.analyse(entry, check, &bind, None)?;
        check_consumer(name, stream, &analysed)?;
        let pushes = match &variant.schedule.batch {
            Batch::Streams(streams) if streams.iter().all(|stream| stream.value != name) => None,
            Batch::Streams(_) => Some(self.pushes(name)?),
            Batch::Bounded => self.pushes(name).ok(),
        };
        let batched = pushes.is_some();
        let pushes = pushes.unwrap_or_default();
        let most = pushes.values().copied().max().unwrap_or(0);
        check_room(variant, name, stream, most)?;
        Ok(WiredStream {
            leaves: read_leaves(variant, name, stream, &analysed.facts),
            entry: analysed.entry,
            batched,
            pushes,
            most,
            rays: stream.rays,
            counts: analysed.counts,
        })
    }

    /// Most records that one run of each kernel pushes to a stream.
    fn pushes(&self, stream: &str) -> Result<IndexMap<String, u32>, Vec<Diagnostic>> {
        let own = self.stage_pushes(stream)?;
        let fusion = &self.wiring.fusion;
        let mut most = IndexMap::new();
        for chain in std::iter::once(&fusion.start).chain(fusion.queued.values()) {
            let mut pushing = chain.stages.iter().filter(|name| own.contains_key(*name));
            let Some(first) = pushing.next() else { continue };
            if chain.loops {
                return Err(vec![self.uncountable(stream, chain, first)]);
            }
            let leads = |from: &str, to: &str| self.wiring.stages[from].leads_to(to);
            most.extend(room::ahead(chain.stages.iter(), leads, &own).swap_remove_entry(&chain.entry));
        }
        Ok(most)
    }

    /// K0226: nothing bounds the records that a looping kernel pushes.
    fn uncountable(&self, stream: &str, chain: &Chain, stage: &str) -> Diagnostic {
        let schedule = &self.variant.schedule;
        let place = match &schedule.batch {
            Batch::Streams(streams) => streams.iter().find(|named| named.value == stream).map(|named| named.span),
            Batch::Bounded => None,
        };
        let place = place.unwrap_or(schedule.fuse.span);
        let message = format!("kernel `{}` pushes to the batched stream `{stream}` in a loop", chain.entry);
        Diagnostic::error("K0226", message)
            .at(schedule.fuse.span, format!("stage `{stage}` pushes, and its kernel leads back to earlier stages"))
            .also(place, "how often cannot be told, so neither how much room the stream needs")
            .help(format!("take `{stream}` out of `schedule.batch`, or fuse only stages that lead to later ones"))
    }

    /// Most records that one run of each stage pushes to a stream.
    fn stage_pushes(&self, stream: &str) -> Result<IndexMap<String, u32>, Vec<Diagnostic>> {
        let mut findings = Vec::new();
        let mut most = IndexMap::new();
        for (name, stage) in &self.wiring.stages {
            match stage.facts.pushes.get(stream) {
                Some(Some(pushes)) => {
                    most.insert(name.clone(), *pushes);
                }
                Some(None) => {
                    let message = format!("stage `{name}` pushes to `{stream}` in a loop");
                    findings.push(
                        Diagnostic::error("K0217", message)
                            .at(stage.entry.span, "how often cannot be told, so neither how much room the stream needs")
                            .help(format!("push outside of loops, or take `{stream}` out of `schedule.batch`")),
                    );
                }
                None => {}
            }
        }
        if findings.is_empty() { Ok(most) } else { Err(findings) }
    }
}

/// K0222: not even the fewest slots of a pass find room for the records of a kernel.
fn check_room(variant: &Variant, name: &str, stream: &Stream, most: u32) -> Result<(), Vec<Diagnostic>> {
    let capacity = &variant.schedule.capacity;
    let records = room::records(&variant.schedule);
    if records >= most {
        return Ok(());
    }
    let least = f64::from((1000 * most).div_ceil(SLOT_GRAIN)) / 1000.0;
    let message = format!("stream `{name}` has no room for the records of a kernel");
    Err(vec![
        Diagnostic::error("K0222", message)
            .at(capacity.span, format!("room for {records} in {SLOT_GRAIN} path slots"))
            .also(stream.span, format!("one path can push {most} in a kernel"))
            .help(format!("write a capacity of {least} or more")),
    ])
}

fn read_leaves(variant: &Variant, name: &str, stream: &Stream, facts: &StageFacts) -> Vec<StateLeaf> {
    let Some(record) = variant.pipeline.records.get(&stream.record.value) else { return Vec::new() };
    let leaves = record.fields.iter().flat_map(|(field, declared)| {
        declared.quantity.leaves().into_iter().map(move |shape| StateLeaf::new(name, field, &shape))
    });
    leaves.filter(|leaf| facts.reads.contains_key(&leaf.leaf)).collect()
}

/// The instance that a parameter of a stage or of its key stands for.
fn instance_of(variant: &Variant, stage: &Stage, param: &str) -> Option<String> {
    match stage.with.get(param) {
        Some(instance) => Some(instance.value.clone()),
        None => variant.pipeline.state.contains_key(param).then(|| param.to_owned()),
    }
}

/// The instance of each parameter, and its record.
fn instances(variant: &Variant, stage: &Stage, signature: &Signature) -> Vec<(String, String)> {
    let instances = signature.params.iter().filter_map(|(param, _)| {
        let instance = instance_of(variant, stage, param)?;
        let record = variant.pipeline.state.get(&instance)?.value.clone();
        Some((instance, record))
    });
    instances.collect()
}
