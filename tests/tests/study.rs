//! Studies: what a small one writes, what it does not render twice, and that every shipped one can be run.

use kernelgen::config::model::{Effects, Selection};
use runtime::configs::{Axis, Library};
use runtime::device::{DeviceOptions, Gpu};
use runtime::error::Error;
use runtime::image_file::Image;
use runtime::pyramid;
use runtime::render::Progress;
use runtime::settings::RenderFile;
use runtime::study::results::Run;
use runtime::study::{Observer, Outcome, Results, Study, run};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, Mutex, PoisonError};
use tests::browser;
use tests::program::program;

/// Two pipelines on two shipped scenes, and a scene that is not there.
const SMALL: &str = r#"
title = "Small & quick"
doc   = "Two variants on two scenes."

[defaults]
size = [16, 16]
spp  = 2

[[variant]]
name     = "pt <b>"
pipeline = "pt"
doc      = "Path tracing."

[[variant]]
name     = "nee"
pipeline = "nee"

[[scene]]
name              = "cornell_box"
reference_variant = "pt <b>"
reference_spp     = 8

[[scene]]
name = "slit_room"
set  = { max_edges = 3 }

[[scene]]
name  = "gone"
scene = "no/such/scene.glb"
"#;

/// One study at a time: renders use all cores of a software device anyway.
static GPU: LazyLock<Mutex<Gpu>> = LazyLock::new(|| {
    Mutex::new(Gpu::open(&DeviceOptions::default()).expect("there is a Vulkan device, if only Mesa's software driver"))
});

/// A folder for a study, removed at the end of its test.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        Folder(std::env::temp_dir().join(format!("pathloom-study-{}-{test}", std::process::id())))
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays behind in the temporary one does no harm.
        drop(fs::remove_dir_all(&self.0));
    }
}

/// Remembers what a study says, and stops it after some renders.
#[derive(Default)]
struct Listener {
    begun: Vec<String>,
    notes: Vec<String>,
    stop_after: Option<usize>,
}

impl Observer for Listener {
    fn begin(&mut self, what: &str) -> bool {
        self.begun.push(what.to_owned());
        self.stop_after.is_none_or(|most| self.begun.len() <= most)
    }

    fn show(&mut self, _: &Progress) -> bool {
        true
    }

    fn end(&mut self) {}

    fn note(&mut self, line: &str) {
        self.notes.push(line.to_owned());
    }
}

fn run_in(folder: &Path, text: &str, listener: &mut Listener) -> Result<Outcome, Error> {
    let study = Study::parse(text, "small.toml")?;
    let gpu = GPU.lock().unwrap_or_else(PoisonError::into_inner);
    run(&study, folder, &gpu, listener)
}

#[track_caller]
fn run_small(folder: &Folder, text: &str) -> (Outcome, Listener) {
    let mut listener = Listener::default();
    let outcome = run_in(&folder.0, text, &mut listener).unwrap_or_else(|error| panic!("{error}"));
    (outcome, listener)
}

/// Opening and closing tags in order, void elements and the contents of `<style>` left out.
#[track_caller]
fn assert_balanced(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in html.split('<').skip(1).filter_map(|rest| rest.split('>').next()) {
        let name = tag.trim_start_matches('/').split_whitespace().next().unwrap_or("").trim_end_matches('/');
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "`</{name}>` closes something else");
        } else if !(tag.ends_with('/') || tag.starts_with('!') || ["img", "meta", "input"].contains(&name)) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

