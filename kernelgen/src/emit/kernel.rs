//! Kernels of stages and of stream consumers, as text.

use super::memory::Access;
use super::queue::Queues;
use super::stream;
use super::text::{Imports, PARAMETERS, stage_constant, stream_constant};
use super::wiring::{WiredStage, WiredStream};
use crate::config::model::QueueKind;
use indexmap::IndexMap;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Where a kernel's paths come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Every slot in use: the start of a pass.
    Slots,
    /// The queue of the stage.
    Queue,
}

/// The frame of a kernel over paths.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub kernel: &'a str,
    /// The stage that its paths wait for.
    pub entry: &'a str,
    pub source: Source,
    pub queues: &'a Queues,
    pub access: &'a Access,
    /// Whether its paths move into slots side by side.
    pub packs: bool,
    /// The start stage, where a slot whose path is over in this kernel takes the next.
    pub next: Option<&'a str>,
    /// Streams that it may push to and whose records the workgroup counts together.
    pub gathered: &'a [String],
}

/// What a frame is filled with.
#[derive(Default)]
pub(super) struct Filling {
    pub imports: Imports,
    /// What the kernel is, for its comment.
    pub heading: String,
    /// Lines before it is known whether there is a path.
    pub locals: String,
    /// Instances with their records.
    pub instances: IndexMap<String, String>,
    /// Lines between loads and stores.
    pub body: String,
    /// The stages that wait for paths of this kernel, and the condition on which a path goes there.
    pub targets: Vec<(String, String)>,
    /// Lines that all invocations reach.
    pub end: String,
    /// Whether a stage counts something in a tally.
    pub counts: bool,
}

/// The kernel of one stage: load, call, store, enqueue.
pub(super) fn stage_kernel(frame: Frame<'_>, stage: &WiredStage) -> String {
    let mut filling = Filling {
        heading: format!("Stage `{}`", frame.entry),
        instances: stage.instances.iter().cloned().collect(),
        targets: targets(stage),
        counts: stage.counts,
        ..Filling::default()
    };
    filling.imports.add(&stage.entry.module, [stage.entry.name.as_str()]);
    let mut result = "_";
    if !stage.routes.is_empty() {
        filling.imports.add("outcome", ["END"]);
        filling.imports.add("outcome", outcomes(stage).iter().map(String::as_str));
        filling.locals = "    var outcome = END;\n".to_owned();
        result = "outcome";
    }
    filling.body = format!("        {result} = {};\n", call(&stage.entry.name, &stage.instances));
    frame.fill(filling)
}

