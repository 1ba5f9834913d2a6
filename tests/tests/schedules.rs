//! How stages become kernels never changes the image: bit for bit with the fixed-point film, and every ray is counted once.

use runtime::configs::Axis;
use tests::rendering::{Job, Rendering, shipped};

/// A picture that does not fill its tiles, of paths long enough to go round and round. The smallest pipeline has a scene with every
/// kind of light, the others one that gives small kernels.
fn job(pipeline: &str) -> Job {
    let scene = if pipeline == "nee" { "light_kinds" } else { "cornell_box" };
    Job::of_file(shipped(scene)).pipeline(pipeline).size(20, 12).samples(2).edges(6).fixed_point()
}

#[track_caller]
fn assert_same(rendering: &Rendering, expected: &Rendering, what: &str) {
    assert!(rendering.sums == expected.sums, "{what}: another image");
    let rays = |rendering: &Rendering| (rendering.rays, rendering.visibility);
    assert_eq!(rays(rendering), rays(expected), "{what}: all rays, and visibility rays among them");
    assert_eq!(rendering.tallies, expected.tallies, "{what}: tallies");
    assert_eq!(rendering.rejected, 0, "{what}");
}

/// Against `wavefront`, and against a layout that shares nothing with one whose fields share all they can: every shipped schedule but
/// those that `streams` compares.
#[track_caller]
fn every_schedule(pipeline: &str) {
    let expected = job(pipeline).render();
    assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
    assert!(expected.walk_rays.iter().all(|&rays| rays > 0), "{pipeline}: rays of all kinds, not {expected:?}");
    for schedule in Axis::Schedule.names().into_iter().filter(|name| !["wavefront", "inline", "ordered"].contains(name))
    {
        let rendering = job(pipeline).schedule(schedule).layout("compact").render();
        assert_same(&rendering, &expected, &format!("{pipeline}, {schedule}"));
        if !["walks", "regenerating"].contains(&schedule) {
            assert_eq!(rendering.walk_rays, expected.walk_rays, "{pipeline}, {schedule}: rays by kind");
        }
    }
}

#[test]
fn every_schedule_gives_the_same_bits_of_nee() {
    every_schedule("nee");
}

#[test]
fn every_schedule_gives_the_same_bits_of_pt() {
    every_schedule("pt");
}

#[test]
fn every_schedule_gives_the_same_bits_of_lt() {
    every_schedule("lt");
}

#[test]
fn every_schedule_gives_the_same_bits_of_sbdpt() {
    every_schedule("sbdpt");
}

#[test]
fn every_schedule_gives_the_same_bits_of_the_seed() {
    every_schedule("sbdpt_seed");
}

/// Groups by hand: one without a way back, whose streams may be batched, and one that is entered in two places.
#[test]
fn groups_of_stages_give_the_same_bits() {
    let expected = job("sbdpt").render();
    let straight = r#"[["emit_light", "emit_eye", "trace_eye"], ["extend_light", "trace_light", "shade_light"]]"#;
    let crossed = r#"[["shade_eye", "escape_eye", "extend_light", "trace_light"], ["emit_eye", "shade_light"]]"#;
    for (groups, queue, schedule) in [(straight, "workgroup", "ordered"), (crossed, "none", "inline")] {
        let job = job("sbdpt").schedule(schedule).set("schedule.fuse", groups).set("schedule.queue", queue);
        assert_same(&job.render(), &expected, groups);
    }
    let late = job("sbdpt").schedule("walks").set("schedule.load", "use").layout("split_compact").render();
    assert_same(&late, &expected, "fields loaded with the first stage that uses them");
}

/// 1,024 slots take 4,096 paths in one pass, whatever their kernels are, and their streams are emptied in time.
#[test]
fn slots_that_take_further_paths_give_the_same_bits() {
    for (pipeline, schedules) in [("pt", &["regenerating", "walks", "uncompacted"][..]), ("sbdpt", &["regenerating"])] {
        let job = Job::of_file(shipped("cornell_box")).pipeline(pipeline).size(64, 64).samples(1).fixed_point();
        let expected = job.clone().render();
        for schedule in schedules {
            let job = job.clone().schedule(schedule).set("schedule.regenerate", 4).paths(1024);
            assert_same(&job.render(), &expected, &format!("{pipeline}, {schedule}"));
        }
    }
}

/// What would go round for ever is given up and counted: too few rounds fail a render, whoever counts them.
#[test]
fn a_megakernel_gives_up_paths_that_outlive_the_rounds() {
    let cut = |schedule: &str| {
        let job = job("pt").schedule(schedule).set("rounds", "'2'");
        std::panic::catch_unwind(move || job.render()).expect_err("paths are alive after two rounds")
    };
    for schedule in ["wavefront", "walks", "megakernel"] {
        let payload = cut(schedule);
        let message = payload.downcast_ref::<String>().expect("a message");
        assert!(message.contains("paths were still alive after the last round"), "{schedule}: {message}");
    }
}
