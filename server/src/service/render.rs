//! The render thread: renders images that are due and publishes them. Its queue is
//! short and blocking, so no image is skipped; the simulation slows down instead.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

use parking_lot::Mutex;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::{StreamId, v1};
use wheelarm_sensor_models::Surface;

use super::compressed::{Compressed, Exact};
use super::convert;
use super::error::ServiceError;
use super::malloc_trim;
use super::outbox::Outbox;
use super::person;
use super::pick::Picked;
use super::preview::Previews;
use super::priority::step_back;
use super::sensor_images::{DepthView, SensorImages};
use super::wakeup::Wakeup;
use crate::appearance::SampledAppearance;
use crate::people::Person;
use crate::robot::RobotModel;
use crate::scene::Scene;
use crate::sensors::camera::{
    Binding, CameraSpec, Frame, Graphics, IN_FLIGHT, Intrinsics, RenderError, RenderScene, Renderer,
};
use crate::sensors::models;
use crate::sim::{CameraSetting, Scenario, Simulation};
use crate::snapshot::Snapshot;

/// Batches that may wait to be rendered.
const QUEUE: usize = 2;

enum Job {
    Draw {
        snapshot: Arc<Snapshot>,
        cameras: Vec<usize>,
        episode: u64,
    },
    Drain(SyncSender<()>),
}

/// Handle of the render thread; ends with it.
pub struct RenderThread {
    jobs: Option<SyncSender<Job>>,
    thread: Option<JoinHandle<()>>,
    /// Batches that wait or are being rendered.
    pending: Arc<AtomicUsize>,
    failed: Arc<Mutex<Option<String>>>,
    outbox: Arc<Outbox>,
    previews: Arc<Previews>,
    picked: Arc<Picked>,
    sensor_images: Arc<SensorImages>,
    compressed: Arc<Compressed>,
    names: Vec<String>,
    /// Graphics adapter, driver and type.
    pub adapter: String,
    /// Legend of the instance ids.
    pub instances: Vec<v1::Instance>,
}

struct Setup {
    scene: Scene,
    model: RobotModel,
    assets: PathBuf,
    scenario: Scenario,
    graphics: Graphics,
    person: Option<Arc<Person>>,
    /// State to render.
    snapshot: Arc<Snapshot>,
}

impl Setup {
    /// Renderer of the scenario's cameras, followed by the views of depth sensors.
    fn renderer(&self, views: &[DepthView]) -> Result<(Renderer, RenderScene), RenderError> {
        let appearance = self
            .scenario
            .appearance
            .filter(|appearance| !appearance.is_plain());
        let appearance = appearance
            .map(|appearance| SampledAppearance::new(appearance, &self.scene, &self.assets));
        let appearance = appearance.transpose()?;
        let scene = RenderScene::with_meshes(
            &self.model,
            &self.scene,
            &self.assets,
            (appearance.as_ref(), self.person.as_ref()),
            self.graphics.meshes(),
        )?;
        let mut cameras = self
            .scenario
            .cameras
            .iter()
            .map(|c| self.camera(c))
            .collect::<Result<Vec<_>, _>>()?;
        let views = views.iter().filter_map(|view| {
            let camera = cameras.get(view.camera)?;
            Some(models::depth_view(camera, &view.parameters))
        });
        let views: Vec<CameraSpec> = views.collect();
        cameras.extend(views);
        let quality = self.scenario.quality;
        let renderer = Renderer::over(&self.graphics, &scene, &cameras, quality)?;
        Ok((renderer, scene))
    }
}

impl Setup {
    fn camera(&self, setting: &CameraSetting) -> Result<CameraSpec, RenderError> {
        let mut spec = self.described(&setting.name, setting.size)?;
        if let Some(lens) = setting.lens {
            let [width, height] = lens.size;
            let ([fx, fy], [cx, cy]) = (lens.focal, lens.principal);
            let lens = Intrinsics {
                width,
                height,
                fx,
                fy,
                cx,
                cy,
            };
            spec.intrinsics = lens.resized(setting.size);
        }
        if let Some(place) = &setting.place {
            let mut frames = self.model.roles.frames.iter();
            // A frame of the robot, or else the house: the simulation has checked it.
            let frame = frames.find(|frame| frame.name == place.frame);
            spec.binding = frame.map_or(Binding::World, |frame| Binding::Link(frame.link));
            spec.mount = place.pose;
        }
        Ok(spec)
    }

