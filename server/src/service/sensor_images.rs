//! Images of simulated sensors. Each sensor of the scenario has its own thread, which
//! converts exact images and publishes each result when it arrives. Nothing is computed
//! on the simulation thread.
//!
//! A color sensor uses the images of its camera. A depth sensor uses a view of its own,
//! which the render thread renders with the camera and does not publish.
//!
//! The images published in an episode depend only on the exact images, the seeds and
//! the last tick, not on the wall clock.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

use wheelarm_proto::random::fnv1a;
use wheelarm_proto::{PHYSICS_HZ, stamp_nanos, v1};
use wheelarm_sensor_models::color::ColorModel;
use wheelarm_sensor_models::delay::{Delay, DelayLine};
use wheelarm_sensor_models::depth::{DepthModel, DepthParameters};
use wheelarm_sensor_models::noise::Random;
use wheelarm_sensor_models::{Exact, Lens, Surface};

use super::convert;
use super::error::ServiceError;
use super::outbox::Outbox;
use super::priority::step_back;
use super::wakeup::Wakeup;
use crate::sensors::camera::{Frame, Intrinsics};
use crate::sensors::models::{Device, color_name, depth_name};

/// Exact images that may wait; more block the render thread.
const QUEUE: usize = 2;

/// Polling interval for arrivals while images are delayed.
const LOOK: Duration = Duration::from_millis(2);

enum Job {
    Make {
        frame: Box<Frame>,
        episode: u64,
        tick: u64,
    },
    /// Publish images that have arrived.
    Publish(SyncSender<()>),
    /// End of the episode: publish images that have arrived, drop the rest.
    Settle(SyncSender<()>),
}

/// Episode and tick of the simulation.
#[derive(Default)]
struct SimTick {
    episode: AtomicU64,
    tick: AtomicU64,
}

/// Handle of the threads; they end with it.
pub struct SensorImages {
    sensors: Vec<SensorWorker>,
    now: Arc<SimTick>,
    making: Arc<AtomicUsize>,
    /// The sensors on each camera, by its index in the scenario.
    names: Vec<Vec<String>>,
    kinds: Vec<SensorKind>,
    depth_views: Vec<DepthView>,
}

/// A view through the lens of a depth sensor. View indices follow those of the
/// scenario's cameras.
#[derive(Clone, Debug)]
pub struct DepthView {
    /// The camera with which it is rendered, by its index in the scenario.
    pub camera: usize,
    /// Lens and mount.
    pub parameters: DepthParameters,
}

/// A sensor on a camera.
#[derive(Clone, Debug)]
pub struct SensorKind {
    /// Its name.
    pub name: String,
    /// Name of the camera.
    pub camera: String,
    /// Whether it delivers depth instead of colour.
    pub is_depth: bool,
}

/// Model of a sensor.
enum Kind {
    Color(Box<ColorModel>),
    Depth(Box<DepthModel>),
}

/// State of a sensor.
struct Sensor {
    name: String,
    camera: usize,
    /// Index of the view that it uses.
    view: usize,
    camera_name: String,
    kind: Kind,
    seed: u64,
    rate: f64,
    phase: f64,
    age: Delay,
    on_way: DelayLine<v1::SensorFrame>,
    /// The episode of its state.
    episode: u64,
    /// Number of the last exposure of its clock.
    last: Option<i64>,
}

/// One sensor's thread.
struct SensorWorker {
    view: usize,
    jobs: SyncSender<Job>,
    thread: JoinHandle<()>,
}

/// State of a thread.
struct Worker {
    sensor: Sensor,
    surfaces: Vec<Surface>,
    outbox: Arc<Outbox>,
    now: Arc<SimTick>,
}

