//! The film between passes: every batch of samples is moved from the film to wide sums, and its deviation from the mean so far is
//! kept, which gives standard errors without reading anything back.

use crate::buffers::create;
use crate::device::Gpu;
use crate::error::Error;
use crate::tallies::Tallied;
use bytemuck::{Pod, Zeroable};
use kernelgen::config::model::Accumulate;
use kernelgen::plan::Layers;
use std::ops::Range;
use wgpu::BufferUsages;

/// One unit of a fixed-point film.
pub const FIXED_UNIT: f64 = 1.0 / 16_777_216.0;
const WORKGROUP: u32 = 64;
const WIDEST: u32 = 65_535;

/// What has been accumulated: plane by plane, three channels a pixel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Totals {
    /// Samples per pixel.
    pub samples: u32,
    /// Batches they came in.
    pub batches: u32,
    /// Sums of radiance.
    pub sums: Sums,
    /// For every sum: the sum over batches of n_b (m_b - m)^2, where n_b and m_b are a batch's samples and mean; `None` when unknown.
    pub spread: Option<Vec<f32>>,
    /// How much of each plane goes into the picture: all of the first, see `shares` of the others.
    pub shares: Vec<f64>,
    /// What the paths counted, where stages count.
    pub tallied: Option<Tallied>,
}

/// Sums of radiance over all samples.
#[derive(Clone, Debug, PartialEq)]
pub enum Sums {
    /// Of a floating-point film.
    Float(Vec<f64>),
    /// Of a fixed-point film, in units of 2^-24: exact.
    Fixed(Vec<i64>),
}

impl Sums {
    /// The sums as numbers.
    pub fn values(&self) -> Vec<f64> {
        self.values_of(0..self.len())
    }

    fn values_of(&self, words: Range<usize>) -> Vec<f64> {
        match self {
            Sums::Float(values) => values[words].to_vec(),
            Sums::Fixed(units) => units[words].iter().map(|&unit| unit as f64 * FIXED_UNIT).collect(),
        }
    }

    fn len(&self) -> usize {
        match self {
            Sums::Float(values) => values.len(),
            Sums::Fixed(units) => units.len(),
        }
    }
}

impl Totals {
    /// Mean radiance of the picture, W m^-2 sr^-1: the first plane and the shares of the others.
    pub fn mean(&self) -> Vec<f32> {
        self.means(&self.picture_sums())
    }

    /// Standard error of the mean; `None` before the second batch.
    ///
    /// With batches of n_b samples each, sum n_b (m_b - m)^2 / (B - 1) estimates the variance of one sample. Planes are taken as
    /// independent of each other: their covariances are left out.
    pub fn standard_error(&self) -> Option<Vec<f32>> {
        let spread = self.spread.as_ref()?;
        let squares = self.added(|plane, share| {
            let values = spread[self.words_of(plane)].iter();
            values.map(|&value| share * share * f64::from(value)).collect()
        });
        self.errors(&squares)
    }

    /// Mean of a plane, by its number, as it was added up: without its share in the picture.
    pub fn plane_mean(&self, plane: usize) -> Vec<f32> {
        self.means(&self.sums.values_of(self.words_of(plane)))
    }

    /// Standard error of the mean of a plane; `None` before the second batch.
    pub fn plane_standard_error(&self, plane: usize) -> Option<Vec<f32>> {
        let squares: Vec<f64> = self.spread.as_ref()?[self.words_of(plane)].iter().copied().map(f64::from).collect();
        self.errors(&squares)
    }

    fn picture_sums(&self) -> Vec<f64> {
        self.added(|plane, share| {
            let mut values = self.sums.values_of(self.words_of(plane));
            values.iter_mut().for_each(|value| *value *= share);
            values
        })
    }

    /// Adds up something of every plane that has a share in the picture.
    fn added(&self, values: impl Fn(usize, f64) -> Vec<f64>) -> Vec<f64> {
        let mut added = values(0, self.shares[0]);
        for (plane, &share) in self.shares.iter().enumerate().skip(1).filter(|(_, share)| **share != 0.0) {
            for (sum, value) in added.iter_mut().zip(values(plane, share)) {
                *sum += value;
            }
        }
        added
    }

    fn means(&self, sums: &[f64]) -> Vec<f32> {
        let samples = f64::from(self.samples.max(1));
        sums.iter().map(|sum| (sum / samples) as f32).collect()
    }

    fn errors(&self, squares: &[f64]) -> Option<Vec<f32>> {
        let scale = 1.0 / (f64::from(self.batches.checked_sub(1).filter(|&more| more > 0)?) * f64::from(self.samples));
        Some(squares.iter().map(|value| (value * scale).sqrt() as f32).collect())
    }

    fn words_of(&self, plane: usize) -> Range<usize> {
        let words = self.sums.len() / self.shares.len();
        plane * words..(plane + 1) * words
    }

    /// Root mean square of the standard errors over the mean radiance of the picture; infinite before the second batch.
    pub fn relative_error(&self) -> f64 {
        let Some(errors) = self.standard_error() else { return f64::INFINITY };
        let count = errors.len().max(1) as f64;
        let square = errors.iter().map(|&error| f64::from(error).powi(2)).sum::<f64>() / count;
        let mean = self.picture_sums().iter().sum::<f64>() / (count * f64::from(self.samples));
        if mean > 0.0 { square.sqrt() / mean } else { 0.0 }
    }
}