    /// The camera as described by the robot or the scene.
    fn described(&self, name: &str, size: [u32; 2]) -> Result<CameraSpec, RenderError> {
        if name == "room" {
            return Ok(CameraSpec::room(&self.scene, size));
        }
        let cameras = &self.model.settings.cameras;
        let mount = cameras.iter().find(|c| c.name == name).ok_or_else(|| {
            let known: Vec<_> = cameras.iter().map(|c| c.name.as_str()).collect();
            RenderError::BadCamera {
                camera: name.to_owned(),
                reason: format!("unknown; available: {}, room", known.join(", ")),
            }
        })?;
        CameraSpec::on_robot(&self.model, mount, size)
    }
}

/// Opens a graphics device on its own thread while something else is set up: a driver
/// takes longer to start than a simulation. Waits for it when dropped, since drivers
/// fail when the process ends while they start.
#[derive(Debug)]
pub struct OpenAhead(Option<JoinHandle<()>>);

impl OpenAhead {
    /// Starts the thread. If it cannot be started, the renderer opens the device.
    #[must_use]
    pub fn begin(graphics: &Graphics) -> Self {
        let graphics = graphics.clone();
        let opening = move || {
            // Threads of the driver keep the low priority.
            step_back();
            graphics.open_ahead();
        };
        let thread = std::thread::Builder::new().name("graphics".to_owned());
        Self(thread.spawn(opening).ok())
    }
}

impl Drop for OpenAhead {
    fn drop(&mut self) {
        // After a panic nothing is open, and the renderer reports it.
        let _ = self.0.take().map(JoinHandle::join);
    }
}

impl RenderThread {
    /// Starts rendering for a simulation; returns when the renderer is ready.
    ///
    /// # Errors
    /// [`ServiceError`] with the fix, for example without a Vulkan driver.
    pub fn start(
        sim: &Simulation,
        graphics: &Graphics,
        depth: Depth,
        outbox: Arc<Outbox>,
        wakeup: Arc<Wakeup>,
    ) -> Result<Self, ServiceError> {
        let setup = Setup {
            scene: sim.scene().clone(),
            model: sim.model().clone(),
            assets: sim.assets().to_owned(),
            scenario: sim.scenario().clone(),
            graphics: graphics.clone(),
            person: sim.person().cloned(),
            snapshot: Arc::clone(sim.snapshot()),
        };
        let names: Vec<String> = setup
            .scenario
            .cameras
            .iter()
            .map(|c| c.name.clone())
            .collect();
        let previews = Arc::new(Previews::start(&outbox, &names)?);
        let picked = Arc::new(Picked::for_cameras(&names));
        let surfaces = match sim.devices().iter().any(|d| d.model.depth.is_some()) {
            true => surfaces(&setup)?,
            false => Vec::new(),
        };
        let sensor_images =
            SensorImages::start(sim.devices(), &drawn(&setup), surfaces, &outbox, &wakeup)?;
        let sensor_images = Arc::new(sensor_images);
        let compressed = Arc::new(Compressed::start(&names, depth, &outbox, &wakeup)?);
        let (jobs, queue) = mpsc::sync_channel(QUEUE);
        let (ready, standing) = mpsc::sync_channel(1);
        let pending = Arc::new(AtomicUsize::new(0));
        let failed = Arc::new(Mutex::new(None));
        let thread = {
            let (failed, waiting) = (Arc::clone(&failed), Arc::clone(&pending));
            let (outbox, previews) = (Arc::clone(&outbox), Arc::clone(&previews));
            let picked = Arc::clone(&picked);
            let sensor_images = Arc::clone(&sensor_images);
            let compressed = Arc::clone(&compressed);
            let names = names.clone();
            std::thread::Builder::new()
                .name("render".to_owned())
                .spawn(move || {
                    step_back();
                    let views = sensor_images.depth_views();
                    let mut renderer = match setup.renderer(views) {
                        Ok((renderer, scene)) => {
                            let adapter = renderer.adapter().to_string();
                            let legend = legend(&scene);
                            let _ = ready.send(Ok((adapter, legend)));
                            renderer
                        }
                        Err(e) => {
                            let _ = ready.send(Err(e));
                            return;
                        }
                    };
                    let mut is_first = true;
                    let first = drawn(&setup).iter().position(|name| !name.is_empty());
                    let snapshot = Arc::clone(&setup.snapshot);
                    drop(setup);
                    let work = std::panic::AssertUnwindSafe(|| {
                        if let Some(camera) = first {
                            if let Err(error) = renderer.warm_up(&snapshot, camera) {
                                // The first image that a client requests reports the
                                // error.
                                tracing::debug!("a first image: {error}");
                            }
                            malloc_trim::trim();
                        }
                        drop(snapshot);
                        let wanted = |camera: usize| {
                            let wanted = outbox.wants_compressed(&names[camera]);
                            wanted.then_some(depth)
                        };
                        let beside = |camera: usize| {
                            let views = (names.len()..).zip(views);
                            let beside = views.filter(move |(_, view)| view.camera == camera);
                            beside.map(|(index, _)| index)
                        };
                        draw(&mut renderer, &queue, wanted, beside, |frames, of| {
                            let (episode, tick) = (of.episode, of.snapshot.tick);
                            for mut frame in frames {
                                let deflated = std::mem::take(&mut frame.deflated);
                                let Some(name) = names.get(frame.camera) else {
                                    sensor_images.offer(&frame, episode, tick);
                                    continue;
                                };
                                if previews.offer(&frame, episode, tick) {
                                    picked.keep(&frame, tick);
                                }
                                sensor_images.offer(&frame, episode, tick);
                                let (camera, frame) = (frame.camera, message(name, frame));
                                let published = outbox.camera(name, episode, tick, frame.clone());
                                let image = Exact {
                                    frame,
                                    deflated,
                                    published,
                                    episode,
                                    tick,
                                };
                                compressed.offer(camera, image);
                            }
                            waiting.fetch_sub(1, Ordering::AcqRel);
                            wakeup.raise();
                            // Shaders are compiled at their first use.
                            if std::mem::take(&mut is_first) {
                                malloc_trim::trim();
                            }
                        })
                    });
                    let failure = match std::panic::catch_unwind(work) {
                        Ok(Ok(())) => return,
                        Ok(Err(e)) => e.to_string(),
                        Err(_) => "drawing panicked; please report it".to_owned(),
                    };
                    *failed.lock() = Some(failure);
                    wakeup.raise();
                })
        };
        let thread = thread.map_err(|e| ServiceError::Thread(format!("for cameras: {e}")))?;
        let (adapter, instances) = standing
            .recv()
            .map_err(|_| ServiceError::Thread("for cameras ended early".to_owned()))??;
        Ok(Self {
            jobs: Some(jobs),
            thread: Some(thread),
            pending,
            failed,
            outbox,
            previews,
            picked,
            sensor_images,
            compressed,
            names,
            adapter,
            instances,
        })
    }

