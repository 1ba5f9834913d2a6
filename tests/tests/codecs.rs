//! Every codec keeps what it declares: random values there and back on the device.

use kernelgen::source::FileKind;
use runtime::configs::Library;
use serde::Deserialize;
use std::collections::BTreeMap;
use tests::probe::library;
use tests::rendering::{Job, Rendering, shipped};

/// Values that each codec is tried with: a pixel each.
const SIDE: u32 = 256;

/// A table of `stages/codecs.toml`.
#[derive(Clone, Debug, Deserialize)]
struct Codec {
    quantity: Vec<String>,
    error: BTreeMap<String, f64>,
    range: [f64; 2],
}

fn codecs() -> BTreeMap<String, Codec> {
    toml::from_str(stages::CODECS).expect("the codecs are TOML")
}

/// A stage that splats x: the error of the value of its pixel, by the codec's measure; y: 1 if the value is coded again to the same
/// bits, 0.25 if not; z: 1 plus the signed error of the mean component, for the mean over all values.
fn probe(name: &str, codec: &Codec) -> Library {
    let value = match codec.quantity[0].as_str() {
        "unit_vector" => "sample_sphere(random.xy)",
        "spectrum" => "magnitude(random.w) * (0.5 + 0.5 * random.xyz)",
        "uv" => "random.xy",
        _ => "magnitude(random.w)",
    };
    // A component may be half of the magnitude.
    let [least, greatest] = [codec.range[0].max(1e-30).log2() + 1.0, codec.range[1].log2()];
    let measure = codec.error.keys().next().expect("a codec declares an error");
    let (error, shift) = match measure.as_str() {
        "angle" => ("atan2(length(cross(value, kept)), dot(value, kept))", "0.0"),
        "of_largest" => (
            "max_component(abs(kept - value)) / max_component(value)",
            "dot(kept - value, vec3r(1.0)) / max_component(value)",
        ),
        "absolute" => ("max(abs(kept - value).x, abs(kept - value).y)", "(kept - value).x"),
        _ if codec.quantity[0] == "spectrum" => ("max_component(abs(kept - value) / value)", "0.0"),
        _ => ("abs(kept - value) / value", "0.0"),
    };
    // Two points of the square stand for a vector on the fold, which come back with different roundings.
    let same = if measure == "angle" { "all(abs(again - kept) < vec3r(3e-7))" } else { "all(again == kept)" };
    let stage = format!(
        "import package::real::{{real, vec2r, vec3r}};
import package::outcome::DONE;
import package::film::splat;
import package::pass::path_pixel;
import package::random::{{DIMENSION_EMIT, WALK_EYE, random4}};
import package::sample::sphere::sample_sphere;
import package::math::vector::max_component;
import package::codec::{name}::{{decode_{name}, encode_{name}}};

fn magnitude(random: real) -> real {{
    return exp2(mix({least:?}, {greatest:?}, random));
}}

fn there_and_back() -> u32 {{
    let random = random4(WALK_EYE, path_pixel(), DIMENSION_EMIT);
    let value = {value};
    let kept = decode_{name}(encode_{name}(value));
    let again = decode_{name}(encode_{name}(kept));
    splat(path_pixel(), vec3r({error}, select(0.25, 1.0, {same}), 1.0 + {shift}));
    return DONE;
}}
"
    );
    library(&[("stage/probe_codec", &stage)], "there_and_back")
}

fn tabulate(library: Library) -> Rendering {
    let job = Job::of_file(shipped("cornell_box")).library(library).pipeline("probe");
    let table = job.size(SIDE, SIDE).samples(1).render();
    assert_eq!(table.rejected, 0, "an error that is no number");
    table
}

/// The greatest error is below the declared one, which is not a hundred times too large; unbiased codecs have a mean error of zero.
#[test]
fn every_codec_keeps_what_it_declares() {
    for (name, codec) in codecs() {
        let table = tabulate(probe(&name, &codec));
        let (measure, &declared) = codec.error.iter().next().expect("a codec declares an error");
        let worst = table.pixels.rgb.iter().map(|pixel| f64::from(pixel[0])).fold(0.0, f64::max);
        eprintln!("{name}: {measure} {worst:.3e} of {declared:.3e}");
        assert!(worst <= declared, "{name}: {measure} {worst} is more than the declared {declared}");
        assert!(worst > 0.5 * declared, "{name}: {declared} declares far more than {measure} {worst}");
        let count = table.pixels.rgb.len() as f64;
        let mean = table.pixels.rgb.iter().map(|pixel| f64::from(pixel[2]) - 1.0).sum::<f64>() / count;
        // Three components with at most the declared error each.
        assert!(mean.abs() < 4.0 * 3.0 * declared / count.sqrt(), "{name}: rounds by {mean} on average");
    }
}

