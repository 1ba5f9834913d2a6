//! How much room a batched stream has and in what order paths wait never change the image: bit for bit with the fixed-point film.

use kernelgen::source::FileKind;
use runtime::configs::{Axis, Library};
use tests::rendering::{Job, Rendering, shipped};

/// One pass over all 2,048 slots, with paths so long that a stream with room for one record a slot must be emptied on the way.
fn job(pipeline: &str) -> Job {
    Job::of_file(shipped("cornell_box")).pipeline(pipeline).size(64, 32).samples(1).edges(8).fixed_point()
}

/// Both were rendered without overflow, which fails a render.
#[track_caller]
fn assert_same(rendering: &Rendering, expected: &Rendering, what: &str) {
    assert!(rendering.sums == expected.sums, "{what}: another image");
    assert_eq!(rendering.visibility, expected.visibility, "{what}: visibility rays");
    assert_eq!(rendering.rays, expected.rays, "{what}: rays");
    assert_eq!(rendering.rejected, 0, "{what}");
}

/// A tiny stream cuts the work into passes of few slots, a small one is emptied on the way, a large one after the last round.
#[test]
fn every_capacity_gives_the_bits_of_inline_visibility() {
    for pipeline in ["pt", "lt"] {
        let expected = job(pipeline).schedule("inline").render();
        assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
        assert!(expected.visibility > 2048, "{pipeline}: {} records fit into any stream", expected.visibility);
        for capacity in ["0.02", "0.25", "1", "1.5", "2", "4", "14"] {
            let rendering = job(pipeline).set("schedule.capacity", capacity).render();
            assert_same(&rendering, &expected, &format!("{pipeline}, capacity {capacity}"));
        }
    }
}

/// Atomic queues order their records otherwise than subgroups do, and the capacity may come from either schedule.
#[test]
fn capacity_and_queue_kind_do_not_meet() {
    let expected = job("pt").schedule("inline").render();
    let atomic = job("pt").set("schedule.queue", "atomic").set("schedule.capacity", "1").render();
    assert_same(&atomic, &expected, "atomic queues");
    let batched = job("pt").schedule("inline").set("schedule.batch", "connection").render();
    assert_same(&batched, &expected, "inline with a batched stream");
}

/// Paths wait as they came or in the order of their slots, and whoever appends them does.
#[test]
fn every_order_of_queues_gives_the_same_bits() {
    for pipeline in ["pt", "sbdpt", "sbdpt_seed", "sbdpt_pairs"] {
        let expected = job(pipeline).render();
        assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
        let arrival = [("workgroup", "arrival")];
        let kinds = ["workgroup", "subgroup", "atomic"];
        let sorted = kinds.into_iter().flat_map(|queue| [(queue, "slot"), (queue, "packed"), (queue, "dense")]);
        for (queue, order) in arrival.into_iter().chain(sorted) {
            let rendering = job(pipeline).set("schedule.queue", queue).set("schedule.order", order).render();
            assert_same(&rendering, &expected, &format!("{pipeline}, {queue}, {order}"));
            assert_eq!(rendering.tallies, expected.tallies, "{pipeline}, {queue}, {order}: tallies");
        }
    }
}

/// Two turns a round are too few for most eye walks: some wait for the next round, in slots between those of paths that might close up.
/// As long as they do, all paths keep their slots.
#[test]
fn paths_close_up_only_where_all_meet() {
    let declared = r#"turns = "max_edges - round", rounds = "max_edges" }"#;
    let text = Axis::Pipeline.shipped("sbdpt").expect("it is shipped");
    assert!(text.contains(declared), "the declaration has changed");
    let text = text.replace(declared, r#"turns = "2", rounds = "max_edges * max_edges" }"#);
    let mut library = Library::default();
    library.sources.add(FileKind::Config, "pipelines/hurried.toml", "hurried.toml", text);
    let expected = job("sbdpt").layout("compact").render();
    let hurried = job("hurried").library(library).layout("compact").schedule("ordered").render();
    assert!(expected.sums.iter().any(|&sum| sum != 0), "a black image proves nothing");
    assert!(hurried.sums == expected.sums, "a path was written over");
}

/// Where a workgroup gathers records, an invocation keeps its last one for it; what a stage pushed before that must not be lost.
#[test]
fn records_that_a_stage_pushes_in_a_row_all_arrive() {
    let once = "push_connection(connection_of(walk, surface, segment, contribution, pixel));";
    let thrice = format!(
        "{once}\n        push_connection(connection_of(walk, surface, segment, 0.25 * contribution, pixel));\n        {once}"
    );
    let job = |schedule: &str| job("pt").edited("transport/direct", once, &thrice).schedule(schedule);
    let expected = job("inline").render();
    let once = self::job("pt").schedule("inline").render();
    assert_eq!(expected.visibility, 3 * once.visibility, "every push is a ray");
    for capacity in ["3", "13"] {
        let rendering = job("ordered").set("schedule.capacity", capacity).render();
        assert_same(&rendering, &expected, &format!("gathered, capacity {capacity}"));
    }
}

#[test]
fn a_capacity_that_holds_nothing_is_refused() {
    for (capacity, code) in [("0", "K0107"), ("-2", "K0107"), ("many", "K0106"), ("0.0001", "K0222")] {
        let refusal = job("pt").set("schedule.capacity", capacity).check().expect_err("refused");
        assert!(refusal.contains(code), "capacity {capacity}: {refusal}");
    }
}
