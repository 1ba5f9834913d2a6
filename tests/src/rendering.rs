//! Renders scenes for tests, two at a time, on the best adapter of the machine: Mesa's software driver in CI.

use crate::poison::{forget, poison};
use crate::scene_builder::SceneBuilder;
use crate::sky::Sky;
use crate::statistics::Pixels;
use kernelgen::Generated;
use kernelgen::plan::Plan;
use kernelgen::report::Report;
use kernelgen::source::FileKind;
use runtime::configs::Library;
use runtime::device::{DeviceOptions, Gpu};
use runtime::film::Sums;
use runtime::image_file::Image;
use runtime::pyramid;
use runtime::render::{Rendered, Session, Settings, Until};
use runtime::scene::{Accelerator, LoadOptions, Scene};
use runtime::settings::{Aov, RenderFile, SetValue, Target};
use runtime::tallies::Tallied;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError, TryLockError};

/// Batches that a render is cut into, so that its standard errors are good to a tenth.
const BATCHES: u32 = 64;

/// The devices of all tests of a program. Renders take turns on each: a software device renders with all cores, but compiles with one.
static DEVICES: LazyLock<[Mutex<Gpu>; 2]> = LazyLock::new(|| {
    let open =
        || Gpu::open(&DeviceOptions::default()).expect("there is a Vulkan device, if only Mesa's software driver");
    [Mutex::new(open()), Mutex::new(open())]
});

/// A device, free or the next in turn. A test that failed while it rendered leaves it as it was: every render makes its own buffers.
fn device() -> MutexGuard<'static, Gpu> {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    for device in DEVICES.iter() {
        match device.try_lock() {
            Ok(device) => return device,
            Err(TryLockError::Poisoned(failed)) => return failed.into_inner(),
            Err(TryLockError::WouldBlock) => {}
        }
    }
    let turn = NEXT.fetch_add(1, Ordering::Relaxed) % DEVICES.len();
    DEVICES[turn].lock().unwrap_or_else(PoisonError::into_inner)
}

/// What to render and how. Every setter returns the job.
#[derive(Clone, Debug)]
pub struct Job {
    scene: PathBuf,
    options: LoadOptions,
    settings: RenderFile,
    library: Library,
    size: [u32; 2],
    samples: u32,
    seed: u32,
    poisoned: bool,
    forgotten: Option<String>,
    probe: Option<fn(&mut Plan)>,
    paths: Option<u32>,
}

/// A rendered image and what was counted.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Radiance with standard errors.
    pub pixels: Pixels,
    /// Contributions that the film refused.
    pub rejected: u64,
    /// Rays of all kinds.
    pub rays: u64,
    /// Primary, secondary and deep rays among them.
    pub walk_rays: [u64; 3],
    /// Visibility rays among them.
    pub visibility: u64,
    /// Sums of a fixed-point film: what must be equal bit for bit where images must be. Empty for other films.
    pub sums: Vec<i64>,
    /// What stages tallied, for each path; empty where they tally nothing.
    pub tallies: Vec<f64>,
    /// Pictures of the strategies; empty where they are not recorded.
    pub strategies: Vec<Strategy>,
    /// Samples per pixel.
    pub samples: u32,
}

/// What one strategy of a bidirectional pipeline makes: `s` vertices from the eye walk, `t` from the light walk.
#[derive(Clone, Debug)]
pub struct Strategy {
    /// Vertices of the eye walk, the camera not counted.
    pub s: u32,
    /// Vertices of the light walk.
    pub t: u32,
    /// What it adds to the picture, with standard errors.
    pub weighted: Pixels,
    /// What it makes of the paths of its length alone, with standard errors.
    pub unweighted: Pixels,
}

impl Job {
    /// A job on a scene file, or on a folder with a `scene.toml`.
    pub fn of_file(scene: impl Into<PathBuf>) -> Job {
        Job {
            scene: scene.into(),
            options: LoadOptions::default(),
            settings: RenderFile::default().with_defaults(Target::Cpu),
            library: Library::default(),
            size: [32, 32],
            samples: 64,
            seed: 1,
            poisoned: false,
            forgotten: None,
            probe: None,
            paths: None,
        }
    }

    /// The pipeline.
    pub fn pipeline(mut self, name: &str) -> Job {
        self.settings.pipeline = Some(name.into());
        self
    }

    /// The layout.
    pub fn layout(mut self, name: &str) -> Job {
        self.settings.layout = Some(name.into());
        self
    }

    /// The schedule.
    pub fn schedule(mut self, name: &str) -> Job {
        self.settings.schedule = Some(name.into());
        self
    }

    /// The precision.
    pub fn precision(mut self, name: &str) -> Job {
        self.settings.precision = Some(name.into());
        self
    }

    /// Other configs and stages than the shipped ones.
    pub fn library(mut self, library: Library) -> Job {
        self.library = library;
        self
    }

