//! Reads a glTF scene and turns it into the tables that the kernels read.
//!
//! World space is right-handed with +Y up, in metres. Everything is computed in f64 and rounded once. All instances are
//! flattened to world-space triangles. Loading is deterministic: equal files give equal bytes.

mod accessor;
mod alias;
mod blue_noise;
mod bvh;
mod camera;
mod document;
mod emission;
mod feature;
mod light;
mod material;
mod mesh;
mod node;
mod pack;
mod sky;
mod source;
mod stats;
mod tangent;
#[cfg(test)]
mod tests;
mod texture;
mod triangle;
mod uri;

pub use bvh::{Accelerator, BuildPreset};
pub use pack::RESOURCES;
pub use stats::Stats;

use crate::error::{Error, Result};
use bvh::Bvh;
use camera::Camera;
use emission::Emission;
use glam::DVec3;
use kernelgen::config::model::Effects;
use light::Lights;
use material::Material;
use sky::Sky;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use texture::{Collector, Image};
use triangle::{Meshes, Triangle};

/// What the user chooses about a scene.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Sky picture (.exr or .hdr, equirectangular); instead of the one that `scene.toml` names.
    pub env: Option<PathBuf>,
    /// Factor on the sky's radiance; instead of the one in `scene.toml`, else 1.
    pub env_scale: Option<f64>,
    /// Turn of the sky about +Y, degrees; instead of the one in `scene.toml`, else 0.
    pub env_rotate_deg: Option<f64>,
    /// Name or index of the camera; the first one if not given. Cameras count depth-first in document order.
    pub camera: Option<String>,
    /// Image width and height, pixels; else the longer side has 512 and the camera gives the aspect. The vertical field of view stays.
    pub size: Option<(u32, u32)>,
    /// Radius of the lens, m; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus, m; the centre of the scene if not given.
    pub focus_distance: Option<f32>,
    /// Effort of building the hierarchy.
    pub build: BuildPreset,
    /// Which hierarchy is built.
    pub accelerator: Accelerator,
}

/// The lens of the camera.
#[derive(Clone, Copy, Debug)]
struct Lens {
    /// m; 0 is a pinhole.
    radius: f32,
    /// m; 1 for a pinhole.
    focus_distance: f32,
}

/// A loaded scene.
pub struct Scene {
    /// Which effects it calls for, and why.
    pub effects: Effects,
    /// What was ignored, replaced or left out.
    pub warnings: Vec<String>,
    file: PathBuf,
    sky_file: Option<PathBuf>,
    accelerator: Accelerator,
    build: BuildPreset,
    /// In document order.
    triangles: Vec<Triangle>,
    dropped: usize,
    moved_by: DVec3,
    /// Centre and radius of a sphere around all triangles, after moving.
    bounds: (DVec3, f64),
    materials: Vec<Material>,
    images: Vec<Image>,
    lights: Lights,
    sky: Option<Sky>,
    camera: Camera,
    camera_names: Vec<String>,
    lens: Lens,
    /// Built when first asked for.
    bvh: OnceLock<Bvh>,
    packed: pack::Packed,
}

/// Loads a `.glb` or `.gltf` file, or the scene that the `scene.toml` in a folder describes.
/// The sky of a `scene.toml` beside the file is used when that names the file.
///
/// # Errors
/// User input: what is missing, malformed or unsupported, with the file and the place in it.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let source = source::resolve(path, options)?;
    read(&source, options).map_err(|error| error.in_file(&source.file))
}

