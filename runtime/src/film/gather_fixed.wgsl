// Moves a batch of samples from the film to the sums, one word a thread; both in units of 2^-24.

struct Batch { samples: f32, before: f32, words: u32, unused: u32 }

@group(0) @binding(0) var<uniform> batch: Batch;
@group(0) @binding(1) var<storage, read_write> film: array<i64>;
@group(0) @binding(2) var<storage, read_write> sums: array<i64>;
@group(0) @binding(3) var<storage, read_write> spread: array<f32>;

const UNIT: f32 = 1.0 / 16777216.0;

@compute @workgroup_size(64)
fn gather(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let word = (group.y * groups.x + group.x) * 64u + lane;
    if word >= batch.words { return; }
    let value = film[word];
    film[word] = 0li;
    let sum = sums[word];
    if batch.before > 0.0 {
        // Chan's update of a sum of squared deviations by the mean of a new batch.
        let deviation = UNIT * (f32(value) / batch.samples - f32(sum) / batch.before);
        spread[word] += deviation * deviation * (batch.samples / (batch.before + batch.samples) * batch.before);
    }
    sums[word] = sum + value;
}
