//! The kernels that run between the stages: they clear counters, size dispatches and put queues in order.

use super::queue::Queues;
use super::stream::room_function;
use super::text::{Imports, PARAMETERS, stage_constant, stream_constant};
use crate::config::model::RayKind;
use indexmap::IndexMap;
use std::fmt::Write;

/// The kernel that zeroes the control buffer. Rays of a start stage with a kernel of its own, which takes every
/// slot, are counted here, and the paths that slots take first.
pub(super) fn begin_kernel(start_rays: Option<RayKind>, regenerates: bool) -> String {
    let mut imports = Imports::default();
    imports.add("control", ["control", "CONTROL_WORDS"]);
    let rays = start_rays.map(|kind| match kind {
        RayKind::Walk => "CONTROL_RAYS_PRIMARY",
        RayKind::Visibility => "CONTROL_RAYS_VISIBILITY",
    });
    let words: Vec<&str> = rays.into_iter().chain(regenerates.then_some("CONTROL_TAKEN")).collect();
    let mut first = "0u".to_owned();
    if !words.is_empty() {
        imports.add("control", words.iter().copied());
        imports.add("pass", ["pass_info"]);
        first = format!("select(0u, pass_info.slots, word == {})", words.join(" || word == "));
    }
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

/// What a prepare kernel hands to a kernel behind it.
#[derive(Clone, Debug)]
pub(super) enum Entries {
    /// All paths that wait for a stage, which may be put in order before its kernel runs.
    Stage {
        /// The stage.
        stage: String,
        /// Whether they are.
        ordered: bool,
        /// Whether its kernel gives them slots side by side.
        packed: bool,
        /// Whether a turn of paths that stand side by side begins with it.
        turns: bool,
    },
    /// All records that wait in a stream.
    Stream(String),
    /// All records that wait in a stream or none: none if as many can join them as waiting paths may still push. `ahead` holds the
    /// most records of a path by the stage that it waits for.
    FullStream {
        /// The stream.
        stream: String,
        /// Weights of the stages' queues.
        ahead: IndexMap<String, u32>,
    },
}

/// What a prepare kernel does for one queue.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    /// What it hands over.
    pub entries: Entries,
    /// What its rays are counted as.
    pub rays: Option<RayKind>,
}

impl Prepared {
    /// The statement before anything is handed over.
    fn noted(&self, imports: &mut Imports) -> String {
        let Entries::Stage { stage, packed: true, .. } = &self.entries else { return String::new() };
        let constant = stage_constant(stage);
        imports.add("queue", ["note_whether_all_wait", constant.as_str()]);
        format!("    note_whether_all_wait({constant});\n")
    }

    /// The statements that do it.
    fn statements(&self, imports: &mut Imports) -> String {
        let mut text = self.counted(imports);
        if let Entries::Stage { stage, ordered: true, .. } = &self.entries {
            imports.add("queue", ["open_order"]);
            let _ = writeln!(text, "    open_order({});", stage_constant(stage));
        }
        if let Entries::Stage { turns: true, .. } = &self.entries {
            imports.add("queue", ["turn_walk_places"]);
            text.push_str("    turn_walk_places();\n");
        }
        text
    }

    /// The call, and its rays counted.
    fn counted(&self, imports: &mut Imports) -> String {
        let call = self.call(imports);
        let Some(kind) = self.rays else { return format!("    {call};\n") };
        let (item, word) = match kind {
            RayKind::Walk => ("walk_rays_word", "walk_rays_word()"),
            RayKind::Visibility => ("CONTROL_RAYS_VISIBILITY", "CONTROL_RAYS_VISIBILITY"),
        };
        imports.add("control", ["count_rays", item]);
        format!("    count_rays({word}, {call});\n")
    }

