//! The layout never changes what the image converges to: layouts that keep every bit give the same image bit for bit with the
//! fixed-point film, those with codecs one that differs by what these declare.

use runtime::configs::Axis;
use std::collections::BTreeSet;
use tests::rendering::{Job, Rendering, shipped};

/// Shipped layouts by name: those whose codecs keep every bit, or those that do not.
fn layouts(lossless: bool) -> Vec<&'static str> {
    let keeps = |name: &&str| {
        let report = ["sbdpt", "pt", "sbdpt_seed"].into_iter().map(|pipeline| job(pipeline).layout(name));
        let report = report.filter(|job| job.check().is_ok()).map(|job| job.report()).next();
        let tables = report.expect("the layout fits a pipeline").tables;
        let mut fields = tables.iter().flat_map(|table| &table.fields);
        fields.all(|field| ["f32", "u32", "bits"].contains(&field.codec.as_str())) == lossless
    };
    Axis::Layout.names().into_iter().filter(keeps).collect()
}

fn job(pipeline: &str) -> Job {
    Job::of_file(shipped("cornell_box")).pipeline(pipeline).size(40, 24).samples(4).edges(6).fixed_point()
}

#[test]
fn layouts_of_both_kinds_are_shipped() {
    assert_eq!(
        layouts(true),
        ["aos", "aosoa32", "compact", "pt_placed", "seed_aos", "soa", "split_compact", "split_soa"]
    );
    assert_eq!(layouts(false), ["compact_lossy", "compact_near", "split_compact_lossy", "split_compact_near"]);
}

/// Bytes of state a path with every effect, rays in flight left out, as the compiler finds them.
#[test]
fn states_are_as_small_as_they_can_be() {
    let bytes = |scene: &str, lane: u32| {
        let job = Job::of_file(shipped(scene)).pipeline("sbdpt").set("layout.lane", lane);
        ["compact", "compact_near", "compact_lossy"].map(|layout| job.clone().layout(layout).report().bytes_per_path)
    };
    // A bottle that absorbs: with the numbers of what walks are inside of. Lanes of two words leave one empty.
    assert_eq!((bytes("bottle", 1), bytes("bottle", 2)), ([72, 44, 32], [72, 48, 32]));
    let seed = Job::of_file(shipped("bottle")).pipeline("sbdpt_seed").layout("seed_aos");
    assert_eq!(seed.report().bytes_per_path, 224);
    let matt = bytes("cornell_box", 1);
    assert!(matt[0] <= 72 && matt[1] <= 44 && matt[2] <= 32 && matt != [72, 44, 32], "{matt:?}");
}

/// Whether a layout fits the pipeline: one that places fields by name does where these fields are.
fn fits(job: &Job) -> bool {
    let Err(refusal) = job.check() else { return true };
    let of_another = ["no such field", "is placed nowhere"].iter().any(|reason| refusal.contains(reason));
    assert!(of_another, "{refusal}");
    false
}

/// The same image, and the same rays: a path that is lost outside of the box leaves the image as it is.
#[track_caller]
fn assert_same(rendering: &Rendering, expected: &Rendering, what: &str) {
    assert!(rendering.sums == expected.sums, "{what}: the image is not that of aos");
    let traced = |rendering: &Rendering| (rendering.rays, rendering.visibility);
    assert_eq!(traced(rendering), traced(expected), "{what}: all rays, and visibility rays among them");
}

/// Those that place fields most unlike `aos`, with the pipelines that are not rendered by every layout under every schedule.
#[test]
fn unlike_layouts_give_the_same_bits() {
    for (pipeline, layout) in [
        ("nee", "split_compact"),
        ("lt", "split_compact"),
        ("sbdpt_pairs", "split_compact"),
        ("sbdpt_seed", "split_compact"),
        ("sbdpt_seed", "seed_aos"),
    ] {
        let expected = job(pipeline).layout("aos").render();
        assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
        assert_same(&job(pipeline).layout(layout).render(), &expected, &format!("{pipeline}, {layout}"));
    }
}

/// Every layout that keeps every bit under these schedules, rendered once where the plan is the same. Says which layouts fit.
#[track_caller]
fn every_layout_under(schedules: &[&str], pipeline: &str) -> Vec<&'static str> {
    let job = job(pipeline).size(20, 12).samples(2);
    let of = |layout: &str, schedule: &str| job.clone().layout(layout).schedule(schedule);
    let plan = |job: &Job| format!("{:?}", job.plan());
    let expected = of("aos", "wavefront");
    let mut rendered = BTreeSet::from([plan(&expected)]);
    let expected = expected.render();
    assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
    let fitting: Vec<&str> = layouts(true).into_iter().filter(|layout| fits(&of(layout, "wavefront"))).collect();
    for schedule in schedules {
        for layout in &fitting {
            let job = of(layout, schedule);
            if rendered.insert(plan(&job)) {
                assert_same(&job.render(), &expected, &format!("{pipeline}, {layout}, {schedule}"));
            }
        }
    }
    fitting
}

