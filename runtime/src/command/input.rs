//! Arguments that several subcommands share, and what they turn into: settings, a scene, a generated variant, a device.

use super::{Failure, colour, say, warn};
use clap::Args;
use indexmap::IndexMap;
use kernelgen::Generated;
use kernelgen::config::model::{Effect, Effects, Selection};
use kernelgen::source::Sources;
use runtime::configs::{Axis, Library, is_path};
use runtime::device::{DeviceOptions, Gpu};
use runtime::error::Error;
use runtime::image_file::Image;
use runtime::scene::{BuildPreset, Scene};
use runtime::settings::{Camera, DEFAULT_SCENE, RenderFile, SetValue};
use std::path::Path;

/// Which variant.
#[derive(Clone, Debug, Default, Args)]
pub struct VariantArguments {
    /// Layout: name or file
    #[arg(long, value_name = "L", help_heading = "Variant")]
    pub layout: Option<String>,
    /// Schedule: name or file
    #[arg(long, value_name = "S", help_heading = "Variant")]
    pub schedule: Option<String>,
    /// Precision: name or file
    #[arg(long, value_name = "P", help_heading = "Variant")]
    pub precision: Option<String>,
    /// A folder with WGSL modules: new stages, or others in place of shipped ones (`bsdf/lambert.wgsl`)
    #[arg(long, value_name = "DIR", help_heading = "Variant")]
    pub stages: Option<String>,
    /// A pipeline parameter (`max_edges=8`) or a key of an axis (`schedule.workgroup=128`)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value, help_heading = "Variant")]
    pub set: Vec<(String, String)>,
}

/// Which scene, seen how.
#[derive(Clone, Debug, Default, Args)]
pub struct SceneArguments {
    /// A .glb or .gltf file, a folder with one, or a shipped scene by name
    #[arg(long, value_name = "FILE|NAME", help_heading = "Scene")]
    pub scene: Option<String>,
    /// A camera of the scene; the first when not given
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Scene")]
    pub camera: Option<String>,
    /// Picture size in pixels; the vertical field of view stays
    #[arg(long, value_name = "WxH", value_parser = size, help_heading = "Scene")]
    pub size: Option<[u32; 2]>,
    /// Sky: an .hdr or .exr picture in latitude-longitude form
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    pub env: Option<String>,
    /// Factor on the sky's radiance
    #[arg(long, value_name = "X", value_parser = non_negative, allow_negative_numbers = true, help_heading = "Scene")]
    pub env_scale: Option<f64>,
    /// Turn of the sky about +Y, degrees
    #[arg(long, value_name = "DEG", value_parser = finite, allow_negative_numbers = true, help_heading = "Scene")]
    pub env_rotate: Option<f64>,
    /// Radius of the camera's lens, metres; 0 is a pinhole
    #[arg(long, value_name = "M", value_parser = non_negative, allow_negative_numbers = true, help_heading = "Scene")]
    pub lens_radius: Option<f64>,
    /// Distance of the plane in focus, metres; the centre of the scene when not given
    #[arg(long, value_name = "M", value_parser = positive, allow_negative_numbers = true, help_heading = "Scene")]
    pub focus_distance: Option<f64>,
    /// Effort of building the acceleration structure
    #[arg(long, value_name = "PRESET", value_parser = build_preset, help_heading = "Scene")]
    pub build: Option<BuildPreset>,
}

/// Which device.
#[derive(Clone, Debug, Default, Args)]
pub struct DeviceArguments {
    /// Part of an adapter's name (see `pathloom info`)
    #[arg(long, value_name = "NAME", help_heading = "Device")]
    pub adapter: Option<String>,
    /// Bounds checks in kernels and checked indirect dispatches: slower, for finding defects
    #[arg(long, help_heading = "Device")]
    pub checked: bool,
}

impl DeviceArguments {
    /// Opens the device.
    pub fn open(&self) -> Result<Gpu, Error> {
        Gpu::open(&DeviceOptions { adapter: self.adapter.clone(), checked: self.checked })
    }
}

/// A word as in `max_edges=8`.
pub fn key_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or_else(|| "this is not KEY=VALUE, such as max_edges=8".to_owned())?;
    if key.trim().is_empty() || value.trim().is_empty() {
        return Err("both KEY and VALUE are needed, such as max_edges=8".to_owned());
    }
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

/// Width and height as in `640x360`.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once(['x', 'X']);
    let parsed = parts.and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    match parsed {
        Some([0, _] | [_, 0]) => Err("a picture needs at least one pixel each way".to_owned()),
        Some(size) => Ok(size),
        None => Err("this is not WIDTHxHEIGHT, such as 640x360".to_owned()),
    }
}

fn build_preset(text: &str) -> Result<BuildPreset, String> {
    let all = BuildPreset::ALL;
    let named = all.into_iter().find(|preset| preset.name() == text);
    named.ok_or_else(|| format!("valid presets are {}", all.map(BuildPreset::name).join(", ")))
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    finite(text).and_then(|value| if value > 0.0 { Ok(value) } else { Err("must be more than 0".to_owned()) })
}

fn non_negative(text: &str) -> Result<f64, String> {
    finite(text).and_then(|value| if value >= 0.0 { Ok(value) } else { Err("must not be negative".to_owned()) })
}

/// A number, not infinite.
pub fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().map_err(|_| "this is not a number".to_owned())?;
    if number.is_finite() { Ok(number) } else { Err("must be finite".to_owned()) }
}

