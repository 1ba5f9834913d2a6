//! Runs a study: scene after scene, and in each the variants in turn, as often as asked for. What an earlier call has rendered
//! with the same settings is taken over; results are written after every picture, so that an interrupted study goes on.

use super::file::{Against, Study, StudyScene, Variant, Wanted, file_name};
use super::report;
use super::results::{Errors, Reference, Results, Run, Skipped, State, difference_path, write_text};
use crate::compare::metrics::difference_picture;
use crate::configs::Library;
use crate::copy_rate::CopyRate;
use crate::device::Gpu;
use crate::error::Error;
use crate::image_file::Image;
use crate::kernel_profile::KernelProfile;
use crate::measurements::Measurements;
use crate::output::{make_folder, save};
use crate::picture::{Exposure, write_png};
use crate::render::{Progress, Session, Settings, Until};
use crate::scene::{Accelerator, Scene};
use crate::settings::RenderFile;
use kernelgen::Generated;
use kernelgen::config::model::Effects;
use std::path::Path;

/// The folder of pictures in that of the study.
const PICTURES: &str = "pictures";
/// The page with everything on it.
pub const REPORT: &str = "report.html";

/// Is told how a study goes.
pub trait Observer {
    /// A render begins; false stops the study before it.
    fn begin(&mut self, what: &str) -> bool;
    /// It goes on; false stops the study after the current samples.
    fn show(&mut self, progress: &Progress) -> bool;
    /// It is over.
    fn end(&mut self);
    /// Something that the user should know.
    fn note(&mut self, line: &str);
}

/// How a study went.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Everything found, by earlier calls too.
    pub results: Results,
    /// Pictures rendered by this call, references included.
    pub rendered: usize,
    /// Whether it was stopped before its end.
    pub stopped: bool,
}

/// Runs what is left of a study and writes results, pictures and report into its folder.
///
/// # Errors
/// User input for whatever the study names and is not there or is refused; failed when the device is lost or files cannot be written.
pub fn run(study: &Study, folder: &Path, gpu: &Gpu, observer: &mut dyn Observer) -> Result<Outcome, Error> {
    let mut runner = Runner::new(study, folder, gpu, observer)?;
    make_folder(folder)?;
    runner.measure_device()?;
    // What is going to be rendered anew must not pass for done when its picture is there and its numbers are not.
    runner.results().write(folder)?;
    for scene in study.scenes.iter().filter(|scene| scene.absence(&study.defaults).is_none()) {
        runner.scene(scene)?;
        if runner.stopped {
            break;
        }
    }
    runner.finish()
}

/// A picture of the study, rendered or not.
struct Task<'a> {
    scene: &'a StudyScene,
    variant: &'a Variant,
    repeat: u32,
    picture: String,
    wanted: Wanted,
    done: Option<Run>,
}

/// What is kept of a render besides its files.
struct Finished {
    generated: Generated,
    measured: Measurements,
    /// Mean radiance by channel, W m^-2 sr^-1.
    mean: [f64; 3],
}

/// The scene in memory, and the settings that it was loaded with.
struct Loaded {
    settings: RenderFile,
    scene: Scene,
}

struct Runner<'a> {
    study: &'a Study,
    folder: &'a Path,
    gpu: &'a Gpu,
    observer: &'a mut dyn Observer,
    tasks: Vec<Task<'a>>,
    skipped: Vec<Skipped>,
    references: Vec<Reference>,
    copy_rate: Option<CopyRate>,
    states: Vec<State>,
    loaded: Option<Loaded>,
    rendered: usize,
    stopped: bool,
}

impl<'a> Runner<'a> {
    fn new(study: &'a Study, folder: &'a Path, gpu: &'a Gpu, observer: &'a mut dyn Observer) -> Result<Self, Error> {
        let earlier = Results::read(folder)?;
        let mut skipped = Vec::new();
        let mut tasks = Vec::new();
        for scene in &study.scenes {
            match scene.absence(&study.defaults) {
                Some(reason) => skipped.push(Skipped { scene: scene.name.clone(), reason }),
                None => tasks.extend(tasks_of(study, scene, folder, &earlier)?),
            }
        }
        for left_out in &skipped {
            observer.note(&format!("scene `{}` is skipped: {}", left_out.scene, left_out.reason));
        }
        let in_study = |reference: &Reference| study.scenes.iter().any(|scene| scene.name == reference.scene);
        let references = earlier.references.into_iter().filter(in_study).collect();
        Ok(Self {
            study,
            folder,
            gpu,
            observer,
            tasks,
            skipped,
            references,
            copy_rate: earlier.copy_rate,
            states: earlier.states,
            loaded: None,
            rendered: 0,
            stopped: false,
        })
    }

