//! What each dispatch of a pass takes and what joins queues behind it, copied from between the kernels: in passes of their own, for the
//! copies cost time.

use super::{Executor, Pass};
use crate::buffers::create;
use crate::error::Error;
use crate::occupancy::Occupancy;
use wgpu::BufferUsages;

impl Executor {
    /// The occupancy that passes add to.
    pub fn nothing_counted(&self) -> Occupancy {
        Occupancy::new(self.pipelines.len(), self.queues, self.entries)
    }

    /// Runs one pass and adds what its kernels took and sent on. No pass may be in flight.
    ///
    /// # Errors
    /// Failed, when the device is lost or out of memory.
    pub fn count_entries(&self, pass: Pass, occupancy: &mut Occupancy) -> Result<(), Error> {
        let size = self.control.size();
        let copies = self.program.len() as u64 + 1;
        let counts = create(&self.gpu, "entries", size * copies, BufferUsages::COPY_DST | BufferUsages::COPY_SRC)?;
        self.gpu.queue.write_buffer(&self.pass, 0, bytemuck::bytes_of(&pass));
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("entries") });
        for (command, copy) in self.program.iter().zip(0..) {
            encoder.copy_buffer_to_buffer(&self.control, 0, &counts, copy * size, size);
            let description = wgpu::ComputePassDescriptor { label: Some("entries"), timestamp_writes: None };
            self.dispatch(&mut encoder.begin_compute_pass(&description), command, pass.active);
        }
        encoder.copy_buffer_to_buffer(&self.control, 0, &counts, (copies - 1) * size, size);
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read(&counts)?;
        let words: Vec<u32> = bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        let states: Vec<&[u32]> = words.chunks_exact(size as usize / 4).collect();
        occupancy.add(&self.program, &states, pass.active);
        Ok(())
    }
}
