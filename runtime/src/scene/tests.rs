//! Files made for one purpose: what must be understood, and what must be refused with a message that helps.

use super::*;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Little-endian floats as a data URI.
fn uri(bytes: &[u8]) -> String {
    let escaped: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    format!("data:application/octet-stream,{escaped}")
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// One triangle in the plane z = 0 with a material, as a document to be changed.
fn triangle() -> Value {
    with_buffer(&floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]))
}

fn with_buffer(bytes: &[u8]) -> Value {
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bytes.len(), "uri": uri(bytes) }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "materials": [{ "name": "grey", "pbrMetallicRoughness": { "metallicFactor": 0.0 } }],
        "meshes": [{ "name": "one", "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "nodes": [{ "mesh": 0 }],
        "scenes": [{ "nodes": [0] }]
    })
}

/// Loads bytes as a file of their own.
fn load_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let name = format!("pathloom-test-{}-{}.gltf", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, bytes).expect("the temporary folder is writable");
    let result = load(&path, options);
    std::fs::remove_file(&path).expect("the file was written above");
    result
}

fn load_json(document: &Value) -> Result<Scene> {
    load_bytes(document.to_string().as_bytes(), &LoadOptions::default())
}

/// The message that a document is refused with.
fn refusal(document: &Value) -> String {
    let error = load_json(document).err().expect("the document must be refused");
    assert_eq!(error.exit_code(), 2);
    error.to_string()
}

#[track_caller]
fn assert_refused(change: impl FnOnce(&mut Value), words: &[&str]) {
    let mut document = triangle();
    change(&mut document);
    let message = refusal(&document);
    words.iter().for_each(|word| assert!(message.contains(word), "`{word}` is not in: {message}"));
}

