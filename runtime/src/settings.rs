//! The settings of a render, as they stand in `configs/renders/*.toml` and in the metadata of a picture.

use crate::configs::{Axis, Library, with_scene};
use crate::device::Gpu;
use crate::error::Error;
use crate::render::{Rendered, Until};
use crate::scene::{self, BuildPreset, LoadOptions, Scene};
use crate::tallies::Tallied;
use indexmap::IndexMap;
use kernelgen::config::model::{Effects, Selection};
use kernelgen::plan::Plan;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// The scene that is rendered when none is named.
pub const DEFAULT_SCENE: &str = "cornell_box";
/// The parameter that makes a pipeline keep a picture of each strategy.
const RECORD_STRATEGIES: &str = "record_strategies";

/// Everything that fixes a picture; every key is optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderFile {
    /// One line about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doc: Option<String>,
    /// Name or file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pipeline: Option<String>,
    /// Name or file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
    /// Name or file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub schedule: Option<String>,
    /// Name or file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<String>,
    /// Folder with WGSL modules that are added to the shipped ones or replace them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stages: Option<String>,
    /// Name, file or folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Name or index of a camera of the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// Width and height in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<[u32; 2]>,
    /// Samples per pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spp: Option<u32>,
    /// Seed of the random numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u32>,
    /// Sky picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub env: Option<String>,
    /// Factor on its radiance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub env_scale: Option<f64>,
    /// Its turn about +Y, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub env_rotate: Option<f64>,
    /// Further layers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aov: Vec<Aov>,
    /// Radius of the camera's lens, m; 0 is a pinhole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens_radius: Option<f32>,
    /// Distance of the plane in focus, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_distance: Option<f32>,
    /// Effort of building the acceleration structure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub build: Option<BuildPreset>,
    /// `--set` values.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub set: IndexMap<String, SetValue>,
    /// How far a saved picture is; absent in render files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<State>,
    /// Texts of the configs that do not come with the program, by key; absent in render files.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub files: IndexMap<String, String>,
    /// Texts of stage modules that do not come with the program, by module key; absent in render files.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub modules: IndexMap<String, String>,
}

/// How a camera is chosen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Camera {
    /// By its place in the file.
    Index(u32),
    /// By its name.
    Name(String),
}

impl Camera {
    /// The word for the command line.
    pub fn word(&self) -> String {
        match self {
            Camera::Index(index) => index.to_string(),
            Camera::Name(name) => name.clone(),
        }
    }
}

/// What a picture's file may hold beside the radiance. Shown by the word for it in settings and on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aov {
    /// Standard errors.
    Variance,
    /// A picture of each strategy (s, t): the layers of this name in the plan.
    Strategies,
}

impl Aov {
    /// All of them.
    pub const ALL: [Aov; 2] = [Aov::Variance, Aov::Strategies];
}

impl fmt::Display for Aov {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(out)
    }
}

/// The value of a `--set`, with or without quotes in TOML.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SetValue {
    /// `true`
    Bool(bool),
    /// `8`
    Integer(i64),
    /// `0.5`
    Float(f64),
    /// `"fixed_i64"`
    Text(String),
}

impl SetValue {
    /// The word for `--set`.
    pub fn word(&self) -> String {
        match self {
            SetValue::Bool(value) => value.to_string(),
            SetValue::Integer(value) => value.to_string(),
            SetValue::Float(value) => value.to_string(),
            SetValue::Text(value) => value.clone(),
        }
    }
}

/// How far a saved picture is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    /// Samples per pixel in it.
    pub samples: u32,
    /// Batches they came in.
    pub batches: u32,
    /// What its paths counted, where stages count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tallies: Option<Tallied>,
}

/// What kernels are generated for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Target {
    /// A GPU, also where no adapter is there to ask.
    #[default]
    Gpu,
    /// A software device: workgroup barriers are dear, and a cache holds whole records.
    Cpu,
}

impl Target {
    /// That of an adapter.
    pub fn of(gpu: &Gpu) -> Self {
        if gpu.is_cpu() { Self::Cpu } else { Self::Gpu }
    }

    /// The shipped layout and schedule to use where none is chosen.
    fn layout_and_schedule(self) -> (&'static str, &'static str) {
        match self {
            Self::Gpu => ("split_compact", "ordered"),
            Self::Cpu => ("aos", "wavefront"),
        }
    }
}

impl RenderFile {
    /// Reads the text of a render file.
    ///
    /// # Errors
    /// User input, with the place in the text.
    pub fn parse(text: &str, name: &str) -> Result<Self, Error> {
        toml::from_str(text).map_err(|error| Error::input(error.to_string().trim_end()).in_file(name))
    }

