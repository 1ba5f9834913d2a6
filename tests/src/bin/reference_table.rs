//! Prints how the references compare, as tables: `cargo run --release -p tests --bin reference_table -- --help`.

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use tests::following;
use tests::mask::Mask;
use tests::references::{self, Reference, Score};
use tests::rendering::{Job, Rendering};

/// Error of f32 sums that both renderers share, as a share of the mean.
const ROUNDING: f64 = 1e-5;

/// Renders the references at full size and prints the tables of docs/validation.md.
#[derive(Parser)]
struct Arguments {
    /// The folder of scenes and references
    #[arg(long, value_name = "FOLDER", default_value_os_t = references::default_folder())]
    shared: PathBuf,
    /// Time a scene, s
    #[arg(long, value_name = "N", default_value_t = 5.0)]
    seconds: f64,
    /// The pipeline
    #[arg(long, value_name = "NAME", default_value = "pt")]
    pipeline: String,
    /// These references alone
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// A parameter of the pipeline, or several
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = parameter)]
    parameters: Vec<(String, String)>,
    /// With the conventions of the other renderer
    #[arg(long)]
    following: bool,
}

impl Arguments {
    fn check(&self) -> Result<(), String> {
        if !self.shared.join("references/references.toml").is_file() {
            return Err(format!("{} has no references; --shared FOLDER says where they are", self.shared.display()));
        }
        if self.following && self.pipeline != "pt" {
            return Err("--following is for `pt`: light walks do not know these conventions".into());
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<(), String> {
    let arguments = Arguments::parse();
    arguments.check()?;
    let all = chosen(&arguments)?;
    let (exact, approximate): (Vec<_>, Vec<_>) = all.into_iter().partition(Reference::is_exact);
    print_table(&arguments, "exact: all blocks", &exact);
    print_table(&arguments, "approximate: blocks of diffuse surfaces", &approximate);
    Ok(())
}

/// The references that are asked for.
fn chosen(arguments: &Arguments) -> Result<Vec<Reference>, String> {
    let mut all = references::all(&arguments.shared);
    let only = &arguments.only;
    if let Some(unknown) = only.iter().find(|name| all.iter().all(|reference| reference.name != **name)) {
        return Err(format!("there is no reference `{unknown}`"));
    }
    all.retain(|reference| only.is_empty() || only.contains(&reference.name));
    Ok(all)
}

fn print_table(arguments: &Arguments, title: &str, list: &[Reference]) {
    if list.is_empty() {
        return;
    }
    let following = if arguments.following { ", following" } else { "" };
    let parameters: String = arguments.parameters.iter().map(|(key, value)| format!(", {key}={value}")).collect();
    println!("\n`{}`{parameters}{following}, {} s a scene; {title}\n", arguments.pipeline, arguments.seconds);
    println!(
        "| scene, `max_edges` | samples a pixel | mean ours / reference (R, G, B) | scores | beyond 4 | beyond 6 | largest | root mean square |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for reference in list {
        print_row(arguments, reference);
    }
}

fn print_row(arguments: &Arguments, reference: &Reference) {
    let mask = (!reference.is_exact()).then(|| Mask::of(&reference.job(&arguments.shared, 1)));
    let rendering = if arguments.following {
        let scene = following::converted(&arguments.shared, reference);
        render(arguments, following::job(&scene, reference))
    } else {
        render(arguments, reference.job(&arguments.shared, 1))
    };
    let score = Score::of(&rendering.pixels, &reference.image(&arguments.shared), mask.as_ref(), ROUNDING);
    println!("{}", row(reference, &rendering, &score));
    if rendering.rejected > 0 {
        eprintln!("{}: {} rejected contributions", reference.name, rendering.rejected);
    }
}

/// Key and value of a parameter.
fn parameter(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("a parameter is KEY=VALUE")?;
    Ok((key.to_owned(), value.to_owned()))
}

fn render(arguments: &Arguments, job: Job) -> Rendering {
    let job = arguments.parameters.iter().fold(job, |job, (key, value)| job.set(key, value));
    job.pipeline(&arguments.pipeline).suited().render_for(arguments.seconds)
}

fn row(reference: &Reference, rendering: &Rendering, score: &Score) -> String {
    let ratios = score.ratios().map(|ratio| ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.4}"))).join(" ");
    let (name, edges, blocks) = (&reference.name, reference.max_edges, &score.blocks);
    format!(
        "| {name}, {edges} | {} | {ratios} | {} | {} | {} | {:.1} | {:.2} |",
        rendering.samples, blocks.count, blocks.beyond_4, blocks.beyond_6, blocks.largest, blocks.root_mean_square
    )
}