    /// One module changed: `old`, which must stand in it exactly once, becomes `new`.
    #[track_caller]
    pub fn edited(mut self, key: &str, old: &str, new: &str) -> Job {
        let sources = &mut self.library.sources;
        let file = sources.find(FileKind::Module, key).unwrap_or_else(|| panic!("there is no module {key}"));
        let text = &sources.file(file).text;
        let count = text.matches(old).count();
        assert!(count == 1, "{key} has `{old}` {count} times, not once");
        let text = text.replacen(old, new, 1);
        sources.add(FileKind::Module, key, format!("{key}.wgsl"), text);
        self
    }

    /// The camera, by name or index.
    pub fn camera(mut self, name: &str) -> Job {
        self.options.camera = Some(name.into());
        self
    }

    /// A thin lens: its radius and the distance that is in focus, metres.
    pub fn lens(mut self, radius: f32, focus_distance: f32) -> Job {
        self.options.lens_radius = radius;
        self.options.focus_distance = Some(focus_distance);
        self
    }

    /// Width and height in pixels.
    pub fn size(mut self, width: u32, height: u32) -> Job {
        self.size = [width, height];
        self
    }

    /// Samples per pixel.
    pub fn samples(mut self, samples: u32) -> Job {
        self.samples = samples;
        self
    }

    /// Seed of the random numbers.
    pub fn seed(mut self, seed: u32) -> Job {
        self.seed = seed;
        self
    }

    /// Kernels begin with garbage in every field that they do not load.
    pub fn poisoned(mut self) -> Job {
        self.poisoned = true;
        self
    }

    /// Kernels are changed before they run, to measure what happens in them.
    pub fn probed(mut self, probe: fn(&mut Plan)) -> Job {
        self.probe = Some(probe);
        self
    }

    /// Kernels lack a load: the lines that begin so.
    pub fn forgetting(mut self, load: &str) -> Job {
        self.forgotten = Some(load.into());
        self
    }

    /// Path slots.
    pub fn paths(mut self, paths: u32) -> Job {
        self.paths = Some(paths);
        self
    }

    /// `--set KEY=VALUE`.
    pub fn set(mut self, key: &str, value: impl ToString) -> Job {
        self.settings.set.insert(key.into(), SetValue::Text(value.to_string()));
        self
    }

    /// Longest path in edges.
    pub fn edges(self, edges: u32) -> Job {
        self.set("max_edges", edges)
    }

    /// The fixed-point film: sums that do not depend on their order.
    pub fn fixed_point(self) -> Job {
        self.set("accumulate", "fixed_i64")
    }

    /// The layout and the schedule that are best on the adapter, in place of those for a software device.
    pub fn suited(mut self) -> Job {
        let suited = RenderFile::default().with_defaults(Target::of(&device()));
        self.settings = RenderFile { layout: suited.layout, schedule: suited.schedule, ..self.settings };
        self
    }

    /// Renders.
    #[track_caller]
    pub fn render(&self) -> Rendering {
        self.run(Some(self.samples), |session| {
            for batch in 1..=u64::from(BATCHES) {
                let samples = u64::from(self.samples) * batch / u64::from(BATCHES);
                session.run(Until::Samples(samples as u32), &mut |_| true).expect("the render runs");
            }
        })
    }

    /// Renders for so many seconds, loading and compilation left out.
    #[track_caller]
    pub fn render_for(&self, seconds: f64) -> Rendering {
        self.run(None, |session| {
            let until = Until::Seconds(seconds);
            session.warm_up(until).expect("the passes run");
            session.run(until, &mut |_| true).expect("the render runs");
        })
    }

    #[track_caller]
    fn run(&self, samples: Option<u32>, render: impl FnOnce(&mut Session)) -> Rendering {
        let mut scene = self.load();
        let mut plan = self.generate(&scene).unwrap_or_else(|refusal| panic!("{refusal}")).plan;
        if self.poisoned {
            poison(&mut plan);
        }
        if let Some(load) = &self.forgotten {
            forget(&mut plan, load);
        }
        if let Some(probe) = self.probe {
            probe(&mut plan);
        }
        if plan.buffers.iter().any(|buffer| buffer.name == "bvh2_nodes") {
            scene.set_accelerator(Accelerator::Bvh2).expect("the hierarchy can be traversed");
        }
        let gpu = device();
        let settings = Settings { size: self.size, seed: self.seed, paths: self.paths };
        let resources = |name: &str| scene.resource(name);
        let mut session = Session::new(&gpu, &plan, &resources, settings, samples).expect("the plan fits the device");
        render(&mut session);
        rendering(&session.picture().expect("the picture can be read"))
    }

