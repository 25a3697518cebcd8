//! The renderer: uploads a scene once, then draws snapshots of it.

use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use nalgebra::{Isometry3, Point3};
use wgpu::util::DeviceExt;

use super::adapter::{self, AdapterInfo};
use super::buffers::{Batch, Body, Buffers};
use super::pipelines::{DEPTH, Pipelines, Tier};
use super::readback::Layout;
use super::scene::{Binding, RenderScene};
use super::shadow::SunView;
use super::spec::CameraSpec;
use super::target::{Picture, Target, picture};
use super::view::{View, columns};
use super::{Frame, Quality, RenderError};
use crate::geometry::texture;
use crate::scene::Lighting;
use crate::snapshot::Snapshot;

/// Draws the cameras of one scene. Belongs to one thread at a time, any thread.
pub struct Renderer {
    info: AdapterInfo,
    device: wgpu::Device,
    queue: wgpu::Queue,
    failure: Arc<Mutex<Option<String>>>,
    tier: Tier,
    pipelines: Pipelines,
    geometry: Geometry,
    lighting: Lighting,
    shadow: ShadowMap,
    targets: Vec<Target>,
    scene_groups: Vec<wgpu::BindGroup>,
    shadow_group: wgpu::BindGroup,
    /// Links and objects that a snapshot must have.
    expected: [usize; 2],
    read: Vec<wgpu::Buffer>,
    pending: Option<Pending>,
}

/// The scene on the adapter.
struct Geometry {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    body_rows: wgpu::Buffer,
    bodies: Vec<Body>,
    batches: Vec<Batch>,
}

struct ShadowMap {
    picture: Picture,
    sun: SunView,
    /// Rows of the casters when the map was drawn.
    drawn_for: Vec<BodyRow>,
}

/// World_from_body as rows; id, openness.
type BodyRow = [f32; 16];

/// Submitted, not yet read.
struct Pending {
    submission: wgpu::SubmissionIndex,
    cameras: Vec<(usize, Isometry3<f64>)>,
}

/// Coarse triangles serve where 5 mm are less than a pixel.
const COARSE_BELOW: f64 = 0.005;

impl Renderer {
    /// All Vulkan adapters of this machine.
    #[must_use]
    pub fn adapters() -> Vec<AdapterInfo> {
        adapter::list()
    }

    /// Uploads a scene. `adapter` is a part of an adapter's name; without it the strongest is taken.
    ///
    /// # Errors
    /// When there is no Vulkan driver, no such adapter, a camera cannot be, or the adapter fails.
    pub fn new(
        scene: &RenderScene,
        cameras: &[CameraSpec],
        quality: Quality,
        adapter: Option<&str>,
    ) -> Result<Self, RenderError> {
        for camera in cameras {
            camera.check()?;
            let count = match camera.binding {
                Binding::World => usize::MAX,
                Binding::Link(_) => scene.links,
                Binding::Object(_) => scene.objects,
            };
            if let Binding::Link(i) | Binding::Object(i) = camera.binding
                && i >= count
            {
                return Err(RenderError::BadCamera {
                    camera: camera.name.clone(),
                    reason: format!("it sits on body {i}, there are {count}"),
                });
            }
        }
        let (info, chosen) = adapter::choose(adapter)?;
        let fail = |reason: String| RenderError::Device {
            adapter: info.name.clone(),
            reason,
        };
        let (device, queue) = pollster::block_on(chosen.request_device(&wgpu::DeviceDescriptor {
            required_limits: wgpu::Limits {
                max_buffer_size: chosen.limits().max_buffer_size,
                ..Default::default()
            },
            ..Default::default()
        }))
        .map_err(|e| fail(e.to_string()))?;
        let failure = Arc::new(Mutex::new(None));
        device.on_uncaptured_error(Arc::new({
            let failure = failure.clone();
            move |error: wgpu::Error| {
                let mut slot = failure.lock().unwrap_or_else(PoisonError::into_inner);
                slot.get_or_insert(error.to_string());
            }
        }));

        let tier = Tier::of(quality);
        let buffers = Buffers::new(scene);
        let pipelines = Pipelines::new(&device, tier);
        let sun = SunView::new(scene, &buffers, tier.shadow_size);
        let geometry = Geometry::upload(&device, &buffers);
        let materials = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("materials"),
            contents: bytemuck::cast_slice(&buffers.materials),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let pictures = upload_pictures(&device, &queue, &buffers.patterns);
        let shadow_picture = picture(
            &device,
            [tier.shadow_size; 2],
            DEPTH,
            1,
            wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        );
        let targets: Vec<Target> = cameras
            .iter()
            .map(|spec| Target::new(&device, spec.clone(), tier))
            .collect();
        let [repeating, comparing] = samplers(&device);
        let scene_groups = targets
            .iter()
            .map(|target| {
                bind(
                    &device,
                    &pipelines.scene_layout,
                    &[
                        target.uniform.as_entire_binding(),
                        geometry.body_rows.as_entire_binding(),
                        materials.as_entire_binding(),
                        wgpu::BindingResource::TextureView(&pictures),
                        wgpu::BindingResource::Sampler(&repeating),
                    ],
                )
            })
            .collect();
        let shadow_group = bind(
            &device,
            &pipelines.shadow_layout,
            &[
                wgpu::BindingResource::TextureView(&shadow_picture.view),
                wgpu::BindingResource::Sampler(&comparing),
            ],
        );
        let read = targets
            .iter()
            .map(|target| {
                device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(&target.spec.name),
                    size: Layout::of(target).bytes(),
                    usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            })
            .collect();
        let renderer = Self {
            shadow: ShadowMap {
                picture: shadow_picture,
                sun,
                drawn_for: Vec::new(),
            },
            lighting: scene.lighting,
            expected: [scene.links, scene.objects],
            info,
            device,
            queue,
            failure,
            tier,
            pipelines,
            geometry,
            targets,
            scene_groups,
            shadow_group,
            read,
            pending: None,
        };
        renderer.check_failure()?;
        Ok(renderer)
    }

