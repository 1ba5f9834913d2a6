//! The node hierarchy, flattened: which mesh, camera or light stands where, in depth-first document order.

use super::accessor;
use super::document::Document;
use crate::error::{Error, Result};
use glam::{DMat4, DQuat, DVec3};
use gltf::accessor::Dimensions;
use gltf::scene::Transform;

/// A mesh placed in the world.
pub struct Instance {
    /// Index of the mesh in the file.
    pub mesh: usize,
    /// Mesh to world.
    pub matrix: DMat4,
    /// Name of the node, for messages.
    pub name: String,
}

/// A camera or light placed in the world.
pub struct Placed<T> {
    /// The camera or light.
    pub item: T,
    /// Node to world.
    pub matrix: DMat4,
    /// Name of the node or of the item, for messages and for selection.
    pub name: String,
}

/// Everything the default scene places.
#[derive(Default)]
pub struct Placements<'a> {
    /// Meshes.
    pub instances: Vec<Instance>,
    /// Cameras; the index is what `--camera` takes.
    pub cameras: Vec<Placed<gltf::Camera<'a>>>,
    /// Punctual lights.
    pub lights: Vec<Placed<gltf::khr_lights_punctual::Light<'a>>>,
}

/// Walks the default scene, else the first scene, else all nodes that are no other node's child.
///
/// # Errors
/// A node below itself or below two nodes, a transform that is not finite, instancing attributes that do not fit.
pub fn place<'a>(document: &'a Document, warnings: &mut Vec<String>) -> Result<Placements<'a>> {
    let mut placements = Placements::default();
    let nodes: Vec<gltf::Node<'a>> = document.gltf.nodes().collect();
    check_parents(&nodes)?;
    let mut on_path = vec![false; nodes.len()];
    let mut stack: Vec<Step> =
        roots(document).into_iter().rev().map(|node| Step::Enter(node, DMat4::IDENTITY)).collect();
    while let Some(step) = stack.pop() {
        match step {
            Step::Leave(index) => on_path[index] = false,
            Step::Enter(index, parent) => {
                if std::mem::replace(&mut on_path[index], true) {
                    return Err(Error::input("the node is its own descendant").at(format!("node {index}")));
                }
                let node = &nodes[index];
                let matrix = visit(document, node, parent, &mut placements, warnings)
                    .map_err(|error| error.at(describe(node)))?;
                stack.push(Step::Leave(index));
                let children: Vec<usize> = node.children().map(|child| child.index()).collect();
                stack.extend(children.into_iter().rev().map(|child| Step::Enter(child, matrix)));
            }
        }
    }
    Ok(placements)
}

/// Nodes with two parents would be placed twice, and a chain of them without end.
fn check_parents(nodes: &[gltf::Node<'_>]) -> Result<()> {
    let mut parents = vec![None; nodes.len()];
    for node in nodes {
        for child in node.children() {
            if let Some(other) = parents[child.index()].replace(node.index()) {
                let message = format!("it is a child of node {other} and again of node {}", node.index());
                return Err(Error::input(message).at(describe(&child)).help("one parent at most"));
            }
        }
    }
    Ok(())
}

enum Step {
    Enter(usize, DMat4),
    Leave(usize),
}

fn roots(document: &Document) -> Vec<usize> {
    let scene = document.gltf.default_scene().or_else(|| document.gltf.scenes().next());
    if let Some(scene) = scene {
        return scene.nodes().map(|node| node.index()).collect();
    }
    let mut is_child = vec![false; document.gltf.nodes().len()];
    document.gltf.nodes().flat_map(|node| node.children()).for_each(|child| is_child[child.index()] = true);
    (0..is_child.len()).filter(|&index| !is_child[index]).collect()
}

fn describe(node: &gltf::Node<'_>) -> String {
    node.name().map_or_else(|| format!("node {}", node.index()), |name| format!("node {} `{name}`", node.index()))
}

fn visit<'a>(
    document: &Document,
    node: &gltf::Node<'a>,
    parent: DMat4,
    out: &mut Placements<'a>,
    warnings: &mut Vec<String>,
) -> Result<DMat4> {
    let matrix = parent * local(node)?;
    let name = node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned);
    if let Some(mesh) = node.mesh() {
        if node.skin().is_some() {
            warnings.push(format!("skin of {} is ignored: the mesh stands in its bind pose", describe(node)));
        }
        for copy in copies(document, node)? {
            out.instances.push(Instance { mesh: mesh.index(), matrix: matrix * copy, name: name.clone() });
        }
    }
    if let Some(camera) = node.camera() {
        let name = node.name().or(camera.name()).map_or_else(|| format!("camera {}", out.cameras.len()), str::to_owned);
        out.cameras.push(Placed { item: camera, matrix, name });
    }
    if let Some(light) = node.light() {
        let name = light.name().or(node.name()).map_or_else(|| format!("light {}", out.lights.len()), str::to_owned);
        out.lights.push(Placed { item: light, matrix, name });
    }
    Ok(matrix)
}