#[test]
fn every_layout_under_every_schedule_gives_the_same_bits_of_pt() {
    let fitting = every_layout_under(&Axis::Schedule.names(), "pt");
    assert_eq!(fitting, ["aos", "aosoa32", "compact", "pt_placed", "soa", "split_compact", "split_soa"]);
}

/// Under the schedules that do most with what is stored; `schedules` has the others on one layout.
#[test]
fn every_layout_under_unlike_schedules_gives_the_same_bits_of_sbdpt() {
    let fitting = every_layout_under(&["wavefront", "ordered"], "sbdpt");
    assert_eq!(fitting, ["aos", "aosoa32", "compact", "soa", "split_compact", "split_soa"]);
}

#[test]
#[ignore = "some ten minutes without a GPU"]
fn every_layout_under_every_schedule_gives_the_same_bits_of_bidirectional_pipelines() {
    for pipeline in ["sbdpt", "sbdpt_seed", "sbdpt_pairs"] {
        let fitting = every_layout_under(&Axis::Schedule.names(), pipeline);
        assert!(fitting.len() > 5, "{pipeline}: {fitting:?}");
    }
}

/// Mean over all pixels and channels.
fn mean(rendering: &Rendering) -> f64 {
    let pixels = &rendering.pixels.rgb;
    pixels.iter().flatten().map(|&value| f64::from(value)).sum::<f64>() / (3 * pixels.len()) as f64
}

/// Root mean square over all pixels and channels of what `of` makes of each.
fn root_mean_square(rendering: &Rendering, of: impl Fn(usize, usize) -> f64) -> f64 {
    let count = rendering.pixels.rgb.len();
    let sum: f64 =
        (0..count).flat_map(|pixel| (0..3).map(move |channel| (pixel, channel))).map(|(p, c)| of(p, c).powi(2)).sum();
    (sum / (3 * count) as f64).sqrt()
}

/// With the same random numbers: the mean moves by less than a thousandth, pixels by far less than the noise of a sample.
#[test]
fn lossy_layouts_stay_within_what_their_codecs_declare() {
    const SAMPLES: u32 = 64;
    for pipeline in ["pt", "sbdpt"] {
        let job = job(pipeline).samples(SAMPLES);
        let exact = job.clone().layout("soa").render();
        let noise = root_mean_square(&exact, |pixel, channel| f64::from(exact.pixels.errors[pixel][channel]));
        let one_sample = noise * f64::from(SAMPLES).sqrt();
        // Splitting tables moves fields, and codecs none of their bits.
        for layout in layouts(false).into_iter().filter(|layout| !layout.starts_with("split")) {
            let lossy = job.clone().layout(layout).render();
            assert_eq!(lossy.rejected, 0);
            let shift = mean(&lossy) / mean(&exact) - 1.0;
            let moved = root_mean_square(&exact, |pixel, channel| {
                f64::from(lossy.pixels.rgb[pixel][channel]) - f64::from(exact.pixels.rgb[pixel][channel])
            });
            eprintln!(
                "{pipeline} with {layout}: mean {shift:+.2e}, pixels {:.2e} of a sample's noise",
                moved / one_sample
            );
            assert!(shift.abs() < 1e-3, "{pipeline} with {layout}: the mean moves by {shift}");
            assert!(
                moved < 0.05 * one_sample,
                "{pipeline} with {layout}: pixels move by {moved}, noise is {one_sample}"
            );
        }
    }
}

/// Both acceleration structures find the same hits.
#[test]
fn both_accelerators_give_the_same_bits() {
    for scene in ["cornell_box", "outdoor"] {
        let job = Job::of_file(shipped(scene)).pipeline("pt").size(40, 24).samples(16).edges(6).fixed_point();
        let images = ["cwbvh", "bvh2"].map(|accelerator| job.clone().set("accelerator", accelerator).render());
        assert!(images[0].sums.iter().any(|&sum| sum != 0), "{scene}: a black image proves nothing");
        assert!(images[0].sums == images[1].sums, "{scene}: bvh2 gives another image than cwbvh");
    }
}

#[test]
fn the_seed_decides_the_image() {
    let first = job("pt").seed(7).render();
    assert!(first.sums == job("pt").seed(7).render().sums, "the same seed gives another image");
    assert!(first.sums != job("pt").seed(8).render().sums, "another seed gives the same image");
}
