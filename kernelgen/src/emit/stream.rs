//! `package::streams`: what happens to a record that a stage pushes.

use super::room;
use super::text::{COMPONENTS, Imports, stream_constant};
use super::wiring::{WiredStream, Wiring};
use crate::config::model::{Pipeline, RayKind};
use crate::config::quantity::LeafType;
use crate::layout::StateLeaf;
use std::fmt::Write;

/// The WGSL name of a batched stream's buffer.
pub(super) fn buffer_name(stream: &str) -> String {
    format!("{stream}_stream")
}

/// Words of a stored record: those of the leaves that the consumer reads.
pub(super) fn record_words(stream: &WiredStream) -> u32 {
    stream.leaves.iter().map(|leaf| leaf.ty.words()).sum()
}

/// The module for analysis: pushes that go nowhere.
pub(super) fn analysis_module(pipeline: &Pipeline) -> String {
    let mut imports = Imports::default();
    let mut body = String::new();
    for (name, stream) in &pipeline.streams {
        imports.add("state", [stream.record.value.as_str()]);
        push_nowhere(&mut body, name, &stream.record.value);
    }
    format!("{imports}{body}")
}

/// The WGSL function that says how many records a batched stream has room for.
pub(super) fn room_function(stream: &str) -> String {
    format!("{stream}_room")
}

/// The WGSL function that says whether an invocation has pushed to a batched stream what has no place yet.
pub(super) fn has_function(stream: &str) -> String {
    format!("{stream}_arrives")
}

/// The WGSL function that stores what a workgroup has pushed to a batched stream, where workgroups gather their records.
pub(super) fn gather_function(stream: &str) -> String {
    format!("gather_{stream}")
}

/// The module for kernels: batched streams append to their buffer, which has room for `records` (see `room::records`), one by one or
/// where workgroups gather them with one atomic a workgroup; the others call their consumer.
pub(super) fn module(pipeline: &Pipeline, wiring: &Wiring, records: u32, gathers: bool) -> String {
    let mut imports = Imports::default();
    let mut body = String::new();
    for (name, declared) in &pipeline.streams {
        let record = declared.record.value.as_str();
        imports.add("state", [record]);
        match wiring.streams.get(name) {
            Some(stream) if stream.batched => {
                push_room(&mut imports, &mut body, name, records);
                push_batched(&mut imports, &mut body, name, record, stream, gathers);
            }
            Some(stream) => push_inline(&mut imports, &mut body, name, record, stream),
            None => push_nowhere(&mut body, name, record),
        }
    }
    format!("{imports}{body}")
}

/// A push that is analysed, or that no live code calls.
fn push_nowhere(body: &mut String, name: &str, record: &str) {
    let _ = write!(body, "\nfn push_{name}(record: {record}) {{\n}}\n");
}

fn push_inline(imports: &mut Imports, body: &mut String, name: &str, record: &str, stream: &WiredStream) {
    let consumer = stream.entry.name.as_str();
    imports.add(&stream.entry.module, [consumer]);
    let count = match stream.rays {
        None => "",
        Some(RayKind::Walk) => {
            imports.add("control", ["count_ray", "walk_rays_word"]);
            "    count_ray(walk_rays_word());\n"
        }
        Some(RayKind::Visibility) => {
            imports.add("control", ["count_ray", "CONTROL_RAYS_VISIBILITY"]);
            "    count_ray(CONTROL_RAYS_VISIBILITY);\n"
        }
    };
    let _ = write!(
        body,
        "\n/// Resolves a record on the spot.\n\
         fn push_{name}(record: {record}) {{\n{count}    \
             var {name} = record;\n    \
             {consumer}(&{name});\n\
         }}\n"
    );
}

fn push_room(imports: &mut Imports, body: &mut String, name: &str, records: u32) {
    imports.add("pass", ["path_count"]);
    let _ = write!(
        body,
        "\n/// Records that the stream `{name}` has room for; it is emptied before more can come.\n\
         fn {}() -> u32 {{\n    return {};\n}}\n",
        room_function(name),
        room::text(records)
    );
}

fn push_batched(
    imports: &mut Imports,
    body: &mut String,
    name: &str,
    record: &str,
    stream: &WiredStream,
    gathers: bool,
) {
    let buffer = buffer_name(name);
    imports.add("control", ["control", "CONTROL_OVERFLOW"]);
    imports.add("queue", ["append", stream_constant(name).as_str()]);
    imports.add("real", ["real", "vec2r", "vec3r"]);
    let _ = write!(
        body,
        "\n/// Records that wait for `{}`, a plane a word.\n\
         var<storage, read_write> {buffer}: array<u32>;\n",
        stream.entry.name,
    );
    if gathers {
        push_gathered(imports, body, name, record, stream);
    } else {
        push_at_once(body, name, record);
    }
    push_store(body, name, record, stream);
    push_load(body, name, record, stream);
}

