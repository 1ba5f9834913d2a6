//! Renders the references at full size and prints the tables of docs/validation.md: `cargo run --release -p tests --bin reference_table`.
//!
//! Arguments: `--shared FOLDER` (beside the repository), `--seconds N` a scene (5), `--pipeline NAME` (`pt`), `--only NAME,NAME`,
//! `--following` for the conventions of the other renderer.

use std::path::PathBuf;
use std::process::ExitCode;
use tests::following;
use tests::mask::Mask;
use tests::references::{self, Reference, Score};
use tests::rendering::{Job, Rendering};

/// Error of f32 sums that both renderers share, as a share of the mean.
const ROUNDING: f64 = 1e-5;

struct Arguments {
    shared: PathBuf,
    seconds: f64,
    pipeline: String,
    only: Option<Vec<String>>,
    following: bool,
}

fn arguments() -> Result<Arguments, String> {
    let shared = references::default_folder();
    let mut chosen = Arguments { shared, seconds: 5.0, pipeline: "pt".into(), only: None, following: false };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        if word == "--following" {
            chosen.following = true;
            continue;
        }
        let value = words.next().ok_or(format!("`{word}` wants a value, or is unknown"))?;
        match word.as_str() {
            "--shared" => chosen.shared = value.into(),
            "--seconds" => chosen.seconds = value.parse().map_err(|error| format!("--seconds {value}: {error}"))?,
            "--pipeline" => chosen.pipeline = value,
            "--only" => chosen.only = Some(value.split(',').map(str::to_owned).collect()),
            _ => return Err(format!("unknown argument `{word}`")),
        }
    }
    if !chosen.shared.join("references/references.toml").is_file() {
        return Err(format!("{} has no references; --shared FOLDER says where they are", chosen.shared.display()));
    }
    if chosen.following && chosen.pipeline != "pt" {
        return Err("--following is for `pt`: light walks do not know these conventions".into());
    }
    Ok(chosen)
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
    let arguments = arguments()?;
    let all = chosen(&arguments)?;
    let (exact, approximate): (Vec<_>, Vec<_>) = all.into_iter().partition(Reference::is_exact);
    print_table(&arguments, "exact: all blocks", &exact);
    print_table(&arguments, "approximate: blocks of diffuse surfaces", &approximate);
    Ok(())
}

/// The references that are asked for.
fn chosen(arguments: &Arguments) -> Result<Vec<Reference>, String> {
    let mut all = references::all(&arguments.shared);
    let Some(only) = &arguments.only else { return Ok(all) };
    if let Some(unknown) = only.iter().find(|name| all.iter().all(|reference| reference.name != **name)) {
        return Err(format!("there is no reference `{unknown}`"));
    }
    all.retain(|reference| only.contains(&reference.name));
    Ok(all)
}

fn print_table(arguments: &Arguments, title: &str, list: &[Reference]) {
    if list.is_empty() {
        return;
    }
    let following = if arguments.following { ", following" } else { "" };
    println!("\n`{}`{following}, {} s a scene; {title}\n", arguments.pipeline, arguments.seconds);
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

fn render(arguments: &Arguments, job: Job) -> Rendering {
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
