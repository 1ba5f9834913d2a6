//! The scattering functions, asked one by one on the device: sampling against density, energy, reciprocity, Fresnel's equations.

use glam::{DVec3, dvec3};
use std::fmt::Write;
use std::sync::LazyLock;
use tests::material::Material;
use tests::probe::{ONE, broken, library};
use tests::rendering::{BuiltScene, Job, Rendering};
use tests::scene_builder::{Camera, SceneBuilder};
use tests::statistics::{ChiSquare, chi_square};

const PROBES: &str = include_str!("../wgsl/probe_bsdf.wgsl");
const FRESNEL: &str = include_str!("../wgsl/probe_fresnel.wgsl");
/// Bins along the polar angle and the azimuth, as in the probes.
const GRID: [usize; 2] = [32, 16];
const BINS: usize = GRID[0] * GRID[1];
/// One sample for each cell of a bin.
const SAMPLES: u32 = 1024;

/// Where the grid of bins has its pole.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lobe {
    Reflected,
    Transmitted,
}

/// A material seen from a direction.
#[derive(Clone, Debug)]
struct Case {
    material: Material,
    /// On the front of the surface: 1, on its back: -1.
    side: f64,
    cosine: f64,
    lobe: Lobe,
    /// How far the shading normal leans, as a tangent.
    tilt: f64,
}

impl Case {
    fn of(material: Material, cosine: f64) -> Case {
        Case { material, side: 1.0, cosine, lobe: Lobe::Reflected, tilt: 0.0 }
    }

    fn alpha(&self) -> f64 {
        self.material.roughness.powi(2)
    }

    /// Index of the far side over that of the near side.
    fn eta(&self) -> f64 {
        match self.material.solid {
            true => self.material.ior.powf(self.side),
            false => 1.0,
        }
    }

    /// The pole: mirrored or refracted direction in the frame of the shading normal.
    fn axis(&self) -> DVec3 {
        let sine = (1.0 - self.cosine.powi(2)).sqrt();
        match self.lobe {
            Lobe::Reflected => dvec3(-sine, 0.0, self.cosine),
            Lobe::Transmitted => {
                let refracted = (sine / self.eta()).min(1.0);
                dvec3(-refracted, 0.0, -(1.0 - refracted.powi(2)).sqrt().max(1e-3)).normalize()
            }
        }
    }

    /// How strongly bins crowd at the pole.
    fn exponent(&self) -> f64 {
        if self.alpha() < 0.05 { 4.0 } else { 2.0 }
    }

    fn wgsl(&self) -> String {
        let axis = self.axis();
        let Material { base_color: [r, g, b], metallic, roughness, ior, transmission, specular, solid, .. } =
            &self.material;
        format!(
            "BsdfCase(probed_material(vec3r({r:?}, {g:?}, {b:?}), {metallic:?}, {roughness:?}, {ior:?}, {transmission:?}, \
             {specular:?}, {solid}), {:?}, {:?}, {:?}, {:?}, vec3r({:?}, {:?}, {:?}))",
            self.side,
            self.cosine,
            self.tilt,
            self.exponent(),
            axis.x,
            axis.y,
            axis.z
        )
    }
}

const CASES_HEAD: &str = "//! The cases of a test.

import package::real::{real, vec3r};
import package::surface::material::Material;

/// A material seen from a direction.
struct BsdfCase {
    material: Material,
    /// 1 on the front, -1 on the back.
    side: real,
    cosine: real,
    tilt: real,
    exponent: real,
    /// Pole of the bins, in the frame of the shading normal on the outgoing side.
    axis: vec3r,
}

fn probed_material(color: vec3r, metallic: real, roughness: real, ior: real, transmission: real, specular: real, solid: bool) -> Material {
    var material: Material;
    material.base_color = color;
    material.metallic = metallic;
    material.roughness = roughness;
    material.ior = ior;
    material.transmission = transmission;
    material.specular_color = vec3r(1.0);
    material.specular = specular;
    material.solid = solid;
    return material;
}

