//! The scene as the kernels read it: little-endian 32-bit words, as `stages/wgsl/scene` declares them.

use super::alias;
use super::blue_noise;
use super::light::{Light, Shape};
use super::material::Material;
use super::texture::{Slot, Wrap};
use super::triangle::Triangle;
use super::{Accelerator, Scene};
use bytemuck::NoUninit;
use gltf::material::AlphaMode;
use std::sync::OnceLock;

/// Light index of a triangle that is no light, and of a sky that is not there.
const NO_LIGHT: u32 = u32::MAX;
/// Smallest resource, bytes: an empty binding is not legal.
const LEAST_BYTES: usize = 16;

/// Names of the tables that describe a scene. `blue_noise` is a resource beside them.
pub const RESOURCES: [&str; 17] = [
    "bvh_nodes",
    "bvh2_nodes",
    "bvh_triangles",
    "triangle_normals",
    "triangle_uvs",
    "triangle_tangents",
    "triangle_colors",
    "materials",
    "media",
    "texture_slots",
    "texels",
    "lights",
    "light_alias",
    "sky_texels",
    "sky_alias",
    "sky_frame",
    "scene",
];

/// Packed resources, each made when first asked for; by place in [`RESOURCES`].
pub type Packed = [OnceLock<Vec<u8>>; RESOURCES.len()];

/// The bytes of a resource; `None` for an unknown name and for a hierarchy that the kernels do not read or cannot traverse.
pub fn resource<'a>(scene: &'a Scene, name: &str) -> Option<&'a [u8]> {
    if name == "blue_noise" {
        return Some(blue_noise::bytes());
    }
    let other_hierarchy = match scene.accelerator {
        Accelerator::Cwbvh => "bvh2_nodes",
        Accelerator::Bvh2 => "bvh_nodes",
    };
    let place = RESOURCES.iter().position(|&known| known == name && known != other_hierarchy)?;
    if matches!(name, "bvh_nodes" | "bvh2_nodes") && scene.bvh().depth > scene.accelerator.most_levels() {
        return None;
    }
    Some(scene.packed[place].get_or_init(|| pack(scene, RESOURCES[place])))
}

fn pack(scene: &Scene, name: &str) -> Vec<u8> {
    match name {
        "bvh_nodes" | "bvh2_nodes" => bytes(&scene.bvh().words),
        "bvh_triangles" => bytes(&bvh_triangles(scene)),
        "triangle_normals" => bytes(&per_corner(scene, |triangle| triangle.normals.map(|normal| normal.to_array()))),
        "triangle_uvs" => bytes(&uvs(scene)),
        "triangle_tangents" => bytes(&per_corner(scene, |triangle| triangle.tangents)),
        "triangle_colors" => bytes(&per_corner(scene, |triangle| triangle.colors)),
        "materials" => bytes(&materials(scene)),
        "media" => bytes(&media(scene)),
        "texture_slots" => bytes(&texture_slots(scene)),
        "texels" => bytes(&scene.images.iter().flat_map(|image| image.texels.iter().copied()).collect::<Vec<_>>()),
        "lights" => bytes(&lights(scene)),
        "light_alias" => bytes(&alias_words(&scene.lights.probabilities)),
        "sky_texels" => bytes(&scene.sky.as_ref().map_or(Vec::new(), |sky| sky.texels())),
        "sky_alias" => bytes(&scene.sky.as_ref().map_or(Vec::new(), |sky| alias_words(&sky.probabilities))),
        "sky_frame" => bytes(&[sky_frame(scene)]),
        _ => bytes(&[uniform(scene)]),
    }
}

/// Little-endian words, filled up to the smallest binding.
fn bytes<T: NoUninit>(values: &[T]) -> Vec<u8> {
    let mut bytes: Vec<u8> = bytemuck::cast_slice(values).to_vec();
    if cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(4).for_each(<[u8]>::reverse);
    }
    bytes.resize(bytes.len().max(LEAST_BYTES), 0);
    bytes
}

fn per_corner<T>(scene: &Scene, corners: impl Fn(&Triangle) -> [T; 3]) -> Vec<T> {
    in_leaf_order(scene).flat_map(corners).collect()
}

