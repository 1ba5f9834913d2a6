//! A tile of blue noise: the same in every scene, made when the kernels first ask for it.
//!
//! Ulichney, *The void-and-cluster method for dither array generation*, 1993.

use std::sync::OnceLock;

/// Texels in a row, and rows; `stages/wgsl/sequence/blue_noise` reads a tile of this size.
const SIDE: usize = 128;
const TEXELS: usize = SIDE * SIDE;
/// Width of the Gaussian by which points are near each other, texels (Ulichney's choice).
const SIGMA: f64 = 1.5;
/// Beyond this distance on an axis points are not felt, texels: the Gaussian is below 10^-6 there.
const REACH: usize = 8;
/// One point in so many is set at first (Ulichney: at most half).
const FIRST_POINTS: u64 = 10;
/// Bits of a texel that its rank leaves.
const BITS_BELOW_RANK: u32 = 32 - TEXELS.ilog2();

/// The tile's bytes: little-endian words, fractions of 2^32, row by row. One word lies in each of as many equal parts of the unit interval
/// as there are texels; where in its part is random.
pub fn bytes() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| words().iter().flat_map(|word| word.to_le_bytes()).collect())
}

fn words() -> Vec<u32> {
    let below = |texel: usize| (mix(texel as u64) >> 32) as u32 >> (32 - BITS_BELOW_RANK);
    ranks().iter().enumerate().map(|(texel, &rank)| rank << BITS_BELOW_RANK | below(texel)).collect()
}

/// Each number below the count of texels once: the texels up to any rank are spread as evenly as the method can.
fn ranks() -> Vec<u32> {
    let first = first_points();
    let mut ranks = vec![0; TEXELS];
    let mut points = first.clone();
    for rank in (0..first.count()).rev() {
        let texel = points.tightest_cluster();
        points.set(texel, false);
        ranks[texel] = rank as u32;
    }
    let mut points = first;
    // The void of the points set is the cluster of those that are not: one rule serves beyond the half, too.
    for rank in points.count()..TEXELS {
        let texel = points.largest_void();
        points.set(texel, true);
        ranks[texel] = rank as u32;
    }
    ranks
}

/// Random points, moved from clusters to voids until that brings nothing.
fn first_points() -> Points {
    let mut points = Points::new();
    for texel in (0..TEXELS).filter(|&texel| mix((TEXELS + texel) as u64).is_multiple_of(FIRST_POINTS)) {
        points.set(texel, true);
    }
    loop {
        let cluster = points.tightest_cluster();
        points.set(cluster, false);
        let void = points.largest_void();
        let gain = points.nearness[cluster] - points.nearness[void];
        points.set(if gain > 0 { void } else { cluster }, true);
        if gain == 0 {
            return points;
        }
    }
}

/// Points on the texels of a torus.
#[derive(Clone)]
struct Points {
    is_set: Vec<bool>,
    /// Sum of the weights of the set points around each texel, itself included.
    nearness: Vec<i64>,
    /// Of points so many texels away on both axes.
    weights: [[i64; REACH + 1]; REACH + 1],
    /// What `tightest_cluster` and `largest_void` choose from: the one of each row.
    clusters: [Option<usize>; SIDE],
    voids: [Option<usize>; SIDE],
}

impl Points {
    fn new() -> Points {
        /// Weights are whole numbers: taking a point away undoes adding it.
        const ONE: f64 = (1u64 << 40) as f64;
        let weight = |x: usize, y: usize| (ONE * (-((x * x + y * y) as f64) / (2.0 * SIGMA * SIGMA)).exp()) as i64;
        let weights = std::array::from_fn(|y| std::array::from_fn(|x| weight(x, y)));
        let voids = std::array::from_fn(|row| Some(row * SIDE));
        Points { is_set: vec![false; TEXELS], nearness: vec![0; TEXELS], weights, clusters: [None; SIDE], voids }
    }

    fn count(&self) -> usize {
        self.is_set.iter().filter(|&&set| set).count()
    }

    fn set(&mut self, texel: usize, set: bool) {
        self.is_set[texel] = set;
        let sign = if set { 1 } else { -1 };
        for y in 0..=2 * REACH {
            let row = (texel / SIDE + SIDE + y - REACH) % SIDE;
            for x in 0..=2 * REACH {
                let column = (texel % SIDE + SIDE + x - REACH) % SIDE;
                self.nearness[row * SIDE + column] += sign * self.weights[y.abs_diff(REACH)][x.abs_diff(REACH)];
            }
            self.choose_from_row(row);
        }
    }

    fn choose_from_row(&mut self, row: usize) {
        let texels = row * SIDE..(row + 1) * SIDE;
        self.clusters[row] =
            texels.clone().filter(|&texel| self.is_set[texel]).max_by_key(|&texel| self.nearness[texel]);
        self.voids[row] = texels.filter(|&texel| !self.is_set[texel]).min_by_key(|&texel| self.nearness[texel]);
    }

    /// The set point with most points near it.
    fn tightest_cluster(&self) -> usize {
        self.clusters.iter().flatten().copied().max_by_key(|&texel| self.nearness[texel]).unwrap_or(0)
    }

    /// The texel without a point that has fewest points near it.
    fn largest_void(&self) -> usize {
        self.voids.iter().flatten().copied().min_by_key(|&texel| self.nearness[texel]).unwrap_or(0)
    }
}

/// A random word for each number (Steele et al. 2014, SplitMix64).
fn mix(number: u64) -> u64 {
    let mut word = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    word = (word ^ word >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ word >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ word >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_is_there_once() {
        let mut ranks: Vec<u32> = words().iter().map(|word| word >> BITS_BELOW_RANK).collect();
        ranks.sort_unstable();
        assert!(ranks.into_iter().eq(0..TEXELS as u32));
    }

    /// At every level of grey the points keep their distance: squares of 8 x 8 texels hold as many as they should, within a few.
    #[test]
    fn points_up_to_any_rank_are_spread_evenly() {
        let ranks = ranks();
        for level in [TEXELS / 16, TEXELS / 4, TEXELS / 2, TEXELS * 3 / 4] {
            let mut squares = [0.0f64; TEXELS / 64];
            for (texel, _) in ranks.iter().enumerate().filter(|&(_, &rank)| (rank as usize) < level) {
                squares[texel / SIDE / 8 * (SIDE / 8) + texel % SIDE / 8] += 1.0;
            }
            let share = level as f64 / TEXELS as f64;
            let variance =
                squares.iter().map(|count| (count - 64.0 * share).powi(2)).sum::<f64>() / squares.len() as f64;
            // Independent points would have the variance of a binomial distribution.
            let independent = 64.0 * share * (1.0 - share);
            assert!(variance < 0.25 * independent, "level {level}: {variance} against {independent}");
        }
    }
}
