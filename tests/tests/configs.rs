//! Every shipped config renders: each pipeline, layout, schedule and precision in at least one combination, and every render file.

use runtime::configs::Axis;
use runtime::settings::RenderFile;
use tests::rendering::{Job, shipped};

/// One sample of a scene with every kind of light, small.
fn job(pipeline: &str) -> Job {
    Job::of_file(shipped("light_kinds")).pipeline(pipeline).size(16, 16).samples(1)
}

/// Pipelines that can be started; the others are there to be extended.
fn pipelines() -> Vec<&'static str> {
    let starts = |name: &&str| job(name).check().is_ok();
    Axis::Pipeline.names().into_iter().filter(starts).collect()
}

fn assert_renders(job: &Job, what: &str) {
    let rendering = job.render();
    assert_eq!(rendering.rejected, 0, "{what}");
    assert!(rendering.rays >= 256, "{what}: a primary ray for every pixel, not {}", rendering.rays);
}

#[test]
fn every_pipeline_renders_one_sample() {
    let pipelines = pipelines();
    for started in ["lt", "nee", "pt", "rays", "sbdpt", "sbdpt_pairs", "sbdpt_seed"] {
        assert!(pipelines.contains(&started), "pipeline `{started}` is shipped and can be started");
    }
    for pipeline in pipelines {
        assert_renders(&job(pipeline), pipeline);
    }
}

/// A layout that places fields by hand fits the pipeline that it was written for: each renders with the first that it fits.
#[test]
fn every_layout_renders_one_sample() {
    for layout in Axis::Layout.names() {
        let fits = |name: &&str| job(name).layout(layout).check().is_ok();
        let pipeline =
            pipelines().into_iter().find(fits).unwrap_or_else(|| panic!("no pipeline fits layout `{layout}`"));
        assert_renders(&job(pipeline).layout(layout), layout);
    }
}

/// What other pipelines make of them is compared in `schedules` and `streams`.
#[test]
fn every_schedule_renders_one_sample() {
    for schedule in Axis::Schedule.names() {
        assert_renders(&job("pt").schedule(schedule), schedule);
    }
}

#[test]
fn every_precision_renders_one_sample() {
    for precision in Axis::Precision.names() {
        assert_renders(&job("pt").precision(precision), precision);
    }
}

#[test]
fn every_render_file_renders_one_sample() {
    for name in Axis::Render.names() {
        let text = Axis::Render.shipped(name).expect("the name comes from the list");
        let file = RenderFile::parse(text, name).unwrap_or_else(|error| panic!("{name}: {error}"));
        let scene = file.scene.as_deref().expect("a render file names its scene");
        let mut job = Job::of_file(shipped(scene)).size(16, 16).samples(1);
        for (key, value) in &file.set {
            job = job.set(key, value.word());
        }
        for (word, choose) in [
            (&file.pipeline, Job::pipeline as fn(Job, &str) -> Job),
            (&file.layout, Job::layout),
            (&file.schedule, Job::schedule),
            (&file.precision, Job::precision),
        ] {
            if let Some(word) = word {
                job = choose(job, word);
            }
        }
        assert_renders(&job, name);
    }
}
