//! Data of a batch of images: cameras, bodies, contacts and draws, in one buffer with one
//! upload. Every upload allocates memory in the driver, and every draw and pipeline change
//! costs the CPU more than a small GPU image takes. A GPU therefore reads its draws from
//! the buffer, with one command for all draws of a pipeline. A CPU adapter would only loop
//! over them, and gets them as commands.

use std::ops::Range;

use super::contact;
use super::geometry::BodyRow;
use super::uniform::CameraUniform;

/// Alignment of the parts of the buffer that are bound.
const ALIGNMENT: usize = 256;
/// Bytes between the uniforms of two cameras.
const CAMERA: usize = size_of::<CameraUniform>().next_multiple_of(ALIGNMENT);
/// Largest number of draws in the buffer. A batch with more of them records commands.
const MOST_DRAWS: usize = 4096;

/// A draw of triangles.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Draw {
    index_count: u32,
    instance_count: u32,
    first_index: u32,
    base_vertex: i32,
    first_instance: u32,
}

/// Size of a draw, bytes.
const DRAW: usize = size_of::<Draw>();

/// Data of the next batch, and its buffer.
pub(super) struct FrameData {
    pub(super) buffer: wgpu::Buffer,
    /// Content of the buffer, as far as it is used.
    bytes: Vec<u8>,
    bodies: Range<usize>,
    /// Lists of capsules, the first of which is empty; without room if there are none.
    contacts: Range<usize>,
    draws: Vec<Draw>,
    /// Start of the draws in the buffer, if they are there.
    draws_at: Option<u64>,
    /// Whether the adapter reads draws with any first instance from a buffer.
    reads_draws: bool,
}

impl FrameData {
    /// `has_contacts`: whether draws have lists of capsules.
    pub(super) fn new(
        device: &wgpu::Device,
        cameras: usize,
        bodies: usize,
        has_contacts: bool,
    ) -> Self {
        let first_body = cameras * CAMERA;
        let end_of_bodies = first_body + bodies.max(1) * size_of::<BodyRow>();
        let lists = match has_contacts {
            true => 1 + cameras * contact::MOST_LISTS,
            false => 0,
        };
        let first_list = end_of_bodies.next_multiple_of(ALIGNMENT);
        let end_of_lists = first_list + lists * contact::STRIDE as usize;
        let usage = wgpu::BufferUsages::UNIFORM
            | wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::INDIRECT
            | wgpu::BufferUsages::COPY_DST;
        Self {
            buffer: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("frame"),
                size: (end_of_lists + MOST_DRAWS * DRAW) as u64,
                usage,
                mapped_at_creation: false,
            }),
            bytes: vec![0; first_list + lists.min(1) * contact::STRIDE as usize],
            bodies: first_body..end_of_bodies,
            contacts: first_list..end_of_lists,
            draws: Vec::new(),
            draws_at: None,
            reads_draws: device
                .features()
                .contains(wgpu::Features::INDIRECT_FIRST_INSTANCE),
        }
    }

    /// The uniform of a camera.
    pub(super) fn camera_binding(&self, camera: usize) -> wgpu::BindingResource<'_> {
        self.binding(camera * CAMERA..camera * CAMERA + size_of::<CameraUniform>())
    }

    /// The rows of all bodies.
    pub(super) fn bodies_binding(&self) -> wgpu::BindingResource<'_> {
        self.binding(self.bodies.clone())
    }

    /// One list of capsules, at a dynamic offset of [`contact::STRIDE`] per list.
    pub(super) fn contacts_binding(&self) -> wgpu::BindingResource<'_> {
        let start = self.contacts.start;
        self.binding(start..start + contact::LIST as usize)
    }

    /// All lists of capsules.
    pub(super) fn all_contacts_binding(&self) -> wgpu::BindingResource<'_> {
        self.binding(self.contacts.clone())
    }

    fn binding(&self, part: Range<usize>) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.buffer,
            offset: part.start as u64,
            size: std::num::NonZero::new(part.len() as u64),
        })
    }

    /// Begins a batch: removes contacts and draws.
    pub(super) fn begin(&mut self) {
        let has_contacts = !self.contacts.is_empty();
        let empty_list = usize::from(has_contacts) * contact::STRIDE as usize;
        self.bytes.truncate(self.contacts.start + empty_list);
        self.draws.clear();
        self.draws_at = None;
    }

    pub(super) fn set_camera(&mut self, camera: usize, uniform: &CameraUniform) {
        let at = camera * CAMERA;
        self.bytes[at..at + size_of::<CameraUniform>()]
            .copy_from_slice(bytemuck::bytes_of(uniform));
    }

    pub(super) fn set_bodies(&mut self, rows: &[BodyRow]) {
        let rows: &[u8] = bytemuck::cast_slice(rows);
        self.bytes[self.bodies.start..][..rows.len()].copy_from_slice(rows);
    }

    /// Index of the next list of capsules.
    pub(super) fn next_list(&self) -> usize {
        (self.bytes.len() - self.contacts.start) / contact::STRIDE as usize
    }

    /// Appends lists of capsules, [`contact::STRIDE`] bytes each.
    pub(super) fn add_lists(&mut self, lists: &[u8]) {
        self.bytes.extend_from_slice(lists);
    }

    /// Index of the next draw.
    pub(super) fn next_draw(&self) -> usize {
        self.draws.len()
    }

    /// Appends a draw.
    pub(super) fn add_draw(&mut self, indices: &Range<u32>, first_instance: u32) {
        self.draws.push(Draw {
            index_count: indices.end - indices.start,
            instance_count: 1,
            first_index: indices.start,
            base_vertex: 0,
            first_instance,
        });
    }

    /// Uploads the data. The draws are stored if the adapter reads them.
    pub(super) fn upload(&mut self, queue: &wgpu::Queue) {
        if self.reads_draws && !self.draws.is_empty() && self.draws.len() <= MOST_DRAWS {
            self.draws_at = Some(self.bytes.len() as u64);
            self.bytes
                .extend_from_slice(bytemuck::cast_slice(&self.draws));
        }
        queue.write_buffer(&self.buffer, 0, &self.bytes);
    }

    /// Records draws after [`Self::upload`], from the buffer if `reads_draws` and possible.
    pub(super) fn record(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        draws: Range<usize>,
        reads_draws: bool,
    ) {
        match self.draws_at {
            Some(start) if reads_draws => {
                let at = start + (draws.start * DRAW) as u64;
                pass.multi_draw_indexed_indirect(&self.buffer, at, draws.len() as u32);
            }
            _ => {
                for draw in &self.draws[draws] {
                    let indices = draw.first_index..draw.first_index + draw.index_count;
                    let instance = draw.first_instance;
                    pass.draw_indexed(indices, 0, instance..instance + 1);
                }
            }
        }
    }
}
