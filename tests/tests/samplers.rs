//! The samplers: how their numbers are spread over samples, uses and pixels, and that no picture depends on which is taken.

use glam::{DVec3, dvec3};
use runtime::configs::Library;
use std::f64::consts::TAU;
use tests::material::Material;
use tests::probe::{ONE, broken, library};
use tests::rendering::{BuiltScene, Job, Rendering, shipped};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::statistics::{chi_square, spread, z_scores};

const PROBE: &str = include_str!("../wgsl/probe_samplers.wgsl");
const SOBOL: &str = "sequence/sobol";
const SAMPLERS: [&str; 3] = ["independent", "sobol", "blue_noise"];
/// Of the probe: samples of a use are 2^LEVELS.
const LEVELS: u32 = 8;
const SAMPLES: usize = 1 << LEVELS;
const PIXELS: usize = 2;
const USES: usize = 16;
/// Bits of a number.
const BITS: u32 = 24;

/// The samples of a use in a pixel, as multiples of 2^-24.
type Points = Vec<[u32; 4]>;

fn probe(library: Library, sampler: &str) -> Job {
    let job = Job::of_file(shipped("cornell_box")).library(library).pipeline("probe");
    job.set("sampler", sampler).fixed_point()
}

/// The points of every use in two pixels, pixel by pixel.
fn tabulate(sampler: &str) -> Vec<Points> {
    tabulate_with(tabulating(), sampler)
}

fn tabulating() -> Library {
    library(&[("stage/probe_samplers", PROBE)], "tabulate")
}

fn tabulate_with(library: Library, sampler: &str) -> Vec<Points> {
    let rows = 2 * PIXELS * USES;
    let job = probe(library, sampler).size(SAMPLES as u32, rows as u32);
    let rendering = job.samples(SAMPLES as u32).render();
    assert_eq!(rendering.rejected, 0, "{sampler}");
    assert!(rendering.sums.iter().all(|sum| (0..ONE).contains(sum)), "{sampler}: a number is not in [0, 1)");
    let rows: Vec<&[i64]> = rendering.sums.chunks_exact(3 * SAMPLES).collect();
    rows.chunks_exact(2).map(|rows| points(rows[0], rows[1])).collect()
}

fn points(xyz: &[i64], w: &[i64]) -> Points {
    let cells = xyz.chunks_exact(3).zip(w.chunks_exact(3));
    cells.map(|(xyz, w)| [xyz[0], xyz[1], xyz[2], w[0]].map(|units| units as u32)).collect()
}

/// How many of the points are in each of 2^a x 2^b equal parts of the square of two dimensions.
fn counts(points: &Points, dimensions: [usize; 2], splits: [u32; 2]) -> Vec<u64> {
    let mut counts = vec![0; 1 << (splits[0] + splits[1])];
    for point in points {
        let part = |axis: usize| u64::from(point[dimensions[axis]]) >> (BITS - splits[axis]);
        counts[(part(0) << splits[1] | part(1)) as usize] += 1;
    }
    counts
}

/// Whether every part of an area 2^(t - levels), however it is shaped, has 2^t of the first 2^levels points.
fn is_net(points: &Points, dimensions: [usize; 2], levels: u32, t: u32) -> bool {
    let first = points[..1 << levels].to_vec();
    let splits = levels - t;
    (0..=splits).all(|a| counts(&first, dimensions, [a, splits - a]).iter().all(|&count| count == 1 << t))
}

/// The quality of two dimensions of Sobol's sequence is the sum of the degrees of their polynomials less one: 0, 0, 1, 2.
#[test]
fn sobol_points_of_every_use_are_nets() {
    const QUALITY: [u32; 4] = [0, 0, 1, 2];
    for (place, points) in tabulate("sobol").iter().enumerate() {
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let t = QUALITY[a] + QUALITY[b];
            for levels in t..=LEVELS {
                assert!(is_net(points, [a, b], levels, t), "use {place}, dimensions {a} and {b}, 2^{levels} points");
            }
        }
        // One dimension alone: one point in each of 2^m intervals, for every m.
        for dimension in 0..4 {
            for levels in 0..=LEVELS {
                let counts = counts(&points[..1 << levels].to_vec(), [dimension, 0], [levels, 0]);
                assert!(
                    counts.iter().all(|&count| count == 1),
                    "use {place}, dimension {dimension}, 2^{levels} points"
                );
            }
        }
    }
}

