//! `pathloom render`.

use super::input::{self, DeviceArguments, SceneArguments, VariantArguments};
use super::summary::Summary;
use super::{Failure, print, print_json, progress, say};
use clap::Args;
use runtime::error::Error;
use runtime::image_file::Image;
use runtime::kernel_profile::KernelProfile;
use runtime::measurements::Measurements;
use runtime::output::save;
use runtime::picture::Exposure;
use runtime::render::{Session, Settings, Until};
use runtime::scene::Accelerator;
use runtime::settings::{Aov, RenderFile, Target};
use std::path::{Path, PathBuf};

/// Samples per pixel when nothing says when to stop.
const DEFAULT_SAMPLES: u32 = 64;

/// Without arguments: the flagship pipeline on the shipped Cornell box.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    /// A pipeline (name or .toml file), a render file, or a rendered .exr, whose picture is rendered again
    #[arg(value_name = "PIPELINE|RENDER.toml|PICTURE.exr", conflicts_with = "resume")]
    variant: Option<String>,
    #[command(flatten)]
    axes: VariantArguments,
    #[command(flatten)]
    scene: SceneArguments,
    #[command(flatten)]
    device: DeviceArguments,
    /// Samples per pixel, with --resume those of the picture included
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true, group = "until")]
    spp: Option<u32>,
    /// Render for this long
    #[arg(long, value_name = "SECONDS", value_parser = input::positive, allow_negative_numbers = true, group = "until")]
    time: Option<f64>,
    /// Render until the root mean square of the standard errors is this part of the mean radiance
    #[arg(long, value_name = "RELATIVE", value_parser = input::positive, allow_negative_numbers = true, group = "until")]
    error: Option<f64>,
    /// Seed of the random numbers; equal seeds give equal samples
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u32>,
    /// Path slots; more fill larger cards, fewer need less memory
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Device")]
    paths: Option<u32>,
    /// Continue a picture where it was stopped
    #[arg(long, value_name = "PICTURE.exr", conflicts_with_all = ["scene", "camera", "size", "env", "env_scale", "env_rotate", "seed", "set"])]
    resume: Option<PathBuf>,
    /// Further layers: `variance` writes standard errors as sem.R, sem.G, sem.B; `strategies` a picture of each strategy (s, t), weighted
    /// and unweighted, and the pyramids of them as PNG
    #[arg(long, value_name = "LAYERS", value_delimiter = ',')]
    aov: Vec<String>,
    /// Brightness of the PNG in stops, 1 being white; by default the 95th percentile of the luminance is white
    #[arg(long, value_name = "STOPS", value_parser = input::finite, allow_negative_numbers = true)]
    exposure: Option<f64>,
    /// The EXR file to write; the PNG goes beside it
    #[arg(short, long, value_name = "OUT.exr")]
    output: Option<PathBuf>,
    /// Print for each kernel its time, the paths it takes, bytes of state moved, compile time and size
    #[arg(long)]
    profile: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Renders, writes the files, prints the summary.
///
/// # Errors
/// User input, refused variants, failed devices.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let earlier = arguments.resume.as_deref().map(input::of_picture).transpose()?;
    let gpu = arguments.device.open()?;
    let mut settings = chosen(arguments, earlier.as_ref().map(|(settings, _)| settings), Target::of(&gpu))?;
    let until = until(arguments, &settings);
    let output = output(arguments, &settings)?;

    let mut scene = input::load_scene(&settings)?;
    let generated = input::generate_settings(&mut settings, scene.effects.clone())?;
    scene.set_accelerator(Accelerator::of(&generated.plan))?;
    let size = scene.size().into();
    settings.size = Some(size);
    let seed = *settings.seed.get_or_insert(0);
    let render = Settings { size, seed, paths: arguments.paths };
    let work = match until {
        Until::Samples(samples) => Some(samples),
        Until::Seconds(_) | Until::Error(_) => None,
    };
    let mut session = Session::new(&gpu, &generated.plan, &|name| scene.resource(name), render, work)?;
    if let Some((before, image)) = &earlier {
        resume(&mut session, before, image, until, settings.wants(Aov::Variance))?;
    }
    progress::catch_interrupts()?;
    let bar = progress::bar();
    let result = session.run(until, &mut |state| {
        progress::show(&bar, state);
        !progress::interrupted()
    });
    bar.finish_and_clear();
    result?;

    let rendered = session.picture()?;
    let metadata = settings.of_rendered(&rendered, until);
    if settings.wants(Aov::Variance) && rendered.standard_error.is_none() {
        super::warn("one sample per pixel gives no standard errors: no `sem` layers are written");
    }
    let exposure = arguments.exposure.map_or(Exposure::Percentile, |stops| Exposure::Stops(stops as f32));
    let outputs = save(&output, &rendered, &metadata, exposure)?;
    if progress::interrupted() {
        say(&format!(
            "stopped at {} samples per pixel; continue with `pathloom render --resume {}`",
            rendered.totals.samples,
            output.display()
        ));
    }
    let mut measured = Measurements::of(&rendered, &generated, &gpu, &metadata);
    if arguments.profile {
        measured.kernel_profile = Some(KernelProfile::of(&generated.plan, &rendered, &session.occupancy()?)?);
    }
    let summary = Summary { rendered: &rendered, measured: &measured, outputs: &outputs };
    if arguments.json {
        print_json(&summary.json()?)?
    } else {
        print(&summary.text()?)?
    }
    Ok(())
}