    /// Measures the copy rate, unless an earlier call did on the same device.
    fn measure_device(&mut self) -> Result<(), Error> {
        if self.copy_rate.as_ref().is_none_or(|rate| rate.adapter != self.gpu.info.name) {
            self.copy_rate = CopyRate::measure(self.gpu)?;
        }
        Ok(())
    }

    /// Renders what is left of a scene, and measures it.
    fn scene(&mut self, scene: &StudyScene) -> Result<(), Error> {
        let tasks: Vec<usize> =
            (0..self.tasks.len()).filter(|&task| self.tasks[task].scene.name == scene.name).collect();
        self.check_variants(&tasks)?;
        let reference = self.reference(scene)?;
        for task in tasks {
            if self.stopped {
                return Ok(());
            }
            if self.tasks[task].done.is_none() {
                if !self.is_wanted(task) {
                    continue;
                }
                self.run_task(task)?;
            }
            if let Some(reference) = &reference {
                self.measure(task, reference)?;
            }
            self.results().write(self.folder)?;
        }
        Ok(())
    }

    /// Whether the repetitions before this one leave the time of its variant too uncertain.
    fn is_wanted(&self, task: usize) -> bool {
        let Task { scene, variant, .. } = &self.tasks[task];
        let of_both = |run: &&Run| run.scene == scene.name && run.variant == variant.name;
        let runs = self.tasks.iter().filter_map(|task| task.done.as_ref()).filter(of_both);
        self.study.repeat.wants_more(&runs.map(|run| run.measured.ms_per_frame()).collect::<Vec<_>>())
    }

    /// Generates all that will be rendered: better refused now than after the first pictures.
    fn check_variants(&mut self, tasks: &[usize]) -> Result<(), Error> {
        for &task in tasks {
            if self.tasks[task].done.is_some() || self.tasks[task].repeat > 0 {
                continue;
            }
            let settings = self.tasks[task].wanted.settings.clone();
            let loaded = self.load(&settings).map_err(|error| error.at(self.tasks[task].title()))?;
            let generated = generate(&settings, loaded.scene.effects.clone());
            self.loaded = Some(loaded);
            generated.map_err(|error| error.at(self.tasks[task].title()))?;
        }
        Ok(())
    }

    /// The scene of some settings: the one in memory, which is given away, if it is that.
    fn load(&mut self, settings: &RenderFile) -> Result<Loaded, Error> {
        let settings = scene_settings(settings);
        if let Some(loaded) = self.loaded.take().filter(|loaded| loaded.settings == settings) {
            return Ok(loaded);
        }
        let scene = settings.load_scene()?;
        scene.warnings.iter().for_each(|warning| self.observer.note(&format!("warning: {warning}")));
        Ok(Loaded { settings, scene })
    }

    /// The picture that those of a scene are measured against, rendered if need be.
    fn reference(&mut self, scene: &StudyScene) -> Result<Option<Image>, Error> {
        let against = self.study.against(scene).map_err(|error| error.at(format!("scene `{}`", scene.name)))?;
        let (found, image) = match against {
            None => (None, None),
            Some(Against::File(file)) => self.reference_file(scene, &file)?,
            Some(Against::Render(wanted)) => self.reference_render(scene, *wanted)?,
        };
        if found.as_ref() != self.references.iter().find(|reference| reference.scene == scene.name) {
            self.forget_errors(scene);
        }
        self.references.retain(|reference| reference.scene != scene.name);
        self.references.extend(found);
        Ok(image)
    }

    fn forget_errors(&mut self, scene: &StudyScene) {
        let runs =
            self.tasks.iter_mut().filter(|task| task.scene.name == scene.name).filter_map(|task| task.done.as_mut());
        runs.for_each(|run| run.errors = None);
    }

    fn reference_file(&mut self, scene: &StudyScene, file: &Path) -> Result<(Option<Reference>, Option<Image>), Error> {
        if !file.is_file() {
            let (name, file) = (&scene.name, file.display());
            self.observer.note(&format!("scene `{name}` is not measured: its reference `{file}` is not there"));
            return Ok((None, None));
        }
        let image = Image::load(file)?;
        self.check_sizes(scene, &image).map_err(|error| error.in_file(file))?;
        let picture = file.display().to_string();
        Ok((Some(Reference { scene: scene.name.clone(), picture, wanted: None }), Some(image)))
    }

    /// Refuses a reference of another size before anything is rendered, where the sizes are known.
    fn check_sizes(&self, scene: &StudyScene, reference: &Image) -> Result<(), Error> {
        let of_scene = self.tasks.iter().filter(|task| task.scene.name == scene.name);
        let mut sizes = of_scene.filter_map(|task| task.wanted.settings.size);
        let [width, height] = reference.size;
        match sizes.find(|size| *size != reference.size) {
            Some([x, y]) => {
                Err(Error::input(format!("the reference is {width}x{height} pixels, the pictures {x}x{y}"))
                    .at(format!("scene `{}`", scene.name))
                    .help(format!("`size = [{width}, {height}]`")))
            }
            None => Ok(()),
        }
    }

