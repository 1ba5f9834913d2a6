//! Whole generations of a small pipeline.

use crate::config::model::{Effect, Selection};
use crate::plan::{Access, Plan, Role, Step};
use crate::source::{FileKind, Sources};
use crate::{Generated, Refusal};

const PIPELINE: &str = r#"
name = "small"
doc = "Three stages, two outcomes, a stream."
start = "emit"
rounds = "max_edges"

[params]
max_edges = { type = "u32", value = 5 }

[records.Path]
sample = { quantity = "counter", bits = 19 }
length = { quantity = "counter", bits = 5 }
flags = { quantity = "flags", names = ["specular", "bounced"] }

[records.Walk]
position = "position"
direction = "unit_vector"
throughput = "spectrum"
hit = "hit"
pdf_w = "pdf"
scratch = "weight"

[records.Connection]
origin = "position"
contribution = "spectrum"
pixel = "index"
unread = "length"

[state]
path = "Path"
eye = "Walk"

[streams.connection]
record = "Connection"
consumer = "resolve"
rays = "visibility"

[stages]
emit = { on.emitted = "trace" }
trace = { entry = "trace_walk", with.walk = "eye", rays = "walk", on.hit = "shade", on.miss = "end" }
shade = { on.scattered = "trace", on.absorbed = "end" }
"#;

const STAGES: &str = r#"
import package::state::{Path, Walk, Connection, FLAGS_BOUNCED};
import package::outcome::{EMITTED, HIT, MISS, SCATTERED, ABSORBED};
import package::features::HAS_SKY;
import package::params::max_edges;
import package::streams::push_connection;
import package::film::splat;
import package::real::vec3r;
import package::pass::{path_pixel, path_sample};

var<storage, read> spheres: array<vec4f>;

/// Starts a path.
fn emit(path: ptr<function, Path>, eye: ptr<function, Walk>) -> u32 {
    path.sample = path_sample();
    path.length = 0u;
    path.flags = 0u;
    eye.position = vec3r(0.0);
    eye.direction = vec3r(0.0, 0.0, 1.0);
    eye.throughput = vec3r(1.0);
    eye.pdf_w = 1.0;
    eye.scratch = 2.0;
    return EMITTED;
}

/// Traces a ray.
fn trace_walk(walk: ptr<function, Walk>) -> u32 {
    let sphere = spheres[0];
    walk.hit.prim = 0u;
    walk.hit.t = dot(sphere.xyz - walk.position, walk.direction);
    walk.hit.uv = vec2f(0.0);
    if HAS_SKY && walk.hit.t < 0.0 {
        return MISS;
    }
    if walk.hit.t < 0.0 {
        return MISS;
    }
    return HIT;
}

/// Scatters.
fn shade(path: ptr<function, Path>, eye: ptr<function, Walk>) -> u32 {
    eye.position += eye.direction * eye.hit.t;
    var connection: Connection;
    connection.origin = eye.position;
    connection.contribution = eye.throughput * eye.pdf_w;
    connection.pixel = path_pixel();
    connection.unread = 1.0;
    push_connection(connection);
    eye.throughput *= 0.5;
    path.length += 1u;
    path.flags |= FLAGS_BOUNCED;
    if path.length >= max_edges || path.sample == 7u {
        return ABSORBED;
    }
    return SCATTERED;
}

/// Adds what a connection carries.
fn resolve(connection: ptr<function, Connection>) {
    splat(connection.pixel, connection.contribution * connection.origin.z);
}
"#;

const LAYOUT: &str = "doc = \"\"\n[layout]\norder = \"aos\"\nlane = 4\ndead = \"drop\"\n";
const SCHEDULE: &str = "doc = \"\"\n[schedule]\nfuse = []\nqueue = \"subgroup\"\nworkgroup = 64\nload = \"entry\"\nuntil = \"empty\"\naccumulate = \"atomic_f32\"\nbatch = [\"connection\"]\ncapacity = 4\n";
const PRECISION: &str = "doc = \"\"\n[precision]\nreal = \"f32\"\n";

fn sources(pipeline: &str, layout: &str, stages: &str) -> Sources {
    let mut sources = Sources::default();
    for (key, text) in [
        ("pipelines/p.toml", pipeline),
        ("layouts/l.toml", layout),
        ("schedules/s.toml", SCHEDULE),
        ("precisions/f.toml", PRECISION),
    ] {
        sources.add(FileKind::Config, key, format!("configs/{key}"), text);
    }
    sources.add(FileKind::Module, "stage/small", "stages/wgsl/stage/small.wgsl", stages);
    sources
}

fn selection(set: &[(&str, &str)]) -> Selection {
    let sky = Effect { present: false, reason: "no sky".to_owned() };
    Selection {
        pipeline: "pipelines/p.toml".to_owned(),
        layout: "layouts/l.toml".to_owned(),
        schedule: "schedules/s.toml".to_owned(),
        precision: "precisions/f.toml".to_owned(),
        set: set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect(),
        effects: [("sky".to_owned(), sky)].into(),
    }
}

fn generated(set: &[(&str, &str)]) -> Generated {
    let result = crate::generate(&sources(PIPELINE, LAYOUT, STAGES), &selection(set));
    result.unwrap_or_else(|refusal| panic!("{set:?}\n{}", refusal.render(false)))
}

fn refusal(pipeline: &str, layout: &str, stages: &str) -> Refusal {
    crate::generate(&sources(pipeline, layout, stages), &selection(&[])).expect_err("must be refused")
}