impl SensorImages {
    /// Starts the sensors on `cameras`, names in the scenario's order.
    ///
    /// # Errors
    /// When a thread cannot start.
    pub fn start(
        devices: &[Device],
        cameras: &[String],
        surfaces: Vec<Surface>,
        outbox: &Arc<Outbox>,
        wakeup: &Arc<Wakeup>,
    ) -> Result<Self, ServiceError> {
        let mut sensors = Vec::new();
        let mut depth_views = Vec::new();
        for (camera, name) in cameras.iter().enumerate() {
            for device in devices.iter().filter(|device| device.camera == *name) {
                let depth_view = cameras.len() + depth_views.len();
                sensors.extend(on_camera(device, (camera, depth_view), name));
                depth_views.extend(
                    device
                        .model
                        .depth
                        .clone()
                        .map(|parameters| DepthView { camera, parameters }),
                );
            }
        }
        let of_camera = |camera: usize| {
            let own = sensors.iter().filter(|sensor| sensor.camera == camera);
            own.map(|sensor| sensor.name.clone()).collect()
        };
        let names: Vec<Vec<String>> = (0..cameras.len()).map(of_camera).collect();
        let kind = |sensor: &Sensor| SensorKind {
            name: sensor.name.clone(),
            camera: sensor.camera_name.clone(),
            is_depth: matches!(sensor.kind, Kind::Depth(_)),
        };
        let kinds = sensors.iter().map(kind).collect();
        let now = Arc::new(SimTick::default());
        let making = Arc::new(AtomicUsize::new(0));
        let mut at_work = Vec::new();
        for sensor in sensors {
            let (jobs, queue) = mpsc::sync_channel(QUEUE);
            let view = sensor.view;
            let worker = Worker {
                sensor,
                surfaces: surfaces.clone(),
                outbox: Arc::clone(outbox),
                now: Arc::clone(&now),
            };
            let (making, wakeup) = (Arc::clone(&making), Arc::clone(wakeup));
            let started = std::thread::Builder::new()
                .name("sensors".to_owned())
                .spawn(move || {
                    step_back();
                    worker.run(&queue, &making, &wakeup);
                });
            let failed = |e| ServiceError::Thread(format!("for sensors cannot start: {e}"));
            at_work.push(SensorWorker {
                view,
                jobs,
                thread: started.map_err(failed)?,
            });
        }
        Ok(Self {
            sensors: at_work,
            now,
            making,
            names,
            kinds,
            depth_views,
        })
    }

    /// The views of the depth sensors, in the order of their indices.
    #[must_use]
    pub fn depth_views(&self) -> &[DepthView] {
        &self.depth_views
    }

    /// Names of the sensors on a camera.
    #[must_use]
    pub fn names_on(&self, camera: usize) -> &[String] {
        self.names.get(camera).map_or(&[], Vec::as_slice)
    }

    /// Names of all sensors, by camera.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.names.concat()
    }

    /// All sensors, by camera.
    #[must_use]
    pub fn kinds(&self) -> &[SensorKind] {
        &self.kinds
    }

    /// Queues an exact image of a camera or a depth view; blocks while the queue is
    /// full.
    pub fn offer(&self, frame: &Frame, episode: u64, tick: u64) {
        for sensor in self.sensors.iter().filter(|s| s.view == frame.camera) {
            self.making.fetch_add(1, Ordering::AcqRel);
            let job = Job::Make {
                frame: Box::new(frame.clone()),
                episode,
                tick,
            };
            if sensor.jobs.send(job).is_err() {
                self.making.fetch_sub(1, Ordering::AcqRel);
            }
        }
    }

    /// Whether every queued image is processed.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.making.load(Ordering::Acquire) == 0
    }

    /// Sets the simulation's tick; images that have arrived by then are published.
    pub fn set_tick(&self, episode: u64, tick: u64) {
        self.now.episode.store(episode, Ordering::Release);
        self.now.tick.store(tick, Ordering::Release);
    }

    /// Waits until every image that has arrived is published.
    pub fn publish(&self) {
        self.each(Job::Publish);
    }

    /// Waits until every image that has arrived is published, and drops delayed ones.
    pub fn settle(&self) {
        self.each(Job::Settle);
    }

    /// Sends every sensor a job and waits until all are done.
    fn each(&self, job: fn(SyncSender<()>) -> Job) {
        let acknowledgements: Vec<Receiver<()>> = self
            .sensors
            .iter()
            .filter_map(|sensor| {
                let (done, wait) = mpsc::sync_channel(1);
                sensor.jobs.send(job(done)).ok().map(|()| wait)
            })
            .collect();
        for wait in acknowledgements {
            let _ = wait.recv();
        }
    }
}

impl Drop for SensorImages {
    fn drop(&mut self) {
        let sensors = std::mem::take(&mut self.sensors);
        let threads: Vec<JoinHandle<()>> = sensors.into_iter().map(|s| s.thread).collect();
        for thread in threads {
            let _ = thread.join();
        }
    }
}