/// The settings that a VARIANT word stands for: a pipeline, a render file, or the metadata of a picture.
///
/// # Errors
/// User input, when it is none of them.
pub fn variant(word: Option<&str>) -> Result<RenderFile, Error> {
    let Some(word) = word else { return Ok(RenderFile::default()) };
    let path = Path::new(word);
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        return of_picture(path).map(|(settings, _)| again(settings));
    }
    if !is_path(word) {
        let render = Axis::Render.shipped(word).filter(|_| Axis::Pipeline.shipped(word).is_none());
        return match render {
            Some(text) => RenderFile::parse(text, &format!("configs/renders/{word}.toml")),
            None => Ok(of_pipeline(word)),
        };
    }
    let text = std::fs::read_to_string(path)
        .map_err(|error| Error::input(format!("cannot read the file: {error}")).in_file(path))?;
    let names_a_pipeline =
        text.parse::<toml::Table>().is_ok_and(|table| table.get("pipeline").is_some_and(toml::Value::is_str));
    if !names_a_pipeline {
        return Ok(of_pipeline(word));
    }
    let mut settings = RenderFile::parse(&text, word)?;
    settings.relative_to(path.parent().unwrap_or(Path::new("")));
    Ok(settings)
}

fn of_pipeline(word: &str) -> RenderFile {
    RenderFile { pipeline: Some(word.to_owned()), ..RenderFile::default() }
}

/// The settings in the metadata of a picture, and the picture.
///
/// # Errors
/// User input, when the file is no picture of ours.
pub fn of_picture(path: &Path) -> Result<(RenderFile, Image), Error> {
    let image = Image::load(path)?;
    let Some(text) = &image.settings else {
        return Err(Error::input("the picture carries no settings: it was not rendered by pathloom").in_file(path));
    };
    let settings = RenderFile::parse(text, &path.display().to_string())?;
    Ok((settings, image))
}

/// Settings that render a picture anew, with the samples that it has.
fn again(mut settings: RenderFile) -> RenderFile {
    if let Some(state) = settings.state.take() {
        settings.spp = Some(state.samples);
    }
    settings
}

impl VariantArguments {
    /// Puts the flags over the settings of a file.
    pub fn over(&self, settings: RenderFile) -> RenderFile {
        let set: IndexMap<_, _> =
            self.set.iter().map(|(key, value)| (key.clone(), SetValue::Text(value.clone()))).collect();
        settings.overlaid(RenderFile {
            layout: self.layout.clone(),
            schedule: self.schedule.clone(),
            precision: self.precision.clone(),
            stages: self.stages.clone(),
            set,
            ..RenderFile::default()
        })
    }
}

impl SceneArguments {
    /// Puts the flags over the settings of a file. A scene by flag brings its own camera, so the file's is forgotten.
    pub fn over(&self, mut settings: RenderFile) -> RenderFile {
        if self.scene.is_some() && self.scene != settings.scene {
            settings.camera = None;
        }
        let camera =
            self.camera.as_ref().map(|word| word.parse().map_or_else(|_| Camera::Name(word.clone()), Camera::Index));
        settings.overlaid(RenderFile {
            scene: self.scene.clone(),
            camera,
            size: self.size,
            env: self.env.clone(),
            env_scale: self.env_scale,
            env_rotate: self.env_rotate,
            lens_radius: self.lens_radius.map(|radius| radius as f32),
            focus_distance: self.focus_distance.map(|distance| distance as f32),
            build: self.build,
            ..RenderFile::default()
        })
    }
}

/// Loads the scene of the settings, the shipped Cornell box when there is none, and prints its warnings.
///
/// # Errors
/// User input, when the scene or its sky cannot be read.
pub fn load_scene(settings: &RenderFile) -> Result<Scene, Error> {
    let scene = settings.load_scene()?;
    scene.warnings.iter().for_each(|warning| warn(warning));
    Ok(scene)
}

/// The effects that a variant is generated for: those of its scene, or all of them when there is none.
///
/// # Errors
/// User input, when the scene cannot be read.
pub fn effects(settings: &RenderFile) -> Result<Effects, Error> {
    if settings.scene.is_some() { Ok(load_scene(settings)?.effects) } else { every_effect() }
}

/// Every effect that a scene may call for, present.
///
/// # Errors
/// Failed, when the shipped scene that names them cannot be read.
pub fn every_effect() -> Result<Effects, Error> {
    let mut effects = load_scene(&RenderFile::default())?.effects;
    for effect in effects.values_mut() {
        *effect = Effect { present: true, reason: "no scene was named: every effect is assumed".to_owned() };
    }
    Ok(effects)
}

/// The settings with the default scene filled in.
pub fn with_default_scene(mut settings: RenderFile) -> RenderFile {
    settings.scene.get_or_insert_with(|| DEFAULT_SCENE.to_owned());
    settings
}

/// Generates a variant and prints the generator's warnings.
///
/// # Errors
/// Refused, with the generator's diagnostics.
pub fn generate(sources: &Sources, selection: &Selection) -> Result<Generated, Failure> {
    let generated =
        kernelgen::generate(sources, selection).map_err(|refusal| Failure::Refused(refusal.render(colour())))?;
    if !generated.warnings.is_empty() {
        say(kernelgen::diagnostic::render(&generated.warnings, &generated.sources, colour()).trim_end());
    }
    Ok(generated)
}

/// Resolves and generates the variant of the settings.
///
/// # Errors
/// User input for unknown names and for layers that the variant does not have, refused for the generator's diagnostics.
pub fn generate_settings(settings: &mut RenderFile, effects: Effects) -> Result<Generated, Failure> {
    let mut library = Library::default();
    let selection = settings.selection(&mut library, effects)?;
    settings.pin(&selection, &library);
    let generated = generate(&library.sources, &selection)?;
    settings.check_layers(&generated.plan)?;
    Ok(generated)
}
