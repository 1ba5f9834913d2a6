//! Which pixels see nothing but surfaces that are Lambertian in this renderer and in the references' alike.

use crate::probe::{self, ONE, broken};
use crate::rendering::Job;

const PROBE: &str = include_str!("../wgsl/probe_lambert.wgsl");
/// Rays through a pixel: all of them must see such a surface.
const RAYS: u32 = 16;

/// A mark on every pixel.
#[derive(Clone, Debug)]
pub struct Mask {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub inside: Vec<bool>,
}

impl Mask {
    /// Casts rays from the camera of the job, whose stages are replaced: what they say of materials has no part in it.
    #[track_caller]
    pub fn of(job: &Job) -> Mask {
        let mut library = probe::library(&[("stage/probe_lambert", PROBE)], "see_lambert");
        // Leaves and lenses count where their holes are, too.
        let passing = "return hash_opacity(key, prim) < opacity_at(prim, material, barycentric);";
        broken(&mut library, "trace/opacity", passing, "return true;");
        let rendering = job.clone().library(library).pipeline("probe").samples(RAYS).fixed_point().render();
        let all = i64::from(RAYS) * ONE;
        Mask {
            width: rendering.pixels.width,
            height: rendering.pixels.height,
            inside: rendering.sums.chunks_exact(3).map(|sums| sums[0] == all).collect(),
        }
    }

    /// Which blocks of `size` pixels, row by row, lie wholly inside.
    pub fn blocks(&self, size: usize) -> Vec<bool> {
        let columns = self.width.div_ceil(size);
        let mut blocks = vec![true; columns * self.height.div_ceil(size)];
        for (pixel, &inside) in self.inside.iter().enumerate() {
            let (x, y) = (pixel % self.width, pixel / self.width);
            blocks[(y / size) * columns + x / size] &= inside;
        }
        blocks
    }
}
