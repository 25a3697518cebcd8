//! Packs images on the GPU, so that the read-back bytes are the final ones.

use std::sync::{Arc, OnceLock};

use wgpu::util::DeviceExt;
use wheelarm_proto::settings::{Depth, Named};

use super::deflate::{CameraDeflater, Deflater};
use super::planes::Planes;
use super::target::Target;
use super::timing::Timing;

/// Where images are packed: colour without alpha, depth in metres, IDs of 16 bits. The
/// bytes are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// On the GPU; images are shared in the memory that it wrote.
    Adapter,
    /// On the CPU, from the rendered textures.
    Processor,
}

/// `Planes` in the shader.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct PlanesUniform {
    width: u32,
    count: u32,
    depth: u32,
    ids: u32,
    near: u32,
    far: u32,
    background: u32,
    smooth_edges: u32,
}

/// Pixels of one workgroup.
const PER_GROUP: usize = 256;
/// Most workgroups along one axis.
const MOST_GROUPS: usize = 32_768;

/// The pipelines for packing.
pub(super) struct Packer {
    /// Ids in the alpha bytes.
    narrow: wgpu::ComputePipeline,
    /// IDs in a separate texture.
    wide: wgpu::ComputePipeline,
    /// Created when deflated images are first requested.
    deflater: OnceLock<Option<Deflater>>,
}

impl Packer {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("pack.wgsl"),
            source: wgpu::ShaderSource::Wgsl(include_str!("pack.wgsl").into()),
        });
        let pipeline = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        Self {
            narrow: pipeline("pack"),
            wide: pipeline("pack_wide"),
            deflater: OnceLock::new(),
        }
    }

    /// Packer of a camera, with `background` where nothing is hit; `None` when the
    /// images are larger than a shader of this adapter can write.
    pub(super) fn for_camera(
        self: &Arc<Self>,
        device: &wgpu::Device,
        target: &Target,
        background: wgpu::Color,
    ) -> Option<CameraPacker> {
        let planes = Planes::from_target(target);
        let [near, far] = target.spec.range.map(|metres| metres as f32);
        let most = device.limits().max_storage_buffer_binding_size;
        if planes.bytes() > most || !near.is_normal() {
            return None;
        }
        let [_, depth, ids] = planes.ranges();
        let uniform = PlanesUniform {
            width: planes.width,
            count: planes.pixels as u32,
            depth: (depth.start / 4) as u32,
            ids: (ids.start / 4) as u32,
            near: near.to_bits(),
            far: far.to_bits(),
            background: match target.is_averaged() {
                true => u32::MAX,
                false => rgb_bytes(background),
            },
            smooth_edges: target.smooth_edges.into(),
        };
        let uniform = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("planes"),
            contents: bytemuck::bytes_of(&uniform),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let packed = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("packed"),
            size: planes.bytes(),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let pipeline = match target.ids {
            None => &self.narrow,
            Some(_) => &self.wide,
        };
        let view = wgpu::BindingResource::TextureView;
        let mut resources = vec![
            uniform.as_entire_binding(),
            view(&target.color.view),
            view(&target.depth.view),
            packed.as_entire_binding(),
        ];
        resources.extend(target.ids.iter().map(|ids| view(&ids.view)));
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("pack"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let groups = planes.pixels.div_ceil(PER_GROUP);
        let across = groups.min(MOST_GROUPS);
        Some(CameraPacker {
            planes,
            pipeline: pipeline.clone(),
            group,
            groups: [across as u32, groups.div_ceil(across) as u32],
            packed,
            packer: Arc::clone(self),
            deflaters: Default::default(),
        })
    }
}

/// Bytes of an image pixel, lowest first.
fn rgb_bytes(color: wgpu::Color) -> u32 {
    let byte = |c: f64| (c as f32).clamp(0.0, 1.0).mul_add(255.0, 0.5) as u32;
    byte(color.r) | byte(color.g) << 8 | byte(color.b) << 16
}

/// Returns the result of `make`, unless the adapter reports an error or too little
/// memory: the CPU can do the same.
fn tried<T>(device: &wgpu::Device, make: impl FnOnce() -> Option<T>) -> Option<T> {
    let filters = [
        wgpu::ErrorFilter::Internal,
        wgpu::ErrorFilter::OutOfMemory,
        wgpu::ErrorFilter::Validation,
    ];
    let scopes = filters.map(|filter| device.push_error_scope(filter));
    let made = make();
    let mut refused = false;
    // Scopes are closed in reverse order.
    for scope in scopes.into_iter().rev() {
        if let Some(error) = pollster::block_on(scope.pop()) {
            tracing::warn!(
                "images are compressed on the CPU because the graphics adapter cannot: {error}"
            );
            refused = true;
        }
    }
    made.filter(|_| !refused)
}

/// Packer of the images of one camera.
pub(super) struct CameraPacker {
    pub(super) planes: Planes,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    groups: [u32; 2],
    packed: wgpu::Buffer,
    packer: Arc<Packer>,
    /// By the form of depth, created on first use.
    deflaters: [OnceLock<Option<Arc<CameraDeflater>>>; Depth::ALL.len()],
}

impl CameraPacker {
    /// Records the commands that pack the rendered image and copy it to `read`.
    pub(super) fn pack(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        read: &wgpu::Buffer,
        timing: &Timing,
    ) {
        timing.begins(encoder, "pack");
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        let [x, y] = self.groups;
        pass.dispatch_workgroups(x, y, 1);
        drop(pass);
        timing.begins(encoder, "copy");
        encoder.copy_buffer_to_buffer(&self.packed, 0, read, 0, self.planes.bytes());
    }

    /// Deflater of the packed images with depth in the given form, if possible; created
    /// on first use.
    pub(super) fn deflater(
        &self,
        device: &wgpu::Device,
        depth: Depth,
    ) -> Option<Arc<CameraDeflater>> {
        let new = || {
            let make = || tried(device, || Deflater::new(device));
            let deflater = self.packer.deflater.get_or_init(make).as_ref()?;
            let for_camera = || deflater.for_camera(device, self.planes, depth, &self.packed);
            tried(device, for_camera).map(Arc::new)
        };
        let deflater = self.deflaters[depth as usize].get_or_init(new);
        deflater.clone().filter(|deflater| deflater.works())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::camera::RenderError;

    #[test]
    fn resources_that_the_adapter_rejects_are_not_created() {
        let graphics = crate::sensors::camera::Graphics::for_adapter(None);
        let opened = match graphics.device() {
            Ok(opened) => opened,
            Err(reason @ RenderError::NoDriver) => {
                wheelarm_proto::program::skipped(&reason.to_string());
                return;
            }
            Err(other) => panic!("{other}"),
        };
        let shader = |text: &str| {
            let text = text.to_owned();
            tried(&opened.device, || {
                Some(
                    opened
                        .device
                        .create_shader_module(wgpu::ShaderModuleDescriptor {
                            label: None,
                            source: wgpu::ShaderSource::Wgsl(text.into()),
                        }),
                )
            })
        };
        assert!(shader("not a shader").is_none());
        assert_eq!(*opened.failure.lock(), None);
        assert!(shader("@compute @workgroup_size(1) fn f() {}").is_some());
    }
}
