//! Quantities of pictures, each as a table over variants and scenes and as a chart.

use super::html::{element, section, table};
use crate::kernel_profile::KernelProfile;
use crate::study::chart::{Chart, Scale, escape, shown};
use crate::study::interval::Interval;
use crate::study::results::{Errors, Results, Run};

/// A quantity that is shown for every variant and scene.
struct Measure {
    title: &'static str,
    unit: &'static str,
    /// What it says.
    doc: &'static str,
    value: fn(&Run) -> Option<f64>,
    chart: Option<Scale>,
}

const MEASURES: &[Measure] = &[
    Measure {
        title: "Frame time",
        unit: "ms",
        doc: "Wall-clock time for one sample of every pixel.",
        value: |run| Some(run.measured.ms_per_frame()),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Render time",
        unit: "s",
        doc: "Wall-clock time of the whole picture; loading and compilation are left out.",
        value: |run| Some(run.measured.seconds),
        chart: None,
    },
    Measure {
        title: "Samples",
        unit: "samples per pixel",
        doc: "Taken in that time.",
        value: |run| Some(f64::from(run.measured.samples_per_pixel)),
        chart: None,
    },
    Measure {
        title: "Sample rate",
        unit: "Msamples/s",
        doc: "One sample is one path from the camera, or one light path with all its eye walks.",
        value: |run| Some(run.measured.msamples_per_s),
        chart: None,
    },
    Measure {
        title: "Primary rays",
        unit: "Mrays/s",
        doc: "Camera rays over the time of the kernels that trace them.",
        value: |run| rate(run.measured.rays.primary, run.measured.mrays_per_s.primary),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Secondary rays",
        unit: "Mrays/s",
        doc: "Rays after the first scattering.",
        value: |run| rate(run.measured.rays.secondary, run.measured.mrays_per_s.secondary),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Deep rays",
        unit: "Mrays/s",
        doc: "Later rays of walks.",
        value: |run| rate(run.measured.rays.deep, run.measured.mrays_per_s.deep),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Visibility rays",
        unit: "Mrays/s",
        doc: "Shadow and connection rays.",
        value: |run| rate(run.measured.rays.visibility, run.measured.mrays_per_s.visibility),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Wall-clock time of samples",
        unit: "ms per million samples",
        doc: "What the frame time is for a picture of a million pixels.",
        value: |run| Some(run.measured.ms_per_msample()),
        chart: None,
    },
    Measure {
        title: "Device time of samples",
        unit: "ms per million samples",
        doc: "Sum over the kernels; what the wall clock has beyond it is waiting and launching.",
        value: |run| kernels_of(run).and_then(KernelProfile::ms_per_msample),
        chart: None,
    },
    Measure {
        title: "State",
        unit: "bytes per path",
        doc: "What is stored for a path between kernels, rays in flight left out where the layout keeps them apart.",
        value: |run| Some(f64::from(run.measured.bytes_per_path)),
        chart: None,
    },
    Measure {
        title: "Rays in flight",
        unit: "bytes per path",
        doc: "Of layouts that keep them apart.",
        value: |run| Some(f64::from(run.measured.ray_bytes_per_path)).filter(|bytes| *bytes > 0.0),
        chart: None,
    },
    Measure {
        title: "Bytes moved",
        unit: "bytes per sample",
        doc: "What kernels load and store, as the generator predicts: path state, entries of queues, records of streams, times the paths that they took and sent on. What stages look up in the scene is left out.",
        value: |run| kernels_of(run).map(KernelProfile::bytes_per_sample),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Rate of memory",
        unit: "GB/s",
        doc: "Bytes moved over the device time of all kernels; the tables of kernels show it one by one.",
        value: |run| kernels_of(run).and_then(KernelProfile::gb_per_s),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Compilation",
        unit: "s",
        doc: "Wall-clock time from WGSL to pipelines, all kernels side by side on all cores.",
        value: |run| kernels_of(run).map(|kernels| kernels.compile_seconds),
        chart: None,
    },
    Measure {
        title: "SPIR-V",
        unit: "bytes",
        doc: "Size of all kernels as the driver gets them.",
        value: |run| kernels_of(run).map(|kernels| kernels.spirv_bytes() as f64),
        chart: None,
    },
    Measure {
        title: "Mean radiance",
        unit: "W/(m² sr)",
        doc: "Mean over pixels and channels.",
        value: |run| Some(run.mean.iter().sum::<f64>() / 3.0),
        chart: None,
    },
    Measure {
        title: "Mean over the reference's mean",
        unit: "1",
        doc: "Mean of the ratios of the three channels; 1 where no energy is lost or gained.",
        value: |run| run.errors.as_ref().and_then(Errors::ratio),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Bias",
        unit: "1",
        doc: "Mean over pixels and channels, less the reference's, over the reference's.",
        value: |run| run.errors?.bias.map(|bias| bias.relative),
        chart: None,
    },
    Measure {
        title: "Half of the bias's interval",
        unit: "1",
        doc: "From the standard errors of both pictures, 95 %: less bias than this is noise.",
        value: |run| run.errors?.bias?.half_width,
        chart: None,
    },
    Measure {
        title: "Variance",
        unit: "1",
        doc: "Of one sample of a pixel, over the squared mean radiance; mean over pixels.",
        value: Run::variance,
        chart: Some(Scale::Logarithmic),
    },
    Measure {
        title: "Time to equal error",
        unit: "s",
        doc: "Until noise, and what is certain of the bias, are together 1 % of the mean radiance; empty where the bias alone is more.",
        value: |run| run.seconds_to(0.01),
        chart: Some(Scale::Logarithmic),
    },
    Measure {
        title: "Mean squared error",
        unit: "(W/(m² sr))²",
        doc: "Against the reference, over pixels and channels.",
        value: |run| run.errors.map(|errors| errors.mse),
        chart: None,
    },
    Measure {
        title: "Relative mean squared error",
        unit: "1",
        doc: "Squared difference over the squared reference (plus 0.01), mean over pixels and channels.",
        value: |run| run.errors.map(|errors| errors.relmse),
        chart: Some(Scale::Logarithmic),
    },
    Measure {
        title: "FLIP",
        unit: "1",
        doc: "Perceived difference from the reference, 0 to 1.",
        value: |run| run.errors.map(|errors| errors.flip),
        chart: Some(Scale::Linear),
    },
    Measure {
        title: "Squared error of block means",
        unit: "(W/(m² sr))²",
        doc: "Of the means of 8 x 8 pixels: fireflies of single pixels weigh less.",
        value: |run| run.errors.map(|errors| errors.block_mse),
        chart: None,
    },
    Measure {
        title: "Squared error of block means times time",
        unit: "(W/(m² sr))² s",
        doc: "The figure of merit at equal time, lower is better: noise falls with time as this over the seconds.",
        value: |run| run.errors.map(|errors| errors.block_mse_seconds),
        chart: Some(Scale::Logarithmic),
    },
    Measure {
        title: "Largest z-score of block means",
        unit: "standard errors",
        doc: "Beyond 6 a picture differs from its reference by more than its own noise.",
        value: |run| run.errors.and_then(|errors| errors.max_block_z),
        chart: None,
    },
    Measure {
        title: "Rejected",
        unit: "contributions",
        doc: "Not finite or negative; must be 0.",
        value: |run| Some(run.measured.rejected as f64),
        chart: None,
    },
];