/// The codes of a refusal after one replacement in the pipeline or the stages.
#[track_caller]
fn refused(code: &str, from: &str, to: &str) -> String {
    assert!(PIPELINE.contains(from) || STAGES.contains(from), "{from}");
    let refusal = refusal(&PIPELINE.replace(from, to), LAYOUT, &STAGES.replace(from, to));
    let text = refusal.render(false);
    assert!(refusal.diagnostics.iter().any(|finding| finding.code == code), "{code} not in\n{text}");
    assert!(refusal.diagnostics.iter().all(|finding| !finding.labels.is_empty()), "{text}");
    text
}

fn kernel<'a>(plan: &'a Plan, name: &str) -> &'a crate::plan::Kernel {
    plan.kernels.iter().find(|kernel| kernel.name == name).unwrap()
}

/// The kernels of some steps.
fn names<'a>(plan: &'a Plan, steps: impl IntoIterator<Item = &'a Step>) -> Vec<&'a str> {
    let name = |step: &Step| match step {
        Step::Dispatch { kernel } | Step::Single { kernel } | Step::Indirect { kernel, .. } => *kernel,
        Step::Loop { .. } => panic!("{step:?}"),
    };
    steps.into_iter().map(|step| plan.kernels[name(step)].name.as_str()).collect()
}

#[test]
fn every_order_and_lane_generates() {
    for order in ["aos", "soa", "aosoa2", "aosoa32"] {
        for lane in ["1", "2", "4"] {
            for dead in ["drop", "keep"] {
                let set = [("layout.order", order), ("layout.lane", lane), ("layout.dead", dead)];
                let parts = generated(&set);
                assert_eq!(parts.report.bytes_per_path, parts.plan.bytes_per_path);
            }
        }
    }
}

#[test]
fn every_schedule_generates() {
    for queue in ["atomic", "subgroup"] {
        for accumulate in ["atomic_f32", "fixed_i64", "racy"] {
            for workgroup in ["32", "256"] {
                let set =
                    [("schedule.queue", queue), ("schedule.accumulate", accumulate), ("schedule.workgroup", workgroup)];
                let needs = generated(&set).plan.needs;
                assert_eq!(needs.subgroup, queue == "subgroup");
                assert_eq!(needs.float32_atomics, accumulate == "atomic_f32");
                assert_eq!(needs.int64_atomics, accumulate == "fixed_i64");
            }
        }
    }
}

#[test]
fn equal_input_gives_equal_bytes() {
    assert_eq!(format!("{:?}", generated(&[])), format!("{:?}", generated(&[])));
}

#[test]
fn dead_leaves_are_not_stored() {
    let parts = generated(&[]);
    let stored: Vec<&str> =
        parts.report.tables.iter().flat_map(|table| &table.fields).map(|field| field.name.as_str()).collect();
    // 3 vectors, pdf, t, and 26 bits: 12 words; prim, uv and scratch are dead.
    assert!(!stored.contains(&"eye.scratch"), "{stored:?}");
    assert!(!stored.contains(&"eye.hit.prim"), "{stored:?}");
    assert!(stored.contains(&"path.flags") && stored.contains(&"eye.hit.t"), "{stored:?}");
    assert!(parts.report.dead.iter().any(|dead| dead.name == "eye.scratch"));
    assert!(generated(&[("layout.dead", "keep")]).plan.bytes_per_path > parts.plan.bytes_per_path);
}

#[test]
fn a_round_prepares_queues_before_their_stages() {
    let plan = generated(&[]).plan;
    let [begin, first, Step::Loop { rounds: 5, body }, after @ ..] = plan.program.as_slice() else {
        panic!("{:?}", plan.program)
    };
    assert!(matches!((begin, first), (Step::Single { .. }, Step::Dispatch { .. })));
    assert_eq!(names(&plan, [begin, first]), ["begin", "emit"]);
    let expected = ["prepare_trace", "trace", "prepare_shade", "resolve_connection", "shade"];
    assert_eq!(names(&plan, body), expected);
    assert_eq!(names(&plan, after), ["finish", "resolve_connection"]);
    let single = |kernel: &crate::plan::Kernel| kernel.name.starts_with("prepare") || kernel.name == "finish";
    for kernel in plan.kernels.iter().filter(|kernel| !single(kernel)) {
        let arguments = kernel.bindings.iter().any(|binding| plan.buffers[binding.buffer].role == Role::Arguments);
        assert!(!arguments, "{}", kernel.name);
    }
}

#[test]
fn a_stream_is_emptied_when_what_waits_may_not_fit() {
    let plan = generated(&[]).plan;
    let prepare = &kernel(&plan, "prepare_shade").module;
    let flush = "start_full_queue(STREAM_CONNECTION, connection_room(), waiting(QUEUE_SHADE))";
    let (flush, start) = (prepare.find(flush).expect(prepare), prepare.find("start_queue(QUEUE_SHADE").expect(prepare));
    assert!(flush < start, "what is about to start no longer waits");
    assert!(!kernel(&plan, "prepare_trace").module.contains("STREAM_CONNECTION"));
    assert!(kernel(&plan, "finish").module.contains("start_queue(STREAM_CONNECTION, connection_room())"));
}

/// Of the paths that wait when `relay` is about to run, those at `shade` push once in this round and those at `relay` twice; the
/// two stages of which a path runs only one do not add up.
#[test]
fn the_bound_of_a_round_follows_the_routes() {
    let routes = "shade = { on.scattered = \"trace\", on.absorbed = \"end\" }";
    let split = "relay = { on.hit = \"shade\", on.miss = \"dim\" }\n\
        dim = { entry = \"shade\", on.scattered = \"trace\", on.absorbed = \"end\" }\n";
    let relay = "fn relay(eye: ptr<function, Walk>) -> u32 {\n    \
        var connection: Connection;\n    connection.origin = eye.position;\n    push_connection(connection);\n    \
        if eye.hit.t > 1.0 { return HIT; }\n    return MISS;\n}\n";
    let pipeline =
        PIPELINE.replace("on.hit = \"shade\"", "on.hit = \"relay\"").replace(routes, &format!("{split}{routes}"));
    let result = crate::generate(&sources(&pipeline, LAYOUT, &format!("{STAGES}\n{relay}")), &selection(&[]));
    let plan = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan;
    let prepare = &kernel(&plan, "prepare_relay").module;
    let bound = "2u * waiting(QUEUE_RELAY) + waiting(QUEUE_DIM) + waiting(QUEUE_SHADE)";
    assert!(prepare.contains(bound), "{prepare}");
}

