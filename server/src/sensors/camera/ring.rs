//! Read-back buffers of one camera. Each stays mapped where the GPU writes, and can be
//! shared as the image itself; it is reused when no reader holds it.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::Bytes;
use parking_lot::Mutex;

/// Largest number of shared buffers: those in the transport's cache and those in
/// flight. Further images are copied.
const MOST_LENT: usize = 12;

/// The buffers of one camera.
pub(super) struct Ring {
    name: String,
    bytes: u64,
    spare: Arc<BufferPool>,
}

#[derive(Default)]
struct BufferPool {
    buffers: Mutex<Vec<wgpu::Buffer>>,
    lent: AtomicUsize,
}

impl Ring {
    pub(super) fn new(name: &str, bytes: u64) -> Self {
        Self {
            name: name.to_owned(),
            bytes,
            spare: Arc::default(),
        }
    }

    /// A free buffer.
    pub(super) fn take(&self, device: &wgpu::Device) -> wgpu::Buffer {
        let spare = self.spare.buffers.lock().pop();
        spare.unwrap_or_else(|| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(&self.name),
                size: self.bytes,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
    }

    /// Unmaps a buffer without views.
    pub(super) fn release(&self, buffer: wgpu::Buffer) {
        buffer.unmap();
        self.spare.buffers.lock().push(buffer);
    }

    /// Shares the content of a mapped buffer, without a copy while few are shared.
    pub(super) fn lend(&self, buffer: wgpu::Buffer) -> Result<Bytes, String> {
        let view = buffer.get_mapped_range(..).map_err(|e| e.to_string())?;
        if self.spare.lent.load(Ordering::Relaxed) >= MOST_LENT {
            let copy = Bytes::copy_from_slice(&view);
            drop(view);
            self.release(buffer);
            return Ok(copy);
        }
        self.spare.lent.fetch_add(1, Ordering::Relaxed);
        Ok(Bytes::from_owner(MappedBuffer {
            view: Some(view),
            buffer,
            spare: Arc::clone(&self.spare),
        }))
    }

    #[cfg(test)]
    pub(super) fn counts(&self) -> [usize; 2] {
        let spare = self.spare.buffers.lock().len();
        [spare, self.spare.lent.load(Ordering::Relaxed)]
    }
}

/// A shared mapped buffer.
struct MappedBuffer {
    /// `Some` until it is dropped.
    view: Option<wgpu::BufferView>,
    buffer: wgpu::Buffer,
    spare: Arc<BufferPool>,
}

impl AsRef<[u8]> for MappedBuffer {
    fn as_ref(&self) -> &[u8] {
        self.view.as_deref().unwrap_or_default()
    }
}

impl Drop for MappedBuffer {
    fn drop(&mut self) {
        // The view must be dropped before the buffer is unmapped.
        self.view = None;
        self.buffer.unmap();
        self.spare.buffers.lock().push(self.buffer.clone());
        self.spare.lent.fetch_sub(1, Ordering::Relaxed);
    }
}