    /// Whether a client receives the images of a camera, by its index in the scenario.
    #[must_use]
    pub fn is_watched(&self, camera: usize) -> bool {
        let watched = |stream: StreamId| self.outbox.is_watched(&stream);
        let name = self.names.get(camera);
        let sensor_images = |name: &String| watched(StreamId::sensor(name));
        name.is_some_and(|name| {
            self.previews.is_watched(camera)
                || watched(StreamId::camera(name))
                || self
                    .sensor_images
                    .names_on(camera)
                    .iter()
                    .any(sensor_images)
        })
    }

    /// The newest previewed images.
    #[must_use]
    pub fn picked(&self) -> &Arc<Picked> {
        &self.picked
    }

    /// The threads that make the images of sensors.
    #[must_use]
    pub fn sensor_images(&self) -> &SensorImages {
        &self.sensor_images
    }

    /// Whether two batches wait behind the current one.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.pending.load(Ordering::Acquire) > QUEUE
    }

    /// Whether all queued images are rendered and processed by the sensors, or
    /// rendering has failed.
    #[must_use]
    pub fn is_drawn(&self) -> bool {
        let drawn = self.pending.load(Ordering::Acquire) == 0;
        drawn && self.sensor_images.is_idle() || self.failed.lock().is_some()
    }

    /// Whether all queued images are published in every form, or rendering has failed.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.is_drawn() && self.compressed.is_idle()
    }

    /// Queues images; blocks while the queue is full.
    pub fn draw(&self, snapshot: Arc<Snapshot>, cameras: Vec<usize>, episode: u64) {
        if let Some(jobs) = &self.jobs {
            self.pending.fetch_add(1, Ordering::AcqRel);
            let _ = jobs.send(Job::Draw {
                snapshot,
                cameras,
                episode,
            });
        }
    }

    /// Waits until everything queued has been published.
    pub fn drain(&self) {
        let (done, wait) = mpsc::sync_channel(1);
        if let Some(jobs) = &self.jobs
            && jobs.send(Job::Drain(done)).is_ok()
        {
            let _ = wait.recv();
        }
        while !self.compressed.is_idle() {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Why rendering or compression stopped.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        let drawing = self.failed.lock().clone();
        drawing.or_else(|| self.compressed.failure())
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        self.jobs.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Names of the cameras; empty for a camera that is off.
fn drawn(setup: &Setup) -> Vec<String> {
    let cameras = setup.scenario.cameras.iter();
    let name = |c: &CameraSetting| match c.rate_hz > 0.0 {
        true => c.name.clone(),
        false => String::new(),
    };
    cameras.map(name).collect()
}

/// The surface class of each instance ID.
fn surfaces(setup: &Setup) -> Result<Vec<Surface>, ServiceError> {
    let scene = RenderScene::new(&setup.model, &setup.scene, &setup.assets)?;
    Ok(models::surfaces(&setup.assets, &scene)?)
}

/// A batch that is being rendered.
struct PendingBatch {
    snapshot: Arc<Snapshot>,
    episode: u64,
}

/// Renders batches and publishes them. The next batch is rendered while one is read
/// back and sent. `beside` names the views that are rendered with a camera.
fn draw<Views: Iterator<Item = usize>>(
    renderer: &mut Renderer,
    queue: &Receiver<Job>,
    wanted: impl Fn(usize) -> Option<Depth>,
    beside: impl Fn(usize) -> Views,
    mut publish: impl FnMut(Vec<Frame>, PendingBatch),
) -> Result<(), RenderError> {
    let mut flying: VecDeque<PendingBatch> = VecDeque::new();
    loop {
        let job = match flying.len() {
            0 => match queue.recv() {
                Ok(job) => Some(job),
                Err(_) => return Ok(()),
            },
            IN_FLIGHT.. => None,
            _ => queue.try_recv().ok(),
        };
        match job {
            Some(Job::Draw {
                snapshot,
                cameras,
                episode,
            }) => {
                for &camera in &cameras {
                    let wanted = wanted(camera).filter(|_| renderer.deflates(camera));
                    renderer.deflate(camera, wanted);
                }
                let views = cameras.iter().flat_map(|&camera| beside(camera));
                let all: Vec<usize> = cameras.iter().copied().chain(views).collect();
                renderer.submit(&snapshot, &all)?;
                flying.push_back(PendingBatch { snapshot, episode });
                continue;
            }
            Some(Job::Drain(done)) => {
                while let Some(oldest) = flying.pop_front() {
                    publish(renderer.collect()?, oldest);
                }
                // The receiver may have been dropped.
                let _ = done.send(());
            }
            None => {
                if let Some(oldest) = flying.pop_front() {
                    publish(renderer.collect()?, oldest);
                }
            }
        }
    }
}

/// Legend of the instance IDs.
fn legend(scene: &RenderScene) -> Vec<v1::Instance> {
    let kind = |id: u16| {
        let item = scene.items.iter().find(|item| item.instance == id);
        match item.map(|item| &item.binding) {
            Some(Binding::Link(_)) => v1::InstanceKind::Robot,
            Some(Binding::Object(_)) => v1::InstanceKind::Object,
            Some(_) => v1::InstanceKind::Furniture,
            None => v1::InstanceKind::Unspecified,
        }
    };
    let part = |id: u16| {
        let mut parts = scene.person.iter().flat_map(|person| &person.parts);
        parts
            .find(|(instance, _)| *instance == id)
            .map(|(_, part)| *part)
    };
    let legend = scene.instances.iter();
    legend
        .map(|(id, name)| v1::Instance {
            id: u32::from(*id),
            name: name.clone(),
            kind: match part(*id) {
                Some(_) => v1::InstanceKind::Person.into(),
                None => kind(*id).into(),
            },
            part: part(*id)
                .map_or(v1::BodyPart::Unspecified, person::part)
                .into(),
        })
        .collect()
}

fn message(name: &str, frame: Frame) -> v1::CameraFrame {
    let i = frame.intrinsics;
    v1::CameraFrame {
        header: None,
        camera: name.to_owned(),
        intrinsics: Some(v1::Intrinsics {
            width: i.width,
            height: i.height,
            fx: i.fx,
            fy: i.fy,
            cx: i.cx,
            cy: i.cy,
        }),
        pose: Some(convert::pose(&frame.world_from_optical)),
        color: frame.rgb,
        depth: frame.depth,
        segmentation: frame.ids,
        color_format: v1::PixelFormat::Rgb8.into(),
        depth_format: v1::PixelFormat::DepthMetresF32.into(),
        segmentation_format: v1::PixelFormat::IdU16.into(),
    }
}
