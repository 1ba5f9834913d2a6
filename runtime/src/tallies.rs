//! Tallies between passes: what stages counted is added up on the host, and its rates are handed back to later samples.
//!
//! Rates change at fixed numbers of samples per pixel alone, and come from all the samples before: so the picture depends neither on
//! the size of passes nor on how fast they are. What the first sample reads was counted by a pilot, which leaves nothing else behind.

use crate::buffers::Buffers;
use crate::device::Gpu;
use crate::error::Error;
use kernelgen::plan::{Plan, Role};
use serde::{Deserialize, Serialize};

/// What the seed is combined with for the pilot, so that its paths are not those of the picture.
pub const PILOT_SEED: u32 = 0x7069_6c6f;
/// Slots after which the 32-bit counts are taken over: a path may count up to 15 times at one index.
const MOST_SLOTS: u64 = 1 << 28;

/// Path slots of the pilot of a picture of so many pixels: a sample of each, but enough to tell rates by, and no more than that takes.
pub fn pilot_slots(pixels: u32) -> u32 {
    pixels.clamp(4096, 65_536)
}

/// What the samples of a picture counted, the pilot left out. Saved with the picture.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tallied {
    /// Counts of all samples, tally by tally as in the plan.
    pub counts: Vec<u64>,
    /// Paths that were counted.
    pub slots: u64,
    /// The counts behind the present rates.
    pub rated_counts: Vec<u64>,
    /// The paths behind the present rates.
    pub rated_slots: u64,
}

/// The tallies of a session.
#[derive(Debug)]
pub struct Tallies {
    counts: Option<wgpu::Buffer>,
    rates: Option<wgpu::Buffer>,
    /// Where each tally begins.
    firsts: Vec<usize>,
    /// Slots of the pilot, and what it counted.
    pilot_slots: u32,
    pilot: Vec<u64>,
    tallied: Tallied,
    /// Slots submitted since the counts were last taken over.
    pending: u64,
}

impl Tallies {
    /// The tallies of a plan, for a picture of so many pixels; `None` where it has none.
    pub fn new(plan: &Plan, buffers: &Buffers, pixels: u32) -> Option<Self> {
        let words = plan.tallies.iter().map(|tally| tally.size as usize).sum();
        let zeros = vec![0; words];
        (words > 0).then(|| Self {
            counts: buffers.of(plan, Role::TallyCounts).ok().cloned(),
            rates: buffers.of(plan, Role::TallyRates).ok().cloned(),
            firsts: plan.tallies.iter().map(|tally| tally.first as usize).collect(),
            pilot_slots: pilot_slots(pixels),
            pilot: zeros.clone(),
            tallied: Tallied { counts: zeros.clone(), slots: 0, rated_counts: zeros, rated_slots: 0 },
            pending: 0,
        })
    }

    /// Whether stages read rates: then there is a pilot, and rates are published.
    pub fn have_rates(&self) -> bool {
        self.rates.is_some()
    }

    /// What has been taken over so far.
    pub fn tallied(&self) -> &Tallied {
        &self.tallied
    }

    /// Continues an earlier render with its counts and its rates.
    ///
    /// # Errors
    /// User input, when they are those of other tallies.
    pub fn resume(&mut self, earlier: Option<&Tallied>) -> Result<(), Error> {
        let words = self.tallied.counts.len();
        let fits = |tallied: &&Tallied| tallied.counts.len() == words && tallied.rated_counts.len() == words;
        let fitting = earlier.filter(fits);
        self.tallied = fitting.cloned().ok_or_else(|| Error::input("the picture to resume counted something else"))?;
        Ok(())
    }

    /// Whether counts must be taken over before a pass of `active` slots.
    pub fn are_full(&self, active: u32) -> bool {
        self.pending + u64::from(active) > MOST_SLOTS
    }

    /// Notes that a pass of `active` slots was submitted.
    pub fn submitted(&mut self, active: u32) {
        self.pending += u64::from(active);
    }

    /// Path slots of the pilot.
    pub fn pilot_slots(&self) -> u32 {
        self.pilot_slots
    }

    /// Rates of 1 for the pilot, which has no samples before it.
    pub fn begin_pilot(&self, gpu: &Gpu) {
        self.write_rates(gpu, vec![1.0; self.pilot.len()]);
    }

    /// Takes over what the pilot counted and publishes the first rates. No pass may be in flight.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn end_pilot(&mut self, gpu: &Gpu) -> Result<(), Error> {
        self.pilot = self.take(gpu)?;
        self.publish(gpu);
        Ok(())
    }

    /// Zeroes what was counted on the device. No pass may be in flight.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn forget(&self, gpu: &Gpu) -> Result<(), Error> {
        self.take(gpu).map(drop)
    }

    /// Takes over what was counted since the last time. No pass may be in flight.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn drain(&mut self, gpu: &Gpu) -> Result<(), Error> {
        if self.pending == 0 {
            return Ok(());
        }
        let counted = self.take(gpu)?;
        for (total, count) in self.tallied.counts.iter_mut().zip(counted) {
            *total += count;
        }
        self.tallied.slots += std::mem::take(&mut self.pending);
        Ok(())
    }

    /// Drains, and bases the rates on all samples so far. No pass may be in flight.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn renew_rates(&mut self, gpu: &Gpu) -> Result<(), Error> {
        self.drain(gpu)?;
        self.tallied.rated_counts.clone_from(&self.tallied.counts);
        self.tallied.rated_slots = self.tallied.slots;
        self.publish(gpu);
        Ok(())
    }

    fn publish(&self, gpu: &Gpu) {
        let slots = (u64::from(self.pilot_slots) + self.tallied.rated_slots) as f64;
        let counts = self.pilot.iter().zip(&self.tallied.rated_counts);
        self.write_rates(gpu, counts.map(|(pilot, rated)| (pilot + rated) as f64 / slots).collect());
    }

    /// Writes the rates, then their sums within each tally.
    fn write_rates(&self, gpu: &Gpu, mut rates: Vec<f64>) {
        let Some(buffer) = &self.rates else { return };
        let sums = running_sums(&rates, &self.firsts);
        rates.extend(sums);
        let words: Vec<f32> = rates.into_iter().map(|rate| rate as f32).collect();
        gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&words));
    }

    /// Reads the counts on the device and zeroes them.
    fn take(&self, gpu: &Gpu) -> Result<Vec<u64>, Error> {
        let words = self.pilot.len();
        let Some(buffer) = &self.counts else { return Ok(vec![0; words]) };
        let bytes = gpu.read(buffer)?;
        gpu.queue.write_buffer(buffer, 0, &vec![0; words * 4]);
        Ok(bytes.chunks_exact(4).take(words).map(|word| u64::from(bytemuck::pod_read_unaligned::<u32>(word))).collect())
    }
}

/// Sums up to each place, each of `firsts` beginning anew.
fn running_sums(values: &[f64], firsts: &[usize]) -> Vec<f64> {
    let mut sum = 0.0;
    let add = |(place, value): (usize, &f64)| {
        sum = if firsts.contains(&place) { *value } else { sum + value };
        sum
    };
    values.iter().enumerate().map(add).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_begin_anew_with_each_tally() {
        assert_eq!(running_sums(&[1.0, 2.0, 3.0, 4.0, 5.0], &[0, 3]), [1.0, 3.0, 6.0, 4.0, 9.0]);
    }
}
