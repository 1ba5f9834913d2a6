//! A render from plan to picture: splits pixels x samples into passes and batches, keeps passes in flight, adds up what they count.

use crate::buffers::{Buffers, Resources, choose_path_count, usable_slots};
use crate::counters::Counters;
use crate::device::Gpu;
use crate::error::Error;
use crate::execute::{Compiled, Executor, IN_FLIGHT, Pass};
use crate::film::{Accumulator, Totals, shares};
use crate::occupancy::Occupancy;
use crate::profile::Profile;
use crate::tallies::{PILOT_SEED, Tallies};
use kernelgen::plan::{Layers, Plan, Role};
use std::time::Instant;

/// Passes are cut so that one takes about this long, s: drivers and Ctrl-C get their turn.
const PASS_SECONDS: f64 = 0.5;
/// A pass is never cut below this many slots.
const SMALLEST_PASS: u32 = 16_384;
/// A render of known length is cut into at least this many batches, for standard errors.
const FEWEST_BATCHES: u32 = 8;
/// Every pass up to this one is measured, and then every so many-th.
const MEASURED_FIRST: u64 = 8;
const MEASURED_EVERY: u64 = 16;
/// How often the error is looked at when rendering until it is small, s.
const ERROR_SECONDS: f64 = 1.0;
/// How long a warm-up lasts, s: clocks of idle cards take some tenths of a second to rise.
const WARM_UP_SECONDS: f64 = 0.2;
/// The most passes whose queues are counted.
const COUNTED_PASSES: u64 = 4;

/// What is rendered, besides the plan and the scene.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Seed of the random numbers; equal seeds give equal samples.
    pub seed: u32,
    /// Path slots; the adapter's default when `None`.
    pub paths: Option<u32>,
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Until {
    /// At this many samples per pixel in total, earlier runs included.
    Samples(u32),
    /// After this many seconds of rendering, at the next whole sample.
    Seconds(f64),
    /// When the relative error (see `Totals::relative_error`) is at most this.
    Error(f64),
}

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Samples (pixels x samples per pixel) taken since the session began.
    pub taken: u64,
    /// Samples per second so far.
    pub per_second: f64,
    /// Part of the work done, 0 to 1, when it is known.
    pub part: Option<f64>,
}

/// A finished picture, or one that was stopped early.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Groups of layers behind the picture.
    pub layers: Vec<Layers>,
    /// Everything accumulated, also by earlier runs.
    pub totals: Totals,
    /// Mean radiance, three channels a pixel, row by row from the top, W m^-2 sr^-1.
    pub mean: Vec<f32>,
    /// Its standard error; `None` before the second batch.
    pub standard_error: Option<Vec<f32>>,
    /// Samples per pixel taken by this run.
    pub samples_taken: u32,
    /// Counts of this run.
    pub counters: Counters,
    /// Seconds of rendering, compilation and loading left out.
    pub seconds: f64,
    /// Device times.
    pub profile: Profile,
    /// What the compilation took.
    pub compiled: Compiled,
}

impl Rendered {
    /// Mean of a layer, without correction; `None` where there is no such group or index.
    pub fn layer(&self, group: &str, index: u32) -> Option<Vec<f32>> {
        Some(self.totals.plane_mean(self.plane(group, index)?))
    }

    /// Standard error of the mean of a layer; `None` also before the second batch.
    pub fn layer_standard_error(&self, group: &str, index: u32) -> Option<Vec<f32>> {
        self.totals.plane_standard_error(self.plane(group, index)?)
    }

    fn plane(&self, group: &str, index: u32) -> Option<usize> {
        let group = self.layers.iter().find(|layers| layers.name == group)?;
        (index < group.size).then_some((group.first + index) as usize)
    }
}

/// A render in progress.
#[derive(Debug)]
pub struct Session {
    gpu: Gpu,
    executor: Executor,
    accumulator: Accumulator,
    layers: Vec<Layers>,
    tallies: Option<Tallies>,
    /// Whether the pilot is still to come.
    unpiloted: bool,
    settings: Settings,
    /// Path slots that a pass may use.
    slots: u32,
    /// Paths that a pass may have.
    most_paths: u32,
    pass_limit: u32,
    full_passes: bool,
    samples: u32,
    batches: u32,
    spread_known: bool,
    samples_before: u32,
    passes: u64,
    finished: Option<Instant>,
    taken: u64,
    counters: Counters,
    seconds: f64,
    sizes: std::collections::VecDeque<u32>,
}