    /// Makes relative files of a render file count from its folder, where they exist there.
    pub fn relative_to(&mut self, folder: &Path) {
        let words = [
            &mut self.pipeline,
            &mut self.layout,
            &mut self.schedule,
            &mut self.precision,
            &mut self.stages,
            &mut self.scene,
            &mut self.env,
        ];
        for word in words.into_iter().flatten() {
            let beside = folder.join(word.as_str());
            if beside.is_file() || (crate::configs::is_path(word) && beside.is_dir()) {
                *word = beside.to_string_lossy().into_owned();
            }
        }
    }

    /// The settings with those of `over` on top; `set` values are merged.
    #[must_use]
    pub fn overlaid(mut self, over: Self) -> Self {
        let mut set = std::mem::take(&mut self.set);
        set.extend(over.set);
        let mut files = std::mem::take(&mut self.files);
        files.extend(over.files);
        let mut modules = std::mem::take(&mut self.modules);
        modules.extend(over.modules);
        Self {
            doc: over.doc.or(self.doc),
            pipeline: over.pipeline.or(self.pipeline),
            layout: over.layout.or(self.layout),
            schedule: over.schedule.or(self.schedule),
            precision: over.precision.or(self.precision),
            scene: over.scene.or(self.scene),
            camera: over.camera.or(self.camera),
            size: over.size.or(self.size),
            spp: over.spp.or(self.spp),
            seed: over.seed.or(self.seed),
            env: over.env.or(self.env),
            env_scale: over.env_scale.or(self.env_scale),
            env_rotate: over.env_rotate.or(self.env_rotate),
            lens_radius: over.lens_radius.or(self.lens_radius),
            focus_distance: over.focus_distance.or(self.focus_distance),
            build: over.build.or(self.build),
            aov: if over.aov.is_empty() { self.aov } else { over.aov },
            set,
            state: over.state.or(self.state),
            stages: over.stages.or(self.stages),
            files,
            modules,
        }
    }

    /// Fills in what was not chosen: bidirectional path tracing in f32, with the layout and the schedule that are best on such an
    /// adapter (docs/performance.md). None of them changes the picture.
    #[must_use]
    pub fn with_defaults(self, target: Target) -> Self {
        let (layout, schedule) = target.layout_and_schedule();
        Self {
            pipeline: Some("sbdpt".to_owned()),
            layout: Some(layout.to_owned()),
            schedule: Some(schedule.to_owned()),
            precision: Some("f32".to_owned()),
            ..Self::default()
        }
        .overlaid(self)
    }

    /// Loads the scene, the default one when none is named.
    ///
    /// # Errors
    /// User input, when the scene or its sky cannot be read.
    pub fn load_scene(&self) -> Result<Scene, Error> {
        let options = LoadOptions {
            camera: self.camera.as_ref().map(Camera::word),
            size: self.size.map(Into::into),
            env: self.env.as_ref().map(Into::into),
            env_scale: self.env_scale,
            env_rotate_deg: self.env_rotate,
            lens_radius: self.lens_radius.unwrap_or(0.0),
            focus_distance: self.focus_distance,
            build: self.build.unwrap_or_default(),
            ..LoadOptions::default()
        };
        with_scene(self.scene.as_deref().unwrap_or(DEFAULT_SCENE), |path| scene::load(path, &options))
    }

    /// Whether a layer is asked for.
    pub fn wants(&self, layer: Aov) -> bool {
        self.aov.contains(&layer)
    }

    /// Refuses a plan that cannot give the layers asked for.
    ///
    /// # Errors
    /// User input, when the pipeline has no strategies.
    pub fn check_layers(&self, plan: &Plan) -> Result<(), Error> {
        let strategies = Aov::Strategies.to_string();
        if !self.wants(Aov::Strategies) || plan.layers.iter().any(|group| group.name == strategies) {
            return Ok(());
        }
        let pipeline = self.pipeline.as_deref().unwrap_or_default();
        Err(Error::input(format!("the pipeline `{pipeline}` has no strategies to show"))
            .help("bidirectional pipelines such as `sbdpt` have them"))
    }

    /// The settings as they go into the metadata of the picture that they gave.
    #[must_use]
    pub fn of_rendered(&self, rendered: &Rendered, until: Until) -> Self {
        let spp = match until {
            Until::Samples(samples) => Some(samples),
            Until::Seconds(_) | Until::Error(_) => None,
        };
        let totals = &rendered.totals;
        let state = State { samples: totals.samples, batches: totals.batches, tallies: totals.tallied.clone() };
        Self { spp, state: Some(state), ..self.clone() }
    }

