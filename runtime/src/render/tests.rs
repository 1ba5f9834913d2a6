//! The executor on a plan written by hand, on whatever adapter there is.

use super::*;
use crate::device::DeviceOptions;
use crate::film::Sums;
use kernelgen::config::model::{Accumulate, RayKind};
use kernelgen::plan::{Access, Binding, Buffer, Counter, EntryWords, Kernel, Needs, OVERRIDES, SLOT_GRAIN, Size, Step};

const HEADER: &str = "
override path_count: u32;
override picture_width: u32;
override picture_height: u32;
struct Pass { first_pixel: u32, first_sample: u32, active_slots: u32, seed: u32, unused: vec4u }
@group(0) @binding(0) var<storage, read_write> control: array<atomic<u32>>;
@group(0) @binding(1) var<uniform> pass_info: Pass;
fn hash(x: u32) -> u32 { var h = x * 747796405u + 2891336453u; h = ((h >> ((h >> 28u) + 4u)) ^ h) * 277803737u; return (h >> 22u) ^ h; }
";

/// Red is 1 + the sample number, green the pixel, blue uniform in [0, 1).
const EMIT: &str = "
fn emit_at(index: u32) {
    let linear = pass_info.first_pixel + index;
    let pixels = picture_width * picture_height;
    let sample = pass_info.first_sample + linear / pixels;
    let pixel = linear % pixels;
    let random = f32(hash(hash(pixel) + sample + pass_info.seed) >> 8u) * 0x1p-24;
    add(pixel * 3u, f32(1u + sample)); add(pixel * 3u + 1u, f32(pixel)); add(pixel * 3u + 2u, random);
    atomicAdd(&control[1], 1u);
    if index >= path_count { atomicAdd(&control[4], 1u); }
}
@compute @workgroup_size(64)
fn emit_main(@builtin(global_invocation_id) id: vec3u) { if id.x < pass_info.active_slots { emit_at(id.x); } }
";

fn kernel(name: &str, text: String, bindings: &[(usize, Access)], rays: Option<RayKind>) -> Kernel {
    let bindings = bindings.iter().enumerate();
    Kernel {
        name: name.to_owned(),
        entry: format!("{name}_main"),
        module: format!("{HEADER}{text}"),
        overrides: OVERRIDES.map(str::to_owned).to_vec(),
        bindings: bindings
            .map(|(binding, &(buffer, access))| Binding { binding: binding as u32, buffer, access })
            .collect(),
        workgroup: 64,
        stages: Vec::new(),
        load_bytes: 0,
        store_bytes: 0,
        moved_bytes: 0,
        entry_bytes: 0,
        rays,
    }
}

fn plan(film: Accumulate) -> Plan {
    let fixed = film == Accumulate::FixedI64;
    let (ty, add, bytes) = if fixed {
        ("i64", "atomicAdd(&film[word], i64(round(value * 16777216.0)));", 24)
    } else {
        ("f32", "atomicAdd(&film[word], value);", 12)
    };
    let buffer = |name: &str, role, fixed, per_path, per_pixel| Buffer {
        name: name.to_owned(),
        role,
        size: Size { fixed, per_path, per_pixel },
    };
    let film_text = format!(
        "@group(0) @binding(2) var<storage, read_write> film: array<atomic<{ty}>>;\nfn add(word: u32, value: f32) {{ {add} }}"
    );
    let arguments = "@group(0) @binding(2) var<storage, read_write> arguments: array<u32>;
        @compute @workgroup_size(1) fn arm_main() { arguments[3] = (atomicLoad(&control[1]) + 63u) / 64u; arguments[4] = 1u; arguments[5] = 1u; }";
    let clear = "@compute @workgroup_size(8) fn clear_main(@builtin(local_invocation_index) lane: u32) { atomicStore(&control[lane], 0u); }";
    let deep = "@group(0) @binding(2) var<storage, read_write> state: array<u32>;
        @compute @workgroup_size(64) fn deep_main(@builtin(global_invocation_id) id: vec3u) {
            if id.x < atomicLoad(&control[1]) { state[id.x] += pass_info.seed; atomicAdd(&control[2], 1u); } }";
    let base = [(0, Access::ReadWrite), (1, Access::Uniform)];
    let with = |more: usize| [base[0], base[1], (more, Access::ReadWrite)];
    let counter = |name: &str, word| Counter { name: name.to_owned(), word, shift: 0 };
    Plan {
        buffers: vec![
            buffer("control", Role::Control, 64, 0, 0),
            buffer("pass_info", Role::Pass, 32, 0, 0),
            buffer("film", Role::Film, 0, 0, bytes),
            buffer("arguments", Role::Arguments, 24, 0, 0),
            buffer("state", Role::State, 0, 4, 0),
        ],
        kernels: vec![
            kernel("clear", clear.to_owned(), &base, None),
            kernel("emit", format!("{film_text}{EMIT}"), &with(2), Some(RayKind::Walk)),
            kernel("arm", arguments.to_owned(), &with(3), None),
            kernel("deep", deep.to_owned(), &with(4), Some(RayKind::Visibility)),
        ],
        program: vec![
            Step::Single { kernel: 0 },
            Step::Dispatch { kernel: 1, slots: 64 },
            Step::Single { kernel: 2 },
            Step::Loop { turns: vec![2], body: vec![Step::Indirect { kernel: 3, slot: 1 }] },
        ],
        counters: vec![counter("rays_primary", 1), counter("rays_visibility", 2), counter("overflow", 4)],
        // `deep` takes as many as `emit` has counted.
        entries: EntryWords { first: 0, stride: 1 },
        pushed_bytes: Vec::new(),
        dense: None,
        tallies: Vec::new(),
        layers: Vec::new(),
        film,
        bytes_per_path: 4,
        ray_bytes_per_path: 0,
        slots_per_grain: SLOT_GRAIN,
        paths_per_slot: 1,
        needs: Needs { subgroup: false, int64_atomics: fixed, float32_atomics: !fixed },
    }
}