/// How much of each plane goes into the picture: the first as it is, a corrected layer divided by how often a path counted on average
/// over the whole render, other layers not at all. A layer that was never counted is black.
pub fn shares(layers: &[Layers], tallied: Option<&Tallied>) -> Vec<f64> {
    let share = |word: u32| {
        let tallied = tallied?;
        let count = tallied.counts.get(word as usize).copied().filter(|&count| count > 0)?;
        Some(tallied.slots as f64 / count as f64)
    };
    let mut shares = vec![1.0];
    for group in layers {
        shares.extend((0..group.size).map(|index| share(group.correct? + index)).map(Option::unwrap_or_default));
    }
    shares
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BatchUniform {
    samples: f32,
    before: f32,
    words: u32,
    unused: u32,
}

/// Device-side sums.
#[derive(Debug)]
pub struct Accumulator {
    kind: Accumulate,
    words: u32,
    film: wgpu::Buffer,
    uniform: wgpu::Buffer,
    sums: wgpu::Buffer,
    spread: wgpu::Buffer,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
}

impl Accumulator {
    /// Zeroed sums for a film of so many pixels on all its planes.
    ///
    /// # Errors
    /// User input when the picture is too large for the adapter; failed when memory runs out.
    pub fn new(gpu: &Gpu, kind: Accumulate, pixels: u64, film: &wgpu::Buffer) -> Result<Self, Error> {
        let words =
            u32::try_from(pixels * 3).map_err(|_| Error::input("the picture has too many pixels and layers"))?;
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let uniform =
            create(gpu, "batch", size_of::<BatchUniform>() as u64, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
        let sums = create(gpu, "sums", u64::from(words) * 8, storage)?;
        let spread = create(gpu, "spread", u64::from(words) * 4, storage)?;
        let text = if kind == Accumulate::FixedI64 {
            include_str!("film/gather_fixed.wgsl")
        } else {
            include_str!("film/gather_float.wgsl")
        };
        let module = gpu.module("gather", text)?;
        let pipeline = gpu.scoped("gather", || {
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("gather"),
                layout: None,
                module: &module,
                entry_point: Some("gather"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        })?;
        let entry = |binding, buffer: &'_ wgpu::Buffer| (binding, buffer.clone());
        let bound = [entry(0, &uniform), entry(1, film), entry(2, &sums), entry(3, &spread)];
        let entries: Vec<_> = bound
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding: *binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = gpu.scoped("gather", || {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("gather"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            })
        })?;
        Ok(Self { kind, words, film: film.clone(), uniform, sums, spread, pipeline, bindings })
    }

    /// Forgets what the film holds of a batch that has not ended.
    pub fn clear_film(&self, gpu: &Gpu) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("clear") });
        encoder.clear_buffer(&self.film, 0, None);
        gpu.queue.submit([encoder.finish()]);
    }

    /// Encodes the end of a batch of `samples` samples per pixel that follows `before` others: the film is added to the sums and zeroed.
    pub fn encode(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, samples: u32, before: u32) {
        let batch = BatchUniform { samples: samples as f32, before: before as f32, words: self.words, unused: 0 };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&batch));
        let groups = self.words.div_ceil(WORKGROUP);
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("gather"), timestamp_writes: None });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(groups.min(WIDEST), groups.div_ceil(WIDEST), 1);
    }

    /// Reads the sums of `samples` samples per pixel in `batches` batches.
    ///
    /// # Errors
    /// Failed, when the device is lost.
    pub fn read(&self, gpu: &Gpu, samples: u32, batches: u32) -> Result<Totals, Error> {
        let sums = gpu.read(&self.sums)?;
        let spread = gpu.read(&self.spread)?;
        let words = self.words as usize;
        let sums = if self.kind == Accumulate::FixedI64 {
            Sums::Fixed(sums.chunks_exact(8).take(words).map(bytemuck::pod_read_unaligned).collect())
        } else {
            let pairs = sums.chunks_exact(8).take(words).map(bytemuck::pod_read_unaligned::<[f32; 2]>);
            Sums::Float(pairs.map(|[high, low]| f64::from(high) + f64::from(low)).collect())
        };
        let spread = spread.chunks_exact(4).take(words).map(bytemuck::pod_read_unaligned).collect();
        Ok(Totals { samples, batches, sums, spread: Some(spread), shares: vec![1.0], tallied: None })
    }

    /// Continues from earlier sums, rounding them to this film's kind where the kinds differ.
    ///
    /// # Errors
    /// User input, when the sizes differ.
    pub fn write(&self, gpu: &Gpu, totals: &Totals) -> Result<(), Error> {
        let bytes = self.encoded(&totals.sums);
        if bytes.len() as u64 != u64::from(self.words) * 8 {
            return Err(Error::input("the picture to resume has another size"));
        }
        gpu.queue.write_buffer(&self.sums, 0, &bytes);
        if let Some(spread) = &totals.spread {
            gpu.queue.write_buffer(&self.spread, 0, bytemuck::cast_slice(spread));
        }
        Ok(())
    }

    fn encoded(&self, sums: &Sums) -> Vec<u8> {
        match (self.kind, sums) {
            (Accumulate::FixedI64, Sums::Fixed(units)) => bytemuck::cast_slice(units).to_vec(),
            (Accumulate::FixedI64, Sums::Float(values)) => {
                values.iter().flat_map(|value| ((value / FIXED_UNIT).round() as i64).to_le_bytes()).collect()
            }
            (Accumulate::AtomicF32 | Accumulate::Racy, _) => {
                let pair = |value: f64| [value as f32, (value - f64::from(value as f32)) as f32];
                sums.values().into_iter().flat_map(|value| bytemuck::cast::<_, [u8; 8]>(pair(value))).collect()
            }
        }
    }
}