    /// The adapter that draws.
    #[must_use]
    pub fn adapter(&self) -> &AdapterInfo {
        &self.info
    }

    /// The cameras, as given.
    pub fn cameras(&self) -> impl ExactSizeIterator<Item = &CameraSpec> {
        self.targets.iter().map(|t| &t.spec)
    }

    /// Draws some of the cameras and waits for the pictures, in the order asked for.
    ///
    /// # Errors
    /// When a camera does not exist, the snapshot is of another scene, or the adapter fails.
    pub fn render(
        &mut self,
        snapshot: &Snapshot,
        cameras: &[usize],
    ) -> Result<Vec<Frame>, RenderError> {
        self.submit(snapshot, cameras)?;
        self.collect()
    }

    fn check_failure(&self) -> Result<(), RenderError> {
        let mut slot = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        match slot.take() {
            None => Ok(()),
            Some(reason) => Err(self.failed(reason)),
        }
    }

    fn failed(&self, reason: String) -> RenderError {
        RenderError::Device {
            adapter: self.info.name.clone(),
            reason,
        }
    }

    fn submit(&mut self, snapshot: &Snapshot, cameras: &[usize]) -> Result<(), RenderError> {
        self.check_request(snapshot, cameras)?;
        let poses: Vec<Isometry3<f64>> = self
            .geometry
            .bodies
            .iter()
            .map(|b| world_from(b.binding, snapshot))
            .collect();
        let rows: Vec<BodyRow> = poses
            .iter()
            .zip(&self.geometry.bodies)
            .map(|(pose, body)| body_row(pose, body.instance))
            .collect();
        self.queue
            .write_buffer(&self.geometry.body_rows, 0, bytemuck::cast_slice(&rows));
        let views: Vec<View> = cameras
            .iter()
            .map(|&c| {
                let spec = &self.targets[c].spec;
                View::new(spec, &world_from(spec.binding, snapshot))
            })
            .collect();

        let mut encoder = self.device.create_command_encoder(&Default::default());
        for (&c, view) in cameras.iter().zip(&views) {
            let block = self.uniform(view);
            self.queue
                .write_buffer(&self.targets[c].uniform, 0, bytemuck::cast_slice(&block));
        }
        if let (true, Some(&first)) = (self.tier.has_shadows(), cameras.first()) {
            self.draw_shadow(&mut encoder, first, &rows);
        }
        for (&c, view) in cameras.iter().zip(&views) {
            let seen = self.geometry.seen(view, &poses);
            self.draw_camera(&mut encoder, c, &seen);
            let target = &self.targets[c];
            Layout::of(target).copy(&mut encoder, target, &self.read[c]);
        }
        let submission = self.queue.submit([encoder.finish()]);
        for &c in cameras {
            self.read[c].map_async(wgpu::MapMode::Read, .., |_| {});
        }
        self.pending = Some(Pending {
            submission,
            cameras: cameras
                .iter()
                .zip(&views)
                .map(|(&c, view)| (c, view.world_from_optical))
                .collect(),
        });
        Ok(())
    }

