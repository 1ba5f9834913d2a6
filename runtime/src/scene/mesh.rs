//! One mesh primitive in the space of its mesh: an indexed triangle list with the attributes that are used.

use super::accessor;
use super::document::Document;
use super::material::Material;
use super::tangent;
use crate::error::{Error, Result};
use gltf::Semantic;
use gltf::accessor::{Accessor, Dimensions};
use gltf::mesh::Mode;

/// A primitive as an indexed triangle list.
#[derive(Default)]
pub struct Primitive {
    /// Three vertex indices per triangle, front face anticlockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Positions, finite.
    pub positions: Vec<[f32; 3]>,
    /// Normals as written in the file: any length.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates of the (at most two) sets that the material uses.
    pub uvs: [Option<Vec<[f32; 2]>>; 2],
    /// Linear RGBA.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Tangent and bitangent sign of every triangle corner; only where the material has a normal map.
    pub tangents: Option<Vec<[[f32; 4]; 3]>>,
    /// Index into the scene's materials.
    pub material: usize,
}

/// Decodes a primitive; `None` for points, lines and primitives without a triangle.
///
/// # Errors
/// Accessors that do not fit, indices that name no vertex, positions that are not finite.
pub fn read(
    document: &Document,
    primitive: &gltf::Primitive<'_>,
    material: (usize, &Material),
    warnings: &mut Vec<String>,
) -> Result<Option<Primitive>> {
    let position = primitive.get(&Semantic::Positions).ok_or_else(|| Error::input("no POSITION"))?;
    if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        warnings.push("points and lines are ignored".into());
        return Ok(None);
    }
    if primitive.morph_targets().next().is_some() {
        warnings.push("morph targets are ignored".into());
    }
    let positions =
        accessor::floats::<3>(document, &position, Dimensions::Vec3).map_err(|error| error.at("POSITION"))?;
    check_finite(&positions, &position)?;
    let corners = match primitive.indices() {
        Some(indices) => accessor::indices(document, &indices).map_err(|error| error.at("indices"))?,
        None => (0..positions.len() as u32).collect(),
    };
    check_indices(&corners, positions.len(), primitive.indices())?;
    let triangles = triangles(primitive.mode(), &corners);
    if triangles.is_empty() {
        return Ok(None);
    }
    let (index, material) = material;
    let mut out = Primitive { triangles, positions, material: index, ..Primitive::default() };
    let attributes = Attributes { document, primitive, count: out.positions.len() };
    out.normals = attributes.floats(Semantic::Normals, Dimensions::Vec3, [0.0; 3], warnings)?;
    for (slot, set) in material.uv_sets.iter().enumerate() {
        out.uvs[slot] = attributes.floats(Semantic::TexCoords(*set), Dimensions::Vec2, [0.0; 2], warnings)?;
    }
    out.colors = attributes.colors(warnings)?;
    if let Some(set) = material.normal_map_set() {
        let given = attributes.floats(Semantic::Tangents, Dimensions::Vec4, [0.0; 4], warnings)?;
        let given = given.filter(|_| out.normals.is_some());
        out.tangents = Some(match given {
            Some(given) => out.triangles.iter().map(|corners| corners.map(|i| given[i as usize])).collect(),
            None => tangent::compute(&out, set),
        });
    }
    Ok(Some(out))
}

fn check_finite(positions: &[[f32; 3]], accessor: &Accessor<'_>) -> Result<()> {
    let Some(index) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) else { return Ok(()) };
    let message = format!("vertex {index} is {:?}", positions[index]);
    Err(Error::input(message).at(format!("POSITION, accessor {}", accessor.index())).help("finite coordinates"))
}

fn check_indices(corners: &[u32], vertices: usize, accessor: Option<Accessor<'_>>) -> Result<()> {
    let Some(place) = corners.iter().position(|&i| i as usize >= vertices) else { return Ok(()) };
    let at = accessor.map_or(String::from("indices"), |accessor| format!("indices, accessor {}", accessor.index()));
    Err(Error::input(format!("index {place} is {}, the primitive has {vertices} vertices", corners[place])).at(at))
}

/// Triangles of a list, strip or fan, in the order and winding of the glTF specification (section 3.7.2.1).
fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        Mode::TriangleStrip => {
            let turned = |(i, c): (usize, &[u32])| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] };
            corners.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => {
            let fan = corners.get(1..).unwrap_or(&[]);
            fan.windows(2).map(|c| [c[0], c[1], corners[0]]).collect()
        }
        _ => Vec::new(),
    }
}

/// Reads the optional attributes of a primitive.
struct Attributes<'a> {
    document: &'a Document,
    primitive: &'a gltf::Primitive<'a>,
    count: usize,
}

impl Attributes<'_> {
    /// One attribute, with elements that are not finite replaced.
    fn floats<const N: usize>(
        &self,
        semantic: Semantic,
        dimensions: Dimensions,
        neutral: [f32; N],
        warnings: &mut Vec<String>,
    ) -> Result<Option<Vec<[f32; N]>>> {
        let Some(accessor) = self.primitive.get(&semantic) else { return Ok(None) };
        let name = semantic.to_string();
        let mut values =
            accessor::floats::<N>(self.document, &accessor, dimensions).map_err(|error| error.at(&name))?;
        if values.len() != self.count {
            let message = format!("{} elements, POSITION has {}", values.len(), self.count);
            return Err(Error::input(message).at(format!("{name}, accessor {}", accessor.index())));
        }
        let mut replaced = 0usize;
        for value in values.iter_mut().filter(|value| !value.iter().all(|c| c.is_finite())) {
            *value = neutral;
            replaced += 1;
        }
        if replaced > 0 {
            warnings.push(format!(
                "{replaced} elements of {name} (accessor {}) are not finite and count as {neutral:?}",
                accessor.index()
            ));
        }
        Ok(Some(values))
    }

    /// Vertex colours, RGB or RGBA, never negative.
    fn colors(&self, warnings: &mut Vec<String>) -> Result<Option<Vec<[f32; 4]>>> {
        let semantic = Semantic::Colors(0);
        let values = match self.primitive.get(&semantic).map(|accessor| accessor.dimensions()) {
            Some(Dimensions::Vec3) => self
                .floats(semantic, Dimensions::Vec3, [1.0; 3], warnings)?
                .map(|rgb| rgb.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect::<Vec<_>>()),
            Some(_) => self.floats(semantic, Dimensions::Vec4, [1.0; 4], warnings)?,
            None => None,
        };
        Ok(values.map(|values| values.into_iter().map(|color| color.map(|c| c.max(0.0))).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_winding_of_their_first_triangle() {
        assert_eq!(triangles(Mode::TriangleStrip, &[0, 1, 2, 3, 4]), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(Mode::TriangleFan, &[0, 1, 2, 3]), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(Mode::Triangles, &[0, 1, 2, 3]), [[0, 1, 2]]);
        assert!(triangles(Mode::TriangleFan, &[]).is_empty());
    }
}
