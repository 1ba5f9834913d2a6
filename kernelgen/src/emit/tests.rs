//! Whole generations of a small pipeline.

use crate::config::model::{Effect, Selection};
use crate::plan::{Access, Plan, Role, Step};
use crate::source::{FileKind, Sources};
use crate::{Generated, Refusal};

mod copies;
mod dense;
mod schedules;

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
        Step::Dispatch { kernel, .. } | Step::Single { kernel } | Step::Indirect { kernel, .. } => *kernel,
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
fn rays_apart_have_lanes_of_their_own_size() {
    let lanes = |set: &[(&str, &str)]| -> Vec<(String, u32)> {
        let apart = [&[("layout.lane", "4"), ("layout.rays", "apart")], set].concat();
        generated(&apart).report.tables.iter().map(|table| (table.name.clone(), table.lane)).collect()
    };
    assert_eq!(lanes(&[]), [("state".to_owned(), 4), ("ray".to_owned(), 4)]);
    assert_eq!(lanes(&[("layout.ray_lane", "1")]), [("state".to_owned(), 4), ("ray".to_owned(), 1)]);
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
    let [begin, first, Step::Loop { turns, body }, after @ ..] = plan.program.as_slice() else {
        panic!("{:?}", plan.program)
    };
    assert_eq!(turns, &[5]);
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

/// Before `relay` runs, only what waits for it counts: what it leads to has a moment of its own at which the stream may be emptied. Of
/// two stages behind one such moment a path runs one.
#[test]
fn the_bound_of_a_group_is_what_waits_for_it() {
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
    for (prepare, bound) in
        [("prepare_relay", "waiting(QUEUE_RELAY)"), ("prepare_dim", "waiting(QUEUE_DIM) + waiting(QUEUE_SHADE)")]
    {
        let text = &kernel(&plan, prepare).module;
        let call = format!("start_full_queue(STREAM_CONNECTION, connection_room(), {bound})");
        assert!(text.contains(&call), "{text}");
    }
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