    fn collect(&mut self) -> Result<Vec<Frame>, RenderError> {
        let Some(pending) = self.pending.take() else {
            return Ok(Vec::new());
        };
        self.device
            .poll(wgpu::PollType::Wait {
                submission_index: Some(pending.submission),
                timeout: None,
            })
            .map_err(|e| self.failed(e.to_string()))?;
        self.check_failure()?;
        let unpacked = std::thread::scope(|scope| {
            let jobs: Vec<_> = pending
                .cameras
                .iter()
                .map(|&(c, _)| {
                    let (target, buffer) = (&self.targets[c], &self.read[c]);
                    scope.spawn(move || -> Result<[Bytes; 3], String> {
                        let mapped = buffer.get_mapped_range(..).map_err(|e| e.to_string())?;
                        Ok(Layout::of(target).unpack(&mapped, target.spec.range))
                    })
                })
                .collect();
            jobs.into_iter()
                .map(|job| {
                    job.join()
                        .unwrap_or_else(|_| Err("reading a picture failed".into()))
                })
                .collect::<Vec<_>>()
        });
        let mut frames = Vec::with_capacity(unpacked.len());
        for (&(camera, world_from_optical), bytes) in pending.cameras.iter().zip(unpacked) {
            self.read[camera].unmap();
            let [rgb, depth, ids] = bytes.map_err(|reason| self.failed(reason))?;
            frames.push(Frame {
                camera,
                intrinsics: self.targets[camera].spec.intrinsics,
                world_from_optical,
                rgb,
                depth,
                ids,
            });
        }
        Ok(frames)
    }

    fn check_request(&self, snapshot: &Snapshot, cameras: &[usize]) -> Result<(), RenderError> {
        let found = [snapshot.links.len(), snapshot.objects.len()];
        for (kind, k) in [("links", 0), ("objects", 1)] {
            if found[k] != self.expected[k] {
                return Err(RenderError::SnapshotMismatch {
                    kind,
                    found: found[k],
                    expected: self.expected[k],
                });
            }
        }
        for (i, &index) in cameras.iter().enumerate() {
            if index >= self.targets.len() {
                return Err(RenderError::NoSuchCamera {
                    index,
                    count: self.targets.len(),
                });
            }
            if cameras[..i].contains(&index) {
                return Err(RenderError::BadCamera {
                    camera: self.targets[index].spec.name.clone(),
                    reason: "it was asked for twice at once".into(),
                });
            }
        }
        Ok(())
    }

    fn uniform(&self, view: &View) -> [f32; 56] {
        let light = &self.lighting;
        let eye = view.world_from_optical.translation.vector.cast::<f32>();
        let texel = [
            1.0 / self.tier.shadow_size as f32,
            self.shadow.sun.texel as f32,
            0.0,
        ];
        let mut block = [0.0; 56];
        block[..16].copy_from_slice(&columns(&view.clip_from_world));
        block[16..32].copy_from_slice(&columns(&self.shadow.sun.clip_from_world));
        let vectors = [
            [eye.x, eye.y, eye.z],
            light.sun_direction,
            light.sun,
            light.sky,
            light.ground,
            texel,
        ];
        for (k, v) in vectors.iter().enumerate() {
            block[32 + 4 * k..35 + 4 * k].copy_from_slice(v);
        }
        block
    }

    fn draw_shadow(&mut self, encoder: &mut wgpu::CommandEncoder, camera: usize, rows: &[BodyRow]) {
        let bodies = &self.geometry.bodies;
        let casters = || (0..bodies.len()).filter(|&b| !bodies[b].casters.is_empty());
        let places: Vec<BodyRow> = casters().map(|b| rows[b]).collect();
        if !self.shadow.drawn_for.is_empty() && self.shadow.drawn_for == places {
            return;
        }
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            depth_stencil_attachment: Some(depth_attachment(&self.shadow.picture.view, 1.0, true)),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines.caster);
        pass.set_bind_group(0, &self.scene_groups[camera], &[]);
        self.geometry.set(&mut pass);
        for b in casters() {
            for range in &bodies[b].casters {
                pass.draw_indexed(range.clone(), 0, 0..1);
            }
        }
        drop(pass);
        self.shadow.drawn_for = places;
    }

    fn draw_camera(&self, encoder: &mut wgpu::CommandEncoder, camera: usize, seen: &[Seen<'_>]) {
        let target = &self.targets[camera];
        let (view, resolve, depth) = match &target.samples {
            None => (&target.color.view, None, &target.depth.view),
            Some([color, depth]) => (color, Some(&target.color.view), depth),
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(&target.spec.name),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: resolve,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(background(&self.lighting)),
                    store: if resolve.is_some() {
                        wgpu::StoreOp::Discard
                    } else {
                        wgpu::StoreOp::Store
                    },
                },
            })],
            depth_stencil_attachment: Some(depth_attachment(depth, 0.0, resolve.is_none())),
            ..Default::default()
        });
        pass.set_bind_group(0, &self.scene_groups[camera], &[]);
        pass.set_bind_group(1, &self.shadow_group, &[]);
        self.geometry.set(&mut pass);
        for (textured, pipeline) in [
            (false, &self.pipelines.plain),
            (true, &self.pipelines.textured),
        ] {
            pass.set_pipeline(pipeline);
            for s in seen.iter().filter(|s| s.batch.textured == textured) {
                pass.draw_indexed(s.indices(), 0, 0..1);
            }
        }
        drop(pass);
        if let (Some(ids), Some(pipeline)) = (&target.ids, &self.pipelines.outline) {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("ids"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &ids.view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(depth_attachment(&target.depth.view, 0.0, true)),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &self.scene_groups[camera], &[]);
            self.geometry.set(&mut pass);
            for s in seen {
                pass.draw_indexed(s.indices(), 0, 0..1);
            }
        }
    }
}

