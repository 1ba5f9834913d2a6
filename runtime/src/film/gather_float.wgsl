// Moves a batch of samples from the film to the sums, one word a thread.

struct Batch { samples: f32, before: f32, words: u32, unused: u32 }

@group(0) @binding(0) var<uniform> batch: Batch;
@group(0) @binding(1) var<storage, read_write> film: array<f32>;
@group(0) @binding(2) var<storage, read_write> sums: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> spread: array<f32>;

// Knuth's two-sum: the rounding error of every addition goes to the second word, so that a long render does not stall.
fn add(sum: vec2f, value: f32) -> vec2f {
    let total = sum.x + value;
    let part = total - sum.x;
    let lost = (sum.x - (total - part)) + (value - part);
    return vec2f(total, sum.y + lost);
}

@compute @workgroup_size(64)
fn gather(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let word = (group.y * groups.x + group.x) * 64u + lane;
    if word >= batch.words { return; }
    let value = film[word];
    film[word] = 0.0;
    let sum = sums[word];
    if batch.before > 0.0 {
        // Chan's update of a sum of squared deviations by the mean of a new batch.
        let deviation = value / batch.samples - (sum.x + sum.y) / batch.before;
        spread[word] += deviation * deviation * (batch.samples / (batch.before + batch.samples) * batch.before);
    }
    sums[word] = add(sum, value);
}