    /// The call that sizes the dispatch and gives the number of entries.
    fn call(&self, imports: &mut Imports) -> String {
        match &self.entries {
            Entries::Stage { stage, .. } => {
                let constant = stage_constant(stage);
                imports.add("queue", ["start_queue", constant.as_str()]);
                imports.add("pass", ["path_count"]);
                format!("start_queue({constant}, path_count)")
            }
            Entries::Stream(stream) => {
                let (constant, room) = (stream_constant(stream), room_function(stream));
                imports.add("queue", ["start_queue", constant.as_str()]);
                imports.add("streams", [room.as_str()]);
                format!("start_queue({constant}, {room}())")
            }
            Entries::FullStream { stream, ahead } => {
                let (constant, room) = (stream_constant(stream), room_function(stream));
                imports.add("queue", ["start_full_queue", constant.as_str()]);
                imports.add("streams", [room.as_str()]);
                format!("start_full_queue({constant}, {room}(), {})", weighted(ahead, imports))
            }
        }
    }
}

/// What waits in queues, each times its weight.
fn weighted(weights: &IndexMap<String, u32>, imports: &mut Imports) -> String {
    imports.add("control", ["waiting"]);
    let mut terms = Vec::new();
    for (stage, weight) in weights {
        let constant = stage_constant(stage);
        imports.add("queue", [constant.as_str()]);
        terms.push(match weight {
            1 => format!("waiting({constant})"),
            _ => format!("{weight}u * waiting({constant})"),
        });
    }
    terms.join(" + ")
}

/// The kernel before the stages of some queues. Streams stand before stages: what is about to start no longer waits.
pub(super) fn prepare_kernel(name: &str, counts_round: bool, queues: &[Prepared]) -> String {
    let mut imports = Imports::default();
    let mut body = String::new();
    if counts_round {
        imports.add("control", ["control", "CONTROL_ROUND"]);
        body.push_str("    atomicAdd(&control[CONTROL_ROUND], 1u);\n");
    }
    for prepared in queues {
        body.push_str(&prepared.noted(&mut imports));
    }
    for prepared in queues {
        body.push_str(&prepared.statements(&mut imports));
    }
    format!(
        "{imports}\n\
         /// Sizes the dispatches that follow by what waits for them.\n\
         @compute @workgroup_size(1)\n\
         fn {name}_main() {{\n{body}}}\n"
    )
}

/// The kernel that collects the paths that wait for a stage in the order of their slots.
pub(super) fn order_kernel(name: &str, stage: &str, workgroup: u32) -> String {
    let constant = stage_constant(stage);
    let mut imports = Imports::default();
    imports.add("queue", ["take_in_order", constant.as_str()]);
    format!(
        "{imports}\n\
         /// Puts the paths that wait for `{stage}` in the order of their slots.\n\
         @compute @workgroup_size({workgroup})\n\
         fn {name}_main{PARAMETERS} {{\n    \
             take_in_order({constant}, group.y * groups.x + group.x, lane);\n\
         }}\n"
    )
}

/// The kernel after the loop: whatever path still waits was cut off, and what is left in the streams is handed to their consumers.
pub(super) fn finish_kernel(queues: &Queues, streams: &[Prepared]) -> String {
    let mut imports = Imports::default();
    let mut body = String::new();
    if !queues.stages.is_empty() {
        imports.add("control", ["control", "waiting", "CONTROL_UNFINISHED"]);
        let _ = write!(
            body,
            "    var left = 0u;\n    \
                 for (var number = 0u; number < {}u; number += 1u) {{\n        \
                     left += waiting(number);\n    \
                 }}\n    \
                 atomicAdd(&control[CONTROL_UNFINISHED], left);\n",
            queues.stages.len()
        );
    }
    for prepared in streams {
        body.push_str(&prepared.statements(&mut imports));
    }
    format!(
        "{imports}\n\
         /// Counts the paths that still wait: more than none means that the rounds did not suffice. Then empties the streams.\n\
         @compute @workgroup_size(1)\n\
         fn finish_main() {{\n{body}}}\n"
    )
}
