//! Textures and samplers of the patterns that a scene uses.

use std::collections::{BTreeMap, BTreeSet};

use wgpu::util::DeviceExt;

use super::scene::RenderScene;
use crate::geometry::texture::{self, Picture};

/// Repeating with halvings; comparing for the shadow map.
pub(super) fn samplers(device: &wgpu::Device) -> [wgpu::Sampler; 2] {
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
    ]
}

/// Pictures by the names of their patterns.
pub(super) type Painted = BTreeMap<String, Picture>;

/// Paints the patterns of a scene, each on a thread of its own.
pub(super) fn paint(scene: &RenderScene) -> Painted {
    let names: BTreeSet<&str> = scene
        .items
        .iter()
        .filter_map(|item| Some(item.material.texture.as_ref()?.pattern.as_str()))
        .collect();
    std::thread::scope(|scope| {
        let jobs: Vec<_> = names
            .iter()
            .map(|name| (name, scope.spawn(|| texture::paint(name))))
            .collect();
        jobs.into_iter()
            .filter_map(|(name, job)| Some(((*name).to_owned(), job.join().ok()??)))
            .collect()
    })
}

/// Uploads the pictures of `patterns`, one layer each.
pub(super) fn upload(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    patterns: &[String],
    painted: &Painted,
) -> wgpu::TextureView {
    let none = patterns.is_empty();
    let side = if none { 1 } else { texture::SIZE as u32 };
    let bytes: Vec<u8> = if none {
        vec![255; 4]
    } else {
        let pictures = patterns.iter().filter_map(|name| painted.get(name));
        let levels: Vec<&[u8]> = pictures
            .flat_map(|p| p.levels.iter().map(Vec::as_slice))
            .collect();
        levels.concat()
    };
    let texture = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
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
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        &bytes,
    );
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}
