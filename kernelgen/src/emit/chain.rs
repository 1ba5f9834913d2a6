//! The kernel of several stages: it loads what any of them needs, takes a path from stage to stage in registers, and stores what
//! lives on.
//!
//! Stages stand in the order of the pipeline, each behind the question whether the path goes on with it. Where ways lead back, they
//! stand in a loop, whose turns are the rounds in which the path would wait for them in queues: neighbours trace together, then
//! shade together, and rays count for the rounds in which kernels of single stages would trace them.

use super::fusion::Chain;
use super::kernel::{Filling, Frame, Source, call};
use super::memory::Late;
use super::text::{Imports, next_constant};
use super::wiring::Wiring;
use crate::analyze::{KernelTraffic, Leaf};
use crate::config::model::RayKind;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// `package::next`: what a path goes on with inside a kernel.
pub(super) fn module(wiring: &Wiring) -> String {
    let mut text =
        String::from("/// What a path goes on with inside a kernel: nothing, or a stage.\nconst NEXT_END: u32 = 0u;\n");
    for (stage, number) in wiring.stages.keys().zip(1..) {
        let _ = writeln!(text, "const {}: u32 = {number}u;", next_constant(stage));
    }
    text
}

/// The kernel of a chain.
pub(super) fn chain_kernel(frame: Frame<'_>, wiring: &Wiring, chain: &Chain) -> String {
    let mut writer =
        Writer { wiring, chain, source: frame.source, late: &frame.access.late, imports: Imports::default() };
    let body = writer.body();
    let targets = chain.exits.iter().map(|exit| (exit.clone(), writer.goes_on_with(exit))).collect();
    let stages = || chain.stages.iter().map(|name| &wiring.stages[name]);
    let mut filling = Filling { body, targets, ..Filling::default() };
    filling.locals = "    var next = NEXT_END;\n".to_owned();
    writer.imports.add("next", ["NEXT_END"]);
    for group in 0..frame.access.late.len() {
        let _ = writeln!(filling.locals, "    var {} = false;", loaded_flag(group));
    }
    if stages().any(|stage| stage.rays.is_some()) {
        writer.imports.add("control", ["add_rays"]);
        filling.locals.push_str("    var rays = vec4u();\n");
        filling.end = "\n    add_rays(rays, lane);\n".to_owned();
    }
    let names: Vec<String> = chain.stages.iter().map(|name| format!("`{name}`")).collect();
    filling.heading = format!("Stages {}", names.join(", "));
    filling.instances = stages().flat_map(|stage| stage.instances.iter().cloned()).collect();
    filling.counts = stages().any(|stage| stage.counts);
    filling.imports = writer.imports;
    frame.fill(filling)
}

struct Writer<'a> {
    wiring: &'a Wiring,
    chain: &'a Chain,
    source: Source,
    late: &'a [Late],
    imports: Imports,
}

/// Whether a group of late loads has been loaded.
fn loaded_flag(group: usize) -> String {
    format!("loaded_{group}")
}

/// The leaves that a kernel of several stages may load late, by the stages that use them: those that the entry does not touch, and that
/// are not stored at the end, where they might not have been loaded. Whichever of their stages runs first finds them as they were in
/// memory, since no other stage touches them.
pub(super) fn late_leaves(
    wiring: &Wiring,
    chain: &Chain,
    traffic: &KernelTraffic,
) -> BTreeMap<BTreeSet<String>, BTreeSet<Leaf>> {
    let mut late: BTreeMap<BTreeSet<String>, BTreeSet<Leaf>> = BTreeMap::new();
    for leaf in traffic.loads.difference(&traffic.stores) {
        let touches = |name: &&String| {
            let facts = &wiring.stages[*name].facts;
            [&facts.reads, &facts.writes, &facts.maybe].iter().any(|leaves| leaves.contains_key(leaf))
        };
        let stages: BTreeSet<String> = chain.stages.iter().filter(touches).cloned().collect();
        if !stages.contains(&chain.entry) {
            late.entry(stages).or_default().insert(leaf.clone());
        }
    }
    late
}

