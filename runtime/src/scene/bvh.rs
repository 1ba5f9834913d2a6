//! Bounding volume hierarchies over the triangles, built by obvhs and packed as the kernels read them.

use glam::Vec3A;
use kernelgen::plan::Plan;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::PlocBuilder;
use serde::{Deserialize, Serialize};

/// Entries of the stacks with which the kernels traverse: `CWBVH_STACK` and `BVH2_STACK` in `stages/wgsl/trace`.
const CWBVH_STACK: usize = 32;
const BVH2_STACK: usize = 64;

/// Which hierarchy the kernels traverse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Accelerator {
    /// Eight children a node, compressed to 80 bytes (Ylitie et al. 2017).
    #[default]
    Cwbvh,
    /// Two children a node, uncompressed.
    Bvh2,
}

impl Accelerator {
    /// The hierarchy that the kernels of a plan read.
    pub fn of(plan: &Plan) -> Self {
        let reads = |name: &str| plan.buffers.iter().any(|buffer| buffer.name == name);
        if reads("bvh2_nodes") { Accelerator::Bvh2 } else { Accelerator::Cwbvh }
    }

    /// The deepest hierarchy that the kernels can traverse: on the way down they put by one entry a level.
    pub fn most_levels(self) -> usize {
        match self {
            Accelerator::Cwbvh => CWBVH_STACK,
            Accelerator::Bvh2 => BVH2_STACK,
        }
    }
}

/// Time spent on building against time spent on tracing: obvhs' presets, without spatial splits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BuildPreset {
    /// Least effort.
    VeryFast,
    /// Little effort.
    Fast,
    /// About as long as Embree takes.
    #[default]
    Medium,
    /// Much effort.
    Slow,
    /// Most effort.
    VerySlow,
}

impl BuildPreset {
    /// All of them, from least effort to most.
    pub const ALL: [BuildPreset; 5] =
        [BuildPreset::VeryFast, BuildPreset::Fast, BuildPreset::Medium, BuildPreset::Slow, BuildPreset::VerySlow];

    /// The word for it in settings and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            BuildPreset::VeryFast => "very_fast",
            BuildPreset::Fast => "fast",
            BuildPreset::Medium => "medium",
            BuildPreset::Slow => "slow",
            BuildPreset::VerySlow => "very_slow",
        }
    }

    fn parameters(self) -> BvhBuildParams {
        let parameters = match self {
            BuildPreset::VeryFast => BvhBuildParams::very_fast_build(),
            BuildPreset::Fast => BvhBuildParams::fast_build(),
            BuildPreset::Medium => BvhBuildParams::medium_build(),
            BuildPreset::Slow => BvhBuildParams::slow_build(),
            BuildPreset::VerySlow => BvhBuildParams::very_slow_build(),
        };
        // A split triangle would stand in several leaves: its index would no longer be its place in the leaf order.
        BvhBuildParams { pre_split: false, ..parameters }
    }
}

/// A packed hierarchy.
pub struct Bvh {
    /// Node words: 20 a node of a CWBVH, 8 a node of a BVH2.
    pub words: Vec<u32>,
    /// Old index of the triangle at each new place.
    pub order: Vec<u32>,
    /// Number of nodes.
    pub nodes: usize,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
}

/// Builds a hierarchy over triangles given by their corners.
pub fn build(triangles: &[[glam::Vec3; 3]], accelerator: Accelerator, preset: BuildPreset) -> Bvh {
    let exponent = normalizing_exponent(triangles);
    let boxes: Vec<Aabb> = triangles.iter().map(|corners| bounds(corners, exponent)).collect();
    match accelerator {
        Accelerator::Cwbvh => cwbvh(&boxes, preset.parameters(), exponent),
        Accelerator::Bvh2 => bvh2(&boxes, preset.parameters(), exponent),
    }
}

/// Exponent of the power of two that brings the extent to 512..1024: obvhs has absolute epsilons, and scenes come in all sizes.
fn normalizing_exponent(triangles: &[[glam::Vec3; 3]]) -> i32 {
    let (mut low, mut high) = (glam::Vec3::MAX, glam::Vec3::MIN);
    for corner in triangles.as_flattened() {
        (low, high) = (low.min(*corner), high.max(*corner));
    }
    let extent = (high - low).max_element();
    if extent > 0.0 && extent.is_finite() { 9 - extent.log2().floor() as i32 } else { 0 }
}

/// 2^exponent; all products with it are exact.
fn power(exponent: i32) -> f32 {
    f64::from(exponent).exp2() as f32
}

/// Box of a triangle, scaled, and wider by a few roundings: the kernels rebuild corners from edges, and quantize.
fn bounds(corners: &[glam::Vec3; 3], exponent: i32) -> Aabb {
    const SLACK: f32 = 1.0 / (1 << 22) as f32;
    let scaled = corners.map(|corner| Vec3A::from(corner * power(exponent)));
    let tight = Aabb::from_points(&scaled);
    let slack = tight.min.abs().max(tight.max.abs()) * SLACK;
    Aabb::new(tight.min - slack, tight.max + slack)
}