fn local(node: &gltf::Node<'_>) -> Result<DMat4> {
    let matrix = match node.transform() {
        Transform::Matrix { matrix } => DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from))),
        Transform::Decomposed { translation, rotation, scale } => compose(translation, rotation, scale),
    };
    if matrix.is_finite() {
        return Ok(matrix);
    }
    Err(Error::input("the transform is not finite").help("finite matrix, translation, rotation and scale"))
}

/// T R S in double precision. A rotation of length 0 counts as none.
fn compose(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> DMat4 {
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(
        DVec3::from(scale.map(f64::from)),
        rotation,
        DVec3::from(translation.map(f64::from)),
    )
}

/// Transforms of EXT_mesh_gpu_instancing, or the identity.
fn copies(document: &Document, node: &gltf::Node<'_>) -> Result<Vec<DMat4>> {
    const NAME: &str = "EXT_mesh_gpu_instancing";
    let Some(extension) = node.extension_value(NAME) else { return Ok(vec![DMat4::IDENTITY]) };
    let find = |key: &str| -> Result<Option<gltf::Accessor<'_>>> {
        let Some(value) = extension.get("attributes").and_then(|attributes| attributes.get(key)) else {
            return Ok(None);
        };
        let accessor = value.as_u64().and_then(|index| document.gltf.accessors().nth(usize::try_from(index).ok()?));
        accessor
            .map(Some)
            .ok_or_else(|| Error::input(format!("accessor {value} does not exist")).at(format!("{NAME}, {key}")))
    };
    let translations =
        find("TRANSLATION")?.map(|a| accessor::floats::<3>(document, &a, Dimensions::Vec3)).transpose()?;
    let rotations = find("ROTATION")?.map(|a| accessor::floats::<4>(document, &a, Dimensions::Vec4)).transpose()?;
    let scales = find("SCALE")?.map(|a| accessor::floats::<3>(document, &a, Dimensions::Vec3)).transpose()?;
    let lengths =
        [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
    let mut given = lengths.into_iter().flatten();
    let count = given.next().unwrap_or(1);
    if let Some(other) = given.find(|&other| other != count) {
        return Err(Error::input(format!("attributes of {count} and of {other} elements")).at(NAME));
    }
    let matrix = |i: usize| {
        let translation = translations.as_ref().map_or([0.0; 3], |values| values[i]);
        let rotation = rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |values| values[i]);
        compose(translation, rotation, scales.as_ref().map_or([1.0; 3], |values| values[i]))
    };
    let copies: Vec<DMat4> = (0..count).map(matrix).collect();
    match copies.iter().position(|matrix| !matrix.is_finite()) {
        Some(i) => Err(Error::input(format!("the transform of instance {i} is not finite")).at(NAME)),
        None => Ok(copies),
    }
}
