//! The error that is left after a time, bias and noise together: which variant is ahead when.

use super::html::{element, section};
use crate::study::chart::Scale;
use crate::study::lines::{Line, LineChart};
use crate::study::results::{Results, Run};

/// Times are shown from this part of the shortest to this multiple of the longest.
const AROUND: f64 = 16.0;
/// Points of a line.
const POINTS: u32 = 48;

/// The plot of a scene; nothing without a reference.
pub fn section_of(results: &Results, scene: &str) -> String {
    let runs: Vec<&Run> = results.variants.iter().filter_map(|name| results.of(scene, name).first().copied()).collect();
    let models: Vec<(&Run, Model)> = runs.into_iter().filter_map(|run| Some((run, Model::of(run)?))).collect();
    let times = || models.iter().map(|(_, model)| model.seconds);
    if models.is_empty() {
        return String::new();
    }
    let (first, last) = (times().fold(f64::INFINITY, f64::min) / AROUND, times().fold(0.0, f64::max) * AROUND);
    let line = |(run, model): &(&Run, Model)| Line {
        name: run.variant.clone(),
        points: (0..=POINTS)
            .map(|point| first * (last / first).powf(f64::from(point) / f64::from(POINTS)))
            .map(|seconds| [seconds, model.at(seconds)])
            .collect(),
        marks: vec![[model.seconds, model.at(model.seconds)]],
    };
    let lines: Vec<Line> = models.iter().map(line).collect();
    let doc = "Root of the squared bias and of the noise, over the mean radiance: noise falls as one over the root of time, bias stays. \
               Dots are the pictures of the first repetition. Where a line lies flat, more time does not help.";
    let chart = LineChart {
        title: scene,
        across: "seconds",
        unit: "error over the mean radiance",
        lines: &lines,
        scale: Scale::Logarithmic,
    };
    section(&format!("Error over time, scene {scene}"), &(element("p", "", doc) + &chart.svg()))
}

/// Bias and noise of a picture, over the mean radiance.
struct Model {
    seconds: f64,
    /// What is left of the bias beyond its confidence interval.
    bias: f64,
    noise: f64,
}

impl Model {
    fn of(run: &Run) -> Option<Self> {
        let bias = run.errors.as_ref()?.bias?;
        Some(Self { seconds: run.measured.seconds, bias: bias.certain(), noise: run.measured.relative_error? })
    }

    fn at(&self, seconds: f64) -> f64 {
        (self.bias.powi(2) + self.noise.powi(2) * self.seconds / seconds).sqrt()
    }
}
