//! `pathloom explain`.

use super::input::{self, SceneArguments, VariantArguments};
use super::{Failure, print, print_json};
use clap::Args;
use runtime::error::Error;
use runtime::settings::Target;
use serde_json::json;

/// Shows the layout, the traffic of every kernel, dead fields, and effects kept and dropped.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// A pipeline (name or .toml file), a render file, or a rendered .exr
    #[arg(value_name = "VARIANT")]
    variant: String,
    /// One field, such as `eye.hit`
    #[arg(value_name = "FIELD")]
    field: Option<String>,
    #[command(flatten)]
    axes: VariantArguments,
    #[command(flatten)]
    scene: SceneArguments,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Generates and prints the report.
///
/// # Errors
/// User input, refused variants.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let settings = input::variant(Some(&arguments.variant))?;
    let mut settings = arguments.scene.over(arguments.axes.over(settings)).with_defaults(Target::Gpu);
    let effects = input::effects(&settings)?;
    let generated = input::generate_settings(&mut settings, effects)?;
    let report = &generated.report;
    match (&arguments.field, arguments.json) {
        (Some(name), json) => {
            let found = report.field(name).ok_or_else(|| unknown(&generated, name))?;
            if json { print_json(&json!({ "field": name, "text": found }))? } else { print(&found)? }
        }
        (None, true) => {
            let failed = |error: serde_json::Error| Error::failed(format!("cannot write the report as JSON: {error}"));
            print_json(&serde_json::to_value(report).map_err(failed)?)?;
        }
        (None, false) => print(&report.text())?,
    }
    Ok(())
}

fn unknown(generated: &kernelgen::Generated, name: &str) -> Error {
    let fields = generated.report.field_names();
    let error = Error::input(format!("the pipeline `{}` has no field `{name}`", generated.variant.pipeline.name));
    match kernelgen::config::nearest(name, fields.iter().map(String::as_str)) {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error.help(format!("its fields: {}", fields.join(", "))),
    }
}