/// All triangles as the hierarchy numbers them.
fn in_leaf_order(scene: &Scene) -> impl Iterator<Item = &Triangle> {
    scene.bvh().order.iter().map(|&index| &scene.triangles[index as usize])
}

fn bvh_triangles(scene: &Scene) -> Vec<[f32; 12]> {
    let mut light_of = vec![NO_LIGHT; scene.triangles.len()];
    for (light, index) in scene.lights.list.iter().zip(0..) {
        if let Shape::Triangle { triangle, .. } = light.shape {
            light_of[triangle as usize] = index;
        }
    }
    let pack = |&index: &u32| {
        let triangle = &scene.triangles[index as usize];
        let ([x, y, z], (e1, e2)) = (triangle.positions[0].to_array(), triangle.edges());
        let flags = f32::from_bits(u32::from(triangle.alpha_tested));
        let (material, light) = (f32::from_bits(triangle.material), f32::from_bits(light_of[index as usize]));
        [x, y, z, flags, e1.x, e1.y, e1.z, material, e2.x, e2.y, e2.z, light]
    };
    let packed: Vec<[f32; 12]> = scene.bvh().order.iter().map(pack).collect();
    // An empty BVH2 still has a leaf: one triangle without edges, which no ray hits.
    if packed.is_empty() { vec![[0.0; 12]] } else { packed }
}

fn uvs(scene: &Scene) -> Vec<[f32; 2]> {
    let second = scene.effects.get("second_uv").is_some_and(|effect| effect.present);
    let sets = if second { 0..2 } else { 0..1 };
    sets.flat_map(|set| per_corner(scene, move |triangle| triangle.uvs[set])).collect()
}

fn materials(scene: &Scene) -> Vec<[[f32; 4]; 5]> {
    let mut media = 0;
    let row = |source: &Material| {
        media += u32::from(source.absorbs());
        material(source, if source.absorbs() { media } else { 0 })
    };
    scene.materials.iter().map(row).collect()
}

/// Absorption by number of the medium: nothing, then one row for each material that absorbs.
fn media(scene: &Scene) -> Vec<[f32; 4]> {
    let absorbing = scene.materials.iter().filter(|material| material.absorbs());
    let rows = absorbing.map(|material| material.absorption).map(|[r, g, b]| [r, g, b, 0.0]);
    std::iter::once([0.0; 4]).chain(rows).collect()
}

fn material(material: &Material, medium: u32) -> [[f32; 4]; 5] {
    let [r, g, b] = material.base_color;
    let [er, eg, eb] = material.emission;
    let [sr, sg, sb] = material.specular_color;
    [
        [r, g, b, material.alpha],
        [material.metallic, material.roughness, material.ior, material.transmission],
        [er, eg, eb, f32::from_bits(material_flags(material))],
        [sr, sg, sb, material.specular],
        [material.normal_scale, material.alpha_cutoff, f32::from_bits(medium), 0.0],
    ]
}

fn material_flags(material: &Material) -> u32 {
    /// Vertex colours multiply the base colour of every material.
    const VERTEX_COLORS: u32 = 1 << 4;
    const FIRST_TEXTURE: usize = 8;
    let mut flags = VERTEX_COLORS
        | u32::from(material.double_sided)
        | u32::from(material.solid) << 1
        | u32::from(material.unlit) << 5;
    flags |= match material.alpha_mode {
        AlphaMode::Opaque => 0,
        AlphaMode::Mask => 1 << 2,
        AlphaMode::Blend => 1 << 3,
    };
    let present = material.slots.iter().enumerate().filter(|(_, slot)| slot.is_some());
    present.fold(flags, |flags, (role, _)| flags | 1 << (FIRST_TEXTURE + role))
}

fn texture_slots(scene: &Scene) -> Vec<[u32; 12]> {
    let offsets: Vec<u32> = scene
        .images
        .iter()
        .scan(0u32, |next, image| {
            let offset = *next;
            *next += image.texels.len() as u32;
            Some(offset)
        })
        .collect();
    let pack =
        |slot: &Option<Slot>| slot.as_ref().map_or([0; 12], |slot| texture_slot(scene, slot, offsets[slot.image]));
    scene.materials.iter().flat_map(|material| material.slots.iter().map(pack)).collect()
}

