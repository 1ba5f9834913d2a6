//! The auto-tuner: which layout and schedule run a pipeline fastest on a scene and an adapter.

use super::halving::{self, Bench, Standing};
use super::run::{generate, render_settings};
use crate::configs::Axis;
use crate::device::Gpu;
use crate::error::{Error, Kind};
use crate::render::{Session, Until};
use crate::scene::{Accelerator, Scene};
use crate::settings::RenderFile;
use kernelgen::Generated;
use kernelgen::config::model::Effects;
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

/// A measurement is never shorter, s.
const SHORTEST: f64 = 0.02;
/// Codecs that lose nothing; a layout with others is not taken unless it is named.
const EXACT_CODECS: [&str; 3] = ["f32", "u32", "bits"];

/// What is searched.
#[derive(Clone, Debug)]
pub struct Search {
    /// Everything but layout and schedule.
    pub settings: RenderFile,
    /// Names or files; all shipped ones that store fields exactly when empty.
    pub layouts: Vec<String>,
    /// Names or files; all shipped ones when empty.
    pub schedules: Vec<String>,
    /// Time for the search, s.
    pub budget: f64,
}

/// A layout with a schedule.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Name or file.
    pub layout: String,
    /// Name or file.
    pub schedule: String,
    /// Wall-clock time of a million samples, ms, as measured last.
    pub ms_per_msample: Option<f64>,
    /// How often it was measured, each time for longer.
    pub rounds: u32,
    /// Why it was not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// Best first, then those that could not be measured.
    pub candidates: Vec<Candidate>,
    /// The settings with the best layout and schedule.
    pub winner: RenderFile,
    /// Time that the search took, s.
    pub seconds: f64,
}

/// Searches until the budget is spent or `watch`, which is told what is measured next, returns false.
///
/// # Errors
/// User input, when the scene cannot be read, a name is unknown or no candidate can run; failed when the device is lost.
pub fn tune(search: &Search, gpu: &Gpu, watch: &mut dyn FnMut(&str) -> bool) -> Result<Tuned, Error> {
    let start = Instant::now();
    let mut scene = search.settings.load_scene()?;
    let mut candidates = candidates(search);
    let prepared = candidates.par_iter_mut().map(|candidate| prepare(search, &scene.effects, candidate));
    let generated = prepared.collect::<Result<Vec<_>, Error>>()?;
    let able: Vec<usize> = (0..candidates.len()).filter(|&index| generated[index].is_some()).collect();
    let mut trial = Trial {
        search,
        gpu,
        scene: &mut scene,
        candidates,
        generated,
        able: able.clone(),
        watch,
        start,
        goes_on: true,
    };
    let standings = halving::halve(able.len(), search.budget, &mut trial)?;
    let mut candidates = trial.candidates;
    for (&index, standing) in able.iter().zip(&standings) {
        candidates[index].note(*standing);
    }
    let best = halving::winner(&standings).map(|winner| candidates[able[winner]].clone());
    let Some(best) = best else { return Err(none_ran(&candidates)) };
    let (layout, schedule) = (Some(best.layout), Some(best.schedule));
    let measured = best.ms_per_msample.unwrap_or_default();
    let doc = format!("Tuned on {}: {measured:.3} ms per million samples.", gpu.info.name);
    let over = RenderFile { layout, schedule, doc: Some(doc), ..RenderFile::default() };
    candidates.sort_by(|a, b| b.rounds.cmp(&a.rounds).then(a.cost().total_cmp(&b.cost())));
    Ok(Tuned { candidates, winner: search.settings.clone().overlaid(over), seconds: start.elapsed().as_secs_f64() })
}

/// Every layout with every schedule, the default ones first: a small budget may not reach the last.
fn candidates(search: &Search) -> Vec<Candidate> {
    let words = |given: &[String], axis: Axis| match given {
        [] => axis.names().into_iter().map(str::to_owned).collect(),
        given => given.to_vec(),
    };
    let schedules = words(&search.schedules, Axis::Schedule);
    let with_each = |layout: String| {
        schedules.iter().map(move |schedule| Candidate {
            layout: layout.clone(),
            schedule: schedule.clone(),
            ms_per_msample: None,
            rounds: 0,
            left_out: None,
        })
    };
    let mut all: Vec<Candidate> = words(&search.layouts, Axis::Layout).into_iter().flat_map(with_each).collect();
    let other = |word: &str, default: &Option<String>| default.as_deref() != Some(word);
    let RenderFile { layout, schedule, .. } = &search.settings;
    all.sort_by_key(|candidate| (other(&candidate.schedule, schedule), other(&candidate.layout, layout)));
    all
}

