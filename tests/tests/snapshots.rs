//! Committed pictures of what every config generates: the WGSL of each kernel, the layout and the plan. Reviewing a change of the
//! generator is reviewing their difference.

use kernelgen::Generated;
use kernelgen::config::model::{Effect, Effects, Selection};
use kernelgen::plan::Kernel;
use kernelgen::source::FileKind;
use runtime::configs::{Axis, Library};
use runtime::scene::LoadOptions;
use runtime::settings::RenderFile;
use std::fmt::Write;

/// The effects of the shipped Cornell box, or all that a scene may call for.
fn effects(all: bool) -> Effects {
    let scene = runtime::scene::load(&tests::rendering::shipped("cornell_box"), &LoadOptions::default());
    let mut effects = scene.expect("the shipped scene loads").effects;
    if all {
        let present = Effect { present: true, reason: "every effect is asked for".to_owned() };
        effects.values_mut().for_each(|effect| *effect = present.clone());
    }
    effects
}

fn generate(selection: Selection) -> Generated {
    let library = Library::default();
    let generated = kernelgen::generate(&library.sources, &selection);
    let generated = generated.unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
    let warnings: Vec<&str> = generated.warnings.iter().map(|warning| &*warning.message).collect();
    assert_eq!(warnings, [""; 0], "shipped configs are above reproach");
    generated
}

fn selection(pipeline: &str, layout: &str, schedule: &str, precision: &str, all: bool) -> Selection {
    Selection {
        pipeline: format!("pipelines/{pipeline}.toml"),
        layout: format!("layouts/{layout}.toml"),
        schedule: format!("schedules/{schedule}.toml"),
        precision: format!("precisions/{precision}.toml"),
        set: Vec::new(),
        effects: effects(all),
    }
}

/// Everything generated, as one text; kernels in the order of the plan.
fn text_of(generated: &Generated) -> String {
    let mut text = generated.report.text();
    let plan = serde_json::to_value(&generated.plan).expect("a plan is JSON");
    let mut bare = plan.clone();
    for kernel in bare["kernels"].as_array_mut().expect("kernels") {
        kernel.as_object_mut().expect("a kernel is an object").remove("module");
    }
    writeln!(text, "\n==== plan\n{}", serde_json::to_string_pretty(&bare).expect("JSON")).expect("a string grows");
    for kernel in &generated.plan.kernels {
        writeln!(text, "\n==== {}.wgsl\n{}", kernel.name, kernel.module).expect("a string grows");
    }
    text
}

fn pipelines() -> Vec<&'static str> {
    // A pipeline without a start of its own is a base for others, or inherits one.
    Axis::Pipeline
        .names()
        .into_iter()
        .filter(|name| Axis::Pipeline.shipped(name).is_some_and(|text| text.contains("\nstart")))
        .chain(["pt", "sbdpt_pairs"])
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .collect()
}

#[test]
fn every_pipeline_in_a_cornell_box() {
    for pipeline in pipelines() {
        let generated = generate(selection(pipeline, "soa", "wavefront", "f32", false));
        insta::assert_snapshot!(format!("pipeline_{pipeline}_cornell"), text_of(&generated));
    }
}

#[test]
fn every_pipeline_with_every_effect() {
    for pipeline in pipelines() {
        let generated = generate(selection(pipeline, "soa", "wavefront", "f32", true));
        insta::assert_snapshot!(format!("pipeline_{pipeline}_everything"), text_of(&generated));
    }
}

#[test]
fn every_layout() {
    for layout in Axis::Layout.names() {
        // A layout that places fields by hand fits the pipeline that it was written for.
        let pipeline = if layout == "seed_aos" { "sbdpt_seed" } else { "pt" };
        let generated = generate(selection(pipeline, layout, "wavefront", "f32", false));
        insta::assert_snapshot!(format!("layout_{layout}"), text_of(&generated));
    }
}

#[test]
fn every_schedule() {
    for schedule in Axis::Schedule.names() {
        let generated = generate(selection("pt", "soa", schedule, "f32", false));
        insta::assert_snapshot!(format!("schedule_{schedule}"), text_of(&generated));
    }
}

/// What an adapter with memory of its own takes by default: inner loops, paths that move where they stand in queues, and close up.
#[test]
fn the_flagship_as_a_gpu_runs_it() {
    let generated = generate(selection("sbdpt", "split_compact", "ordered", "f32", false));
    insta::assert_snapshot!("pipeline_sbdpt_split_compact_ordered", text_of(&generated));
}

/// The seed's paths all meet at `construct_eye`, too, which touches hardly any of their state.
#[test]
fn paths_close_up_where_the_least_is_taken_along() {
    let generated = generate(selection("sbdpt_seed", "soa", "ordered", "f32", false));
    let closes_up = |kernel: &&Kernel| kernel.module.contains("path_id = packed_slot(");
    let closing: Vec<&str> =
        generated.plan.kernels.iter().filter(closes_up).map(|kernel| kernel.name.as_str()).collect();
    assert_eq!(closing, ["extend_light"]);
}

