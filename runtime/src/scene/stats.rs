//! What `pathloom info --scene` tells about a scene.

use super::light::Shape;
use super::{Accelerator, BuildPreset, Scene};
use kernelgen::config::model::Effects;
use serde::Serialize;
use std::path::PathBuf;

/// Numbers about a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Stats {
    /// The glTF file.
    pub file: PathBuf,
    /// The sky's file.
    pub sky: Option<PathBuf>,
    /// Triangles that rays can hit.
    pub triangles: usize,
    /// Triangles left out for having no area.
    pub dropped: usize,
    /// Centre of the sphere around the scene in the file's coordinates, m.
    pub centre: [f64; 3],
    /// Its radius, m.
    pub radius: f64,
    /// What was subtracted from all coordinates, m.
    pub moved_by: [f64; 3],
    /// Materials in use.
    pub materials: usize,
    /// Images in use.
    pub images: usize,
    /// Their texels.
    pub texels: usize,
    /// Lights by kind.
    pub lights: LightCounts,
    /// All cameras of the file; the place is the index.
    pub cameras: Vec<String>,
    /// The chosen one.
    pub camera: String,
    /// Image width and height, pixels.
    pub size: (u32, u32),
    /// Vertical field of view, degrees.
    pub yfov_deg: f64,
    /// The hierarchy.
    pub bvh: BvhStats,
    /// Bytes of all resources.
    pub bytes: usize,
    /// Which effects it calls for, and why.
    pub effects: Effects,
    /// What was ignored, replaced or left out.
    pub warnings: Vec<String>,
}

/// Lights by kind.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct LightCounts {
    /// Emissive triangles.
    pub triangles: usize,
    /// Point lights.
    pub point: usize,
    /// Spot lights.
    pub spot: usize,
    /// Directional lights.
    pub directional: usize,
    /// 1 if there is a sky.
    pub sky: usize,
}

/// The hierarchy.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BvhStats {
    /// Which one.
    pub accelerator: Accelerator,
    /// Built with what effort.
    pub build: BuildPreset,
    /// Nodes.
    pub nodes: usize,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
}

/// The numbers of a scene.
pub fn of(scene: &Scene) -> Stats {
    let bvh = scene.bvh();
    let bytes = super::RESOURCES.iter().filter_map(|name| scene.resource(name)).map(|bytes| bytes.len()).sum();
    Stats {
        file: scene.file.clone(),
        sky: scene.sky_file.clone(),
        triangles: scene.triangles.len(),
        dropped: scene.dropped,
        centre: (scene.bounds.0 + scene.moved_by).to_array(),
        radius: scene.bounds.1,
        moved_by: scene.moved_by.to_array(),
        materials: scene.materials.len(),
        images: scene.images.len(),
        texels: scene.images.iter().map(|image| image.texels.len()).sum(),
        lights: light_counts(scene),
        cameras: scene.camera_names.clone(),
        camera: scene.camera.name.clone(),
        size: scene.camera.size,
        yfov_deg: scene.camera.yfov.to_degrees(),
        bvh: BvhStats { accelerator: scene.accelerator, build: scene.build, nodes: bvh.nodes, depth: bvh.depth },
        bytes,
        effects: scene.effects.clone(),
        warnings: scene.warnings.clone(),
    }
}

fn light_counts(scene: &Scene) -> LightCounts {
    let mut counts = LightCounts::default();
    for light in &scene.lights.list {
        *match light.shape {
            Shape::Triangle { .. } => &mut counts.triangles,
            Shape::Point { .. } => &mut counts.point,
            Shape::Spot { .. } => &mut counts.spot,
            Shape::Directional { .. } => &mut counts.directional,
            Shape::Sky => &mut counts.sky,
        } += 1;
    }
    counts
}
