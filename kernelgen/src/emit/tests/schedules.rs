//! Kernels of several stages, queues of all kinds, and the loops around them.

use super::*;

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
        assert!(kernel(&plan, feeder).module.contains("wait_for(QUEUE_TRACE, outcome == "), "{feeder}");
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

/// The texts of all kernels.
fn modules(plan: &Plan) -> Vec<&str> {
    plan.kernels.iter().map(|kernel| kernel.module.as_str()).collect()
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
    let constant = with_keys(&[("schedule.sort", "prim")], "return 7u;")
        .unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    assert_eq!(modules(&constant.plan), modules(&sorted(&[]).plan), "a key that is the same for all paths");
    let plan = sorted(&[("schedule.sort", "pole"), fused, inline]).plan;
    assert_eq!(
        kernel(&plan, "count_keys_trace").load_bytes,
        16,
        "the entry of a fused kernel: the lane of `direction`"
    );
}

/// A schedule may name keys that a pipeline knows and none of its stages has.
#[test]
fn keys_of_the_pipeline_need_no_stage() {
    let generate = |keys: &str| {
        let pipeline = PIPELINE.replacen("start", &format!("{keys}start"), 1);
        crate::generate(&sources(&pipeline, LAYOUT, STAGES), &selection(&[("schedule.sort", "prim")]))
    };
    let known = generate("keys = [\"prim\"]\n").unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    assert_eq!(modules(&known.plan), modules(&generated(&[]).plan));
    let text = generate("").expect_err("no such key").render(false);
    assert!(text.contains("K0228"), "{text}");
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
    let Some(Step::Loop { turns, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(turns, &[1]);
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
    let Some(Step::Loop { turns, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(turns, &[5]);
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

/// `bounded` batches what it can: nothing bounds what `trace` and `shade` push when they go round in one kernel.
#[test]
fn streams_are_batched_where_their_records_are_bounded() {
    let has_stream = |set: &[(&str, &str)]| {
        let plan = generated(&[&[("schedule.batch", "bounded")], set].concat()).plan;
        plan.buffers.iter().any(|buffer| buffer.role == Role::Stream)
    };
    assert!(has_stream(&[]));
    assert!(!has_stream(&[("schedule.fuse", "walks")]));
}

/// One atomic a workgroup and queue, for paths and records alike.
#[test]
fn a_workgroup_takes_places_in_all_queues_at_once() {
    let plan = generated(&[("schedule.queue", "workgroup")]).plan;
    let shade = &kernel(&plan, "shade").module;
    let expected = "
    let ranks = array<u32, 2>(ask_place(QUEUE_TRACE, outcome == SCATTERED, lane), \
        ask_place(STREAM_CONNECTION, connection_arrives(), lane));
    take_places(lane);
    stand(QUEUE_TRACE, outcome == SCATTERED, path_id, ranks[0], lane);
    gather_connection(ranks[1], lane);
}";
    assert!(shade.contains(expected), "{shade}");
    assert!(!shade.contains("fn append("), "no stage pushes twice here");
}

#[test]
fn a_slot_whose_path_is_over_takes_the_next() {
    let plan = generated(&[("schedule.regenerate", "4")]).plan;
    assert_eq!(plan.paths_per_slot, 4);
    let Some(Step::Loop { turns, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(turns, &[20]);
    assert_eq!(names(&plan, body)[..2], ["prepare_emit", "emit"]);
    let expected = "
    let again = take_next_path(begun && !(outcome == SCATTERED), path_id, lane);
    enqueue(QUEUE_TRACE, outcome == SCATTERED, path_id, lane);
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

/// `trace` and `shade` lead to one another, and a walk that ends starts over at `emit`.
pub(super) fn with_an_inner_loop(set: &[(&str, &str)]) -> Plan {
    let result = crate::generate(&sources(&inner_loop_pipeline(), LAYOUT, STAGES), &selection(set));
    result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan
}

/// The pipeline of that plan.
pub(super) fn inner_loop_pipeline() -> String {
    let loops = "rounds = \"4 * max_edges\"\n\
        inner = { stage = \"trace\", turns = \"max_edges - round\", rounds = \"max_edges - 1\" }\n";
    PIPELINE.replace("rounds = \"max_edges\"\n", loops).replace("on.miss = \"end\"", "on.miss = \"emit\"")
}

#[test]
fn an_inner_loop_turns_inside_the_rounds() {
    let plan = with_an_inner_loop(&[]);
    let Some(Step::Loop { turns, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(turns, &[4]);
    let [prepare, emit, Step::Loop { turns, body }] = body.as_slice() else { panic!("{body:?}") };
    assert_eq!(names(&plan, [prepare, emit]), ["prepare_emit", "emit"]);
    assert_eq!(turns, &[5, 4, 3, 2]);
    assert_eq!(names(&plan, body), ["prepare_trace", "trace", "prepare_shade", "resolve_connection", "shade"]);
    let counts = |name: &str| kernel(&plan, name).module.contains("atomicAdd(&control[CONTROL_ROUND], 1u);");
    assert!(counts("prepare_trace") && !counts("prepare_emit") && !counts("prepare_shade"));
}

#[test]
fn a_flat_schedule_runs_every_kernel_once_a_round() {
    for set in [("schedule.loops", "flat"), ("schedule.regenerate", "2")] {
        let plan = with_an_inner_loop(&[set]);
        let Some(Step::Loop { turns, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
        assert_eq!(turns, &[20 * plan.paths_per_slot]);
        assert!(body.iter().all(|step| !matches!(step, Step::Loop { .. })), "{body:?}");
    }
}

#[test]
fn a_loop_inside_a_kernel_leaves_the_rounds_around_it() {
    let set = [("schedule.fuse", r#"[["trace", "shade"]]"#), ("schedule.batch", "[]")];
    let plan = with_an_inner_loop(&set);
    let Some(Step::Loop { turns, body }) = plan.program.get(2) else { panic!("{:?}", plan.program) };
    assert_eq!(turns, &[4]);
    assert_eq!(names(&plan, body), ["prepare_emit", "emit", "prepare_trace", "trace"]);
    assert!(
        kernel(&plan, "trace").module.contains("const ROUNDS: u32 = 20u;"),
        "it may turn as often as all rounds could"
    );
}

/// What comes into the loop is gone after its first turn, so its first kernel gets paths from one dispatch at a time; `emit` gets them
/// from every turn.
#[test]
fn paths_that_leave_an_inner_loop_are_put_in_order() {
    let plan = with_an_inner_loop(&[("schedule.order", "slot")]);
    let ordered = |stage: &str| plan.kernels.iter().any(|kernel| kernel.name == format!("order_{stage}"));
    assert!(ordered("emit") && !ordered("trace") && !ordered("shade"));
    let flat = with_an_inner_loop(&[("schedule.order", "slot"), ("schedule.loops", "flat")]);
    let ordered = |stage: &str| flat.kernels.iter().any(|kernel| kernel.name == format!("order_{stage}"));
    assert!(!ordered("emit") && ordered("trace"));
}

/// `emit` loads what lives on though it does not use it, waits for its workgroup, and stores in the slot it is given.
#[test]
fn paths_that_meet_behind_an_inner_loop_move_side_by_side() {
    let plan = with_an_inner_loop(&[("schedule.order", "packed")]);
    let emit = &kernel(&plan, "emit").module;
    let (before, after) = emit.split_once("    storageBarrier();\n").expect("waits");
    assert!(before.contains("carried_number = path_numbers[path_id];"), "{emit}");
    assert!(
        after.contains(
            "path_id = packed_slot(QUEUE_EMIT, index, lane);\n        path_numbers[path_id] = carried_number;"
        )
    );
    assert!(kernel(&plan, "emit_first").module.contains("path_numbers[index] = index;"));
    assert!(kernel(&plan, "prepare_emit").module.contains("    note_whether_all_wait(QUEUE_EMIT);\n    "));
    for name in ["trace", "shade"] {
        assert!(!kernel(&plan, name).module.contains("packed_slot"), "{name} is inside the loop");
    }
    for set in [("schedule.loops", "flat"), ("schedule.queue", "none"), ("schedule.order", "slot")] {
        let plan = with_an_inner_loop(&[("schedule.order", "packed"), set]);
        assert!(plan.kernels.iter().all(|kernel| !kernel.module.contains("path_numbers")), "{set:?}");
    }
}

#[test]
fn wrong_inner_loops_are_refused() {
    let code = |inner: &str| {
        let pipeline =
            PIPELINE.replace("rounds = \"max_edges\"\n", &format!("rounds = \"max_edges\"\ninner = {inner}\n"));
        refusal(&pipeline, LAYOUT, STAGES).diagnostics[0].code
    };
    assert_eq!(
        code(r#"{ stage = "trace", turns = "max_edges - round", rounds = "max_edges + 1" }"#),
        "K0116",
        "0 turns"
    );
    assert_eq!(code(r#"{ stage = "trace", turns = "1", rounds = "round" }"#), "K0116");
    assert_eq!(code(r#"{ stage = "trace", turns = "1000", rounds = "11" }"#), "K0116", "11,000 turns");
    assert_eq!(code(r#"{ stage = "traces", turns = "1", rounds = "1" }"#), "K0202");
    assert_eq!(code(r#"{ stage = "trace", turns = "1" }"#), "K0112");
    assert_eq!(code("3"), "K0106");
}