fn binary(boxes: &[Aabb], parameters: BvhBuildParams) -> (Bvh2, ReinsertionOptimizer) {
    let indices = (0..boxes.len() as u32).collect();
    let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
        parameters.ploc_search_distance,
        boxes,
        indices,
        parameters.sort_precision,
        parameters.search_depth_threshold,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut bvh, parameters.reinsertion_batch_ratio, None);
    (bvh, optimizer)
}

fn cwbvh(boxes: &[Aabb], parameters: BvhBuildParams, exponent: i32) -> Bvh {
    if boxes.is_empty() {
        // A node without children.
        return Bvh { words: vec![0; 20], order: Vec::new(), nodes: 1, depth: 1 };
    }
    let (binary, _) = binary(boxes, parameters);
    let wide = bvh2_to_cwbvh(&binary, parameters.max_prims_per_leaf.clamp(1, 3), true, false);
    let nodes: Vec<CwBvhNode> = wide.nodes.iter().map(|node| unscaled(node, exponent)).collect();
    Bvh {
        words: bytemuck::cast_slice::<CwBvhNode, u8>(&nodes)
            .chunks_exact(4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect(),
        order: wide.primitive_indices,
        nodes: nodes.len(),
        depth: wide_depth(&nodes),
    }
}

/// The node in world units. Its grid exponents are biased like those of floats; only an axis without extent can leave their range,
/// and there a step of the smallest float is as good as none.
fn unscaled(node: &CwBvhNode, exponent: i32) -> CwBvhNode {
    let e = node.e.map(|e| (i32::from(e) - exponent).clamp(1, 254) as u8);
    CwBvhNode { p: node.p * power(-exponent), e, ..*node }
}

fn wide_depth(nodes: &[CwBvhNode]) -> usize {
    let mut deepest = 1;
    let mut stack = vec![(0usize, 1usize)];
    while let Some((index, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        let node = &nodes[index];
        stack.extend((0..node.imask.count_ones()).map(|child| ((node.child_base_idx + child) as usize, depth + 1)));
    }
    deepest
}

fn bvh2(boxes: &[Aabb], parameters: BvhBuildParams, exponent: i32) -> Bvh {
    if boxes.is_empty() {
        return empty_bvh2();
    }
    let (mut bvh, mut optimizer) = binary(boxes, parameters);
    collapse(&mut bvh, parameters.max_prims_per_leaf.clamp(1, 255), parameters.collapse_traversal_cost);
    let ratio = parameters.reinsertion_batch_ratio * parameters.post_collapse_reinsertion_batch_ratio_multiplier;
    optimizer.run(&mut bvh, ratio, None);
    pack_bvh2(&bvh, power(-exponent))
}

/// One leaf, a point far outside every scene, over a triangle without edges (the triangle table of an empty scene holds one).
fn empty_bvh2() -> Bvh {
    let far = 1e30f32.to_bits();
    Bvh { words: vec![far, far, far, 0, far, far, far, 1], order: Vec::new(), nodes: 1, depth: 1 }
}

/// Lays the nodes out depth first, and the triangles in the order of their leaves.
fn pack_bvh2(bvh: &Bvh2, scale: f32) -> Bvh {
    let mut out = Bvh {
        words: Vec::with_capacity(bvh.nodes.len() * 8),
        order: Vec::with_capacity(bvh.primitive_indices.len()),
        nodes: 1,
        depth: 1,
    };
    let push = |words: &mut Vec<u32>, node: &Bvh2Node| {
        let (min, max) = (node.aabb().min * scale, node.aabb().max * scale);
        words.extend([min.x, min.y, min.z, 0.0, max.x, max.y, max.z].map(f32::to_bits));
        words.push(node.prim_count);
    };
    push(&mut out.words, &bvh.nodes[0]);
    let mut stack = vec![(0usize, 0usize, 1usize)];
    while let Some((source, place, depth)) = stack.pop() {
        out.depth = out.depth.max(depth);
        let node = &bvh.nodes[source];
        let first = node.first_index as usize;
        if node.is_leaf() {
            out.words[place * 8 + 3] = out.order.len() as u32;
            out.order.extend_from_slice(&bvh.primitive_indices[first..first + node.prim_count as usize]);
            continue;
        }
        out.words[place * 8 + 3] = out.nodes as u32;
        bvh.nodes[first..first + 2].iter().for_each(|child| push(&mut out.words, child));
        stack.push((first + 1, out.nodes + 1, depth + 1));
        stack.push((first, out.nodes, depth + 1));
        out.nodes += 2;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Triangles of many sizes in a box of the given size, away from the origin; coincident ones among them.
    fn soup(count: u32, size: f32) -> Vec<[Vec3; 3]> {
        let number = |seed: u32| {
            let mixed = seed.wrapping_mul(0x9e37_79b9) ^ (seed.wrapping_mul(0x85eb_ca6b) >> 13);
            (mixed.wrapping_mul(0xc2b2_ae35) >> 8) as f32 / (1 << 24) as f32
        };
        let point = |seed: u32| Vec3::new(number(seed), number(seed + 1), number(seed + 2));
        (0..count)
            .map(|i| {
                let centre = point((i / 2) * 31) + 1.0;
                [0, 1, 2].map(|corner| (centre + point((i / 2) * 31 + 3 + 3 * corner) * 0.05) * size)
            })
            .collect()
    }

    fn assert_is_permutation(order: &[u32], count: usize) {
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..count as u32).collect::<Vec<_>>());
    }

    fn float(words: &[u32], at: usize) -> f32 {
        f32::from_bits(words[at])
    }

    /// Every triangle must lie inside all boxes on its way from the root.
    fn check_bvh2(bvh: &Bvh, triangles: &[[Vec3; 3]]) {
        assert_is_permutation(&bvh.order, triangles.len());
        let mut stack = vec![(0usize, Vec::new())];
        while let Some((node, mut boxes)) = stack.pop() {
            let w = &bvh.words[node * 8..node * 8 + 8];
            boxes.push((
                Vec3::new(float(w, 0), float(w, 1), float(w, 2)),
                Vec3::new(float(w, 4), float(w, 5), float(w, 6)),
            ));
            let (first, count) = (w[3] as usize, w[7] as usize);
            if count == 0 {
                stack.extend([(first, boxes.clone()), (first + 1, boxes)]);
                continue;
            }
            for &triangle in &bvh.order[first..first + count] {
                assert_inside(&boxes, &triangles[triangle as usize]);
            }
        }
    }

    fn assert_inside(boxes: &[(Vec3, Vec3)], corners: &[Vec3; 3]) {
        for (low, high) in boxes {
            assert!(
                corners.iter().all(|c| c.cmpge(*low).all() && c.cmple(*high).all()),
                "{corners:?} outside {low} {high}"
            );
        }
    }

    fn check_cwbvh(bvh: &Bvh, triangles: &[[Vec3; 3]]) {
        assert_is_permutation(&bvh.order, triangles.len());
        let bytes: Vec<u8> = bvh.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let mut stack = vec![(0usize, Vec::new())];
        while let Some((index, boxes)) = stack.pop() {
            let node: CwBvhNode = bytemuck::pod_read_unaligned(&bytes[index * 80..index * 80 + 80]);
            let step = Vec3::from(node.e.map(|e| f32::from_bits(u32::from(e) << 23)));
            let mut inner = 0;
            for child in 0..8 {
                let meta = node.child_meta[child];
                if meta == 0 {
                    continue;
                }
                let corner = |x: [u8; 8], y: [u8; 8], z: [u8; 8]| {
                    node.p + Vec3::new(f32::from(x[child]), f32::from(y[child]), f32::from(z[child])) * step
                };
                let mut boxes = boxes.clone();
                boxes.push((
                    corner(node.child_min_x, node.child_min_y, node.child_min_z),
                    corner(node.child_max_x, node.child_max_y, node.child_max_z),
                ));
                if node.imask & (1 << child) != 0 {
                    stack.push(((node.child_base_idx + inner) as usize, boxes));
                    inner += 1;
                    continue;
                }
                let first = (node.primitive_base_idx + u32::from(meta & 31)) as usize;
                for &triangle in &bvh.order[first..first + (meta >> 5).count_ones() as usize] {
                    assert_inside(&boxes, &triangles[triangle as usize]);
                }
            }
        }
    }

    #[test]
    fn boxes_enclose_their_triangles_at_every_scale() {
        for size in [1e-5, 1.0, 1e6] {
            for count in [1, 2, 9, 500] {
                let triangles = soup(count, size);
                for preset in [BuildPreset::VeryFast, BuildPreset::Medium, BuildPreset::VerySlow] {
                    check_bvh2(&build(&triangles, Accelerator::Bvh2, preset), &triangles);
                    check_cwbvh(&build(&triangles, Accelerator::Cwbvh, preset), &triangles);
                }
            }
        }
    }

    #[test]
    fn the_kernels_have_the_stacks_that_are_counted_on() {
        for (path, declaration) in [
            ("trace/cwbvh", format!("const CWBVH_STACK: u32 = {CWBVH_STACK}u;")),
            ("trace/bvh2", format!("const BVH2_STACK: u32 = {BVH2_STACK}u;")),
        ] {
            let declared = |module: &stages::Module| module.path == path && module.text.contains(&declaration);
            assert!(stages::modules().iter().any(declared), "{path}: {declaration}");
        }
    }

    #[test]
    fn coincident_triangles_and_nothing_at_all() {
        let triangles = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 300];
        check_bvh2(&build(&triangles, Accelerator::Bvh2, BuildPreset::Medium), &triangles);
        check_cwbvh(&build(&triangles, Accelerator::Cwbvh, BuildPreset::Medium), &triangles);
        assert_eq!(build(&[], Accelerator::Cwbvh, BuildPreset::Medium).words, [0; 20]);
        assert_eq!(build(&[], Accelerator::Bvh2, BuildPreset::Medium).nodes, 1);
    }
}
