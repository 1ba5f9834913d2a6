//! Materials: factors, texture slots, and what values they can take over their textures.

use super::texture::{Collector, Image, Reference, Slot};
use crate::error::{Error, Result};
use gltf::material::AlphaMode;
use std::ops::Range;

/// Squared roughness below which a lobe is a delta.
pub const SMOOTH_ALPHA: f32 = 1e-4;

/// What a texture of a material says; the value is its place in the material's slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// RGB base colour, A coverage.
    BaseColor = 0,
    /// G roughness, B metallic.
    MetallicRoughness = 1,
    /// RGB radiance.
    Emissive = 2,
    /// Tangent-space normal.
    Normal = 3,
    /// R transmission.
    Transmission = 4,
    /// A strength of the dielectric reflection.
    Specular = 5,
    /// RGB colour of the dielectric reflection.
    SpecularColor = 6,
}

/// Number of roles.
pub const ROLES: usize = 7;

/// Everything that the kernels know about a surface.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name for messages: `material "glass"`.
    pub name: String,
    /// Linear RGB.
    pub base_color: [f32; 3],
    /// Coverage factor; 1 for opaque materials.
    pub alpha: f32,
    /// 0..1.
    pub metallic: f32,
    /// 0..1; the GGX width is its square.
    pub roughness: f32,
    /// Index of refraction; 0 means a reflectance of 1.
    pub ior: f32,
    /// 0..1.
    pub transmission: f32,
    /// Radiance, W/(m2 sr) in linear sRGB.
    pub emission: [f32; 3],
    /// Strength of the dielectric reflection.
    pub specular: f32,
    /// Colour of the dielectric reflection at normal incidence.
    pub specular_color: [f32; 3],
    /// Absorption inside a solid, 1/m.
    pub absorption: [f32; 3],
    /// Coverage below this is a hole (MASK).
    pub alpha_cutoff: f32,
    /// Scale of the x and y of the normal map.
    pub normal_scale: f32,
    /// Emits and is shaded on both sides.
    pub double_sided: bool,
    /// Bounds a volume.
    pub solid: bool,
    /// Coverage.
    pub alpha_mode: AlphaMode,
    /// KHR_materials_unlit: shaded as Lambert of the base colour.
    pub unlit: bool,
    /// Textures by role.
    pub slots: [Option<Slot>; ROLES],
    /// TEXCOORD_n of the one or two sets that the slots use.
    pub uv_sets: Vec<u32>,
}

impl Material {
    /// Whether light is absorbed inside of what it bounds.
    pub fn absorbs(&self) -> bool {
        self.absorption.iter().any(|&sigma| sigma > 0.0)
    }
}

/// Reads a material.
///
/// # Errors
/// Factors that are not finite or outside their range, more than two texture coordinate sets.
pub fn read(material: &gltf::Material<'_>, textures: &mut Collector, warnings: &mut Vec<String>) -> Result<Material> {
    let name = match (material.name(), material.index()) {
        (Some(name), _) if !name.is_empty() => format!("material \"{name}\""),
        (_, Some(index)) => format!("material {index}"),
        (_, None) => "the default material".into(),
    };
    let mut out = factors(material, name.clone()).map_err(|error| error.at(&name))?;
    let references = references(material, out.unlit);
    out.uv_sets = uv_sets(&references).map_err(|error| error.at(&name))?;
    for (role, reference) in references {
        let set = out.uv_sets.iter().position(|&set| set == reference.tex_coord).unwrap_or(0);
        let srgb = matches!(role, Role::BaseColor | Role::Emissive | Role::SpecularColor);
        if !reference.matrix.as_flattened().iter().all(|value| value.is_finite()) {
            return Err(Error::input("KHR_texture_transform is not finite").at(format!("{name}, {role:?} texture")));
        }
        out.slots[role as usize] = Some(textures.slot(&reference, srgb, set));
    }
    if out.unlit {
        warnings.push(format!("{name} is unlit: it is shaded as Lambert of its base colour"));
    }
    Ok(out)
}