fn corners(document: &Value) -> [[f32; 3]; 3] {
    load_json(document)
        .map(|scene| scene.triangles[0].positions.map(|p| p.to_array()))
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_triangle_without_indices_loads() {
    let scene = load_json(&triangle()).unwrap();
    assert_eq!((scene.triangle_count(), scene.size()), (1, (512, 384)));
    assert!(scene.warnings.iter().any(|warning| warning.contains("no light")));
    let present = |name: &str| scene.effects[name].present;
    assert!(present("diffuse") && present("rough_specular"));
    assert!(!present("metal") && !present("shading_normals") && !present("area_light") && !present("lens"));
    assert_eq!(scene.effects.len(), 30);
}

#[test]
fn quantized_interleaved_positions_are_decoded() {
    let words: Vec<i16> = vec![0, 0, 0, 99, 32767, 0, 0, 99, 0, -32768, 0, 99];
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut document = with_buffer(&bytes);
    document["bufferViews"][0]["byteStride"] = json!(8);
    document["accessors"][0]["componentType"] = json!(5122);
    document["accessors"][0]["normalized"] = json!(true);
    document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert_eq!(corners(&document), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
    document["accessors"][0]["normalized"] = json!(false);
    assert_eq!(corners(&document)[2], [0.0, -32768.0, 0.0]);
}

#[test]
fn sparse_elements_replace_those_of_the_buffer_or_zeros() {
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 3.0, 0.0, 0.0]);
    bytes.extend([2, 1]);
    let mut document = with_buffer(&bytes);
    document["bufferViews"] = json!([
        { "buffer": 0, "byteLength": 36 },
        { "buffer": 0, "byteOffset": 36, "byteLength": 24 },
        { "buffer": 0, "byteOffset": 60, "byteLength": 2 }
    ]);
    let sparse = |count: u32| json!({ "count": count, "indices": { "bufferView": 2, "componentType": 5121 }, "values": { "bufferView": 1 } });
    document["accessors"][0]["sparse"] = sparse(1);
    assert_eq!(corners(&document), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    document["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    document["accessors"][0]["sparse"] = sparse(2);
    assert_eq!(corners(&document), [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
}

#[test]
fn effects_follow_the_materials() {
    let mut document = triangle();
    document["materials"][0] = json!({
        "name": "pane",
        "doubleSided": true,
        "emissiveFactor": [1.0, 0.5, 0.0],
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.0 },
        "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1.0 }, "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 } }
    });
    let scene = load_json(&document).unwrap();
    for (name, present) in [
        ("area_light", true),
        ("two_sided_emission", true),
        ("diffuse", false),
        ("thin_glass", true),
        ("solid_glass", false),
        ("delta", true),
        ("delta_transmission", true),
        ("rough_transmission", false),
        ("rough_specular", false),
    ] {
        assert_eq!(scene.effects[name].present, present, "{name}: {}", scene.effects[name].reason);
    }
    assert!(scene.effects["thin_glass"].reason.contains("material \"pane\""));
    assert_eq!(scene.materials[0].emission, [8.0, 4.0, 0.0]);
}

#[test]
fn lambert_calls_for_nothing_specular() {
    let mut document = triangle();
    document["materials"][0]["extensions"] = json!({ "KHR_materials_specular": { "specularFactor": 0.0 } });
    let scene = load_json(&document).unwrap();
    assert!(["specular", "rough_specular", "delta_specular", "delta"].iter().all(|name| !scene.effects[*name].present));
}

#[test]
fn empty_documents_have_every_resource() {
    let scene = load_json(&json!({ "asset": { "version": "2.0" } })).unwrap();
    assert_eq!(scene.triangle_count(), 0);
    RESOURCES.iter().for_each(|name| {
        assert!(*name == "bvh2_nodes" || scene.resource(name).is_some_and(|bytes| bytes.len() >= 16), "{name}")
    });
}

#[test]
fn far_scenes_are_moved_together_with_their_camera_and_lights() {
    let mut document = triangle();
    document["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    document["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    document["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    document["nodes"] = json!([
        { "translation": [1e5, 0.0, 0.0], "children": [1, 2, 3] },
        { "mesh": 0 },
        { "camera": 0, "translation": [0.0, 0.0, 5.0] },
        { "translation": [0.0, 2.0, 0.0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }
    ]);
    let scene = load_json(&document).unwrap();
    assert_eq!(scene.triangles[0].positions[1].to_array(), [0.5, -0.5, 0.0]);
    let word = |name: &str, at: usize| {
        f32::from_le_bytes(scene.resource(name).unwrap()[at * 4..at * 4 + 4].try_into().unwrap())
    };
    assert_eq!([0, 1, 2].map(|i| word("scene", i)), [-0.5, -0.5, 5.0]);
    assert_eq!([4, 5, 6].map(|i| word("lights", i)), [-0.5, 1.5, 0.0]);
}

#[test]
fn wrong_geometry_is_refused_by_name() {
    let indexed = |indices: &[u8]| {
        let mut bytes = floats(&[0.0; 9]);
        bytes.extend(indices);
        let mut document = with_buffer(&bytes);
        document["bufferViews"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "buffer": 0, "byteOffset": 36, "byteLength": indices.len() }));
        document["accessors"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR" }));
        document["meshes"][0]["primitives"][0]["indices"] = json!(1);
        document
    };
    let message = refusal(&indexed(&[0, 1, 7]));
    assert!(message.contains("mesh 0 `one`, primitive 0, indices, accessor 1: index 2 is 7"), "{message}");
    let message = refusal(&indexed(&[0, 1]));
    assert!(message.contains("exceed buffer view 1 of 2 bytes"), "{message}");
    let message = refusal(&with_buffer(&floats(&[0.0, f32::NAN, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])));
    assert!(message.contains("primitive 0, POSITION, accessor 0: vertex 0 is [0.0, NaN, 0.0]"), "{message}");
    assert_refused(|d| d["accessors"][0]["count"] = json!(4), &["accessor 0", "exceed buffer view 0"]);
    assert_refused(|d| d["accessors"][0]["count"] = json!(u64::MAX), &["accessor 0", "count"]);
    assert_refused(
        |d| d["bufferViews"][0]["byteLength"] = json!(100),
        &["buffer view 0", "exceed buffer 0 of 36 bytes"],
    );
    assert_refused(|d| d["buffers"][0]["byteLength"] = json!(37), &["buffer 0", "only 36 bytes"]);
    assert_refused(|d| d["accessors"][0]["type"] = json!("VEC2"), &["POSITION", "accessor 0", "Vec2"]);
    assert_refused(|d| d["meshes"][0]["primitives"][0]["attributes"] = json!({}), &["mesh 0", "POSITION"]);
    assert_refused(|d| d["nodes"][0]["scale"] = json!([1e38, 1.0, 1.0]), &["beyond the range"]);
}

#[test]
fn wrong_references_are_refused_by_name() {
    assert_refused(
        |d| d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
        &["extensionsRequired", "KHR_draco_mesh_compression", "help"],
    );
    assert_refused(|d| d["buffers"][0]["uri"] = json!("not%20there.bin"), &["buffer 0", "not there.bin"]);
    assert_refused(|d| d["nodes"][0]["mesh"] = json!(9), &["nodes[0].mesh"]);
    assert_refused(|d| d["nodes"][0]["children"] = json!([0]), &["node 0", "descendant"]);
    assert_refused(|d| d["asset"]["version"] = json!("1.0"), &["asset", "1.0"]);
    assert_refused(
        |d| d["materials"][0]["extensions"] = json!({ "KHR_materials_ior": { "ior": 0.5 } }),
        &["material \"grey\"", "ior is 0.5"],
    );
    let textured = |d: &mut Value, uri: &str| {
        d["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
        d["textures"] = json!([{ "source": 0 }]);
        d["images"] = json!([{ "uri": uri }]);
    };
    assert_refused(|d| textured(d, "missing.png"), &["image 0", "missing.png"]);
    assert_refused(|d| textured(d, "data:image/png,abc"), &["image 0", "unknown image format", "PNG or JPEG"]);
    assert_refused(|d| textured(d, "data:image/png,%89PNG%0d%0a%1a%0a"), &["image 0", "cannot decode"]);
    let camera =
        json!([{ "type": "orthographic", "orthographic": { "xmag": 1.0, "ymag": 1.0, "zfar": 9.0, "znear": 0.1 } }]);
    assert_refused(
        |d| {
            d["cameras"] = camera;
            d["nodes"][0]["camera"] = json!(0);
            d["nodes"][0]["name"] = json!("plan");
        },
        &["camera `plan`", "orthographic"],
    );
}

#[test]
fn other_files_are_refused() {
    let message = |bytes: &[u8]| {
        load_bytes(bytes, &LoadOptions::default()).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(message(b"PK\x03\x04").contains("not a glTF file"));
    assert!(message(b"").contains("empty"));
    assert!(message(b"{").contains("JSON"));
    assert!(message(b"glTF\x02\0\0\0\xff\0\0\0").contains("truncated GLB"));
    assert!(message(b"glTF\x01\0\0\0\x14\0\0\0").contains("version 1"));
    assert!(load(Path::new("no/such/file.glb"), &LoadOptions::default()).is_err());
}

/// A changed byte may spoil a file in any way; it must never stop the program.
#[test]
fn damaged_files_never_panic() {
    let mut document = triangle();
    document["extensionsUsed"] = json!(["KHR_lights_punctual", "EXT_mesh_gpu_instancing"]);
    document["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": { "outerConeAngle": 0.5 } }] } });
    document["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    document["nodes"] = json!([
        { "mesh": 0, "children": [1], "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0 } } } },
        { "camera": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } }
    ]);
    document["accessors"][0]["sparse"] = json!({ "count": 1, "indices": { "bufferView": 0, "byteOffset": 0, "componentType": 5121 }, "values": { "bufferView": 0 } });
    let text = document.to_string().into_bytes();
    assert!(load_bytes(&text, &LoadOptions::default()).is_ok());
    let mut state = 1u32;
    let mut next = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % below
    };
    for _ in 0..2000 {
        let mut damaged = text.clone();
        let place = next(damaged.len());
        let digits = b"0123456789-\"{}[],x";
        damaged[place] = digits[next(digits.len())];
        drop(load_bytes(&damaged, &LoadOptions::default()));
    }
}
