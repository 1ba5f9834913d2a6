//! What the renderer of the references does otherwise than this one, as edits of stages and scenes. With them this renderer must give
//! its pictures; without them the pictures differ, and these are the reasons.
//!
//! Sources are the code of Mitsuba 3.9.1 and of the script that gave it the scenes. They concern eye walks: light walks are not edited.

mod converter;
mod holes;
mod lights;
mod materials;
mod normals;

use crate::glb;
use crate::references::{Reference, scene};
use crate::rendering::{BuiltScene, Job};
use std::path::Path;

/// A change of a module: `old`, which stands in it once, is what this renderer does, `new` what the other one does.
#[derive(Clone, Copy, Debug)]
struct Edit {
    module: &'static str,
    old: &'static str,
    new: &'static str,
}

/// A scene as the script converts it for the other renderer.
///
/// # Panics
/// When its files cannot be read.
pub fn converted(shared: &Path, reference: &Reference) -> BuiltScene {
    let file = scene(shared, &reference.scene);
    let bytes = std::fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let (mut document, buffer) = glb::parts(&bytes);
    converter::convert(&mut document);
    BuiltScene::of_glb(&glb::file(&document, &buffer), description(&file))
}

/// The `scene.toml` beside a scene, for a copy that lies elsewhere.
fn description(file: &Path) -> Option<String> {
    let folder = std::path::absolute(file.parent()?).ok()?;
    let text = std::fs::read_to_string(folder.join("scene.toml")).ok()?;
    let mut table: toml::Table = text.parse().expect("scene.toml is TOML");
    table.insert("file".into(), BuiltScene::FILE.into());
    if let Some(sky) = table.get_mut("env").and_then(|env| env.get_mut("file")) {
        let place = folder.join(sky.as_str().expect("the sky is a file"));
        *sky = place.to_str().expect("the sky's name is text").into();
    }
    Some(table.to_string())
}

/// The job of a reference with all edits of stages, on a scene of `converted`.
pub fn job(scene: &BuiltScene, reference: &Reference) -> Job {
    edited(reference.of_job(scene.job(), 1))
}

/// A job with all edits of stages.
pub fn edited(job: Job) -> Job {
    let edits = [lights::EDITS, materials::EDITS, normals::EDITS, holes::EDITS].concat();
    edits.iter().fold(job, |job, edit| job.edited(edit.module, edit.old, edit.new))
}