/// A place a record.
fn push_at_once(body: &mut String, name: &str, record: &str) {
    let constant = stream_constant(name);
    let _ = write!(
        body,
        "\n/// Keeps a record until the stream is emptied.\n\
         fn push_{name}(record: {record}) {{\n    \
             store_{name}(append({constant}), record);\n\
         }}\n"
    );
}

/// A place for the records of a workgroup, taken at the end of the kernel: until then an invocation keeps its last record.
fn push_gathered(imports: &mut Imports, body: &mut String, name: &str, record: &str, stream: &WiredStream) {
    let constant = stream_constant(name);
    let (has, gather) = (has_function(name), gather_function(name));
    imports.add("queue", ["place_of"]);
    let mut earlier = String::new();
    if stream.pushes.values().any(|most| *most > 1) {
        earlier = format!(
            "    if has_{name} {{\n        \
                 store_{name}(append({constant}), last_{name});\n    \
             }}\n"
        );
    }
    let _ = write!(
        body,
        "\n/// The last record of this invocation.\n\
         var<private> last_{name}: {record};\n\
         /// Whether there is one.\n\
         var<private> has_{name}: bool;\n\n\
         /// Keeps a record until the stream is emptied.\n\
         fn push_{name}(record: {record}) {{\n\
         {earlier}    \
             last_{name} = record;\n    \
             has_{name} = true;\n\
         }}\n\n\
         /// Whether this invocation has a record without a place.\n\
         fn {has}() -> bool {{\n    \
             return has_{name};\n\
         }}\n\n\
         /// Stores the last record of this invocation in the place that was taken for it.\n\
         fn {gather}(rank: u32, lane: u32) {{\n    \
             if has_{name} {{\n        \
                 store_{name}(place_of({constant}, rank, lane), last_{name});\n    \
             }}\n\
         }}\n"
    );
}

fn push_store(body: &mut String, name: &str, record: &str, stream: &WiredStream) {
    let buffer = buffer_name(name);
    let room = room_function(name);
    let _ = write!(
        body,
        "\n/// Puts a record into its place.\n\
         fn store_{name}(index: u32, record: {record}) {{\n    \
             let room = {room}();\n    \
             if index >= room {{\n        \
                 atomicAdd(&control[CONTROL_OVERFLOW], 1u);\n        \
                 return;\n    \
             }}\n"
    );
    for (value, plane) in stream.leaves.iter().flat_map(word_values).zip(0..) {
        let _ = writeln!(body, "    {buffer}[{}] = {value};", plane_address(plane));
    }
    body.push_str("}\n");
}

fn push_load(body: &mut String, name: &str, record: &str, stream: &WiredStream) {
    let buffer = buffer_name(name);
    let room = room_function(name);
    let _ = write!(
        body,
        "\n/// Takes a record out.\n\
         fn load_{name}(index: u32) -> {record} {{\n    \
             let room = {room}();\n    \
             var record: {record};\n"
    );
    let mut plane = 0;
    for leaf in &stream.leaves {
        let words = leaf.ty.words();
        let values: Vec<String> =
            (plane..plane + words).map(|plane| format!("{buffer}[{}]", plane_address(plane))).collect();
        plane += words;
        let _ = writeln!(body, "    {} = {};", path_of(leaf), value_of(leaf.ty, &values));
    }
    body.push_str("    return record;\n}\n");
}

fn plane_address(plane: u32) -> String {
    match plane {
        0 => "index".to_owned(),
        1 => "room + index".to_owned(),
        _ => format!("{plane}u * room + index"),
    }
}

fn path_of(leaf: &StateLeaf) -> String {
    match &leaf.leaf.member {
        Some(member) => format!("record.{}.{member}", leaf.leaf.field),
        None => format!("record.{}", leaf.leaf.field),
    }
}

/// A leaf as words.
fn word_values(leaf: &StateLeaf) -> Vec<String> {
    let path = path_of(leaf);
    match leaf.ty {
        LeafType::U32 => vec![path],
        LeafType::Real => vec![format!("bitcast<u32>({path})")],
        LeafType::Vec2 | LeafType::Vec3 => COMPONENTS[..leaf.ty.words() as usize]
            .iter()
            .map(|component| format!("bitcast<u32>({path}.{component})"))
            .collect(),
    }
}

/// A leaf from words.
fn value_of(ty: LeafType, words: &[String]) -> String {
    let joined = words.join(", ");
    match ty {
        LeafType::U32 => joined,
        LeafType::Real => format!("bitcast<real>({joined})"),
        LeafType::Vec2 => format!("bitcast<vec2r>(vec2u({joined}))"),
        LeafType::Vec3 => format!("bitcast<vec3r>(vec3u({joined}))"),
    }
}
