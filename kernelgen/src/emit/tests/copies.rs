//! Kernels of stages that copy between fields which share bits.

use super::{PRECISION, SCHEDULE, kernel, selection};
use crate::Generated;
use crate::source::{FileKind, Sources};

const PIPELINE: &str = r#"
name = "handover"
doc = "A walk, and what its last vertex is used for."
start = "emit"
rounds = "8"
inner = { stage = "trace", turns = "4", rounds = "2" }

[records.Path]
kept = { quantity = "counter", bits = 9 }

[records.Walk]
hit = "hit"
throughput = "spectrum"
depth = { quantity = "counter", bits = 7 }

[state]
path = "Path"
light = "Walk"
vertex = "Walk"

[stages]
emit = { on.go = "trace" }
trace = { with.walk = "light", on.go = "shade", on.stop = "join" }
shade = { with.walk = "light", on.go = "trace" }
join = { on.go = "last" }
last = { on.go = "emit", on.stop = "end" }
"#;

/// `join` hands the light walk over to `last`; `// more` is what else it does.
const STAGES: &str = r#"
import package::state::{Path, Walk};
import package::outcome::{GO, STOP};
import package::film::splat;
import package::real::{real, vec2r, vec3r};
import package::pass::path_pixel;

fn emit(path: ptr<function, Path>, light: ptr<function, Walk>) -> u32 {
    path.kept = path_pixel() & 511u;
    light.throughput = vec3r(1.0);
    light.depth = 0u;
    return GO;
}

fn trace(walk: ptr<function, Walk>) -> u32 {
    walk.hit.prim = path_pixel();
    walk.hit.t = walk.throughput.x;
    walk.hit.uv = vec2r(walk.throughput.yz);
    if walk.depth == 4u {
        return STOP;
    }
    return GO;
}

fn shade(walk: ptr<function, Walk>) -> u32 {
    walk.throughput *= walk.hit.t;
    walk.depth += 1u;
    return GO;
}

fn join(path: ptr<function, Path>, light: ptr<function, Walk>, vertex: ptr<function, Walk>) -> u32 {
    vertex.hit = light.hit;
    vertex.throughput = light.throughput;
    vertex.depth = light.depth;
    // more
    return GO;
}

fn last(path: ptr<function, Path>, vertex: ptr<function, Walk>) -> u32 {
    let word = vertex.hit.prim + vertex.depth + path.kept;
    splat(path_pixel(), vertex.throughput * vertex.hit.t + vec3r(vertex.hit.uv, real(word)));
    if path.kept == 0u {
        return STOP;
    }
    return GO;
}
"#;

const LAYOUT: &str = "doc = \"\"\n[layout]\norder = \"soa\"\nlane = 1\ndead = \"drop\"\nshare = true\n";

fn generated(set: &[(&str, &str)], more: &str) -> Generated {
    let mut sources = Sources::default();
    let schedule = SCHEDULE.replace("batch = [\"connection\"]", "batch = []");
    for (key, text) in
        [("pipelines/p.toml", PIPELINE), ("layouts/l.toml", LAYOUT), ("schedules/s.toml", schedule.as_str())]
    {
        sources.add(FileKind::Config, key, format!("configs/{key}"), text);
    }
    sources.add(FileKind::Config, "precisions/f.toml", "configs/precisions/f.toml", PRECISION);
    sources.add(FileKind::Module, "stage/small", "stages/wgsl/stage/small.wgsl", STAGES.replace("// more", more));
    let result = crate::generate(&sources, &selection(set));
    result.unwrap_or_else(|refusal| panic!("{set:?}\n{}", refusal.render(false)))
}

/// Words that a kernel loads and stores, and its statements that do it.
fn moved(parts: &Generated, name: &str) -> (u32, u32, Vec<String>) {
    let kernel = kernel(&parts.plan, name);
    let main = kernel.module.split(&format!("fn {name}_main")).nth(1).unwrap_or_default();
    let lines = main.lines().map(str::trim).filter(|line| line.contains("state_address(") || line.contains("bitcast<"));
    (kernel.load_bytes / 4, kernel.store_bytes / 4, lines.map(str::to_owned).collect())
}

/// Words that `join` loads and stores.
#[track_caller]
fn join(set: &[(&str, &str)], more: &str, expected: (u32, u32)) {
    let parts = generated(set, more);
    let (loads, stores, lines) = moved(&parts, "join");
    assert_eq!((loads, stores), expected, "{set:?} {more} {lines:?}");
}

#[test]
fn copies_in_place_move_nothing() {
    let parts = generated(&[], "");
    assert_eq!(moved(&parts, "join"), (0, 0, Vec::new()));
    let report = parts.report.kernels.iter().find(|kernel| kernel.name == "join").unwrap();
    assert!(report.loads.is_empty() && report.stores.is_empty(), "{report:?}");
    assert!(moved(&parts, "shade").1 > 0 && moved(&parts, "last").0 == 8);
    let explained = parts.report.field("vertex.throughput").unwrap();
    assert!(explained.contains("copied in place from light.throughput in join"), "{explained}");
    // Hit, throughput, and the two counters in one word.
    assert_eq!(parts.plan.bytes_per_path, 32);
}

#[test]
fn of_a_copy_in_place_only_what_the_stage_uses_is_loaded() {
    let (loads, stores, lines) = moved(&generated(&[], "path.kept = 1u;"), "join");
    assert_eq!((loads, stores), (1, 1), "the depth stays beside what is stored: {lines:?}");
    join(&[], "let t = light.hit.t;\n    if t > 1.0 { path.kept = 1u; }", (2, 1));
    join(&[], "if vertex.hit.t > 1.0 { path.kept = 1u; }", (2, 1));
    join(&[], "vertex.throughput *= 2.0;", (3, 3));
    join(&[], "if path.kept == 1u { vertex.hit.t = 0.0; }", (2, 1));
    join(&[], "light.throughput = vec3r(0.0);", (0, 0));
}

#[test]
fn copies_are_made_where_they_are_not_in_place() {
    join(&[("layout.share", "false")], "", (8, 8));
    // A path that moves into another slot takes its copies along.
    let packed = generated(&[("schedule.order", "packed")], "");
    assert!(kernel(&packed.plan, "join").module.contains("packed_slot(QUEUE_JOIN"));
    let (loads, stores, lines) = moved(&packed, "join");
    assert_eq!((loads, stores), (8, 8), "{lines:?}");
    assert!(!packed.report.field("vertex.throughput").unwrap().contains("in place"));
    // In a kernel of several stages copies stay in registers.
    let fused = generated(&[("schedule.fuse", r#"[["join", "last"]]"#)], "");
    assert_eq!(moved(&fused, "join").1, 0);
    assert!(moved(&fused, "join").0 > 0);
}