/// What was kept once is kept for good by every codec: a field that is loaded and stored again does not drift.
#[test]
fn what_was_kept_stays_as_it_is() {
    for (name, codec) in codecs() {
        let table = tabulate(probe(&name, &codec));
        let moved = table.pixels.rgb.iter().filter(|pixel| pixel[1] < 1.0).count();
        assert!(moved == 0, "{name}: {moved} values change when they are kept again");
    }
}

/// Zero stays zero, axes stay axes, and what is no number stays none: 1 in a pixel for each that does.
#[test]
fn corners_are_kept() {
    let stage = "import package::real::{real, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::path_pixel;
import package::codec::oct32::{decode_oct32, encode_oct32};
import package::codec::oct24::{decode_oct24, encode_oct24};
import package::codec::rgbe::{decode_rgbe, encode_rgbe};
import package::codec::rgb9e5::{decode_rgb9e5, encode_rgb9e5};
import package::codec::rgb13e9::{decode_rgb13e9, encode_rgb13e9};
import package::codec::f16x3::{decode_f16x3, encode_f16x3};
import package::codec::f16::{decode_f16, encode_f16};
import package::codec::log16::{decode_log16, encode_log16};
import package::codec::finite::{all_finite, is_finite};

fn axis(index: u32) -> vec3r {
    var axis = vec3r(0.0);
    axis[index % 3u] = select(-1.0, 1.0, index < 3u);
    return axis;
}

fn no_number() -> real {
    return bitcast<f32>(0x7fc00000u | path_pixel());
}

fn kept(index: u32) -> bool {
    let zero = vec3r(0.0);
    let none = vec3r(1.0, no_number(), 2.0);
    switch index {
        case 0u, 1u, 2u, 3u, 4u, 5u: {
            return all(decode_oct32(encode_oct32(axis(index))) == axis(index))
                && all(decode_oct24(encode_oct24(axis(index))) == axis(index));
        }
        case 6u: { return all(decode_rgbe(encode_rgbe(zero)) == zero); }
        case 7u: { return all(decode_rgb9e5(encode_rgb9e5(zero)) == zero); }
        case 8u: { return all(decode_rgb13e9(encode_rgb13e9(zero)) == zero); }
        case 9u: { return all(decode_f16x3(encode_f16x3(zero)) == zero); }
        case 10u: { return decode_f16(encode_f16(0.0)) == 0.0; }
        case 11u: { return decode_log16(encode_log16(0.0)) == 0.0; }
        case 12u: { return !all_finite(decode_rgbe(encode_rgbe(none))); }
        case 13u: { return !all_finite(decode_rgb9e5(encode_rgb9e5(none))); }
        case 14u: { return !all_finite(decode_rgb13e9(encode_rgb13e9(none))); }
        case 15u: { return !all_finite(decode_f16x3(encode_f16x3(none))); }
        case 16u: { return !is_finite(decode_f16(encode_f16(no_number()))); }
        case 17u: { return !is_finite(decode_log16(encode_log16(no_number()))); }
        case 18u: { return decode_log16(encode_log16(1.0)) == 1.0; }
        case 19u: { return decode_log16(encode_log16(1e30)) > 9e18 && decode_log16(encode_log16(1e-30)) < 1.2e-19; }
        case 20u: { return all(decode_rgb9e5(encode_rgb9e5(vec3r(1e9))) > vec3r(65000.0)); }
        default: { return all(decode_rgbe(encode_rgbe(vec3r(1.0, 0.5, 0.0))) == vec3r(1.0, 0.5, 0.0)); }
    }
}

fn corners() -> u32 {
    splat(path_pixel(), vec3r(select(0.0, 1.0, kept(path_pixel()))));
    return DONE;
}
";
    let library = library(&[("stage/probe_codec", stage)], "corners");
    assert!(library.sources.find(FileKind::Module, "codec/oct32").is_some());
    let job = Job::of_file(shipped("cornell_box")).library(library).pipeline("probe");
    let table = job.size(22, 1).samples(1).render();
    let lost: Vec<usize> = (0..22).filter(|&index| table.pixels.rgb[index][0] != 1.0).collect();
    assert!(lost.is_empty(), "cases {lost:?} are not kept");
}
