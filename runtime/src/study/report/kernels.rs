//! What each kernel costs, and how full the queues are.

use super::html::{element, section, table};
use crate::kernel_profile::{KernelMeasurements, KernelProfile};
use crate::study::chart::{Scale, escape, shown};
use crate::study::lines::{Line, LineChart};
use crate::study::results::Results;

/// Compares the kernels of all variants on a scene, then shows those of each.
pub fn section_of(results: &Results, scene: &str) -> String {
    let of = |variant: &String| results.of(scene, variant).first()?.measured.kernel_profile.as_ref();
    let profiles: Vec<(&String, &KernelProfile)> =
        results.variants.iter().filter_map(|variant| Some((variant, of(variant)?))).collect();
    if profiles.is_empty() {
        return String::new();
    }
    let doc = "Of the first repetition. Bytes are those that the generator predicts: path state, entries of queues, records of streams, \
               not what stages look up in the scene. GB/s are these bytes over the kernel's device time, beside their share of the device's copy rate. Queues are counted in passes of their own.";
    let copy_rate = results.copy_rate.as_ref().map(|rate| rate.gb_per_s);
    let mut inner = element("p", "", doc);
    inner += &compared(&profiles, "Device time, ms per million samples", &|kernel| kernel.ms_per_msample);
    inner += &compared(&profiles, "Moved, GB/s", &|kernel| kernel.gb_per_s);
    if let Some(copy_rate) = copy_rate {
        inner += &compared(&profiles, "Moved, share of the copy rate, %", &|kernel| {
            Some(100.0 * kernel.gb_per_s? / copy_rate)
        });
    }
    for (variant, profile) in profiles {
        inner += &of_variant(variant, profile, copy_rate);
    }
    section(&format!("Kernels, scene {scene}"), &inner)
}

/// A value of every kernel in every variant; nothing where it is known of none.
fn compared(
    profiles: &[(&String, &KernelProfile)],
    title: &str,
    value: &dyn Fn(&KernelMeasurements) -> Option<f64>,
) -> String {
    let mut names: Vec<&str> = Vec::new();
    for kernel in profiles.iter().flat_map(|(_, profile)| &profile.kernels) {
        if value(kernel).is_some() && !names.contains(&kernel.name.as_str()) {
            names.push(&kernel.name);
        }
    }
    if names.is_empty() {
        return String::new();
    }
    let of = |profile: &KernelProfile, name: &str| {
        let kernel = profile.kernels.iter().find(|kernel| kernel.name == name);
        kernel.and_then(value).map_or(String::new(), shown)
    };
    let row = |name: &&str| {
        ((*name).to_owned(), profiles.iter().map(|(_, profile)| of(profile, name)).collect::<Vec<String>>())
    };
    let variants: Vec<String> = profiles.iter().map(|(variant, _)| (*variant).clone()).collect();
    element("h3", "", &escape(title)) + &table("kernel", &variants, &names.iter().map(row).collect::<Vec<_>>())
}

fn of_variant(variant: &str, profile: &KernelProfile, copy_rate: Option<f64>) -> String {
    let columns = [
        "paths per sample",
        "bytes of state per sample",
        "bytes of queues and records per sample",
        "ms per million samples",
        "GB/s",
        "% of the copy rate",
        "compile time, s",
        "SPIR-V bytes",
    ];
    let known = |value: Option<f64>| value.map_or(String::new(), shown);
    let row = |kernel: &KernelMeasurements| {
        let share = kernel.gb_per_s.zip(copy_rate).map(|(rate, copy_rate)| 100.0 * rate / copy_rate);
        let cells = [
            shown(kernel.entries_per_sample),
            shown(kernel.state_bytes_per_sample),
            shown(kernel.queue_bytes_per_sample),
            known(kernel.ms_per_msample),
            known(kernel.gb_per_s),
            known(share),
            shown(kernel.compile_seconds),
            kernel.spirv_bytes.to_string(),
        ];
        (kernel.name.clone(), cells.to_vec())
    };
    let rows: Vec<_> = profile.kernels.iter().map(row).collect();
    let inner = element("summary", "", &escape(&format!("Kernels and queues of {variant}")))
        + &table("kernel", &columns.map(str::to_owned), &rows)
        + &occupancy(variant, profile);
    element("details", "", &inner)
}

/// Paths that wait for each kernel, round by round.
fn occupancy(variant: &str, profile: &KernelProfile) -> String {
    // A stream that is emptied once, behind the rounds, is a point.
    let points = |rounds: &[f64]| -> Vec<[f64; 2]> {
        let rounds = rounds.iter().enumerate().map(|(round, &paths)| [round as f64, paths]);
        rounds.skip_while(|point| point[1] == 0.0).collect()
    };
    let lines: Vec<Line> = profile
        .occupancy
        .iter()
        .filter(|(_, rounds)| rounds.len() > 1)
        .map(|(name, rounds)| Line { name: name.clone(), points: points(rounds), marks: points(rounds) })
        .collect();
    if lines.is_empty() {
        return String::new();
    }
    let title = format!("Occupancy of queues, {variant}");
    LineChart {
        title: &title,
        across: "round",
        unit: "paths, or records, per path slot",
        lines: &lines,
        scale: Scale::Linear,
    }
    .svg()
}