fn factors(material: &gltf::Material<'_>, name: String) -> Result<Material> {
    let pbr = material.pbr_metallic_roughness();
    let unlit = material.unlit();
    let strength = material.emissive_strength().unwrap_or(1.0);
    let [r, g, b, alpha] = pbr.base_color_factor();
    let specular = material.specular();
    let transmission = material.transmission().map_or(0.0, |t| t.transmission_factor());
    let volume = material.volume();
    let solid = transmission > 0.0 && volume.as_ref().is_some_and(|volume| volume.thickness_factor() > 0.0);
    let mut out = Material {
        name,
        base_color: non_negative("baseColorFactor", [r, g, b])?,
        alpha: if material.alpha_mode() == AlphaMode::Opaque { 1.0 } else { unit("baseColorFactor alpha", alpha)? },
        metallic: unit("metallicFactor", pbr.metallic_factor())?,
        roughness: unit("roughnessFactor", pbr.roughness_factor())?,
        ior: ior(material.ior().unwrap_or(1.5))?,
        transmission: unit("transmissionFactor", transmission)?,
        emission: non_negative("emissiveFactor x emissiveStrength", material.emissive_factor().map(|c| c * strength))?,
        specular: unit("specularFactor", specular.as_ref().map_or(1.0, |s| s.specular_factor()))?,
        specular_color: non_negative(
            "specularColorFactor",
            specular.as_ref().map_or([1.0; 3], |s| s.specular_color_factor()),
        )?,
        absorption: [0.0; 3],
        alpha_cutoff: material.alpha_cutoff().unwrap_or(0.5),
        normal_scale: material.normal_texture().map_or(1.0, |texture| texture.scale()),
        double_sided: material.double_sided(),
        solid,
        alpha_mode: material.alpha_mode(),
        unlit,
        slots: Default::default(),
        uv_sets: Vec::new(),
    };
    if let Some(volume) = volume.filter(|_| solid) {
        out.absorption = absorption(volume.attenuation_color(), volume.attenuation_distance())?;
    }
    if !out.alpha_cutoff.is_finite() || !out.normal_scale.is_finite() {
        return Err(Error::input("alphaCutoff or the scale of the normal map is not finite"));
    }
    if unlit {
        let lambert = Material {
            metallic: 0.0,
            roughness: 1.0,
            transmission: 0.0,
            specular: 0.0,
            emission: [0.0; 3],
            solid: false,
            ..out
        };
        return Ok(Material { absorption: [0.0; 3], ..lambert });
    }
    Ok(out)
}

fn unit(name: &str, value: f32) -> Result<f32> {
    if value.is_finite() {
        Ok(value.clamp(0.0, 1.0))
    } else {
        Err(Error::input(format!("{name} is {value}")).help("0 to 1"))
    }
}

fn non_negative(name: &str, value: [f32; 3]) -> Result<[f32; 3]> {
    if value.iter().all(|c| c.is_finite() && *c >= 0.0) {
        return Ok(value);
    }
    Err(Error::input(format!("{name} is {value:?}")).help("finite and not negative"))
}

fn ior(value: f32) -> Result<f32> {
    if value == 0.0 || (value.is_finite() && value >= 1.0) {
        return Ok(value);
    }
    Err(Error::input(format!("ior is {value}")).help("1 or more, or 0"))
}

/// Beer-Lambert absorption that turns white into `color` over `distance` metres.
fn absorption(color: [f32; 3], distance: f32) -> Result<[f32; 3]> {
    /// Darkest attenuation colour: a channel of 0 would absorb infinitely.
    const DARKEST: f64 = 1e-20;
    if distance.is_nan() || distance <= 0.0 {
        return Err(Error::input(format!("attenuationDistance is {distance}")).help("more than 0"));
    }
    let color = non_negative("attenuationColor", color)?;
    if distance >= f32::MAX {
        return Ok([0.0; 3]);
    }
    Ok(color
        .map(|c| (-f64::from(c).clamp(DARKEST, 1.0).ln() / f64::from(distance)).min(f64::from(f32::MAX)) as f32 + 0.0))
}