#[test]
fn numbers_of_every_sampler_are_uniform() {
    const PARTS: u32 = 4;
    for sampler in SAMPLERS {
        let table = tabulate(sampler);
        for dimension in 0..4 {
            let mut observed = [0u64; 1 << PARTS];
            for points in &table {
                let counts = counts(points, [dimension, 0], [PARTS, 0]);
                observed.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            }
            let expected = [(table.len() * SAMPLES) as f64 / f64::from(1 << PARTS); 1 << PARTS];
            let test = chi_square(&observed, &expected);
            assert!(test.p_value > 1e-4, "{sampler}, dimension {dimension}: {test:?}");
        }
    }
}

/// No use knows of another, whether on the same walk or on the other.
#[test]
fn uses_are_not_correlated() {
    for sampler in ["sobol", "blue_noise"] {
        let table = tabulate(sampler);
        // Blue noise leaves the eye walks of two pixels in one order; those of one pixel are compared.
        let same_pixel = |a: usize, b: usize| a / USES == b / USES;
        let (largest, mean) = correlations(&table, |a, b| sampler == "sobol" || same_pixel(a, b));
        assert!(largest < LARGEST && mean < MEAN, "{sampler}: {largest}, {mean}");
        let (largest, mean) = correlations(&table, |a, b| (a ^ b) & 1 == 1);
        assert!(largest < LARGEST && mean < MEAN, "{sampler}, eye and light: {largest}, {mean}");
    }
    let mut library = tabulating();
    broken(&mut library, SOBOL, "owen_scramble(index, shuffle_seed)", "index");
    let (largest, mean) = correlations(&tabulate_with(library, "sobol"), |a, b| (a ^ b) & 1 == 1);
    assert!(largest > LARGEST && mean > MEAN, "not noticed without shuffling: {largest}, {mean}");
}

/// Bounds on `correlations`. A nested shuffle moves neighbours in the order together, so that squares are on average 1.6 times those of
/// independent numbers, also for shuffles without a flaw.
const LARGEST: f64 = 6.5;
const MEAN: f64 = 1.9;

/// Correlations of the dimensions of two uses over the samples, for pairs of uses that `among` takes: the largest as a multiple of that
/// of independent numbers, and the mean of their squares, which is 1 for these.
fn correlations(table: &[Points], among: impl Fn(usize, usize) -> bool) -> (f64, f64) {
    let mut scores = Vec::new();
    for (a, first) in table.iter().enumerate() {
        for (b, second) in table.iter().enumerate().skip(a + 1).filter(|(b, _)| among(a, *b)) {
            assert_ne!(first, second, "uses {a} and {b} draw the same numbers");
            for dimensions in 0..16 {
                scores.push(correlation(first, second, [dimensions / 4, dimensions % 4]) * (SAMPLES as f64).sqrt());
            }
        }
    }
    let spread = spread(&scores);
    (spread.largest, spread.root_mean_square.powi(2))
}

fn correlation(a: &Points, b: &Points, dimensions: [usize; 2]) -> f64 {
    let centred = |points: &Points, dimension: usize| -> Vec<f64> {
        let mean = points.iter().map(|point| f64::from(point[dimension])).sum::<f64>() / points.len() as f64;
        points.iter().map(|point| f64::from(point[dimension]) - mean).collect()
    };
    let (a, b) = (centred(a, dimensions[0]), centred(b, dimensions[1]));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt()
}

#[test]
fn every_sampler_gives_the_same_mean_picture() {
    for (pipeline, samples) in [("pt", 128), ("lt", 256)] {
        let job = Job::of_file(shipped("cornell_box")).pipeline(pipeline).size(32, 32).edges(4).samples(samples);
        let renders = SAMPLERS.map(|sampler| job.clone().set("sampler", sampler).render());
        for (render, sampler) in renders.iter().zip(SAMPLERS) {
            assert_eq!(render.rejected, 0);
            let scores = z_scores(&render.pixels.block_estimates(4), &renders[0].pixels.block_estimates(4), 1e-4);
            assert!(spread(&scores).agrees(), "{pipeline}, {sampler}: {:?}", spread(&scores));
            let z = render.pixels.mean_estimate().z(&renders[0].pixels.mean_estimate(), 0.0);
            assert!(z.abs() < 4.0, "{pipeline}, {sampler}: {z}");
        }
    }
}

