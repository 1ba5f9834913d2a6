//! Kernels of stages and of stream consumers, as text.

use super::memory::Access;
use super::queue::Queues;
use super::text::{Imports, PARAMETERS, stage_constant, stream_constant};
use super::wiring::{WiredStage, WiredStream};
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

/// The kernel of a stage: load, call, store, enqueue.
pub(super) fn stage_kernel(
    kernel: &str,
    name: &str,
    stage: &WiredStage,
    source: Source,
    queues: &Queues,
    access: &Access,
) -> String {
    let workgroup = queues.workgroup;
    let mut imports = Imports::default();
    imports.add(&stage.entry.module, [stage.entry.name.as_str()]);
    imports.add("pass", ["path_id"]);
    let condition = match source {
        Source::Slots => {
            imports.add("pass", ["pass_info"]);
            "index < pass_info.slots".to_owned()
        }
        Source::Queue => {
            let constant = stage_constant(name);
            imports.add("pass", ["path_count"]);
            imports.add("control", ["running"]);
            imports.add("queue", ["queue", constant.as_str()]);
            format!("index < running({constant})")
        }
    };
    let path = match source {
        Source::Slots => "index".to_owned(),
        Source::Queue => format!("queue[{} * path_count + index]", stage_constant(name)),
    };
    for buffer in &access.buffers {
        imports.add("tables", [buffer.as_str(), format!("{buffer}_address").as_str()]);
    }
    for (codec, function) in &access.codecs {
        imports.add(&format!("codec::{codec}"), [function.as_str()]);
    }
    let call = call(stage);
    let enqueue = enqueue(stage, queues, &mut imports);
    let mut text = String::new();
    let _ = write!(
        text,
        "/// Stage `{name}` of a path: {} bytes of state in, {} out.\n\
         @compute @workgroup_size({workgroup})\n\
         fn {kernel}_main{PARAMETERS} {{\n    \
             let index = (group.y * groups.x + group.x) * {workgroup}u + lane;\n",
        access.load_bytes, access.store_bytes
    );
    if !stage.routes.is_empty() {
        imports.add("outcome", ["END"]);
        text.push_str("    var outcome = END;\n");
    }
    let _ = write!(text, "    if {condition} {{\n        path_id = {path};\n");
    push_instances(&mut text, stage, access, &mut imports);
    let _ = write!(text, "\n        {call}\n");
    if !access.stores.is_empty() {
        text.push('\n');
    }
    for store in &access.stores {
        let _ = writeln!(text, "        {store}");
    }
    let _ = write!(text, "    }}\n{enqueue}{}}}\n", add_tallies(stage.counts, &mut imports));
    format!("{imports}\n{text}")
}

fn push_instances(text: &mut String, stage: &WiredStage, access: &Access, imports: &mut Imports) {
    if !stage.instances.is_empty() {
        text.push('\n');
    }
    for (instance, record) in &stage.instances {
        imports.add("state", [record.as_str()]);
        let _ = writeln!(text, "        var {instance}: {record};");
    }
    for load in &access.loads {
        let _ = writeln!(text, "        {load}");
    }
    if access.loads.iter().any(|load| load.contains("bitcast<")) {
        let types = ["real", "vec2r", "vec3r"];
        let used = types.iter().filter(|ty| {
            let cast = format!("bitcast<{ty}>");
            access.loads.iter().any(|load| load.contains(&cast))
        });
        imports.add("real", used.copied());
    }
}

fn call(stage: &WiredStage) -> String {
    let arguments: Vec<String> = stage.instances.iter().map(|(instance, _)| format!("&{instance}")).collect();
    let call = format!("{}({})", stage.entry.name, arguments.join(", "));
    if stage.routes.is_empty() {
        return format!("_ = {call};");
    }
    format!("outcome = {call};")
}

/// A line for every stage that an outcome leads to.
fn enqueue(stage: &WiredStage, queues: &Queues, imports: &mut Imports) -> String {
    let mut targets: IndexMap<&str, Vec<String>> = IndexMap::new();
    for (outcome, target) in &stage.routes {
        targets.entry(target).or_default().push(outcome.to_uppercase());
    }
    let mut text = String::new();
    if !targets.is_empty() {
        text.push('\n');
    }
    for (target, outcomes) in targets {
        let constant = stage_constant(target);
        imports.add("outcome", outcomes.iter().map(String::as_str));
        imports.add("queue", [constant.as_str()]);
        let tests: Vec<String> = outcomes.iter().map(|outcome| format!("outcome == {outcome}")).collect();
        let wanted = tests.join(" || ");
        let _ = if queues.is_ordered(target) {
            imports.add("queue", ["wait_for"]);
            writeln!(text, "    if {wanted} {{\n        wait_for({constant}, path_id);\n    }}")
        } else {
            imports.add("queue", ["enqueue"]);
            writeln!(text, "    enqueue({constant}, {wanted}, path_id, lane);")
        };
    }
    text
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
        "outcome",
        "record",
        "path_id",
        "queue",
        "control",
        "film",
        "state",
        "arguments",
        "path_count",
        "enqueue",
        "running",
        "pass_info",
        "waits_for",
    ])
}