/// The textures that matter, by role. Those behind a factor of 0 do not.
fn references<'a>(material: &gltf::Material<'a>, unlit: bool) -> Vec<(Role, Reference<'a>)> {
    let pbr = material.pbr_metallic_roughness();
    let mut out = Vec::new();
    let mut add =
        |role: Role, info: Option<gltf::texture::Info<'a>>| out.extend(info.map(|info| (role, Reference::new(&info))));
    add(Role::BaseColor, pbr.base_color_texture());
    if unlit {
        return out;
    }
    if pbr.metallic_factor() > 0.0 || pbr.roughness_factor() > 0.0 {
        add(Role::MetallicRoughness, pbr.metallic_roughness_texture());
    }
    let strength = material.emissive_strength().unwrap_or(1.0);
    if strength > 0.0 && material.emissive_factor().iter().any(|&c| c > 0.0) {
        add(Role::Emissive, material.emissive_texture());
    }
    if let Some(transmission) = material.transmission().filter(|t| t.transmission_factor() > 0.0) {
        add(Role::Transmission, transmission.transmission_texture());
    }
    if let Some(specular) = material.specular().filter(|specular| specular.specular_factor() > 0.0) {
        add(Role::Specular, specular.specular_texture());
        add(Role::SpecularColor, specular.specular_color_texture());
    }
    out.extend(material.normal_texture().map(|info| (Role::Normal, Reference::of_normal_map(&info))));
    out
}

fn uv_sets(references: &[(Role, Reference<'_>)]) -> Result<Vec<u32>> {
    let mut sets: Vec<u32> = references.iter().map(|(_, reference)| reference.tex_coord).collect();
    sets.sort_unstable();
    sets.dedup();
    if sets.len() > 2 {
        return Err(Error::input(format!("its textures use the texture coordinate sets {sets:?}"))
            .help("at most two sets in one material"));
    }
    Ok(sets)
}

impl Material {
    /// The slot of a role.
    pub fn slot(&self, role: Role) -> Option<&Slot> {
        self.slots[role as usize].as_ref()
    }

    /// Which of the material's texture coordinate sets its normal map uses.
    pub fn normal_map_set(&self) -> Option<usize> {
        self.slot(Role::Normal).map(|slot| slot.set)
    }

    /// Whether any channel of the emission factor is positive.
    pub fn emits(&self) -> bool {
        self.emission.iter().any(|&c| c > 0.0)
    }

    /// What factor x texture can be, with `factor` in the channel `channel` of `role`.
    fn span(&self, factor: f32, role: Role, channel: usize, images: &[Image]) -> Range<f32> {
        let (low, high) = self.slot(role).map_or((1.0, 1.0), |slot| slot.range(images, channel));
        factor * low..factor * high
    }

    /// Values that metallic can take.
    pub fn metallic_span(&self, images: &[Image]) -> Range<f32> {
        self.span(self.metallic, Role::MetallicRoughness, 2, images)
    }

    /// Values that the GGX width, roughness squared, can take.
    pub fn width_span(&self, images: &[Image]) -> Range<f32> {
        let roughness = self.span(self.roughness, Role::MetallicRoughness, 1, images);
        roughness.start * roughness.start..roughness.end * roughness.end
    }

    /// Values that transmission can take.
    pub fn transmission_span(&self, images: &[Image]) -> Range<f32> {
        self.span(self.transmission, Role::Transmission, 0, images)
    }

    /// Values that the strength of the dielectric reflection can take.
    pub fn specular_span(&self, images: &[Image]) -> Range<f32> {
        self.span(self.specular, Role::Specular, 3, images)
    }

    /// Whether a triangle whose vertex colours have this least alpha can have holes or be seen through.
    pub fn alpha_tested(&self, images: &[Image], least_vertex_alpha: f32) -> bool {
        let least = self.span(self.alpha, Role::BaseColor, 3, images).start * least_vertex_alpha;
        match self.alpha_mode {
            AlphaMode::Opaque => false,
            AlphaMode::Mask => least < self.alpha_cutoff,
            AlphaMode::Blend => least < 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absorption_turns_white_into_the_attenuation_colour() {
        let sigma = absorption([0.5, 1.0, 0.0], 2.0).unwrap();
        assert!(((-f64::from(sigma[0]) * 2.0).exp() - 0.5).abs() < 1e-6);
        assert_eq!(sigma[1], 0.0);
        assert!(sigma[2].is_finite());
        assert_eq!(absorption([0.5; 3], f32::INFINITY).unwrap(), [0.0; 3]);
        assert!(absorption([0.5; 3], 0.0).is_err());
        assert!(ior(0.5).is_err());
    }
}
