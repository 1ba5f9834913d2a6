//! Study files: variants, scenes, and what the pictures are measured against.

use super::axes::Axes;
use super::interval::Repeat;
use crate::configs::{Axis, Library, is_path, scene_names, unknown};
use crate::error::Error;
use crate::render::Until;
use crate::settings::{Aov, RenderFile, Target};
use kernelgen::config::model::Effects;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Samples per pixel when neither samples nor seconds are given.
const DEFAULT_SAMPLES: u32 = 64;
/// Added to the seed of a reference: its samples must not be those of the pictures that it judges.
const REFERENCE_SEED: u32 = 0x5eed_0000;

/// A study as it stands in its file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Name of the file without its extension.
    #[serde(skip)]
    pub name: String,
    /// What it is going to run on.
    #[serde(skip)]
    pub target: Target,
    /// Heading of the report.
    pub title: String,
    /// What it shows.
    #[serde(default)]
    pub doc: String,
    /// How often everything is rendered, each time with another seed.
    #[serde(default)]
    pub repeat: Repeat,
    /// What holds unless a scene or a variant says otherwise.
    #[serde(default)]
    pub defaults: Defaults,
    /// Lists whose combinations are variants before those of `variants`.
    #[serde(default)]
    axes: Axes,
    /// What is compared; once the file is read, the combinations of its axes too.
    #[serde(default, rename = "variant")]
    pub variants: Vec<Variant>,
    /// On what.
    #[serde(rename = "scene")]
    pub scenes: Vec<StudyScene>,
}

/// Settings of all renders.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Defaults {
    /// Time for one picture, s, instead of `spp`.
    pub seconds: Option<f64>,
    /// All other keys.
    #[serde(flatten)]
    pub settings: RenderFile,
}

/// One of the things compared.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Its name in tables and pictures.
    pub name: String,
    /// Time for one picture, s, instead of `spp`.
    pub seconds: Option<f64>,
    /// All other keys.
    #[serde(flatten)]
    pub settings: RenderFile,
}

/// A scene and what its pictures are measured against.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyScene {
    /// Its name in tables and pictures, and the scene unless `scene` says otherwise.
    pub name: String,
    /// Time for one picture, s, instead of `spp`.
    pub seconds: Option<f64>,
    /// A picture to measure against.
    pub reference: Option<PathBuf>,
    /// A variant to measure against, rendered anew.
    pub reference_variant: Option<String>,
    /// Samples per pixel of that.
    pub reference_spp: Option<u32>,
    /// All other keys.
    #[serde(flatten)]
    pub settings: RenderFile,
}

/// A render as it was asked for: equal ones need not be done twice.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Time for the picture, s, instead of `spp`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Everything else.
    pub settings: RenderFile,
}

/// What the pictures of a scene are measured against.
#[derive(Clone, Debug, PartialEq)]
pub enum Against {
    /// A picture that is there.
    File(PathBuf),
    /// A picture that the study renders.
    Render(Box<Wanted>),
}

impl Study {
    /// Reads a study by the name of a shipped one or by its file, from whose folder its files count.
    ///
    /// # Errors
    /// User input, with the place in the text.
    pub fn load(word: &str) -> Result<Self, Error> {
        if let Some(text) = Axis::Study.shipped(word) {
            return Self::parse(text, &format!("configs/studies/{word}.toml"));
        }
        if !is_path(word) {
            return Err(unknown(Axis::Study, word));
        }
        let path = Path::new(word);
        let text = std::fs::read_to_string(path).map_err(|error| {
            let shipped = format!("shipped studies: {}", Axis::Study.names().join(", "));
            Error::input(format!("cannot read the study: {error}")).in_file(path).help(shipped)
        })?;
        let mut study = Self::parse(&text, word)?;
        study.relative_to(path.parent().unwrap_or(Path::new("")));
        Ok(study)
    }