#[test]
fn a_pass_uses_as_many_slots_as_an_emptied_stream_can_serve() {
    let plan_of = |capacity: &str| generated(&[("schedule.capacity", capacity)]).plan;
    for (capacity, slots, bytes) in [("14", 1024, 392), ("1", 1024, 28), ("0.25", 256, 7), ("0.1", 102, 3)] {
        let plan = plan_of(capacity);
        let stream = plan.buffers.iter().find(|buffer| buffer.role == Role::Stream).unwrap();
        assert_eq!((plan.slots_per_grain, stream.size.per_path), (slots, bytes), "{capacity}");
    }
    assert!(kernel(&plan_of("1"), "shade").module.contains("return path_count;"));
    assert!(kernel(&plan_of("0.25"), "shade").module.contains("return path_count / 1024u * 256u;"));
    assert_eq!(generated(&[("schedule.capacity", "0.25"), ("schedule.batch", "[]")]).plan.slots_per_grain, 1024);
}

#[test]
fn a_stream_without_room_for_a_round_is_refused() {
    let set = [("schedule.capacity", "0.0005")];
    let refusal = crate::generate(&sources(PIPELINE, LAYOUT, STAGES), &selection(&set)).expect_err("no room");
    let text = refusal.render(false);
    assert_eq!(refusal.diagnostics[0].code, "K0222", "{text}");
    assert!(text.contains("write a capacity of 0.001 or more"), "{text}");
}

/// Walks that miss start anew: `trace` gets its paths from two stages then.
fn with_two_feeders(order: &str) -> Plan {
    let pipeline = PIPELINE.replace("on.miss = \"end\"", "on.miss = \"emit\"");
    assert_ne!(pipeline, PIPELINE);
    let result = crate::generate(&sources(&pipeline, LAYOUT, STAGES), &selection(&[("schedule.order", order)]));
    result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan
}