#[test]
fn every_precision() {
    for precision in Axis::Precision.names() {
        let generated = generate(selection("pt", "soa", "wavefront", precision, false));
        insta::assert_snapshot!(format!("precision_{precision}"), text_of(&generated));
    }
}

/// Each render file fixes a variant and a scene: the kernels that its picture comes from.
#[test]
fn every_render_file() {
    for name in Axis::Render.names() {
        let text = Axis::Render.shipped(name).expect("the name comes from the list");
        let file = RenderFile::parse(text, name).unwrap_or_else(|error| panic!("{name}: {error}"));
        let scene = file.scene.as_deref().expect("a render file names its scene");
        let loaded = runtime::scene::load(&tests::rendering::shipped(scene), &LoadOptions::default());
        let selection = file
            .selection(&mut Library::default(), loaded.expect("the shipped scene loads").effects)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        insta::assert_snapshot!(format!("render_{name}"), text_of(&generate(selection)));
    }
}

/// A file without `start` is there to be extended: here by the least pipeline that can run, one stage that ends at once.
#[test]
fn every_base_under_the_least_pipeline() {
    for base in Axis::Pipeline.names().into_iter().filter(|name| !pipelines().contains(name)) {
        let least = format!(
            "doc = \"Least.\"\nextends = \"{base}.toml\"\nstart = \"emit_eye\"\nrounds = \"1\"\n[state]\neye = \"Walk\"\n\
             [stages]\nemit_eye = {{ with.walk = \"eye\", on.emitted = \"end\" }}\n"
        );
        let mut library = Library::default();
        library.sources.add(FileKind::Config, "pipelines/least.toml", "least.toml", least);
        let generated = kernelgen::generate(&library.sources, &selection("least", "soa", "wavefront", "f32", false))
            .unwrap_or_else(|refusal| panic!("{}", refusal.render(false)));
        insta::assert_snapshot!(format!("base_{base}"), text_of(&generated));
    }
}

#[test]
fn equal_input_gives_equal_bytes() {
    let twice: Vec<String> =
        (0..2).map(|_| text_of(&generate(selection("lt", "aosoa32", "wavefront", "f32", true)))).collect();
    assert_eq!(twice[0], twice[1]);
}

#[test]
fn a_cornell_box_has_no_trace_of_absent_effects() {
    for pipeline in pipelines() {
        let generated = generate(selection(pipeline, "soa", "wavefront", "f32", false));
        for kernel in &generated.plan.kernels {
            let code = without_comments(&kernel.module).to_lowercase();
            for word in [
                "glass",
                "dielectric",
                "refract",
                "transmi",
                "texture",
                "texel",
                "sky",
                "lens",
                "spot",
                "ggx",
                "fresnel",
                "medium",
                "attenuation",
                "delta",
                "mirror",
                "thin_",
                "normal_map",
                "tangent_at",
            ] {
                assert!(
                    !code.contains(word),
                    "{pipeline}: {} mentions `{word}`:\n{}",
                    kernel.name,
                    line_with(&code, word)
                );
            }
        }
        let resources = [
            "texels",
            "texture_slots",
            "sky_texels",
            "sky_alias",
            "triangle_uvs",
            "triangle_colors",
            "triangle_tangents",
            "triangle_normals",
        ];
        for buffer in &generated.plan.buffers {
            assert!(!resources.contains(&buffer.name.as_str()), "{pipeline} binds {}", buffer.name);
        }
    }
}

fn line_with(text: &str, word: &str) -> String {
    text.lines().filter(|line| line.contains(word)).collect::<Vec<_>>().join("\n")
}

fn without_comments(text: &str) -> String {
    // Constants say which effects are absent, so they may name them.
    let code = |line: &&str| !line.starts_with("const HAS_") && !line.contains(" if HAS_");
    text.lines().filter(code).map(|line| line.split("//").next().unwrap_or(line)).collect::<Vec<_>>().join("\n")
}

/// Every copied line stands in its file to the letter; only binding numbers are put in front of resources.
#[test]
fn stage_text_is_printed_verbatim() {
    let library = Library::default();
    let generated = generate(selection("pt", "soa", "wavefront", "f32", true));
    let mut copied = 0;
    for kernel in &generated.plan.kernels {
        for block in kernel.module.split("\n// stages/wgsl/").skip(1) {
            let (place, rest) = block.split_once('\n').expect("a place stands on its own line");
            let file = place.split(':').next().expect("file");
            let id = library.sources.find(FileKind::Module, file.trim_end_matches(".wgsl")).expect("the module exists");
            let source: Vec<&str> = library.sources.file(id).text.lines().collect();
            let body = rest.split("\n// <generated>").next().expect("body");
            copied += 1;
            // What stays of an `else` whose `if` was cut is a bare block.
            for line in body.lines().filter(|line| !matches!(line.trim(), "" | "{")) {
                let own = match line.strip_prefix("@group(0) @binding(") {
                    Some(numbered) => numbered.split_once(") ").expect("a number").1,
                    None => line,
                };
                assert!(source.contains(&own), "{}: `{own}` is not a line of {file}", kernel.name);
            }
        }
    }
    assert!(copied > 50, "declarations were copied: {copied}");
}
