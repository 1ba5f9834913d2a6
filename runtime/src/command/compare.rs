//! `pathloom compare`.

use super::{Failure, print, print_json};
use clap::Args;
use runtime::compare::{Image, Metrics, block_z, check, metrics, zscore};
use runtime::error::Error;
use runtime::picture::write_png;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Prints mse, relmse, FLIP, the ratio of the means, and the largest z-score of block means where the images carry standard errors.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// An image
    #[arg(value_name = "A.exr")]
    a: PathBuf,
    /// The image it is compared with
    #[arg(value_name = "B.exr")]
    b: PathBuf,
    /// Compare both with this image, too
    #[arg(long, value_name = "R.exr")]
    reference: Option<PathBuf>,
    /// Write FLIP's picture of the difference
    #[arg(short, long, value_name = "DIFF.png")]
    output: Option<PathBuf>,
    /// Side of the blocks of the z-scores, pixels
    #[arg(long, value_name = "N", default_value_t = 8, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    block: u32,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

struct Comparison {
    name: String,
    metrics: Metrics,
    largest_z: Option<f64>,
    blocks: Option<usize>,
}

/// Compares and prints.
///
/// # Errors
/// User input, when an image cannot be read or the sizes differ.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let a = Image::load(&arguments.a)?;
    let b = Image::load(&arguments.b)?;
    let main = compare((&arguments.a, &a), (&arguments.b, &b), arguments.block)?;
    let mut against = Vec::new();
    if let Some(path) = &arguments.reference {
        let reference = Image::load(path)?;
        against.push(("a", compare((&arguments.a, &a), (path, &reference), arguments.block)?));
        against.push(("b", compare((&arguments.b, &b), (path, &reference), arguments.block)?));
    }
    if let Some(path) = &arguments.output {
        write_png(path, a.size, &runtime::compare::metrics::difference_picture(&a, &b))?;
    }
    if arguments.json {
        let mut object = main.json();
        if !against.is_empty() {
            object["reference"] =
                against.iter().map(|(name, comparison)| ((*name).to_owned(), comparison.json())).collect();
        }
        print_json(&object)?;
    } else {
        let lines: Vec<String> = std::iter::once(&main)
            .chain(against.iter().map(|(_, comparison)| comparison))
            .map(Comparison::text)
            .collect();
        print(&lines.join("\n"))?;
    }
    Ok(())
}

fn compare(a: (&Path, &Image), b: (&Path, &Image), block: u32) -> Result<Comparison, Error> {
    let (name_a, name_b) = (a.0.display().to_string(), b.0.display().to_string());
    check((&name_a, a.1), (&name_b, b.1))?;
    let scores = block_z(a.1, b.1, block);
    Ok(Comparison {
        name: format!("{name_a} against {name_b}"),
        metrics: metrics(a.1, b.1),
        largest_z: scores.as_deref().map(zscore::largest),
        blocks: scores.map(|scores| scores.len() / 3),
    })
}

impl Comparison {
    fn json(&self) -> Value {
        let metrics = &self.metrics;
        json!({
            "mse": metrics.mse,
            "relmse": metrics.relmse,
            "flip": metrics.flip,
            "mean_ratio": metrics.mean_ratio,
            "max_block_z": self.largest_z,
            "blocks": self.blocks,
        })
    }

    fn text(&self) -> String {
        let metrics = &self.metrics;
        let ratio =
            metrics.mean_ratio.map(|ratio| ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.5}"))).join(" ");
        let z = match (self.largest_z, self.blocks) {
            (Some(z), Some(blocks)) => format!("{z:.2} in {blocks} blocks of three channels"),
            _ => "unknown: neither image has sem layers (`render --aov variance`)".to_owned(),
        };
        format!(
            "{}\n  mse          {:.6e}\n  relmse       {:.6e}\n  flip         {:.5}\n  mean ratio   {ratio}\n  max block z  {z}\n",
            self.name, metrics.mse, metrics.relmse, metrics.flip
        )
    }
}