    /// Resolves the axes to config keys; reads the user's own files into `library`.
    ///
    /// # Errors
    /// User input, when an axis is not chosen, or names what does not exist.
    pub fn selection(&self, library: &mut Library, effects: Effects) -> Result<Selection, Error> {
        for (key, text) in &self.files {
            library.add_own(key, text);
        }
        for (key, text) in &self.modules {
            library.add_module(key, &format!("{key}.wgsl"), text);
        }
        if let Some(folder) = &self.stages {
            library.add_module_folder(Path::new(folder))?;
        }
        let mut key = |axis: Axis, word: &Option<String>| match word {
            Some(word) => library.resolve(axis, word),
            None => Err(Error::input(format!("no {} is chosen", axis.word()))),
        };
        let recorded = self.wants(Aov::Strategies).then(|| (RECORD_STRATEGIES.to_owned(), true.to_string()));
        Ok(Selection {
            pipeline: key(Axis::Pipeline, &self.pipeline)?,
            layout: key(Axis::Layout, &self.layout)?,
            schedule: key(Axis::Schedule, &self.schedule)?,
            precision: key(Axis::Precision, &self.precision)?,
            set: self.set.iter().map(|(key, value)| (key.clone(), value.word())).chain(recorded).collect(),
            effects,
        })
    }

    /// Replaces files by their config keys, so that the settings no longer depend on where they lay: their texts go into `files`.
    pub fn pin(&mut self, selection: &Selection, library: &Library) {
        self.files = library.own.iter().cloned().collect();
        self.modules = library.own_modules.iter().cloned().collect();
        self.stages = None;
        let axes = [
            (&mut self.pipeline, &selection.pipeline),
            (&mut self.layout, &selection.layout),
            (&mut self.schedule, &selection.schedule),
            (&mut self.precision, &selection.precision),
        ];
        for (word, key) in axes {
            if self.files.contains_key(key) {
                *word = Some(key.clone());
            }
        }
    }

    /// As TOML, for the metadata of a picture.
    ///
    /// # Errors
    /// Failed, when a value has no TOML form.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string_pretty(self)
            .map_err(|error| Error::failed(format!("cannot write the settings as TOML: {error}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_win_and_sets_merge() {
        let file = RenderFile::parse(
            "pipeline = \"pt\"\nsize = [4, 2]\ncamera = 1\nset = { max_edges = 5, rr = true }",
            "a.toml",
        );
        let over = RenderFile {
            size: Some([8, 8]),
            set: IndexMap::from([("max_edges".to_owned(), SetValue::Text("9".to_owned()))]),
            ..RenderFile::default()
        };
        let merged = file.map(|file| file.overlaid(over)).unwrap_or_default();
        assert_eq!((merged.size, merged.pipeline.as_deref()), (Some([8, 8]), Some("pt")));
        assert_eq!(merged.camera, Some(Camera::Index(1)));
        assert_eq!(merged.set.values().map(SetValue::word).collect::<Vec<_>>(), ["9", "true"]);
    }

    #[test]
    fn what_is_not_chosen_suits_the_target() {
        let filled = |target| RenderFile::default().with_defaults(target);
        let axes = |settings: RenderFile| (settings.pipeline, settings.layout, settings.schedule, settings.precision);
        let words = |words: [&str; 4]| words.map(|word| Some(word.to_owned())).into();
        assert_eq!(axes(filled(Target::Gpu)), words(["sbdpt", "split_compact", "ordered", "f32"]));
        assert_eq!(axes(filled(Target::Cpu)), words(["sbdpt", "aos", "wavefront", "f32"]));
        let chosen = RenderFile { layout: Some("soa".to_owned()), ..RenderFile::default() };
        assert_eq!(chosen.with_defaults(Target::Gpu).layout.as_deref(), Some("soa"));
    }

    #[test]
    fn unknown_keys_are_refused_with_their_place() {
        let error = RenderFile::parse("sise = [4, 2]", "a.toml");
        assert!(error.is_err_and(|error| error.exit_code() == 2 && error.to_string().contains("sise")));
    }

    #[test]
    fn metadata_can_be_read_back() {
        let tallies = Tallied { counts: vec![3, 1 << 40], slots: 1 << 50, rated_counts: vec![2, 1], rated_slots: 7 };
        let settings = RenderFile {
            spp: Some(16),
            aov: vec![Aov::Strategies],
            state: Some(State { samples: 16, batches: 8, tallies: Some(tallies) }),
            files: IndexMap::from([("pipelines/mine.toml".to_owned(), "start = \"a\"\n".to_owned())]),
            set: IndexMap::from([("schedule.workgroup".to_owned(), SetValue::Text("128".to_owned()))]),
            ..RenderFile::default()
        };
        let again = settings.to_toml().and_then(|text| RenderFile::parse(&text, "metadata"));
        assert_eq!(again.ok(), Some(settings));
    }
}
