//! A plan's program as one list of dispatches.

use kernelgen::plan::{Plan, Step};

/// How large a dispatch is.
#[derive(Clone, Copy, Debug)]
pub enum Extent {
    /// An invocation a slot in use.
    Active,
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
    /// As the control buffer says at this offset, bytes.
    Counted(u64),
}

/// A dispatch of the flattened program.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// Index into `Plan::kernels`.
    pub kernel: usize,
    /// Round of the outermost loop; 0 before it, the number of its rounds behind it.
    pub round: u32,
    /// How large it is.
    pub extent: Extent,
    /// What it takes.
    pub entries: Entries,
}

/// Unrolls the loops of a plan's program.
pub fn commands(plan: &Plan) -> Vec<Command> {
    let mut program = Vec::new();
    flatten(plan, &plan.program, None, &mut program);
    program
}

fn flatten(plan: &Plan, steps: &[Step], round: Option<u32>, program: &mut Vec<Command>) {
    let mut done = 0;
    for step in steps {
        let command =
            |kernel: usize, extent, entries| Command { kernel, round: round.unwrap_or(done), extent, entries };
        match step {
            Step::Dispatch { kernel } => {
                let works = plan.kernels.get(*kernel).is_some_and(|kernel| !kernel.stages.is_empty());
                program.push(command(*kernel, Extent::Active, if works { Entries::Active } else { Entries::None }));
            }
            Step::Single { kernel } => program.push(command(*kernel, Extent::Single, Entries::None)),
            Step::Indirect { kernel, slot } => {
                let counted = Entries::Counted(u64::from(plan.entries.of_slot(*slot)) * 4);
                program.push(command(*kernel, Extent::Indirect(u64::from(*slot) * 12), counted));
            }
            Step::Loop { rounds, body } => {
                for index in 0..*rounds {
                    flatten(plan, body, round.or(Some(index)), program);
                }
                done = *rounds;
            }
        }
    }
}
