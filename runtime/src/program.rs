//! A plan's program as one list of dispatches.

use kernelgen::plan::{Plan, Step};

/// How large a dispatch is.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    /// Workgroups for the slots in use, each of which takes so many.
    Active(u32),
    /// One workgroup.
    Single,
    /// As the arguments buffer says at this offset, bytes.
    Indirect(u64),
}

/// How many paths, or records of a stream, a dispatch takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entries {
    /// It is housekeeping.
    None,
    /// All slots in use.
    Active,
    /// As this word of the control buffer says.
    Counted(usize),
}

/// A dispatch of the flattened program.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// Index into `Plan::kernels`.
    pub kernel: usize,
    /// Turns of innermost loops begun before it, its own left out; behind all loops the number of all.
    pub round: u32,
    /// How large it is.
    pub extent: Extent,
    /// What it takes.
    pub entries: Entries,
}

/// Unrolls the loops of a plan's program.
pub fn commands(plan: &Plan) -> Vec<Command> {
    let mut flattened = Flattened { plan, begun: 0, program: Vec::new() };
    flattened.add(&plan.program, None);
    flattened.program
}

struct Flattened<'a> {
    plan: &'a Plan,
    /// Turns of innermost loops begun.
    begun: u32,
    program: Vec<Command>,
}

impl Flattened<'_> {
    /// Adds steps, those of a loop's turn of this number if it is one.
    fn add(&mut self, steps: &[Step], turn: Option<usize>) {
        for step in steps {
            match step {
                Step::Dispatch { kernel, slots } => {
                    let works = self.plan.kernels.get(*kernel).is_some_and(|kernel| !kernel.stages.is_empty());
                    let entries = if works { Entries::Active } else { Entries::None };
                    self.push(turn, *kernel, Extent::Active(*slots), entries);
                }
                Step::Single { kernel } => self.push(turn, *kernel, Extent::Single, Entries::None),
                Step::Indirect { kernel, slot } => {
                    let counted = Entries::Counted(self.plan.entries.of_slot(*slot) as usize);
                    self.push(turn, *kernel, Extent::Indirect(u64::from(*slot) * 12), counted);
                }
                Step::Loop { turns, body } => self.repeat(turns, body, turn.unwrap_or(0)),
            }
        }
    }

    /// Adds the turns of a loop inside a turn of this number.
    fn repeat(&mut self, turns: &[u32], body: &[Step], around: usize) {
        let innermost = !body.iter().any(|step| matches!(step, Step::Loop { .. }));
        let count = turns.get(around).or(turns.last()).copied().unwrap_or(0);
        for turn in 0..count {
            self.begun += u32::from(innermost);
            self.add(body, Some(turn as usize));
        }
    }

    fn push(&mut self, turn: Option<usize>, kernel: usize, extent: Extent, entries: Entries) {
        let round = if turn.is_some() { self.begun.saturating_sub(1) } else { self.begun };
        self.program.push(Command { kernel, round, extent, entries });
    }
}