impl Session {
    /// Allocates, uploads and compiles. `work` is the number of samples per pixel to come, where it is known: fewer slots may do.
    ///
    /// # Errors
    /// User input when the adapter cannot run the plan or the picture does not fit; failed when a kernel does not compile.
    pub fn new(
        gpu: &Gpu,
        plan: &Plan,
        resources: &Resources,
        settings: Settings,
        work: Option<u32>,
    ) -> Result<Self, Error> {
        gpu.require(&plan.needs)?;
        let pixels = pixels_of(settings.size)?;
        let total = work.map(|samples| u64::from(samples) * u64::from(pixels));
        let path_count = choose_path_count(gpu, plan, pixels.into(), settings.paths, total)?;
        let buffers = Buffers::new(gpu, plan, settings.size, path_count, resources)?;
        let accumulator = Accumulator::new(
            gpu,
            plan.film,
            u64::from(pixels) * u64::from(plan.planes()),
            buffers.of(plan, Role::Film)?,
        )?;
        let executor = Executor::new(gpu, plan, &buffers)?;
        let tallies = Tallies::new(plan, &buffers, pixels);
        gpu.check()?;
        let slots = usable_slots(plan, path_count);
        Ok(Self {
            gpu: gpu.clone(),
            executor,
            accumulator,
            layers: plan.layers.clone(),
            unpiloted: tallies.as_ref().is_some_and(Tallies::have_rates),
            tallies,
            settings,
            slots,
            most_paths: slots * plan.paths_per_slot,
            pass_limit: slots * plan.paths_per_slot,
            full_passes: false,
            samples: 0,
            batches: 0,
            spread_known: true,
            samples_before: 0,
            passes: 0,
            finished: None,
            taken: 0,
            counters: Counters::default(),
            seconds: 0.0,
            sizes: std::collections::VecDeque::new(),
        })
    }

    /// Continues an earlier render: its samples are neither lost nor taken again. Call before `run`.
    ///
    /// # Errors
    /// User input, when its size differs, or its paths counted something else, or it comes without its layers.
    pub fn resume(&mut self, totals: &Totals) -> Result<(), Error> {
        if !self.layers.is_empty() && totals.shares.len() == 1 {
            let error = Error::input("cannot resume a picture with layers");
            return Err(error.help("its file holds their sum, not each of them"));
        }
        if let Some(tallies) = &mut self.tallies {
            tallies.resume(totals.tallied.as_ref())?;
        }
        self.accumulator.write(&self.gpu, totals)?;
        self.samples = totals.samples;
        self.samples_before = totals.samples;
        self.batches = totals.batches;
        self.spread_known = totals.spread.is_some();
        Ok(())
    }