fn texture_slot(scene: &Scene, slot: &Slot, offset: u32) -> [u32; 12] {
    let image = &scene.images[slot.image];
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0u32,
        Wrap::Clamp => 1,
        Wrap::Mirror => 2,
    };
    let flags = wrap(slot.wrap[0])
        | wrap(slot.wrap[1]) << 2
        | u32::from(slot.nearest) << 4
        | u32::from(slot.srgb) << 5
        | (slot.set as u32) << 6;
    let [[m00, m01, m02], [m10, m11, m12]] = slot.matrix.map(|row| row.map(f32::to_bits));
    [offset, image.width | image.height << 16, flags, 0, m00, m01, m02, 0, m10, m11, m12, 0]
}

fn lights(scene: &Scene) -> Vec<[[f32; 4]; 4]> {
    let order = &scene.bvh().order;
    let mut place = vec![0u32; order.len()];
    order.iter().zip(0..).for_each(|(&index, prim)| place[index as usize] = prim);
    scene
        .lights
        .list
        .iter()
        .zip(&scene.lights.probabilities)
        .map(|(entry, &probability)| light(entry, probability, &place))
        .collect()
}

/// `place` leads from a triangle in document order to the leaf order.
fn light(light: &Light, probability: f64, place: &[u32]) -> [[f32; 4]; 4] {
    let mut words = [[0.0f32; 4]; 4];
    let (kind, prim) = match light.shape {
        Shape::Triangle { triangle, area } => {
            words[1][3] = area as f32;
            (0, place[triangle as usize])
        }
        Shape::Point { position } => {
            words[1][..3].copy_from_slice(&position.as_vec3().to_array());
            (1, 0)
        }
        Shape::Spot { position, direction, cos_inner, cos_outer } => {
            words[1][..3].copy_from_slice(&position.as_vec3().to_array());
            words[2][..3].copy_from_slice(&direction.as_vec3().to_array());
            words[2][3] = cos_outer as f32;
            words[3][3] = cos_inner as f32;
            (2, 0)
        }
        Shape::Directional { direction } => {
            words[2][..3].copy_from_slice(&direction.as_vec3().to_array());
            (3, 0)
        }
        Shape::Sky => (4, 0),
    };
    words[0] = [f32::from_bits(kind), probability as f32, f32::from_bits(prim), 0.0];
    words[3][..3].copy_from_slice(&light.intensity);
    words
}

fn alias_words(probabilities: &[f64]) -> Vec<[u32; 2]> {
    alias::table(probabilities).iter().map(|entry| [entry.threshold.to_bits(), entry.alias]).collect()
}

/// The uniform `Scene`: six vec4.
fn uniform(scene: &Scene) -> [[f32; 4]; 6] {
    let camera = &scene.camera;
    let origin = (camera.origin - scene.moved_by).as_vec3();
    let [right, up, forward] = camera.axes.map(|axis| axis.as_vec3());
    let (half_width, half_height) = camera.half_extent();
    let (centre, radius) = (scene.bounds.0.as_vec3(), scene.bounds.1);
    [
        origin.extend(scene.lens.radius).to_array(),
        right.extend(half_width as f32).to_array(),
        up.extend(half_height as f32).to_array(),
        forward.extend(scene.lens.focus_distance).to_array(),
        centre.extend(radius as f32).to_array(),
        bits([camera.size.0, camera.size.1, scene.lights.list.len() as u32, scene.triangles.len() as u32]),
    ]
}

/// The uniform `SkyFrame`: two vec4.
fn sky_frame(scene: &Scene) -> [[f32; 4]; 2] {
    let light = scene.lights.sky_index();
    let (width, height) = scene.sky.as_ref().map_or((1, 1), |sky| (sky.width, sky.height));
    let (sin, cos) = scene.sky.as_ref().map_or(0.0, |sky| sky.rotation).sin_cos();
    let probability = light.map_or(0.0, |index| scene.lights.probabilities[index]);
    [
        bits([width, height, 0, light.map_or(NO_LIGHT, |index| index as u32)]),
        [cos as f32, sin as f32, probability as f32, 0.0],
    ]
}

/// Four words in the place of four floats.
fn bits(words: [u32; 4]) -> [f32; 4] {
    words.map(f32::from_bits)
}
