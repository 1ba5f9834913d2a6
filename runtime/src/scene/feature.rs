//! Which effects a scene calls for, and what in it decides.

use super::light::{Light, Lights, Shape};
use super::material::{Material, Role, SMOOTH_ALPHA};
use super::texture::Image;
use super::triangle::Triangle;
use kernelgen::config::model::{Effect, Effects};

/// What the effects are read from.
pub struct Evidence<'a> {
    /// Materials of the triangles.
    pub materials: &'a [Material],
    /// Their images.
    pub images: &'a [Image],
    /// All triangles.
    pub triangles: &'a [Triangle],
    /// All lights.
    pub lights: &'a Lights,
    /// Whether any placed primitive has vertex colours.
    pub vertex_colors: bool,
    /// Radius of the lens, m.
    pub lens_radius: f32,
}

/// The effects of a scene: every name that a stage may ask for.
pub fn effects(evidence: &Evidence<'_>) -> Effects {
    let mut out = Effects::new();
    let mut add = |name: &str, reason: Result<String, &str>| {
        let present = reason.is_ok();
        out.insert(name.to_owned(), Effect { present, reason: reason.unwrap_or_else(str::to_owned) });
    };
    for (name, reason) in light_effects(evidence)
        .into_iter()
        .chain(texture_effects(evidence))
        .chain(geometry_effects(evidence))
        .chain(lobe_effects(evidence))
    {
        add(name, reason);
    }
    out
}

type Finding = (&'static str, Result<String, &'static str>);

fn light_effects(evidence: &Evidence<'_>) -> Vec<Finding> {
    let count = |test: fn(&Light) -> bool, noun: &str| {
        let lights: Vec<&Light> = evidence.lights.list.iter().filter(|light| test(light)).collect();
        match lights[..] {
            [] => None,
            [only] if !only.name.is_empty() => Some(format!("{noun} \"{}\"", only.name)),
            [_] => Some(format!("one {noun}")),
            ref several => Some(format!("{} {noun}s", several.len())),
        }
    };
    let is_area = |light: &Light| matches!(light.shape, Shape::Triangle { .. });
    let both_sides = |light: &&Light| match light.shape {
        Shape::Triangle { triangle, .. } => material_of(evidence, triangle).double_sided,
        _ => false,
    };
    let two_sided = evidence.lights.list.iter().find(both_sides).and_then(|light| match light.shape {
        Shape::Triangle { triangle, .. } => {
            Some(format!("{} emits and is double-sided", material_of(evidence, triangle).name))
        }
        _ => None,
    });
    vec![
        ("area_light", count(is_area, "emissive triangle").ok_or("no triangle emits")),
        ("point_light", count(|l| matches!(l.shape, Shape::Point { .. }), "point light").ok_or("no point light")),
        ("spot_light", count(|l| matches!(l.shape, Shape::Spot { .. }), "spot light").ok_or("no spot light")),
        (
            "directional_light",
            count(|l| matches!(l.shape, Shape::Directional { .. }), "directional light").ok_or("no directional light"),
        ),
        (
            "sky",
            count(|l| matches!(l.shape, Shape::Sky), "environment map")
                .map(|_| "an environment map is given".into())
                .ok_or("no environment map"),
        ),
        ("two_sided_emission", two_sided.ok_or("no double-sided material emits")),
    ]
}

fn material_of<'a>(evidence: &Evidence<'a>, triangle: u32) -> &'a Material {
    &evidence.materials[evidence.triangles[triangle as usize].material as usize]
}

/// The first material that a test holds for.
fn first(evidence: &Evidence<'_>, test: impl Fn(&Material) -> bool, verb: &str) -> Option<String> {
    evidence.materials.iter().find(|material| test(material)).map(|material| format!("{} {verb}", material.name))
}

fn texture_effects(evidence: &Evidence<'_>) -> Vec<Finding> {
    let role = |role: Role, verb: &str| first(evidence, |m| m.slot(role).is_some(), verb);
    let specular = |m: &Material| m.slot(Role::Specular).or(m.slot(Role::SpecularColor)).is_some();
    let second = |m: &Material| m.slots.iter().flatten().any(|slot| slot.set == 1);
    vec![
        ("texture_base_color", role(Role::BaseColor, "has a base colour texture").ok_or("no base colour texture")),
        (
            "texture_metallic_roughness",
            role(Role::MetallicRoughness, "has a metallic-roughness texture").ok_or("no metallic-roughness texture"),
        ),
        ("texture_emissive", role(Role::Emissive, "has an emissive texture").ok_or("no emissive texture")),
        (
            "texture_transmission",
            role(Role::Transmission, "has a transmission texture").ok_or("no transmission texture"),
        ),
        ("texture_specular", first(evidence, specular, "has a specular texture").ok_or("no specular texture")),
        (
            "textures",
            first(evidence, |m| m.slots.iter().any(Option::is_some), "is textured").ok_or("no material is textured"),
        ),
        (
            "second_uv",
            first(evidence, second, "uses two sets of texture coordinates")
                .ok_or("no material uses two sets of texture coordinates"),
        ),
        ("normal_map", role(Role::Normal, "has a normal map").ok_or("no normal map")),
    ]
}

