//! Textures and samplers of the patterns that a scene uses.

use std::collections::BTreeMap;

use parking_lot::Mutex;
use wgpu::util::DeviceExt;
use wheelarm_proto::cache::{Key, Store};

use super::ambient_map::AmbientMap;
use crate::appearance::Reflection;
use crate::geometry::texture::{self, Image, Source, TextureError};
use wheelarm_proto::parallel;

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

/// The images of the latest scene on the GPU. The next scene usually has the same, or few
/// others.
#[derive(Default)]
pub(super) struct PatternCache(Mutex<Option<Uploaded>>);

/// Images in the layers of one texture.
struct Uploaded {
    device: wgpu::Device,
    keys: Vec<Key>,
    texture: wgpu::Texture,
}

impl PatternCache {
    /// Decodes the images that are not uploaded.
    ///
    /// # Errors
    /// For an invalid file.
    pub(super) fn missing(
        &self,
        sources: &BTreeMap<String, Source>,
        store: &Store,
    ) -> Result<BTreeMap<Key, Image>, TextureError> {
        let uploaded = self.0.lock();
        let is_missing = |source: &&Source| {
            let uploaded = uploaded.as_ref();
            uploaded.is_none_or(|uploaded| !uploaded.keys.contains(source.key()))
        };
        let missing: Vec<&Source> = sources.values().filter(is_missing).collect();
        drop(uploaded);
        let decode = |source: &Source| Ok((*source.key(), source.decode_with(store)?));
        parallel::map(missing, decode).into_iter().collect()
    }

    /// The texture with the images of `patterns`, one layer each. Images that are neither
    /// uploaded nor in `images` are decoded.
    ///
    /// # Errors
    /// For an invalid file.
    pub(super) fn view(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        patterns: &[String],
        sources: &BTreeMap<String, Source>,
        images: BTreeMap<Key, Image>,
    ) -> Result<wgpu::TextureView, TextureError> {
        let sources = patterns.iter().filter_map(|name| sources.get(name));
        let sources: Vec<&Source> = sources.collect();
        let keys: Vec<Key> = sources.iter().map(|source| *source.key()).collect();
        let mut kept = self.0.lock();
        kept.take_if(|uploaded| uploaded.device != *device);
        if let Some(uploaded) = kept.as_ref().filter(|uploaded| uploaded.keys == keys) {
            return Ok(view(&uploaded.texture));
        }
        let texture = layers(device, patterns.len());
        if patterns.is_empty() {
            write(queue, &texture, [0, 0], &[255; 4]);
        }
        let mut encoder = device.create_command_encoder(&Default::default());
        for (layer, source) in sources.into_iter().enumerate() {
            let key = source.key();
            let place = kept
                .as_ref()
                .and_then(|old| Some((old, old.keys.iter().position(|old| old == key)?)));
            match (images.get(key), place) {
                (Some(image), _) => upload(queue, &texture, layer, image),
                (None, Some((old, place))) => {
                    copy(&mut encoder, [&old.texture, &texture], [place, layer]);
                }
                (None, None) => upload(queue, &texture, layer, &source.decode()?),
            }
            // One by one: all together would double the memory.
            queue.submit([]);
        }
        queue.submit([encoder.finish()]);
        let view = view(&texture);
        *kept = Some(Uploaded {
            device: device.clone(),
            keys,
            texture,
        });
        Ok(view)
    }
}

/// A texture of `count` images.
fn layers(device: &wgpu::Device, count: usize) -> wgpu::Texture {
    let side = if count == 0 { 1 } else { texture::SIZE as u32 };
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("patterns"),
        size: wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: count.max(1) as u32,
        },
        mip_level_count: if count == 0 {
            1
        } else {
            texture::LEVELS as u32
        },
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// A level of a layer.
fn place(
    texture: &wgpu::Texture,
    [layer, level]: [usize; 2],
) -> (wgpu::TexelCopyTextureInfo<'_>, wgpu::Extent3d) {
    let side = texture.width() >> level;
    let at = wgpu::TexelCopyTextureInfo {
        mip_level: level as u32,
        origin: wgpu::Origin3d {
            x: 0,
            y: 0,
            z: layer as u32,
        },
        ..texture.as_image_copy()
    };
    let size = wgpu::Extent3d {
        width: side,
        height: side,
        depth_or_array_layers: 1,
    };
    (at, size)
}

fn write(queue: &wgpu::Queue, texture: &wgpu::Texture, at: [usize; 2], bytes: &[u8]) {
    let (at, size) = place(texture, at);
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(size.width * 4),
        rows_per_image: None,
    };
    queue.write_texture(at, bytes, layout, size);
}

fn upload(queue: &wgpu::Queue, texture: &wgpu::Texture, layer: usize, image: &Image) {
    for (level, bytes) in image.levels().enumerate() {
        write(queue, texture, [layer, level], bytes);
    }
}

/// Copies an image from one texture to another.
fn copy(encoder: &mut wgpu::CommandEncoder, [from, to]: [&wgpu::Texture; 2], layers: [usize; 2]) {
    for level in 0..texture::LEVELS {
        let (source, size) = place(from, [layers[0], level]);
        let (target, _) = place(to, [layers[1], level]);
        encoder.copy_texture_to_texture(source, target, size);
    }
}

fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}
