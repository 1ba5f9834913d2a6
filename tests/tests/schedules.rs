//! How stages become kernels never changes the image: bit for bit with the fixed-point film, and every ray is counted once.

use kernelgen::plan::Plan;
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
    schedules(pipeline, |_| true);
}

/// As `every_schedule`, for those that `wanted` chooses.
#[track_caller]
fn schedules(pipeline: &str, wanted: impl Fn(&str) -> bool) {
    let expected = job(pipeline).render();
    assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
    assert!(expected.walk_rays.iter().all(|&rays| rays > 0), "{pipeline}: rays of all kinds, not {expected:?}");
    let compared_elsewhere = ["wavefront", "inline", "ordered"];
    let names = Axis::Schedule.names().into_iter().filter(|name| !compared_elsewhere.contains(name));
    for schedule in names.filter(|name| wanted(name)) {
        let rendering = job(pipeline).schedule(schedule).layout("compact").render();
        assert_same(&rendering, &expected, &format!("{pipeline}, {schedule}"));
        // An inner loop counts the turns of all paths, a kernel of several stages those of each.
        let inner_turns = pipeline == "sbdpt" && schedule == "megakernel";
        if !["walks", "regenerating"].contains(&schedule) && !inner_turns {
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
fn unlike_schedules_give_the_same_bits_of_lt() {
    schedules("lt", |name| ["megakernel", "regenerating"].contains(&name));
}

#[test]
fn every_schedule_gives_the_same_bits_of_sbdpt() {
    every_schedule("sbdpt");
}

#[test]
fn unlike_schedules_give_the_same_bits_of_variants() {
    for pipeline in ["sbdpt_seed", "sbdpt_pairs"] {
        schedules(pipeline, |name| ["uncompacted", "walks"].contains(&name));
    }
}

/// Walks of one light vertex end together, or paths are in all phases: nothing else differs.
#[test]
fn flat_rounds_give_the_same_bits() {
    for pipeline in ["sbdpt", "sbdpt_seed", "sbdpt_pairs"] {
        let expected = job(pipeline).render();
        for schedule in ["wavefront", "ordered"] {
            let flat = job(pipeline).schedule(schedule).set("schedule.loops", "flat");
            assert_same(&flat.render(), &expected, &format!("{pipeline}, {schedule}, flat"));
        }
    }
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
    for (pipeline, schedules) in
        [("pt", &["regenerating", "walks", "uncompacted", "sorted_material"][..]), ("sbdpt", &["regenerating"])]
    {
        let job = Job::of_file(shipped("cornell_box")).pipeline(pipeline).size(64, 64).samples(1).fixed_point();
        let expected = job.clone().render();
        for schedule in schedules {
            let job = job.clone().schedule(schedule).set("schedule.regenerate", 4).paths(1024);
            assert_same(&job.render(), &expected, &format!("{pipeline}, {schedule}"));
        }
    }
}

/// Keys are computed of decoded fields, from a table of their own and where paths enter a kernel of several stages.
#[test]
fn queues_sorted_in_any_layout_and_kernel_give_the_same_bits() {
    let job = |sort: &str| {
        let job = job("pt").schedule("wavefront").set("schedule.fuse", r#"[["trace_eye", "escape"]]"#);
        job.set("schedule.sort", sort).layout("split_compact_lossy").set("layout.rays", "apart")
    };
    assert_same(&job(r#"["material", "ray"]"#).render(), &job("none").render(), "both keys");
}

/// Counts as `rejected` how often neighbours of a workgroup shade different materials.
fn count_unlike_neighbours(plan: &mut Plan) {
    let rejected = plan.counters.iter().find(|counter| counter.name == "rejected").expect("the film counts").word;
    let shade = plan.kernels.iter_mut().find(|kernel| kernel.name == "shade").expect("pt shades");
    let call = "outcome = shade_mis(";
    let once = |text: &&str| shade.module.matches(text).count() == 1;
    let end = ["    let ranks = array", "    enqueue(QUEUE_TRACE_EYE,"].into_iter().find(once).expect("paths go on");
    assert!(once(&call), "{}", shade.module);
    let noted = format!("shaded[lane] = load_triangle(eye.hit.prim).material + 1u;\n        {call}");
    let compared = format!(
        "    workgroupBarrier();\n    \
         if lane > 0u && shaded[lane] > 0u && shaded[lane] != shaded[max(lane, 1u) - 1u] {{\n        \
             atomicAdd(&control[{rejected}u], 1u);\n    \
         }}\n{end}"
    );
    let module = shade.module.replacen(call, &noted, 1).replacen(end, &compared, 1);
    shade.module = format!("{module}\nvar<workgroup> shaded: array<u32, {}>;\n", shade.workgroup);
}

/// The box has four materials, so three places in a sorted queue where neighbours differ: in four workgroups together, not in each.
/// Keys depend on nothing that their kernels have not loaded.
#[test]
fn sorted_paths_shade_like_their_neighbours() {
    let rounds = 6;
    let unlike = |schedule: &str| {
        let job = Job::of_file(shipped("cornell_box")).pipeline("pt").size(32, 32).samples(1).edges(rounds);
        job.schedule(schedule).poisoned().probed(count_unlike_neighbours).render().rejected
    };
    let (unsorted, sorted) = (unlike("ordered"), unlike("sorted_material"));
    assert!(sorted > 0, "there are several materials");
    assert!(sorted <= 3 * u64::from(rounds), "{sorted}");
    assert!(unsorted > 10 * sorted, "{unsorted} in the order of slots, {sorted} sorted");
}

/// The schedule for GPUs sorts by material what waits to be shaded where there is solid glass, and no state stays behind; else nothing.
#[test]
fn paths_are_sorted_behind_solid_glass_alone() {
    let kernels = |pipeline: &str, scene: &str, schedule: &str| -> Vec<String> {
        let report =
            Job::of_file(shipped(scene)).pipeline(pipeline).layout("split_compact").schedule(schedule).report();
        report.kernels.into_iter().map(|kernel| kernel.name).collect()
    };
    for (pipeline, scene, sorted) in
        [("pt", "bottle", true), ("pt", "cornell_box", false), ("sbdpt", "bottle", false), ("lt", "bottle", false)]
    {
        let names = kernels(pipeline, scene, "ordered");
        let shade = names.iter().find(|name| name.starts_with("count_keys_"));
        assert_eq!(shade.is_some(), sorted, "{pipeline}, {scene}: {names:?}");
    }
    assert_eq!(kernels("pt", "bottle", "ordered"), kernels("pt", "bottle", "sorted_material"));
}

/// As if a pass had traced almost as many rays as 32 bits hold before it began.
const TRACED_BEFORE: u64 = 0xffff_fff0;

fn begin_with_many_rays(plan: &mut Plan) {
    let word = |name: &str| plan.counters.iter().find(|counter| counter.name == name).expect("rays are counted").word;
    let (primary, visibility) = (word("rays_primary"), word("rays_visibility"));
    let begin = plan.kernels.iter_mut().find(|kernel| kernel.name == "begin").expect("passes begin");
    let (clears, counts) = (
        "atomicStore(&control[word], 0u);",
        format!("select(0u, {TRACED_BEFORE}u, word == {primary}u || word == {visibility}u)"),
    );
    assert!(begin.module.matches(clears).count() == 1, "{}", begin.module);
    begin.module = begin.module.replacen(clears, &format!("atomicStore(&control[word], {counts});"), 1);
}

/// By the kernels between the stages, by fused kernels, and where rays are traced on the spot.
#[test]
fn rays_beyond_32_bits_are_counted() {
    for schedule in ["ordered", "inline", "walks", "megakernel"] {
        let job = job("pt").schedule(schedule).samples(8);
        let rays = |job: &Job| {
            let rendering = job.render();
            [rendering.walk_rays[0], rendering.visibility]
        };
        let few = rays(&job);
        for (many, few) in rays(&job.probed(begin_with_many_rays)).into_iter().zip(few) {
            let more = many - few;
            assert!(more > 0 && more.is_multiple_of(TRACED_BEFORE), "{schedule}: {more} more than {few}");
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