impl Frame<'_> {
    /// The whole text.
    pub(super) fn fill(self, filling: Filling) -> String {
        let Frame { kernel, queues, access, packs, next, gathered, .. } = self;
        let Filling { mut imports, heading, locals, instances, body, targets, end, counts } = filling;
        let workgroup = queues.workgroup;
        let (condition, path) = self.path(&mut imports);
        for buffer in &access.buffers {
            imports.add("tables", [buffer.as_str(), format!("{buffer}_address").as_str()]);
        }
        for (codec, function) in &access.codecs {
            imports.add(&format!("codec::{codec}"), [function.as_str()]);
        }
        let (mut test, mut condition, mut targets) = (String::new(), condition, targets);
        let mut taken = String::new();
        if packs || next.is_some() {
            test = format!("    let begun = {condition};\n");
            condition = "begun".to_owned();
        }
        if let Some(start) = next {
            taken = take_next(&targets, &mut imports);
            targets.push((start.to_owned(), "again".to_owned()));
        }
        let enqueue = taken + &leave(&targets, gathered, queues, &mut imports);
        let declared = declared(&instances, &mut imports);
        let loaded = loaded(access, &mut imports);
        let mut stored = String::new();
        for (number, store) in access.stores.iter().enumerate() {
            let _ = writeln!(stored, "{}        {store}", if number == 0 { "\n" } else { "" });
        }
        let mut numbered = "";
        if queues.numbers_paths() && self.source == Source::Slots {
            imports.add("pass", ["path_numbers"]);
            numbered = "        path_numbers[index] = index;\n";
        }
        let counted = add_tallies(counts, &mut imports);
        let blocks = if packs {
            self.moved(&path, &declared, &loaded, &body, &stored, &mut imports)
        } else {
            let declared = indented(&declared);
            let gap = if declared.is_empty() { "" } else { "\n" };
            format!(
                "    if {condition} {{\n        path_id = {path};\n{numbered}{gap}{declared}{loaded}\n{body}{stored}    }}\n"
            )
        };
        format!(
            "{imports}\n\
             /// {heading} of a path: {} bytes of state in, {} out.\n\
             @compute @workgroup_size({workgroup})\n\
             fn {kernel}_main{PARAMETERS} {{\n    \
                 let index = (group.y * groups.x + group.x) * {workgroup}u + lane;\n\
             {test}{locals}{blocks}{enqueue}{end}{counted}}}\n",
            access.load_bytes, access.store_bytes
        )
    }

    /// Loads and the body, then stores in the slot in which the path goes on. In between all of the workgroup wait for one another: a
    /// path may take the slot of a neighbour.
    fn moved(
        self,
        path: &str,
        declared: &str,
        loaded: &str,
        body: &str,
        stored: &str,
        imports: &mut Imports,
    ) -> String {
        let constant = stage_constant(self.entry);
        imports.add("pass", ["path_numbers"]);
        imports.add("queue", ["packed_slot"]);
        let mut locals = String::new();
        for local in &self.access.locals {
            let _ = writeln!(locals, "    {local}");
        }
        format!(
            "{declared}{locals}    \
                 var carried_number = 0u;\n    \
                 if begun {{\n        \
                     path_id = {path};\n        \
                     carried_number = path_numbers[path_id];\n\
             {loaded}\n{body}    }}\n\n    \
                 storageBarrier();\n    \
                 if begun {{\n        \
                     path_id = packed_slot({constant}, index, lane);\n        \
                     path_numbers[path_id] = carried_number;\n\
             {stored}    }}\n"
        )
    }

    /// The condition on which there is a path, and its slot.
    fn path(self, imports: &mut Imports) -> (String, String) {
        imports.add("pass", ["path_id"]);
        match self.source {
            Source::Slots => {
                imports.add("pass", ["pass_info"]);
                ("index < pass_info.slots".to_owned(), "index".to_owned())
            }
            Source::Queue if self.queues.kind == QueueKind::None => {
                let constant = stage_constant(self.entry);
                imports.add("queue", ["takes", constant.as_str()]);
                (format!("takes({constant}, index)"), "index".to_owned())
            }
            Source::Queue => {
                let constant = stage_constant(self.entry);
                imports.add("pass", ["path_count"]);
                imports.add("control", ["running"]);
                imports.add("queue", ["queue", constant.as_str()]);
                (format!("index < running({constant})"), format!("queue[{constant} * path_count + index]"))
            }
        }
    }
}

/// The instances.
fn declared(instances: &IndexMap<String, String>, imports: &mut Imports) -> String {
    let mut text = String::new();
    for (instance, record) in instances {
        imports.add("state", [record.as_str()]);
        let _ = writeln!(text, "    var {instance}: {record};");
    }
    text
}

/// Lines one level deeper.
fn indented(text: &str) -> String {
    text.lines().map(|line| format!("    {line}\n")).collect()
}

/// What is loaded into the instances.
fn loaded(access: &Access, imports: &mut Imports) -> String {
    let mut text = String::new();
    for load in &access.loads {
        let _ = writeln!(text, "        {load}");
    }
    if access.all_loads().any(|load| load.contains("bitcast<")) {
        let types = ["real", "vec2r", "vec3r"];
        let used = types.iter().filter(|ty| {
            let cast = format!("bitcast<{ty}>");
            access.all_loads().any(|load| load.contains(&cast))
        });
        imports.add("real", used.copied());
    }
    text
}

/// The call of a function of instances.
pub(super) fn call(function: &str, instances: &[(String, String)]) -> String {
    let arguments: Vec<String> = instances.iter().map(|(instance, _)| format!("&{instance}")).collect();
    format!("{function}({})", arguments.join(", "))
}

/// Constants of the outcomes that lead somewhere.
fn outcomes(stage: &WiredStage) -> Vec<String> {
    stage.routes.iter().map(|(outcome, _)| outcome.to_uppercase()).collect()
}

/// Every stage that an outcome leads to, and on which outcomes.
fn targets(stage: &WiredStage) -> Vec<(String, String)> {
    let led = stage.outcomes_by_target().into_iter();
    let tests = led.map(|(target, outcomes)| {
        let tests: Vec<String> = outcomes.iter().map(|outcome| format!("outcome == {outcome}")).collect();
        (target.to_owned(), tests.join(" || "))
    });
    tests.collect()
}

