//! A small glTF scene with one of everything that the loader reads, to be damaged by tests.

use serde_json::{Value, json};

/// 0: three positions, 36: three texture coordinates, 60: three indices, 66: one sparse index, 68: one replaced position.
pub fn buffer() -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]));
    bytes.extend([0u16, 1, 2, 1].iter().flat_map(|index| index.to_le_bytes()));
    bytes.extend(floats(&[1.0, 0.5, 0.0]));
    bytes
}

/// A textured triangle with indices and a sparse accessor, a point light and a camera; its buffer is `scene.bin`, its texture `red.png`.
pub fn document() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "name": "thing", "mesh": 0, "children": [3] },
            { "name": "eye", "camera": 0, "translation": [0.0, 0.0, 3.0] },
            { "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "inner" },
        ],
        "meshes": [{ "name": "flag", "primitives": [
            { "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 },
        ] }],
        "materials": [{ "name": "paint", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": "red.png" }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 5.0 }] } },
        "extensionsUsed": ["KHR_lights_punctual"],
        "buffers": [{ "byteLength": 80, "uri": "scene.bin" }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 24 },
            { "buffer": 0, "byteOffset": 60, "byteLength": 6 },
            { "buffer": 0, "byteOffset": 66, "byteLength": 2 },
            { "buffer": 0, "byteOffset": 68, "byteLength": 12 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
              "sparse": { "count": 1, "indices": { "bufferView": 3, "componentType": 5123 }, "values": { "bufferView": 4 } } },
            { "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR" },
        ],
    })
}

/// The same with more materials, lights and nodes, and with buffer and texture (a PNG) for the binary chunk of a `.glb`.
pub fn packed(png: &[u8]) -> (Value, Vec<u8>) {
    let mut bytes = buffer();
    let mut document = document();
    if let Some(views) = document["bufferViews"].as_array_mut() {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": png.len() }));
    }
    bytes.extend(png);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    document["buffers"] = json!([{ "byteLength": bytes.len() }]);
    document["images"] = json!([{ "bufferView": 5, "mimeType": "image/png" }]);
    document["samplers"] = json!([{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33648 }]);
    document["textures"] = json!([{ "source": 0, "sampler": 0 }, { "source": 0 }]);
    document["materials"] = json!([
        {
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "extensions": {
                "KHR_texture_transform": { "offset": [0.1, 0.2], "rotation": 0.3, "scale": [2.0, 3.0] } } } },
            "normalTexture": { "index": 1, "scale": 0.5 },
            "emissiveFactor": [1.0, 0.5, 0.2], "emissiveTexture": { "index": 0 },
            "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": true,
        },
        {
            "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.7, 0.6, 0.5], "metallicFactor": 0.0, "roughnessFactor": 0.3 },
            "alphaMode": "BLEND",
            "extensions": {
                "KHR_materials_emissive_strength": { "emissiveStrength": 2.0 },
                "KHR_materials_ior": { "ior": 1.33 },
                "KHR_materials_specular": { "specularFactor": 0.5, "specularColorTexture": { "index": 1 } },
                "KHR_materials_transmission": { "transmissionFactor": 0.9, "transmissionTexture": { "index": 0 } },
                "KHR_materials_volume": { "thicknessFactor": 1.0, "attenuationDistance": 0.5, "attenuationColor": [0.9, 0.8, 0.1] },
            },
        },
    ]);
    document["meshes"] = json!([
        { "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] },
        { "primitives": [
            { "attributes": { "POSITION": 0, "NORMAL": 0, "TEXCOORD_0": 1, "COLOR_0": 0 }, "material": 1, "mode": 5 },
            { "attributes": { "POSITION": 0 }, "mode": 6 },
        ] },
    ]);
    let spot = json!({ "type": "spot", "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } });
    document["extensions"]["KHR_lights_punctual"]["lights"] =
        json!([{ "type": "point" }, spot, { "type": "directional", "color": [1.0, 0.9, 0.8] }]);
    document["nodes"] = json!([
        { "mesh": 0, "children": [3, 4], "rotation": [0.0, 0.0, 0.7, 0.7], "scale": [1.0, -2.0, 1.0] },
        { "camera": 0, "translation": [0.0, 0.0, 3.0] },
        { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        { "mesh": 1, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0, "SCALE": 0 } } } },
        { "extensions": { "KHR_lights_punctual": { "light": 1 } }, "children": [5] },
        { "extensions": { "KHR_lights_punctual": { "light": 2 } } },
    ]);
    (document, bytes)
}
