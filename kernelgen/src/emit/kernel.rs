//! Kernels of stages and of stream consumers, as text.

use super::dense::Dense;
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
    /// Whether there is one such stage, and every path goes there.
    pub all_go_on: bool,
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
        all_go_on: stage.outcomes_by_target().len() == 1 && !stage.may_end(),
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
        let Frame { kernel, queues, access, packs, next, .. } = self;
        let moves = self.moves(&filling.targets);
        let Filling { mut imports, heading, locals, instances, body, targets, all_go_on, end, counts } = filling;
        let workgroup = queues.workgroup;
        let (condition, found) = self.path(&mut imports);
        for buffer in &access.buffers {
            imports.add("tables", [buffer.as_str(), format!("{buffer}_address").as_str()]);
        }
        for (codec, function) in &access.codecs {
            imports.add(&format!("codec::{codec}"), [function.as_str()]);
        }
        let (mut test, mut condition, mut targets) = (String::new(), condition, targets);
        let mut taken = String::new();
        if packs || moves || next.is_some() {
            test = format!("    let begun = {condition};\n");
            condition = "begun".to_owned();
        }
        if let Some(start) = next {
            taken = take_next(&targets, &mut imports);
            targets.push((start.to_owned(), "again".to_owned()));
        }
        let numbered = moves && all_go_on && self.source == Source::Slots && self.gathered.is_empty();
        let enqueue = match targets.as_slice() {
            [(target, wanted)] if numbered => self.begin_turn(target, wanted, &mut imports),
            _ => taken + &self.leave(&targets, &mut imports),
        };
        let declared = declared(&instances, &mut imports);
        let loaded = loaded(access, &mut imports);
        let stored = lines(&access.stores);
        let mut hoisted = declared.clone();
        for local in &access.locals {
            let _ = writeln!(hoisted, "    {local}");
        }
        let mut numbered = "";
        if queues.numbers_paths() && self.source == Source::Slots {
            imports.add("pass", ["path_numbers"]);
            numbered = "        path_numbers[index] = index;\n";
        }
        let counted = add_tallies(counts, &mut imports);
        let blocks = if packs {
            self.packed(&hoisted, &found, &loaded, &body, &stored, &mut imports)
        } else if moves {
            format!("{hoisted}    if begun {{\n{found}{numbered}{loaded}\n{body}{stored}    }}\n")
        } else {
            let declared = indented(&declared);
            let gap = if declared.is_empty() { "" } else { "\n" };
            format!("    if {condition} {{\n{found}{numbered}{gap}{declared}{loaded}\n{body}{stored}    }}\n")
        };
        let onward = if moves { format!(", {} where it goes on", access.moved_bytes) } else { String::new() };
        format!(
            "{imports}\n\
             /// {heading} of a path: {} bytes of state in, {} out{onward}.\n\
             @compute @workgroup_size({workgroup})\n\
             fn {kernel}_main{PARAMETERS} {{\n    \
                 let index = (group.y * groups.x + group.x) * {workgroup}u + lane;\n\
             {test}{locals}{blocks}{enqueue}{end}{counted}}}\n",
            access.load_bytes, access.store_bytes
        )
    }

    /// Loads and the body, then stores in the slot in which the path goes on. In between all of the workgroup wait for one another: a
    /// path may take the slot of a neighbour.
    fn packed(
        self,
        hoisted: &str,
        found: &str,
        loaded: &str,
        body: &str,
        stored: &str,
        imports: &mut Imports,
    ) -> String {
        let constant = stage_constant(self.entry);
        imports.add("pass", ["path_numbers"]);
        imports.add("queue", ["packed_slot"]);
        let found_again = self.found(&format!("packed_slot({constant}, index, lane)"), imports);
        format!(
            "{hoisted}    \
                 var carried_number = 0u;\n    \
                 if begun {{\n\
             {found}        \
                     carried_number = path_numbers[path_id];\n\
             {loaded}\n{body}    }}\n\n    \
                 storageBarrier();\n    \
                 if begun {{\n\
             {found_again}        \
                     path_numbers[path_id] = carried_number;\n\
             {stored}    }}\n"
        )
    }

    /// The loop whose paths stand side by side, if this kernel is one of it.
    fn inside(&self) -> Option<&Dense> {
        let dense = self.queues.dense.as_ref()?;
        (self.source == Source::Queue && dense.inside.contains(self.entry)).then_some(dense)
    }

    /// Whether paths of this kernel move to where they stand in a queue.
    fn moves(&self, targets: &[(String, String)]) -> bool {
        targets.iter().any(|(target, _)| self.queues.is_first_of_dense(target))
    }

    /// Where a queue has this path: its place in a loop whose paths stand side by side, else its slot.
    pub(super) fn queued_as(&self, imports: &mut Imports) -> &'static str {
        let name = if self.inside().is_some() { "walk_place" } else { "path_id" };
        imports.add("pass", [name]);
        name
    }

    /// The line that names the slot of the path of an invocation outside of such a loop, and a second where tables of the loop are used
    /// by slot.
    fn found(&self, slot: &str, imports: &mut Imports) -> String {
        imports.add("pass", ["path_id"]);
        if !self.access.by_slot {
            return format!("        path_id = {slot};\n");
        }
        imports.add("pass", ["path_count", "walk_place"]);
        format!("        path_id = {slot};\n        walk_place = 2u * path_count + path_id;\n")
    }

    /// The condition on which there is a path, and the lines that find it.
    fn path(&self, imports: &mut Imports) -> (String, String) {
        let constant = stage_constant(self.entry);
        match self.source {
            Source::Slots => {
                imports.add("pass", ["pass_info"]);
                return ("index < pass_info.slots".to_owned(), self.found("index", imports));
            }
            Source::Queue if self.queues.kind == QueueKind::None => {
                imports.add("queue", ["takes", constant.as_str()]);
                return (format!("takes({constant}, index)"), self.found("index", imports));
            }
            Source::Queue => {}
        }
        imports.add("control", ["running"]);
        imports.add("queue", [constant.as_str()]);
        let condition = format!("index < running({constant})");
        if self.queues.is_first_of_dense(self.entry) {
            imports.add("queue", ["walk_places"]);
            return (condition, self.found_in_place("walk_places() + index", imports));
        }
        imports.add("pass", ["path_count"]);
        imports.add("queue", ["queue"]);
        let entry = format!("queue[{constant} * path_count + index]");
        let found = match self.inside() {
            Some(_) => self.found_in_place(&entry, imports),
            None => self.found(&entry, imports),
        };
        (condition, found)
    }

    /// The lines that name the place and the slot of the path of an invocation in a loop whose paths stand side by side.
    fn found_in_place(&self, place: &str, imports: &mut Imports) -> String {
        imports.add("pass", ["path_id", "walk_place"]);
        imports.add("queue", ["walk_slots"]);
        format!("        walk_place = {place};\n        path_id = walk_slots[walk_place];\n")
    }

    /// Where paths and records go when a kernel is over: those that a workgroup counts together ask for places first, then take them.
    fn leave(&self, targets: &[(String, String)], imports: &mut Imports) -> String {
        let queues = self.queues;
        let (mut asks, mut goes, mut moved) = (Vec::new(), String::new(), String::new());
        for (target, wanted) in targets {
            let constant = stage_constant(target);
            imports.add("queue", [constant.as_str()]);
            let rank = format!("ranks[{}]", asks.len());
            if queues.is_first_of_dense(target) {
                asks.push(format!("ask_place({constant}, {wanted}, lane)"));
                imports.add("queue", ["place_of"]);
                moved = self.move_on(wanted, &format!("place_of({constant}, {rank}, lane)"), imports);
                continue;
            }
            let path = if queues.is_dense(target) { self.queued_as(imports) } else { "path_id" };
            let (function, line) = if queues.is_waited_for_in_slots(target) {
                ("wait_for", format!("wait_for({constant}, {wanted}, {path})"))
            } else if queues.stands_in(target) {
                ("stand", format!("stand({constant}, {wanted}, {path}, {rank}, lane)"))
            } else {
                ("enqueue", format!("enqueue({constant}, {wanted}, {path}, lane)"))
            };
            imports.add("queue", [function]);
            let _ = writeln!(goes, "    {line};");
            if function != "enqueue" {
                asks.push(format!("ask_place({constant}, {wanted}, lane)"));
            }
        }
        for stream in self.gathered {
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
        format!(
            "\n    let ranks = array<u32, {}>({});\n    take_places(lane);\n{goes}{moved}",
            asks.len(),
            asks.join(", ")
        )
    }

    /// The paths of all slots go on with the first stage of a loop whose paths stand side by side: as their slots do.
    fn begin_turn(&self, target: &str, wanted: &str, imports: &mut Imports) -> String {
        let constant = stage_constant(target);
        imports.add("queue", ["all_stand", constant.as_str()]);
        format!("\n    all_stand({constant}, index);\n{}", self.move_on(wanted, "index", imports))
    }

    /// A path that goes on with the first stage of a loop whose paths stand side by side: its state is stored where it stands then.
    fn move_on(&self, wanted: &str, place: &str, imports: &mut Imports) -> String {
        imports.add("pass", ["path_id", "walk_place"]);
        imports.add("queue", ["next_walk_places", "walk_slots"]);
        format!(
            "    if {wanted} {{\n        \
                     walk_place = next_walk_places() + {place};\n        \
                     walk_slots[walk_place] = path_id;\n\
             {}    }}\n",
            lines(&self.access.moved_stores)
        )
    }
}

/// Statements of a path, set off from what stands before them.
fn lines(statements: &[String]) -> String {
    let mut text = String::new();
    for (number, statement) in statements.iter().enumerate() {
        let _ = writeln!(text, "{}        {statement}", if number == 0 { "\n" } else { "" });
    }
    text
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
        "walk_place",
        "walk_slots",
    ])
}
