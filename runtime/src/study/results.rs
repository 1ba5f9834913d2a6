//! What a study found: `results.json`, which also tells what need not be rendered again, and `results.csv`.

use super::file::Wanted;
use crate::compare::bias::Bias;
use crate::compare::metrics::block_mse;
use crate::compare::{Image, block_z, check, metrics, zscore};
use crate::copy_rate::CopyRate;
use crate::error::Error;
use crate::image_file::replace;
use crate::kernel_profile::KernelProfile;
use crate::measurements::Measurements;
use crate::settings::SetValue;
use kernelgen::report::{Reason, Report, TableReport};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Side of the blocks whose means are compared, pixels.
const BLOCK: u32 = 8;
/// The file of results in the folder of a study.
pub const FILE: &str = "results.json";
/// The table beside it.
pub const TABLE: &str = "results.csv";

/// Everything that was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Heading of the study.
    pub title: String,
    /// What it shows.
    pub doc: String,
    /// Names of the variants, in order.
    pub variants: Vec<String>,
    /// Names of the scenes that are here, in order.
    pub scenes: Vec<String>,
    /// Scenes that are not.
    pub skipped: Vec<Skipped>,
    /// What pictures were measured against.
    pub references: Vec<Reference>,
    /// The device's copy rate; unknown where it has no timestamps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copy_rate: Option<CopyRate>,
    /// Where the state of each variant lives, scene by scene.
    #[serde(default)]
    pub states: Vec<State>,
    /// One entry a picture.
    pub runs: Vec<Run>,
}

/// A scene that was left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// Its name.
    pub scene: String,
    /// Why.
    pub reason: String,
}

/// Where the state of a variant lives on a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct State {
    /// Name of the scene.
    pub scene: String,
    /// Name of the variant.
    pub variant: String,
    /// Bytes a path, rays in flight left out where the layout keeps them apart.
    pub bytes_per_path: u32,
    /// Bytes of its rays in flight, where the layout keeps them apart.
    #[serde(default)]
    pub ray_bytes_per_path: u32,
    /// Its tables.
    pub tables: Vec<TableReport>,
    /// Fields that are stored nowhere, and why.
    pub dead: Vec<Reason>,
}

impl State {
    /// As the generator reports it.
    pub fn of(scene: &str, variant: &str, report: &Report) -> Self {
        Self {
            scene: scene.to_owned(),
            variant: variant.to_owned(),
            bytes_per_path: report.bytes_per_path,
            ray_bytes_per_path: report.ray_bytes_per_path,
            tables: report.tables.clone(),
            dead: report.dead.clone(),
        }
    }
}

/// What the pictures of a scene were measured against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// Name of the scene.
    pub scene: String,
    /// The picture; one that the study rendered lies in its folder.
    pub picture: String,
    /// How it was rendered, if by the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wanted: Option<Wanted>,
}

/// One picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Name of the scene.
    pub scene: String,
    /// Name of the variant.
    pub variant: String,
    /// Number of the repetition, from 0.
    pub repeat: u32,
    /// The EXR file, from the study's folder.
    pub picture: String,
    /// As asked for.
    pub wanted: Wanted,
    /// Cost.
    pub measured: Measurements,
    /// Mean radiance of the picture by channel, W m^-2 sr^-1.
    pub mean: [f64; 3],
    /// Distance from the reference, where there is one.
    pub errors: Option<Errors>,
}

/// How far a picture is from its reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Mean squared difference over pixels and channels, (W m^-2 sr^-1)^2.
    pub mse: f64,
    /// Mean of the squared difference over the squared reference (plus 0.01).
    pub relmse: f64,
    /// Mean FLIP error, 0 to 1.
    pub flip: f64,
    /// Mean over the reference's mean, by channel; `None` where that is black.
    pub mean_ratio: [Option<f64>; 3],
    /// Largest z-score of the means of 8 x 8 pixels; `None` without standard errors.
    pub max_block_z: Option<f64>,
    /// Mean squared difference of the means of 8 x 8 pixels, (W m^-2 sr^-1)^2.
    pub block_mse: f64,
    /// That times the seconds of rendering: what is left after one second, where the error is noise alone.
    pub block_mse_seconds: f64,
    /// How far its mean is off; `None` where the reference is black.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias: Option<Bias>,
}

impl Run {
    /// Variance of one sample of a pixel over the squared mean radiance, mean over pixels; unknown before the second batch.
    pub fn variance(&self) -> Option<f64> {
        let error = self.measured.relative_error?;
        Some(error.powi(2) * f64::from(self.measured.samples_per_pixel))
    }