const SIZE: [u32; 2] = [70, 30];

fn settings(paths: u32) -> Settings {
    Settings { size: SIZE, seed: 7, paths: Some(paths) }
}

fn gpu() -> Gpu {
    Gpu::open(&DeviceOptions::default()).expect("an adapter")
}

fn nothing<'a>(_: &str) -> Option<&'a [u8]> {
    None
}

#[test]
fn every_sample_of_every_pixel_is_taken_once() {
    for paths in [1024, 4096, 1 << 16] {
        let rendered = render(&gpu(), &plan(Accumulate::AtomicF32), &nothing, settings(paths), 24).expect("a picture");
        let pixels = u64::from(SIZE[0] * SIZE[1]);
        assert_eq!(rendered.counters.primary, pixels * 24);
        assert_eq!(rendered.counters.visibility, 2 * pixels * 24);
        assert_eq!(rendered.totals.samples, 24);
        assert!(rendered.totals.batches >= 8);
        for (pixel, value) in rendered.mean.chunks_exact(3).enumerate() {
            assert!((value[0] - 12.5).abs() < 1e-4, "samples 1 to 24 have the mean 12.5, not {}", value[0]);
            assert!((value[1] - pixel as f32).abs() < 1e-2);
        }
    }
}

#[test]
fn a_pass_uses_no_more_slots_than_its_plan_allows() {
    let plan = Plan { slots_per_grain: 100, ..plan(Accumulate::FixedI64) };
    let session = Session::new(&gpu(), &plan, &nothing, settings(4096), Some(3)).expect("a session");
    assert_eq!((session.slots, session.pass_limit), (400, 400));
    let few = render(&gpu(), &plan, &nothing, settings(4096), 3).expect("a picture");
    let all = Plan { slots_per_grain: SLOT_GRAIN, ..plan };
    assert_eq!(few.totals.sums, render(&gpu(), &all, &nothing, settings(4096), 3).expect("a picture").totals.sums);
}

#[test]
fn standard_errors_are_those_of_uniform_numbers() {
    let rendered = render(&gpu(), &plan(Accumulate::AtomicF32), &nothing, settings(4096), 64).expect("a picture");
    let errors = rendered.standard_error.expect("errors");
    let square: f64 = errors.iter().skip(2).step_by(3).map(|&error| f64::from(error).powi(2)).sum();
    let mean_square = square / f64::from(SIZE[0] * SIZE[1]);
    let expected = 1.0 / 12.0 / 64.0;
    assert!((mean_square / expected - 1.0).abs() < 0.05, "{mean_square} against {expected}");
    assert!(errors.iter().skip(1).step_by(3).all(|&error| error < 1e-3), "green has no variance");
}

