//! How full queues are: the paths that each kernel takes, round by round, and those that it sends on.

use crate::program::{Command, Entries};
use kernelgen::plan::EntryWords;

/// What kernels took in passes that ran for this alone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Occupancy {
    /// Path slots in use, all passes together.
    pub slots: u64,
    /// Passes.
    pub passes: u32,
    /// By kernel of the plan, by round: paths, or records of a stream, that it took. Ends with the last round that has any; what runs
    /// behind the rounds follows the last of them. Empty for housekeeping that is
    /// not sized by what waits.
    pub entries: Vec<Vec<u64>>,
    /// By kernel of the plan, by queue: paths, or records, that joined it from there.
    pub pushes: Vec<Vec<u64>>,
    /// Where the control buffer says how many wait.
    words: EntryWords,
}

impl Occupancy {
    /// Nothing counted yet, for a plan of so many kernels and queues.
    pub fn new(kernels: usize, queues: usize, words: EntryWords) -> Self {
        let pushes = vec![vec![0; queues]; kernels];
        Self { entries: vec![Vec::new(); kernels], pushes, words, ..Self::default() }
    }

    /// Adds a pass of `active` slots: the control buffer before each dispatch, and behind the last.
    pub fn add(&mut self, program: &[Command], states: &[&[u32]], active: u32) {
        for (command, states) in program.iter().zip(states.windows(2)) {
            let [before, after] = [states[0], states[1]];
            let taken = match command.entries {
                Entries::None => continue,
                Entries::Active => active,
                Entries::Counted(word) => before[word],
            };
            for (slot, pushes) in (0..).zip(&mut self.pushes[command.kernel]) {
                let waiting = self.words.waiting(slot) as usize;
                *pushes += u64::from(after[waiting].saturating_sub(before[waiting]));
            }
            if taken > 0 {
                let rounds = &mut self.entries[command.kernel];
                let round = command.round as usize;
                rounds.resize(rounds.len().max(round + 1), 0);
                rounds[round] += u64::from(taken);
            }
        }
        self.slots += u64::from(active);
        self.passes += 1;
    }

    /// Entries of a kernel in all rounds, for one slot in use.
    pub fn per_slot(&self, kernel: usize) -> f64 {
        self.entries[kernel].iter().sum::<u64>() as f64 / self.slots.max(1) as f64
    }

    /// What joined a queue from a kernel in all rounds, for one slot in use.
    pub fn pushes_per_slot(&self, kernel: usize, queue: usize) -> f64 {
        self.pushes[kernel][queue] as f64 / self.slots.max(1) as f64
    }

    /// Entries of a kernel by round, for one slot in use.
    pub fn by_round(&self, kernel: usize) -> Vec<f64> {
        self.entries[kernel].iter().map(|&entries| entries as f64 / self.slots.max(1) as f64).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Extent;

    #[test]
    fn entries_and_pushes_are_added_by_kernel_and_round() {
        let command = |kernel, round, entries| Command { kernel, round, extent: Extent::Active(64), entries };
        let program = [
            command(0, 0, Entries::None),
            command(1, 0, Entries::Active),
            command(2, 0, Entries::Counted(1)),
            command(2, 1, Entries::Counted(1)),
            command(2, 2, Entries::Counted(1)),
        ];
        // How many wait in the only queue, and how many its kernel takes.
        let mut occupancy = Occupancy::new(3, 1, EntryWords { first: 1, stride: 2 });
        occupancy.add(&program, &[&[0, 0], &[0, 0], &[0, 8], &[4, 4], &[7, 0], &[7, 0]], 8);
        occupancy.add(&program, &[&[0, 0], &[0, 0], &[2, 2], &[2, 0], &[2, 0], &[2, 0]], 2);
        assert_eq!((occupancy.slots, occupancy.passes), (10, 2));
        assert_eq!(occupancy.entries, [vec![], vec![10], vec![10, 4]]);
        assert_eq!(occupancy.pushes, [[0], [2], [7]]);
        assert_eq!(occupancy.per_slot(2), 1.4);
        assert_eq!(occupancy.pushes_per_slot(2, 0), 0.7);
        assert_eq!(occupancy.by_round(2), [1.0, 0.4]);
    }
}