    fn reference_render(
        &mut self,
        scene: &StudyScene,
        wanted: Wanted,
    ) -> Result<(Option<Reference>, Option<Image>), Error> {
        let picture = format!("{PICTURES}/{}--reference.exr", file_name(&scene.name));
        let path = self.folder.join(&picture);
        let reference = Reference { scene: scene.name.clone(), picture, wanted: Some(wanted.clone()) };
        if !(self.references.contains(&reference) && path.is_file()) {
            let title = format!("the reference of scene `{}`", scene.name);
            if self.render(&wanted, &title, &path)?.is_none() {
                return Ok((None, None));
            }
        }
        Ok((Some(reference), Some(Image::load(&path)?)))
    }

    fn run_task(&mut self, task: usize) -> Result<(), Error> {
        let title = self.tasks[task].title();
        let wanted = self.tasks[task].wanted.clone();
        let path = self.folder.join(&self.tasks[task].picture);
        if let Some(finished) = self.render(&wanted, &title, &path)? {
            let Task { scene, variant, .. } = &self.tasks[task];
            let state = State::of(&scene.name, &variant.name, &finished.generated.report);
            self.states.retain(|known| known.scene != state.scene || known.variant != state.variant);
            self.states.push(state);
            self.tasks[task].finish(finished);
        }
        Ok(())
    }

    /// Renders and writes a picture; `None` when it was stopped.
    fn render(&mut self, wanted: &Wanted, title: &str, path: &Path) -> Result<Option<Finished>, Error> {
        if !self.observer.begin(title) {
            self.stopped = true;
            return Ok(None);
        }
        let result = self.render_loaded(wanted, path).map_err(|error| error.at(title));
        self.observer.end();
        result
    }

    fn render_loaded(&mut self, wanted: &Wanted, path: &Path) -> Result<Option<Finished>, Error> {
        let mut loaded = self.load(&wanted.settings)?;
        let result = self.render_scene(&mut loaded.scene, wanted, path);
        self.loaded = Some(loaded);
        result
    }

    fn render_scene(&mut self, scene: &mut Scene, wanted: &Wanted, path: &Path) -> Result<Option<Finished>, Error> {
        let gpu = self.gpu;
        let generated = generate(&wanted.settings, scene.effects.clone())?;
        scene.set_accelerator(Accelerator::of(&generated.plan))?;
        let settings = RenderFile { size: Some(scene.size().into()), ..wanted.settings.clone() };
        let (until, render) = (wanted.until(), render_settings(&settings));
        let scene = &*scene;
        let mut session = Session::new(gpu, &generated.plan, &|name| scene.resource(name), render, work(until))?;
        session.warm_up(until)?;
        let mut go_on = true;
        session.run(until, &mut |progress| {
            go_on &= self.observer.show(progress);
            go_on
        })?;
        self.stopped = !go_on;
        if self.stopped {
            return Ok(None);
        }
        let rendered = session.picture()?;
        let metadata = settings.of_rendered(&rendered, until);
        save(path, &rendered, &metadata, Exposure::Percentile)?;
        self.rendered += 1;
        let mut measured = Measurements::of(&rendered, &generated, gpu, &metadata);
        measured.kernel_profile = Some(KernelProfile::of(&generated.plan, &rendered, &session.occupancy()?)?);
        Ok(Some(Finished { mean: mean(&rendered.mean), measured, generated }))
    }

    /// Measures a picture against the reference, unless that has been done.
    fn measure(&mut self, task: usize, reference: &Image) -> Result<(), Error> {
        let title = self.tasks[task].title();
        let Some(run) = self.tasks[task].done.as_mut().filter(|run| run.errors.is_none()) else { return Ok(()) };
        let path = self.folder.join(&run.picture);
        let image = Image::load(&path)?;
        run.errors = Some(Errors::of(&image, reference, run.measured.seconds).map_err(|error| error.at(title))?);
        write_png(&difference_path(&path), image.size, &difference_picture(&image, reference))
    }

    fn results(&self) -> Results {
        let scenes = self.study.scenes.iter().map(|scene| &scene.name);
        let skipped = |name: &String| self.skipped.iter().any(|skipped| skipped.scene == *name);
        Results {
            title: self.study.title.clone(),
            doc: self.study.doc.clone(),
            variants: self.study.variants.iter().map(|variant| variant.name.clone()).collect(),
            scenes: scenes.filter(|name| !skipped(name)).cloned().collect(),
            skipped: self.skipped.clone(),
            references: self.references.clone(),
            copy_rate: self.copy_rate.clone(),
            states: self.states(),
            runs: self.tasks.iter().filter_map(|task| task.done.clone()).collect(),
        }
    }