#[test]
fn a_fixed_film_does_not_depend_on_passes_and_resumes_exactly() {
    let (gpu, plan) = (gpu(), plan(Accumulate::FixedI64));
    let whole = render(&gpu, &plan, &nothing, settings(1 << 16), 20).expect("a picture");
    let part = render(&gpu, &plan, &nothing, settings(1024), 9).expect("a picture");
    let mut session = Session::new(&gpu, &plan, &nothing, settings(2048), None).expect("a session");
    session.resume(&part.totals).expect("room");
    session.run(Until::Samples(20), &mut |_| true).expect("the rest");
    let resumed = session.picture().expect("a picture");
    assert!(matches!(&resumed.totals.sums, Sums::Fixed(sums) if sums.iter().any(|&sum| sum > 0)));
    assert_eq!(resumed.totals.sums, whole.totals.sums);
    assert_eq!((resumed.samples_taken, resumed.totals.samples), (11, 20));
}

#[test]
fn time_and_interruption_stop_at_whole_samples() {
    let (gpu, plan) = (gpu(), plan(Accumulate::FixedI64));
    let mut session = Session::new(&gpu, &plan, &nothing, settings(1024), None).expect("a session");
    session.run(Until::Seconds(0.2), &mut |_| true).expect("a render");
    session.run(Until::Samples(1_000_000), &mut |_| false).expect("a render");
    let picture = session.picture().expect("a picture");
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    assert!(picture.totals.samples > 0 && picture.totals.samples < 1_000_000);
    assert_eq!(picture.counters.primary, pixels * u64::from(picture.totals.samples));
}

#[test]
fn rates_come_from_measured_passes() {
    let rendered = render(&gpu(), &plan(Accumulate::AtomicF32), &nothing, settings(1024), 8).expect("a picture");
    let rates = rendered.profile.mrays_per_second(&rendered.counters, rendered.seconds);
    assert!(rates.primary > 0.0 && rates.visibility > 0.0);
    assert_eq!(rendered.profile.kernel_milliseconds().len(), 4);
}

#[test]
fn a_warm_up_leaves_no_trace() {
    let (gpu, plan) = (gpu(), plan(Accumulate::FixedI64));
    let cold = render(&gpu, &plan, &nothing, settings(1024), 5).expect("a picture");
    let mut session = Session::new(&gpu, &plan, &nothing, settings(1024), Some(5)).expect("a session");
    session.warm_up(Until::Samples(5)).expect("a warm-up");
    session.run(Until::Samples(5), &mut |_| true).expect("a render");
    let warm = session.picture().expect("a picture");
    assert_eq!((warm.totals.sums, warm.counters), (cold.totals.sums, cold.counters));
    assert!(warm.profile.passes > 0);
}

#[test]
fn a_short_run_can_take_full_passes() {
    let small = Settings { size: [16, 16], ..settings(4096) };
    let first_batch = |full: bool| {
        let plan = plan(Accumulate::AtomicF32);
        let mut session = Session::new(&gpu(), &plan, &nothing, small, None).expect("a session");
        if full {
            session.take_full_passes();
        }
        session.run(Until::Seconds(0.0), &mut |_| true).expect("a render");
        session.picture().expect("a picture").totals.samples
    };
    assert_eq!((first_batch(false), first_batch(true)), (1, 16));
}

#[test]
fn entries_are_counted_round_by_round() {
    let mut plan = plan(Accumulate::AtomicF32);
    plan.kernels[1].stages = vec!["emit".to_owned()];
    let mut session = Session::new(&gpu(), &plan, &nothing, settings(1024), Some(2)).expect("a session");
    session.run(Until::Samples(2), &mut |_| true).expect("a render");
    let occupancy = session.occupancy().expect("the device is there");
    // 2100 pixels in passes of 1024 slots: two are full, the third has the rest.
    assert_eq!((occupancy.slots, occupancy.passes), (2100, 3));
    assert_eq!(occupancy.entries, [vec![], vec![2100], vec![], vec![2100, 2100]], "`deep` takes all, in both rounds");
}

#[test]
fn what_does_not_fit_is_refused() {
    let gpu = gpu();
    let plan = plan(Accumulate::AtomicF32);
    let error =
        Session::new(&gpu, &plan, &nothing, Settings { size: [0, 4], ..settings(1024) }, None).expect_err("empty");
    assert_eq!(error.exit_code(), 2);
    let error = Session::new(&gpu, &plan, &nothing, settings(0), None).expect_err("no paths");
    assert!(error.to_string().contains("--paths 0"));
}
