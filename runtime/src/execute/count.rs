//! How many paths each dispatch of a pass takes, copied from between the kernels: in passes of their own, for the copies cost time.

use super::{Executor, Pass};
use crate::buffers::create;
use crate::error::Error;
use crate::occupancy::Occupancy;
use crate::program::Entries;
use wgpu::BufferUsages;

impl Executor {
    /// Runs one pass and adds what its kernels took. No pass may be in flight.
    ///
    /// # Errors
    /// Failed, when the device is lost or out of memory.
    pub fn count_entries(&self, pass: Pass, occupancy: &mut Occupancy) -> Result<(), Error> {
        let size = 4 * self.program.len() as u64;
        let counts = create(&self.gpu, "entries", size, BufferUsages::COPY_DST | BufferUsages::COPY_SRC)?;
        self.gpu.queue.write_buffer(&self.pass, 0, bytemuck::bytes_of(&pass));
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("entries") });
        for (command, at) in self.program.iter().zip((0..).step_by(4)) {
            if let Entries::Counted(word) = command.entries {
                encoder.copy_buffer_to_buffer(&self.control, word, &counts, at, 4);
            }
            let description = wgpu::ComputePassDescriptor { label: Some("entries"), timestamp_writes: None };
            self.dispatch(&mut encoder.begin_compute_pass(&description), command, pass.active);
        }
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read(&counts)?;
        let counted: Vec<u32> = bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        occupancy.add(&self.program, &counted, pass.active);
        Ok(())
    }
}