    /// Reads the text of a study file.
    ///
    /// # Errors
    /// User input, with the place in the text.
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let mut study: Self =
            toml::from_str(text).map_err(|error| Error::input(error.to_string().trim_end()).in_file(file))?;
        study.name = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        study.multiply(text).and_then(|()| study.check()).map_err(|error| error.in_file(file))?;
        Ok(study)
    }

    /// Puts the combinations of the axes before the variants.
    fn multiply(&mut self, text: &str) -> Result<(), Error> {
        let mut variants = self.axes.variants(text)?;
        variants.append(&mut self.variants);
        if variants.is_empty() {
            return Err(Error::input("there is nothing to compare")
                .help("`[[variant]]` tables, or lists in `[axes]` such as `layout = [\"aos\", \"soa\"]`"));
        }
        self.variants = variants;
        Ok(())
    }

    fn relative_to(&mut self, folder: &Path) {
        self.defaults.settings.relative_to(folder);
        for variant in &mut self.variants {
            variant.settings.relative_to(folder);
        }
        for scene in &mut self.scenes {
            scene.settings.relative_to(folder);
            let beside = scene.reference.as_ref().map(|reference| folder.join(reference));
            scene.reference = beside.filter(|beside| beside.is_file()).or(scene.reference.take());
        }
    }

    fn check(&self) -> Result<(), Error> {
        self.check_names()?;
        check_length(self.defaults.seconds, &self.defaults.settings).map_err(|error| error.at("defaults"))?;
        for variant in &self.variants {
            let place = format!("variant `{}`", variant.name);
            check_length(variant.seconds, &variant.settings).map_err(|error| error.at(place))?;
        }
        for scene in &self.scenes {
            self.check_scene(scene).map_err(|error| error.at(format!("scene `{}`", scene.name)))?;
        }
        Ok(())
    }

    /// Pictures are named after a scene and a variant: no two may have one name.
    fn check_names(&self) -> Result<(), Error> {
        let mut seen = BTreeSet::new();
        for (kind, name) in self.scenes.iter().map(|scene| ("scene", &scene.name)).chain(self.variant_names()) {
            if name.trim().is_empty() {
                return Err(Error::input(format!("a {kind} has an empty name")));
            }
            if !seen.insert((kind, file_name(name))) {
                return Err(Error::input(format!(
                    "there are two {kind}s whose files would be called `{}`",
                    file_name(name)
                ))
                .help("letters, digits, `.` and `-` tell names apart"));
            }
        }
        Ok(())
    }

    fn variant_names(&self) -> impl Iterator<Item = (&'static str, &String)> {
        self.variants.iter().map(|variant| ("variant", &variant.name))
    }

    fn check_scene(&self, scene: &StudyScene) -> Result<(), Error> {
        check_length(scene.seconds, &scene.settings)?;
        match (&scene.reference, &scene.reference_variant, scene.reference_spp) {
            (Some(_), Some(_), _) => {
                Err(Error::input("it has both `reference` and `reference_variant`").help("one of them"))
            }
            (_, None, Some(_)) => Err(Error::input("`reference_spp` needs a `reference_variant`")),
            (_, Some(_), None | Some(0)) => {
                Err(Error::input("`reference_variant` needs a `reference_spp`, at least 1 sample per pixel"))
            }
            (_, Some(name), Some(_)) => self.variant(name).map(drop),
            (_, None, None) => Ok(()),
        }
    }

    fn variant(&self, name: &str) -> Result<&Variant, Error> {
        let known = || self.variants.iter().map(|variant| variant.name.as_str());
        self.variants.iter().find(|variant| variant.name == name).ok_or_else(|| {
            let error = Error::input(format!("there is no variant `{name}` to measure against"));
            match kernelgen::config::nearest(name, known()) {
                Some(near) => error.help(format!("did you mean `{near}`?")),
                None => error.help(format!("there are {}", known().collect::<Vec<_>>().join(", "))),
            }
        })
    }

    /// What is rendered for a variant on a scene: the defaults, over them the scene's settings, over them the variant's.
    ///
    /// # Errors
    /// User input, when an axis names what does not exist.
    pub fn wanted(&self, variant: &Variant, scene: &StudyScene) -> Result<Wanted, Error> {
        let name = RenderFile { scene: Some(scene.name.clone()), ..RenderFile::default() };
        let wanted = Wanted { seconds: None, settings: name.with_defaults(self.target) }
            .overlaid(self.defaults.seconds, &self.defaults.settings)
            .overlaid(scene.seconds, &scene.settings)
            .overlaid(variant.seconds, &variant.settings);
        let place = format!("variant `{}`", variant.name);
        wanted.finished().map_err(|error| error.at(place))
    }

    /// What the pictures of a scene are measured against, if anything.
    ///
    /// # Errors
    /// As `wanted`.
    pub fn against(&self, scene: &StudyScene) -> Result<Option<Against>, Error> {
        if let Some(file) = &scene.reference {
            return Ok(Some(Against::File(file.clone())));
        }
        let Some(name) = &scene.reference_variant else { return Ok(None) };
        let mut wanted = self.wanted(self.variant(name)?, scene)?;
        wanted.seconds = None;
        wanted.settings.spp = scene.reference_spp;
        wanted.settings.seed = wanted.settings.seed.map(|seed| seed.wrapping_add(REFERENCE_SEED));
        Ok(Some(Against::Render(Box::new(wanted))))
    }
}