fn bsdf_case(index: u32) -> BsdfCase {
    switch index {
";

fn cases_module(cases: &[Case]) -> String {
    let mut text = CASES_HEAD.to_owned();
    for (index, case) in cases.iter().enumerate().skip(1) {
        writeln!(text, "        case {index}u: {{ return {}; }}", case.wgsl()).expect("strings can be written to");
    }
    writeln!(text, "        default: {{ return {}; }}\n    }}\n}}", cases[0].wgsl())
        .expect("strings can be written to");
    text
}

fn gold(roughness: f64) -> Material {
    Material::metal("gold", [1.0, 0.8, 0.3], roughness)
}

fn thin(roughness: f64) -> Material {
    Material { solid: false, ..Material::glass("thin", 1.5, roughness) }
}

/// Every kind of lobe, alone and mixed, from narrow to broad, from both sides.
fn all_cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let lambert = Material::lambert("lambert", [0.5, 0.8, 0.2]);
    for cosine in [0.7, 0.05] {
        cases.push(Case::of(lambert.clone(), cosine));
        for roughness in [0.1, 0.5, 1.0] {
            cases.push(Case::of(Material::glossy("plastic", [0.5, 0.8, 0.2], roughness), cosine));
        }
    }
    for roughness in [0.1, 0.3, 0.7, 1.0] {
        for cosine in [0.95, 0.3, 0.05] {
            cases.push(Case::of(gold(roughness), cosine));
        }
    }
    for roughness in [0.1, 0.4, 0.8] {
        for (side, cosine) in [(1.0, 0.9), (1.0, 0.2), (-1.0, 0.9), (-1.0, 0.4)] {
            cases.extend(both_lobes(&Case { side, ..Case::of(Material::glass("glass", 1.5, roughness), cosine) }));
        }
    }
    for (roughness, cosine) in [(0.1, 0.8), (0.6, 0.8), (0.6, 0.15)] {
        cases.extend(both_lobes(&Case::of(thin(roughness), cosine)));
    }
    let mixed = Material { transmission: 0.5, metallic: 0.3, ..Material::glass("mixed", 1.33, 0.5) };
    let mixed = Material { base_color: [0.5, 0.8, 0.2], ..mixed };
    for side in [1.0, -1.0] {
        cases.extend(both_lobes(&Case { side, ..Case::of(mixed.clone(), 0.6) }));
        cases.extend(both_lobes(&Case { side, tilt: 0.3, ..Case::of(mixed.clone(), 0.6) }));
    }
    cases
}

fn both_lobes(case: &Case) -> [Case; 2] {
    [Lobe::Reflected, Lobe::Transmitted].map(|lobe| Case { lobe, ..case.clone() })
}

/// A scene whose materials call for the effects of the cases.
fn scene_of(materials: impl Iterator<Item = Material>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    for (place, material) in materials.enumerate() {
        let material = scene.material(material);
        scene.quad(material, DVec3::X * 2.0 * place as f64, DVec3::X, DVec3::Y);
    }
    scene.camera("main", Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, yfov: 40.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
}

/// A smooth-shaded sphere among them makes normals that differ from the geometry's part of the kernels.
static EVERYTHING: LazyLock<BuiltScene> = LazyLock::new(|| {
    let mut scene = SceneBuilder::new();
    let materials = [
        Material::lambert("lambert", [0.5; 3]),
        Material::glossy("plastic", [0.5; 3], 0.5),
        gold(0.3),
        gold(0.0),
        Material::glass("glass", 1.5, 0.3),
        Material::glass("clear", 1.5, 0.0),
        thin(0.3),
        thin(0.0),
    ];
    for (place, material) in materials.into_iter().enumerate() {
        let material = scene.material(material);
        scene.mesh(material, tests::shape::sphere(DVec3::X * 3.0 * place as f64, 1.0, 8));
    }
    scene.camera("main", Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, yfov: 40.0, aspect: 1.0 });
    BuiltScene::new(&scene, None)
});

fn job(scene: &BuiltScene, cases: &[Case], entry: &str) -> Job {
    let text = cases_module(cases);
    let modules = [("stage/probe_bsdf", PROBES), ("probe/bsdf_cases", text.as_str())];
    let job = scene.job().library(library(&modules, entry)).pipeline("probe").fixed_point();
    job.size(GRID[0] as u32, (GRID[1] * cases.len()) as u32).samples(SAMPLES)
}

/// A bin: its sums of the three channels, in ones.
type Bin = [f64; 3];

/// Sums of every case.
#[track_caller]
fn tables(rendering: &Rendering) -> Vec<Vec<Bin>> {
    assert_eq!(rendering.rejected, 0, "a probe gave a value that is no number");
    let bins: Vec<Bin> = rendering
        .sums
        .chunks_exact(3)
        .map(|sums| std::array::from_fn(|channel| sums[channel] as f64 / ONE as f64))
        .collect();
    bins.chunks_exact(BINS).map(<[Bin]>::to_vec).collect()
}

/// What was drawn and what was integrated, for every case.
struct Findings {
    counted: Vec<Vec<Bin>>,
    integrated: Vec<Vec<Bin>>,
}

fn findings(scene: &BuiltScene, cases: &[Case]) -> Findings {
    Findings {
        counted: tables(&job(scene, cases, "count_samples").render()),
        integrated: tables(&job(scene, cases, "integrate_density").render()),
    }
}

/// Directions drawn for a case.
fn drawn() -> f64 {
    BINS as f64 * f64::from(SAMPLES)
}

fn total(bins: &[Bin], channel: usize) -> f64 {
    bins.iter().map(|bin| bin[channel]).sum()
}

/// The bins' counts against their densities; what is drawn elsewhere is one more cell.
fn histogram_test(counted: &[Bin], integrated: &[Bin]) -> ChiSquare {
    let mut observed: Vec<u64> = counted.iter().map(|bin| bin[0].round() as u64).collect();
    let mut expected: Vec<f64> = integrated.iter().map(|bin| bin[0] * drawn() / f64::from(SAMPLES)).collect();
    observed.push(drawn() as u64 - observed.iter().sum::<u64>());
    expected.push((drawn() - expected.iter().sum::<f64>()).max(1e-3));
    chi_square(&observed, &expected)
}

static ALL: LazyLock<(Vec<Case>, Findings)> = LazyLock::new(|| {
    let cases = all_cases();
    let found = findings(&EVERYTHING, &cases);
    (cases, found)
});

#[test]
fn samples_follow_the_density() {
    let (cases, found) = &*ALL;
    let mut failed = String::new();
    for (i, case) in cases.iter().enumerate() {
        let test = histogram_test(&found.counted[i], &found.integrated[i]);
        if test.p_value < 1e-4 {
            writeln!(failed, "{case:?}: {test:?}").expect("strings can be written to");
        }
    }
    assert!(failed.is_empty(), "{failed}");
}

#[test]
fn a_bare_diffuse_surface_follows_its_density() {
    let scene = scene_of([Material::lambert("lambert", [0.5; 3])].into_iter());
    let cases = [0.9, 0.1].map(|cosine| Case::of(Material::lambert("lambert", [0.5; 3]), cosine));
    let found = findings(&scene, &cases);
    for i in 0..cases.len() {
        let test = histogram_test(&found.counted[i], &found.integrated[i]);
        assert!(test.p_value > 1e-4, "{test:?}");
        assert!((total(&found.integrated[i], 1) / f64::from(SAMPLES) - 0.5).abs() < 1e-3);
    }
}

#[test]
fn a_wrong_density_is_found() {
    let scene = &*EVERYTHING;
    let cases = [Case::of(gold(0.7), 0.3)];
    let text = cases_module(&cases);
    let modules = [("stage/probe_bsdf", PROBES), ("probe/bsdf_cases", text.as_str())];
    let mut wrong = library(&modules, "integrate_density");
    // Three percent too much.
    broken(
        &mut wrong,
        "bsdf/ggx",
        "return 0.25 * smith_masking_over_cosine",
        "return 0.2575 * smith_masking_over_cosine",
    );
    let counted = tables(&job(scene, &cases, "count_samples").render());
    let integrated = tables(&job(scene, &cases, "integrate_density").library(wrong).render());
    let test = histogram_test(&counted[0], &integrated[0]);
    assert!(test.p_value < 1e-8, "a wrong density passed: {test:?}");
}

#[test]
fn densities_and_albedos_stay_below_one() {
    let (cases, found) = &*ALL;
    let mut failed = String::new();
    let mut i = 0;
    while i < cases.len() {
        // The two lobes of a transmitting material share what there is.
        let lobes = if cases.get(i + 1).is_some_and(|next| next.lobe == Lobe::Transmitted) { 2 } else { 1 };
        let sum = |tables: &[Vec<Bin>], channel: usize, count: f64| {
            tables[i..i + lobes].iter().map(|bins| total(bins, channel)).sum::<f64>() / count
        };
        let density = sum(&found.integrated, 0, f64::from(SAMPLES));
        let drawn_share = sum(&found.counted, 0, drawn());
        let reflected = total(&found.integrated[i], 1) / f64::from(SAMPLES);
        let importance = sum(&found.integrated, 2, f64::from(SAMPLES));
        if density > 1.002 || drawn_share > 1.003 {
            writeln!(failed, "density {density}: {:?}", cases[i]).expect("strings can be written to");
        }
        // Radiance through a boundary grows with the squared index; the power, which importance tells, does not.
        let power = if cases[i].tilt == 0.0 { importance } else { reflected };
        if power > 1.002 {
            writeln!(failed, "albedo {power}: {:?}", cases[i]).expect("strings can be written to");
        }
        i += lobes;
    }
    assert!(failed.is_empty(), "{failed}");
}

#[test]
fn weights_average_to_the_albedo() {
    let (cases, found) = &*ALL;
    let mut failed = String::new();
    for (i, case) in cases.iter().enumerate() {
        for channel in [1, 2] {
            let sampled = total(&found.counted[i], channel) / drawn();
            let integrated = total(&found.integrated[i], channel) / f64::from(SAMPLES);
            // Five standard errors of weights up to four, and the rounding of the integral.
            let allowed = 5.0 * (4.0 * integrated / drawn()).sqrt() + 1e-3 * integrated;
            if (sampled - integrated).abs() > allowed {
                writeln!(failed, "channel {channel}: {sampled}, integral {integrated}: {case:?}")
                    .expect("strings can be written to");
            }
        }
    }
    assert!(failed.is_empty(), "{failed}");
}

#[test]
fn scattering_is_reciprocal() {
    let cases: Vec<Case> = all_cases().into_iter().filter(|case| case.lobe == Lobe::Reflected).collect();
    let tables = tables(&job(&EVERYTHING, &cases, "compare_turned").samples(256).render());
    let mut failed = String::new();
    for (case, bins) in cases.iter().zip(&tables) {
        for (row, what) in ["reflection", "transmission", "importance", "reverse density"].into_iter().enumerate() {
            let decades: Vec<f64> = bins[row * GRID[0]..][..9].iter().map(|bin| bin[0]).collect();
            let count: f64 = decades.iter().sum();
            let transmits = case.material.transmission > 0.0;
            if count < 1000.0 && (row != 1 || transmits) {
                writeln!(failed, "{what}: only {count} pairs: {case:?}").expect("strings can be written to");
            }
            // Refraction finds its half vector from either side with another rounding, which a narrow lobe magnifies.
            let worst = decades.iter().rposition(|&count| count > 0.0).unwrap_or(0) as i32 - 7;
            let allowed = if row == 0 { -5 } else { -3 };
            if worst > allowed {
                writeln!(failed, "{what}: up to 1e{worst}, {decades:?}: {case:?}").expect("strings can be written to");
            }
        }
    }
    assert!(failed.is_empty(), "{failed}");
}

/// Fresnel's equations for unpolarised light.
fn fresnel(cosine: f64, eta: f64) -> f64 {
    let sine_squared = (1.0 - cosine * cosine) / (eta * eta);
    if sine_squared >= 1.0 {
        return 1.0;
    }
    let transmitted = (1.0 - sine_squared).sqrt();
    let perpendicular = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    let parallel = (eta * cosine - transmitted) / (eta * cosine + transmitted);
    0.5 * (perpendicular.powi(2) + parallel.powi(2))
}

#[test]
fn smooth_glass_reflects_and_refracts() {
    let seen = [(1.0, 0.9), (1.0, 0.2), (-1.0, 0.9), (-1.0, 0.76), (-1.0, 0.5)];
    let mut cases: Vec<Case> = Vec::new();
    for (material, sides) in [(Material::glass("clear", 1.5, 0.0), &seen[..]), (thin(0.0), &seen[..2])] {
        cases.extend(sides.iter().map(|&(side, cosine)| Case {
            side,
            lobe: Lobe::Transmitted,
            ..Case::of(material.clone(), cosine)
        }));
    }
    let tables = tables(&job(&EVERYTHING, &cases, "count_deltas").samples(256).render());
    for (case, bins) in cases.iter().zip(&tables) {
        let drawn = BINS as f64 * 256.0;
        let once = fresnel(case.cosine, if case.material.solid { case.eta() } else { case.material.ior });
        let reflectance = if case.material.solid { once } else { 2.0 * once / (1.0 + once) };
        let [refracted, reflected, neither] = [bins[0], bins[1], bins[2]];
        let error = (reflectance * (1.0 - reflectance) / drawn).sqrt();
        assert_eq!(neither[0], 0.0, "{case:?}: directions that are neither reflected nor refracted");
        assert!((reflected[0] / drawn - reflectance).abs() <= 5.0 * error, "{case:?}: {reflected:?}");
        // The lobe is drawn by its reflectance: weights are 1, and 1/eta^2 for radiance that is refracted.
        for (found, expected) in [
            (reflected[1], reflected[0]),
            (reflected[2], reflected[0]),
            (refracted[1], refracted[0] / case.eta().powi(2)),
            (refracted[2], refracted[0]),
        ] {
            assert!((found - expected).abs() <= 1e-5 * expected, "{case:?}: {found}, expected {expected}");
        }
    }
}

#[test]
fn reflectances_are_those_of_the_textbook() {
    let scene = scene_of([Material::glass("glass", 1.5, 0.0), thin(0.0), gold(0.5)].into_iter());
    let library = library(&[("stage/probe_fresnel", FRESNEL)], "tabulate_fresnel");
    let rendering = scene.job().library(library).pipeline("probe").fixed_point().size(16, 64).samples(256).render();
    let value = |entry: usize| {
        let column = rendering.sums.chunks_exact(3).skip(entry).step_by(16);
        column.map(|sums| sums[0] as f64).sum::<f64>() / (ONE as f64 * 64.0 * 256.0)
    };
    let brewster = 0.5 * ((1.0 - 2.25f64) / (1.0 + 2.25)).powi(2);
    let known = [
        (0, 0.04, "normal incidence"),
        (1, 0.04, "normal incidence from inside"),
        (2, 0.091_778_0, "diffuse light from outside, 1.5"),
        (3, 0.596_345_8, "diffuse light from inside, 1.5"),
        (4, 0.065_930_8, "diffuse light from outside, 1.33"),
        (5, 0.471_949_1, "diffuse light from inside, 1.33"),
        (6, 1.0, "beyond the critical angle"),
        (8, 1.0, "grazing"),
        (9, 0.08 / 1.04, "a thin sheet"),
        (10, 0.04, "Schlick at normal incidence"),
        (11, 1.0, "Schlick grazing"),
        (12, 0.04 + 0.96 / 21.0, "Schlick in diffuse light"),
        (13, brewster, "Brewster's angle"),
    ];
    for (entry, expected, what) in known {
        assert!((value(entry) - expected).abs() < 2e-6, "{what}: {}, expected {expected}", value(entry));
    }
    assert!(value(7) < 0.98, "below the critical angle: {}", value(7));
}
