//! The configs and scenes that come with the program, and the user's own files beside them.

use crate::error::Error;
use kernelgen::source::{FileKind, Sources};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Shipped configs: path below `configs/` and text.
static CONFIGS: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/configs.rs"));
/// Files of shipped scenes: path below `configs/scenes/`, `NAME/FILE`, and bytes.
static SCENES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/scenes.rs"));

/// Tells apart scenes that one process unpacks at the same time.
static UNPACKED: AtomicU32 = AtomicU32::new(0);

/// A kind of config.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// What is computed.
    Pipeline,
    /// Where fields live.
    Layout,
    /// How stages become kernels.
    Schedule,
    /// In what arithmetic.
    Precision,
    /// All of them, a scene and the settings of a picture.
    Render,
    /// Several renders that are compared.
    Study,
}

impl Axis {
    /// The axes that make up a variant.
    pub const VARIANT: [Axis; 4] = [Axis::Pipeline, Axis::Layout, Axis::Schedule, Axis::Precision];

    /// The folder of its files.
    pub fn folder(self) -> &'static str {
        match self {
            Axis::Pipeline => "pipelines",
            Axis::Layout => "layouts",
            Axis::Schedule => "schedules",
            Axis::Precision => "precisions",
            Axis::Render => "renders",
            Axis::Study => "studies",
        }
    }

    /// The word for one of its files.
    pub fn word(self) -> &'static str {
        match self {
            Axis::Pipeline => "pipeline",
            Axis::Layout => "layout",
            Axis::Schedule => "schedule",
            Axis::Precision => "precision",
            Axis::Render => "render",
            Axis::Study => "study",
        }
    }

    /// Names of the shipped files, sorted; one in a folder below carries the folder's name, `folder/name`.
    pub fn names(self) -> Vec<&'static str> {
        let prefix = format!("{}/", self.folder());
        CONFIGS.iter().filter_map(|(key, _)| key.strip_prefix(prefix.as_str())?.strip_suffix(".toml")).collect()
    }

    /// The text of a shipped file.
    pub fn shipped(self, name: &str) -> Option<&'static str> {
        let key = format!("{}/{name}.toml", self.folder());
        CONFIGS.iter().find(|(candidate, _)| *candidate == key).map(|(_, text)| *text)
    }
}

/// Everything that the generator may read: shipped configs and stage modules, and the files that were named.
#[derive(Clone, Debug)]
pub struct Library {
    /// For `kernelgen::generate`.
    pub sources: Sources,
    /// Texts that do not come with the program, by config key: they belong in the metadata of a picture.
    pub own: Vec<(String, String)>,
    /// Stage modules that do not come with the program, by module key.
    pub own_modules: Vec<(String, String)>,
}

impl Default for Library {
    fn default() -> Self {
        let mut sources = Sources::default();
        for (key, text) in CONFIGS {
            sources.add(FileKind::Config, *key, format!("configs/{key}"), *text);
        }
        sources.add(FileKind::Config, "codecs.toml", "stages/codecs.toml", stages::CODECS);
        for module in stages::modules() {
            sources.add(FileKind::Module, module.path, module.name, module.text);
        }
        Self { sources, own: Vec::new(), own_modules: Vec::new() }
    }
}

impl Library {
    /// Resolves a word of the command line or of a render file to a config key: a shipped name, or a file, which is read with all
    /// that it extends. Words with a `/` or ending in `.toml` are files, unless they are keys of `own`.
    ///
    /// # Errors
    /// User input, when there is neither a config of this name nor a file.
    pub fn resolve(&mut self, axis: Axis, word: &str) -> Result<String, Error> {
        if self.own.iter().any(|(key, _)| key == word) {
            return Ok(word.to_owned());
        }
        if !is_path(word) {
            let key = format!("{}/{word}.toml", axis.folder());
            return if self.sources.find(FileKind::Config, &key).is_some() {
                Ok(key)
            } else {
                Err(unknown(axis, word))
            };
        }
        let path = Path::new(word);
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let key = format!("{}/{name}", axis.folder());
        self.add_file(&key, path)?;
        Ok(key)
    }

    /// Adds a text under a config key, as found in the metadata of a picture.
    pub fn add_own(&mut self, key: &str, text: &str) {
        self.sources.add(FileKind::Config, key, key, text);
        self.own.push((key.to_owned(), text.to_owned()));
    }

    /// Adds a stage module, in place of the shipped one of the same key.
    pub fn add_module(&mut self, key: &str, name: &str, text: &str) {
        self.sources.add(FileKind::Module, key, name, text);
        self.own_modules.push((key.to_owned(), text.to_owned()));
    }

    /// Adds every `.wgsl` file below a folder, by its path there (`bsdf/lambert.wgsl`): new modules, or others in place of shipped ones.
    ///
    /// # Errors
    /// User input, when the folder cannot be read or holds no module.
    pub fn add_module_folder(&mut self, folder: &Path) -> Result<(), Error> {
        let mut files = Vec::new();
        wgsl_files(folder, &mut files)
            .map_err(|error| Error::input(format!("cannot read the folder of stages: {error}")).in_file(folder))?;
        if files.is_empty() {
            return Err(Error::input("there is no .wgsl file in this folder").in_file(folder));
        }
        files.sort();
        for file in files {
            let text = std::fs::read_to_string(&file)
                .map_err(|error| Error::input(format!("cannot read the stage module: {error}")).in_file(&file))?;
            let inside = file.strip_prefix(folder).unwrap_or(&file).with_extension("");
            let key: Vec<_> = inside.iter().map(|part| part.to_string_lossy()).collect();
            self.add_module(&key.join("/"), &file.display().to_string(), &text);
        }
        Ok(())
    }