fn chosen(arguments: &Arguments, earlier: Option<&RenderFile>, target: Target) -> Result<RenderFile, Error> {
    let file = match earlier {
        Some(earlier) => earlier.clone(),
        None => input::variant(arguments.variant.as_deref())?,
    };
    let mut settings = arguments.scene.over(arguments.axes.over(file));
    settings.seed = arguments.seed.or(settings.seed);
    if !arguments.aov.is_empty() {
        settings.aov = arguments.aov.iter().map(|word| layer(word)).collect::<Result<_, _>>()?;
    }
    Ok(input::with_default_scene(settings.with_defaults(target)))
}

fn layer(word: &str) -> Result<Aov, Error> {
    Aov::ALL.into_iter().find(|layer| layer.to_string() == word).ok_or_else(|| {
        let names = Aov::ALL.map(|layer| format!("`{layer}`")).join(" and ");
        Error::input(format!("--aov {word}: there is no such layer")).help(format!("the layers are {names}"))
    })
}

fn until(arguments: &Arguments, settings: &RenderFile) -> Until {
    match (arguments.time, arguments.error) {
        (Some(seconds), _) => Until::Seconds(seconds),
        (_, Some(relative)) => Until::Error(relative),
        _ => Until::Samples(arguments.spp.or(settings.spp).unwrap_or(DEFAULT_SAMPLES)),
    }
}

fn output(arguments: &Arguments, settings: &RenderFile) -> Result<PathBuf, Error> {
    let path = match (&arguments.output, &arguments.resume) {
        (Some(path), _) | (None, Some(path)) => path.clone(),
        (None, None) => {
            let stem = |word: &Option<String>| {
                Path::new(word.as_deref().unwrap_or("")).file_stem().unwrap_or_default().to_string_lossy().into_owned()
            };
            PathBuf::from(format!("{}_{}.exr", stem(&settings.scene), stem(&settings.pipeline)))
        }
    };
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("exr")) {
        return Err(Error::input(format!("the output `{}` is not called .exr", path.display()))
            .help("the PNG is written beside it by itself"));
    }
    // Better now than after hours of rendering. Folders that are missing are made when there is something to put in.
    if let Some(file) = path.ancestors().skip(1).find(|ancestor| ancestor.exists()).filter(|found| !found.is_dir()) {
        return Err(Error::input(format!("the output `{}` cannot be put into a file", path.display()))
            .help(format!("`{}` is not a folder", file.display())));
    }
    if let Some(taken) = [path.clone(), path.with_extension("png")].iter().find(|file| file.is_dir()) {
        return Err(Error::input(format!("the output `{}` is a folder", taken.display())).help("the name of a file"));
    }
    Ok(path)
}

fn resume(
    session: &mut Session,
    before: &RenderFile,
    image: &Image,
    until: Until,
    variance: bool,
) -> Result<(), Error> {
    let state =
        before.state.as_ref().ok_or_else(|| Error::input("the picture does not say how many samples it has"))?;
    if let Until::Samples(wanted) = until
        && wanted <= state.samples
    {
        let error = Error::input(format!("the picture already has {} samples per pixel", state.samples));
        return Err(error.help(format!("ask for more in total, `--spp {}`", u64::from(state.samples) * 2)));
    }
    if image.standard_error.is_none() && state.batches > 1 && (variance || matches!(until, Until::Error(_))) {
        return Err(
            Error::input("the picture has no standard errors to continue").help("render it with `--aov variance`")
        );
    }
    let mut totals = image.totals(state.samples, state.batches);
    totals.tallied.clone_from(&state.tallies);
    session.resume(&totals)
}
