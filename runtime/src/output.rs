//! The files of a finished render: the picture as EXR, with the layers asked for, and as PNG, and the pyramids of its strategies.

use crate::error::Error;
use crate::film::Sums;
use crate::image_file::Image;
use crate::picture::{Exposure, to_srgb, write_png};
use crate::pyramid::{self, Strategy};
use crate::render::Rendered;
use crate::settings::{Aov, RenderFile};
use std::path::{Path, PathBuf};

/// Writes the files of a render; the metadata say which layers are asked for. Gives their paths.
///
/// # Errors
/// Failed, when a file cannot be written or the metadata have no TOML form.
pub fn save(
    path: &Path,
    rendered: &Rendered,
    metadata: &RenderFile,
    exposure: Exposure,
) -> Result<Vec<PathBuf>, Error> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    let strategies = strategies(rendered, metadata);
    let layers: Vec<_> = strategies.iter().flatten().flat_map(Strategy::layers).collect();
    image(rendered, metadata)?.save_with_layers(path, &layers)?;
    let factor = exposure.factor(&rendered.mean);
    let png = path.with_extension("png");
    write_png(&png, rendered.size, &to_srgb(&rendered.mean, factor))?;
    let mut written = vec![path.to_path_buf(), png];
    if let Some(strategies) = strategies {
        written.extend(pyramid::write(path, &strategies, rendered.size, factor)?);
    }
    Ok(written)
}

/// Makes a folder, unless it is there.
///
/// # Errors
/// Failed, with the path.
pub fn make_folder(folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::failed(format!("cannot make the folder: {error}")).in_file(folder))
}

fn image(rendered: &Rendered, metadata: &RenderFile) -> Result<Image, Error> {
    Ok(Image {
        size: rendered.size,
        radiance: rendered.mean.clone(),
        standard_error: rendered.standard_error.clone().filter(|_| metadata.wants(Aov::Variance)),
        fixed: match &rendered.totals.sums {
            Sums::Fixed(units) if rendered.layers.is_empty() => Some(units.clone()),
            Sums::Fixed(_) | Sums::Float(_) => None,
        },
        settings: Some(metadata.to_toml()?),
    })
}

fn strategies(rendered: &Rendered, metadata: &RenderFile) -> Option<Vec<Strategy>> {
    let group = metadata.wants(Aov::Strategies).then(|| Aov::Strategies.to_string())?;
    Some(pyramid::strategies(&|index| rendered.layer(&group, index)))
}
