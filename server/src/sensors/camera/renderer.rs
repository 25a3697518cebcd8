//! The renderer: uploads a scene once, then renders snapshots of it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use nalgebra::Isometry3;
use parking_lot::Mutex;
use wgpu::util::DeviceExt;
use wheelarm_proto::settings::Depth;

use super::adapter::{self, AdapterInfo};
use super::ambient_map::PlacedCharts;
use super::contact::Nearby;
use super::frame_data::FrameData;
use super::geometry::{BodyRows, Geometry, Order};
use super::graphics::{Graphics, OpenDevice};
use super::image_pass::{ImagePass, Shown, background};
use super::person::PersonMesh;
use super::pipelines::Pipelines;
use super::prepare::{PreparedScene, check_cameras, prepare};
use super::readback::{Buffers as ReadBuffers, ReadBack, Reading};
use super::scene::{Binding, RenderScene, Surrounding};
use super::shadow::{ShadowMap, SunView};
use super::soft::SoftMeshes;
use super::spec::CameraSpec;
use super::surroundings::Surroundings;
use super::target::Target;
use super::tier::Tier;
use super::timing::Timing;
use super::uniform::CameraUniform;
use super::view::View;
use super::{Frame, Quality, RenderError, patterns};
use crate::scene::Lighting;
use crate::snapshot::Snapshot;

/// Renders the cameras of one scene. Used by one thread at a time.
pub struct Renderer {
    info: AdapterInfo,
    device: wgpu::Device,
    queue: wgpu::Queue,
    failure: Arc<Mutex<Option<String>>>,
    broken: Arc<AtomicBool>,
    timing: Timing,
    tier: Tier,
    pipelines: Arc<Pipelines>,
    geometry: Geometry,
    rows: BodyRows,
    soft: SoftMeshes,
    person: Option<PersonMesh>,
    surroundings: Arc<Surroundings>,
    lighting: Lighting,
    surrounding: Option<Surrounding>,
    shadow: ShadowMap,
    targets: Vec<Target>,
    scene_groups: Vec<wgpu::BindGroup>,
    shadow_group: wgpu::BindGroup,
    /// Contacts of one draw, for a CPU adapter, and of all draws; only with contacts.
    contact_groups: Option<[wgpu::BindGroup; 2]>,
    frame: FrameData,
    nearby: Nearby,
    charts: PlacedCharts,
    /// Links, objects and sliding furniture that a snapshot must have.
    expected: [usize; 3],
    /// One per camera.
    read_back: Vec<ReadBack>,
    /// Cameras to deflate, with the form of depth.
    deflated: Vec<Option<Depth>>,
    /// Batches in flight, oldest first.
    pending: VecDeque<Vec<Pending>>,
    /// The current image is discarded: only one of its pixels is rendered.
    is_warming_up: bool,
}

/// Batches that can be submitted before the first one is read: the GPU continues with
/// the second while the first is unpacked and sent.
pub const IN_FLIGHT: usize = 2;

/// A submitted image that is not read yet.
struct Pending {
    submission: wgpu::SubmissionIndex,
    camera: usize,
    world_from_optical: Isometry3<f64>,
    /// Read-back buffers.
    buffers: ReadBuffers,
}

impl Renderer {
    /// All Vulkan adapters of this machine.
    #[must_use]
    pub fn adapters() -> Vec<AdapterInfo> {
        adapter::list()
    }

    /// As [`Renderer::over`] with a separate device. `adapter` is an index, a PCI ID or
    /// a part of an adapter's name; without it the best one is used.
    ///
    /// # Errors
    /// As [`Renderer::over`].
    pub fn new(
        scene: &RenderScene,
        cameras: &[CameraSpec],
        quality: Quality,
        adapter: Option<&str>,
    ) -> Result<Self, RenderError> {
        Self::over(&Graphics::for_adapter(adapter), scene, cameras, quality)
    }