/// A diffuse floor before a wall, under a panel that is out of the picture: no edge of a light is seen, which would outweigh all else.
fn lit_floor() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let grey = scene.material(Material::lambert("grey", [0.7; 3]));
    let light = scene.material(Material::emitter("light", [3.0; 3]));
    scene.floor(grey, 0.0, 4.0);
    scene.quad(grey, dvec3(-2.0, 0.0, -0.5), DVec3::X * 4.0, DVec3::Y * 0.9);
    scene.ceiling(light, 1.0, 1.6);
    scene.camera("main", Camera { eye: dvec3(0.0, 0.8, 3.0), target: DVec3::ZERO, yfov: 20.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

fn root_mean_square_error(render: &Rendering, reference: &Rendering) -> f64 {
    let squares: f64 = errors(render, reference).iter().map(|error| error * error).sum();
    (squares / render.pixels.rgb.len() as f64).sqrt()
}

/// The error of each pixel, all channels added up.
fn errors(render: &Rendering, reference: &Rendering) -> Vec<f64> {
    let sum = |pixel: &[f32; 3]| pixel.iter().map(|&channel| f64::from(channel)).sum::<f64>();
    render.pixels.rgb.iter().zip(&reference.pixels.rgb).map(|(found, wanted)| sum(found) - sum(wanted)).collect()
}

/// The bound is one that points do not keep that are the same in every pixel and use.
#[test]
fn sobol_errs_less_than_independent_numbers() {
    const BOUND: f64 = 0.6;
    let scene = lit_floor();
    let diffuse = || scene.job().pipeline("pt").size(32, 32).edges(3);
    let reference = diffuse().set("sampler", "sobol").seed(2).samples(2048).render();
    let error = |job: Job| root_mean_square_error(&job.samples(64).render(), &reference);
    let independent = error(diffuse());
    let sobol = |library| error(diffuse().library(library).set("sampler", "sobol")) / independent;
    let found = sobol(Library::default());
    assert!(found < BOUND, "{found} of the error of independent numbers");
    let mut library = Library::default();
    broken(&mut library, SOBOL, "return reverseBits(bits);", "return value;");
    let unscrambled = sobol(library);
    assert!(unscrambled > BOUND, "{unscrambled} of the error of independent numbers is not noticed");
}

/// Lowest frequencies of a square image of `side` pixels: mean energy for whole waves up to an eighth of the side on either axis.
fn low_frequencies(values: &[f64], side: usize) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let most = side as i32 / 8;
    let mut energies = Vec::new();
    for (v, u) in (-most..=most).flat_map(|v| (0..=most).map(move |u| (v, u))).filter(|&wave| wave != (0, 0)) {
        let (mut real, mut imaginary) = (0.0, 0.0);
        for (i, value) in values.iter().enumerate() {
            let (x, y) = ((i % side) as f64, (i / side) as f64);
            let (sine, cosine) = (TAU * (f64::from(u) * x + f64::from(v) * y) / side as f64).sin_cos();
            real += (value - mean) * cosine;
            imaginary += (value - mean) * sine;
        }
        energies.push((real * real + imaginary * imaginary) / values.len() as f64);
    }
    energies.iter().sum::<f64>() / energies.len() as f64
}

/// The numbers themselves: white noise has its variance, 1/12, at every frequency.
#[test]
fn numbers_of_a_use_are_blue_noise_over_the_pixels() {
    let side = 64;
    let library = library(&[("stage/probe_samplers", PROBE)], "scatter_numbers");
    for (sampler, range) in [("independent", 0.7..1.4), ("sobol", 0.7..1.4), ("blue_noise", 0.0..0.25)] {
        let rendering = probe(library.clone(), sampler).size(side, side).samples(1).render();
        for channel in 0..3 {
            let values: Vec<f64> =
                rendering.sums.chunks_exact(3).map(|sums| sums[channel] as f64 / ONE as f64).collect();
            let energy = low_frequencies(&values, side as usize) * 12.0;
            assert!(range.contains(&energy), "{sampler}, dimension {channel}: {energy} of white noise");
        }
    }
}

/// The error of a picture, of direct light: what is left at low frequencies is what the eye sees.
#[test]
fn blue_noise_leaves_less_error_at_low_frequencies() {
    let scene = lit_floor();
    let job = scene.job().pipeline("nee").size(64, 64).edges(2);
    let reference = job.clone().set("sampler", "sobol").seed(2).samples(1024).render();
    let energy = |sampler| {
        let render = job.clone().set("sampler", sampler).samples(1).render();
        low_frequencies(&errors(&render, &reference), 64)
    };
    let (independent, blue_noise) = (energy("independent"), energy("blue_noise"));
    assert!(blue_noise < 0.65 * independent, "{blue_noise} against {independent}");
}
