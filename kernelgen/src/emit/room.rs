//! Room in batched streams: how much a stream has, how much a round may need, and so when it is emptied and how many slots a pass
//! may use.
//!
//! Records collect over the rounds of a pass. Once a round, before the first stage that may push, the device adds up what the
//! paths that wait can still push in this round. Only if so many might find no room behind what is already there is the stream
//! emptied first. A pass uses so few slots that an emptied stream takes whatever one round pushes, so none ever overflows.

use super::wiring::Wiring;
use crate::config::model::Schedule;
use crate::plan::SLOT_GRAIN;
use indexmap::IndexMap;

/// Records that a batched stream has room for, for every `SLOT_GRAIN` path slots.
pub(super) fn records(schedule: &Schedule) -> u32 {
    (schedule.capacity.value * f64::from(SLOT_GRAIN)) as u32
}

/// The same room in WGSL, for all path slots.
pub(super) fn text(records: u32) -> String {
    match (records / SLOT_GRAIN, records % SLOT_GRAIN) {
        (1, 0) => "path_count".to_owned(),
        (factor, 0) => format!("{factor}u * path_count"),
        _ => format!("path_count / {SLOT_GRAIN}u * {records}u"),
    }
}

/// Most records that a path which waits for one of these stages can still push in the round, by stage; 0 is left out. `stages` are
/// those that the round has yet to run, in this order.
pub(super) fn ahead(wiring: &Wiring, stages: &[String], pushes: &IndexMap<String, u32>) -> IndexMap<String, u32> {
    let mut ahead: IndexMap<String, u32> = IndexMap::new();
    for stage in stages.iter().rev() {
        // A route back leads into the next round: its target is not among those that follow.
        let routes = wiring.stages[stage].routes.iter();
        let later = routes.filter_map(|(_, target)| ahead.get(target)).max().copied().unwrap_or(0);
        let most = pushes.get(stage).copied().unwrap_or(0) + later;
        if most > 0 {
            ahead.insert(stage.clone(), most);
        }
    }
    ahead.reverse();
    ahead
}

/// Most records that a path pushes between two moments at which the stream may be emptied: in a round, or in the start stage.
pub(super) fn most(wiring: &Wiring, start: &str, pushes: &IndexMap<String, u32>) -> u32 {
    let looped: Vec<String> = wiring.stages.keys().filter(|stage| wiring.is_looped(stage)).cloned().collect();
    let in_a_round = ahead(wiring, &looped, pushes).into_values();
    in_a_round.chain(pushes.get(start).copied()).max().unwrap_or(0)
}

/// Slots that a pass may use of every `SLOT_GRAIN`.
pub(super) fn slots(wiring: &Wiring, schedule: &Schedule) -> u32 {
    let batched = wiring.streams.values().filter(|stream| stream.batched && stream.most > 0);
    let fitting = batched.map(|stream| records(schedule) / stream.most);
    fitting.min().map_or(SLOT_GRAIN, |slots| slots.min(SLOT_GRAIN))
}
