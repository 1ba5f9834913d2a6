//! `pathloom emit`.

use super::input::{self, SceneArguments, VariantArguments};
use super::{Failure, print, print_json};
use clap::Args;
use kernelgen::Generated;
use runtime::error::Error;
use runtime::settings::Target;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Writes one WGSL file a kernel, `layout.txt` and `plan.json`.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// A pipeline (name or .toml file), a render file, or a rendered .exr
    #[arg(value_name = "VARIANT")]
    variant: String,
    #[command(flatten)]
    axes: VariantArguments,
    #[command(flatten)]
    scene: SceneArguments,
    /// The folder to write to; named after the variant when not given
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Generates and writes.
///
/// # Errors
/// User input, refused variants, files that cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let settings = input::variant(Some(&arguments.variant))?;
    let mut settings = arguments.scene.over(arguments.axes.over(settings)).with_defaults(Target::Gpu);
    let effects = input::effects(&settings)?;
    let generated = input::generate_settings(&mut settings, effects)?;
    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from(name(&generated)));
    let files = write(&folder, &generated)?;
    if arguments.json {
        let shown: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        print_json(&json!({ "folder": folder.display().to_string(), "files": shown }))?;
    } else {
        print(&format!("{} files in {}", files.len(), folder.display()))?;
    }
    Ok(())
}

fn name(generated: &Generated) -> String {
    let variant = &generated.variant;
    format!("{}_{}_{}_{}", variant.pipeline.name, variant.layout.name, variant.schedule.name, variant.precision.name)
}

fn write(folder: &Path, generated: &Generated) -> Result<Vec<PathBuf>, Error> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::failed(format!("cannot create the folder: {error}")).in_file(folder))?;
    let mut files = Vec::new();
    let mut file = |name: String, text: &str| {
        let path = folder.join(name);
        let written = std::fs::write(&path, text);
        files.push(path.clone());
        written.map_err(|error| Error::failed(format!("cannot write: {error}")).in_file(path))
    };
    for kernel in &generated.plan.kernels {
        file(format!("{}.wgsl", kernel.name), &kernel.module)?;
    }
    file("layout.txt".to_owned(), &generated.report.text())?;
    file("plan.json".to_owned(), &plan(generated)?)?;
    Ok(files)
}

/// The plan with the names of the kernels' files in place of their texts.
fn plan(generated: &Generated) -> Result<String, Error> {
    let failed = |error: serde_json::Error| Error::failed(format!("cannot write the plan as JSON: {error}"));
    let mut plan = serde_json::to_value(&generated.plan).map_err(failed)?;
    if let Some(kernels) = plan["kernels"].as_array_mut() {
        for (kernel, source) in kernels.iter_mut().zip(&generated.plan.kernels) {
            kernel["module"] = json!(format!("{}.wgsl", source.name));
        }
    }
    Ok(format!("{plan:#}\n"))
}
