//! Scenes as the script of the references hands them to the other renderer, which has other materials than glTF.

use serde_json::{Map, Value, json};

/// Alpha below which the other renderer's `principled` material raises it (`principled.cpp`: 0.001).
const LEAST_ALPHA: f64 = 1e-3;
/// Roughness below which the script takes the smooth dielectric for glass.
const SMOOTH_GLASS: f64 = 0.05;
/// Share of transmission from which the script takes a material for glass.
const GLASS_TRANSMISSION: f64 = 0.3;

/// Edits all materials and samplers.
pub fn convert(document: &mut Value) {
    for material in list(document, "materials") {
        material_as_converted(material);
    }
    filter_linearly(document);
}

/// Pictures are given without their samplers, and bilinear filtering is the other renderer's default (`veach_ajar` asks for nearest).
fn filter_linearly(document: &mut Value) {
    for sampler in list(document, "samplers").filter_map(Value::as_object_mut) {
        sampler.retain(|key, _| !["magFilter", "minFilter"].contains(&key.as_str()));
    }
}

/// What a list of the document holds; nothing where it is not there.
fn list<'a>(document: &'a mut Value, name: &str) -> impl Iterator<Item = &'a mut Value> {
    document.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten()
}

fn material_as_converted(material: &mut Value) {
    emit_in_front(material);
    let transmission = extension(material, "transmission");
    let share = transmission["transmissionFactor"].as_f64().unwrap_or(0.0);
    if share > GLASS_TRANSMISSION && transmission.get("transmissionTexture").is_none() {
        simple_glass(material);
    } else {
        forget(material, "transmission");
        raise_roughness(material);
    }
}

/// Triangle lights emit on one side (`area.cpp`).
fn emit_in_front(material: &mut Value) {
    let emits = material
        .get("emissiveFactor")
        .and_then(Value::as_array)
        .is_some_and(|rgb| rgb.iter().any(|x| x.as_f64() > Some(0.0)));
    if emits {
        material["doubleSided"] = json!(false);
    }
}

/// Glass has no textures and nothing that absorbs; where it is rough, it has no tint either (`roughdielectric`), and a sheet is smooth
/// (`thindielectric`).
fn simple_glass(material: &mut Value) {
    let old = material["pbrMetallicRoughness"].take();
    let roughness = old["roughnessFactor"].as_f64().unwrap_or(1.0);
    let solid = extension(material, "volume")["thicknessFactor"].as_f64() > Some(0.0);
    let smooth = !solid || roughness < SMOOTH_GLASS;
    let white = json!([1.0, 1.0, 1.0, 1.0]);
    let tint = old.get("baseColorFactor").filter(|_| smooth).cloned().unwrap_or(white);
    material["pbrMetallicRoughness"] = json!({
        "baseColorFactor": tint,
        "metallicFactor": 0.0,
        "roughnessFactor": if smooth { 0.0 } else { roughness },
    });
    material["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": 1.0 });
    if solid {
        material["extensions"]["KHR_materials_volume"] = json!({ "thicknessFactor": 1.0 });
    }
}

/// No coat is smoother than an alpha of 1e-3; mirrors are another material.
fn raise_roughness(material: &mut Value) {
    let Some(surface) = material.get_mut("pbrMetallicRoughness") else { return };
    let factor = |key: &str| surface[key].as_f64().unwrap_or(1.0);
    let mirror = factor("metallicFactor") == 1.0 && factor("roughnessFactor") == 0.0;
    let textured = surface.get("metallicRoughnessTexture").is_some();
    if !textured && !mirror && factor("roughnessFactor").powi(2) < LEAST_ALPHA {
        surface["roughnessFactor"] = json!(LEAST_ALPHA.sqrt());
    }
}

/// An extension of a material, `Null` where it is not there.
fn extension(material: &Value, name: &str) -> Value {
    let extension = material.get("extensions").and_then(|all| all.get(format!("KHR_materials_{name}")));
    extension.cloned().unwrap_or(Value::Null)
}

fn forget(material: &mut Value, name: &str) {
    let extensions = material.get_mut("extensions").and_then(Value::as_object_mut);
    extensions.and_then(|all: &mut Map<String, Value>| all.remove(&format!("KHR_materials_{name}")));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rough_glass_loses_colour_textures_and_absorption() {
        let mut document = json!({ "materials": [{
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1.0, 1.0, 1.0], "metallicRoughnessTexture": { "index": 0 } },
            "extensions": {
                "KHR_materials_transmission": { "transmissionFactor": 1.0 },
                "KHR_materials_volume": { "thicknessFactor": 0.1, "attenuationDistance": 0.001 },
                "KHR_materials_ior": { "ior": 1.4 },
            },
        }] });
        convert(&mut document);
        let expected = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            "extensions": {
                "KHR_materials_transmission": { "transmissionFactor": 1.0 },
                "KHR_materials_volume": { "thicknessFactor": 1.0 },
                "KHR_materials_ior": { "ior": 1.4 },
            },
        });
        assert_eq!(document["materials"][0], expected);
    }

    #[test]
    fn lambert_stays() {
        let lambert = json!({
            "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            "extensions": { "KHR_materials_specular": { "specularFactor": 0.0 } },
        });
        let mut document = json!({ "materials": [lambert.clone()] });
        convert(&mut document);
        assert_eq!(document["materials"][0], lambert);
    }
}