    /// Renders until told, or until `watch` returns false; always whole samples of the whole picture.
    ///
    /// # Errors
    /// Failed, when the device is lost, a stream overflowed or paths were left unfinished.
    pub fn run(&mut self, until: Until, watch: &mut dyn FnMut(&Progress) -> bool) -> Result<(), Error> {
        let start = Instant::now();
        self.pilot()?;
        self.finished = None;
        let before = self.seconds;
        let mut stop = false;
        let mut looked = Instant::now();
        while !stop && !self.reached(until, before + start.elapsed().as_secs_f64()) {
            let samples = self.batch_samples(until);
            self.run_batch(samples, start, &mut |session, elapsed| {
                let go_on = watch(&session.progress(until, before + elapsed, elapsed));
                stop |= !go_on;
            })?;
            if let Until::Error(wanted) = until
                && self.batches >= FEWEST_BATCHES
                && looked.elapsed().as_secs_f64() > ERROR_SECONDS
            {
                self.drain_tallies()?;
                stop |= self.totals()?.relative_error() <= wanted;
                looked = Instant::now();
            }
        }
        self.drain_tallies()?;
        self.finish_passes()?;
        self.seconds = before + start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Runs passes as those to come and throws them away: drivers compile at the first dispatch, clocks rise under load. Call before
    /// `run`; neither the picture nor its counts and times know of it.
    ///
    /// # Errors
    /// As `run`.
    pub fn warm_up(&mut self, until: Until) -> Result<(), Error> {
        if let Some(tallies) = &self.tallies {
            tallies.begin_pilot(&self.gpu);
        }
        let work = self.pixels() * u64::from(self.batch_samples(until));
        let long = if let Until::Seconds(seconds) = until { seconds.min(WARM_UP_SECONDS) } else { WARM_UP_SECONDS };
        let start = Instant::now();
        loop {
            self.discarded(0, u64::from(self.pass_limit).min(work) as u32)?;
            if start.elapsed().as_secs_f64() > long {
                break;
            }
        }
        self.accumulator.clear_film(&self.gpu);
        self.tallies.as_ref().map_or(Ok(()), |tallies| tallies.forget(&self.gpu))
    }

    /// Runs a pass with the pilot's seed.
    fn discarded(&mut self, done: u32, active: u32) -> Result<(), Error> {
        let pass = pass_at(&self.settings, self.settings.seed ^ PILOT_SEED, 0, done.into(), [self.slots, active]);
        self.executor.submit(pass, false, |_| ())?;
        self.executor.wait().map(drop)
    }

    fn pixels(&self) -> u64 {
        u64::from(self.settings.size[0]) * u64::from(self.settings.size[1])
    }

    /// Runs the program once for the rates that the first sample reads. Nothing else of it remains: neither light nor counts of rays.
    fn pilot(&mut self) -> Result<(), Error> {
        let Some(tallies) = self.tallies.as_mut().filter(|_| std::mem::take(&mut self.unpiloted)) else {
            return Ok(());
        };
        tallies.begin_pilot(&self.gpu);
        let (mut done, slots) = (0, tallies.pilot_slots());
        while done < slots {
            let active = self.pass_limit.min(slots - done);
            self.discarded(done, active)?;
            done += active;
        }
        self.tallies.as_mut().map_or(Ok(()), |tallies| tallies.end_pilot(&self.gpu))?;
        self.accumulator.clear_film(&self.gpu);
        Ok(())
    }

    fn finish_passes(&mut self) -> Result<(), Error> {
        while self.executor.in_flight() > 0 {
            self.finish_pass()?;
        }
        Ok(())
    }

    /// Takes over what was counted on the device.
    fn drain_tallies(&mut self) -> Result<(), Error> {
        if self.tallies.is_some() {
            self.finish_passes()?;
            // The next pass finds an idle device: the time until it is done says less about it.
            self.finished = None;
        }
        self.tallies.as_mut().map_or(Ok(()), |tallies| tallies.drain(&self.gpu))
    }

    /// Rates come from all samples so far at each milestone.
    fn renew_rates(&mut self) -> Result<(), Error> {
        if next_milestone(self.samples - 1) != self.samples || !self.has_rates() {
            return Ok(());
        }
        self.drain_tallies()?;
        self.tallies.as_mut().map_or(Ok(()), |tallies| tallies.renew_rates(&self.gpu))
    }

    fn has_rates(&self) -> bool {
        self.tallies.as_ref().is_some_and(Tallies::have_rates)
    }

    fn reached(&self, until: Until, elapsed: f64) -> bool {
        match until {
            Until::Samples(wanted) => self.samples >= wanted,
            Until::Seconds(wanted) => self.batches > 0 && elapsed + self.flying_seconds(elapsed) >= wanted,
            Until::Error(_) => false,
        }
    }

    /// The time that the passes in flight are going to take, at the speed so far, s.
    fn flying_seconds(&self, elapsed: f64) -> f64 {
        let done = self.taken as f64;
        let flying: f64 = self.sizes.iter().map(|&size| f64::from(size)).sum();
        if done > 0.0 { elapsed * flying / done } else { 0.0 }
    }

    /// Samples per pixel of the next batch: it ends where the rates of tallies change.
    fn batch_samples(&self, until: Until) -> u32 {
        let wanted = self.wanted_samples(until);
        if self.has_rates() { wanted.min(next_milestone(self.samples) - self.samples) } else { wanted }
    }

    /// From now on batches of a run for so many seconds are as large as a pass: a short run takes the passes of a long one, with hardly a
    /// standard error.
    pub fn take_full_passes(&mut self) {
        self.full_passes = true;
    }

    /// A pass of whole samples at most, and an eighth of the work at most unless `take_full_passes` was called.
    fn wanted_samples(&self, until: Until) -> u32 {
        let pixels = self.settings.size[0] * self.settings.size[1];
        let natural = (self.most_paths / pixels).max(1);
        match until {
            Until::Seconds(_) if self.full_passes => natural,
            Until::Samples(wanted) => {
                let run = wanted - self.samples_before.min(wanted);
                natural.min((run / FEWEST_BATCHES).max(1)).min(wanted - self.samples)
            }
            Until::Seconds(_) | Until::Error(_) => natural.min((self.samples / FEWEST_BATCHES).max(1)),
        }
    }

    fn run_batch(&mut self, samples: u32, start: Instant, after_pass: &mut dyn FnMut(&Self, f64)) -> Result<(), Error> {
        let pixels = self.settings.size[0] * self.settings.size[1];
        let work = u64::from(pixels) * u64::from(samples);
        let mut done = 0;
        while done < work {
            if !self.executor.has_room() || self.executor.in_flight() >= IN_FLIGHT {
                self.finish_pass()?;
                after_pass(self, start.elapsed().as_secs_f64());
            }
            let active = u64::from(self.pass_limit).min(work - done) as u32;
            if self.tallies.as_ref().is_some_and(|tallies| tallies.are_full(active)) {
                self.drain_tallies()?;
            }
            let last = done + u64::from(active) == work;
            self.submit(done, active, last.then_some(samples))?;
            done += u64::from(active);
        }
        self.samples += samples;
        self.batches += 1;
        self.renew_rates()
    }

    /// Submits the pass that begins `done` slots into the current batch, and ends the batch behind it if `ends` says of how many samples.
    fn submit(&mut self, done: u64, active: u32, ends: Option<u32>) -> Result<(), Error> {
        let pass = pass_at(&self.settings, self.settings.seed, self.samples, done, [self.slots, active]);
        let number = self.passes;
        let measure = number <= MEASURED_FIRST || number.is_multiple_of(MEASURED_EVERY);
        let (gpu, accumulator, samples) = (&self.gpu, &self.accumulator, self.samples);
        self.executor.submit(pass, measure, |encoder| {
            if let Some(batch) = ends {
                accumulator.encode(gpu, encoder, batch, samples);
            }
        })?;
        self.passes += 1;
        self.sizes.push_back(active);
        if let Some(tallies) = &mut self.tallies {
            tallies.submitted(active);
        }
        Ok(())
    }

    /// Waits for the oldest pass and adds what it counted.
    fn finish_pass(&mut self) -> Result<(), Error> {
        let counters = self.executor.wait()?;
        self.counters.add(&counters);
        let active = self.sizes.pop_front().unwrap_or(0);
        self.taken += u64::from(active);
        let now = Instant::now();
        if let Some(before) = self.finished.replace(now) {
            self.pace(active, (now - before).as_secs_f64());
        }
        Ok(())
    }

    /// Fits the size of passes to the device. While the queue is full, a pass takes the time between two completions; the first
    /// one, which may compile and clear, is left out.
    fn pace(&mut self, active: u32, seconds: f64) {
        let fitting = f64::from(active) * PASS_SECONDS / seconds.max(1e-6);
        let slow = seconds > PASS_SECONDS;
        let quick = seconds < PASS_SECONDS / 4.0 && active >= self.pass_limit && self.pass_limit < self.most_paths;
        if slow || quick {
            let wanted = fitting.min(2.0 * f64::from(self.pass_limit)) as u32;
            self.pass_limit = (wanted / 1024 * 1024).max(SMALLEST_PASS).min(self.most_paths);
        }
    }

    fn progress(&self, until: Until, elapsed: f64, run: f64) -> Progress {
        let pixels = f64::from(self.settings.size[0]) * f64::from(self.settings.size[1]);
        let part = match until {
            Until::Samples(wanted) => {
                Some(self.taken as f64 / (pixels * f64::from(wanted - self.samples_before.min(wanted)).max(1.0)))
            }
            Until::Seconds(wanted) => Some(run / wanted),
            Until::Error(_) => None,
        };
        Progress {
            taken: self.taken,
            per_second: self.taken as f64 / elapsed.max(1e-9),
            part: part.map(|part| part.min(1.0)),
        }
    }

    /// Reads what has been accumulated.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn totals(&self) -> Result<Totals, Error> {
        let mut totals = self.accumulator.read(&self.gpu, self.samples, self.batches)?;
        if !self.spread_known {
            totals.spread = None;
        }
        totals.shares = shares(&self.layers, self.tallies.as_ref().map(Tallies::tallied));
        totals.tallied = self.tallies.as_ref().map(|tallies| tallies.tallied().clone());
        Ok(totals)
    }

