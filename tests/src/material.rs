//! Materials of the built scenes, in the words of glTF.

use serde_json::{Map, Value, json};

/// A metallic-roughness material with the extensions that Pathloom reads.
#[derive(Clone, Debug)]
pub struct Material {
    /// Its name in the file.
    pub name: String,
    /// Linear reflectance.
    pub base_color: [f64; 3],
    /// Opacity; below 1 the material is written as BLEND.
    pub opacity: f64,
    /// 0 dielectric, 1 metal.
    pub metallic: f64,
    /// Perceptual roughness; alpha is its square.
    pub roughness: f64,
    /// `KHR_materials_specular.specularFactor`; 0 with `metallic` 0 is exactly Lambert.
    pub specular: f64,
    /// Index of refraction.
    pub ior: f64,
    /// Share of light that a dielectric lets through.
    pub transmission: f64,
    /// Whether it bounds a solid; a transmitting material without a volume is one thin sheet.
    pub solid: bool,
    /// Colour that white light has after `distance` metres in the solid.
    pub attenuation: Option<([f64; 3], f64)>,
    /// Emitted radiance.
    pub emission: [f64; 3],
    /// Whether both sides are drawn and emit.
    pub double_sided: bool,
}

impl Material {
    /// A Lambert reflector, exactly.
    pub fn lambert(name: &str, albedo: [f64; 3]) -> Material {
        Material {
            name: name.to_owned(),
            base_color: albedo,
            opacity: 1.0,
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            ior: 1.5,
            transmission: 0.0,
            solid: false,
            attenuation: None,
            emission: [0.0; 3],
            double_sided: false,
        }
    }

    /// A black surface that emits from its front.
    pub fn emitter(name: &str, radiance: [f64; 3]) -> Material {
        Material { emission: radiance, ..Material::lambert(name, [0.0; 3]) }
    }

    /// A metal; roughness 0 is a perfect mirror.
    pub fn metal(name: &str, reflectance: [f64; 3], roughness: f64) -> Material {
        Material { metallic: 1.0, roughness, specular: 1.0, ..Material::lambert(name, reflectance) }
    }

    /// A diffuse base under a dielectric interface.
    pub fn glossy(name: &str, albedo: [f64; 3], roughness: f64) -> Material {
        Material { roughness, specular: 1.0, ..Material::lambert(name, albedo) }
    }

    /// Clear solid glass; its surface must be closed.
    pub fn glass(name: &str, ior: f64, roughness: f64) -> Material {
        Material { ior, roughness, specular: 1.0, transmission: 1.0, solid: true, ..Material::lambert(name, [1.0; 3]) }
    }

    /// One thin sheet of clear glass.
    pub fn thin_glass(name: &str, ior: f64) -> Material {
        Material { solid: false, ..Material::glass(name, ior, 0.0) }
    }

    /// Seen and emitting from both sides.
    pub fn two_sided(mut self) -> Material {
        self.double_sided = true;
        self
    }

    /// Whether it gives off light.
    pub fn emits(&self) -> bool {
        self.emission.iter().any(|&channel| channel > 0.0)
    }

    /// The glTF object; extensions appear only where they say something.
    pub fn to_json(&self) -> Value {
        let color = self.base_color;
        let mut material = json!({
            "name": self.name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [color[0], color[1], color[2], self.opacity],
                "metallicFactor": self.metallic,
                "roughnessFactor": self.roughness,
            },
        });
        if self.opacity < 1.0 {
            material["alphaMode"] = json!("BLEND");
        }
        if self.double_sided {
            material["doubleSided"] = json!(true);
        }
        let strength = largest(self.emission);
        if self.emits() {
            material["emissiveFactor"] = json!(self.emission.map(|channel| channel / strength));
        }
        let extensions = self.extensions();
        if !extensions.is_empty() {
            material["extensions"] = Value::Object(extensions);
        }
        material
    }

    fn extensions(&self) -> Map<String, Value> {
        let mut extensions = Map::new();
        if self.emits() {
            extensions.insert(
                "KHR_materials_emissive_strength".into(),
                json!({ "emissiveStrength": largest(self.emission) }),
            );
        }
        if self.specular != 1.0 {
            extensions.insert("KHR_materials_specular".into(), json!({ "specularFactor": self.specular }));
        }
        if self.ior != 1.5 {
            extensions.insert("KHR_materials_ior".into(), json!({ "ior": self.ior }));
        }
        if self.transmission > 0.0 {
            extensions.insert("KHR_materials_transmission".into(), json!({ "transmissionFactor": self.transmission }));
        }
        if self.solid {
            extensions.insert("KHR_materials_volume".into(), self.volume());
        }
        extensions
    }

    fn volume(&self) -> Value {
        match self.attenuation {
            None => json!({ "thicknessFactor": 1.0 }),
            Some((color, distance)) => {
                json!({ "thicknessFactor": 1.0, "attenuationColor": color, "attenuationDistance": distance })
            }
        }
    }
}

/// The largest of three channels.
pub fn largest(color: [f64; 3]) -> f64 {
    color[0].max(color[1]).max(color[2])
}