fn read(source: &source::Source, options: &LoadOptions) -> Result<Scene> {
    let mut warnings = Vec::new();
    let document = document::read(&source.file, &mut warnings)?;
    let placements = node::place(&document, &mut warnings)?;
    let mut textures = Collector::default();
    let (meshes, materials) = meshes(&document, &placements.instances, &mut textures, &mut warnings)?;
    let images = textures.decode(&document)?;
    check_texels(&images)?;
    check_media(&materials)?;
    let geometry = triangle::flatten(&placements.instances, &meshes, &materials, &images)?;
    if geometry.dropped > 0 {
        warnings.push(format!("{} triangles without area are left out", geometry.dropped));
    }
    let vertex_colors = meshes.values().flatten().any(|primitive| primitive.colors.is_some());
    drop(meshes);
    let triangles = geometry.triangles;
    let bounds = bounding_sphere(&triangles);
    let sky = match &source.sky {
        Some(sky) => sky::read(&sky.file, sky.scale, sky.rotate_deg, &mut warnings)?,
        None => None,
    };
    let camera = camera::choose(
        &placements.cameras,
        options.camera.as_deref(),
        options.size,
        (bounds.0 + geometry.moved_by, bounds.1),
    )?;
    let lens = lens(&camera, options, bounds.0 + geometry.moved_by)?;
    let emission = Emission::new(&materials, &images);
    let lights = light::collect(
        &triangles,
        &emission,
        &placements.lights,
        geometry.moved_by,
        sky.as_ref(),
        bounds.1,
        &mut warnings,
    )?;
    if lights.list.is_empty() {
        warnings.push("the scene has no light: pictures of it are black".into());
    }
    let evidence = feature::Evidence {
        materials: &materials,
        images: &images,
        triangles: &triangles,
        lights: &lights,
        vertex_colors,
        lens_radius: lens.radius,
    };
    let effects = feature::effects(&evidence);
    let mut seen = std::collections::BTreeSet::new();
    warnings.retain(|warning| seen.insert(warning.clone()));
    Ok(Scene {
        effects,
        warnings,
        file: source.file.clone(),
        sky_file: source.sky.as_ref().map(|sky| sky.file.clone()),
        accelerator: options.accelerator,
        build: options.build,
        triangles,
        dropped: geometry.dropped,
        moved_by: geometry.moved_by,
        bounds,
        materials,
        images,
        lights,
        sky,
        camera,
        camera_names: placements.cameras.into_iter().map(|camera| camera.name).collect(),
        lens,
        bvh: OnceLock::new(),
        packed: pack::Packed::default(),
    })
}

/// Decodes the meshes that are placed, and the materials that they use.
fn meshes(
    document: &document::Document,
    instances: &[node::Instance],
    textures: &mut Collector,
    warnings: &mut Vec<String>,
) -> Result<(Meshes, Vec<Material>)> {
    let mut materials: Vec<Material> = Vec::new();
    let mut places: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    let mut meshes = Meshes::new();
    let used: std::collections::BTreeSet<usize> = instances.iter().map(|instance| instance.mesh).collect();
    for mesh in document.gltf.meshes().filter(|mesh| used.contains(&mesh.index())) {
        let mut primitives = Vec::new();
        for primitive in mesh.primitives() {
            let source = primitive.material();
            let place = match places.get(&source.index()) {
                Some(&place) => place,
                None => {
                    materials.push(material::read(&source, textures, warnings)?);
                    places.insert(source.index(), materials.len() - 1);
                    materials.len() - 1
                }
            };
            let at = |error: Error| {
                let name = mesh.name().map_or(String::new(), |name| format!(" `{name}`"));
                error.at(format!("mesh {}{name}, primitive {}", mesh.index(), primitive.index()))
            };
            primitives.extend(mesh::read(document, &primitive, (place, &materials[place]), warnings).map_err(at)?);
        }
        meshes.insert(mesh.index(), primitives);
    }
    Ok((meshes, materials))
}

/// Walks keep the number of the medium that they are in, in 8 bits.
const MOST_MEDIA: usize = 255;

fn check_media(materials: &[Material]) -> Result<()> {
    let absorbing = materials.iter().filter(|material| material.absorbs());
    let Some(surplus) = absorbing.clone().nth(MOST_MEDIA) else { return Ok(()) };
    let message = format!(
        "{} materials absorb light inside of solids; {} is the first too many",
        absorbing.count(),
        surplus.name
    );
    Err(Error::input(message)
        .help(format!("at most {MOST_MEDIA} with an `attenuationDistance`: merge those that are equal")))
}