    fn add_file(&mut self, key: &str, path: &Path) -> Result<(), Error> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| Error::input(format!("cannot read the file: {error}")).in_file(path))?;
        self.sources.add(FileKind::Config, key, path.display().to_string(), text.clone());
        self.own.push((key.to_owned(), text.clone()));
        for base in extends(&text) {
            let base_path = path.with_file_name("").join(&base);
            let base_key = join(key, &base);
            let known = self.own.iter().any(|(own, _)| *own == base_key);
            if base_path.is_file() && !known {
                self.add_file(&base_key, &base_path)?;
            }
        }
        Ok(())
    }
}

fn wgsl_files(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            wgsl_files(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "wgsl") {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether a word of the command line is a file rather than a name.
pub fn is_path(word: &str) -> bool {
    word.contains('/')
        || word.contains('\\')
        || Path::new(word).extension().is_some_and(|extension| extension == "toml")
}

/// The error about a word that names no shipped file of an axis.
pub fn unknown(axis: Axis, word: &str) -> Error {
    let names = axis.names();
    let error = Error::input(format!("there is no {} named `{word}`", axis.word()));
    match kernelgen::config::nearest(word, names.iter().copied()) {
        Some(near) => error.help(format!("did you mean `{near}`? A file is given with its path, `./{word}.toml`")),
        None => error.help(format!("there are {}; a file is given with its path, `./{word}.toml`", names.join(", "))),
    }
}

/// The files that a config extends; nothing when it does not parse, which the generator reports with the place.
pub fn extends(text: &str) -> Vec<String> {
    let table = text.parse::<toml::Table>().unwrap_or_default();
    match table.get("extends") {
        Some(toml::Value::String(base)) => vec![base.clone()],
        Some(toml::Value::Array(bases)) => bases.iter().filter_map(|base| base.as_str().map(str::to_owned)).collect(),
        _ => Vec::new(),
    }
}

/// The config key that `path` means in the file with the config key `from`, as the generator resolves it.
pub fn join(from: &str, path: &str) -> String {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// Names of the shipped scenes, sorted.
pub fn scene_names() -> Vec<&'static str> {
    let mut names: Vec<_> = SCENES.iter().filter_map(|(path, _)| Some(path.split_once('/')?.0)).collect();
    names.dedup();
    names
}

/// Calls `use_path` with the path of a scene: a file or a folder, or else a shipped scene by name, which is unpacked meanwhile.
///
/// # Errors
/// User input, when there is no such scene; else the error of `use_path`.
pub fn with_scene<T>(word: &str, use_path: impl FnOnce(&Path) -> Result<T, Error>) -> Result<T, Error> {
    if Path::new(word).exists() {
        return use_path(Path::new(word));
    }
    if !scene_names().contains(&word) {
        return Err(unknown_scene(word));
    }
    let number = UNPACKED.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("pathloom-{}-{number}", std::process::id()));
    let result = unpack(word, &folder)
        .map_err(|error| Error::failed(format!("cannot unpack the scene `{word}`: {error}")).in_file(&folder))
        .and_then(|()| use_path(&folder).map_err(|error| shipped_place(error, word, &folder)));
    // Files left in the temporary folder do no harm.
    drop(std::fs::remove_dir_all(&folder));
    result
}

/// Names the shipped file where an error names the unpacked one.
fn shipped_place(mut error: Error, name: &str, folder: &Path) -> Error {
    let inside = error.file.as_ref().and_then(|file| file.strip_prefix(folder).ok().map(Path::to_path_buf));
    if let Some(inside) = inside {
        error.file = Some(Path::new("configs/scenes").join(name).join(inside));
    }
    error
}

fn unpack(name: &str, folder: &Path) -> std::io::Result<()> {
    let prefix = format!("{name}/");
    for (path, bytes) in SCENES {
        let Some(file) = path.strip_prefix(prefix.as_str()) else { continue };
        let target = folder.join(file);
        if let Some(parent) = target.parent() {
            std::fs::create_dir_all(parent)?;
        }
        std::fs::write(target, bytes)?;
    }
    Ok(())
}

fn unknown_scene(word: &str) -> Error {
    let names = scene_names();
    let error = Error::input(format!("there is no scene `{word}`: neither a file nor a shipped scene"));
    match kernelgen::config::nearest(word, names.iter().copied()) {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error.help(format!("shipped scenes: {}", names.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_paths_are_told_apart() {
        assert!(is_path("./pt"));
        assert!(is_path("pt.toml"));
        assert!(!is_path("pt"));
    }

    #[test]
    fn an_unknown_name_is_the_users_mistake() {
        let error = Library::default().resolve(Axis::Layout, "no_such_layout");
        assert!(error.is_err_and(|error| error.exit_code() == 2 && error.to_string().contains("no_such_layout")));
    }

    #[test]
    fn keys_join_like_paths() {
        assert_eq!(join("pipelines/pt.toml", "nee.toml"), "pipelines/nee.toml");
        assert_eq!(join("pipelines/pt.toml", "../more/./nee.toml"), "more/nee.toml");
    }
}