/// Generates a candidate, or notes why it is left out.
fn prepare(search: &Search, effects: &Effects, candidate: &mut Candidate) -> Result<Option<Generated>, Error> {
    let settings = candidate.settings(search);
    match generate(&settings, effects.clone()) {
        Ok(generated) => {
            if let Some(codec) = lossy_codec(&generated).filter(|_| search.layouts.is_empty()) {
                candidate.left_out = Some(format!("fields are stored as {codec}: name the layout to take it"));
                return Ok(None);
            }
            Ok(Some(generated))
        }
        // A shipped layout may be made for another pipeline; what the user names has to fit.
        Err(error) if error.kind == Kind::UserInput && search.layouts.is_empty() && search.schedules.is_empty() => {
            candidate.left_out = Some("the generator refuses it for this pipeline".to_owned());
            Ok(None)
        }
        Err(error) => Err(error.at(format!("layout `{}`, schedule `{}`", candidate.layout, candidate.schedule))),
    }
}

fn lossy_codec(generated: &Generated) -> Option<&str> {
    let fields = generated.report.tables.iter().flat_map(|table| &table.fields);
    fields.map(|field| field.codec.as_str()).find(|codec| !EXACT_CODECS.contains(codec))
}

fn none_ran(candidates: &[Candidate]) -> Error {
    let reason = candidates.iter().find_map(|candidate| candidate.left_out.clone());
    let error = Error::input("no layout and schedule could be measured");
    error.help(reason.unwrap_or_else(|| "a larger `--budget`".to_owned()))
}

impl Candidate {
    fn settings(&self, search: &Search) -> RenderFile {
        search.settings.clone().overlaid(RenderFile {
            layout: Some(self.layout.clone()),
            schedule: Some(self.schedule.clone()),
            ..RenderFile::default()
        })
    }

    fn note(&mut self, standing: Standing) {
        self.ms_per_msample = standing.cost;
        self.rounds = standing.rounds;
        if standing.rounds == 0 {
            self.left_out = Some("the budget was spent".to_owned());
        }
    }

    fn cost(&self) -> f64 {
        self.ms_per_msample.unwrap_or(f64::INFINITY)
    }
}

/// The candidates on the device.
struct Trial<'a> {
    search: &'a Search,
    gpu: &'a Gpu,
    scene: &'a mut Scene,
    candidates: Vec<Candidate>,
    generated: Vec<Option<Generated>>,
    /// Indices of those that were generated.
    able: Vec<usize>,
    watch: &'a mut dyn FnMut(&str) -> bool,
    start: Instant,
    goes_on: bool,
}

impl Bench for Trial<'_> {
    fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn goes_on(&self) -> bool {
        self.goes_on
    }

    fn measure(&mut self, candidate: usize, seconds: f64) -> Result<Option<f64>, Error> {
        let index = self.able[candidate];
        let Candidate { layout, schedule, .. } = &self.candidates[index];
        self.goes_on = (self.watch)(&format!("layout `{layout}`, schedule `{schedule}`, {seconds:.2} s"));
        match self.run(index, seconds) {
            Ok(cost) => Ok(Some(cost)),
            // It asks for more than the adapter has.
            Err(error) if error.kind == Kind::UserInput => {
                self.candidates[index].left_out = Some(error.message);
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

impl Trial<'_> {
    /// Milliseconds of a million samples; compilation counts against the seconds, but not in the result.
    fn run(&mut self, index: usize, seconds: f64) -> Result<f64, Error> {
        let start = Instant::now();
        let Some(generated) = &self.generated[index] else { return Err(Error::failed("the candidate was refused")) };
        self.scene.set_accelerator(Accelerator::of(&generated.plan))?;
        let scene = &*self.scene;
        let size: [u32; 2] = scene.size().into();
        let settings = RenderFile { size: Some(size), ..self.search.settings.clone() };
        let resources = |name: &str| scene.resource(name);
        let mut session = Session::new(self.gpu, &generated.plan, &resources, render_settings(&settings), None)?;
        session.take_full_passes();
        session.warm_up(Until::Seconds(seconds))?;
        let left = (seconds - start.elapsed().as_secs_f64()).max(SHORTEST);
        session.run(Until::Seconds(left), &mut |_| true)?;
        let rendered = session.picture()?;
        let samples = f64::from(size[0]) * f64::from(size[1]) * f64::from(rendered.samples_taken);
        Ok(1e9 * rendered.seconds / samples.max(1.0))
    }
}