/// A batch in view.
struct Seen<'a> {
    batch: &'a Batch,
    coarse: bool,
}

impl Seen<'_> {
    fn indices(&self) -> std::ops::Range<u32> {
        if self.coarse {
            self.batch.coarse.clone()
        } else {
            self.batch.full.clone()
        }
    }
}

impl Geometry {
    fn upload(device: &wgpu::Device, buffers: &Buffers) -> Self {
        let filled = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        Self {
            vertices: filled(
                "vertices",
                bytemuck::cast_slice(&buffers.vertices),
                wgpu::BufferUsages::VERTEX,
            ),
            indices: filled(
                "indices",
                bytemuck::cast_slice(&buffers.indices),
                wgpu::BufferUsages::INDEX,
            ),
            body_rows: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("bodies"),
                size: (buffers.bodies.len().max(1) * std::mem::size_of::<BodyRow>()) as u64,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            bodies: buffers.bodies.clone(),
            batches: buffers.batches.clone(),
        }
    }

    fn set(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
    }

    /// Batches in view, near ones first; large ones (walls, floor) last, they are mostly hidden.
    fn seen(&self, view: &View, poses: &[Isometry3<f64>]) -> Vec<Seen<'_>> {
        let mut seen: Vec<(f64, Seen<'_>)> = self
            .batches
            .iter()
            .filter_map(|batch| {
                let centre: Point3<f64> = poses[batch.body] * batch.centre;
                let distance = view.distance(&centre, batch.radius)?;
                let late = if batch.radius > 1.5 { 100.0 } else { 0.0 };
                let coarse = distance > view.focal * COARSE_BELOW;
                Some((distance + late, Seen { batch, coarse }))
            })
            .collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        seen.into_iter().map(|(_, s)| s).collect()
    }
}

fn world_from(binding: Binding, snapshot: &Snapshot) -> Isometry3<f64> {
    match binding {
        Binding::World => Isometry3::identity(),
        Binding::Link(i) => snapshot.links[i].pose,
        Binding::Object(i) => snapshot.objects[i].pose,
    }
}

fn body_row(pose: &Isometry3<f64>, instance: u8) -> BodyRow {
    let m = pose.to_homogeneous();
    let mut row = [0.0; 16];
    for r in 0..3 {
        for c in 0..4 {
            row[4 * r + c] = m[(r, c)] as f32;
        }
    }
    row[12] = f32::from(instance) / 255.0;
    row[13] = 1.0;
    row
}

fn depth_attachment(
    view: &wgpu::TextureView,
    clear: f32,
    keep: bool,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Clear(clear),
            store: if keep {
                wgpu::StoreOp::Store
            } else {
                wgpu::StoreOp::Discard
            },
        }),
        stencil_ops: None,
    }
}

/// Sky where nothing is hit, as the shader would show it; id 0.
fn background(light: &Lighting) -> wgpu::Color {
    let show = |c: f32| f64::from((c * (6.2 * c + 0.5)) / (c * (6.2 * c + 1.7) + 0.06));
    let [r, g, b] = light.sky.map(|c| show(c * 1.5));
    wgpu::Color { r, g, b, a: 0.0 }
}

fn samplers(device: &wgpu::Device) -> [wgpu::Sampler; 2] {
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

fn bind(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .enumerate()
        .map(|(i, resource)| wgpu::BindGroupEntry {
            binding: i as u32,
            resource: resource.clone(),
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries,
    })
}

fn upload_pictures(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    patterns: &[String],
) -> wgpu::TextureView {
    let painted: Vec<_> = std::thread::scope(|scope| {
        let jobs: Vec<_> = patterns
            .iter()
            .map(|name| scope.spawn(|| texture::paint(name)))
            .collect();
        jobs.into_iter()
            .filter_map(|job| job.join().ok().flatten())
            .collect()
    });
    let none = patterns.is_empty();
    let side = if none { 1 } else { texture::SIZE as u32 };
    let bytes: Vec<u8> = if none {
        vec![255; 4]
    } else {
        painted
            .into_iter()
            .flat_map(|p| p.levels)
            .flatten()
            .collect()
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
