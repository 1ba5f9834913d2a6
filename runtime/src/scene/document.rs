//! A glTF file as text and bytes: container, JSON, extensions, buffers. Nothing is interpreted here.

use super::uri;
use crate::error::{Error, Result};
use gltf::json;
use gltf::json::validation::Checked;
use std::path::{Path, PathBuf};

/// Extensions whose data is used.
const SUPPORTED: [&str; 10] = [
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// A validated document with its buffers.
pub struct Document {
    /// The validated JSON.
    pub gltf: gltf::Document,
    /// Bytes of every buffer.
    pub buffers: Vec<Vec<u8>>,
    /// Folder that relative URIs start at.
    pub base: PathBuf,
}

/// Reads a `.glb` or `.gltf` file with its buffers.
///
/// # Errors
/// Names what is malformed, missing or unsupported.
pub fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Document> {
    let bytes = std::fs::read(path).map_err(|error| Error::input(format!("cannot read the file: {error}")))?;
    let (text, blob) = split(&bytes)?;
    let mut root =
        json::Root::from_slice(text).map_err(|error| Error::input(format!("the JSON is not glTF 2.0: {error}")))?;
    check_version(&root)?;
    check_extensions(&mut root, warnings)?;
    complete(&mut root);
    check_unions(&root)?;
    let gltf = gltf::Document::from_json(root).map_err(invalid)?;
    let base = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let buffers = gltf.buffers().map(|buffer| read_buffer(&buffer, blob, &base)).collect::<Result<_>>()?;
    Ok(Document { gltf, buffers, base })
}

/// JSON text and binary chunk of a file.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    if bytes.starts_with(b"glTF") {
        return split_glb(bytes);
    }
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    match text.iter().find(|c| !c.is_ascii_whitespace()) {
        Some(b'{') => Ok((text, None)),
        Some(_) => Err(Error::input(format!("not a glTF file: it starts with {:02x?}", &bytes[..bytes.len().min(4)]))
            .help("a .glb (magic `glTF`) or a .gltf (JSON) file")),
        None => Err(Error::input("the file is empty")),
    }
}

fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let truncated = || Error::input(format!("truncated GLB: it ends after {} bytes", bytes.len()));
    let version = word(4).ok_or_else(truncated)?;
    if version != 2 {
        return Err(Error::input(format!("GLB container version {version}")).help("version 2"));
    }
    let total = word(8).ok_or_else(truncated)? as usize;
    if total > bytes.len() {
        return Err(Error::input(format!(
            "truncated GLB: the header promises {total} bytes, the file has {}",
            bytes.len()
        )));
    }
    let (mut text, mut blob, mut at) = (None, None, 12);
    while at + 8 <= total {
        let length = word(at).ok_or_else(truncated)? as usize;
        let kind = word(at + 4).ok_or_else(truncated)?;
        let chunk = bytes.get(at + 8..(at + 8).saturating_add(length)).ok_or_else(truncated)?;
        match kind.to_le_bytes().as_slice() {
            b"JSON" if text.is_none() => text = Some(chunk),
            b"BIN\0" if blob.is_none() => blob = Some(chunk),
            _ => {}
        }
        at += 8 + length;
    }
    Ok((text.ok_or_else(|| Error::input("GLB without a JSON chunk"))?, blob))
}

fn check_version(root: &json::Root) -> Result<()> {
    let version = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
    if version.starts_with("2.") {
        return Ok(());
    }
    Err(Error::input(format!("glTF version `{version}`")).at("asset").help("version 2.x"))
}

fn check_extensions(root: &mut json::Root, warnings: &mut Vec<String>) -> Result<()> {
    let unsupported = |name: &&String| !SUPPORTED.contains(&name.as_str());
    if let Some(name) = root.extensions_required.iter().find(unsupported) {
        return Err(Error::input(format!("the file requires the extension `{name}`, which is not supported"))
            .at("extensionsRequired")
            .help(format!("supported: {}", SUPPORTED.join(", "))));
    }
    warnings
        .extend(root.extensions_used.iter().filter(unsupported).map(|name| format!("extension `{name}` is ignored")));
    // The library would refuse names that it does not read itself; ours are checked above.
    root.extensions_required.clear();
    Ok(())
}