/// The sensors of a device on a camera.
fn on_camera(
    device: &Device,
    (camera, depth_view): (usize, usize),
    camera_name: &str,
) -> Vec<Sensor> {
    let color = device.model.color.as_ref().map(|p| {
        let name = color_name(camera_name);
        let seed = device.seed ^ fnv1a(&name);
        let model = ColorModel::new(p.clone(), seed, device.strength);
        let kind = Kind::Color(Box::new(model));
        (name, seed, kind, [p.rate, p.phase], p.age)
    });
    let depth = device.model.depth.as_ref().map(|p| {
        let name = depth_name(camera_name);
        let seed = device.seed ^ fnv1a(&name);
        let model = DepthModel::new(p.clone(), seed, device.strength);
        let kind = Kind::Depth(Box::new(model));
        (name, seed, kind, [p.rate, p.phase], p.age)
    });
    let all = [color, depth].into_iter().flatten();
    all.map(|(name, seed, kind, [rate, phase], age)| Sensor {
        name,
        camera,
        view: match kind {
            Kind::Color(_) => camera,
            Kind::Depth(_) => depth_view,
        },
        camera_name: camera_name.to_owned(),
        kind,
        seed,
        rate,
        phase,
        age: age.times(device.strength),
        on_way: DelayLine::default(),
        episode: 0,
        last: None,
    })
    .collect()
}

impl Worker {
    fn run(mut self, queue: &Receiver<Job>, making: &AtomicUsize, wakeup: &Wakeup) {
        loop {
            self.publish();
            let job = match self.sensor.on_way.is_empty() {
                false => queue.recv_timeout(LOOK),
                true => queue.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            match job {
                Ok(Job::Make {
                    frame,
                    episode,
                    tick,
                }) => {
                    self.sensor.take(&frame, episode, tick, &self.surfaces);
                    making.fetch_sub(1, Ordering::AcqRel);
                    wakeup.raise();
                }
                Ok(Job::Publish(done)) => {
                    self.publish();
                    // The receiver may have been dropped.
                    let _ = done.send(());
                }
                Ok(Job::Settle(done)) => {
                    self.publish();
                    self.sensor.restart(0);
                    // The receiver may have been dropped.
                    let _ = done.send(());
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Publishes images that have arrived, and drops those of ended episodes.
    fn publish(&mut self) {
        let episode = self.now.episode.load(Ordering::Acquire);
        let tick = self.now.tick.load(Ordering::Acquire);
        let sensor = &mut self.sensor;
        if sensor.episode != episode {
            // Images of an episode that has not been announced here yet wait.
            if sensor.episode < episode {
                sensor.on_way.clear();
            }
            return;
        }
        while let Some((arrival, message)) = sensor.on_way.arrived(tick) {
            self.outbox.sensor(&sensor.name, episode, arrival, message);
        }
    }
}

impl Sensor {
    fn restart(&mut self, episode: u64) {
        self.episode = episode;
        self.last = None;
        self.on_way.clear();
        if let Kind::Color(model) = &mut self.kind {
            model.restart();
        }
    }

    /// Makes an image when one is due by the sensor's clock, and queues it with its
    /// delay.
    fn take(&mut self, frame: &Frame, episode: u64, tick: u64, surfaces: &[Surface]) {
        if self.episode != episode {
            self.restart(episode);
        }
        let seconds = tick as f64 / PHYSICS_HZ as f64;
        let number = ((seconds - self.phase) * self.rate + 1e-9).floor() as i64;
        if self.last.is_some_and(|last| number <= last) {
            return;
        }
        self.last = Some(number);
        let exact = Exact {
            lens: lens(&frame.intrinsics),
            tick,
            rgb: &frame.rgb,
            depth: &frame.depth,
            ids: &frame.ids,
        };
        let mut message = v1::SensorFrame {
            sensor: self.name.clone(),
            camera: self.camera_name.clone(),
            exposure_nanos: stamp_nanos(tick),
            exposure_tick: tick,
            intrinsics: Some(intrinsics(&exact.lens)),
            pose: Some(convert::pose(&frame.world_from_optical)),
            ..v1::SensorFrame::default()
        };
        match &mut self.kind {
            Kind::Color(model) => {
                message.color = model.image(&exact).into();
                message.set_color_format(v1::PixelFormat::Rgb8);
            }
            Kind::Depth(model) => {
                message.depth = model.image(&exact, surfaces).into();
                message.set_depth_format(v1::PixelFormat::DepthMillimetresU16);
            }
        }
        let age = self
            .age
            .ticks(&mut Random::new(self.seed, [tick, u64::MAX - 1]));
        // Each image arrives at its own tick.
        self.on_way.send_after(tick + age, message);
    }
}

fn lens(i: &Intrinsics) -> Lens {
    Lens {
        width: i.width as usize,
        height: i.height as usize,
        focal: [i.fx, i.fy],
        principal: [i.cx, i.cy],
    }
}

fn intrinsics(lens: &Lens) -> v1::Intrinsics {
    v1::Intrinsics {
        width: lens.width as u32,
        height: lens.height as u32,
        fx: lens.focal[0],
        fy: lens.focal[1],
        cx: lens.principal[0],
        cy: lens.principal[1],
    }
}
