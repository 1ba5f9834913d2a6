//! `package::tallies`: counting, and how often earlier samples counted.

use crate::config::evaluate_size;
use crate::config::model::Pipeline;
use crate::diagnostic::Diagnostic;
use crate::plan::Tally;
use std::fmt::Write;

/// The WGSL name of the buffer of counts.
pub(super) const COUNTS: &str = "tally_counts";
/// The WGSL name of the buffer of rates.
pub(super) const RATES: &str = "tally_rates";

/// Counters that a workgroup has room for: half of the 16 KiB that every adapter grants.
const MOST_WORDS: u32 = 2048;

/// The tallies of a pipeline, one behind the other.
///
/// # Errors
/// K0116 a size that cannot be evaluated, or more counters than a workgroup has room for.
pub(super) fn tallies(pipeline: &Pipeline) -> Result<Vec<Tally>, Diagnostic> {
    let mut tallies = Vec::new();
    let mut first = 0;
    for (name, declared) in &pipeline.tallies {
        let size = evaluate_size(pipeline, &declared.size)?;
        tallies.push(Tally { name: name.clone(), first, size });
        first = size.saturating_add(first);
        if first > MOST_WORDS {
            return Err(Diagnostic::error("K0116", format!("the tallies up to `{name}` have {first} counters"))
                .at(declared.size.span, format!("{size} of them"))
                .help(format!("a workgroup counts on its own and has room for {MOST_WORDS}")));
        }
    }
    Ok(tallies)
}

/// Words of each buffer.
pub(super) fn words(tallies: &[Tally]) -> u64 {
    tallies.iter().map(|tally| u64::from(tally.size)).sum()
}

/// The module. An index beyond the last counts as the last: it must not reach into the next tally. Workgroups count on their own
/// and add up at the end: all invocations of a device on one word would wait for one another.
pub(super) fn module(pipeline: &Pipeline, tallies: &[Tally], workgroup: u32) -> String {
    let mut text = format!(
        "import package::real::real;\n\n\
         /// Counts of the present samples, tally by tally.\n\
         var<storage, read_write> {COUNTS}: array<atomic<u32>>;\n\n\
         /// Counts of earlier samples divided by the number of their paths, then their sums: of each tally up to each index.\n\
         var<storage, read> {RATES}: array<f32>;\n"
    );
    let words = words(tallies);
    if words > 0 {
        let _ = write!(
            text,
            "\n/// Counts of this workgroup.\n\
             var<workgroup> tally_share: array<atomic<u32>, {words}>;\n\n\
             /// Adds what this workgroup has counted; `lane` numbers its invocations, which must all call it, last of all.\n\
             fn add_tallies(lane: u32) {{\n    \
                 workgroupBarrier();\n    \
                 for (var word = lane; word < {words}u; word += {workgroup}u) {{\n        \
                     let counted = atomicLoad(&tally_share[word]);\n        \
                     if counted > 0u {{\n            \
                         atomicAdd(&{COUNTS}[word], counted);\n        \
                     }}\n    \
                 }}\n\
             }}\n"
        );
    }
    for tally in tallies {
        let doc = pipeline.tallies.get(&tally.name).map_or("", |declared| declared.doc.as_str());
        push_functions(&mut text, tally, doc, words);
    }
    text
}

fn push_functions(text: &mut String, tally: &Tally, doc: &str, words: u64) {
    let Tally { name, first, size } = tally;
    let colon = if doc.is_empty() { "." } else { ": " };
    let doc = doc.replace('\n', " ");
    let word = word(*first, *size);
    let _ = write!(
        text,
        "\n/// Counts at an index of `{name}`{colon}{doc}\n\
         fn count_{name}(index: u32) {{\n    \
             atomicAdd(&tally_share[{word}], 1u);\n\
         }}\n\n\
         /// How often a path of the earlier samples counted at an index of `{name}`.\n\
         fn {name}_rate(index: u32) -> real {{\n    \
             return {RATES}[{word}];\n\
         }}\n\n\
         /// The sum of `{name}_rate` up to an index, that included.\n\
         fn {name}_rate_sum(index: u32) -> real {{\n    \
             return {RATES}[{words}u + {word}];\n\
         }}\n"
    );
}

fn word(first: u32, size: u32) -> String {
    let index = format!("min(index, {}u)", size - 1);
    if first == 0 { index } else { format!("{first}u + {index}") }
}