    /// Seconds after which noise and what is certain of the bias together are this part of the mean radiance; `None` where bias alone
    /// is more, or noise unknown.
    pub fn seconds_to(&self, relative: f64) -> Option<f64> {
        let bias = self.errors.as_ref().and_then(|errors| errors.bias).map_or(0.0, |bias| bias.certain());
        let room = relative.powi(2) - bias.powi(2);
        let noise = self.measured.relative_error?.powi(2);
        (room > 0.0).then(|| self.measured.seconds * noise / room)
    }
}

impl Errors {
    /// Of a picture that took so many seconds.
    ///
    /// # Errors
    /// User input when the sizes differ, failed when a pixel is not finite.
    pub fn of(image: &Image, reference: &Image, seconds: f64) -> Result<Self, Error> {
        check(("picture", image), ("reference", reference))?;
        let metrics = metrics(image, reference);
        let block_mse = block_mse(image, reference, BLOCK);
        Ok(Self {
            mse: metrics.mse,
            relmse: metrics.relmse,
            flip: metrics.flip,
            mean_ratio: metrics.mean_ratio,
            max_block_z: block_z(image, reference, BLOCK).as_deref().map(zscore::largest),
            block_mse,
            block_mse_seconds: block_mse * seconds,
            bias: Bias::of(image, reference),
        })
    }

    /// Mean of the ratios of the channels; `None` when all are black.
    pub fn ratio(&self) -> Option<f64> {
        let known: Vec<f64> = self.mean_ratio.iter().flatten().copied().collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }
}

impl Results {
    /// The results in a folder; none when it has no such file.
    ///
    /// # Errors
    /// User input, when the file is something else.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(Self::default());
        }
        let unusable = |error: String| {
            Error::input(format!("this does not hold the results of a study: {error}"))
                .in_file(&path)
                .help("another folder, `-o DIR`; or delete the file, and everything is rendered again")
        };
        let text = std::fs::read_to_string(&path).map_err(|error| unusable(error.to_string()))?;
        serde_json::from_str(&text).map_err(|error| unusable(error.to_string()))
    }

    /// Writes both files into a folder, to other names first so that they are never half written.
    ///
    /// # Errors
    /// Failed, when they cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        let json = serde_json::to_string_pretty(self)
            .map_err(|error| Error::failed(format!("cannot write the results as JSON: {error}")))?;
        write_text(&folder.join(FILE), &format!("{json}\n"))?;
        write_text(&folder.join(TABLE), &self.csv())
    }

    /// One row a run under a row of names; what is unknown is empty.
    pub fn csv(&self) -> String {
        let header: Vec<String> = COLUMNS.iter().map(|(name, _)| (*name).to_owned()).collect();
        let rows = self.runs.iter().map(|run| COLUMNS.iter().map(|(_, value)| quoted(&value(run))).collect());
        std::iter::once(header).chain(rows).map(|row: Vec<String>| row.join(",") + "\n").collect()
    }

    /// The runs of a variant on a scene, one a repetition.
    pub fn of<'a>(&'a self, scene: &str, variant: &str) -> Vec<&'a Run> {
        self.runs.iter().filter(|run| run.scene == scene && run.variant == variant).collect()
    }

    /// What the pictures of a scene were measured against.
    pub fn reference(&self, scene: &str) -> Option<&Reference> {
        self.references.iter().find(|reference| reference.scene == scene)
    }
}

/// Writes a text by way of another name.
///
/// # Errors
/// Failed, with the path.
pub fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    replace(path, |temporary| std::fs::write(temporary, text).map_err(|error| error.to_string()))
}