#[test]
fn a_small_study_writes_everything_and_renders_nothing_twice() {
    let folder = Folder::new("small");
    let (first, listener) = run_small(&folder, SMALL);
    assert_eq!(
        (first.rendered, first.results.runs.len(), first.stopped),
        (5, 4, false),
        "four pictures and a reference"
    );
    assert!(listener.notes.iter().any(|note| note.contains("`gone` is skipped")), "{:?}", listener.notes);
    assert_tables(&folder, &first.results);
    assert_pictures(&folder, &first.results);
    assert_report(&folder.text("report.html"));

    let (second, listener) = run_small(&folder, SMALL);
    assert_eq!((second.rendered, listener.begun.len()), (0, 0));
    assert_eq!(second.results, first.results);

    let (third, listener) = run_small(&folder, &SMALL.replace("max_edges = 3", "max_edges = 4"));
    assert_eq!(third.rendered, 2, "one scene has other settings: {:?}", listener.begun);
}

#[track_caller]
fn assert_tables(folder: &Folder, results: &Results) {
    let csv = folder.text("results.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 1 + 4, "a row of names and one for each picture");
    assert!(lines[0].starts_with("scene,variant,repeat,pipeline,"));
    let cells = |line: &str| line.split('"').step_by(2).collect::<String>().split(',').count();
    assert!(lines.iter().all(|line| cells(line) == cells(lines[0])), "{csv}");
    let read = Results::read(&folder.0).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(&read, results);
    for run in &results.runs {
        assert_eq!((run.measured.samples, run.measured.rejected), (16 * 16 * 2, 0));
        assert_eq!(run.errors.is_some(), run.scene == "cornell_box", "only one scene has a reference");
    }
}

#[track_caller]
fn assert_pictures(folder: &Folder, results: &Results) {
    for run in &results.runs {
        let path = folder.0.join(&run.picture);
        let image = Image::load(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(image.size, [16, 16]);
        let settings = image.settings.map(|text| RenderFile::parse(&text, "metadata"));
        assert!(settings.is_some_and(|settings| settings.is_ok()), "the picture can be rendered again");
        assert!(path.with_extension("png").is_file());
        assert_eq!(path.with_extension("difference.png").is_file(), run.errors.is_some());
    }
}

#[track_caller]
fn assert_report(html: &str) {
    for words in ["Small &amp; quick", "pt &lt;b&gt;", "nee", "cornell_box", "slit_room", "gone", "Path tracing."] {
        assert!(html.contains(words), "`{words}` is not in the report");
    }
    assert!(!html.contains("<b>"), "names are escaped");
    for outside in ["http://", "https://", "src=\"pictures"] {
        assert!(!html.contains(outside), "the report needs nothing beside it");
    }
    assert!(html.contains("<svg") && html.contains("data:image/png;base64,"));
    assert_balanced(html);
}

/// The words that each kernel of `rays` moves, counted by hand: of paths that it takes, of those that it sends on, and of queues.
#[test]
fn bytes_moved_are_those_counted_by_hand() {
    let folder = Folder::new("bytes");
    let variant = "[[variant]]\nname = \"rays\"\npipeline = \"rays\"\nlayout = \"soa\"\nschedule = \"ordered\"\n";
    let scene = "[[scene]]\nname = \"cornell_box\"\nsize = [32, 24]\nspp = 2\nset = { max_edges = 2 }\n";
    let (outcome, _) = run_small(&folder, &format!("title = \"Bytes\"\n{variant}{scene}"));
    let profile = outcome.results.runs[0].measured.kernel_profile.as_ref().expect("studies profile kernels");
    let kernel = |name: &str| profile.kernels.iter().find(|kernel| kernel.name == name).expect("a kernel of `rays`");
    let taken = |name: &str| kernel(name).entries_per_sample;
    let (position, direction, hit, length) = (3.0, 3.0, 4.0, 1.0);
    let ray = position + direction + length;
    let again = taken("trace_eye") - 1.0;
    assert!(taken("emit_eye") == 1.0 && taken("probe") == taken("trace_eye"));
    assert!(again > 0.1 && again < taken("bounce") && taken("bounce") <= taken("probe"), "{again}");
    // A place knows its slot; what leads to `trace_eye` writes that, and a ray, to where the path stands then.
    let (entry, slot) = (1.0, 1.0);
    let by_hand = [
        ("emit_eye", ray, slot),
        ("trace_eye", taken("trace_eye") * (position + direction + hit), taken("trace_eye") * (slot + entry)),
        ("probe", taken("probe") * (position + direction), taken("probe") * (entry + slot) + taken("bounce") * entry),
        (
            "bounce",
            taken("bounce") * (direction + hit + length) + again * ray,
            taken("bounce") * (entry + slot) + again * slot,
        ),
    ];
    for (name, state, queues) in by_hand {
        let of = kernel(name);
        for (bytes, words) in [(of.state_bytes_per_sample, state), (of.queue_bytes_per_sample, queues)] {
            assert!((bytes / (4.0 * words) - 1.0).abs() < 1e-9, "{name}: {bytes} for {} by hand", 4.0 * words);
        }
    }
    let bytes: f64 = by_hand.iter().map(|(_, state, queues)| 4.0 * (state + queues)).sum();
    assert!((profile.bytes_per_sample() / bytes - 1.0).abs() < 1e-9, "{} for {bytes}", profile.bytes_per_sample());
}

#[test]
fn what_kernels_take_and_move_is_measured() {
    let folder = Folder::new("kernels");
    let axes = "[axes]\nlayout = [\"aos\", \"soa\"]\nschedule = [\"wavefront\", \"ordered\"]\npipeline = [\"pt\"]\n";
    let scene = "[[scene]]\nname = \"cornell_box\"\nsize = [32, 24]\nspp = 4\nset = { max_edges = 3 }\n";
    let (outcome, _) = run_small(&folder, &format!("title = \"Kernels\"\n{axes}{scene}"));
    let results = &outcome.results;
    assert_eq!(results.variants, ["aos x wavefront", "aos x ordered", "soa x wavefront", "soa x ordered"]);
    let rate = results.copy_rate.as_ref().expect("the software device has timestamps");
    assert!(rate.gb_per_s > 0.1 && rate.gb_per_s < 1e4 && rate.bytes >= 1 << 20, "{rate:?}");
    for run in &results.runs {
        assert_kernels(run);
    }
    let entries = |run: &Run| {
        let mut occupancy = run.measured.kernel_profile.as_ref().expect("studies profile kernels").occupancy.clone();
        let resolved: f64 = occupancy.shift_remove("resolve_connection").expect("a kernel of `pt`").iter().sum();
        (occupancy, (resolved * run.measured.samples as f64).round())
    };
    let [first, rest @ ..] = results.runs.as_slice() else { panic!("four runs") };
    // Neither layout nor order of queues decides where a path goes. When records are resolved depends on the room for them.
    rest.iter().for_each(|run| assert_eq!(entries(run), entries(first), "{}", run.variant));
}

#[track_caller]
fn assert_kernels(run: &Run) {
    let profile = run.measured.kernel_profile.as_ref().expect("studies profile kernels");
    let kernel = |name: &str| profile.kernels.iter().find(|kernel| kernel.name == name).expect("a kernel of `pt`");
    let of = |name: &str| profile.occupancy.get(name).unwrap_or_else(|| panic!("{name} takes nothing"));
    assert_eq!(of("emit_eye"), &[1.0], "every path begins once");
    assert_eq!(of("trace_eye")[0], 1.0, "and is traced in the first round");
    assert!(of("trace_eye").windows(2).all(|pair| pair[0] >= pair[1]), "no path comes back to life");
    let walk_rays = (run.measured.rays.primary + run.measured.rays.secondary + run.measured.rays.deep) as f64;
    let traced = walk_rays / run.measured.samples as f64;
    assert!((kernel("trace_eye").entries_per_sample / traced - 1.0).abs() < 1e-9, "a ray a path traced");
    let ended: f64 = ["shade", "escape"].iter().filter_map(|name| profile.occupancy.get(*name)).flatten().sum();
    assert!((ended / traced - 1.0).abs() < 1e-9, "what is traced hits or misses");
    let visibility = run.measured.rays.visibility as f64 / run.measured.samples as f64;
    let resolved: f64 = of("resolve_connection").iter().sum();
    let records = kernel("resolve_connection").queue_bytes_per_sample / resolved;
    assert!((records - 44.0).abs() < 1e-9, "{records} bytes a record: origin, direction, distance, light, pixel");
    assert!((resolved / visibility - 1.0).abs() < 1e-9, "a ray a connection");
    for kernel in &profile.kernels {
        assert!(kernel.compile_seconds > 0.0 && kernel.spirv_bytes > 100, "{kernel:?}");
        let state = kernel.entries_per_sample * f64::from(kernel.load_bytes + kernel.store_bytes);
        assert!(kernel.state_bytes_per_sample >= state, "what moves on comes on top: {kernel:?}");
        assert_eq!(kernel.gb_per_s.is_some(), kernel.bytes_per_sample() > 0.0, "{kernel:?}");
        assert!(kernel.gb_per_s.is_none_or(|rate| rate > 0.0 && rate.is_finite()));
    }
}

/// What a browser makes of a page: pictures that it shows, texts that stick out of their drawings, what the slider does.
const LOOK: &str = r#"
    const images = [...document.images];
    const outside = [...document.querySelectorAll("svg")].flatMap((svg) => {
        const frame = svg.getBoundingClientRect();
        const sticksOut = (text) => {
            const box = text.getBoundingClientRect();
            return Math.min(frame.left, box.left) !== frame.left || Math.max(frame.right, box.right) !== frame.right;
        };
        return [...svg.querySelectorAll("text")].filter(sticksOut).map((text) => text.textContent);
    });
    const box = document.querySelector(".compare");
    const [left, right] = box.querySelectorAll("img");
    const slider = box.querySelector("input");
    const before = { left: left.alt, right: right.alt, clip: getComputedStyle(right).clipPath };
    slider.value = "25";
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    const select = box.querySelectorAll("select")[1];
    select.selectedIndex = select.options.length - 1;
    select.dispatchEvent(new Event("input", { bubbles: true }));
    const chosen = document.getElementById(select.value);
    const after = { right: right.alt, clip: getComputedStyle(right).clipPath, same: right.src === chosen.src };
    return {
        images: images.length,
        loaded: images.filter((image) => image.complete && image.naturalWidth === 16).length,
        requests: performance.getEntriesByType("resource").map((entry) => entry.name).filter((name) => !name.startsWith("data:")),
        charts: document.querySelectorAll("svg.chart").length,
        states: [...document.querySelectorAll("svg.state")].map((svg) => svg.querySelectorAll("rect.field").length),
        outside,
        before,
        after,
    };
"#;

#[test]
fn the_report_opens_in_a_browser() {
    let folder = Folder::new("browser");
    let axes = "[axes]\nlayout = [\"aos\", \"soa\"]\n[defaults]\npipeline = \"nee\"\n";
    let scene =
        "[[scene]]\nname = \"cornell_box\"\nsize = [16, 16]\nspp = 4\nreference_variant = \"aos\"\nreference_spp = 8\n";
    run_small(&folder, &format!("title = \"Browser\"\n{axes}{scene}"));
    let Some(found) = browser::evaluate(&folder.0.join("report.html"), LOOK) else {
        eprintln!("SKIPPED: no Chromium is installed; the report is not opened");
        return;
    };
    assert_eq!(found["problems"], json!([]));
    assert_eq!(found["requests"], json!([]), "the page needs no network and no file beside it");
    assert_eq!(found["outside"], json!([]), "texts stick out of their drawings");
    assert_eq!((&found["images"], &found["loaded"]), (&json!(7), &json!(7)), "5 figures and the slider's two");
    assert_eq!(found["before"], json!({ "left": "reference", "right": "aos", "clip": "inset(0px 0px 0px 50%)" }));
    assert_eq!(found["after"], json!({ "right": "soa, difference", "clip": "inset(0px 0px 0px 25%)", "same": true }));
    let states = found["states"].as_array().expect("a list");
    assert!(states.len() == 2 && states.iter().all(|fields| fields.as_u64() > Some(5)), "{states:?}");
    assert!(found["charts"].as_u64() > Some(10), "{}", found["charts"]);
}

#[test]
fn a_tuned_config_renders() {
    let folder = Folder::new("tune");
    fs::create_dir_all(&folder.0).expect("the temporary folder is writable");
    let run = |arguments: &[&str]| {
        let output = Command::new(program()).current_dir(&folder.0).args(arguments).output().expect("the program runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).expect("one JSON object")
    };
    let search = "study --tune cornell_box --pipeline nee --layouts aos,soa --schedules wavefront,inline --size 16x16 \
                  --set max_edges=3 --budget 3 -o tuned --json";
    let tuned = &run(&search.split_whitespace().collect::<Vec<_>>())["scenes"][0];
    let candidates = tuned["candidates"].as_array().expect("a list");
    let rounds: u64 = candidates.iter().filter_map(|candidate| candidate["rounds"].as_u64()).sum();
    assert!(candidates.len() == 4 && (1..=6).contains(&rounds), "all once, then two of them: {tuned}");
    let best = &candidates[0];
    assert!(best["ms_per_msample"].as_f64().is_some_and(|time| time > 0.0), "{tuned}");
    assert_eq!((&best["layout"], &best["schedule"]), (&tuned["layout"], &tuned["schedule"]));

    let rendered = run(&["render", "tuned/cornell_box.toml", "--spp", "1", "-o", "tuned.exr", "--json"]);
    let variant = &rendered["variant"];
    assert_eq!((&variant["layout"], &variant["schedule"]), (&tuned["layout"], &tuned["schedule"]));
    assert_eq!((&variant["pipeline"], &variant["size"]), (&json!("nee"), &json!([16, 16])));
    assert_eq!(rendered["rejected"], 0);
}

#[test]
fn a_stopped_study_goes_on() {
    let folder = Folder::new("stopped");
    let mut listener = Listener { stop_after: Some(2), ..Listener::default() };
    let stopped = run_in(&folder.0, SMALL, &mut listener).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((stopped.stopped, stopped.rendered, stopped.results.runs.len()), (true, 2, 1));
    let (rest, _) = run_small(&folder, SMALL);
    assert_eq!((rest.stopped, rest.rendered, rest.results.runs.len()), (false, 3, 4));
}

#[test]
fn repetitions_have_seeds_of_their_own() {
    let folder = Folder::new("repeat");
    // No time is known so well: it ends after the third.
    let repeat = "repeat = { at_least = 2, at_most = 3, within = 1e-9 }";
    let (outcome, _) = run_small(&folder, &SMALL.replace("[defaults]", &format!("{repeat}\n[defaults]")));
    let runs = outcome.results.of("slit_room", "nee");
    assert_eq!(runs.len(), 3);
    assert_ne!(runs[0].mean, runs[1].mean);
    assert_ne!(runs[0].picture, runs[1].picture);
    assert!(folder.text("report.html").contains(" ± "));
}

#[test]
fn a_study_of_strategies_shows_their_pyramids() {
    let folder = Folder::new("strategies");
    let variant = "[[variant]]\nname = \"all\"\npipeline = \"sbdpt\"\naov = [\"strategies\"]\n";
    let scene = "[[scene]]\nname = \"cornell_box\"\nsize = [16, 16]\nspp = 2\nset = { max_edges = 3 }\n";
    let (outcome, _) = run_small(&folder, &format!("title = \"Pyramids\"\n{variant}{scene}"));
    let picture = folder.0.join(&outcome.results.runs[0].picture);
    for file in pyramid::files(&picture) {
        assert!(file.is_file(), "{} is not there", file.display());
        let name = file.file_name().expect("the name of a file").to_string_lossy();
        assert!(folder.text("report.html").contains(&*name), "the report lacks {name}");
    }
}

#[track_caller]
fn refused(test: &str, text: &str, words: &[&str]) {
    let folder = Folder::new(test);
    let error = run_in(&folder.0, text, &mut Listener::default()).expect_err("the study is refused");
    let said = error.to_string();
    assert_eq!(error.exit_code(), 2, "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "`{word}` is not in: {said}"));
}

#[test]
fn broken_studies_are_refused() {
    refused("key", &SMALL.replace("spp  = 2", "sp = 2"), &["small.toml", "unknown field `sp`"]);
    refused(
        "pipeline",
        &SMALL.replace("\"nee\"\npipeline = \"nee\"", "\"nee\"\npipeline = \"ne\""),
        &["no pipeline named `ne`"],
    );
    refused("reference", &SMALL.replace("= \"pt <b>\"\nreference", "= \"ptt\"\nreference"), &["no variant `ptt`"]);
    refused("set", &SMALL.replace("max_edges = 3", "max_egdes = 3"), &["K0110", "max_egdes", "slit_room"]);
    refused("layer", &SMALL.replace("spp  = 2", "spp = 2\naov = [\"normals\"]"), &["normals", "`variance`"]);
    refused(
        "strategies",
        &SMALL.replace("spp  = 2", "spp = 2\naov = [\"strategies\"]"),
        &["variant `pt <b>`", "the pipeline `pt` has no strategies to show"],
    );
    refused("scene", &SMALL.replace("\"slit_room\"", "\"slit_rom\""), &["there is no scene `slit_rom`"]);
}

#[test]
fn results_of_something_else_are_not_overwritten() {
    let folder = Folder::new("other");
    fs::create_dir_all(&folder.0).expect("the temporary folder is writable");
    fs::write(folder.0.join("results.json"), "[1, 2]").expect("the temporary folder is writable");
    let error = run_in(&folder.0, SMALL, &mut Listener::default()).expect_err("the folder is taken");
    assert_eq!((error.exit_code(), folder.text("results.json").as_str()), (2, "[1, 2]"));
}

/// Every effect that a scene may call for.
fn effects() -> Effects {
    let mut effects = RenderFile::default().load_scene().expect("the Cornell box is shipped").effects;
    effects.values_mut().for_each(|effect| effect.present = true);
    effects
}

#[test]
fn every_shipped_study_parses_and_its_variants_generate() {
    let effects = effects();
    assert!(!Axis::Study.names().is_empty(), "studies are shipped");
    let mut broken = Vec::new();
    let mut generated = Vec::new();
    for name in Axis::Study.names() {
        if let Err(error) = generate(name, &effects, &mut generated) {
            broken.push(format!("{name}: {error}"));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// Generates what a study renders, unless it is among what was `generated` for another scene or study.
fn generate(name: &str, effects: &Effects, generated: &mut Vec<Selection>) -> Result<(), String> {
    let study = Study::load(name).map_err(|error| error.to_string())?;
    for scene in &study.scenes {
        study.against(scene).map_err(|error| error.to_string())?;
        for variant in &study.variants {
            let wanted = study.wanted(variant, scene).map_err(|error| error.to_string())?;
            let mut library = Library::default();
            let selection =
                wanted.settings.selection(&mut library, effects.clone()).map_err(|error| error.to_string())?;
            if generated.contains(&selection) {
                continue;
            }
            kernelgen::generate(&library.sources, &selection)
                .map_err(|refusal| format!("variant `{}`: {}", variant.name, refusal.render(false)))?;
            generated.push(selection);
        }
    }
    Ok(())
}