/// Texels are addressed with 32 bits.
fn check_texels(images: &[Image]) -> Result<()> {
    let texels: usize = images.iter().map(|image| image.texels.len()).sum();
    if u32::try_from(texels).is_ok() {
        return Ok(());
    }
    Err(Error::input(format!("the textures have {texels} texels")).help(format!("at most {}", u32::MAX)))
}

/// Centre of the bounding box, and the radius of the sphere around it that holds every corner, rounded up.
fn bounding_sphere(triangles: &[Triangle]) -> (DVec3, f64) {
    /// Keeps corners inside after the radius is rounded to f32.
    const MARGIN: f64 = 1.0 + 1e-5;
    let corners = || triangles.iter().flat_map(|triangle| triangle.positions).map(|corner| corner.as_dvec3());
    let (low, high) = corners()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| (low.min(corner), high.max(corner)));
    if triangles.is_empty() {
        return (DVec3::ZERO, 1.0);
    }
    let centre = (low + high) / 2.0;
    let squared = corners().map(|corner| corner.distance_squared(centre)).fold(0.0, f64::max);
    (centre, squared.sqrt() * MARGIN)
}

fn lens(camera: &Camera, options: &LoadOptions, centre: DVec3) -> Result<Lens> {
    let radius = options.lens_radius;
    if !(radius.is_finite() && radius >= 0.0) {
        return Err(Error::input(format!("lens radius {radius}")).help("0 or more metres"));
    }
    if radius == 0.0 {
        return Ok(Lens { radius, focus_distance: 1.0 });
    }
    let focus_distance = options.focus_distance.unwrap_or_else(|| (centre - camera.origin).dot(camera.axes[2]) as f32);
    if focus_distance.is_finite() && focus_distance > 0.0 {
        return Ok(Lens { radius, focus_distance });
    }
    Err(Error::input(format!("focus distance {focus_distance}")).help("more than 0 metres"))
}

impl Scene {
    /// The bytes of a resource by its WGSL name, at least 16. `None` for unknown names, and for the hierarchy that
    /// [`LoadOptions::accelerator`] does not ask for or the kernels cannot traverse. The hierarchy is built and each table packed when first asked for.
    pub fn resource(&self, name: &str) -> Option<&[u8]> {
        pack::resource(self, name)
    }

    /// Chooses the hierarchy, which is built if it is not there yet: a scene is loaded before it is known which one its kernels read.
    ///
    /// # Errors
    /// User input: the hierarchy has more levels than the kernels can traverse. It is then no resource of this scene.
    pub fn set_accelerator(&mut self, accelerator: Accelerator) -> Result<()> {
        if self.accelerator != accelerator {
            self.accelerator = accelerator;
            self.bvh = OnceLock::new();
            self.packed = pack::Packed::default();
        }
        let (levels, most) = (self.bvh().depth, accelerator.most_levels());
        if levels <= most {
            return Ok(());
        }
        let message = format!("the hierarchy over its triangles has {levels} levels, the kernels traverse {most}");
        Err(Error::input(message)
            .in_file(&self.file)
            .help("another `--build` preset, or triangles whose sizes differ less"))
    }

    /// Image width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.camera.size
    }

    /// Triangles that rays can hit.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Triangles of the file that were left out, having no area.
    pub fn dropped_count(&self) -> usize {
        self.dropped
    }

    /// Numbers about the scene; builds the hierarchy.
    pub fn stats(&self) -> Stats {
        stats::of(self)
    }

    fn bvh(&self) -> &Bvh {
        self.bvh.get_or_init(|| {
            let corners: Vec<[glam::Vec3; 3]> = self.triangles.iter().map(|triangle| triangle.positions).collect();
            bvh::build(&corners, self.accelerator, self.build)
        })
    }
}
