//! Room in batched streams: how much a stream has, how much a round may need, and so when it is emptied and how many slots a pass
//! may use.
//!
//! Records collect over the rounds of a pass. Before kernels that may push, the device adds up what the paths that wait for them can
//! push there. Only if so many might find no room behind what is already there is the stream emptied first. A pass uses so few slots
//! that an emptied stream takes whatever a kernel pushes for all of them, so none ever overflows.

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

/// Most records that a path which is about to run one of these stages of a kernel can still push there, by name; 0 is left out. They
/// run in this order; `leads` says whether one leads to another.
pub(super) fn ahead<'a>(
    order: impl DoubleEndedIterator<Item = &'a String>,
    leads: impl Fn(&str, &str) -> bool,
    pushes: &IndexMap<String, u32>,
) -> IndexMap<String, u32> {
    let mut ahead: IndexMap<String, u32> = IndexMap::new();
    for name in order.rev() {
        // A way back leads into the next round: its target is not among those that follow.
        let later = ahead.iter().filter(|(target, _)| leads(name, target)).map(|(_, most)| *most).max().unwrap_or(0);
        let most = pushes.get(name).copied().unwrap_or(0) + later;
        if most > 0 {
            ahead.insert(name.clone(), most);
        }
    }
    ahead.reverse();
    ahead
}

/// Slots that a pass may use of every `SLOT_GRAIN`.
pub(super) fn slots(wiring: &Wiring, schedule: &Schedule) -> u32 {
    let batched = wiring.streams.values().filter(|stream| stream.batched && stream.most > 0);
    let fitting = batched.map(|stream| records(schedule) / stream.most);
    fitting.min().map_or(SLOT_GRAIN, |slots| slots.min(SLOT_GRAIN))
}