#[test]
fn paths_that_come_from_several_stages_are_put_in_order() {
    let plan = with_two_feeders("slot");
    let Some(Step::Loop { body, .. }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    let expected = [
        "prepare_emit",
        "emit",
        "prepare_trace",
        "order_trace",
        "trace",
        "prepare_shade",
        "resolve_connection",
        "shade",
    ];
    assert_eq!(names(&plan, body), expected);
    for feeder in ["emit_first", "emit", "shade"] {
        assert!(kernel(&plan, feeder).module.contains("wait_for(QUEUE_TRACE, path_id);"), "{feeder}");
    }
    assert!(kernel(&plan, "trace").module.contains("enqueue(QUEUE_SHADE,"));
    assert!(kernel(&plan, "prepare_trace").module.contains("open_order(QUEUE_TRACE);"));
}

/// Every slot is looked at, and only where a path waits for the kernel at all.
#[test]
fn without_queues_paths_are_marked() {
    let plan = generated(&[("schedule.queue", "none"), ("schedule.order", "slot")]).plan;
    let trace = &kernel(&plan, "trace").module;
    assert!(trace.contains("if takes(QUEUE_TRACE, index) {\n        path_id = index;"), "{trace}");
    assert!(trace.contains("waits_for[path] = number + 1u;") && !trace.contains("subgroup"), "{trace}");
    let prepare = &kernel(&plan, "prepare_trace").module;
    assert!(prepare.contains("select(entries, pass_info.slots, entries > 0u && number < 2u)"), "{prepare}");
    let queues: Vec<&str> =
        plan.buffers.iter().filter(|buffer| buffer.role == Role::Queue).map(|buffer| buffer.name.as_str()).collect();
    assert_eq!(queues, ["waits_for"]);
    assert!(plan.kernels.iter().all(|kernel| !kernel.name.starts_with("order_")));
}

#[test]
fn paths_that_come_from_one_stage_are_not_put_in_order() {
    for plan in [generated(&[("schedule.order", "slot")]).plan, with_two_feeders("arrival")] {
        assert!(plan.kernels.iter().all(|kernel| !kernel.module.contains("waits_for")));
        assert!(plan.buffers.iter().all(|buffer| buffer.name != "waits_for"));
    }
}

/// Both stages declare keys, which read what nobody else does: the primitive of the hit.
fn with_keys(set: &[(&str, &str)], key: &str) -> Result<Generated, Refusal> {
    let pipeline = PIPELINE
        .replace("rays = \"walk\", on", "rays = \"walk\", sort.pole = \"pole_key\", on")
        .replace(
            "shade = { on",
            "shade = { with.walk = \"eye\", sort.prim = \"prim_key\", sort.pole = \"pole_key\", on",
        )
        .replace("on.miss = \"end\"", "on.miss = \"emit\"");
    let functions = format!(
        "{STAGES}\nfn prim_key(walk: ptr<function, Walk>) -> u32 {{ {key} }}\n\
         fn pole_key(walk: ptr<function, Walk>) -> u32 {{ return u32(walk.direction.z > 0.0); }}\n"
    );
    crate::generate(&sources(&pipeline, LAYOUT, &functions), &selection(set))
}

fn sorted(set: &[(&str, &str)]) -> Generated {
    with_keys(set, "return walk.hit.prim;").unwrap_or_else(|refusal| panic!("{set:?}\n{}", refusal.render(false)))
}

#[test]
fn a_queue_is_sorted_by_the_key_of_its_stage() {
    let Generated { plan, report, .. } = sorted(&[("schedule.sort", "prim"), ("schedule.order", "slot")]);
    let Some(Step::Loop { body, .. }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    let expected = ["prepare_shade", "resolve_connection", "count_keys_shade", "sum_keys", "sort_shade", "shade"];
    let names = names(&plan, body);
    assert_eq!(names[names.len() - 6..], expected);
    assert!(names.contains(&"order_trace") && !names.contains(&"order_shade"), "{names:?}");
    let count = kernel(&plan, "count_keys_shade");
    assert!(count.module.contains("bin = prim_key(&eye) % BINS;"), "{}", count.module);
    assert_eq!((count.load_bytes, count.store_bytes, count.rays), (4, 0, None), "one word holds the primitive");
    assert!(!kernel(&plan, "shade").module.contains("eye.hit.prim ="), "only the key needs it");
    assert!(report.dead.iter().all(|dead| dead.name != "eye.hit.prim"), "{:?}", report.dead);
    let unsorted = sorted(&[]).report.dead;
    assert!(unsorted.iter().any(|dead| dead.name == "eye.hit.prim"), "without the key nobody reads it: {unsorted:?}");
}

/// The key wins over the order of slots, and kernels that the queue is fed by do not wait for that.
#[test]
fn a_sorted_queue_is_not_put_in_order_of_slots() {
    let plan = sorted(&[("schedule.sort", "pole"), ("schedule.order", "slot")]).plan;
    let Some(Step::Loop { body, .. }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    let names = names(&plan, body);
    let steps = ["count_keys_trace", "sum_keys", "sort_trace", "trace"];
    assert!(names.windows(4).any(|window| window == steps), "{names:?}");
    assert!(kernel(&plan, "shade").module.contains("enqueue(QUEUE_TRACE,"));
    assert!(plan.kernels.iter().all(|kernel| !kernel.module.contains("waits_for")));
}

/// Of several keys that a stage declares, the schedule's first.
#[test]
fn the_first_key_of_a_list_counts() {
    for (list, function) in [("[\"prim\", \"pole\"]", "prim_key"), ("[\"pole\", \"prim\"]", "pole_key")] {
        let plan = sorted(&[("schedule.sort", list)]).plan;
        assert!(kernel(&plan, "count_keys_shade").module.contains(&format!("bin = {function}(&eye)")), "{list}");
        assert!(kernel(&plan, "count_keys_trace").module.contains("bin = pole_key(&eye)"), "{list}");
        assert_eq!(plan.kernels.iter().filter(|kernel| kernel.name == "sum_keys").count(), 1, "shared");
    }
}

#[test]
fn what_is_not_sorted_has_no_trace_of_keys() {
    let fused = ("schedule.fuse", r#"[["trace", "shade"]]"#);
    let inline = ("schedule.batch", "[]");
    for set in [&[][..], &[("schedule.sort", "none")], &[("schedule.sort", "prim"), fused, inline]] {
        let plan = sorted(set).plan;
        assert!(plan.kernels.iter().all(|kernel| !kernel.module.contains("key_bins")), "{set:?}");
        assert!(plan.buffers.iter().all(|buffer| !buffer.name.starts_with("key")), "{set:?}");
    }
    let plan = sorted(&[("schedule.sort", "pole"), fused, inline]).plan;
    assert_eq!(
        kernel(&plan, "count_keys_trace").load_bytes,
        16,
        "the entry of a fused kernel: the lane of `direction`"
    );
}

#[test]
fn wrong_keys_are_refused() {
    let sort = ("schedule.sort", "prim");
    let key = "return walk.hit.prim;";
    for (code, set, key) in [
        ("K0228", &[("schedule.sort", "prin")][..], key),
        ("K0229", &[sort, ("schedule.queue", "none")], key),
        ("K0230", &[sort], "walk.scratch = 1.0; return walk.hit.prim;"),
        ("K0230", &[sort], "splat(0u, walk.throughput); return 0u;"),
        ("K0310", &[sort], "return 1.0;"),
    ] {
        let text = with_keys(set, key).expect_err(code).render(false);
        assert!(text.contains(code), "{code} not in\n{text}");
    }
    let nearest = with_keys(&[("schedule.sort", "prin")], key).expect_err("no such key").render(false);
    assert!(nearest.contains("did you mean `prim`?"), "{nearest}");
    refused("K0208", "shade = { on", "shade = { sort.prim = \"prim_key\", on");
    refused("K0220", "shade = { on", "shade = { with.walk = \"eye\", on");
}

/// The schedule that fuses these groups, with inline visibility.
fn fused(fuse: &str) -> Generated {
    generated(&[("schedule.fuse", fuse), ("schedule.batch", "[]")])
}

#[test]
fn a_megakernel_stores_nothing_and_waits_for_nothing() {
    let parts = fused("all");
    let plan = &parts.plan;
    assert_eq!(names(plan, &plan.program), ["begin", "emit"]);
    assert_eq!((plan.bytes_per_path, plan.kernels[1].rays), (0, None));
    assert_eq!(plan.kernels[1].stages, ["emit", "trace", "shade"]);
    assert!(plan.buffers.iter().all(|buffer| !matches!(buffer.role, Role::State | Role::Queue | Role::Arguments)));
    assert!(!kernel(plan, "begin").module.contains("CONTROL_RAYS"), "the kernel counts its rays itself");
    let explained = parts.report.field("eye.throughput").unwrap();
    assert!(explained.contains("not stored: lives within one kernel"), "{explained}");
    assert!(parts.report.field("eye.scratch").unwrap().contains("dead: written by `emit`"));
    let expected = "    var next = NEXT_END;
    var rays = vec4u();
    if index < pass_info.slots {
        path_id = index;

        var path: Path;
        var eye: Walk;

        switch emit(&path, &eye) {
            case EMITTED: { next = NEXT_TRACE; }
            default: { next = NEXT_END; }
        }
        for (var round = 1u; next != NEXT_END; round += 1u) {
            if round > ROUNDS {
                count_unfinished();
                next = NEXT_END;
                break;
            }
            if next == NEXT_TRACE {
                rays += walk_ray(round);
                switch trace_walk(&eye) {
                    case HIT: { next = NEXT_SHADE; }
                    default: { next = NEXT_END; }
                }
            }
            if next == NEXT_SHADE {
                switch shade(&path, &eye) {
                    case SCATTERED: { next = NEXT_TRACE; }
                    default: { next = NEXT_END; }
                }
            }
        }
    }

    add_rays(rays, lane);
}";
    let module = &plan.kernels[1].module;
    assert!(module.contains(expected), "{module}");
    assert!(module.contains("const ROUNDS: u32 = 5u;"), "{module}");
}

/// A path that leaves with the first stage does not load what only the second one uses.
#[test]
fn fields_are_loaded_with_the_first_stage_that_uses_them() {
    let groups = ("schedule.fuse", r#"[["trace", "shade"]]"#);
    let [entry, late] = ["entry", "use"].map(|load| {
        let plan = generated(&[groups, ("schedule.batch", "[]"), ("schedule.load", load)]).plan;
        kernel(&plan, "trace").clone()
    });
    assert!(late.load_bytes >= entry.load_bytes, "a lane is loaded twice if its words are used at different times");
    assert!(!entry.module.contains("loaded_0"));
    let waits = "            if next == NEXT_SHADE {
                if !loaded_0 {
                    loaded_0 = true;
";
    assert!(late.module.contains("    var loaded_0 = false;\n") && late.module.contains(waits), "{}", late.module);
    let (before, after) = late.module.split_once(waits).unwrap();
    assert!(!before.contains("eye.throughput = ") && after.contains("eye.throughput = "), "{}", late.module);
    assert!(before.contains("eye.position = "), "the entry uses it");
}

#[test]
fn a_group_without_a_way_back_is_a_straight_kernel() {
    let pipeline = PIPELINE.replace("on.scattered = \"trace\"", "on.scattered = \"last\"")
        + "last = { entry = \"trace_walk\", with.walk = \"eye\", on.hit = \"end\", on.miss = \"end\" }\n";
    let set = [("schedule.fuse", r#"[["trace", "shade"]]"#)];
    let result = crate::generate(&sources(&pipeline, LAYOUT, STAGES), &selection(&set));
    let plan = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan;
    let Some(Step::Loop { rounds: 1, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    let expected = ["prepare_trace", "resolve_connection", "trace", "prepare_last", "last"];
    assert_eq!(names(&plan, body), expected, "paths that wait for the kernel may push once each");
    let module = &kernel(&plan, "trace").module;
    let expected = "
        rays += walk_ray(rounds_begun());
        switch trace_walk(&eye) {
            case HIT: { next = NEXT_SHADE; }
            default: { next = NEXT_END; }
        }
        if next == NEXT_SHADE {
            switch shade(&path, &eye) {
                case SCATTERED: { next = NEXT_LAST; }
                default: { next = NEXT_END; }
            }
        }
";
    assert!(module.contains(expected), "{module}");
    assert!(module.contains("    enqueue(QUEUE_LAST, next == NEXT_LAST, path_id, lane);\n\n    add_rays("), "{module}");
    assert!(kernel(&plan, "prepare_trace").module.contains("connection_room(), waiting(QUEUE_TRACE))"));
}

/// Each stage that others lead to from outside has a queue and a kernel of its own, which knows where its paths begin.
#[test]
fn a_group_with_two_entries_has_two_kernels() {
    let pipeline = PIPELINE.replace("on.hit = \"shade\", on.miss = \"end\"", "on.hit = \"shade\", on.miss = \"relay\"")
        + "relay = { entry = \"trace_walk\", with.walk = \"eye\", on.hit = \"shade\", on.miss = \"end\" }\n";
    let set = [("schedule.fuse", r#"[["trace", "shade"]]"#), ("schedule.batch", "[]")];
    let result = crate::generate(&sources(&pipeline, LAYOUT, STAGES), &selection(&set));
    let parts = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    let plan = parts.plan;
    assert_eq!(kernel(&plan, "trace").stages, ["trace", "shade"]);
    assert_eq!(kernel(&plan, "shade").stages, ["shade", "trace"]);
    assert_eq!(kernel(&plan, "relay").stages, ["relay"]);
    for (name, begun) in [("trace", "NEXT_TRACE"), ("shade", "NEXT_SHADE")] {
        let module = &kernel(&plan, name).module;
        let head = format!(
            "next = {begun};\n        for (var round = rounds_begun(); next != NEXT_END && next != NEXT_RELAY;"
        );
        assert!(module.contains(&head), "{module}");
        assert!(module.contains("enqueue(QUEUE_RELAY, next == NEXT_RELAY"), "{module}");
    }
    let loads_hit = |name: &str| {
        let kernel = parts.report.kernels.iter().find(|kernel| kernel.name == name).unwrap();
        kernel.loads.contains(&"eye.hit.t".to_owned())
    };
    assert!(loads_hit("shade") && !loads_hit("trace"), "who begins with `trace` finds the hit by itself");
    let Some(Step::Loop { rounds: 5, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(names(&plan, body), ["prepare_trace", "trace", "shade", "prepare_relay", "relay"]);
}

#[test]
fn walks_are_traced_and_scattered_in_one_kernel() {
    let parts = fused("walks");
    assert_eq!(kernel(&parts.plan, "trace").stages, ["trace", "shade"]);
    assert_eq!(kernel(&parts.plan, "emit").stages, ["emit"]);
    let stored: Vec<&str> =
        parts.report.tables.iter().flat_map(|table| &table.fields).map(|field| field.name.as_str()).collect();
    assert!(!stored.contains(&"eye.hit.t") && stored.contains(&"eye.position"), "{stored:?}");
}

#[test]
fn a_slot_whose_path_is_over_takes_the_next() {
    let plan = generated(&[("schedule.regenerate", "4")]).plan;
    assert_eq!(plan.paths_per_slot, 4);
    let Some(Step::Loop { rounds: 20, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(names(&plan, body)[..2], ["prepare_emit", "emit"]);
    let expected = "
    let again = take_next_path(begun && !(outcome == SCATTERED), path_id, lane);
    enqueue(QUEUE_EMIT, again, path_id, lane);
}";
    let shade = &kernel(&plan, "shade").module;
    assert!(shade.contains(expected), "{shade}");
    assert!(shade.contains("pass_info.first_pixel + path_numbers[path_id]"), "{shade}");
    assert!(kernel(&plan, "emit_first").module.contains("path_numbers[index] = index;"));
    assert!(kernel(&plan, "begin").module.contains("select(0u, pass_info.slots, word == CONTROL_TAKEN)"));
    for name in ["emit_first", "emit"] {
        assert!(!kernel(&plan, name).module.contains("take_next_path"), "no path is over in `{name}`");
    }
    let once = generated(&[("schedule.regenerate", "1")]).plan;
    assert_eq!(once.paths_per_slot, 1);
    assert!(once.kernels.iter().all(|kernel| !kernel.module.contains("path_numbers")));
    let longest = generated(&[("schedule.regenerate", "16"), ("max_edges", "300")]).plan;
    assert_eq!(longest.paths_per_slot, 3, "a pass has 1,000 rounds at most");
}

#[test]
fn what_cannot_be_fused_is_refused() {
    let code = |fuse: &str| {
        let result = crate::generate(&sources(PIPELINE, LAYOUT, STAGES), &selection(&[("schedule.fuse", fuse)]));
        let refusal = result.expect_err(fuse);
        let text = refusal.render(false);
        assert!(refusal.diagnostics.iter().all(|finding| !finding.help.is_empty()), "{text}");
        refusal.diagnostics[0].code
    };
    assert_eq!(code("everything"), "K0107");
    assert_eq!(code(r#"["trace", "shade"]"#), "K0106");
    assert_eq!(code(r#"[["trace", "shda"]]"#), "K0202");
    assert_eq!(code(r#"[["trace", "shade"], ["shade", "emit"]]"#), "K0225");
    assert_eq!(code("all"), "K0226", "the stream is batched");
    let set = [("schedule.fuse", "all"), ("schedule.batch", "[]"), ("schedule.regenerate", "2")];
    let refusal = crate::generate(&sources(PIPELINE, LAYOUT, STAGES), &selection(&set)).expect_err("its own queue");
    assert_eq!(refusal.diagnostics[0].code, "K0227");
}

#[test]
fn a_start_stage_that_is_routed_to_has_two_kernels() {
    let pipeline = PIPELINE.replace("on.scattered = \"trace\"", "on.scattered = \"emit\"");
    let result = crate::generate(&sources(&pipeline, LAYOUT, STAGES), &selection(&[]));
    let plan = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan;
    assert!(kernel(&plan, "emit_first").module.contains("index < pass_info.slots"));
    assert!(kernel(&plan, "emit").module.contains("index < running(QUEUE_EMIT)"));
    assert!(kernel(&plan, "prepare_emit").module.contains("CONTROL_ROUND"));
}

#[test]
fn an_inline_stream_has_no_buffer() {
    let plan = generated(&[("schedule.batch", "[]")]).plan;
    assert!(plan.buffers.iter().all(|buffer| buffer.role != Role::Stream));
    assert!(kernel(&plan, "shade").module.contains("resolve(&connection)"));
    assert!(plan.kernels.iter().all(|kernel| kernel.name != "resolve_connection"));
}

#[test]
fn a_batched_stream_keeps_what_its_consumer_reads() {
    let plan = generated(&[]).plan;
    let stream = plan.buffers.iter().find(|buffer| buffer.role == Role::Stream).unwrap();
    // `origin` is read as a whole, `contribution` too, `pixel` is one word: 7 words, four records a path.
    assert_eq!(stream.size.per_path, 112);
}

#[test]
fn scene_resources_come_last_and_once() {
    let plan = generated(&[]).plan;
    let resources: Vec<&str> =
        plan.buffers.iter().filter(|buffer| buffer.role == Role::Resource).map(|buffer| buffer.name.as_str()).collect();
    assert_eq!(resources, ["spheres"]);
}

#[test]
fn explain_names_places() {
    let report = generated(&[]).report;
    let text = report.field("eye.hit").unwrap();
    assert!(text.contains("written by trace (stages/wgsl/stage/small.wgsl:"), "{text}");
    assert!(text.contains("read by shade (stages/wgsl/stage/small.wgsl:"), "{text}");
    assert!(report.field("eye.scratch").unwrap().contains("dead:"));
    assert!(report.field("eye.nothing").is_none());
    assert!(report.text().contains("table state"));
}

#[test]
fn wiring_errors_name_both_sides() {
    let text = refused("K0203", ", on.absorbed = \"end\"", "");
    assert!(text.contains("returned here") && text.contains("no `on.absorbed`"), "{text}");
    refused("K0206", "with.walk = \"eye\", ", "");
    refused("K0207", "with.walk = \"eye\"", "with.walk = \"path\"");
    let text = refused("K0208", "entry = \"trace_walk\"", "entry = \"trace_wlak\"");
    assert!(text.contains("did you mean `trace_walk`?"), "{text}");
    refused("K0209", "on.scattered = \"trace\"", "on.scattered = \"shade\"");
    refused("K0210", "    path.length = 0u;\n", "");
    refused("K0211", "splat(connection.pixel,", "splat(path_pixel(),");
    refused("K0212", "    splat(connection.pixel, ", "    push_connection(*connection); splat(connection.pixel, ");
    refused(
        "K0215",
        "fn resolve(connection: ptr<function, Connection>) {",
        "fn resolve(connection: ptr<function, Connection>) -> u32 { return 0u; }\nfn other(connection: ptr<function, Connection>) {",
    );
    refused(
        "K0217",
        "    push_connection(connection);",
        "    for (var i = 0u; i < path.length; i += 1u) { push_connection(connection); }",
    );
}

#[test]
fn an_outcome_that_no_stage_routes_is_not_a_missing_name() {
    let stages = STAGES.replace("ABSORBED", "LOST");
    let refusal = refusal(PIPELINE, LAYOUT, &stages);
    assert!(refusal.diagnostics.iter().any(|finding| finding.code == "K0203"), "{}", refusal.render(false));
}

#[test]
fn routes_that_are_never_taken_are_warnings() {
    let pipeline = PIPELINE.replace("on.emitted = \"trace\"", "on.emitted = \"trace\", on.failed = \"end\"");
    let result = crate::generate(&sources(&pipeline, LAYOUT, STAGES), &selection(&[]));
    let warnings = result.map_err(|refusal| refusal.render(false)).unwrap().warnings;
    assert!(warnings.iter().any(|warning| warning.code == "K0204"), "{warnings:?}");
}

#[test]
fn an_explicit_placement_is_followed() {
    let place = r#"
place = [
  ["eye.position", "eye.hit.t"],
  ["eye.direction", "eye.pdf_w"],
  ["eye.throughput", ["path.sample:19", "_:6", "path.length:5", "path.flags:2"]],
]
"#;
    let layout = format!("{LAYOUT}{place}");
    let result = crate::generate(&sources(PIPELINE, &layout, STAGES), &selection(&[]));
    let parts = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    assert_eq!(parts.plan.bytes_per_path, 48);
    let shade = &kernel(&parts.plan, "shade").module;
    assert!(shade.contains("path.length = extractBits(state_2.w, 25u, 5u);"), "{shade}");
}

/// The pipeline with tallies, and stages that count and read.
fn with_tallies(declared: &str, used: &str) -> Result<Generated, Refusal> {
    let pipeline = format!("{PIPELINE}\n[tallies]\n{declared}\n");
    let imports = "import package::tallies::{count_bounces, bounces_rate, bounces_rate_sum};\n";
    let stages = format!("{imports}{}", STAGES.replace("    eye.throughput *= 0.5;\n", used));
    crate::generate(&sources(&pipeline, LAYOUT, &stages), &selection(&[]))
}

const TALLIES: &str = "other = { size = \"3\" }\nbounces = { size = \"max_edges + 1\", doc = \"Bounces.\" }";

#[test]
fn tallies_have_their_parts_of_two_buffers() {
    let used = "    count_bounces(path.length);\n    eye.throughput *= bounces_rate(0u) + bounces_rate_sum(2u);\n";
    let plan = with_tallies(TALLIES, used).unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan;
    let parts: Vec<_> = plan.tallies.iter().map(|tally| (tally.name.as_str(), tally.first, tally.size)).collect();
    assert_eq!(parts, [("other", 0, 3), ("bounces", 3, 6)]);
    for (role, access) in [(Role::TallyCounts, Access::ReadWrite), (Role::TallyRates, Access::Read)] {
        let index = plan.buffers.iter().position(|buffer| buffer.role == role).unwrap();
        assert_eq!(plan.buffers[index].size.fixed, if role == Role::TallyRates { 72 } else { 36 });
        let binding = kernel(&plan, "shade").bindings.iter().find(|binding| binding.buffer == index).unwrap();
        assert_eq!(binding.access, access);
        let elsewhere = plan.kernels.iter().filter(|kernel| kernel.name != "shade").flat_map(|kernel| &kernel.bindings);
        assert!(elsewhere.into_iter().all(|binding| binding.buffer != index));
    }
    let shade = &kernel(&plan, "shade").module;
    assert!(shade.contains("/// Counts at an index of `bounces`: Bounces."), "{shade}");
    assert!(shade.contains("return tally_rates[9u + 3u + min(index, 5u)];"), "{shade}");
    assert!(shade.contains("atomicAdd(&tally_share[3u + min(index, 5u)], 1u);"), "{shade}");
    // Whoever counts adds up for its workgroup, out of every branch; the others know nothing of it.
    assert!(
        shade.contains(
            "\n    }\n\n    enqueue(QUEUE_TRACE, outcome == SCATTERED, path_id, lane);\n\n    add_tallies(lane);\n}"
        ),
        "{shade}"
    );
    assert!(!kernel(&plan, "trace").module.contains("tally"));
}

#[test]
fn tallies_that_nothing_uses_take_no_space() {
    let plan = with_tallies(TALLIES, "").unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan;
    let unused = |role| plan.buffers.iter().all(|buffer| buffer.role != role);
    assert!(plan.tallies.is_empty() && unused(Role::TallyCounts) && unused(Role::TallyRates));
    let counting = with_tallies(TALLIES, "    count_bounces(0u);\n").unwrap_or_else(|_| panic!("refused")).plan;
    assert!(counting.buffers.iter().all(|buffer| buffer.role != Role::TallyRates) && counting.tallies.len() == 2);
}

#[test]
fn wrong_tallies_are_refused() {
    let code = |declared: &str| {
        let refusal = with_tallies(declared, "    count_bounces(0u);\n").expect_err(declared);
        assert!(refusal.diagnostics.iter().all(|finding| !finding.labels.is_empty() && !finding.help.is_empty()));
        refusal.diagnostics.iter().map(|finding| finding.code).collect::<Vec<_>>()
    };
    assert_eq!(code("bounces = { size = \"max_edge\" }"), ["K0116"]);
    assert_eq!(code("bounces = { size = \"max_edges - 5\" }"), ["K0116"]);
    assert_eq!(code("bounces = { size = \"131073\" }"), ["K0116"]);
    assert_eq!(code("other = { size = \"2048\" }\nbounces = { size = \"1\" }"), ["K0116"]);
    assert_eq!(code("bounces = { doc = \"no size\" }"), ["K0112"]);
    assert_eq!(code("bounces = { size = 3 }"), ["K0106"]);
    assert_eq!(code("bounces = { size = \"3\", span = 3 }"), ["K0102"]);
    assert_eq!(code("ray = { size = \"3\" }"), ["K0115"]);
    assert_eq!(code("a_rate = { size = \"3\" }\ncount_a = { size = \"3\" }"), ["K0115"]);
    assert_eq!(code("splat = { size = \"3\" }"), ["K0114"]);
    assert_eq!(code("bounce = { size = \"3\" }"), ["K0303"]);
}

/// The pipeline with layers and a tally, and a consumer that adds to layers.
fn with_layers(declared: &str, used: &str) -> Result<Generated, Refusal> {
    let pipeline = format!("{PIPELINE}\n[tallies]\nwalks = {{ size = \"max_edges + 1\" }}\n{declared}\n");
    let imports = "import package::film::{splat_implicit, splat_strategies};\n";
    let splat = "    splat(connection.pixel,";
    let stages = format!("{imports}{}", STAGES.replace(splat, &format!("{used}{splat}")));
    crate::generate(&sources(&pipeline, LAYOUT, &stages), &selection(&[]))
}

const LAYERS: &str = "[layers]\nstrategies = { size = \"2 * max_edges\" }\n\
                      implicit = { size = \"max_edges + 1\", correct = \"walks\" }";

fn layers(used: &str) -> Plan {
    with_layers(LAYERS, used).unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan
}

#[test]
fn layers_are_planes_behind_the_picture() {
    let plan = layers("    splat_implicit(1u, connection.pixel, vec3r(1.0)); splat_strategies(0u, 0u, vec3r(1.0));\n");
    let [strategies, implicit] = plan.layers.as_slice() else { panic!("{:?}", plan.layers) };
    assert_eq!((strategies.name.as_str(), strategies.first, strategies.size), ("strategies", 1, 10));
    assert_eq!((implicit.name.as_str(), implicit.first, implicit.size), ("implicit", 11, 6));
    assert_eq!((strategies.correct, implicit.correct), (None, Some(0)));
    assert_eq!(plan.tallies.len(), 1, "the runtime needs the tally that corrects, whether it is counted or not");
    let film = plan.buffers.iter().find(|buffer| buffer.role == Role::Film).unwrap();
    assert_eq!((plan.planes(), film.size.per_pixel), (17, 17 * 12));
    let consumer = &kernel(&plan, "resolve_connection").module;
    assert!(consumer.contains("let plane = 11u + min(index, 5u);"), "{consumer}");
}

#[test]
fn layers_that_nothing_adds_to_take_no_space() {
    let plan = layers("    splat_implicit(1u, connection.pixel, vec3r(1.0));\n");
    assert_eq!(
        plan.layers.iter().map(|group| (group.name.as_str(), group.first)).collect::<Vec<_>>(),
        [("implicit", 1)]
    );
    let plan = layers("");
    let film = plan.buffers.iter().find(|buffer| buffer.role == Role::Film).unwrap();
    assert!(plan.layers.is_empty() && plan.tallies.is_empty() && film.size.per_pixel == 12);
}

#[test]
fn wrong_layers_are_refused() {
    let code = |declared: &str| {
        let refusal = with_layers(declared, "    splat_implicit(0u, 0u, vec3r(1.0));\n").expect_err(declared);
        assert!(refusal.diagnostics.iter().all(|finding| !finding.labels.is_empty() && !finding.help.is_empty()));
        refusal.diagnostics.iter().map(|finding| finding.code).collect::<Vec<_>>()
    };
    assert_eq!(code("[layers]\nimplicit = { size = \"max_edge\" }"), ["K0116"]);
    assert_eq!(code("[layers]\nimplicit = { size = \"3\", correct = \"walk\" }"), ["K0223"]);
    assert_eq!(code("[layers]\nimplicit = { size = \"3\", correct = \"walks\" }"), ["K0224"]);
    assert_eq!(code("[layers]\nimplicit = { size = \"3\", correct = 1 }"), ["K0106"]);
    assert_eq!(code("[layers]\nimplicit = { size = \"3\", over = \"walks\" }"), ["K0102"]);
    assert_eq!(code("[layers]\nimplicit = { correct = \"walks\" }"), ["K0112"]);
    assert_eq!(code("[layers]\nim-plicit = { size = \"3\" }"), ["K0114"]);
    assert_eq!(code("[layers]\na = { size = \"3\" }\n[records.splat_a]\nx = \"index\""), ["K0115"]);
}
