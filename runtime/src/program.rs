//! A plan's program as one list of dispatches.

use kernelgen::plan::Step;

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

/// A dispatch of the flattened program.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// Index into `Plan::kernels`.
    pub kernel: usize,
    /// Round of the outermost loop; 0 outside.
    pub round: u32,
    /// How large it is.
    pub extent: Extent,
}

/// Unrolls the loops of a program.
pub fn commands(steps: &[Step]) -> Vec<Command> {
    let mut program = Vec::new();
    flatten(steps, None, &mut program);
    program
}

fn flatten(steps: &[Step], round: Option<u32>, program: &mut Vec<Command>) {
    for step in steps {
        let command = |kernel: usize, extent| Command { kernel, round: round.unwrap_or(0), extent };
        match step {
            Step::Dispatch { kernel } => program.push(command(*kernel, Extent::Active)),
            Step::Single { kernel } => program.push(command(*kernel, Extent::Single)),
            Step::Indirect { kernel, slot } => program.push(command(*kernel, Extent::Indirect(u64::from(*slot) * 12))),
            Step::Loop { rounds, body } => {
                for index in 0..*rounds {
                    flatten(body, round.or(Some(index)), program);
                }
            }
        }
    }
}
