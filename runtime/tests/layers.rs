//! Layers through the whole runtime: planes behind the picture, with and without a correction by a tally.

mod common;

use common::{SIZE, Small, gpu, rendered, session};
use kernelgen::plan::Plan;
use runtime::film::Totals;
use runtime::render::{Rendered, Session, Settings, Until};

const PIPELINE: &str = r#"
doc = "Every path draws a number, and adds to the layer of that number."
start = "draw"
rounds = "1"

[tallies]
drawn = { size = "4" }

[layers]
idle  = { size = "5" }
parts = { size = "4", correct = "drawn" }
shown = { size = "2" }

[records.Path]
number = "index"

[state]
path = "Path"

[stages]
draw = { on.drawn = "show" }
show = { on.done = "end" }
"#;

/// The picture itself is 1 everywhere.
const STAGES: &str = r#"
import package::film::{splat, splat_parts, splat_shown};
import package::outcome::{DRAWN, DONE};
import package::pass::{pass_seed, path_pixel, path_sample};
import package::real::{real, vec3r};
import package::state::Path;
import package::tallies::count_drawn;

/// Draws 0, 1 or 2.
fn draw(path: ptr<function, Path>) -> u32 {
    path.number = hash(hash(path_pixel()) + hash(path_sample()) + pass_seed()) % 3u;
    return DRAWN;
}

/// Counts and adds.
fn show(path: ptr<function, Path>) -> u32 {
    let pixel = path_pixel();
    count_drawn(path.number);
    splat(pixel, vec3r(1.0));
    splat_parts(path.number, pixel, vec3r(real(path.number + 1u)));
    splat_shown(path.number, pixel, vec3r(real(pixel), 0.0, 0.5));
    if path.number == 0u {
        splat_shown(1u, pixel, vec3r(-1.0));
    }
    return DONE;
}
"#;

const SAMPLES: u32 = 16;

fn plan(accumulate: &'static str) -> Plan {
    Small { pipeline: PIPELINE, stages: STAGES, order: "soa", queue: "atomic", accumulate }.plan()
}

fn average(values: &[f32]) -> f64 {
    values.iter().copied().map(f64::from).sum::<f64>() / values.len() as f64
}

fn layer(rendered: &Rendered, group: &str, index: u32) -> Vec<f32> {
    rendered.layer(group, index).expect("the layer")
}

#[test]
fn only_layers_that_are_added_to_take_space() {
    for (accumulate, channel) in [("fixed_i64", 8), ("atomic_f32", 4)] {
        let plan = plan(accumulate);
        let groups: Vec<_> = plan.layers.iter().map(|group| (group.name.as_str(), group.first, group.size)).collect();
        assert_eq!(groups, [("parts", 1, 4), ("shown", 5, 2)]);
        let film = plan.buffers.iter().find(|buffer| buffer.name == "film").expect("a film");
        assert_eq!((plan.planes(), film.size.per_pixel), (7, 3 * 7 * channel));
    }
}

/// Layer i gets i + 1 from every path that is counted at i, so that corrected it is i + 1 on average over the pixels.
#[test]
fn corrected_layers_go_into_the_picture_and_others_do_not() {
    for accumulate in ["fixed_i64", "atomic_f32"] {
        let rendered = rendered(&gpu(), &plan(accumulate), 2048, SAMPLES);
        assert_eq!(rendered.mean.len(), (3 * SIZE[0] * SIZE[1]) as usize);
        assert!((average(&rendered.mean) - 7.0).abs() < 1e-4, "{accumulate}: {}", average(&rendered.mean));
        let tallied = rendered.totals.tallied.as_ref().expect("counts");
        for index in 0..4 {
            let rate = tallied.counts[index as usize] as f64 / tallied.slots as f64;
            let expected = f64::from(index + 1) * rate;
            assert!((average(&layer(&rendered, "parts", index)) - expected).abs() < 1e-4, "{accumulate} {index}");
        }
    }
}

#[test]
fn a_layer_holds_the_pixels_in_their_places_and_refuses_what_the_picture_refuses() {
    let rendered = rendered(&gpu(), &plan("fixed_i64"), 2048, SAMPLES);
    let [first, last] = [0, 1].map(|index| layer(&rendered, "shown", index));
    for (pixel, (first, last)) in first.chunks_exact(3).zip(last.chunks_exact(3)).enumerate() {
        // Every path adds the number of its pixel; index 2 is taken as the last.
        assert!((first[0] + last[0] - pixel as f32).abs() < 1e-2, "{pixel}: {first:?} {last:?}");
        assert!((first[2] + last[2] - 0.5).abs() < 1e-6 && first[1] + last[1] == 0.0);
    }
    let counts = &rendered.totals.tallied.as_ref().expect("counts").counts;
    assert_eq!(rendered.counters.rejected, counts[0]);
    assert!(rendered.layer("shown", 2).is_none() && rendered.layer("idle", 0).is_none());
}

#[test]
fn standard_errors_add_up_in_squares() {
    let rendered = rendered(&gpu(), &plan("fixed_i64"), 2048, SAMPLES);
    let shares = &rendered.totals.shares;
    assert_eq!((shares[0], shares[4], shares[5], shares.len()), (1.0, 0.0, 0.0, 7));
    let parts: Vec<Vec<f32>> =
        (0..4).map(|index| rendered.layer_standard_error("parts", index).expect("errors")).collect();
    let errors = rendered.standard_error.as_ref().expect("errors");
    for (word, &error) in errors.iter().enumerate() {
        let square: f64 = (0..4).map(|index| (shares[index + 1] * f64::from(parts[index][word])).powi(2)).sum();
        assert!((f64::from(error) - square.sqrt()).abs() < 1e-4 * square.sqrt().max(1e-3));
    }
    assert!(average(errors) > 0.1);
}

#[test]
fn layers_depend_on_no_size_of_passes_and_resume_in_memory() {
    let (gpu, plan) = (gpu(), plan("fixed_i64"));
    let whole = rendered(&gpu, &plan, 1024, SAMPLES).totals;
    let part = rendered(&gpu, &plan, 8192, 5).totals;
    let mut session = session(&gpu, &plan, 4096);
    session.resume(&part).expect("all layers");
    session.run(Until::Samples(SAMPLES), &mut |_| true).expect("the rest");
    let resumed = session.totals().expect("totals");
    assert_eq!((&resumed.sums, &resumed.shares), (&whole.sums, &whole.shares));
    assert_eq!(resumed.mean(), whole.mean());
}

#[test]
fn a_saved_picture_with_layers_is_not_resumed() {
    let (gpu, plan) = (gpu(), plan("fixed_i64"));
    let totals = Totals { shares: vec![1.0], ..rendered(&gpu, &plan, 4096, 2).totals };
    let error = session(&gpu, &plan, 1024).resume(&totals).expect_err("no layers");
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("cannot resume a picture with layers"), "{error}");
}

#[test]
fn a_film_with_too_many_layers_is_refused() {
    let pipeline = r#"
start = "draw"
rounds = "1"
layers.shown = { size = "131072" }
layers.parts = { size = "1" }
tallies.drawn = { size = "1" }
records.Path.number = "index"
state.path = "Path"
stages.draw.on.drawn = "show"
stages.show.on.done = "end"
"#;
    let plan = Small { pipeline, stages: STAGES, order: "soa", queue: "atomic", accumulate: "fixed_i64" }.plan();
    let settings = Settings { size: [2048, 2048], seed: 7, paths: Some(1024) };
    let error = Session::new(&gpu(), &plan, &|_| None, settings, None).expect_err("too large");
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().starts_with("`film` takes"), "{error}");
}
