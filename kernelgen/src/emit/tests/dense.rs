//! Loops whose paths stand side by side.

use super::schedules::{inner_loop_pipeline, with_an_inner_loop};
use super::{LAYOUT, STAGES, kernel, selection, sources};
use crate::plan::Plan;

const DENSE: (&str, &str) = ("schedule.order", "dense");

/// Bytes a path slot of a buffer.
fn per_path(plan: &Plan, buffer: &str) -> u64 {
    plan.buffers.iter().find(|own| own.name == buffer).expect("a buffer of this name").size.per_path
}

#[test]
fn paths_go_on_where_they_stand_in_the_queue() {
    let plan = with_an_inner_loop(&[DENSE]);
    let moves = "walk_place = next_walk_places() + place_of(QUEUE_TRACE, ranks[0], lane);\n        \
                 walk_slots[walk_place] = path_id;\n";
    let found = "path_id = walk_slots[walk_place];\n";
    for (name, place) in [("trace", "walk_places() + index"), ("shade", "queue[QUEUE_SHADE * path_count + index]")] {
        let text = &kernel(&plan, name).module;
        assert!(text.contains(&format!("walk_place = {place};\n        {found}")), "{text}");
    }
    for name in ["emit", "shade"] {
        let kernel = kernel(&plan, name);
        let (_, behind) = kernel.module.split_once(moves).unwrap_or_else(|| panic!("{}", kernel.module));
        assert!(behind.contains("state[state_address(") && !kernel.module.contains("enqueue(QUEUE_TRACE"));
        assert!(kernel.moved_bytes > 0 && kernel.store_bytes == 0, "{name}: all of it lives in the loop alone");
    }
    let trace = kernel(&plan, "trace");
    assert!(
        trace.moved_bytes == 0
            && trace.store_bytes > 0
            && trace.module.contains("enqueue(QUEUE_SHADE, outcome == HIT, walk_place")
    );
    assert!(trace.module.contains("wait_for(QUEUE_EMIT, outcome == MISS, path_id)"), "out of the loop by slot");
    let turns = |name: &str| kernel(&plan, name).module.contains("    turn_walk_places();\n");
    assert!(turns("prepare_trace") && !turns("prepare_shade") && !turns("prepare_emit"));
    assert_eq!(per_path(&plan, "state"), 2 * u64::from(plan.bytes_per_path), "places of two turns");
    assert_eq!(plan.dense, Some(1), "behind `emit`");
}

/// Where no path ends in the kernel that a pass starts with, nothing has to be counted.
#[test]
fn paths_of_all_slots_stand_as_their_slots_do() {
    let first = |stages: &str| {
        let result = crate::generate(&sources(&inner_loop_pipeline(), LAYOUT, stages), &selection(&[DENSE]));
        let plan = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan;
        kernel(&plan, "emit_first").module.clone()
    };
    let all = first(STAGES);
    let stands = "all_stand(QUEUE_TRACE, index);\n    if outcome == EMITTED {\n        \
                  walk_place = next_walk_places() + index;\n        walk_slots[walk_place] = path_id;\n";
    assert!(all.contains(stands) && !all.contains("take_places") && !all.contains("place_of"), "{all}");
    let may_end = "if path.sample > 3u {\n        return END;\n    }\n    return EMITTED;";
    let ends = STAGES.replace("return EMITTED;", may_end).replace("outcome::{", "outcome::{END, ");
    let some = first(&ends);
    assert!(some.contains("place_of(QUEUE_TRACE, ranks[0], lane)") && !some.contains("all_stand"), "{some}");
}

/// `shade` does not touch the density that `emit` wrote: it takes it along.
#[test]
fn what_lives_on_untouched_is_taken_along() {
    for (order, lane) in [("aos", "4"), ("soa", "1"), ("aosoa32", "2")] {
        let plan = with_an_inner_loop(&[DENSE, ("layout.order", order), ("layout.lane", lane)]);
        let moved = |name: &str| kernel(&plan, name).moved_bytes;
        assert!(moved("shade") == moved("emit") && moved("emit") == moved("emit_first"), "{order}, {lane}");
    }
}

/// A stage behind the loop that begins another eye walk of the same path.
const AGAIN: &str = r"
import package::outcome::DONE;

fn again(path: ptr<function, Path>, eye: ptr<function, Walk>) -> u32 {
    path.length += 1u;
    eye.position = vec3r(0.0);
    eye.direction = vec3r(0.0, 0.0, 1.0);
    eye.throughput = vec3r(1.0);
    eye.pdf_w = 1.0;
    return DONE;
}
";

/// The path counts on from walk to walk, so its table stays; the walk's own moves.
#[test]
fn what_is_needed_behind_the_loop_stays_in_its_slot() {
    let stage = "again = { on.done = \"trace\" }\ntrace = {";
    let pipeline =
        inner_loop_pipeline().replace("on.miss = \"emit\"", "on.miss = \"again\"").replace("trace = {", stage);
    let set = [DENSE, ("layout.tables", r#"{ path = ["path"], eye = ["eye"] }"#)];
    let result = crate::generate(&sources(&pipeline, LAYOUT, &format!("{STAGES}{AGAIN}")), &selection(&set));
    let generated = result.unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    let tables = &generated.report.tables;
    let bytes = |name: &str| tables.iter().find(|table| table.name == name).expect("a table of this name").bytes;
    assert_eq!(per_path(&generated.plan, "path_state"), u64::from(bytes("path")));
    assert_eq!(per_path(&generated.plan, "eye_state"), 2 * u64::from(bytes("eye")));
    let shade = kernel(&generated.plan, "shade");
    assert!(shade.store_bytes > 0 && shade.moved_bytes > 0, "{shade:?}");
}

#[test]
fn paths_keep_their_slots_where_turns_are_not_in_step() {
    for set in [
        ("schedule.loops", "flat"),
        ("schedule.queue", "none"),
        ("schedule.regenerate", "2"),
        ("schedule.order", "packed"),
    ] {
        let plan = with_an_inner_loop(&[DENSE, set]);
        assert_eq!(plan.dense, None, "{set:?}");
        assert!(plan.kernels.iter().all(|kernel| !kernel.module.contains("walk_slots") && kernel.moved_bytes == 0));
    }
}