/// Adds what the specification demands and nothing here needs: without it the library refuses files that are fine otherwise.
fn complete(root: &mut json::Root) {
    for image in root.images.iter_mut().filter(|image| image.buffer_view.is_some()) {
        // The format is told by the bytes.
        image.mime_type.get_or_insert_with(|| json::image::MimeType(String::new()));
    }
    let positions: Vec<_> = root
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .filter_map(|primitive| primitive.attributes.get(&Checked::Valid(json::mesh::Semantic::Positions)))
        .map(json::Index::value)
        .collect();
    for index in positions {
        if let Some(accessor) = root.accessors.get_mut(index) {
            accessor.min.get_or_insert_with(|| vec![0.0; 3].into());
            accessor.max.get_or_insert_with(|| vec![0.0; 3].into());
        }
    }
}

/// Checks what the library takes for granted when it hands out cameras, attributes, images and lights.
fn check_unions(root: &json::Root) -> Result<()> {
    for (index, camera) in root.cameras.iter().enumerate() {
        let present = match camera.type_ {
            Checked::Valid(json::camera::Type::Perspective) => camera.perspective.is_some(),
            Checked::Valid(json::camera::Type::Orthographic) => camera.orthographic.is_some(),
            Checked::Invalid => false,
        };
        if !present {
            return Err(
                Error::input("`type` is unknown, or the object it names is missing").at(format!("camera {index}"))
            );
        }
    }
    for (index, mesh) in root.meshes.iter().enumerate() {
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let position = primitive.attributes.get(&Checked::Valid(json::mesh::Semantic::Positions));
            if position.is_none_or(|accessor| accessor.value() >= root.accessors.len()) {
                return Err(Error::input("no POSITION, or its accessor does not exist")
                    .at(format!("mesh {index}, primitive {number}")));
            }
        }
    }
    if let Some(index) = root.images.iter().position(|image| image.buffer_view.is_none() && image.uri.is_none()) {
        return Err(Error::input("neither `uri` nor `bufferView`").at(format!("image {index}")).help("one of the two"));
    }
    let lights = root.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    let lights = lights.map_or(&[][..], |extension| &extension.lights);
    for (index, light) in lights.iter().enumerate() {
        use json::extensions::scene::khr_lights_punctual::Type;
        let at = || format!("light {index}");
        match light.type_ {
            Checked::Invalid => return Err(Error::input("unknown `type`").at(at()).help("point, spot or directional")),
            Checked::Valid(Type::Spot) if light.spot.is_none() => {
                return Err(Error::input("`spot` is missing").at(at()));
            }
            Checked::Valid(_) => {}
        }
    }
    for (index, node) in root.nodes.iter().enumerate() {
        let light = node.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        if let Some(light) = light.filter(|light| light.light.value() >= lights.len()) {
            let message = format!("light {} does not exist, the file has {}", light.light.value(), lights.len());
            return Err(Error::input(message).at(format!("node {index}")));
        }
    }
    Ok(())
}

fn invalid(error: gltf::Error) -> Error {
    let gltf::Error::Validation(findings) = error else { return Error::input(error.to_string()) };
    let Some((path, finding)) = findings.first() else { return Error::input("invalid glTF") };
    let others = findings.len() - 1;
    let more = if others == 0 { String::new() } else { format!(" (and {others} more)") };
    Error::input(format!("{finding}{more}")).at(path)
}

fn read_buffer(buffer: &gltf::Buffer<'_>, blob: Option<&[u8]>, base: &Path) -> Result<Vec<u8>> {
    let at = || format!("buffer {}", buffer.index());
    let bytes = match buffer.source() {
        gltf::buffer::Source::Bin => {
            blob.ok_or_else(|| Error::input("it has no URI and the file has no BIN chunk").at(at()))?.to_vec()
        }
        gltf::buffer::Source::Uri(uri) => uri::read(uri, base).map_err(|error| error.at(at()))?,
    };
    if bytes.len() < buffer.length() {
        let message = format!("byteLength is {}, only {} bytes are there", buffer.length(), bytes.len());
        return Err(Error::input(message).at(at()));
    }
    Ok(bytes)
}