/// Where paths and records go when a kernel is over: those that a workgroup counts together ask for places first, then take them.
fn leave(targets: &[(String, String)], gathered: &[String], queues: &Queues, imports: &mut Imports) -> String {
    let (mut asks, mut goes) = (Vec::new(), String::new());
    for (target, wanted) in targets {
        let constant = stage_constant(target);
        imports.add("queue", [constant.as_str()]);
        let rank = format!("ranks[{}]", asks.len());
        let (function, line) = if queues.is_waited_for_in_slots(target) {
            ("wait_for", format!("wait_for({constant}, {wanted}, path_id)"))
        } else if queues.stands_in(target) {
            ("stand", format!("stand({constant}, {wanted}, path_id, {rank}, lane)"))
        } else {
            ("enqueue", format!("enqueue({constant}, {wanted}, path_id, lane)"))
        };
        imports.add("queue", [function]);
        let _ = writeln!(goes, "    {line};");
        if function != "enqueue" {
            asks.push(format!("ask_place({constant}, {wanted}, lane)"));
        }
    }
    for stream in gathered {
        let constant = stream_constant(stream);
        let (has, gather) = (stream::has_function(stream), stream::gather_function(stream));
        imports.add("queue", [constant.as_str()]);
        imports.add("streams", [has.as_str(), gather.as_str()]);
        let _ = writeln!(goes, "    {gather}(ranks[{}], lane);", asks.len());
        asks.push(format!("ask_place({constant}, {has}(), lane)"));
    }
    if asks.is_empty() {
        return if goes.is_empty() { goes } else { format!("\n{goes}") };
    }
    imports.add("queue", ["ask_place", "take_places"]);
    format!("\n    let ranks = array<u32, {}>({});\n    take_places(lane);\n{goes}", asks.len(), asks.join(", "))
}

/// The line that gives a slot whose path goes nowhere the next path.
fn take_next(targets: &[(String, String)], imports: &mut Imports) -> String {
    imports.add("queue", ["take_next_path"]);
    let goes_on: Vec<&str> = targets.iter().map(|(_, wanted)| wanted.as_str()).collect();
    let over = if goes_on.is_empty() { "begun".to_owned() } else { format!("begun && !({})", goes_on.join(" || ")) };
    format!("\n    let again = take_next_path({over}, path_id, lane);")
}

/// The kernel of a batched stream's consumer.
pub(super) fn consumer_kernel(kernel: &str, name: &str, stream: &WiredStream, workgroup: u32) -> String {
    let mut imports = Imports::default();
    let constant = stream_constant(name);
    imports.add(&stream.entry.module, [stream.entry.name.as_str()]);
    imports.add("control", ["running"]);
    imports.add("queue", [constant.as_str()]);
    imports.add("streams", [format!("load_{name}").as_str()]);
    let counts = add_tallies(stream.counts, &mut imports);
    format!(
        "{imports}\n\
         /// Consumer `{consumer}` of the stream `{name}`.\n\
         @compute @workgroup_size({workgroup})\n\
         fn {kernel}_main{PARAMETERS} {{\n    \
             let index = (group.y * groups.x + group.x) * {workgroup}u + lane;\n    \
             if index < running({constant}) {{\n        \
                 var {name} = load_{name}(index);\n        \
                 {consumer}(&{name});\n    \
             }}\n{counts}\
         }}\n",
        consumer = stream.entry.name,
    )
}

/// The line that adds what a workgroup has counted to the tallies.
fn add_tallies(counts: bool, imports: &mut Imports) -> &'static str {
    if !counts {
        return "";
    }
    imports.add("tallies", ["add_tallies"]);
    "\n    add_tallies(lane);\n"
}

/// Names that the generated kernels use themselves: no instance and no stream can have them.
pub(super) fn reserved_locals() -> BTreeSet<&'static str> {
    BTreeSet::from([
        "index",
        "group",
        "groups",
        "lane",
        "begun",
        "again",
        "bin",
        "next",
        "ranks",
        "round",
        "rays",
        "outcome",
        "record",
        "path_id",
        "queue",
        "control",
        "film",
        "state",
        "arguments",
        "path_count",
        "carried_number",
        "enqueue",
        "running",
        "pass_info",
        "waits_for",
    ])
}
