//! Generated modules that follow from the configs alone: numbers, records, outcomes, features, parameters, the pass.

use crate::config::model::{Effects, Param, ParamValue, Pipeline, Real, Record};
use crate::config::quantity::Quantity;
use crate::diagnostic::Diagnostic;
use crate::link::{Constant, Constants};
use crate::source::Span;
use indexmap::{IndexMap, IndexSet};
use std::fmt::Write;

/// `package::real`: what the stages compute in.
pub(super) fn real(real: Real) -> String {
    let name = match real {
        Real::F32 => "f32",
    };
    format!(
        "/// The arithmetic of every stage.\n\
         alias real = {name};\n\
         alias vec2r = vec2<real>;\n\
         alias vec3r = vec3<real>;\n\
         alias vec4r = vec4<real>;\n"
    )
}

/// `package::state`: a struct a record, and the bits of their flags.
///
/// # Errors
/// K0213 two records give different bits to a flag of one name.
pub(super) fn state(pipeline: &Pipeline) -> Result<String, Vec<Diagnostic>> {
    let mut text = String::from(
        "import package::real::{real, vec2r, vec3r};\n\n\
         /// A ray hit.\n\
         struct Hit {\n    \
             /// Primitive.\n    \
             prim: u32,\n    \
             /// Distance along the ray, m.\n    \
             t: real,\n    \
             /// Barycentric coordinates.\n    \
             uv: vec2r,\n\
         }\n",
    );
    for (name, record) in &pipeline.records {
        push_record(&mut text, name, record);
    }
    for (name, (value, _)) in flags(pipeline)? {
        let _ = write!(text, "\nconst {name}: u32 = {value}u;\n");
    }
    Ok(text)
}

fn push_record(text: &mut String, name: &str, record: &Record) {
    if record.fields.is_empty() {
        return;
    }
    let _ = write!(text, "\nstruct {name} {{\n");
    for (field, declared) in &record.fields {
        let _ = writeln!(text, "    /// {}", describe(&declared.quantity));
        let _ = writeln!(text, "    {field}: {},", declared.quantity.wgsl());
    }
    text.push_str("}\n");
}

fn describe(quantity: &Quantity) -> String {
    match quantity {
        Quantity::Position => "Position, m.".to_owned(),
        Quantity::UnitVector => "Unit vector.".to_owned(),
        Quantity::Spectrum => "Spectrum, linear sRGB, >= 0.".to_owned(),
        Quantity::Pdf => "Density, 1/sr or 1/m^2.".to_owned(),
        Quantity::MisPartial => "Partial sum of MIS ratios.".to_owned(),
        Quantity::Length => "Length, m.".to_owned(),
        Quantity::Weight => "Weight.".to_owned(),
        Quantity::Uv => "Surface coordinates.".to_owned(),
        Quantity::Hit => "Ray hit.".to_owned(),
        Quantity::Index => "Index.".to_owned(),
        Quantity::Counter { bits } => format!("Counter of {bits} bits."),
        Quantity::Flags { names } => format!("Flags: {}.", names.join(", ")),
    }
}

/// Constants of all flags: `FLAGS_SPECULAR` to its value and where it was first declared.
fn flags(pipeline: &Pipeline) -> Result<IndexMap<String, (u32, Span)>, Vec<Diagnostic>> {
    let mut constants: IndexMap<String, (u32, Span)> = IndexMap::new();
    let mut findings = Vec::new();
    for record in pipeline.records.values() {
        for (field, declared) in &record.fields {
            let Quantity::Flags { names } = &declared.quantity else { continue };
            for (bit, flag) in names.iter().enumerate().take(32) {
                let name = format!("{field}_{flag}").to_uppercase();
                let value = 1 << bit;
                match constants.get(&name) {
                    Some((other, first)) if *other != value => {
                        let message = format!("`{name}` would stand for two different bits");
                        findings.push(
                            Diagnostic::error("K0213", message)
                                .at(declared.span, format!("bit {bit} here"))
                                .also(*first, format!("bit {} here", other.trailing_zeros()))
                                .help("list the flags in the same order in both records"),
                        );
                    }
                    _ => {
                        constants.insert(name, (value, declared.span));
                    }
                }
            }
        }
    }
    if findings.is_empty() { Ok(constants) } else { Err(findings) }
}

/// Outcome names (lower case) in order of their values; the first is `end`, 0.
///
/// `imported` are names that stages import from `package::outcome`: they get a value too, so that one that no stage routes is
/// reported as such and not as a missing name.
pub(super) fn outcome_names(pipeline: &Pipeline, imported: &[String]) -> IndexSet<String> {
    let mut names = IndexSet::from(["end".to_owned()]);
    for stage in pipeline.stages.values() {
        names.extend(stage.on.keys().cloned());
    }
    names.extend(imported.iter().map(|name| name.to_lowercase()));
    names
}

/// `package::outcome`: what a stage may return.
pub(super) fn outcome(names: &IndexSet<String>) -> String {
    let mut text = String::from("/// What a stage may return; the pipeline says where it leads.\n");
    for (value, name) in names.iter().enumerate() {
        let _ = writeln!(text, "const {}: u32 = {value}u;", name.to_uppercase());
    }
    text
}