impl StudyScene {
    /// Why it cannot be rendered here, when it is a file that is not there.
    pub fn absence(&self, defaults: &Defaults) -> Option<String> {
        let word = self.settings.scene.as_ref().or(defaults.settings.scene.as_ref())?;
        let shipped = scene_names().contains(&word.as_str());
        let file = word.contains(['/', '\\']) || Path::new(word).extension().is_some();
        (file && !shipped && !Path::new(word).exists()).then(|| format!("`{word}` is not there"))
    }
}

impl Wanted {
    /// Settings and length with others on top; samples and seconds replace each other.
    fn overlaid(self, seconds: Option<f64>, over: &RenderFile) -> Self {
        let mut settings = self.settings.overlaid(over.clone());
        if seconds.is_some() {
            settings.spp = None;
        }
        let kept = self.seconds.filter(|_| over.spp.is_none());
        Self { seconds: seconds.or(kept), settings }
    }

    /// With what depends on files made independent of them.
    fn finished(mut self) -> Result<Self, Error> {
        let mut library = Library::default();
        let selection = self.settings.selection(&mut library, Effects::new())?;
        self.settings.pin(&selection, &library);
        self.settings.doc = None;
        self.settings.seed.get_or_insert(0);
        if !self.settings.wants(Aov::Variance) {
            // z-scores weigh differences against the noise.
            self.settings.aov.push(Aov::Variance);
        }
        if self.seconds.is_none() {
            self.settings.spp.get_or_insert(DEFAULT_SAMPLES);
        }
        Ok(self)
    }

    /// The same with the seed of a repetition.
    #[must_use]
    pub fn repeated(&self, repeat: u32) -> Self {
        let mut again = self.clone();
        again.settings.seed = again.settings.seed.map(|seed| seed.wrapping_add(repeat));
        again
    }

    /// When it is done.
    pub fn until(&self) -> Until {
        match self.seconds {
            Some(seconds) => Until::Seconds(seconds),
            None => Until::Samples(self.settings.spp.unwrap_or(DEFAULT_SAMPLES)),
        }
    }
}

fn check_length(seconds: Option<f64>, settings: &RenderFile) -> Result<(), Error> {
    match (seconds, settings.spp) {
        (Some(_), Some(_)) => Err(Error::input("it has both `seconds` and `spp`").help("one of them")),
        (Some(seconds), None) if !(seconds.is_finite() && seconds > 0.0) => {
            Err(Error::input(format!("`seconds = {seconds}`: the time must be more than 0")))
        }
        (None, Some(0)) => Err(Error::input("`spp` must be at least 1")),
        _ => Ok(()),
    }
}

