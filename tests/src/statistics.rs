//! Statistics of rendered images: means with standard errors, z-scores over pixel blocks, the chi-square test.

/// A mean and the standard error of that mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
}

impl Estimate {
    /// The mean of independent values, with the error that their spread implies. Two values at least.
    pub fn of(values: &[f64]) -> Estimate {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Estimate { mean, error: (squares / (count * (count - 1.0))).sqrt() }
    }

    /// A value known without error.
    pub fn exact(mean: f64) -> Estimate {
        Estimate { mean, error: 0.0 }
    }

    /// The standard error as a share of the mean, infinite where that is not positive.
    fn noise(&self) -> f64 {
        if self.mean > 0.0 { self.error / self.mean } else { f64::INFINITY }
    }

    /// How many combined standard errors two means lie apart; `floor` is an error that both share (rounding), so that exact values compare.
    pub fn z(&self, other: &Estimate, floor: f64) -> f64 {
        let error = (self.error.powi(2) + other.error.powi(2) + floor.powi(2)).sqrt();
        if error == 0.0 {
            return if self.mean == other.mean { 0.0 } else { f64::INFINITY };
        }
        (self.mean - other.mean) / error
    }
}

/// An RGB image as rows of pixels, with standard errors.
#[derive(Clone, Debug)]
pub struct Pixels {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Mean radiance.
    pub rgb: Vec<[f32; 3]>,
    /// Standard error of each mean.
    pub errors: Vec<[f32; 3]>,
}

impl Pixels {
    /// Every channel of every pixel, channels fastest.
    pub fn estimates(&self) -> Vec<Estimate> {
        self.block_estimates(1)
    }

    /// Means over squares of `size` pixels (smaller at the right and lower edges), row by row, channels fastest.
    ///
    /// Pixels count as independent.
    pub fn block_estimates(&self, size: usize) -> Vec<Estimate> {
        let columns = self.width.div_ceil(size);
        let mut blocks = vec![Block::default(); columns * self.height.div_ceil(size)];
        for (i, (mean, error)) in self.rgb.iter().zip(&self.errors).enumerate() {
            let (x, y) = (i % self.width, i / self.width);
            blocks[(y / size) * columns + x / size].add(mean, error);
        }
        blocks.iter().flat_map(Block::estimates).collect()
    }

    /// The mean over the whole image and all channels. Channels count as wholly dependent, pixels as independent.
    pub fn mean_estimate(&self) -> Estimate {
        let channels = self.block_estimates(self.width.max(self.height));
        Estimate {
            mean: channels.iter().map(|channel| channel.mean).sum::<f64>() / 3.0,
            error: channels.iter().map(|channel| channel.error).sum::<f64>() / 3.0,
        }
    }

    /// An image known without error.
    pub fn exact(width: usize, height: usize, rgb: Vec<[f32; 3]>) -> Pixels {
        Pixels { width, height, errors: vec![[0.0; 3]; rgb.len()], rgb }
    }

    /// The image with squares of `factor` pixels made one. Pixels that do not fill a square at the right and lower edges are left out.
    pub fn shrunk(&self, factor: usize) -> Pixels {
        let (width, height) = (self.width / factor, self.height / factor);
        let cropped = |values: &[[f32; 3]]| -> Vec<[f32; 3]> {
            (0..height * factor).flat_map(|y| values[y * self.width..][..width * factor].to_vec()).collect()
        };
        let whole = Pixels {
            width: width * factor,
            height: height * factor,
            rgb: cropped(&self.rgb),
            errors: cropped(&self.errors),
        };
        let blocks = whole.block_estimates(factor);
        let pick = |value: fn(&Estimate) -> f64| -> Vec<[f32; 3]> {
            blocks.chunks_exact(3).map(|pixel| std::array::from_fn(|channel| value(&pixel[channel]) as f32)).collect()
        };
        Pixels { width, height, rgb: pick(|e| e.mean), errors: pick(|e| e.error) }
    }
}

/// Sums over a square of pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    sums: [f64; 3],
    variances: [f64; 3],
    count: f64,
}

impl Block {
    fn add(&mut self, mean: &[f32; 3], error: &[f32; 3]) {
        for channel in 0..3 {
            self.sums[channel] += f64::from(mean[channel]);
            self.variances[channel] += f64::from(error[channel]).powi(2);
        }
        self.count += 1.0;
    }

    fn estimates(&self) -> [Estimate; 3] {
        std::array::from_fn(|channel| Estimate {
            mean: self.sums[channel] / self.count,
            error: self.variances[channel].sqrt() / self.count,
        })
    }
}