fn geometry_effects(evidence: &Evidence<'_>) -> Vec<Finding> {
    let of_material = |test: fn(&Triangle) -> bool, verb: &str| {
        let triangle = evidence.triangles.iter().find(|triangle| test(triangle))?;
        Some(format!("{} {verb}", evidence.materials[triangle.material as usize].name))
    };
    let curved = of_material(|t| !t.flat, "is on triangles with vertex normals");
    let alpha = of_material(|t| t.alpha_tested, "has holes or is partly transparent");
    let lens = (evidence.lens_radius > 0.0).then(|| format!("lens radius {} m", evidence.lens_radius));
    vec![
        (
            "vertex_colors",
            evidence.vertex_colors.then(|| "a mesh has vertex colours".into()).ok_or("no mesh has vertex colours"),
        ),
        ("shading_normals", curved.ok_or("all vertex normals are face normals")),
        ("alpha", alpha.ok_or("every surface is opaque")),
        ("lens", lens.ok_or("the camera is a pinhole")),
    ]
}

/// Which scattering lobes a material can have, over all values of its textures.
#[derive(Clone, Copy)]
struct Lobes {
    diffuse: bool,
    reflects: bool,
    transmits: bool,
    metal: bool,
    rough: bool,
    smooth: bool,
}

fn lobes(material: &Material, images: &[Image]) -> Lobes {
    let metallic = material.metallic_span(images);
    let transmission = material.transmission_span(images);
    let width = material.width_span(images);
    let transmits = transmission.end > 0.0 && metallic.start < 1.0;
    Lobes {
        diffuse: metallic.start < 1.0 && transmission.start < 1.0 && material.base_color.iter().any(|&c| c > 0.0),
        reflects: metallic.end > 0.0 || material.specular_span(images).end > 0.0 || transmission.end > 0.0,
        transmits,
        metal: metallic.end > 0.0,
        rough: width.end >= SMOOTH_ALPHA,
        smooth: width.start < SMOOTH_ALPHA,
    }
}

fn lobe_effects(evidence: &Evidence<'_>) -> Vec<Finding> {
    let with = |test: &dyn Fn(&Material, Lobes) -> bool, verb: &str| {
        first(evidence, |m| test(m, lobes(m, evidence.images)), verb)
    };
    vec![
        ("diffuse", with(&|_, l| l.diffuse, "has a diffuse lobe").ok_or("no material has a diffuse lobe")),
        ("specular", with(&|_, l| l.reflects, "reflects specularly").ok_or("every material is exactly Lambert")),
        ("metal", with(&|_, l| l.metal, "is metallic").ok_or("no material is metallic")),
        (
            "rough_specular",
            with(&|_, l| l.reflects && l.rough, "has a rough reflection").ok_or("no material has a rough reflection"),
        ),
        (
            "delta_specular",
            with(&|_, l| l.reflects && l.smooth, "is perfectly smooth")
                .ok_or("no material with a reflection is perfectly smooth"),
        ),
        ("transmission", with(&|_, l| l.transmits, "transmits").ok_or("no material transmits")),
        (
            "solid_glass",
            with(&|m, l| l.transmits && m.solid, "bounds a solid that transmits").ok_or("no solid transmits"),
        ),
        (
            "thin_glass",
            with(&|m, l| l.transmits && !m.solid, "is a thin sheet that transmits").ok_or("no thin sheet transmits"),
        ),
        (
            "rough_transmission",
            with(&|_, l| l.transmits && l.rough, "transmits roughly").ok_or("no material transmits roughly"),
        ),
        (
            "delta_transmission",
            with(&|_, l| l.transmits && l.smooth, "transmits and is perfectly smooth")
                .ok_or("no material that transmits is perfectly smooth"),
        ),
        (
            "attenuation",
            with(&|m, l| l.transmits && m.solid && m.absorbs(), "absorbs inside").ok_or("no solid absorbs"),
        ),
        (
            "delta",
            with(&|_, l| l.smooth && (l.reflects || l.transmits), "is perfectly smooth").ok_or("no lobe is a delta"),
        ),
    ]
}
