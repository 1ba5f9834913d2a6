//! Queues sorted by a key: a counting sort in three kernels, which puts the paths that wait for a stage in the order of their keys before
//! the stage's own kernel takes them from the same queue (sorting by material: Laine et al. 2013; by ray: Meister et al. 2020).
//!
//! `count_keys_X` computes the key of every path that waits for stage X, notes path and key, and counts each key; `sum_keys` turns counts
//! into the places where keys begin; `sort_X` writes the paths back into the queue. Paths of equal keys come in any order.

use super::kernel::{Filling, Frame, call};
use super::text::{Imports, PARAMETERS, stage_constant};
use super::wiring::WiredKey;

/// Keys are told apart modulo this many: a workgroup of as many threads adds up their counts.
pub(super) const BINS: u32 = 256;

/// The kernel that computes and counts the keys of the paths that wait for a stage.
pub(super) fn count_kernel(frame: Frame<'_>, key: &WiredKey) -> String {
    let mut imports = Imports::default();
    let path = frame.queued_as(&mut imports);
    let mut filling = Filling {
        imports,
        heading: format!("Key `{}`", key.entry.name),
        locals: "    var bin = NO_BIN;\n".to_owned(),
        instances: key.instances.iter().cloned().collect(),
        end: format!("\n    count_key(bin, {path}, index, lane);\n"),
        ..Filling::default()
    };
    filling.body = format!("        bin = {} % BINS;\n", call(&key.entry.name, &key.instances));
    filling.imports.add(&key.entry.module, [key.entry.name.as_str()]);
    filling.imports.add("sort", ["BINS", "NO_BIN", "count_key"]);
    frame.fill(filling)
}

/// The kernel of one workgroup that says where the paths of each key begin.
pub(super) fn sum_kernel(name: &str) -> String {
    let mut imports = Imports::default();
    imports.add("sort", ["sum_counts"]);
    format!(
        "{imports}\n\
         /// Turns the counts of keys into the places where their paths begin.\n\
         @compute @workgroup_size({BINS})\n\
         fn {name}_main(@builtin(local_invocation_index) lane: u32) {{\n    \
             sum_counts(lane);\n\
         }}\n"
    )
}

/// The kernel that writes the paths back into their queue.
pub(super) fn sort_kernel(name: &str, stage: &str, workgroup: u32) -> String {
    let constant = stage_constant(stage);
    let mut imports = Imports::default();
    imports.add("queue", [constant.as_str()]);
    imports.add("sort", ["place_by_key"]);
    format!(
        "{imports}\n\
         /// Puts the paths that wait for `{stage}` in the order of their keys.\n\
         @compute @workgroup_size({workgroup})\n\
         fn {name}_main{PARAMETERS} {{\n    \
             place_by_key({constant}, (group.y * groups.x + group.x) * {workgroup}u + lane, lane);\n\
         }}\n"
    )
}

/// `package::sort`: the counting sort, for workgroups of so many threads. One queue is sorted at a time.
pub(super) fn module(workgroup: u32) -> String {
    format!(
        "import package::control::running;\n\
         import package::pass::path_count;\n\
         import package::queue::queue;\n\n\
         /// Keys that are told apart.\n\
         const BINS: u32 = {BINS}u;\n\n\
         /// In the place of a key where there is no path.\n\
         const NO_BIN: u32 = BINS;\n\n\
         /// Threads of the workgroups that count and place.\n\
         const SORT_THREADS: u32 = {workgroup}u;\n\
         {SORT}"
    )
}

const SORT: &str = r"
/// How many paths have each key, 0 when none is counted; then where those of each key that have no place yet go.
var<storage, read_write> key_bins: array<atomic<u32>>;

/// Paths of the queue that is sorted, and their keys.
var<storage, read_write> keyed_paths: array<vec2u>;

/// Of this workgroup's paths: how many have each key, later where they go.
var<workgroup> bin_shares: array<atomic<u32>, BINS>;

/// Running sums over keys.
var<workgroup> bin_sums: array<u32, BINS>;

/// Notes the key of a path, and counts it unless it is `NO_BIN`, with one atomic a key and workgroup; `lane` numbers its invocations,
/// which must all call it.
fn count_key(bin: u32, path: u32, place: u32, lane: u32) {
    _ = rank_in_bin(bin, lane);
    if bin != NO_BIN {
        keyed_paths[place] = vec2u(path, bin);
    }
    for (var own = lane; own < BINS; own += SORT_THREADS) {
        let share = atomicLoad(&bin_shares[own]);
        if share > 0u {
            atomicAdd(&key_bins[own], share);
        }
    }
}

/// How many paths of this workgroup came before with the same key; counts them in `bin_shares`. To be called by all invocations.
fn rank_in_bin(bin: u32, lane: u32) -> u32 {
    for (var own = lane; own < BINS; own += SORT_THREADS) {
        atomicStore(&bin_shares[own], 0u);
    }
    workgroupBarrier();
    var rank = 0u;
    if bin != NO_BIN {
        rank = atomicAdd(&bin_shares[bin], 1u);
    }
    workgroupBarrier();
    return rank;
}

/// Exclusive sums of the counts, which are zeroed (Hillis and Steele 1986). To be called by one workgroup with a thread a key.
fn sum_counts(bin: u32) {
    let count = atomicExchange(&key_bins[bin], 0u);
    bin_sums[bin] = count;
    workgroupBarrier();
    for (var step = 1u; step < BINS; step *= 2u) {
        var below = 0u;
        if bin >= step {
            below = bin_sums[bin - step];
        }
        workgroupBarrier();
        bin_sums[bin] += below;
        workgroupBarrier();
    }
    atomicStore(&key_bins[BINS + bin], bin_sums[bin] - count);
}

/// Writes the path that was noted at a place back into its queue, behind all with smaller keys. To be called by all invocations of a
/// workgroup.
fn place_by_key(number: u32, place: u32, lane: u32) {
    var noted = vec2u(0u, NO_BIN);
    if place < running(number) {
        noted = keyed_paths[place];
    }
    let rank = rank_in_bin(noted.y, lane);
    for (var own = lane; own < BINS; own += SORT_THREADS) {
        let share = atomicLoad(&bin_shares[own]);
        if share > 0u {
            atomicStore(&bin_shares[own], atomicAdd(&key_bins[BINS + own], share));
        }
    }
    workgroupBarrier();
    if noted.y != NO_BIN {
        queue[number * path_count + atomicLoad(&bin_shares[noted.y]) + rank] = noted.x;
    }
}
";
