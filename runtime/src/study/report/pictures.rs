//! Pictures of a scene side by side and one over the other, and their differences from the reference.

use super::html::{element, figure, section};
use crate::compare::Image;
use crate::error::Error;
use crate::picture::{Exposure, png, to_srgb};
use crate::pyramid;
use crate::settings::Aov;
use crate::study::chart::{escape, shown};
use crate::study::results::{Errors, Reference, Results, Run, difference_path};
use std::path::Path;

/// Beyond this z-score of a block a picture differs from its reference by more than noise.
const LARGE_Z: f64 = 6.0;

/// The pictures of a scene that are on the page, for the slider to choose from.
struct Shown<'a> {
    scene: &'a str,
    names: Vec<String>,
}

impl Shown<'_> {
    /// A figure that the slider knows.
    fn figure(&mut self, name: &str, caption: &str, png: &[u8]) -> String {
        let id = self.id(self.names.len());
        self.names.push(name.to_owned());
        figure(&id, caption, png)
    }

    fn id(&self, index: usize) -> String {
        format!("{}/{index}", self.scene)
    }

    /// Two pictures one over the other, the first two at the beginning; nothing where there is only one.
    fn slider(&self) -> String {
        if self.names.len() < 2 {
            return String::new();
        }
        let select = |label: &str, chosen: usize| {
            let inner = format!("{label} {}", element("select", "", &self.options(chosen)));
            element("label", "", &inner)
        };
        let images = "<img alt=\"left\"><img alt=\"right\">";
        let slider =
            "<input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"where the right picture begins\">";
        let inner = select("left", 0) + &select("right", 1) + slider + &element("div", "class=\"over\"", images);
        element("div", "class=\"compare\"", &inner)
    }

    fn options(&self, chosen: usize) -> String {
        let option = |(index, name): (usize, &String)| {
            let selected = if index == chosen { " selected" } else { "" };
            element("option", &format!("value=\"{}\"{selected}", escape(&self.id(index))), &escape(name))
        };
        self.names.iter().enumerate().map(option).collect()
    }
}

/// The pictures of a scene side by side, all with one exposure, and their differences from the reference.
pub fn section_of(results: &Results, scene: &str, folder: &Path) -> Result<String, Error> {
    let runs: Vec<&Run> =
        results.variants.iter().filter_map(|variant| results.of(scene, variant).first().copied()).collect();
    let Some(first) = runs.first() else { return Ok(String::new()) };
    let reference = results.reference(scene).map(|reference| load_reference(reference, folder)).transpose()?;
    let exposing = match &reference {
        Some(image) => image.clone(),
        None => Image::load(&folder.join(&first.picture))?,
    };
    let factor = Exposure::Percentile.factor(&exposing.radiance);
    let mut shown = Shown { scene, names: Vec::new() };
    let mut figures = String::new();
    if let Some(image) = &reference {
        figures += &shown.figure("reference", "reference", &exposed(image, factor)?);
    }
    for run in &runs {
        let image = Image::load(&folder.join(&run.picture))?;
        figures += &shown.figure(&run.variant, &caption(run), &exposed(&image, factor)?);
    }
    let differences = differences(&mut shown, &runs, folder)?;
    let doc = "All with one exposure: that of the reference, or of the first picture where there is none.";
    Ok(section(
        &format!("Pictures, scene {scene}"),
        &(shown.slider() + &gallery(doc, &figures) + &differences + &pyramids(&runs, folder)?),
    ))
}

/// Figures side by side under a line about them; nothing without figures.
fn gallery(doc: &str, figures: &str) -> String {
    if figures.is_empty() {
        return String::new();
    }
    element("p", "", doc) + &element("div", "class=\"pictures\"", figures)
}

fn load_reference(reference: &Reference, folder: &Path) -> Result<Image, Error> {
    match reference.wanted {
        Some(_) => Image::load(&folder.join(&reference.picture)),
        None => Image::load(Path::new(&reference.picture)),
    }
}

fn exposed(image: &Image, factor: f32) -> Result<Vec<u8>, Error> {
    png(image.size, &to_srgb(&image.radiance, factor))
}

fn caption(run: &Run) -> String {
    let measured = &run.measured;
    format!("{}: {} samples per pixel, {} s", run.variant, measured.samples_per_pixel, shown(measured.seconds))
}

fn differences(shown: &mut Shown, runs: &[&Run], folder: &Path) -> Result<String, Error> {
    let mut figures = String::new();
    for run in runs {
        let Some(errors) = &run.errors else { continue };
        let bytes = read(&difference_path(&folder.join(&run.picture)))?;
        let name = format!("{}, difference", run.variant);
        figures += &shown.figure(&name, &difference_caption(run, errors), &bytes);
    }
    let doc = "Difference from the reference (FLIP): black where nothing differs, white where everything does.";
    Ok(gallery(doc, &figures))
}

fn difference_caption(run: &Run, errors: &Errors) -> String {
    let beyond = errors.max_block_z.filter(|&z| z > LARGE_Z).map_or("", |_| "; beyond noise");
    format!("{}: FLIP {}, relative MSE {}{beyond}", run.variant, shown(errors.flip), shown(errors.relmse))
}

/// The pyramids of strategies, where they were asked for.
fn pyramids(runs: &[&Run], folder: &Path) -> Result<String, Error> {
    let mut figures = String::new();
    for run in runs.iter().filter(|run| run.wanted.settings.wants(Aov::Strategies)) {
        for path in pyramid::files(&folder.join(&run.picture)) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            figures += &figure("", &name, &read(&path)?);
        }
    }
    let doc = "Strategies of s vertices from the camera and t from a light, a row for each length of path. Weighted they add up to the \
               picture; unweighted each shows what it would make of the paths of its length alone.";
    Ok(gallery(doc, &figures))
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|error| Error::failed(format!("cannot read the picture: {error}")).in_file(path))
}