/// How a set of z-scores is spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// How many lie beyond 4 in size.
    pub beyond_4: usize,
    /// How many lie beyond 6 in size.
    pub beyond_6: usize,
    /// The largest in size.
    pub largest: f64,
    /// Root mean square; 1 for normal scores whose errors are right.
    pub root_mean_square: f64,
}

/// Sums up z-scores. A score that is not a number counts as infinite.
pub fn spread(scores: &[f64]) -> Spread {
    let sizes: Vec<f64> = scores.iter().map(|score| if score.is_nan() { f64::INFINITY } else { score.abs() }).collect();
    let beyond = |limit: f64| sizes.iter().filter(|&&size| size > limit).count();
    Spread {
        count: sizes.len(),
        beyond_4: beyond(4.0),
        beyond_6: beyond(6.0),
        largest: sizes.iter().copied().fold(0.0, f64::max),
        root_mean_square: (sizes.iter().map(|size| size * size).sum::<f64>() / sizes.len().max(1) as f64).sqrt(),
    }
}

impl Spread {
    /// The rule for two renderings of one image: none beyond 6, at most one in 10,000 (and at least one allowed) beyond 4.
    pub fn agrees(&self) -> bool {
        self.beyond_6 == 0 && self.beyond_4 <= (self.count / 10_000).max(1)
    }
}

/// z-scores of two rows of estimates, with a shared relative rounding error.
pub fn z_scores(a: &[Estimate], b: &[Estimate], relative_floor: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a.z(b, relative_floor * a.mean.abs().max(b.mean.abs()))).collect()
}

/// What two images, or an image and what it must be, say of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// z-scores of blocks of pixels.
    pub blocks: Spread,
    /// z-score of the mean over the image.
    pub mean: f64,
    /// The larger standard error of the two means, as a share of its mean; infinite for a black image.
    pub noise: f64,
}

impl Comparison {
    /// Compares means over blocks of `block` x `block` pixels and over everything, with a shared relative rounding error.
    pub fn of(a: &Pixels, b: &Pixels, block: usize, relative_floor: f64) -> Comparison {
        let (mean_a, mean_b) = (a.mean_estimate(), b.mean_estimate());
        Comparison {
            blocks: spread(&z_scores(&a.block_estimates(block), &b.block_estimates(block), relative_floor)),
            mean: mean_a.z(&mean_b, relative_floor * mean_a.mean.abs()),
            noise: mean_a.noise().max(mean_b.noise()),
        }
    }

    /// The rule for two renderings of one image, for blocks and for the mean. It says nothing where there is too much noise.
    pub fn agrees(&self) -> bool {
        self.blocks.agrees() && self.mean.abs() < 4.0
    }
}

/// The result of a chi-square test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// The statistic.
    pub statistic: f64,
    /// Degrees of freedom: cells after pooling, less one.
    pub freedom: usize,
    /// Probability of a statistic at least as large if the expectation is right.
    pub p_value: f64,
}

/// Tests observed counts against expected ones; cells that expect less than 5 are pooled into one.
pub fn chi_square(observed: &[u64], expected: &[f64]) -> ChiSquare {
    let mut cells: Vec<(f64, f64)> = Vec::new();
    let mut pool = (0.0, 0.0);
    for (&count, &expectation) in observed.iter().zip(expected) {
        if expectation < 5.0 {
            pool = (pool.0 + count as f64, pool.1 + expectation);
        } else {
            cells.push((count as f64, expectation));
        }
    }
    if pool != (0.0, 0.0) {
        cells.push(pool);
    }
    let statistic = cells.iter().map(|(count, expectation)| (count - expectation).powi(2) / expectation).sum();
    let freedom = cells.len().saturating_sub(1);
    ChiSquare { statistic, freedom, p_value: upper_gamma(freedom as f64 / 2.0, statistic / 2.0) }
}

/// The regularised upper incomplete gamma function Q(a, x): by its series below a + 1, by its continued fraction above.
fn upper_gamma(a: f64, x: f64) -> f64 {
    if a <= 0.0 || x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - log_gamma(a)).exp();
    if x < a + 1.0 { 1.0 - scale * lower_series(a, x) } else { scale * upper_fraction(a, x) }
}

fn lower_series(a: f64, x: f64) -> f64 {
    let mut term = 1.0 / a;
    let mut sum = term;
    let mut n = a;
    while term > sum * 1e-15 {
        n += 1.0;
        term *= x / n;
        sum += term;
    }
    sum
}

