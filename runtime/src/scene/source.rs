//! What the user named: a glTF file, or a folder with a `scene.toml` that names one and its sky.

use super::LoadOptions;
use crate::error::{Error, Result};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Name of the description in a scene's folder.
const DESCRIPTION: &str = "scene.toml";

/// The parts of a `scene.toml` that are used.
#[derive(Default, Deserialize)]
struct Description {
    #[serde(default)]
    file: String,
    env: Option<Environment>,
}

#[derive(Deserialize)]
struct Environment {
    file: PathBuf,
    scale: Option<f64>,
    rotate_y_deg: Option<f64>,
}

/// Where a scene and its sky lie.
#[derive(Debug)]
pub struct Source {
    /// The glTF file.
    pub file: PathBuf,
    /// The sky.
    pub sky: Option<SkySource>,
}

/// A sky and how it is used.
#[derive(Debug)]
pub struct SkySource {
    /// The image.
    pub file: PathBuf,
    /// Factor on its radiance.
    pub scale: f64,
    /// Degrees about +Y.
    pub rotate_deg: f64,
}

/// Resolves a path. What `options` say about the sky wins over the description.
///
/// # Errors
/// A path that does not exist, a folder without a description, a description that is not valid or names no file.
pub fn resolve(path: &Path, options: &LoadOptions) -> Result<Source> {
    if path.is_dir() {
        return from_folder(path, options);
    }
    if !path.exists() {
        return Err(Error::input("no such file")
            .in_file(path)
            .help("a .glb or .gltf file, or a folder with a scene.toml"));
    }
    let beside = path.with_file_name(DESCRIPTION);
    let description = if beside.is_file() { describe(&beside)? } else { Description::default() };
    let ours = path.file_name().is_some_and(|name| name == Path::new(&description.file).as_os_str());
    let environment = description.env.filter(|_| ours);
    Ok(Source { file: path.to_path_buf(), sky: sky(environment, &beside, options) })
}

fn from_folder(folder: &Path, options: &LoadOptions) -> Result<Source> {
    let path = folder.join(DESCRIPTION);
    if !path.is_file() {
        return Err(Error::input(format!("the folder has no {DESCRIPTION}"))
            .in_file(folder)
            .help("a .glb or .gltf file, or a folder with a scene.toml"));
    }
    let description = describe(&path)?;
    if description.file.is_empty() {
        return Err(Error::input("`file` names no glTF file").in_file(&path).help("file = \"scene.glb\""));
    }
    let file = folder.join(&description.file);
    if !file.is_file() {
        return Err(Error::input(format!("`file` names {}, which does not exist", description.file)).in_file(&path));
    }
    Ok(Source { file, sky: sky(description.env, &path, options) })
}

fn describe(path: &Path) -> Result<Description> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Error::input(format!("cannot read it: {error}")).in_file(path))?;
    toml::from_str(&text).map_err(|error| {
        let help = "env = { file = \"sky.exr\", scale = 1.0, rotate_y_deg = 0.0 }";
        Error::input(error.to_string().trim_end().to_owned()).in_file(path).help(help)
    })
}

fn sky(described: Option<Environment>, description: &Path, options: &LoadOptions) -> Option<SkySource> {
    let scale = options.env_scale;
    let rotate = options.env_rotate_deg;
    if let Some(file) = &options.env {
        return Some(SkySource { file: file.clone(), scale: scale.unwrap_or(1.0), rotate_deg: rotate.unwrap_or(0.0) });
    }
    described.map(|environment| SkySource {
        file: description.parent().unwrap_or(Path::new("")).join(environment.file),
        scale: scale.or(environment.scale).unwrap_or(1.0),
        rotate_deg: rotate.or(environment.rotate_y_deg).unwrap_or(0.0),
    })
}