/// A name as part of a file's name.
pub fn file_name(name: &str) -> String {
    let plain = |letter: char| if letter.is_ascii_alphanumeric() || ".-".contains(letter) { letter } else { '_' };
    name.chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        title = "Two"
        [defaults]
        pipeline = "pt"
        seconds = 2
        set = { max_edges = 4 }
        [[variant]]
        name = "a"
        [[variant]]
        name = "b"
        pipeline = "nee"
        spp = 8
        set = { accelerator = "bvh2" }
        [[scene]]
        name = "cornell_box"
        size = [8, 8]
        set = { max_edges = 6 }
        reference_variant = "b"
        reference_spp = 100
    "#;

    fn study(text: &str) -> Result<Study, Error> {
        Study::parse(text, "a.toml")
    }

    #[test]
    fn variants_lie_over_scenes_over_defaults() -> Result<(), Error> {
        let study = study(TEXT)?;
        let [a, b] = [0, 1].map(|variant| study.wanted(&study.variants[variant], &study.scenes[0]));
        let (a, b) = (a?, b?.repeated(3));
        assert_eq!((a.seconds, a.settings.spp, a.settings.pipeline.as_deref()), (Some(2.0), None, Some("pt")));
        assert_eq!((b.seconds, b.settings.spp, b.settings.pipeline.as_deref()), (None, Some(8), Some("nee")));
        assert_eq!((b.settings.set.len(), b.settings.set["max_edges"].word()), (2, "6".to_owned()));
        assert_eq!((b.settings.scene.as_deref(), b.settings.seed), (Some("cornell_box"), Some(3)));
        Ok(())
    }

    #[test]
    fn a_reference_has_other_samples() -> Result<(), Error> {
        let study = study(TEXT)?;
        let Some(Against::Render(wanted)) = study.against(&study.scenes[0])? else {
            return Err(Error::failed("the reference is rendered"));
        };
        assert_eq!((wanted.until(), wanted.settings.seed), (Until::Samples(100), Some(REFERENCE_SEED)));
        Ok(())
    }

    #[track_caller]
    fn refused(old: &str, new: &str, words: &[&str]) {
        let error = study(&TEXT.replace(old, new)).expect_err("the study is refused");
        assert_eq!(error.exit_code(), 2);
        let said = error.to_string();
        words.iter().for_each(|word| assert!(said.contains(word), "`{word}` is not in: {said}"));
    }

    #[test]
    fn mistakes_are_named() {
        refused("title", "tilte", &["a.toml", "tilte"]);
        refused("spp = 8", "sp = 8", &["unknown field `sp`"]);
        refused("size = [8, 8]", "sise = [8, 8]", &["unknown field `sise`"]);
        refused("seconds = 2", "seconds = 0", &["defaults", "more than 0"]);
        refused("seconds = 2", "seconds = 2\nspp = 1", &["defaults", "both `seconds` and `spp`"]);
        refused("name = \"b\"", "name = \"a\"", &["two variants", "`a`"]);
        refused("reference_variant = \"b\"", "reference_variant = \"c\"", &["scene `cornell_box`", "no variant `c`"]);
        refused("reference_spp = 100", "", &["needs a `reference_spp`"]);
    }

    #[test]
    fn products_come_before_variants() -> Result<(), Error> {
        let study = study(&TEXT.replace("[defaults]", "[axes]\nlayout = [\"aos\", \"soa\"]\n[defaults]"))?;
        let names: Vec<&str> = study.variants.iter().map(|variant| variant.name.as_str()).collect();
        assert_eq!(names, ["aos", "soa", "a", "b"]);
        Ok(())
    }

    #[test]
    fn mistakes_in_products_are_named() {
        let axes = |text: &str| format!("[axes]\n{text}\n        [defaults]");
        refused("[defaults]", &axes("layout = [\"sao\"]"), &["a.toml: line 4, axes.layout", "no layout named `sao`"]);
        refused("[defaults]", &axes("layout = [\"a\"]"), &["no layout named `a`"]);
        refused("name = \"b\"", "name = \"b\"\nsets = 3", &["unknown field `sets`"]);
        let nothing = "title = \"t\"\n[[scene]]\nname = \"cornell_box\"\n";
        let error = study(nothing).expect_err("there is no variant").to_string();
        assert!(error.contains("nothing to compare") && error.contains("[axes]"), "{error}");
        let twice = TEXT.replace("[defaults]", &axes("layout = [\"aos\"]")).replace("name = \"a\"", "name = \"aos\"");
        let error = study(&twice).expect_err("two variants of one name").to_string();
        assert!(error.contains("two variants"), "{error}");
    }

    #[test]
    fn an_unknown_axis_names_its_variant() -> Result<(), Error> {
        let study = study(&TEXT.replace("\"nee\"", "\"ne\""))?;
        let error = study.wanted(&study.variants[1], &study.scenes[0]);
        assert!(error.is_err_and(|error| error.to_string().contains("variant `b`") && error.exit_code() == 2));
        Ok(())
    }
}