    fn load(&self) -> Scene {
        let options = LoadOptions { size: Some((self.size[0], self.size[1])), ..self.options.clone() };
        runtime::scene::load(&self.scene, &options).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Whether the generator takes this pipeline with this layout and these settings.
    ///
    /// # Errors
    /// What the generator has against it, as it is printed.
    pub fn check(&self) -> Result<(), String> {
        self.generate(&self.load()).map(drop)
    }

    /// What lives where.
    #[track_caller]
    pub fn report(&self) -> Report {
        self.generate(&self.load()).unwrap_or_else(|refusal| panic!("{refusal}")).report
    }

    /// The kernels, and how they are run.
    #[track_caller]
    pub fn plan(&self) -> Plan {
        self.generate(&self.load()).unwrap_or_else(|refusal| panic!("{refusal}")).plan
    }

    fn generate(&self, scene: &Scene) -> Result<Generated, String> {
        let mut library = self.library.clone();
        let selection =
            self.settings.selection(&mut library, scene.effects.clone()).map_err(|error| error.to_string())?;
        kernelgen::generate(&library.sources, &selection).map_err(|refusal| refusal.render(false))
    }
}

fn rendering(rendered: &Rendered) -> Rendering {
    let counters = &rendered.counters;
    let unknown = vec![0.0; rendered.mean.len()];
    Rendering {
        pixels: pixels(rendered.size, &rendered.mean, rendered.standard_error.as_ref().unwrap_or(&unknown)),
        rejected: counters.rejected,
        rays: counters.primary + counters.secondary + counters.deep + counters.visibility,
        walk_rays: [counters.primary, counters.secondary, counters.deep],
        visibility: counters.visibility,
        sums: match &rendered.totals.sums {
            Sums::Fixed(units) => units.clone(),
            Sums::Float(_) => Vec::new(),
        },
        tallies: rendered.totals.tallied.as_ref().map(rates).unwrap_or_default(),
        strategies: strategies(rendered),
        samples: rendered.samples_taken,
    }
}

fn strategies(rendered: &Rendered) -> Vec<Strategy> {
    let group = Aov::Strategies.to_string();
    let means = pyramid::strategies(&|index| rendered.layer(&group, index));
    let errors = pyramid::strategies(&|index| rendered.layer_standard_error(&group, index));
    let pair = |(mean, error): (pyramid::Strategy, pyramid::Strategy)| {
        assert_eq!((mean.s, mean.t), (error.s, error.t), "a strategy has no standard errors");
        let with_errors = |mean: &[f32], error: &[f32]| pixels(rendered.size, mean, error);
        Strategy {
            s: mean.s,
            t: mean.t,
            weighted: with_errors(&mean.weighted, &error.weighted),
            unweighted: with_errors(&mean.unweighted, &error.unweighted),
        }
    };
    means.into_iter().zip(errors).map(pair).collect()
}

fn rates(tallied: &Tallied) -> Vec<f64> {
    tallied.counts.iter().map(|&count| count as f64 / tallied.slots as f64).collect()
}

fn pixels(size: [u32; 2], mean: &[f32], errors: &[f32]) -> Pixels {
    let triples = |values: &[f32]| values.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Pixels { width: size[0] as usize, height: size[1] as usize, rgb: triples(mean), errors: triples(errors) }
}

/// A scene of a test, written to a folder that is removed with it.
#[derive(Debug)]
pub struct BuiltScene {
    folder: PathBuf,
    sky: Option<PathBuf>,
}

/// A new temporary folder with this scene in it.
fn written(scene: &[u8]) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("pathloom-test-{}-{number}", std::process::id()));
    fs::create_dir_all(&folder).expect("the temporary folder can be written");
    fs::write(folder.join(BuiltScene::FILE), scene).expect("the scene can be written");
    folder
}

impl BuiltScene {
    /// Name of its file.
    pub const FILE: &str = "scene.glb";

    /// Writes a scene, with a sky or without.
    pub fn new(scene: &SceneBuilder, sky: Option<&Sky>) -> BuiltScene {
        let folder = written(&scene.to_glb());
        let sky = sky.map(|sky| {
            let path = folder.join("sky.exr");
            fs::write(&path, sky.to_exr().expect("the sky has texels")).expect("the sky can be written");
            path
        });
        BuiltScene { folder, sky }
    }

    /// Writes the bytes of a scene and the text of the `scene.toml` beside it.
    pub fn of_glb(bytes: &[u8], description: Option<String>) -> BuiltScene {
        let folder = written(bytes);
        if let Some(text) = description {
            fs::write(folder.join("scene.toml"), text).expect("the description can be written");
        }
        BuiltScene { folder, sky: None }
    }

    /// A job on this scene.
    pub fn job(&self) -> Job {
        let mut job = Job::of_file(self.folder.join(Self::FILE));
        job.options.env = self.sky.clone();
        job
    }
}

impl Drop for BuiltScene {
    fn drop(&mut self) {
        // What cannot be removed stays in the system's temporary folder; no test depends on it.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// The file of a shipped scene.
pub fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../configs/scenes/{name}/{name}.glb"))
}

/// A reference image: `R,G,B` the mean radiance, `sem.R,sem.G,sem.B` its standard error.
pub fn read_reference(path: &Path) -> Pixels {
    let image = Image::load(path).unwrap_or_else(|error| panic!("{error}"));
    let errors = image.standard_error.expect("a reference has standard errors");
    pixels(image.size, &image.radiance, &errors)
}
