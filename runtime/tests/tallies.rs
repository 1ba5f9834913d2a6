//! Tallies through the whole runtime: a pipeline of one stage that counts, and whose picture is made of the rates it reads.

mod common;

use common::{SIZE, Small, gpu, rendered, session};
use kernelgen::plan::Plan;
use runtime::counters::Counters;
use runtime::film::Totals;
use runtime::render::Until;
use runtime::tallies::pilot_slots;

const PIPELINE: &str = r#"
doc = "Every path draws a number and counts it twice."
start = "draw"
rounds = "1"

[params]
numbers = { type = "u32", value = 3 }

[tallies]
unused = { size = "7" }
drawn = { size = "numbers + 1", doc = "Numbers that were drawn." }

[records.Path]
number = "index"

[state]
path = "Path"

[stages]
draw = { on.drawn = "show" }
show = { on.done = "end" }
"#;

/// Red, green and blue are the rates of the three numbers.
const STAGES: &str = r#"
import package::film::splat;
import package::outcome::{DRAWN, DONE};
import package::params::numbers;
import package::pass::{pass_seed, path_pixel, path_sample};
import package::real::vec3r;
import package::state::Path;
import package::tallies::{count_drawn, drawn_rate};

/// Draws 0, 1 or 2.
fn draw(path: ptr<function, Path>) -> u32 {
    path.number = hash(hash(path_pixel()) + hash(path_sample()) + pass_seed()) % numbers;
    return DRAWN;
}

/// Counts, and shows what was counted before.
fn show(path: ptr<function, Path>) -> u32 {
    count_drawn(path.number);
    count_drawn(path.number);
    splat(path_pixel(), vec3r(drawn_rate(0u), drawn_rate(1u), drawn_rate(2u)));
    return DONE;
}
"#;

fn plan(order: &'static str, queue: &'static str) -> Plan {
    Small { pipeline: PIPELINE, stages: STAGES, order, queue, accumulate: "fixed_i64" }.plan()
}

#[test]
fn the_picture_depends_on_no_size_of_passes_no_layout_and_no_schedule() {
    let gpu = gpu();
    let expected = rendered(&gpu, &plan("soa", "atomic"), 1024, 11).totals;
    for (order, queue, paths) in [("soa", "atomic", 4096), ("aos", "atomic", 1 << 16), ("soa", "subgroup", 2048)] {
        let totals = rendered(&gpu, &plan(order, queue), paths, 11).totals;
        assert_eq!(totals.sums, expected.sums, "{order} {queue} {paths}");
        assert_eq!(totals.tallied, expected.tallied, "{order} {queue} {paths}");
    }
}

#[test]
fn everything_is_counted_once_and_the_pilot_not_at_all() {
    let (gpu, plan) = (gpu(), plan("soa", "atomic"));
    let mut session = session(&gpu, &plan, 1024);
    session.run(Until::Samples(11), &mut |_| true).expect("a render");
    let tally = plan.tallies.iter().find(|tally| tally.name == "drawn").expect("the tally");
    assert_eq!((plan.tallies.len(), tally.first, tally.size), (2, 7, 4));
    let counts = &session.tally_totals()[tally.first as usize..];
    let slots = u64::from(SIZE[0] * SIZE[1]) * 11;
    assert_eq!(session.tally_slots(), slots);
    assert_eq!(counts.iter().sum::<u64>(), 2 * slots);
    assert_eq!(counts[3], 0);
    assert!(session.tally_totals()[..7].iter().all(|&count| count == 0));
}

/// The first sample shows the pilot, the second to the eighth the pilot and the first, the ninth those and all seven.
#[test]
fn rates_are_those_of_all_samples_up_to_the_last_power_of_eight() {
    let (gpu, plan) = (gpu(), plan("soa", "atomic"));
    let shown = |totals: &Totals| f64::from(totals.mean()[0]) * f64::from(totals.samples);
    let count = |totals: &Totals| totals.tallied.as_ref().expect("counts").counts[7] as f64;
    let totals: Vec<Totals> = (1..=9).map(|samples| rendered(&gpu, &plan, 4096, samples).totals).collect();
    let piloted = pilot_slots(SIZE[0] * SIZE[1]);
    let pilot = shown(&totals[0]) * f64::from(piloted);
    // Two counts of three numbers; four standard errors of a number that is drawn a third of the time.
    let error = 2.0 * (2.0 / 9.0 / f64::from(piloted)).sqrt();
    assert!((shown(&totals[0]) - 2.0 / 3.0).abs() < 4.0 * error, "{pilot} of {piloted}");
    for (samples, rated) in [(2, 1), (3, 1), (4, 1), (8, 1), (9, 8)] {
        let slots = f64::from(piloted + SIZE[0] * SIZE[1] * rated);
        let expected = (pilot + count(&totals[rated as usize - 1])) / slots;
        let step = shown(&totals[samples - 1]) - shown(&totals[samples - 2]);
        assert!((step - expected).abs() < 1e-5, "sample {samples}: {step} against {expected}");
    }
}

#[test]
fn the_pilot_leaves_no_light_and_no_rays_and_is_not_the_picture() {
    let (gpu, plan) = (gpu(), plan("soa", "atomic"));
    let one = rendered(&gpu, &plan, 4096, 1);
    // All pixels alike: one sample each, whose three rates sum up to two counts.
    for pixel in one.mean.chunks_exact(3) {
        assert!((pixel.iter().sum::<f32>() - 2.0).abs() < 1e-5, "{pixel:?}");
    }
    assert_eq!(one.counters, Counters::default());
    assert!(one.profile.passes <= 1, "the pilot was measured too");
}

#[test]
fn a_resumed_render_goes_on_with_the_same_rates() {
    let (gpu, plan) = (gpu(), plan("soa", "atomic"));
    let whole = rendered(&gpu, &plan, 2048, 20).totals;
    // 8 is where rates change, 9 and 15 are not.
    for stop in [8, 9, 15] {
        let part = rendered(&gpu, &plan, 4096, stop).totals;
        let mut session = session(&gpu, &plan, 1024);
        session.resume(&part).expect("the same tallies");
        session.run(Until::Samples(20), &mut |_| true).expect("the rest");
        let resumed = session.totals().expect("totals");
        assert_eq!(resumed.sums, whole.sums, "stopped at {stop}");
        assert_eq!(resumed.tallied, whole.tallied, "stopped at {stop}");
    }
}

#[test]
fn a_picture_without_counts_is_not_resumed() {
    let (gpu, plan) = (gpu(), plan("soa", "atomic"));
    let totals = Totals { tallied: None, ..rendered(&gpu, &plan, 4096, 2).totals };
    let error = session(&gpu, &plan, 1024).resume(&totals).expect_err("no counts");
    assert_eq!((error.exit_code(), error.to_string().contains("counted something else")), (2, true));
}
