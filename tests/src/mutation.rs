//! Mutations: deliberate errors in the text of the stages. Each names a check that passes on the stages as they are, and has to notice
//! the error.

use crate::rendering::{Job, Rendering};
use crate::statistics::{Comparison, Pixels};
use std::fmt::{self, Display, Formatter};
use std::sync::OnceLock;

/// Standard error of a whole image, as a share of its mean, beyond which a comparison does not count as passed.
const NOISE: f64 = 0.01;
/// f32 sums of radiance and tessellated shapes, as a share of the value.
const ROUNDING: f64 = 3e-4;

/// A deliberate error.
#[derive(Debug)]
pub struct Mutation {
    /// What is wrong.
    pub name: &'static str,
    /// Key of the module that is changed: its path below `stages/wgsl` without extension.
    pub module: &'static str,
    /// Text that stands in the module exactly once.
    pub old: &'static str,
    /// What it becomes.
    pub new: &'static str,
    /// What has to notice.
    pub check: &'static Check,
}

/// The stages that a check renders with: as they are, or with a mutation.
#[derive(Clone, Copy, Debug)]
pub struct Stages<'a>(Option<&'a Mutation>);

/// A comparison of renderings that holds for stages without error.
#[derive(Debug)]
pub struct Check {
    name: &'static str,
    run: fn(Stages) -> Verdict,
    unchanged: OnceLock<Verdict>,
}

/// What a check found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Of the images.
    pub comparison: Comparison,
    /// Contributions that the film refused.
    pub rejected: u64,
}

impl Stages<'_> {
    /// Renders a job with these stages.
    #[track_caller]
    pub fn render(self, job: Job) -> Rendering {
        match self.0 {
            Some(mutation) => job.edited(mutation.module, mutation.old, mutation.new).render(),
            None => job.render(),
        }
    }
}

impl Verdict {
    /// Two renderings must show the same image.
    pub fn same(a: &Rendering, b: &Rendering, block: usize) -> Verdict {
        let comparison = Comparison::of(&a.pixels, &b.pixels, block, ROUNDING);
        Verdict { comparison, rejected: a.rejected + b.rejected }
    }

    /// Every channel of every pixel must have this radiance.
    pub fn constant(rendering: &Rendering, expected: f64, block: usize) -> Verdict {
        Verdict::expected(&rendering.pixels, rendering.rejected, |_| expected as f32, block)
    }

    /// No pixel may be brighter than this radiance.
    pub fn at_most(rendering: &Rendering, bound: f64, block: usize) -> Verdict {
        Verdict::expected(&rendering.pixels, rendering.rejected, |found| found.min(bound as f32), block)
    }

    fn expected(pixels: &Pixels, rejected: u64, expected: impl Fn(f32) -> f32, block: usize) -> Verdict {
        let rgb = pixels.rgb.iter().map(|pixel| pixel.map(&expected)).collect();
        let exact = Pixels::exact(pixels.width, pixels.height, rgb);
        Verdict { comparison: Comparison::of(pixels, &exact, block, ROUNDING), rejected }
    }

    /// The check tells nothing against the stages, and it is sharp enough to mean something.
    pub fn passes(&self) -> bool {
        self.rejected == 0 && self.comparison.agrees() && self.comparison.noise < NOISE
    }

    /// The check tells that something is wrong. Noise alone does not.
    pub fn refutes(&self) -> bool {
        self.rejected > 0 || !self.comparison.agrees()
    }
}

impl Display for Verdict {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let Comparison { blocks, mean, noise } = &self.comparison;
        write!(f, "blocks up to {:.1}, mean {mean:.1}, noise {:.2} %", blocks.largest, 100.0 * noise)?;
        match self.rejected {
            0 => Ok(()),
            rejected => write!(f, ", {rejected} rejected"),
        }
    }
}

impl Check {
    /// A check by its name and what it renders and compares.
    pub const fn new(name: &'static str, run: fn(Stages) -> Verdict) -> Check {
        Check { name, run, unchanged: OnceLock::new() }
    }

    /// What the check says of the stages as they are; found once.
    pub fn unchanged(&self) -> Verdict {
        *self.unchanged.get_or_init(|| (self.run)(Stages(None)))
    }

    /// What the check says of the stages with an error.
    pub fn mutated(&self, mutation: &Mutation) -> Verdict {
        (self.run)(Stages(Some(mutation)))
    }
}

/// Examines mutations one by one and prints what was found.
///
/// # Panics
/// When a check does not pass without its mutation, or does not notice it; all of them are named.
#[track_caller]
pub fn assert_noticed(mutations: &[Mutation]) {
    let failures: Vec<String> = mutations.iter().filter_map(examine).collect();
    assert!(failures.is_empty(), "{} of {} mutations:\n{}", failures.len(), mutations.len(), failures.join("\n"));
}

/// What is wrong with a mutation, if anything.
fn examine(mutation: &Mutation) -> Option<String> {
    let check = mutation.check;
    let unchanged = check.unchanged();
    if !unchanged.passes() {
        return Some(format!("`{}` fails without any mutation: {unchanged}", check.name));
    }
    let mutated = check.mutated(mutation);
    println!("{}\n    `{}`: {unchanged}\n    with the mutation: {mutated}", mutation.name, check.name);
    if mutated.refutes() {
        return None;
    }
    Some(format!("`{}` did not notice \"{}\" in {}: {mutated}", check.name, mutation.name, mutation.module))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(values: [f32; 2], error: f32, rejected: u64, expected: impl Fn(f32) -> f32) -> Verdict {
        let pixels = Pixels { width: 2, height: 1, rgb: values.map(|x| [x; 3]).to_vec(), errors: vec![[error; 3]; 2] };
        Verdict::expected(&pixels, rejected, expected, 1)
    }

    #[test]
    fn verdicts_pass_refute_or_say_nothing() {
        let said = |verdict: Verdict| (verdict.passes(), verdict.refutes());
        let one = |_| 1.0;
        assert_eq!(said(verdict([1.002, 0.999], 1e-3, 0, one)), (true, false));
        assert_eq!(said(verdict([1.02, 0.98], 1e-3, 0, one)), (false, true));
        assert_eq!(said(verdict([1.2, 0.9], 0.1, 0, one)), (false, false), "too noisy to say anything");
        assert_eq!(said(verdict([1.0, 1.0], 1e-3, 1, one)), (false, true), "a contribution that is no number");
        assert_eq!(said(verdict([0.0, 0.0], 0.0, 0, one)), (false, true), "a black image");
    }

    #[test]
    fn bounds_hold_on_one_side() {
        let at_most = |bound: f32| verdict([0.5, 0.6], 1e-3, 0, |found| found.min(bound));
        assert!(at_most(0.7).passes());
        assert!(at_most(0.55).refutes());
    }
}