fn kernels_of(run: &Run) -> Option<&KernelProfile> {
    run.measured.kernel_profile.as_ref()
}

/// A rate of rays that there are.
fn rate(rays: u64, mrays_per_second: f64) -> Option<f64> {
    (rays > 0).then_some(mrays_per_second)
}

/// Tables and charts of all quantities that were measured.
pub fn sections(results: &Results) -> String {
    MEASURES.iter().map(|measure| section_of(measure, results)).collect()
}

/// Table and chart of a measure; nothing where no run has it.
fn section_of(measure: &Measure, results: &Results) -> String {
    let values: Vec<Vec<Vec<f64>>> = results
        .variants
        .iter()
        .map(|variant| results.scenes.iter().map(|scene| repeated(measure, results, scene, variant)).collect())
        .collect();
    if values.iter().flatten().all(Vec::is_empty) {
        return String::new();
    }
    let cells = |of: &Vec<Vec<f64>>| of.iter().map(|values| cell(values)).collect();
    let rows: Vec<(String, Vec<String>)> = results.variants.iter().cloned().zip(values.iter().map(cells)).collect();
    let mut inner = table("variant", &results.scenes, &rows);
    if let Some(scale) = measure.chart {
        let chart = Chart {
            title: measure.title,
            unit: measure.unit,
            groups_are: "scene",
            groups: &results.scenes,
            series: &results.variants,
            values: values.iter().map(|of| of.iter().map(|values| mean(values)).collect()).collect(),
            scale,
        };
        inner += &chart.svg();
    }
    let inner = element("p", "", &escape(measure.doc)) + &element("div", "class=\"beside\"", &inner);
    section(&format!("{} [{}]", measure.title, measure.unit), &inner)
}

fn repeated(measure: &Measure, results: &Results, scene: &str, variant: &str) -> Vec<f64> {
    results.of(scene, variant).into_iter().filter_map(measure.value).collect()
}

fn mean(values: &[f64]) -> Option<f64> {
    Interval::of(values).map(|interval| interval.mean)
}

/// The mean of the repetitions, with half its 95 % confidence interval where there are several.
fn cell(values: &[f64]) -> String {
    match Interval::of(values) {
        Some(Interval { mean, half_width: Some(half_width) }) if half_width > 0.0 => {
            format!("{} ± {}", shown(mean), shown(half_width))
        }
        Some(Interval { mean, .. }) => shown(mean),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repetitions_show_their_spread() {
        assert_eq!([cell(&[]), cell(&[2.0]), cell(&[2.0, 2.0]), cell(&[1.0, 3.0])], ["", "2", "2", "2 ± 12.71"]);
    }
}