impl Writer<'_> {
    /// What every path does.
    fn body(&mut self) -> String {
        let entry = self.chain.entry.as_str();
        let begun = match self.source {
            Source::Slots => "1u",
            Source::Queue => "rounds_begun()",
        };
        if self.source == Source::Queue && self.chain.loops {
            let next = self.constant(entry);
            return format!("        next = {next};\n{}", self.turns(begun, true));
        }
        let first = self.stage(entry, begun, 2);
        // Where the start is one of the stages that follow, a path comes to it again.
        let again = self.chain.stages.iter().any(|name| self.wiring.stages[name].leads_to(entry));
        let rest = if self.chain.loops { self.turns(begun, again) } else { self.once(begun, again, 2) };
        format!("{first}{rest}")
    }

    /// The stages one behind the other, each for the paths that go on with it; the entry among them or not.
    fn once(&mut self, round: &str, with_entry: bool, depth: usize) -> String {
        let indent = "    ".repeat(depth);
        let chain = self.chain;
        let mut text = String::new();
        for name in chain.stages.iter().filter(|name| with_entry || **name != chain.entry) {
            let (condition, stage) = (self.goes_on_with(name), self.stage(name, round, depth + 1));
            let _ = write!(text, "{indent}if {condition} {{\n{stage}{indent}}}\n");
        }
        text
    }

    /// The stages again and again, until the path is over or goes on elsewhere. A path that the last round leaves inside is given up
    /// and counted, as one that would wait in a queue then.
    fn turns(&mut self, begun: &str, with_entry: bool) -> String {
        let chain = self.chain;
        self.imports.add("control", ["ROUNDS", "count_unfinished"]);
        self.import_round(begun);
        let mut inside = "next != NEXT_END".to_owned();
        for exit in &chain.exits {
            let _ = write!(inside, " && next != {}", self.constant(exit));
        }
        let body = self.once("round", with_entry, 3);
        format!(
            "        for (var round = {begun}; {inside}; round += 1u) {{\n            \
                 if round > ROUNDS {{\n                \
                     count_unfinished();\n                \
                     next = NEXT_END;\n                \
                     break;\n            \
                 }}\n\
             {body}        }}\n"
        )
    }

    /// A stage: its ray is counted, it is called, its outcome is followed.
    fn stage(&mut self, name: &str, round: &str, depth: usize) -> String {
        let indent = "    ".repeat(depth);
        let stage = &self.wiring.stages[name];
        self.imports.add(&stage.entry.module, [stage.entry.name.as_str()]);
        let mut text = self.late_loads(name, &indent);
        match stage.rays {
            Some(RayKind::Walk) => {
                self.imports.add("control", ["walk_ray"]);
                self.import_round(round);
                let _ = writeln!(text, "{indent}rays += walk_ray({round});");
            }
            Some(RayKind::Visibility) => {
                let _ = writeln!(text, "{indent}rays.w += 1u;");
            }
            None => {}
        }
        if stage.routes.is_empty() {
            let _ =
                writeln!(text, "{indent}_ = {};\n{indent}next = NEXT_END;", call(&stage.entry.name, &stage.instances));
            return text;
        }
        let _ = writeln!(text, "{indent}switch {} {{", call(&stage.entry.name, &stage.instances));
        for (target, outcomes) in stage.outcomes_by_target() {
            self.imports.add("outcome", outcomes.iter().map(String::as_str));
            let next = self.constant(target);
            let _ = writeln!(text, "{indent}    case {}: {{ next = {next}; }}", outcomes.join(", "));
        }
        let _ = writeln!(text, "{indent}    default: {{ next = NEXT_END; }}\n{indent}}}");
        text
    }

    /// What the stage uses and no stage before it has loaded.
    fn late_loads(&self, name: &str, indent: &str) -> String {
        let mut text = String::new();
        for (group, late) in self.late.iter().enumerate().filter(|(_, late)| late.stages.contains(name)) {
            let flag = loaded_flag(group);
            let _ = writeln!(text, "{indent}if !{flag} {{\n{indent}    {flag} = true;");
            for load in &late.loads {
                let _ = writeln!(text, "{indent}    {load}");
            }
            let _ = writeln!(text, "{indent}}}");
        }
        text
    }

    fn import_round(&mut self, round: &str) {
        if round == "rounds_begun()" {
            self.imports.add("control", ["rounds_begun"]);
        }
    }

    fn goes_on_with(&mut self, stage: &str) -> String {
        format!("next == {}", self.constant(stage))
    }

    /// The constant of a stage that a path goes on with.
    fn constant(&mut self, stage: &str) -> String {
        let constant = next_constant(stage);
        self.imports.add("next", [constant.as_str()]);
        constant
    }
}
