//! Textures and samplers of the patterns that a scene uses.

use std::collections::BTreeMap;

use wgpu::util::DeviceExt;

use super::ambient_map::AmbientMap;
use crate::appearance::Reflection;
use crate::geometry::texture::{self, Image};

/// Repeating with mipmaps; comparing for the shadow map; smooth between levels; for
/// textures of one level.
pub(super) fn samplers(device: &wgpu::Device) -> [wgpu::Sampler; 4] {
    let linear = wgpu::FilterMode::Linear;
    [
        device.create_sampler(&wgpu::SamplerDescriptor {
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            mag_filter: linear,
            min_filter: linear,
            mipmap_filter: wgpu::MipmapFilterMode::Nearest,
            ..Default::default()
        }),
        device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: linear,
            min_filter: linear,
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..Default::default()
        }),
        device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: linear,
            min_filter: linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        }),
        device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: linear,
            min_filter: linear,
            ..Default::default()
        }),
    ]
}

/// Uploads the reflection map of smooth surfaces.
pub(super) fn upload_reflection(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    reflection: Option<&Reflection>,
) -> wgpu::TextureView {
    let levels = reflection.map_or_else(|| vec![vec![0; 4]], |r| r.levels.clone());
    let side = reflection.map_or(1, |_| Reflection::SIDE as u32);
    let texture = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
            label: Some("reflection"),
            size: wgpu::Extent3d {
                width: side,
                height: side,
                depth_or_array_layers: 1,
            },
            mip_level_count: levels.len() as u32,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        &levels.concat(),
    );
    texture.create_view(&Default::default())
}

/// Uploads the ambient map, one byte per texel.
pub(super) fn upload_ambient_map(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    map: &AmbientMap,
) -> wgpu::TextureView {
    let texture = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
            label: Some("ambient map"),
            size: wgpu::Extent3d {
                width: map.size[0] as u32,
                height: map.size[1] as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        &map.texels,
    );
    texture.create_view(&Default::default())
}

/// Uploads the images of `patterns`, one layer each.
pub(super) fn upload(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    patterns: &[String],
    images: &BTreeMap<String, Image>,
) -> wgpu::TextureView {
    let none = patterns.is_empty();
    let side = if none { 1 } else { texture::SIZE as u32 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("patterns"),
        size: wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: patterns.len().max(1) as u32,
        },
        mip_level_count: if none { 1 } else { texture::LEVELS as u32 },
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let write = |layer: usize, level: usize, bytes: &[u8]| {
        let side = side >> level;
        let at = wgpu::TexelCopyTextureInfo {
            mip_level: level as u32,
            origin: wgpu::Origin3d {
                x: 0,
                y: 0,
                z: layer as u32,
            },
            ..texture.as_image_copy()
        };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(side * 4),
            rows_per_image: None,
        };
        let size = wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: 1,
        };
        queue.write_texture(at, bytes, layout, size);
    };
    if none {
        write(0, 0, &[255; 4]);
    }
    // One by one: all together would double the memory.
    let layers = patterns.iter().filter_map(|name| images.get(name));
    for (layer, image) in layers.enumerate() {
        for (level, bytes) in image.levels.iter().enumerate() {
            write(layer, level, bytes);
        }
        queue.submit([]);
    }
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}
