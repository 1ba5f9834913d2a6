//! How often the kernels of a program run.
//!
//! A round runs every kernel once, in the order of the pipeline. Where a pipeline declares an inner loop, as the eye walks that belong
//! to one vertex of a light walk, a round runs the kernels of that loop again and again until its walks are over. Then all paths
//! leave it together: the kernels behind it find them side by side, and run as often as there are rounds, not as there are turns.

use super::fusion::{Chain, Fusion};
use crate::config::model::{Loops, Schedule, Variant};
use crate::config::{MOST_ROUNDS, evaluate_inner, evaluate_rounds};
use crate::diagnostic::Diagnostic;
use std::ops::Range;

/// The loops of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rounds {
    /// Rounds after which no path is alive if all of them run every kernel once, whatever the loops are: of all paths of a slot.
    pub most: u32,
    /// Rounds.
    pub outer: u32,
    /// The loop inside them.
    pub inner: Option<InnerLoop>,
    /// Paths that a slot takes in a pass.
    pub paths_per_slot: u32,
}

/// A loop inside the rounds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct InnerLoop {
    /// Its kernels among those that take paths from queues.
    pub kernels: Range<usize>,
    /// Its turns, round by round.
    pub turns: Vec<u32>,
}

impl Rounds {
    /// The loops of these kernels.
    ///
    /// # Errors
    /// K0116, as `evaluate_rounds`.
    pub(super) fn new(variant: &Variant, fusion: &Fusion) -> Result<Rounds, Diagnostic> {
        let rounds = evaluate_rounds(&variant.pipeline)?;
        let paths_per_slot = paths_per_slot(&variant.schedule, rounds);
        let most = paths_per_slot * rounds;
        let flat = Rounds { most, outer: most, inner: None, paths_per_slot };
        // A slot that takes a further path begins it in any round: its walks are no longer in step with those of others.
        let in_step = variant.schedule.loops == Loops::Nested && variant.schedule.regenerate.value == 1;
        let Some(declared) = variant.pipeline.inner.as_ref().filter(|_| in_step) else { return Ok(flat) };
        let turns = evaluate_inner(&variant.pipeline, declared)?;
        let outer = turns.len() as u32;
        Ok(match kernels_between(fusion, &declared.stage.value) {
            Some(kernels) => Rounds { outer, inner: Some(InnerLoop { kernels, turns }), ..flat },
            None if is_inside(fusion, &declared.stage.value) => Rounds { outer, ..flat },
            None => flat,
        })
    }

    /// Whether paths of several dispatches may wait for a kernel at once: those of one are in order.
    pub(super) fn mixes(&self, fusion: &Fusion, entry: &str) -> bool {
        let Some(InnerLoop { kernels, .. }) = &self.inner else { return fusion.feeders(entry, 0..usize::MAX) > 1 };
        let inside = fusion.feeders(entry, kernels.clone());
        let outside = fusion.feeders(entry, 0..usize::MAX) - inside;
        match fusion.queued.get_index_of(entry) {
            // What comes from outside is gone when the first turn is over.
            Some(place) if place == kernels.start => inside > 1 || outside > 1,
            Some(place) if kernels.contains(&place) => inside + outside > 1,
            _ => inside > 0 || outside > 1,
        }
    }

    /// Whether there is an inner loop and a kernel is not part of it: paths that leave the loop may all meet there.
    pub(super) fn is_beside_inner(&self, fusion: &Fusion, entry: &str) -> bool {
        let inside = |place| self.inner.as_ref().is_some_and(|inner| inner.kernels.contains(&place));
        self.inner.is_some() && !fusion.queued.get_index_of(entry).is_some_and(inside)
    }
}

/// Paths that a pass may have for each slot, if one takes so many rounds.
fn paths_per_slot(schedule: &Schedule, rounds: u32) -> u32 {
    schedule.regenerate.value.min(MOST_ROUNDS / rounds.max(1)).max(1)
}

/// The kernels from the one that begins with this stage to the last that leads back to it.
fn kernels_between(fusion: &Fusion, stage: &str) -> Option<Range<usize>> {
    let first = fusion.queued.get_index_of(stage)?;
    let leads_back = |chain: &Chain| chain.feeds.contains(stage);
    let last = fusion.queued.values().skip(first).rposition(leads_back)?;
    Some(first..first + last + 1)
}

/// Whether paths go round from this stage inside a kernel.
fn is_inside(fusion: &Fusion, stage: &str) -> bool {
    fusion.queued.values().any(|chain| chain.loops && chain.stages.contains(stage))
}