/// `package::features`: the effects of the scene.
pub(super) fn features(effects: &Effects) -> String {
    let mut text = String::new();
    for (name, effect) in effects {
        if !effect.reason.is_empty() {
            let _ = writeln!(text, "/// {}", effect.reason.replace('\n', " "));
        }
        let _ = writeln!(text, "const HAS_{}: bool = {};", name.to_uppercase(), effect.present);
    }
    text
}

/// `package::params`: the parameters of the pipeline.
pub(super) fn params(params: &IndexMap<String, Param>) -> String {
    let mut text = String::from("import package::real::real;\n\n");
    for (name, param) in params {
        if !param.doc.is_empty() {
            let _ = writeln!(text, "/// {}", param.doc.replace('\n', " "));
        }
        for (name, constant) in constants_of(name, param) {
            let _ = match constant {
                Constant::Bool(value) => writeln!(text, "const {name}: bool = {value};"),
                Constant::U32(value) => writeln!(text, "const {name}: u32 = {value}u;"),
                Constant::Real(value) => writeln!(text, "const {name}: real = {value:?};"),
            };
        }
    }
    text
}

/// The constants that a parameter declares: itself, and the words of a choice.
fn constants_of(name: &str, param: &Param) -> Vec<(String, Constant)> {
    let own = |value| vec![(name.to_owned(), value)];
    match &param.value {
        ParamValue::U32(value) => own(Constant::U32(*value)),
        ParamValue::Real(value) => own(Constant::Real(*value)),
        ParamValue::Bool(value) => own(Constant::Bool(*value)),
        ParamValue::Choice { of, index } => {
            let mut constants = own(Constant::U32(*index));
            let words = of.iter().zip(0..);
            constants.extend(words.map(|(word, value)| (format!("{name}_{word}"), Constant::U32(value))));
            constants
        }
    }
}

/// What the linker knows when it cuts text.
pub(super) fn constants(pipeline: &Pipeline, effects: &Effects) -> Constants {
    let mut known = Constants::new();
    for (name, effect) in effects {
        let name = format!("HAS_{}", name.to_uppercase());
        known.insert(("features".to_owned(), name), Constant::Bool(effect.present));
    }
    for (name, param) in &pipeline.params {
        for (name, constant) in constants_of(name, param) {
            known.insert(("params".to_owned(), name), constant);
        }
    }
    known
}

/// `package::pass`: which path this is, its pixel and its sample. Where slots take several paths, or paths change their
/// slots, these are `numbered`: they know the numbers of their paths.
pub(super) fn pass(numbered: bool) -> String {
    format!("{PASS}{}", if numbered { TAKEN_NUMBER } else { OWN_NUMBER })
}

const OWN_NUMBER: &str = r"
/// Number of the path in the order of pixels, samples one after the other.
fn path_number() -> u32 {
    return pass_info.first_pixel + path_id;
}
";

const TAKEN_NUMBER: &str = r"
/// Which path of the pass a slot has.
var<storage, read_write> path_numbers: array<u32>;

/// Number of the path in the order of pixels, samples one after the other.
fn path_number() -> u32 {
    return pass_info.first_pixel + path_numbers[path_id];
}
";

const PASS: &str = r"/// What the host says about a pass.
struct Pass {
    /// Place of slot 0 in the order of pixels.
    first_pixel: u32,
    /// Number of the sample that slot 0 takes.
    first_sample: u32,
    /// Path slots in use.
    slots: u32,
    /// Seed of all random numbers.
    seed: u32,
    /// Paths of the pass.
    paths: u32,
    unused_0: u32,
    unused_1: u32,
    unused_2: u32,
}

var<uniform> pass_info: Pass;

/// Path slots that the buffers have room for.
override path_count: u32;

/// Pixels in a row.
override picture_width: u32;

/// Rows.
override picture_height: u32;

/// The path slot of this invocation.
var<private> path_id: u32;

/// In a loop whose paths stand side by side, where that of this invocation stands in the tables of the loop.
var<private> walk_place: u32;

/// Index of the path's pixel, y * width + x. Neighbours in the order of paths are neighbours in a tile of 8 x 8 pixels.
fn path_pixel() -> u32 {
    let width = picture_width;
    let height = picture_height;
    let number = path_number() % (width * height);
    let top = number / (8u * width) * 8u;
    let rows = min(8u, height - top);
    let in_band = number - top * width;
    let whole_tiles = width / 8u;
    var x: u32;
    var y: u32;
    if in_band < whole_tiles * 8u * rows {
        let in_tile = in_band % (8u * rows);
        x = in_band / (8u * rows) * 8u + in_tile % 8u;
        y = top + in_tile / 8u;
    } else {
        let in_tile = in_band - whole_tiles * 8u * rows;
        let columns = max(width % 8u, 1u);
        x = whole_tiles * 8u + in_tile % columns;
        y = top + in_tile / columns;
    }
    return y * width + x;
}

/// Number of the path's sample, counted from the first of the whole rendering.
fn path_sample() -> u32 {
    return pass_info.first_sample + path_number() / (picture_width * picture_height);
}

/// Seed of all random numbers.
fn pass_seed() -> u32 {
    return pass_info.seed;
}
";
