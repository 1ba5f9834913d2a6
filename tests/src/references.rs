//! Images of an independent renderer, where a folder `shared` with scenes and references lies beside the repository.

use crate::mask::Mask;
use crate::rendering::{Job, read_reference};
use crate::statistics::{Estimate, Pixels, Spread, spread, z_scores};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Pixels along an edge of a block whose mean is compared.
pub const BLOCK: usize = 8;

#[derive(Deserialize)]
struct References {
    reference: Vec<Reference>,
}

/// An entry of `references.toml`.
#[derive(Clone, Debug, Deserialize)]
pub struct Reference {
    /// Its own name, that of its image.
    pub name: String,
    /// The scene that it shows.
    pub scene: String,
    /// Index of the camera.
    pub camera: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Longest path in edges.
    pub max_edges: u32,
    /// Samples per pixel in the image.
    pub spp: u32,
    /// `exact`, or `approximate` where the other renderer has no such material.
    pub materials: String,
}

/// Where the folder of scenes and references is looked for: beside the repository.
pub fn default_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared")
}

/// The folder of scenes and references, or `None`, with a message that no test runner hides in its summary.
pub fn shared() -> Option<PathBuf> {
    let folder = default_folder();
    if folder.join("references/references.toml").is_file() {
        return Some(folder);
    }
    eprintln!("SKIPPED: {} has no references; nothing is checked", folder.display());
    None
}

/// All references of the folder, in its order.
///
/// # Panics
/// When its list cannot be read.
pub fn all(shared: &Path) -> Vec<Reference> {
    let text = std::fs::read_to_string(shared.join("references/references.toml")).expect("references.toml can be read");
    let all: References = toml::from_str(&text).expect("references.toml is a list of references");
    all.reference
}

/// The reference of this name.
///
/// # Panics
/// When there is none.
pub fn reference(shared: &Path, name: &str) -> Reference {
    let found = all(shared).into_iter().find(|reference| reference.name == name);
    found.unwrap_or_else(|| panic!("no reference `{name}`"))
}

/// The file of a scene.
pub fn scene(shared: &Path, name: &str) -> PathBuf {
    shared.join(format!("scenes/{name}/{name}.glb"))
}

impl Reference {
    /// Both renderers must give the same picture, whatever it shows.
    pub fn is_exact(&self) -> bool {
        self.materials == "exact"
    }

    /// The image.
    pub fn image(&self, shared: &Path) -> Pixels {
        read_reference(&shared.join(format!("references/{}.exr", self.name)))
    }

    /// `job` with the camera, the longest path and the size of the image, over `shrink`.
    pub fn of_job(&self, job: Job, shrink: u32) -> Job {
        job.camera(&self.camera.to_string()).edges(self.max_edges).size(self.size[0] / shrink, self.size[1] / shrink)
    }

    /// A job that renders this image, over `shrink`.
    pub fn job(&self, shared: &Path, shrink: u32) -> Job {
        self.of_job(Job::of_file(scene(shared, &self.scene)), shrink)
    }
}

/// Raises standard errors to those that the reference foretells for so many times fewer samples. Where few paths find light, the
/// error that few samples see of themselves is far too small when they have missed it; the reference has not.
pub fn expect_errors(pixels: &mut Pixels, reference: &Pixels, times_fewer: u32) {
    let growth = (times_fewer as f32).sqrt();
    for (found, known) in pixels.errors.iter_mut().zip(&reference.errors) {
        *found = std::array::from_fn(|channel| found[channel].max(growth * known[channel]));
    }
}

/// How a rendering compares with its reference.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// Differences of block means over the combined standard errors, three channels a block.
    pub blocks: Spread,
    /// Mean over the scored blocks, by channel.
    pub found: [Estimate; 3],
    /// That of the reference.
    pub wanted: [Estimate; 3],
}

impl Score {
    /// Compares blocks that lie wholly within the mask; all without one. `rounding` is an error that both share, as a share of the mean.
    pub fn of(found: &Pixels, wanted: &Pixels, mask: Option<&Mask>, rounding: f64) -> Score {
        let pick = |pixels: &Pixels| scored(&pixels.block_estimates(BLOCK), mask);
        let (found, wanted) = (pick(found), pick(wanted));
        Score { blocks: spread(&z_scores(&found, &wanted, rounding)), found: means(&found), wanted: means(&wanted) }
    }

    /// Ours over theirs by channel; `None` where the reference is black.
    pub fn ratios(&self) -> [Option<f64>; 3] {
        std::array::from_fn(|c| (self.wanted[c].mean > 0.0).then(|| self.found[c].mean / self.wanted[c].mean))
    }

    /// The mean of all channels is within 0.5 % of the reference's, or within the noise. Channels count as wholly dependent.
    pub fn mean_agrees(&self) -> bool {
        let sum = |estimates: &[Estimate; 3]| Estimate {
            mean: estimates.iter().map(|estimate| estimate.mean).sum(),
            error: estimates.iter().map(|estimate| estimate.error).sum(),
        };
        let (found, wanted) = (sum(&self.found), sum(&self.wanted));
        let noise = 4.0 * (found.error.powi(2) + wanted.error.powi(2)).sqrt();
        (found.mean - wanted.mean).abs() < noise.max(0.005 * wanted.mean)
    }

    /// At most one block in 10,000 beyond 4 standard errors and none beyond 6, and the mean agrees.
    pub fn agrees(&self) -> bool {
        self.blocks.count > 0 && self.blocks.agrees() && self.mean_agrees()
    }
}

fn scored(estimates: &[Estimate], mask: Option<&Mask>) -> Vec<Estimate> {
    let Some(mask) = mask else { return estimates.to_vec() };
    let blocks = estimates.chunks_exact(3).zip(mask.blocks(BLOCK));
    blocks.filter(|(_, whole)| *whole).flat_map(|(channels, _)| channels.to_vec()).collect()
}

fn means(estimates: &[Estimate]) -> [Estimate; 3] {
    let count = (estimates.len() / 3).max(1) as f64;
    std::array::from_fn(|channel| {
        let of_channel = || estimates.iter().skip(channel).step_by(3);
        Estimate {
            mean: of_channel().map(|estimate| estimate.mean).sum::<f64>() / count,
            error: of_channel().map(|estimate| estimate.error.powi(2)).sum::<f64>().sqrt() / count,
        }
    })
}