    /// What stages counted at every index, tally by tally as in the plan, by earlier runs too; empty for a plan without tallies.
    pub fn tally_totals(&self) -> Vec<u64> {
        self.tallies.as_ref().map(|tallies| tallies.tallied().counts.clone()).unwrap_or_default()
    }

    /// Paths behind `tally_totals`.
    pub fn tally_slots(&self) -> u64 {
        self.tallies.as_ref().map_or(0, |tallies| tallies.tallied().slots)
    }

    /// Reads the picture; more may be rendered afterwards.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn picture(&self) -> Result<Rendered, Error> {
        let totals = self.totals()?;
        Ok(Rendered {
            size: self.settings.size,
            mean: totals.mean(),
            standard_error: totals.standard_error(),
            layers: self.layers.clone(),
            totals,
            samples_taken: self.samples - self.samples_before,
            counters: self.counters,
            seconds: self.seconds,
            profile: self.executor.profile.clone(),
            compiled: self.executor.compiled.clone(),
        })
    }

    /// Counts what each kernel takes in every round, in passes as those of the picture, at most four, spread over it. Their light stays
    /// in the film, so nothing can follow.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn occupancy(self) -> Result<Occupancy, Error> {
        let natural = (u64::from(self.slots) / self.pixels()).max(1);
        let work = self.pixels() * natural.min(self.samples.max(1).into());
        let passes = work.div_ceil(self.pass_limit.into());
        let counted = passes.min(COUNTED_PASSES);
        let mut occupancy = self.executor.nothing_counted();
        for index in 0..counted {
            let done = index * passes / counted * u64::from(self.pass_limit);
            let active = u64::from(self.pass_limit).min(work - done) as u32;
            let pass = pass_at(&self.settings, self.settings.seed, 0, done, [self.slots, active]);
            self.executor.count_entries(pass, &mut occupancy)?;
        }
        Ok(occupancy)
    }
}

