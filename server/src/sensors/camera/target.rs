//! Render targets of one camera.

use super::pipelines::{COLOR, DEPTH, IDS};
use super::spec::CameraSpec;
use super::tier::Tier;

/// Textures of one camera.
pub(super) struct Target {
    pub(super) spec: CameraSpec,
    pub(super) color: Image,
    pub(super) depth: Image,
    /// Several samples per pixel: colour and depth.
    pub(super) samples: Option<[wgpu::TextureView; 2]>,
    /// A separate texture when IDs are not stored in the alpha byte.
    pub(super) ids: Option<Image>,
    /// Whether edges are smoothed when the image is packed.
    pub(super) smooth_edges: bool,
}

/// A texture and its full view.
pub(super) struct Image {
    pub(super) texture: wgpu::Texture,
    pub(super) view: wgpu::TextureView,
}

impl Target {
    pub(super) fn new(device: &wgpu::Device, spec: CameraSpec, tier: Tier) -> Self {
        let size = [spec.intrinsics.width, spec.intrinsics.height];
        let read = wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::TEXTURE_BINDING;
        let inner = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let samples = (tier.samples > 1)
            .then(|| [COLOR, DEPTH].map(|f| image(device, size, f, tier.samples, inner).view));
        Self {
            color: image(device, size, COLOR, 1, read),
            depth: image(device, size, DEPTH, 1, read),
            samples,
            ids: tier
                .separate_ids()
                .then(|| image(device, size, IDS, 1, read)),
            smooth_edges: tier.smooth_edges,
            spec,
        }
    }

    /// Whether several samples are averaged for a pixel.
    pub(super) fn is_averaged(&self) -> bool {
        self.samples.is_some()
    }
}

pub(super) fn image(
    device: &wgpu::Device,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    sample_count: u32,
    usage: wgpu::TextureUsages,
) -> Image {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    });
    let view = texture.create_view(&Default::default());
    Image { texture, view }
}

pub(super) fn depth_attachment(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<f32>,
    keep: bool,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load,
            store: if keep {
                wgpu::StoreOp::Store
            } else {
                wgpu::StoreOp::Discard
            },
        }),
        stencil_ops: None,
    }
}