/// A column of the table: its name and how it is read off a run.
type Column = (&'static str, fn(&Run) -> String);

const COLUMNS: &[Column] = &[
    ("scene", |run| run.scene.clone()),
    ("variant", |run| run.variant.clone()),
    ("repeat", |run| run.repeat.to_string()),
    ("pipeline", |run| word(&run.wanted.settings.pipeline)),
    ("layout", |run| word(&run.wanted.settings.layout)),
    ("schedule", |run| word(&run.wanted.settings.schedule)),
    ("precision", |run| word(&run.wanted.settings.precision)),
    ("set", set),
    ("width", |run| run.measured.variant.size.map_or(String::new(), |size| size[0].to_string())),
    ("height", |run| run.measured.variant.size.map_or(String::new(), |size| size[1].to_string())),
    ("samples_per_pixel", |run| run.measured.samples_per_pixel.to_string()),
    ("samples", |run| run.measured.samples.to_string()),
    ("seconds", |run| run.measured.seconds.to_string()),
    ("ms_per_msample", |run| run.measured.ms_per_msample().to_string()),
    ("ms_per_frame", |run| run.measured.ms_per_frame().to_string()),
    ("msamples_per_s", |run| run.measured.msamples_per_s.to_string()),
    ("rays_primary", |run| run.measured.rays.primary.to_string()),
    ("rays_secondary", |run| run.measured.rays.secondary.to_string()),
    ("rays_deep", |run| run.measured.rays.deep.to_string()),
    ("rays_visibility", |run| run.measured.rays.visibility.to_string()),
    ("mrays_per_s_primary", |run| run.measured.mrays_per_s.primary.to_string()),
    ("mrays_per_s_secondary", |run| run.measured.mrays_per_s.secondary.to_string()),
    ("mrays_per_s_deep", |run| run.measured.mrays_per_s.deep.to_string()),
    ("mrays_per_s_visibility", |run| run.measured.mrays_per_s.visibility.to_string()),
    ("device_ms_per_pass", |run| number(run.measured.ms_per_pass.as_ref().map(|times| times.values().sum()))),
    ("device_ms_per_msample", |run| kernels(run, KernelProfile::ms_per_msample)),
    ("bytes_per_path", |run| run.measured.bytes_per_path.to_string()),
    ("ray_bytes_per_path", |run| run.measured.ray_bytes_per_path.to_string()),
    ("bytes_moved_per_sample", |run| kernels(run, |kernels| Some(kernels.bytes_per_sample()))),
    ("gb_per_s", |run| kernels(run, KernelProfile::gb_per_s)),
    ("compile_seconds", |run| kernels(run, |kernels| Some(kernels.compile_seconds))),
    ("spirv_bytes", |run| kernels(run, |kernels| Some(kernels.spirv_bytes() as f64))),
    ("rejected", |run| run.measured.rejected.to_string()),
    ("mean_r", |run| run.mean[0].to_string()),
    ("mean_g", |run| run.mean[1].to_string()),
    ("mean_b", |run| run.mean[2].to_string()),
    ("relative_error", |run| number(run.measured.relative_error)),
    ("mse", |run| error(run, |errors| Some(errors.mse))),
    ("relmse", |run| error(run, |errors| Some(errors.relmse))),
    ("flip", |run| error(run, |errors| Some(errors.flip))),
    ("mean_ratio_r", |run| error(run, |errors| errors.mean_ratio[0])),
    ("mean_ratio_g", |run| error(run, |errors| errors.mean_ratio[1])),
    ("mean_ratio_b", |run| error(run, |errors| errors.mean_ratio[2])),
    ("max_block_z", |run| error(run, |errors| errors.max_block_z)),
    ("block_mse", |run| error(run, |errors| Some(errors.block_mse))),
    ("block_mse_seconds", |run| error(run, |errors| Some(errors.block_mse_seconds))),
    ("bias", |run| error(run, |errors| Some(errors.bias?.relative))),
    ("bias_half_width", |run| error(run, |errors| errors.bias?.half_width)),
    ("variance", |run| number(run.variance())),
    ("seconds_to_1_percent", |run| number(run.seconds_to(0.01))),
    ("adapter", |run| run.measured.adapter.clone()),
    ("picture", |run| run.picture.clone()),
];

fn word(word: &Option<String>) -> String {
    word.clone().unwrap_or_default()
}

fn set(run: &Run) -> String {
    let words = |(key, value): (&String, &SetValue)| format!("{key}={}", value.word());
    run.wanted.settings.set.iter().map(words).collect::<Vec<_>>().join(" ")
}

fn number(value: Option<f64>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

fn kernels(run: &Run, value: fn(&KernelProfile) -> Option<f64>) -> String {
    number(run.measured.kernel_profile.as_ref().and_then(value))
}

fn error(run: &Run, value: fn(&Errors) -> Option<f64>) -> String {
    number(run.errors.as_ref().and_then(value))
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}

/// Where the picture of the difference from the reference lies beside a picture.
pub fn difference_path(picture: &Path) -> PathBuf {
    picture.with_extension("difference.png")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_with_commas_and_quotes_are_quoted() {
        assert_eq!(quoted("a, \"b\""), "\"a, \"\"b\"\"\"");
        assert_eq!(quoted("plain"), "plain");
    }

    #[test]
    fn a_table_without_runs_has_its_header() {
        let csv = Results::default().csv();
        assert!(csv.starts_with("scene,variant,repeat,") && csv.lines().count() == 1);
    }
}