/// Renders a plan in one call: for tests and studies.
///
/// # Errors
/// As `Session::new` and `Session::run`.
pub fn render(
    gpu: &Gpu,
    plan: &Plan,
    resources: &Resources,
    settings: Settings,
    samples: u32,
) -> Result<Rendered, Error> {
    let mut session = Session::new(gpu, plan, resources, settings, Some(samples))?;
    session.run(Until::Samples(samples), &mut |_| true)?;
    session.picture()
}

/// Samples per pixel, more than these, at which the rates of tallies change: 1, 8, 64, ... Between them passes are as large as they can
/// be; closer together, a short render would consist of small ones.
fn next_milestone(samples: u32) -> u32 {
    (0..u32::BITS).step_by(3).map(|exponent| 1 << exponent).find(|milestone| *milestone > samples).unwrap_or(u32::MAX)
}

/// The pass that begins `done` paths behind the start of sample `sample`: of so many slots at most, and so many paths.
fn pass_at(settings: &Settings, seed: u32, sample: u32, done: u64, [slots, paths]: [u32; 2]) -> Pass {
    let [width, height] = settings.size;
    let pixels = u64::from(width) * u64::from(height);
    Pass {
        first_pixel: (done % pixels) as u32,
        first_sample: sample + (done / pixels) as u32,
        active: slots.min(paths),
        seed,
        paths,
        unused: [0; 3],
    }
}

fn pixels_of(size: [u32; 2]) -> Result<u32, Error> {
    let [width, height] = size;
    let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0 && pixels <= u32::MAX / 3);
    pixels.ok_or_else(|| Error::input(format!("a picture of {width}x{height} pixels is empty or too large")))
}

#[cfg(test)]
mod tests;