/// The continued fraction 1/(x+1-a- 1(1-a)/(x+3-a- ...)), from its tail up.
fn upper_fraction(a: f64, x: f64) -> f64 {
    let depth = 200 + (10.0 * a.sqrt()) as u32;
    let mut tail = 0.0;
    for i in (1..=depth).rev() {
        let i = f64::from(i);
        tail = i * (i - a) / (x + 2.0 * i + 1.0 - a - tail);
    }
    1.0 / (x + 1.0 - a - tail)
}

/// Stirling's series after a shift of the argument above 12; relative error below 1e-14.
fn log_gamma(a: f64) -> f64 {
    let mut shift = 0.0;
    let mut x = a;
    while x < 12.0 {
        shift += x.ln();
        x += 1.0;
    }
    let inverse = 1.0 / (x * x);
    let series = (1.0 / 12.0 - inverse * (1.0 / 360.0 - inverse * (1.0 / 1260.0 - inverse / 1680.0))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_has_the_tabulated_quantiles() {
        for (freedom, statistic, p_value) in
            [(1, 3.841_459, 0.05), (10, 18.307_04, 0.05), (100, 135.806_7, 0.01), (30, 13.786_72, 0.995)]
        {
            let found = upper_gamma(f64::from(freedom) / 2.0, statistic / 2.0);
            assert!((found - p_value).abs() < 1e-6, "{freedom} degrees of freedom: {found}, not {p_value}");
        }
    }

    #[test]
    fn rare_cells_are_pooled() {
        let test = chi_square(&[100, 2, 3, 95], &[98.0, 2.5, 2.5, 97.0]);
        assert_eq!(test.freedom, 2);
        assert!(test.p_value > 0.9);
    }

    #[test]
    fn wrong_expectations_are_found() {
        assert!(chi_square(&[600, 400], &[500.0, 500.0]).p_value < 1e-8);
    }

    #[test]
    fn estimates_carry_the_error_of_the_mean() {
        let estimate = Estimate::of(&[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(estimate.mean, 2.5);
        assert!((estimate.error - (5.0f64 / 12.0).sqrt()).abs() < 1e-12);
        assert_eq!(estimate.z(&Estimate::exact(2.5), 0.0), 0.0);
    }

    #[test]
    fn blocks_at_the_edges_are_smaller() {
        let pixels = Pixels {
            width: 3,
            height: 1,
            rgb: vec![[1.0; 3], [3.0; 3], [7.0; 3]],
            errors: vec![[3.0; 3], [4.0; 3], [1.0; 3]],
        };
        let blocks = pixels.block_estimates(2);
        assert_eq!(blocks[0], Estimate { mean: 2.0, error: 2.5 });
        assert_eq!(blocks[3], Estimate { mean: 7.0, error: 1.0 });
        assert_eq!(blocks.len(), 6);
    }

    #[test]
    fn shrinking_keeps_whole_squares() {
        let pixels = Pixels {
            width: 3,
            height: 2,
            rgb: (0..6u8).map(|i| [f32::from(i); 3]).collect(),
            errors: vec![[1.0; 3]; 6],
        };
        let small = pixels.shrunk(2);
        assert_eq!((small.width, small.height), (1, 1));
        assert_eq!((small.rgb[0], small.errors[0]), ([2.0; 3], [0.5; 3]));
    }

    #[test]
    fn comparisons_look_at_blocks_and_at_the_mean() {
        let expected = Pixels::exact(2, 1, vec![[1.0; 3]; 2]);
        let shifted = |left: f32, right: f32| Pixels {
            rgb: vec![[left; 3], [right; 3]],
            errors: vec![[0.01; 3]; 2],
            ..expected.clone()
        };
        assert!(Comparison::of(&shifted(1.01, 0.98), &expected, 1, 0.0).agrees());
        let uneven = Comparison::of(&shifted(1.1, 0.9), &expected, 1, 0.0);
        assert!(uneven.mean.abs() < 1e-3 && !uneven.agrees());
        let brighter = Comparison::of(&shifted(1.035, 1.035), &expected, 1, 0.0);
        assert!(brighter.blocks.agrees() && !brighter.agrees());
        assert!((brighter.noise - 0.01 / (1.035 * 2.0f64.sqrt())).abs() < 1e-6);
    }

    #[test]
    fn a_score_that_is_no_number_does_not_agree() {
        assert!(!spread(&[0.0, f64::NAN]).agrees());
        assert!(spread(&[0.5, -3.0]).agrees());
    }
}