    /// In the order of scenes and variants, whatever was rendered first.
    fn states(&self) -> Vec<State> {
        let first = self.tasks.iter().filter(|task| task.repeat == 0);
        let of = |task: &Task| {
            let is = |state: &&State| state.scene == task.scene.name && state.variant == task.variant.name;
            self.states.iter().find(is).cloned()
        };
        first.filter_map(of).collect()
    }

    fn finish(self) -> Result<Outcome, Error> {
        let results = self.results();
        results.write(self.folder)?;
        write_text(&self.folder.join(REPORT), &report::page(self.study, &results, self.folder)?)?;
        Ok(Outcome { results, rendered: self.rendered, stopped: self.stopped })
    }
}

impl Task<'_> {
    fn title(&self) -> String {
        let turn = if self.repeat > 0 { format!(", repetition {}", self.repeat) } else { String::new() };
        format!("variant `{}`, scene `{}`{turn}", self.variant.name, self.scene.name)
    }

    fn finish(&mut self, finished: Finished) {
        self.done = Some(Run {
            scene: self.scene.name.clone(),
            variant: self.variant.name.clone(),
            repeat: self.repeat,
            picture: self.picture.clone(),
            wanted: self.wanted.clone(),
            measured: finished.measured,
            mean: finished.mean,
            errors: None,
        });
    }
}

/// The pictures of a scene, turn after turn through the variants: what drifts with time meets them all alike.
fn tasks_of<'a>(
    study: &'a Study,
    scene: &'a StudyScene,
    folder: &Path,
    earlier: &Results,
) -> Result<Vec<Task<'a>>, Error> {
    let wanted = |variant| study.wanted(variant, scene).map_err(|error| error.at(format!("scene `{}`", scene.name)));
    let wanted = study.variants.iter().map(wanted).collect::<Result<Vec<_>, Error>>()?;
    let mut tasks = Vec::new();
    for repeat in 0..study.repeat.at_most {
        for (variant, wanted) in study.variants.iter().zip(&wanted) {
            let wanted = wanted.repeated(repeat);
            let picture = picture_name(&scene.name, &variant.name, repeat);
            let same = |run: &&Run| run.wanted == wanted && run.picture == picture;
            let done = earlier.runs.iter().find(same).filter(|run| folder.join(&run.picture).is_file()).cloned();
            tasks.push(Task { scene, variant, repeat, picture, wanted, done });
        }
    }
    Ok(tasks)
}

fn picture_name(scene: &str, variant: &str, repeat: u32) -> String {
    let turn = if repeat > 0 { format!("--{repeat}") } else { String::new() };
    format!("{PICTURES}/{}--{}{turn}.exr", file_name(scene), file_name(variant))
}

/// The keys that decide what is loaded.
fn scene_settings(settings: &RenderFile) -> RenderFile {
    RenderFile {
        scene: settings.scene.clone(),
        camera: settings.camera.clone(),
        size: settings.size,
        env: settings.env.clone(),
        env_scale: settings.env_scale,
        env_rotate: settings.env_rotate,
        lens_radius: settings.lens_radius,
        focus_distance: settings.focus_distance,
        build: settings.build,
        ..RenderFile::default()
    }
}

/// What a session is told.
pub(super) fn render_settings(settings: &RenderFile) -> Settings {
    Settings { size: settings.size.unwrap_or_default(), seed: settings.seed.unwrap_or(0), paths: None }
}

fn work(until: Until) -> Option<u32> {
    match until {
        Until::Samples(samples) => Some(samples),
        Until::Seconds(_) | Until::Error(_) => None,
    }
}

/// Generates a variant.
///
/// # Errors
/// User input, when a name is unknown or the generator refuses the variant.
pub(super) fn generate(settings: &RenderFile, effects: Effects) -> Result<Generated, Error> {
    let mut library = Library::default();
    let selection = settings.selection(&mut library, effects)?;
    let generated = kernelgen::generate(&library.sources, &selection)
        .map_err(|refusal| Error::input(format!("the generator refuses it\n{}", refusal.render(false).trim_end())))?;
    settings.check_layers(&generated.plan)?;
    Ok(generated)
}

fn mean(radiance: &[f32]) -> [f64; 3] {
    let pixels = (radiance.len() / 3).max(1) as f64;
    [0, 1, 2]
        .map(|channel| radiance.iter().skip(channel).step_by(3).map(|&value| f64::from(value)).sum::<f64>() / pixels)
}