    /// Uploads a scene to a shared device.
    ///
    /// # Errors
    /// Without a Vulkan driver, for an unknown adapter or an invalid camera, or when
    /// the adapter fails.
    pub fn over(
        graphics: &Graphics,
        scene: &RenderScene,
        cameras: &[CameraSpec],
        quality: Quality,
    ) -> Result<Self, RenderError> {
        check_cameras(scene, cameras)?;
        let tier = Tier::for_scene(quality, scene);
        let PreparedScene {
            opened,
            pipelines,
            packer,
            surroundings,
            mut buffers,
            images,
        } = prepare(scene, tier, graphics)?;
        let OpenDevice {
            info,
            device,
            queue,
            failure,
            broken,
        } = opened;
        let sun = SunView::new(scene, &buffers, tier.shadow_size);
        let occluders = std::mem::take(&mut buffers.occluders);
        let nearby = Nearby::new(occluders, &buffers.bodies, &mut buffers.batches);
        let geometry = Geometry::upload(&device, &buffers);
        let soft = SoftMeshes::find(scene, &buffers);
        let person = PersonMesh::find(scene, &buffers);
        let materials = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("materials"),
            contents: bytemuck::cast_slice(&buffers.materials),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let images = graphics.patterns().view(
            (&device, &queue),
            &buffers.patterns,
            &scene.textures,
            images,
        )?;
        let shadow = ShadowMap::new(&device, sun, tier.shadow_size);
        let targets: Vec<Target> = cameras
            .iter()
            .map(|spec| Target::new(&device, spec.clone(), tier))
            .collect();
        let [repeating, comparing, smooth, one_level] = patterns::samplers(&device);
        let reflection = scene.surrounding.as_ref().map(|s| &s.reflection);
        let reflection = patterns::upload_reflection(&device, &queue, reflection);
        let ambient_map = patterns::upload_ambient_map(&device, &queue, &buffers.ambient_map);
        let has_contacts = tier.ambient_per_pixel;
        let frame = FrameData::new(&device, cameras.len(), geometry.bodies.len(), has_contacts);
        let scene_group = |camera: usize| {
            bind(
                &device,
                &pipelines.scene_layout,
                &[
                    frame.camera_binding(camera),
                    frame.bodies_binding(),
                    materials.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&images),
                    wgpu::BindingResource::Sampler(&repeating),
                    wgpu::BindingResource::TextureView(&reflection),
                    wgpu::BindingResource::Sampler(&smooth),
                    wgpu::BindingResource::TextureView(&ambient_map),
                    wgpu::BindingResource::Sampler(&one_level),
                ],
            )
        };
        let scene_groups = (0..cameras.len()).map(scene_group).collect();
        let shadow_group = bind(
            &device,
            &pipelines.shadow_layout,
            &[
                wgpu::BindingResource::TextureView(&shadow.image.view),
                wgpu::BindingResource::Sampler(&comparing),
            ],
        );
        let contact_groups = has_contacts.then(|| {
            let (one, all) = (&pipelines.contact_layout, &pipelines.all_contacts_layout);
            [
                bind(&device, one, &[frame.contacts_binding()]),
                bind(&device, all, &[frame.all_contacts_binding()]),
            ]
        });
        let sky = background(&scene.lighting);
        let read_back = |target: &Target| ReadBack::new(&device, target, packer.as_ref(), sky);
        let read_back = targets.iter().map(read_back).collect();
        let renderer = Self {
            shadow,
            lighting: scene.lighting,
            surrounding: scene.surrounding.clone(),
            surroundings,
            expected: [scene.links, scene.objects, scene.sliding],
            info,
            timing: Timing::new(&device, &queue),
            device,
            queue,
            failure,
            broken,
            tier,
            pipelines,
            geometry,
            rows: BodyRows::default(),
            soft,
            person,
            targets,
            scene_groups,
            shadow_group,
            contact_groups,
            frame,
            nearby,
            charts: buffers.ambient_map.charts,
            deflated: vec![None; cameras.len()],
            read_back,
            pending: VecDeque::new(),
            is_warming_up: false,
        };
        renderer.check_failure()?;
        Ok(renderer)
    }

    /// The adapter used for rendering.
    #[must_use]
    pub fn adapter(&self) -> &AdapterInfo {
        &self.info
    }

    /// The cameras, as given.
    pub fn cameras(&self) -> impl ExactSizeIterator<Item = &CameraSpec> {
        self.targets.iter().map(|t| &t.spec)
    }

    /// Whether the GPU deflates the images of a camera faster than the CPU, if
    /// requested; by its index.
    #[must_use]
    pub fn deflates(&self, camera: usize) -> bool {
        self.read_back.get(camera).is_some_and(ReadBack::deflates)
    }

    /// Whether to deflate the images of a camera from the next on, if the adapter can,
    /// and the stored form of depth; by its index.
    pub fn deflate(&mut self, camera: usize, wanted: Option<Depth>) {
        if let Some(deflated) = self.deflated.get_mut(camera) {
            *deflated = wanted;
        }
    }

    /// Renders an image and discards it, if the pipelines have not been used: drivers
    /// compile at first use, however many pixels are rendered.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn warm_up(&mut self, snapshot: &Snapshot, camera: usize) -> Result<(), RenderError> {
        if self.pipelines.drew.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.is_warming_up = true;
        let rendered = self.render(snapshot, &[camera]);
        self.is_warming_up = false;
        rendered.map(drop)
    }

    /// Renders some of the cameras and waits for the images, in the given order.
    ///
    /// # Errors
    /// When a camera does not exist, the snapshot is of another scene, a batch is
    /// in flight, or the adapter fails.
    pub fn render(
        &mut self,
        snapshot: &Snapshot,
        cameras: &[usize],
    ) -> Result<Vec<Frame>, RenderError> {
        if !self.pending.is_empty() {
            return Err(RenderError::InFlight);
        }
        self.submit(snapshot, cameras)?;
        self.collect()
    }

    /// Submits images of some of the cameras. Up to [`IN_FLIGHT`] batches can be
    /// submitted before the first one is collected.
    ///
    /// # Errors
    /// As [`Renderer::render`], and when too many batches are in flight.
    pub fn submit(&mut self, snapshot: &Snapshot, cameras: &[usize]) -> Result<(), RenderError> {
        self.check_request(snapshot, cameras)?;
        if self.pending.len() == IN_FLIGHT {
            return Err(RenderError::InFlight);
        }
        let poses: Vec<Isometry3<f64>> = self
            .geometry
            .bodies
            .iter()
            .map(|b| world_from(b.binding, snapshot))
            .collect();
        let changed = self
            .rows
            .update(&poses, &self.geometry.bodies, &self.surroundings);
        if changed {
            self.frame.set_bodies(self.rows.all());
        }
        self.soft.write(&self.queue, &self.geometry, snapshot);
        if let Some(person) = &mut self.person
            && person.write(&self.queue, &self.geometry, snapshot)
        {
            self.shadow.changes(person.bodies());
        }
        let views: Vec<View> = cameras
            .iter()
            .map(|&c| {
                let spec = &self.targets[c].spec;
                View::new(spec, &world_from(spec.binding, snapshot))
            })
            .collect();

        self.frame.begin();
        for (&c, view) in cameras.iter().zip(&views) {
            let sun = &self.shadow.sun;
            let texel = [1.0 / self.tier.shadow_size as f32, sun.texel as f32];
            let block = CameraUniform::new(
                view,
                &self.lighting,
                &sun.clip_from_world,
                texel,
                self.surrounding.as_ref(),
            );
            self.frame.set_camera(c, &block);
        }
        let outdated = match self.tier.has_shadows() && !cameras.is_empty() {
            true => self.shadow.update(&mut self.frame, &self.geometry, &poses),
            false => None,
        };
        let shown = self.find_shown(cameras, &views, &poses);
        self.frame.upload(&self.queue);

        let mut encoder = self.device.create_command_encoder(&Default::default());
        self.timing.begins(&mut encoder, "shadow");
        if let (Some(outdated), Some(&first)) = (outdated, cameras.first()) {
            let group = &self.scene_groups[first];
            let frame = (&self.frame, self.is_on_gpu(first));
            let (pipelines, geometry) = (&self.pipelines, &self.geometry);
            self.shadow
                .record(&mut encoder, pipelines, group, geometry, frame, outdated);
        }
        self.timing.begins(&mut encoder, "draw");
        // All images are rendered before the first is copied: a copy waits for its
        // source, and a CPU adapter renders nothing meanwhile.
        for (&c, shown) in cameras.iter().zip(&shown) {
            self.image_pass(c).record(&mut encoder, shown);
        }
        let mut buffers = Vec::with_capacity(cameras.len());
        for &c in cameras {
            let (read_back, target) = (&self.read_back[c], &self.targets[c]);
            let deflated = self.deflated[c];
            let on = (&self.device, &self.queue);
            let (encoder, timing) = (&mut encoder, &self.timing);
            buffers.push(read_back.copy(on, encoder, target, deflated, timing));
        }
        self.timing.ends(&self.device, &mut encoder);
        self.pipelines.drew.store(true, Ordering::Relaxed);
        let submission = self.queue.submit([encoder.finish()]);
        let mut images = Vec::with_capacity(cameras.len());
        for ((&camera, view), buffers) in cameras.iter().zip(&views).zip(buffers) {
            buffers.map();
            images.push(Pending {
                submission: submission.clone(),
                camera,
                world_from_optical: view.world_from_optical,
                buffers,
            });
        }
        self.pending.push_back(images);
        Ok(())
    }

    /// Waits for the images of the oldest batch, in the given order; returns none when
    /// nothing is in flight.
    ///
    /// # Errors
    /// When the adapter fails.
    pub fn collect(&mut self) -> Result<Vec<Frame>, RenderError> {
        let Some(images) = self.pending.pop_front() else {
            return Ok(Vec::new());
        };
        let read = std::thread::scope(|scope| -> Result<Vec<_>, RenderError> {
            let mut jobs = Vec::with_capacity(images.len());
            for p in &images {
                self.device
                    .poll(wgpu::PollType::Wait {
                        submission_index: Some(p.submission.clone()),
                        timeout: None,
                    })
                    .map_err(|e| {
                        // The first error of the adapter is the cause.
                        let first = self.failure.lock().take();
                        self.failed(first.unwrap_or_else(|| e.to_string()))
                    })?;
                self.check_failure()?;
                let (read_back, buffers) = (&self.read_back[p.camera], p.buffers.clone());
                let read = move || read_back.image(buffers);
                jobs.push(match read_back.is_packed() {
                    true => Reading::Done(read()),
                    false => Reading::UnderWay(scope.spawn(read)),
                });
            }
            Ok(jobs.into_iter().map(Reading::wait).collect())
        })?;
        self.timing.read(&self.device);
        let mut frames = Vec::with_capacity(read.len());
        for (p, image) in images.iter().zip(read) {
            let ([rgb, depth, ids], deflated) = image.map_err(|reason| self.failed(reason))?;
            frames.push(Frame {
                camera: p.camera,
                intrinsics: self.targets[p.camera].spec.intrinsics,
                world_from_optical: p.world_from_optical,
                rgb,
                depth,
                ids,
                deflated,
            });
        }
        Ok(frames)
    }

    /// GPU time of each part of the images since the last call; empty unless the device
    /// is [`Graphics::timed`].
    pub fn spent(&self) -> Vec<(&'static str, Duration)> {
        self.timing.spent()
    }

    #[cfg(test)]
    pub(super) fn ring(&self, camera: usize) -> &super::ring::Ring {
        self.read_back[camera].ring()
    }

    fn check_failure(&self) -> Result<(), RenderError> {
        let mut slot = self.failure.lock();
        match slot.take() {
            None => Ok(()),
            Some(reason) => Err(self.failed(reason)),
        }
    }

    fn failed(&self, reason: String) -> RenderError {
        self.broken.store(true, Ordering::Release);
        RenderError::Device {
            adapter: self.info.name.clone(),
            reason,
        }
    }

    fn check_request(&self, snapshot: &Snapshot, cameras: &[usize]) -> Result<(), RenderError> {
        let found = [
            snapshot.links.len(),
            snapshot.objects.len(),
            snapshot.sliding.len(),
        ];
        for (kind, k) in [("links", 0), ("objects", 1), ("pieces of furniture", 2)] {
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
                    reason: "it was requested twice in one batch".into(),
                });
            }
        }
        Ok(())
    }

    /// Whether a GPU renders the images of a camera.
    fn is_on_gpu(&self, camera: usize) -> bool {
        self.read_back[camera].order() == Order::Finish
    }

    fn image_pass(&self, camera: usize) -> ImagePass<'_> {
        let target = &self.targets[camera];
        ImagePass {
            target,
            pipelines: &self.pipelines,
            geometry: &self.geometry,
            frame: &self.frame,
            scene_group: &self.scene_groups[camera],
            shadow_group: &self.shadow_group,
            contact_groups: self.contact_groups.as_ref(),
            sky: background(&self.lighting),
            packs_background: self.read_back[camera].has_background(target),
            is_on_gpu: self.is_on_gpu(camera),
            is_warming_up: self.is_warming_up,
        }
    }

    /// Finds what each camera shows, and adds its draws and contacts to the frame.
    fn find_shown(
        &mut self,
        cameras: &[usize],
        views: &[View],
        poses: &[Isometry3<f64>],
    ) -> Vec<Shown> {
        let (geometry, frame) = (&self.geometry, &mut self.frame);
        self.nearby.place(poses);
        let mut shown = Vec::with_capacity(cameras.len());
        for (&c, view) in cameras.iter().zip(views) {
            let order = self.read_back[c].order();
            let mut contacts = match self.tier.ambient_per_pixel {
                true => Some(self.nearby.in_view(view, &geometry.batches, &self.charts)),
                false => None,
            };
            let visible = geometry.visible(view, poses, order, contacts.as_mut());
            let first_list = frame.next_list();
            let mut variants = Vec::new();
            if let Some(contacts) = contacts {
                frame.add_lists(&contacts.bytes());
                variants = contacts.variants();
            }
            let first_draw = frame.next_draw();
            for range in &visible {
                frame.add_draw(&range.indices, range.ambient.instance(first_list));
            }
            shown.push(Shown {
                visible,
                first_draw,
                first_list,
                variants,
            });
        }
        shown
    }
}

fn world_from(binding: Binding, snapshot: &Snapshot) -> Isometry3<f64> {
    match binding {
        Binding::World => Isometry3::identity(),
        Binding::Link(i) => snapshot.links[i].pose,
        Binding::Object(i) => snapshot.objects[i].pose,
        Binding::Sliding(i) => snapshot.sliding[i].pose,
    }
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
